"""Thesis 3.5: fixed-step simulation of the right-hand side, one run or many parameter sets at once.

Classical Runge-Kutta of order four. Inputs are given at the start, middle and end of every step, so the
order holds for any smooth input. Both kernels call `derivatives`; nothing about the machine is in here.
"""

from typing import Any

import numpy as np

from pumplib.kernels import inline, kernel
from pumplib.plant.equations import Coefficients, derivatives

N_STATES = 7
LANES = 32  # parameter sets stepped together, so that the compiler can use vector registers
N_COEFFICIENTS = len(Coefficients._fields)


@inline
def rk4_step(
    s0: float, s1: float, s2: float, s3: float, s4: float, s5: float, s6: float,
    d0: float, q0: float, K0: float, T0: float,
    d1: float, q1: float, K1: float, T1: float,
    d2: float, q2: float, K2: float, T2: float,
    h: float, c: Coefficients,
) -> tuple[float, float, float, float, float, float, float]:  # fmt: skip
    """One Runge-Kutta step of the seven states.

    Parameters
    ----------
    s0, s1, s2, s3, s4, s5, s6 : float
        State at the start of the step.
    d0, q0, K0, T0, d1, q1, K1, T1, d2, q2, K2, T2 : float
        Stator voltage (d, q), valve and load torque at start, middle and end of the step.
    h : float
        Step, s.
    c : Coefficients
        Of the machine.

    Returns
    -------
    tuple of float
        State at the end of the step.
    """
    g = 0.5 * h
    a0, a1, a2, a3, a4, a5, a6 = derivatives(s0, s1, s2, s3, s4, s5, s6, d0, q0, K0, T0, c)
    b0, b1, b2, b3, b4, b5, b6 = derivatives(
        s0 + g * a0, s1 + g * a1, s2 + g * a2, s3 + g * a3, s4 + g * a4, s5 + g * a5, s6 + g * a6,
        d1, q1, K1, T1, c,
    )  # fmt: skip
    e0, e1, e2, e3, e4, e5, e6 = derivatives(
        s0 + g * b0, s1 + g * b1, s2 + g * b2, s3 + g * b3, s4 + g * b4, s5 + g * b5, s6 + g * b6,
        d1, q1, K1, T1, c,
    )  # fmt: skip
    f0, f1, f2, f3, f4, f5, f6 = derivatives(
        s0 + h * e0, s1 + h * e1, s2 + h * e2, s3 + h * e3, s4 + h * e4, s5 + h * e5, s6 + h * e6,
        d2, q2, K2, T2, c,
    )  # fmt: skip
    w = h / 6.0
    return (
        s0 + w * (a0 + 2.0 * (b0 + e0) + f0),
        s1 + w * (a1 + 2.0 * (b1 + e1) + f1),
        s2 + w * (a2 + 2.0 * (b2 + e2) + f2),
        s3 + w * (a3 + 2.0 * (b3 + e3) + f3),
        s4 + w * (a4 + 2.0 * (b4 + e4) + f4),
        s5 + w * (a5 + 2.0 * (b5 + e5) + f5),
        s6 + w * (a6 + 2.0 * (b6 + e6) + f6),
    )


@kernel
def run_one(x: Any, v_d: Any, v_q: Any, K_v: Any, T_load: Any, h: float, every: int, c: Coefficients, out: Any) -> None:
    """Simulate one machine; inputs at half steps, the state recorded at every `every`-th step.

    Parameters
    ----------
    x : ndarray, shape (7,)
        Initial state; holds the final state afterwards.
    v_d, v_q, K_v, T_load : ndarray, shape (2 n + 1,)
        Inputs at half steps.
    h : float
        Step, s.
    every : int
        Steps per record.
    c : Coefficients
        Of the machine.
    out : ndarray, shape (n // every, 7)
        Receives the states after steps every, 2 every, ...
    """
    s0, s1, s2, s3, s4, s5, s6 = x[0], x[1], x[2], x[3], x[4], x[5], x[6]
    i = 0
    for row in range(out.shape[0]):
        for _ in range(every):
            s0, s1, s2, s3, s4, s5, s6 = rk4_step(
                s0, s1, s2, s3, s4, s5, s6,
                v_d[i], v_q[i], K_v[i], T_load[i],
                v_d[i + 1], v_q[i + 1], K_v[i + 1], T_load[i + 1],
                v_d[i + 2], v_q[i + 2], K_v[i + 2], T_load[i + 2],
                h, c,
            )  # fmt: skip
            i += 2
        out[row, 0] = s0
        out[row, 1] = s1
        out[row, 2] = s2
        out[row, 3] = s3
        out[row, 4] = s4
        out[row, 5] = s5
        out[row, 6] = s6
    x[0], x[1], x[2], x[3], x[4], x[5], x[6] = s0, s1, s2, s3, s4, s5, s6


@kernel
def derivatives_along(x: Any, v_d: Any, v_q: Any, K_v: Any, T_load: Any, c: Coefficients, out: Any) -> None:
    """Right-hand side at recorded samples.

    Parameters
    ----------
    x : ndarray, shape (n, 7)
        States.
    v_d, v_q, K_v, T_load : ndarray, shape (n,)
        Inputs at the samples.
    c : Coefficients
        Of the machine.
    out : ndarray, shape (n, 7)
        Receives the time derivatives.
    """
    for k in range(x.shape[0]):
        d = derivatives(
            x[k, 0], x[k, 1], x[k, 2], x[k, 3], x[k, 4], x[k, 5], x[k, 6],
            v_d[k], v_q[k], K_v[k], T_load[k], c,
        )  # fmt: skip
        for j in range(N_STATES):
            out[k, j] = d[j]


@kernel
def run_many(x: Any, v_d: Any, v_q: Any, K_v: Any, T_load: Any, h: float, every: int, c: Any, out: Any) -> None:
    """Simulate blocks of `LANES` machines on the same inputs.

    Parameters
    ----------
    x : ndarray, shape (blocks, 7, LANES)
        Initial states; hold the final states afterwards.
    v_d, v_q, K_v, T_load : ndarray, shape (2 n + 1,)
        Inputs at half steps, common to all machines.
    h : float
        Step, s.
    every : int
        Steps per record.
    c : ndarray, shape (blocks, n_coefficients, LANES)
        `Coefficients` of every machine, in their order.
    out : ndarray, shape (blocks, n // every, 7, LANES)
        Receives the states after steps every, 2 every, ...
    """
    # One flat buffer: the compiler then knows that states and coefficients do not overlap.
    b = np.empty((N_STATES + N_COEFFICIENTS) * LANES)
    p = N_STATES * LANES
    for block in range(x.shape[0]):
        for j in range(N_STATES):
            for m in range(LANES):
                b[j * LANES + m] = x[block, j, m]
        for j in range(N_COEFFICIENTS):
            for m in range(LANES):
                b[p + j * LANES + m] = c[block, j, m]
        i = 0
        for row in range(out.shape[1]):
            for _ in range(every):
                d0, q0, K0, T0 = v_d[i], v_q[i], K_v[i], T_load[i]
                d1, q1, K1, T1 = v_d[i + 1], v_q[i + 1], K_v[i + 1], T_load[i + 1]
                d2, q2, K2, T2 = v_d[i + 2], v_q[i + 2], K_v[i + 2], T_load[i + 2]
                for m in range(LANES):
                    s0, s1, s2, s3, s4, s5, s6 = rk4_step(
                        b[m], b[32 + m], b[64 + m], b[96 + m], b[128 + m], b[160 + m], b[192 + m],
                        d0, q0, K0, T0, d1, q1, K1, T1, d2, q2, K2, T2, h,
                        Coefficients(
                            b[p + m], b[p + 32 + m], b[p + 64 + m], b[p + 96 + m], b[p + 128 + m],
                            b[p + 160 + m], b[p + 192 + m], b[p + 224 + m], b[p + 256 + m], b[p + 288 + m],
                            b[p + 320 + m], b[p + 352 + m], b[p + 384 + m], b[p + 416 + m], b[p + 448 + m],
                            b[p + 480 + m], b[p + 512 + m], b[p + 544 + m], b[p + 576 + m], b[p + 608 + m],
                            b[p + 640 + m], b[p + 672 + m], b[p + 704 + m], b[p + 736 + m], b[p + 768 + m],
                            b[p + 800 + m], b[p + 832 + m],
                        ),
                    )  # fmt: skip
                    b[m] = s0
                    b[32 + m] = s1
                    b[64 + m] = s2
                    b[96 + m] = s3
                    b[128 + m] = s4
                    b[160 + m] = s5
                    b[192 + m] = s6
                i += 2
            for j in range(N_STATES):
                for m in range(LANES):
                    out[block, row, j, m] = b[j * LANES + m]
        for j in range(N_STATES):
            for m in range(LANES):
                x[block, j, m] = b[j * LANES + m]
