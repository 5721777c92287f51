"""Thesis 6.2: nonlinear plants from the literature, each with an unknown input that a state transformation removes."""

import sympy as sp

from pumplib.structure.model import StructuralModel, define


def bioreactor() -> StructuralModel:
    """Continuous stirred bioreactor with an unknown rate of growth.

    The consumption of the substrate S is k times the growth of the biomass X, whatever the kinetics: S + k X does not
    see them.

    Returns
    -------
    StructuralModel
        X and S are measured, the dilution rate D and the substrate in the feed are known.

    References
    ----------
    G. Bastin and D. Dochain, On-line Estimation and Adaptive Control of Bioreactors (1990), section 1.5 and chapter 3.
    """
    X, S, y_X, y_S, D, S_in, k = sp.symbols("X S y_X y_S D S_in k", positive=True)
    X_dot, S_dot, growth, f_D = sp.symbols("X_dot S_dot r f_D", real=True)
    return define(
        "bioreactor",
        relations={
            "b1": X_dot - growth + (D + f_D) * X,
            "b2": S_dot + k * growth - (D + f_D) * (S_in - S),
            "m_X": y_X - X,
            "m_S": y_S - S,
        },
        derivatives={"d1": (X_dot, X), "d2": (S_dot, S)},
        unknown=[X, S, X_dot, S_dot, growth],
        known=[D, S_in, y_X, y_S],
        faults=[f_D],
        parameters=[k],
    )


def stirred_tank() -> StructuralModel:
    """Continuous stirred tank reactor with an exothermic reaction of unknown rate.

    Returns
    -------
    StructuralModel
        Concentration c and temperature Theta are measured; flow over volume D, feed and coolant are known.

    References
    ----------
    O. A. Asbjørnsen and M. Fjeld, Response modes of continuous stirred tank reactors, Chemical Engineering Science 25
    (1970): combinations of the states that the reaction does not see.
    """
    c, Theta, y_c, y_t, D, c_in, T_in, T_c, h, U = sp.symbols("c Theta y_c y_t D c_in T_in T_c h U", positive=True)
    c_dot, Theta_dot, rate, f_U = sp.symbols("c_dot Theta_dot r f_U", real=True)
    return define(
        "stirred tank reactor",
        relations={
            "b1": c_dot - D * (c_in - c) + rate,
            "b2": Theta_dot - D * (T_in - Theta) - h * rate + (U + f_U) * (Theta - T_c),
            "m_c": y_c - c,
            "m_t": y_t - Theta,
        },
        derivatives={"d1": (c_dot, c), "d2": (Theta_dot, Theta)},
        unknown=[c, Theta, c_dot, Theta_dot, rate],
        known=[D, c_in, T_in, T_c, y_c, y_t],
        faults=[f_U],
        parameters=[h, U],
    )


def robot_arm() -> StructuralModel:
    """Planar arm with two joints in the horizontal plane, unknown torque in the first joint.

    The momentum conjugate to the second angle is driven by the second torque only.

    Returns
    -------
    StructuralModel
        Second angle and both speeds are measured, the second torque is known and may fail.

    References
    ----------
    A. De Luca and R. Mattone, Actuator failure detection and isolation using generalized momenta, IEEE Int. Conf.
    Robotics and Automation (2003).
    """
    q, w_1, w_2, q_dot, w_1_dot, w_2_dot = sp.symbols("q w_1 w_2 q_dot w_1_dot w_2_dot", real=True)
    y_q, y_1, y_2, tau_1, tau_2, f_2 = sp.symbols("y_q y_1 y_2 tau_1 tau_2 f_2", real=True)
    a, b, d = sp.symbols("a b d", positive=True)
    coupling = d + b * sp.cos(q)
    return define(
        "robot arm",
        relations={
            "e1": (a + 2 * b * sp.cos(q)) * w_1_dot
            + coupling * w_2_dot
            - b * sp.sin(q) * (2 * w_1 * w_2 + w_2**2)
            - tau_1,
            "e2": coupling * w_1_dot + d * w_2_dot + b * sp.sin(q) * w_1**2 - tau_2 - f_2,
            "e3": q_dot - w_2,
            "m_q": y_q - q,
            "m_1": y_1 - w_1,
            "m_2": y_2 - w_2,
        },
        derivatives={"d1": (q_dot, q), "d2": (w_1_dot, w_1), "d3": (w_2_dot, w_2)},
        unknown=[q, w_1, w_2, q_dot, w_1_dot, w_2_dot, tau_1],
        known=[tau_2, y_q, y_1, y_2],
        faults=[f_2],
        parameters=[a, b, d],
    )


def aircraft() -> StructuralModel:
    """Vertical take-off aircraft in a plane with unknown thrust; the roll moment may fail.

    Returns
    -------
    StructuralModel
        Angle, its rate and both velocities are measured; the moment u_2 is known, eps couples it to the translation.

    References
    ----------
    J. Hauser, S. Sastry, G. Meyer, Nonlinear control design for slightly non-minimum phase systems: application to
    V/STOL aircraft, Automatica 28 (1992). C. De Persis, R. De Santis, A. Isidori, Nonlinear actuator fault detection
    and isolation for a VTOL aircraft, American Control Conference (2001).
    """
    theta, w, v_x, v_z, thrust, u_2, f_2 = sp.symbols("theta w v_x v_z u_1 u_2 f_2", real=True)
    rates = sp.symbols("theta_dot w_dot v_x_dot v_z_dot", real=True)
    y_t, y_w, y_x, y_z = sp.symbols("y_t y_w y_x y_z", real=True)
    eps, g, lam = sp.symbols("eps g lam", positive=True)
    return define(
        "vertical take-off aircraft",
        relations={
            "e1": rates[0] - w,
            "e2": rates[1] - lam * (u_2 + f_2),
            "e3": rates[2] + sp.sin(theta) * thrust - eps * sp.cos(theta) * (u_2 + f_2),
            "e4": rates[3] - sp.cos(theta) * thrust - eps * sp.sin(theta) * (u_2 + f_2) + g,
            "m_t": y_t - theta,
            "m_w": y_w - w,
            "m_x": y_x - v_x,
            "m_z": y_z - v_z,
        },
        derivatives={"d1": (rates[0], theta), "d2": (rates[1], w), "d3": (rates[2], v_x), "d4": (rates[3], v_z)},
        unknown=[theta, w, v_x, v_z, *rates, thrust],
        known=[u_2, y_t, y_w, y_x, y_z],
        faults=[f_2],
        parameters=[eps, g, lam],
    )
