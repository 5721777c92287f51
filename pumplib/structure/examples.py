"""Thesis 6.2: published models for structural analysis and realization: satellite, three tanks, two motors, and others.

Relations are those of the cited sources, in our notation. Names of the measurements and faults follow the sources.
"""

from __future__ import annotations

from typing import Literal

import sympy as sp

from pumplib.errors import ParameterError
from pumplib.structure.model import StructuralModel, define


def satellite(unknown_input: Literal["velocity", "force"] = "velocity") -> StructuralModel:
    """Satellite in the plane of its orbit, in polar coordinates, with an unknown radial motion.

    Parameters
    ----------
    unknown_input : {"velocity", "force"}
        "velocity": the radial velocity v is an unknown signal. "force": v is a state and the radial force f_r on it is
        unknown. Both have the angular momentum rho^2 omega as the quantity that the unknown does not reach.

    Returns
    -------
    StructuralModel
        Radius rho and angular velocity omega are measured, u_2 is the tangential thrust.

    Raises
    ------
    ParameterError
        If `unknown_input` is another word.

    References
    ----------
    Thesis 1.3, 6.2. C. De Persis and A. Isidori, A geometric approach to nonlinear fault detection and isolation,
    IEEE Trans. Automatic Control 46 (2001).
    """
    if unknown_input not in ("velocity", "force"):
        raise ParameterError(f"satellite: unknown_input = {unknown_input!r}; must be velocity or force.")
    rho, y1 = sp.symbols("rho y1", positive=True)
    omega, v, rho_dot, omega_dot, v_dot, force = sp.symbols("omega v rho_dot omega_dot v_dot f_r", real=True)
    u_1, u_2, y2, f_u = sp.symbols("u_1 u_2 y2 f_u", real=True)
    theta_1, theta_2 = sp.symbols("theta_1 theta_2", positive=True)
    relations = {
        "s1": rho_dot - v,
        "s2": omega_dot + 2 * v * omega / rho - theta_2 * (u_2 + f_u) / rho,
        "m1": y1 - rho,
        "m2": y2 - omega,
    }
    derivatives = {"d1": (rho_dot, rho), "d2": (omega_dot, omega)}
    if unknown_input == "velocity":
        return define(
            "satellite, unknown velocity",
            relations=relations,
            derivatives=derivatives,
            unknown=[rho, omega, v, rho_dot, omega_dot],
            known=[u_2, y1, y2],
            faults=[f_u],
            parameters=[theta_2],
        )
    return define(
        "satellite, unknown force",
        relations=relations | {"s3": v_dot - rho * omega**2 + theta_1 / rho**2 - theta_2 * u_1 - force},
        derivatives=derivatives | {"d3": (v_dot, v)},
        unknown=[rho, omega, v, force, rho_dot, omega_dot, v_dot],
        known=[u_1, u_2, y1, y2],
        faults=[f_u],
        parameters=[theta_1, theta_2],
    )


def three_tanks() -> StructuralModel:
    """Three tanks in a row: pressure of the first, flow between the last two and inflow are measured.

    Returns
    -------
    StructuralModel
        Six faults: of the three valves and of the three balances.

    References
    ----------
    E. Frisk, M. Krysander, D. Jung, A toolbox for analysis and design of model based diagnosis systems for large
    scale models, IFAC World Congress (2017), and its published model.
    """
    p1, p2, p3, q0, q1, q2, q3 = sp.symbols("p1 p2 p3 q0 q1 q2 q3", real=True)
    rates = sp.symbols("p1_dot p2_dot p3_dot", real=True)
    y1, y2, y3, *faults = sp.symbols("y1 y2 y3 fV1 fV2 fV3 fT1 fT2 fT3", real=True)
    V1, V2, V3, T1, T2, T3 = faults
    R1, R2, R3, C1, C2, C3 = sp.symbols("Rv1 Rv2 Rv3 CT1 CT2 CT3", positive=True)
    return define(
        "three tanks",
        relations={
            "e1": -q1 + (p1 - p2) / R1 + V1,
            "e2": -q2 + (p2 - p3) / R2 + V2,
            "e3": -q3 + p3 / R3 + V3,
            "e4": -rates[0] + (q0 - q1) / C1 + T1,
            "e5": -rates[1] + (q1 - q2) / C2 + T2,
            "e6": -rates[2] + (q2 - q3) / C3 + T3,
            "e7": -y1 + p1,
            "e8": -y2 + q2,
            "e9": -y3 + q0,
        },
        derivatives={"e10": (rates[0], p1), "e11": (rates[1], p2), "e12": (rates[2], p3)},
        unknown=[p1, p2, p3, q0, q1, q2, q3, *rates],
        known=[y1, y2, y3],
        faults=faults,
        parameters=[R1, R2, R3, C1, C2, C3],
    )


def dc_motor() -> StructuralModel:
    """Series-wound direct-current motor: current, speed and torque are measured; resistance and sensors may fail.

    Returns
    -------
    StructuralModel

    References
    ----------
    Frisk, Krysander, Jung (2017), published model of the electric motor.
    """
    I, w, T, T_m, T_l, I_dot, w_dot = sp.symbols("I w T Tm Tl I_dot w_dot", real=True)
    V, yi, yw, yT, fR, fi, fw, fT = sp.symbols("V yi yw yT fR fi fw fT", real=True)
    K_a, b, R, J, L = sp.symbols("Ka b R J L", positive=True)
    return define(
        "DC motor",
        relations={
            "e1": -V + I * (R + fR) + L * I_dot + K_a * I * w,
            "e2": -T_m + K_a * I**2,
            "e3": -J * w_dot + T - b * w,
            "e4": -T + T_m - T_l,
            "e5": -yi + I + fi,
            "e6": -yw + w + fw,
            "e7": -yT + T + fT,
        },
        derivatives={"e8": (I_dot, I), "e9": (w_dot, w)},
        unknown=[I_dot, w_dot, I, w, T, T_m, T_l],
        known=[V, yi, yw, yT],
        faults=[fR, fi, fw, fT],
        parameters=[K_a, b, R, J, L],
    )


def induction_motor(*, signs: Literal["published", "physical"] = "published") -> StructuralModel:
    """Induction motor with rotor flux as state: two currents and the speed are measured, the load is unknown.

    Parameters
    ----------
    signs : {"published", "physical"}
        The published model has the speed voltages of both axes with the same sign, under which the flux does not turn;
        "physical" has them with opposite signs. The structure is the same.

    Returns
    -------
    StructuralModel

    Raises
    ------
    ParameterError
        If `signs` is another word.

    References
    ----------
    Frisk, Krysander, Jung (2017), published model of the induction motor; C. De Persis and A. Isidori (2001) for its
    use in fault isolation.
    """
    if signs not in ("published", "physical"):
        raise ParameterError(f"induction_motor: signs = {signs!r}; must be published or physical.")
    turn = 1 if signs == "published" else -1
    i_a, i_b, l_a, l_b, w, q_a, q_b, T_l = sp.symbols("i_a i_b lambda_a lambda_b w q_a q_b Tl", real=True)
    rates = sp.symbols("i_a_dot i_b_dot lambda_a_dot lambda_b_dot w_dot", real=True)
    f_a, f_b, u_a, u_b, y1, y2, y3 = sp.symbols("f_a f_b u_a u_b y1 y2 y3", real=True)
    a, b, c, d, L_M, k, c_f, c_t = sp.symbols("a b c d L_M k c_f c_t", positive=True)
    return define(
        f"induction motor, {signs} signs",
        relations={
            "e1": -q_a + w * l_a,
            "e2": -q_b + w * l_b,
            "e3": -rates[0] - a * i_a + b * c * l_a + b * q_b + d * u_a,
            "e4": -rates[1] - a * i_b + b * c * l_b + turn * b * q_a + d * u_b,
            "e5": -rates[2] + L_M * c * i_a - c * l_a - q_b,
            "e6": -rates[3] + L_M * c * i_b - c * l_b - turn * q_a,
            "e7": -rates[4] - k * c_f * w + k * c_t * (i_a * l_b - i_b * l_a) - k * T_l,
            "e13": -y1 + i_a + f_a,
            "e14": -y2 + i_b + f_b,
            "e15": -y3 + w,
        },
        derivatives={
            "e8": (rates[0], i_a),
            "e9": (rates[1], i_b),
            "e10": (rates[2], l_a),
            "e11": (rates[3], l_b),
            "e12": (rates[4], w),
        },
        unknown=[i_a, i_b, l_a, l_b, w, *rates, q_a, q_b, T_l],
        known=[u_a, u_b, y1, y2, y3],
        faults=[f_a, f_b],
        parameters=[a, b, c, d, L_M, k, c_f, c_t],
    )


def pendulum() -> StructuralModel:
    """Pendulum in Cartesian coordinates, nothing measured: exactly determined, so there is nothing to test.

    Returns
    -------
    StructuralModel

    References
    ----------
    C. C. Pantelides, The consistent initialization of differential-algebraic systems, SIAM J. Scientific and
    Statistical Computing 9 (1988).
    """
    x, y, w, z, T = sp.symbols("x y w z T", real=True)
    rates = sp.symbols("x_dot y_dot w_dot z_dot", real=True)
    g, L = sp.symbols("g L", positive=True)
    return define(
        "pendulum",
        relations={
            "e1": -rates[0] + w,
            "e2": -rates[1] + z,
            "e3": -rates[2] + T * x,
            "e4": -rates[3] + T * y - g,
            "e5": x**2 + y**2 - L**2,
        },
        derivatives={"e6": (rates[0], x), "e7": (rates[1], y), "e8": (rates[2], w), "e9": (rates[3], z)},
        unknown=[*rates, T, x, y, w, z],
        parameters=[g, L],
    )
