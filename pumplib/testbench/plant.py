"""Thesis 4.4.2, 5.3, 6.7, 7.4: the bench's plant, richer than the model of any observer.

Flux linkages instead of currents, so that the main flux can saturate; winding temperature, iron loss, winding
asymmetry, permeance harmonics; inter-turn and ground faults; head curve with a cubic term, leakage with a lag,
valve lag, check valve; and the hydraulic and mechanical faults as changes of the physics. With every feature
off this is the plant of chapter 3 in other coordinates.
"""

from typing import NamedTuple

from pumplib.hydraulics.pressure import impeller_pressure, impeller_torque
from pumplib.kernels import inline

STATES = ("psi_sd", "psi_sq", "psi_rd", "psi_rq", "omega", "theta", "q", "Q_p", "K_v")
N_STATES = len(STATES)
CAVITATION_TORQUE = 0.45  # share of the head drop that the torque follows with cavitation (assumed)
DRY_TORQUE = 0.93  # the same when the pump runs dry (assumed)


class Constants(NamedTuple):
    """What stays the same during a run; SI, sums over the stages."""

    delta: float  # 1 for a delta-connected stator, 0 for Y
    r_s: float
    r_r: float
    inv_L_ls: float
    inv_L_lr: float
    inv_L_m: float
    sat_0: float  # i_mu = psi_m / L_m (sat_0 + sat_6 (psi / sat_psi)^6)
    sat_6: float
    inv_sat_psi: float
    sat_rotor: float  # 1: the saturation law takes |psi_r|, 0: |psi_m|
    z_p: float
    asym_a: float  # relative deviations of the phase resistances
    asym_b: float
    asym_c: float
    G_fe: float  # iron-loss conductance of a phase, S
    perm_1: float  # permeance harmonics of the shaft angle (eccentricity) and of the slots
    perm_n: float
    slots: float
    kappa_c: float  # uncoupled share of the leakage of two sections of a winding
    L_ls: float
    a_h0: float
    a_h1: float
    a_h2: float
    a_h3: float  # cubic head term, a_h3 Q^3 300 / (omega + 50)
    a_t0: float
    a_t1: float
    a_t2: float
    K_c: float
    leak_a: float  # leakage of (3.25): share of the pressure, loss, inverse inertia ...
    leak_K_l: float
    leak_inv_K_J: float
    leak_gain: float  # ... or gain and inverse lag of q = K sqrt(H), where leak_inv_lag > 0
    leak_inv_lag: float
    p_static: float
    K_pipe: float
    inv_K_p: float
    B: float
    K_Q_J: float
    inv_J: float
    valve_inv_lag: float  # 0: the valve follows its command at once
    check_valve: float  # 1: no flow backwards
    npsh_0: float  # cavitation trigger NPSH_r = npsh_0 + npsh_2 Q^2; 0 switches it off
    npsh_2: float
    npsh_gain: float
    p_vapour: float
    inv_weight: float  # 1 / (rho g)


class Slow(NamedTuple):
    """What changes slowly: operating point, disturbances and faults; constant during a millisecond."""

    valve: float  # command, Pa s2/m6
    load: float  # N m
    r_s: float  # factors of the resistances (temperature)
    r_r: float
    density: float  # factor of pressure and torque
    p_source: float  # Pa
    gamma_a: float  # shorted shares of the turns, signed
    gamma_b: float
    gamma_c: float
    r_f: float  # contact resistance, ohm
    G_ground: float  # conductance from terminal a to ground, S
    K_f: float  # clogging, Pa s2/m6
    dB: float  # rub, N m s
    K_l: float  # leakage fault, m3/s/sqrt(Pa)
    f_c: float  # cavitation
    f_d: float  # dry running
    K_ext: float  # leak in the outlet pipe, m3/s/sqrt(Pa)
    K_in: float  # obstruction of the inlet, Pa s2/m6
    bearing: float  # torque ripple at shaft frequency, N m
    block: float  # brake of a blocked rotor, 1/s


class Point(NamedTuple):
    """Quantities of one instant beside the states."""

    i_d: float  # effective stator current i'
    i_q: float
    ir_d: float
    ir_q: float
    e_d: float  # d psi_s / dt, the voltage of the iron branch
    e_q: float
    drop_d: float  # resistive voltage
    drop_q: float
    T_e: float
    T_p: float
    H_p: float
    Q_ext: float
    f_c: float
    field: float  # 3/2 (i_s dpsi_s + i_r dpsi_r), power into the field and the shaft, W


@inline
def magnetising(size2: float, psi_r2: float, m: float, c: Constants) -> float:
    """Inverse main inductance at the present flux.

    Parameters
    ----------
    size2 : float
        |psi_s/L_ls + psi_r/L_lr|^2, A2.
    psi_r2 : float
        |psi_r|^2, (V s)2.
    m : float
        Permeance factor.
    c : Constants
        Of the machine.

    Returns
    -------
    float
        i_mu / psi_m, 1/H.
    """
    g = m * c.inv_L_m
    if c.sat_6 == 0.0:
        return g * c.sat_0
    scale = c.inv_sat_psi * c.inv_sat_psi
    if c.sat_rotor > 0.5:
        x2 = psi_r2 * scale
        return g * (c.sat_0 + c.sat_6 * x2 * x2 * x2)
    # |psi_m| solves psi (leak + g (sat_0 + sat_6 (psi/sat_psi)^6)) = size. The leakage term dominates, so the
    # equation is nearly linear and Newton's method from the rotor's flux needs two steps.
    leak = c.inv_L_ls + c.inv_L_lr + g * c.sat_0
    size = size2**0.5
    psi = size / (leak + g * c.sat_6 * psi_r2 * psi_r2 * psi_r2 * scale * scale * scale)
    for _ in range(2):
        x2 = psi * psi * scale
        x6 = g * c.sat_6 * x2 * x2 * x2
        psi = (size + 6.0 * x6 * psi) / (leak + 7.0 * x6)
    x2 = psi * psi * scale
    return g * (c.sat_0 + c.sat_6 * x2 * x2 * x2)


@inline
def cavitation(Q_p: float, c: Constants, s: Slow) -> float:
    """Cavitation from too little inlet pressure, added to the prescribed one.

    Parameters
    ----------
    Q_p : float
        Pump flow, m3/s.
    c : Constants
        NPSH the pump needs.
    s : Slow
        Source pressure, inlet obstruction, prescribed cavitation.

    Returns
    -------
    float
        f_c, 0..0.35.
    """
    if c.npsh_0 == 0.0:
        return s.f_c
    needed = c.npsh_0 + c.npsh_2 * Q_p * Q_p
    available = (s.p_source - s.K_in * Q_p * abs(Q_p) - c.p_vapour) * c.inv_weight
    return min(s.f_c + c.npsh_gain * max(0.0, needed - available) / needed, 0.349)


@inline
def rates(
    psi_sd: float, psi_sq: float, psi_rd: float, psi_rq: float, omega: float, cos_t: float, sin_t: float,
    cos_n: float, sin_n: float, q: float, Q_p: float, K_v: float,
    v_d: float, v_q: float, c: Constants, s: Slow,
) -> tuple[tuple[float, float, float, float, float, float, float, float, float], Point]:  # fmt: skip
    """Right-hand side of the bench's plant.

    Parameters
    ----------
    psi_sd, psi_sq, psi_rd, psi_rq : float
        Flux linkages, V s.
    omega : float
        Shaft speed, rad/s.
    cos_t, sin_t, cos_n, sin_n : float
        Of the shaft angle and of its multiple by the number of slots.
    q, Q_p, K_v : float
        Leakage and pump flow, m3/s; valve, Pa s2/m6.
    v_d, v_q : float
        Stator voltage, V.
    c : Constants
        Of the machine.
    s : Slow
        Operating point, disturbances, faults.

    Returns
    -------
    derivatives : tuple of float
        In the order of the states.
    point : Point
        Currents, torque, pressure and the like.
    """
    # motor: currents from flux linkages
    m = 1.0 + c.perm_1 * cos_t + c.perm_n * cos_n
    w_d = psi_sd * c.inv_L_ls + psi_rd * c.inv_L_lr
    w_q = psi_sq * c.inv_L_ls + psi_rq * c.inv_L_lr
    g = magnetising(w_d * w_d + w_q * w_q, psi_rd * psi_rd + psi_rq * psi_rq, m, c)
    share = 1.0 / (c.inv_L_ls + c.inv_L_lr + g)
    psi_md, psi_mq = share * w_d, share * w_q
    i_d, i_q = c.inv_L_ls * (psi_sd - psi_md), c.inv_L_ls * (psi_sq - psi_mq)
    ir_d, ir_q = c.inv_L_lr * (psi_rd - psi_md), c.inv_L_lr * (psi_rq - psi_mq)
    # resistive voltage, with unequal phases: 2/3 sum a_k r_k i_k
    r = c.r_s * s.r_s
    half_q = 0.8660254037844386 * i_q
    i_b, i_c = -0.5 * i_d + half_q, -0.5 * i_d - half_q
    drop_d = r * (i_d + (2.0 * c.asym_a * i_d - c.asym_b * i_b - c.asym_c * i_c) / 3.0)
    drop_q = r * (i_q + 0.5773502691896258 * (c.asym_b * i_b - c.asym_c * i_c))
    k_fe = 1.0 / (1.0 + c.G_fe * r)  # the iron branch lies behind the resistance
    e_d, e_q = k_fe * (v_d - drop_d), k_fe * (v_q - drop_q)
    r_r = c.r_r * s.r_r
    speed = c.z_p * omega
    dr_d, dr_q = -r_r * ir_d - speed * psi_rq, -r_r * ir_q + speed * psi_rd
    T_e = 1.5 * c.z_p * (psi_sd * i_q - psi_sq * i_d)
    if c.perm_1 != 0.0 or c.perm_n != 0.0:
        # the field's energy depends on the angle, so the angle feels a torque
        psi2 = psi_md * psi_md + psi_mq * psi_mq
        x2 = psi2 * c.inv_sat_psi * c.inv_sat_psi
        energy = 1.5 * c.inv_L_m * psi2 * (0.5 * c.sat_0 + 0.125 * c.sat_6 * x2 * x2 * x2)
        T_e += energy * (c.perm_1 * sin_t + c.slots * c.perm_n * sin_n)
    # hydraulics
    f_c = cavitation(Q_p, c, s)
    Q_i = Q_p + q
    ideal = s.density * (
        impeller_pressure(Q_i, omega, c.a_h0, c.a_h1, c.a_h2)
        - (c.a_h3 * Q_i * Q_i * Q_i * 300.0 / (abs(omega) + 50.0) + s.K_f * Q_i * abs(Q_i))
    )
    H_i = ideal * (1.0 - f_c) * (1.0 - s.f_d)
    H_p = H_i - s.density * c.K_c * Q_p * abs(Q_p)
    T_p = s.density * impeller_torque(Q_i, omega, c.a_t0, c.a_t1, c.a_t2)
    T_p *= (1.0 - CAVITATION_TORQUE * f_c) * (1.0 - DRY_TORQUE * s.f_d)
    if c.leak_inv_lag > 0.0:
        dq = c.leak_inv_lag * ((c.leak_gain + s.K_l) * max(H_p, 0.0) ** 0.5 - q)
    else:
        dq = c.leak_inv_K_J * (c.leak_a * H_i - c.leak_K_l * q * abs(q))
    Q_ext = s.K_ext * max(H_p, 0.0) ** 0.5
    Q_a = Q_p - Q_ext
    opening = K_v if c.valve_inv_lag > 0.0 else s.valve
    dQ = c.inv_K_p * (H_p + s.p_source - (c.p_static + s.K_in * Q_p * abs(Q_p) + (opening + c.K_pipe) * Q_a * abs(Q_a)))
    if c.check_valve > 0.5 and Q_p <= 0.0 and dQ < 0.0:
        dQ = 0.0
    domega = (
        c.inv_J * (T_e - (c.B + s.dB) * omega - T_p - s.load - s.bearing * cos_t)
        - s.block * omega
        + c.K_Q_J * (dQ + dq)
    )
    # the rotor's flux changes in its own frame by its resistance only
    field = 1.5 * (i_d * e_d + i_q * e_q - r_r * (ir_d * ir_d + ir_q * ir_q))
    point = Point(i_d, i_q, ir_d, ir_q, e_d, e_q, drop_d, drop_q, T_e, T_p, H_p, Q_ext, f_c, field)
    return (e_d, e_q, dr_d, dr_q, domega, omega, dq, dQ, c.valve_inv_lag * (s.valve - K_v)), point
