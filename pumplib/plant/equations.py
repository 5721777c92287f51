"""Thesis 3.4, 3.5: motor, shaft, pump and application as one right-hand side.

State ``(i_sd, i_sq, i_md, i_mq, omega, q, Q_p)``; inputs: stator voltage, valve, load torque. Sections 3.4
and 3.5 of the thesis are not in the surviving text; the composition is rebuilt from 3.2-3.3 and Newton's law.

    (J + J_Mv) domega/dt = T_e - B omega - T_steady(Q_i, omega) - T_load + K_Q dQ_i/dt,   Q_i = Q_p + q

`reciprocal` = 1 adds what energy conservation asks for and the text leaves out: if a change of flow acts on
the shaft with K_Q dQ/dt, a change of speed acts on the liquid with the pressure K_Q domega/dt.
"""

from typing import NamedTuple

from pumplib.errors import ParameterError
from pumplib.hydraulics.pressure import (
    flow_derivative,
    impeller_pressure,
    impeller_torque,
    leakage_derivative,
)
from pumplib.kernels import inline
from pumplib.machines.parameters import PumpSet
from pumplib.motor.dq import current_derivatives, torque

STATES = ("i_sd", "i_sq", "i_md", "i_mq", "omega", "q", "Q_p")
STATE_UNITS = ("A", "A", "A", "A", "rad/s", "m3/s", "m3/s")


class Coefficients(NamedTuple):
    """What the right-hand side needs, derived once from a `PumpSet`: reciprocals and sums over the stages."""

    r_s: float
    R_r: float  # R_r'
    L_m: float  # L_m'
    inv_L_s: float  # 1 / L_s'
    inv_L_m: float
    z_p: float
    k_T: float  # 3/2 z_p L_m'
    a_h0: float
    a_h1: float
    a_h2: float
    a_t0: float
    a_t1: float
    a_t2: float
    a: float  # share of the total pressure that drives the leakage of one stage
    K_l: float
    inv_K_J: float
    K_c: float
    p_static: float
    K_pipe: float
    inv_K_p: float
    B: float
    K_Q: float
    K_Q_J: float  # K_Q / J
    inv_J: float  # with the liquid, and with the reciprocal coupling solved for domega/dt
    c_Q: float  # dQ_p/dt per domega/dt, zero without the reciprocal term
    c_q: float  # dq/dt per domega/dt
    c_H: float  # pressure per domega/dt


def coefficients(
    machine: PumpSet, *, leakage: bool = True, flow: bool = True, reciprocal: bool = False
) -> Coefficients:
    """Derive the coefficients of the right-hand side.

    Parameters
    ----------
    machine : PumpSet
        Motor, pump and application.
    leakage : bool
        False holds the leakage flow (the simplified model of assumption 3.3.1 when it starts at zero).
    flow : bool
        False holds the pump flow (no hydraulics when it starts at zero).
    reciprocal : bool
        Whether speed changes act back on the liquid; not in the thesis.

    Returns
    -------
    Coefficients

    Raises
    ------
    ParameterError
        If the reciprocal coupling is larger than the inertias allow (no positive kinetic energy).

    References
    ----------
    Thesis (3.7), (3.11), (3.25); 3.3.5 for the stages (reconstructed).
    """
    motor, pump, application = machine.motor, machine.pump, machine.application
    n = pump.stages
    inv_K_p = 1 / application.K_p if flow else 0.0
    inv_K_J = 1 / pump.K_J if leakage else 0.0
    K_Q, a = n * pump.K_Q, pump.a / n
    c_H = K_Q if reciprocal else 0.0
    inertia = machine.inertia - c_H * K_Q * (inv_K_p + a * inv_K_J)
    if inertia <= 0:
        raise ParameterError(
            f"K_Q = {pump.K_Q:g} N m s2/m3 a stage is too large for J = {machine.inertia:g} kg m2 with K_p = "
            f"{application.K_p:g} and K_J = {pump.K_J:g} Pa s2/m3: the liquid's kinetic energy would be negative. "
            "Lower K_Q, raise K_p or K_J, or switch the leakage dynamics or the reciprocal term off."
        )
    return Coefficients(
        r_s=motor.r_s,
        R_r=motor.R_r_prime,
        L_m=motor.L_m_prime,
        inv_L_s=1 / motor.L_s_prime,
        inv_L_m=1 / motor.L_m_prime,
        z_p=float(motor.z_p),
        k_T=1.5 * motor.z_p * motor.L_m_prime,
        a_h0=n * pump.a_h0,
        a_h1=n * pump.a_h1,
        a_h2=n * pump.a_h2,
        a_t0=n * pump.a_t0,
        a_t1=n * pump.a_t1,
        a_t2=n * pump.a_t2,
        a=a,
        K_l=pump.K_l,
        inv_K_J=inv_K_J,
        K_c=pump.K_c,
        p_static=application.p_static,
        K_pipe=application.K_pipe,
        inv_K_p=inv_K_p,
        B=machine.friction,
        K_Q=K_Q,
        K_Q_J=K_Q / inertia,
        inv_J=1 / inertia,
        c_Q=c_H * inv_K_p,
        c_q=c_H * a * inv_K_J,
        c_H=c_H,
    )


@inline
def derivatives(
    i_sd: float, i_sq: float, i_md: float, i_mq: float, omega: float, q: float, Q_p: float,
    v_d: float, v_q: float, K_v: float, T_load: float, c: Coefficients,
) -> tuple[float, float, float, float, float, float, float]:  # fmt: skip
    """Right-hand side of the motor-pump set.

    Parameters
    ----------
    i_sd, i_sq, i_md, i_mq : float
        Stator and magnetising current, A.
    omega, q, Q_p : float
        Shaft speed, rad/s; leakage and pump flow, m3/s.
    v_d, v_q : float
        Stator voltage, V.
    K_v : float
        Valve, Pa s2/m6.
    T_load : float
        Further load torque on the shaft, N m.
    c : Coefficients
        From `coefficients`.

    Returns
    -------
    tuple of float
        Time derivatives in the order of the states.

    References
    ----------
    Thesis (3.7), (3.11), (3.21), (3.25); shaft and application reconstructed.
    """
    di_sd, di_sq, di_md, di_mq = current_derivatives(
        i_sd, i_sq, i_md, i_mq, c.z_p * omega, v_d, v_q, c.r_s, c.R_r, c.L_m, c.inv_L_s, c.inv_L_m
    )
    Q_i = Q_p + q
    pressure = impeller_pressure(Q_i, omega, c.a_h0, c.a_h1, c.a_h2)
    dq = leakage_derivative(q, pressure, c.a, c.K_l, c.inv_K_J)
    dQ = flow_derivative(Q_p, pressure, c.p_static, c.K_c + c.K_pipe + K_v, c.inv_K_p)
    T_e = torque(i_sd, i_sq, i_md, i_mq, c.k_T)
    T_p = impeller_torque(Q_i, omega, c.a_t0, c.a_t1, c.a_t2)
    domega = c.inv_J * (T_e - c.B * omega - T_p - T_load) + c.K_Q_J * (dQ + dq)
    if c.c_H != 0.0:  # a branch that is never taken costs less than two products that are always zero
        dq += c.c_q * domega
        dQ += c.c_Q * domega
    return di_sd, di_sq, di_md, di_mq, domega, dq, dQ
