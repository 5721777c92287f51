"""Thesis 4.4.2, 5.3, 6.7, 7.4: the bench's time loop: supply, plant, short-circuit loop, thermal model.

Steps of 0.1 ms with the classical Runge-Kutta method; slow quantities change once a millisecond (a tick).
The loop current of an inter-turn short is an output of the healthy equations (spec of chapter 5): it is
solved exactly for a parabola of the voltage within a step, so its stiffness does not matter.
"""

import math
from typing import Any, NamedTuple

from pumplib.kernels import inline, kernel
from pumplib.testbench.plant import N_STATES, Constants, Slow, rates

STEPS_PER_TICK = 10
FAST = ("v_a", "v_b", "v_c", "i_a", "i_b", "i_c", "v_0")  # V, A; every step
TICK = (
    "H_p", "Q", "omega", "T_e", "T_p", "Q_p", "q", "i_f", "temperature", "f_c", "K_v", "power", "psi_r", "r_s",
)  # fmt: skip
SQRT3_2 = math.sqrt(3) / 2


class Source(NamedTuple):
    """Wave form of the supply, relative to its fundamental, and what an inverter adds to it."""

    h3_re: float  # third harmonic, zero sequence
    h3_im: float
    h5_re: float  # fifth, negative sequence
    h5_im: float
    h7_re: float  # seventh, positive sequence
    h7_im: float
    dead: float  # voltage lost per phase by the dead time, V
    inv_dead_i: float  # 1 / current at which the loss is full, 1/A
    link: float  # voltage of the inverter's link, V
    carrier: float  # switching frequency, Hz; 0 for a grid


class Thermal(NamedTuple):
    """One-mass thermal model of the winding."""

    inv_C: float  # K/J; 0 holds the temperature
    inv_R: float  # W/K
    ambient: float  # K
    reference: float  # K
    alpha: float  # 1/K


@inline
def source_voltage(
    turns: float, amplitude: float, n_re: float, n_im: float, source: Source
) -> tuple[float, float, float]:
    """Terminal voltage of the supply at one angle.

    Parameters
    ----------
    turns : float
        Angle of the fundamental in turns.
    amplitude : float
        V.
    n_re, n_im : float
        Negative sequence relative to the fundamental.
    source : Source
        Harmonics.

    Returns
    -------
    d, q, zero : float
        V.
    """
    angle = 2.0 * math.pi * turns
    x, y = math.cos(angle), math.sin(angle)
    x2, y2 = x * x - y * y, 2.0 * x * y
    x3, y3 = x2 * x - y2 * y, x2 * y + y2 * x
    x5, y5 = x3 * x2 - y3 * y2, x3 * y2 + y3 * x2
    x7, y7 = x5 * x2 - y5 * y2, x5 * y2 + y5 * x2
    # negative sequences are conjugate: (c z)* turns backwards
    d = x + (n_re * x - n_im * y) + (source.h5_re * x5 - source.h5_im * y5) + (source.h7_re * x7 - source.h7_im * y7)
    q = y - (n_re * y + n_im * x) - (source.h5_re * y5 + source.h5_im * x5) + (source.h7_re * y7 + source.h7_im * x7)
    return amplitude * d, amplitude * q, amplitude * (source.h3_re * x3 - source.h3_im * y3)


@inline
def dead_time(i_d: float, i_q: float, source: Source) -> tuple[float, float]:
    """Voltage that an inverter loses by its dead time, against the direction of each phase current.

    Parameters
    ----------
    i_d, i_q : float
        Terminal current, A.
    source : Source
        Size of the loss.

    Returns
    -------
    d, q : float
        V.
    """
    a = min(1.0, max(-1.0, i_d * source.inv_dead_i))
    b = min(1.0, max(-1.0, (-0.5 * i_d + SQRT3_2 * i_q) * source.inv_dead_i))
    c = min(1.0, max(-1.0, (-0.5 * i_d - SQRT3_2 * i_q) * source.inv_dead_i))
    return source.dead * (2.0 * a - b - c) / 3.0, source.dead * (b - c) * 0.5773502691896258


@inline
def pulse_flux(duty: float, x: float) -> float:
    """Integral of a pulse less its mean, from the start of the switching period.

    The pulse lies in the middle of the period, so that the integral vanishes there and has no mean.

    Parameters
    ----------
    duty : float
        Share of the period with the upper switch closed, 0..1.
    x : float
        Position within the period, 0..1.

    Returns
    -------
    float
        In units of link voltage times period.
    """
    return min(max(x - 0.5 * (1.0 - duty), 0.0), duty) - duty * x


@inline
def ripple(v_a: float, v_b: float, v_c: float, x: float, source: Source) -> tuple[float, float]:
    """Flux ripple of a pulse-width modulated voltage.

    Regular sampling with the zero sequence that centres the three pulses, as in space-vector modulation.

    Parameters
    ----------
    v_a, v_b, v_c : float
        Mean voltages of the period, V.
    x : float
        Position within the switching period, 0..1.
    source : Source
        Link and switching frequency.

    Returns
    -------
    d, q : float
        V s.
    """
    centre = 0.5 * (max(v_a, v_b, v_c) + min(v_a, v_b, v_c))
    a = pulse_flux(0.5 + (v_a - centre) / source.link, x)
    b = pulse_flux(0.5 + (v_b - centre) / source.link, x)
    c = pulse_flux(0.5 + (v_c - centre) / source.link, x)
    unit = source.link / source.carrier
    return unit * (2.0 * a - b - c) / 3.0, unit * (b - c) * 0.5773502691896258


@inline
def stage(
    p_sd: float, p_sq: float, p_rd: float, p_rq: float, w: float, th: float, q: float, Q: float, K: float,
    v_d: float, v_q: float, c: Constants, s: Slow,
) -> tuple[float, float, float, float, float, float, float, float, float]:  # fmt: skip
    """Derivatives with the harmonics of the shaft angle, computed only where a machine has them.

    Parameters
    ----------
    p_sd, p_sq, p_rd, p_rq, w, th, q, Q, K : float
        States.
    v_d, v_q : float
        Stator voltage, V.
    c : Constants
        Of the machine.
    s : Slow
        Operating point, disturbances, faults.

    Returns
    -------
    tuple of float
        In the order of the states.
    """
    if c.perm_1 != 0.0 or c.perm_n != 0.0 or s.bearing != 0.0:
        cos_t, sin_t = math.cos(th), math.sin(th)
        cos_n, sin_n = math.cos(c.slots * th), math.sin(c.slots * th)
    else:
        cos_t, sin_t, cos_n, sin_n = 1.0, 0.0, 1.0, 0.0
    return rates(p_sd, p_sq, p_rd, p_rq, w, cos_t, sin_t, cos_n, sin_n, q, Q, K, v_d, v_q, c, s)[0]


@kernel
def run_bench(
    x: Any, extra: Any, turns: Any, hertz: Any, amplitude: Any, negative: Any, slow: Any, h: float, c: Constants,
    source: Source, thermal: Thermal, fast: Any, tick: Any,
) -> None:  # fmt: skip
    """Simulate the bench and record what sensors can see and what only scoring may.

    Parameters
    ----------
    x : ndarray, shape (9,)
        Initial state; holds the final state afterwards.
    extra : ndarray, shape (2,)
        Loop current, A, and winding temperature, K; updated.
    turns, hertz, amplitude : ndarray, shape (n + 1,)
        Angle (turns), frequency (Hz) and amplitude (V) of the supply at the ticks.
    negative : ndarray, shape (n, 2)
        Negative sequence of the supply, real and imaginary part.
    slow : ndarray, shape (n, 20)
        `Slow` of every tick.
    h : float
        Step, s.
    c : Constants
        Of the machine.
    source : Source
        Wave form.
    thermal : Thermal
        Winding.
    fast : ndarray, shape (10 n, 7)
        Receives terminal voltages, currents and star-point voltage, see `FAST`.
    tick : ndarray, shape (n, 14)
        Receives the quantities of `TICK`.
    """
    s0, s1, s2, s3, s4, s5, s6, s7, s8 = x[0], x[1], x[2], x[3], x[4], x[5], x[6], x[7], x[8]
    i_f, temperature = extra[0], extra[1]
    g, w6 = 0.5 * h, h / 6.0
    span = 1.0 / STEPS_PER_TICK
    # B_v of (3.10): sqrt(3) exp(j pi/6), or 1
    b_d = 1.0 + 0.5 * c.delta
    b_q = SQRT3_2 * c.delta
    # at the switching frequency only the leakage stands against the voltage; |B_v|^2 = 3 in delta
    inv_leak = (1.0 + 2.0 * c.delta) / (1.0 / c.inv_L_ls + 1.0 / (c.inv_L_m + c.inv_L_lr))
    for k in range(slow.shape[0]):
        factor = 1.0 + thermal.alpha * (temperature - thermal.reference)
        s = Slow(
            slow[k, 0], slow[k, 1], slow[k, 2] * factor, slow[k, 3] * factor, slow[k, 4], slow[k, 5],
            slow[k, 6], slow[k, 7], slow[k, 8], slow[k, 9], slow[k, 10], slow[k, 11], slow[k, 12], slow[k, 13],
            slow[k, 14], slow[k, 15], slow[k, 16], slow[k, 17], slow[k, 18], slow[k, 19],
        )  # fmt: skip
        f0, df = hertz[k], (hertz[k + 1] - hertz[k]) * span
        a0, da = amplitude[k], (amplitude[k + 1] - amplitude[k]) * span
        n_re, n_im = negative[k, 0], negative[k, 1]
        # short-circuit loop: L di_f/dt + R i_f = u, in this tick constant
        turned = s.gamma_a + s.gamma_b + s.gamma_c
        sizes = abs(s.gamma_a) + abs(s.gamma_b) + abs(s.gamma_c)
        sigma = sizes - s.gamma_a**2 - s.gamma_b**2 - s.gamma_c**2
        s_0 = (1.0 - c.delta) * turned * turned / 3.0
        loop_L = c.L_ls * (c.kappa_c * sigma + s_0)
        loop_R = s.r_f + c.r_s * s.r_s * (sigma + s_0)
        shorted = sizes > 0.0
        decay, w_0, w_1, w_2 = 0.0, 0.0, 0.0, 1.0
        if shorted and loop_L > 1e-12 * loop_R:
            z = h * loop_R / loop_L
            decay = math.exp(-z)
            # exact for a voltage that is a parabola within the step: integrals of z exp(-z (1 - x)) x^n
            n_0 = -math.expm1(-z)
            n_1 = 1.0 - n_0 / z
            n_2 = 1.0 - 2.0 * n_1 / z
            w_0, w_1, w_2 = n_0 - 3.0 * n_1 + 2.0 * n_2, 4.0 * (n_1 - n_2), 2.0 * n_2 - n_1
        g_d = (2.0 * s.gamma_a - s.gamma_b - s.gamma_c) / 3.0
        g_q = (s.gamma_b - s.gamma_c) * 0.5773502691896258
        copper = 0.0
        supplied = 0.0
        d2, q2, z2 = source_voltage(turns[k], a0, n_re, n_im, source)
        for j in range(STEPS_PER_TICK):
            d0, q0, z0 = d2, q2, z2
            base = turns[k] + h * j * (f0 + 0.5 * df * j)
            f = f0 + df * j
            d1, q1, _ = source_voltage(base + g * (f + 0.25 * df), a0 + da * (j + 0.5), n_re, n_im, source)
            d2, q2, z2 = source_voltage(base + h * (f + 0.5 * df), a0 + da * (j + 1.0), n_re, n_im, source)
            sd0, sq0 = b_d * d0 - b_q * q0, b_d * q0 + b_q * d0
            sd1, sq1 = b_d * d1 - b_q * q1, b_d * q1 + b_q * d1
            sd2, sq2 = b_d * d2 - b_q * q2, b_d * q2 + b_q * d2
            if c.perm_1 != 0.0 or c.perm_n != 0.0 or s.bearing != 0.0:
                ct, st = math.cos(s5), math.sin(s5)
                cn, sn = math.cos(c.slots * s5), math.sin(c.slots * s5)
            else:
                ct, st, cn, sn = 1.0, 0.0, 1.0, 0.0
            (r0, r1, r2, r3, r4, r5, r6, r7, r8), p = rates(
                s0, s1, s2, s3, s4, ct, st, cn, sn, s6, s7, s8, sd0, sq0, c, s
            )
            if source.dead > 0.0:
                # the inverter sees the current at the start of the step
                t_d, t_q = b_d * p.i_d + b_q * p.i_q, b_d * p.i_q - b_q * p.i_d
                l_d, l_q = dead_time(t_d, t_q, source)
                d0, q0 = d0 - l_d, q0 - l_q
                m_d, m_q = b_d * l_d - b_q * l_q, b_d * l_q + b_q * l_d
                sd0, sq0, sd1, sq1, sd2, sq2 = sd0 - m_d, sq0 - m_q, sd1 - m_d, sq1 - m_q, sd2 - m_d, sq2 - m_q
                (r0, r1, r2, r3, r4, r5, r6, r7, r8), p = rates(
                    s0, s1, s2, s3, s4, ct, st, cn, sn, s6, s7, s8, sd0, sq0, c, s
                )
            # what the terminals show at the start of the step
            u0 = 1.5 * (g_d * sd0 + g_q * sq0)
            if shorted and loop_L <= 1e-12 * loop_R:
                i_f = u0 / loop_R
            n_d = p.i_d + g_d * i_f + c.G_fe * p.e_d
            n_q = p.i_q + g_q * i_f + c.G_fe * p.e_q
            o_d, o_q = b_d * n_d + b_q * n_q, b_d * n_q - b_q * n_d  # C_i is the conjugate of B_v
            row = k * STEPS_PER_TICK + j
            v_a, v_b, v_c = d0 + z0, -0.5 * d0 + SQRT3_2 * q0 + z0, -0.5 * d0 - SQRT3_2 * q0 + z0
            fast[row, 0] = v_a
            fast[row, 1] = v_b
            fast[row, 2] = v_c
            supplied += 1.5 * (d0 * o_d + q0 * o_q) + s.G_ground * v_a * v_a  # without the ripple, which carries none
            if source.carrier > 0.0:
                periods = source.carrier * h * row
                l_d, l_q = ripple(v_a, v_b, v_c, periods - math.floor(periods), source)
                o_d, o_q = o_d + inv_leak * l_d, o_q + inv_leak * l_q
            fast[row, 3] = o_d + s.G_ground * v_a
            fast[row, 4] = -0.5 * o_d + SQRT3_2 * o_q
            fast[row, 5] = -0.5 * o_d - SQRT3_2 * o_q
            di_f = (u0 - loop_R * i_f) / loop_L if shorted and loop_L > 1e-12 * loop_R else 0.0
            half = SQRT3_2 * p.i_q
            unequal = c.asym_a * p.i_d + c.asym_b * (half - 0.5 * p.i_d) - c.asym_c * (half + 0.5 * p.i_d)
            r_s = c.r_s * s.r_s
            star = z0 - r_s * unequal / 3.0 + turned / 3.0 * (r_s * i_f + c.L_ls * di_f)
            fast[row, 6] = (1.0 - c.delta) * star
            copper += 1.5 * ((sd0 - p.e_d) * (p.i_d + c.G_fe * p.e_d) + (sq0 - p.e_q) * (p.i_q + c.G_fe * p.e_q))
            copper += loop_R * i_f * i_f
            if j == 0:
                tick[k, 0] = p.H_p
                tick[k, 1] = s7 - p.Q_ext
                tick[k, 2] = s4
                tick[k, 3] = p.T_e
                tick[k, 4] = p.T_p
                tick[k, 5] = s7
                tick[k, 6] = s6
                tick[k, 7] = i_f
                tick[k, 8] = temperature
                tick[k, 9] = p.f_c
                tick[k, 10] = s8 if c.valve_inv_lag > 0.0 else s.valve
                tick[k, 12] = math.sqrt(s2 * s2 + s3 * s3)
                tick[k, 13] = s.r_s
            # the remaining stages of the step
            k0, k1, k2, k3, k4, k5, k6, k7, k8 = stage(
                s0 + g * r0, s1 + g * r1, s2 + g * r2, s3 + g * r3, s4 + g * r4, s5 + g * r5, s6 + g * r6,
                s7 + g * r7, s8 + g * r8, sd1, sq1, c, s,
            )  # fmt: skip
            m0, m1, m2, m3, m4, m5, m6, m7, m8 = stage(
                s0 + g * k0, s1 + g * k1, s2 + g * k2, s3 + g * k3, s4 + g * k4, s5 + g * k5, s6 + g * k6,
                s7 + g * k7, s8 + g * k8, sd1, sq1, c, s,
            )  # fmt: skip
            e0, e1, e2, e3, e4, e5, e6, e7, e8 = stage(
                s0 + h * m0, s1 + h * m1, s2 + h * m2, s3 + h * m3, s4 + h * m4, s5 + h * m5, s6 + h * m6,
                s7 + h * m7, s8 + h * m8, sd2, sq2, c, s,
            )  # fmt: skip
            s0 += w6 * (r0 + 2.0 * (k0 + m0) + e0)
            s1 += w6 * (r1 + 2.0 * (k1 + m1) + e1)
            s2 += w6 * (r2 + 2.0 * (k2 + m2) + e2)
            s3 += w6 * (r3 + 2.0 * (k3 + m3) + e3)
            s4 += w6 * (r4 + 2.0 * (k4 + m4) + e4)
            s5 += w6 * (r5 + 2.0 * (k5 + m5) + e5)
            s6 += w6 * (r6 + 2.0 * (k6 + m6) + e6)
            s7 += w6 * (r7 + 2.0 * (k7 + m7) + e7)
            s8 += w6 * (r8 + 2.0 * (k8 + m8) + e8)
            if c.check_valve > 0.5 and s7 < 0.0:
                s7 = 0.0
            if shorted:
                u1, u2 = 1.5 * (g_d * sd1 + g_q * sq1), 1.5 * (g_d * sd2 + g_q * sq2)
                i_f = decay * i_f + (w_0 * u0 + w_1 * u1 + w_2 * u2) / loop_R
            else:
                i_f = 0.0
        s5 -= 2.0 * math.pi * math.floor(s5 / (2.0 * math.pi))
        tick[k, 11] = supplied * span
        heat = copper * span - thermal.inv_R * (temperature - thermal.ambient)
        temperature += STEPS_PER_TICK * h * thermal.inv_C * heat
    x[0], x[1], x[2], x[3], x[4], x[5], x[6], x[7], x[8] = s0, s1, s2, s3, s4, s5, s6, s7, s8
    extra[0], extra[1] = i_f, temperature


assert N_STATES == 9  # the loop above is written out for nine states
