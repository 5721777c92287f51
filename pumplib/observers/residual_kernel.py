"""Thesis 6.6: the pump's residual generators as one compiled loop; a record, a piece or a sample, the same bits."""

import math
from typing import Any, NamedTuple

from pumplib.decide.strict import strict_inline, strict_kernel

COLUMNS = ("r1", "r2", "r3", "r4", "omega", "T_e", "H", "Q", "flag")
N_STATE = 20
UNTRUSTED, SETTLING, ABOVE_MAP, SHUT_OFF = 1, 2, 4, 8


class Generator(NamedTuple):
    """Constants of the loop; SI."""

    a_h0: float
    a_h1: float
    a_h2: float
    a_t0: float
    a_t1: float
    a_t2: float
    B: float
    J: float
    K_Q: float
    k: float  # output injection, 1/s
    keep: float  # exp(-k dt)
    dt: float
    slow: float  # gain of the low-pass that brings every signal to the lag of the slowest sensor
    direct_H: float  # share of a signal passed directly: its sensor's lag over the slowest one's
    direct_Q: float
    smooth: float  # gain of the low-pass of r1
    settle: float  # samples that are flagged after a start
    shut_off: float  # share of the largest head slope below which r3 is off
    steepest: float  # sqrt(a_h1^2 + 4 a_h2 a_h0): largest head slope over speed


@strict_inline
def _fourth_rate(w4: Any, T: Any, H: Any, Q: Any, g: Any) -> Any:
    """Rate of J w4 - K_Q Q: torque balance at the estimated speed, corrected by the pressure."""
    weight = g.k * g.J / (g.a_h1 * Q + 2.0 * g.a_h0 * max(w4, 50.0))
    head = g.a_h0 * w4 * w4 + g.a_h1 * w4 * Q - g.a_h2 * Q * Q
    load = g.B * w4 + g.a_t0 * w4 * w4 + g.a_t1 * w4 * Q - g.a_t2 * Q * Q
    return T - load + weight * (H - head)


@strict_kernel
def run_generator(x: Any, trusted: Any, s: Any, g: Generator, out: Any) -> None:
    """Residuals of a block of samples.

    Parameters
    ----------
    x : ndarray, shape (n, 4)
        Speed (rad/s), torque (N m), differential pressure (Pa), flow (m3/s).
    trusted : ndarray of bool, shape (n,)
        False where the motor's observer does not stand behind speed and torque: the generators start anew after it.
    s : ndarray, shape (20,)
        State; zeros at the start, updated.
    g : Generator
        Constants.
    out : ndarray, shape (n, 9)
        Receives `COLUMNS`; NaN where untrusted.
    """
    running, age = s[0], s[1]
    w, T, low_H = s[2], s[3], s[4]
    r1, z2, z3, w4 = s[5], s[6], s[7], s[8]
    u2, y2, u3, y3 = s[9], s[10], s[11], s[12]
    low_Q, Q_before, u4 = s[13], s[14], s[15]
    share = (1.0 - g.keep) / g.k
    for n in range(x.shape[0]):
        if not trusted[n]:
            running = 0.0
            for c in range(8):
                out[n, c] = math.nan
            out[n, 8] = UNTRUSTED
            continue
        if running == 0.0:
            w, T, low_H, low_Q, age = x[n, 0], x[n, 1], x[n, 2], x[n, 3], 0.0
        else:
            w += g.slow * (x[n, 0] - w)
            T += g.slow * (x[n, 1] - T)
            low_H += g.slow * (x[n, 2] - low_H)
            low_Q += g.slow * (x[n, 3] - low_Q)
        # (own lag s + 1)/(slowest lag s + 1): all signals then lag alike
        H = g.direct_H * x[n, 2] + (1.0 - g.direct_H) * low_H
        Q = g.direct_Q * x[n, 3] + (1.0 - g.direct_Q) * low_Q
        flag = SETTLING if age < g.settle else 0
        gap = H - (g.a_h0 * w * w + g.a_h1 * w * Q - g.a_h2 * Q * Q)
        D = (g.a_h1 * w) ** 2 + 4.0 * g.a_h2 * (g.a_h0 * w * w - H)
        if D < 0.0:
            D = 0.0
            flag |= ABOVE_MAP
        slope = math.sqrt(D)
        Qh = (g.a_h1 * w + slope) / (2.0 * g.a_h2)
        loss = T - g.B * w - g.a_t0 * w * w
        new_u2, new_y2 = loss - g.a_t1 * w * Q + g.a_t2 * Q * Q, g.J * w - g.K_Q * Q
        new_u3, new_y3 = loss - g.a_t1 * w * Qh + g.a_t2 * Qh * Qh, g.J * w - g.K_Q * Qh
        if running == 0.0:
            # residuals start at rest: output injection has settled on the first sample
            r1, z2, z3, w4, running = gap, new_y2 + new_u2 / g.k, new_y3 + new_u3 / g.k, w, 1.0
        else:
            r1 += g.smooth * (gap - r1)
            # z' = u + k (y - z), exact for inputs that are straight lines to second order
            z2 = g.keep * z2 + share * 0.5 * (u2 + new_u2 + g.k * (y2 + new_y2))
            z3 = g.keep * z3 + share * 0.5 * (u3 + new_u3 + g.k * (y3 + new_y3))
            # r4: the speed is not used, pressure corrects it; J w4 - K_Q Q is the state, Heun's rule
            step = g.K_Q * (Q - Q_before)
            guess = w4 + (g.dt * u4 + step) / g.J
            w4 += (0.5 * g.dt * (u4 + _fourth_rate(guess, T, H, Q, g)) + step) / g.J
        u4 = _fourth_rate(w4, T, H, Q, g)
        Q_before = Q
        u2, y2, u3, y3 = new_u2, new_y2, new_u3, new_y3
        r3 = g.k * (y3 - z3)
        if slope < g.shut_off * g.steepest * w:
            flag |= SHUT_OFF
        out[n, 0] = r1
        out[n, 1] = g.k * (y2 - z2)
        out[n, 2] = r3
        out[n, 3] = H - (g.a_h0 * w4 * w4 + g.a_h1 * w4 * Q - g.a_h2 * Q * Q)
        out[n, 4], out[n, 5], out[n, 6], out[n, 7], out[n, 8] = w, T, H, Q, flag
        age += 1.0
    s[0], s[1] = running, age
    s[2], s[3], s[4] = w, T, low_H
    s[5], s[6], s[7], s[8] = r1, z2, z3, w4
    s[9], s[10], s[11], s[12] = u2, y2, u3, y3
    s[13], s[14], s[15] = low_Q, Q_before, u4
