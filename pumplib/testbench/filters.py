"""Thesis 4.4.2, 5.3: what a sensor does to a signal, compiled: filters, sampling, analog errors, conversion.

Lag and anti-alias filter are solved together and exactly for an input that is a straight line between the
points of the simulation. Compiled without fused operations: a record in pieces gives the same bits as a whole.
"""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pumplib.decide.strict import strict_kernel

Array = NDArray[Any]
BLOCK = 2048  # simulation points that pass through all stages while they stay in the cache
PASS, LAG, FULL = 0, 1, 2  # no filter; first-order lag; lag and anti-alias filter
N_FILTER, N_ANALOG, N_MEMORY = 13, 6, 8
NO_FAULT, DRIFT, GAIN, SPIKE, STUCK = 0, 1, 2, 3, 4
CLIP = 4.0  # jitter is cut at this many standard deviations
NEVER = 2**62


def _exponential(matrix: Array) -> Array:
    """Matrix exponential by scaling and Taylor series; the matrices here are 5 by 5 and well scaled."""
    halvings = max(0, math.ceil(math.log2(max(float(np.abs(matrix).sum(axis=1).max()), 1e-300))) + 4)
    small = matrix / 2.0**halvings
    term: Array = np.eye(len(matrix))
    total: Array = np.eye(len(matrix))
    for k in range(1, 16):
        term = term @ small / k
        total = total + term
    for _ in range(halvings):
        total = total @ total
    return total


def filter_coefficients(lag: float, anti_alias: float | None, dt: float) -> tuple[int, Array]:
    """Coefficients of one step of lag and anti-alias filter, exact for a piecewise linear input.

    States are the lag's output x0, the filter's output x1 and its scaled derivative x2:
    x0' = (u - x0)/T, x1' = w x2, x2' = w (x0 - x1 - sqrt(2) x2) with w = 2 pi f.

    Parameters
    ----------
    lag : float
        Time constant T of the lag, s; 0 without.
    anti_alias : float or None
        Cut-off frequency f (-3 dB) of the Butterworth filter of order two, Hz.
    dt : float
        Step of the simulation, s.

    Returns
    -------
    kind : int
        `PASS`, `LAG` or `FULL`.
    coefficients : ndarray, shape (13,)
        A00, A10, A11, A12, A20, A21, A22, then the factors of the input at the start (three) and end (three).

    References
    ----------
    Thesis 4.4.2, 5.3 (test set-up). G. F. Franklin, J. D. Powell and M. Workman, Digital Control of Dynamic
    Systems, first-order hold equivalents.
    """
    out = np.zeros(N_FILTER)
    if anti_alias is None:
        if lag == 0.0:
            return PASS, out
        # the input's share by expm1, exact for short and for long steps
        z = dt / lag
        gone = -math.expm1(-z)
        now = 1.0 - gone / z if z > 1e-3 else z * (0.5 - z * (1 / 6 - z / 24))
        out[[0, 7, 10]] = 1.0 - gone, gone - now, now
        return LAG, out
    # augmented system [x; u; du] over one step: exp gives state transition and response to a ramp
    w = 2 * math.pi * anti_alias * dt
    m = np.zeros((5, 5))
    m[1, 2] = w
    m[2, 1], m[2, 2] = -w, -math.sqrt(2) * w
    if lag > 0.0:
        m[0, 0], m[0, 3] = -dt / lag, dt / lag
        m[2, 0] = w
    else:
        m[2, 3] = w
    m[3, 4] = 1.0
    e = _exponential(m)
    if lag == 0.0:
        e[:, 0] = 0.0
        e[0, 3:] = 0.0
    out[:7] = e[0, 0], e[1, 0], e[1, 1], e[1, 2], e[2, 0], e[2, 1], e[2, 2]
    out[7:10], out[10:] = e[:3, 3] - e[:3, 4], e[:3, 4]
    return FULL, out


@strict_kernel
def _filter(truth, c, n, kind, f, mem, y):  # type: ignore[no-untyped-def]
    """Filter a column into y[2:]; y[0] and y[1] get the two points before."""
    y[0], y[1] = mem[4], mem[5]
    if kind == 0:
        for k in range(n):
            y[k + 2] = truth[k, c]
    elif kind == 1:
        a, b0, b1 = f[0], f[7], f[10]
        x, before = mem[0], mem[3]
        for k in range(n):
            u = truth[k, c]
            x = a * x + (b0 * before + b1 * u)
            before = u
            y[k + 2] = x
        mem[0] = x
    else:
        x0, x1, x2, before = mem[0], mem[1], mem[2], mem[3]
        for k in range(n):
            u = truth[k, c]
            v0 = f[0] * x0 + (f[7] * before + f[10] * u)
            v1 = f[2] * x1 + f[3] * x2 + (f[1] * x0 + (f[8] * before + f[11] * u))
            v2 = f[5] * x1 + f[6] * x2 + (f[4] * x0 + (f[9] * before + f[12] * u))
            x0, x1, x2 = v0, v1, v2
            before = u
            y[k + 2] = x1
        mem[0], mem[1], mem[2] = x0, x1, x2
    mem[3] = truth[n - 1, c]
    mem[4], mem[5] = y[n], y[n + 1]


@strict_kernel
def sensor_block(  # type: ignore[no-untyped-def]
    truth, first, begin, n, sample, m, num, den, kind, filters, analog, jitter, dropout, hold,
    fault, fault_at, fault_value, rate, normals, instants, uniforms, mem, saturated, missing, y, b, out, row,
):  # fmt: skip
    """Take one block of simulation points through all sensors.

    Parameters
    ----------
    truth : ndarray, shape (points, channels)
        True values on the simulation grid.
    first : int
        Index of the block's first point, counted from the start of the run.
    begin, n : int
        First row of `truth` in the block and number of its rows.
    sample, m : int
        Index of the block's first sample from the start of the run, and number of samples.
    num, den : int
        Simulation points between two samples, as a fraction.
    kind, filters : ndarray, shape (channels,) and (channels, 13)
        From `filter_coefficients`.
    analog : ndarray, shape (channels, 6)
        Factor, offset, noise, lowest and highest value, quantisation step.
    jitter, dropout : ndarray, shape (channels,)
        Standard deviation of the instants in simulation points; probability of a lost sample.
    hold : ndarray of bool, shape (channels,)
        Whether a lost sample repeats the last one.
    fault : ndarray of int, shape (channels,)
        `NO_FAULT` or kind of the fault.
    fault_at : ndarray of int, shape (channels, 3)
        First sample of the fault, first one after it, samples between two spikes.
    fault_value : ndarray, shape (channels, 2)
        Size and time of the onset, s.
    rate : float
        Samples a second.
    normals, instants, uniforms : ndarray, shape (channels, m)
        Random numbers of noise, jitter and drop-outs; read where the defect is on.
    mem : ndarray, shape (channels, 8)
        Filter states (3), last input, last two filtered points, last value given out, value before sticking; changed.
    saturated, missing : ndarray of int, shape (channels,)
        Counts; changed.
    y, b : ndarray
        Work space for the filtered points and the samples.
    out : ndarray, shape (samples, channels)
        Receives the values from `row` on.
    row : int
        First row of the block's samples.
    """
    part = truth[begin : begin + n]
    for c in range(truth.shape[1]):
        _filter(part, c, n, kind[c], filters[c], mem[c], y)
        # sampling
        if jitter[c] == 0.0 and den == 1:
            k = sample * num - first + 2
            for i in range(m):
                b[i] = y[k]
                k += num
        else:
            for i in range(m):
                top = ((sample + i) * num + den - 1) // den
                s = float((sample + i) * num - top * den) / den
                if jitter[c] > 0.0:
                    s += jitter[c] * min(max(instants[c, i], -CLIP), CLIP)
                k = top - first
                y0, y1, y2 = y[k + 2], y[k + 1], y[k]
                # parabola through the last three points
                b[i] = y0 + 0.5 * s * ((3.0 * y0 - 4.0 * y1 + y2) + s * (y0 - 2.0 * y1 + y2))
        # transducer: gain, offset, then the faults that act on the analog signal
        factor, offset, sigma = analog[c, 0], analog[c, 1], analog[c, 2]
        for i in range(m):
            b[i] = b[i] * factor + offset
        if fault[c] != NO_FAULT and fault[c] != STUCK:
            for i in range(max(fault_at[c, 0] - sample, 0), min(fault_at[c, 1] - sample, m)):
                j = sample + i
                if fault[c] == DRIFT:
                    b[i] += fault_value[c, 0] * (j / rate - fault_value[c, 1])
                elif fault[c] == GAIN:
                    b[i] *= 1.0 + fault_value[c, 0]
                elif (j - fault_at[c, 0]) % fault_at[c, 2] == 0:
                    b[i] += fault_value[c, 0]
        if sigma > 0.0:
            for i in range(m):
                b[i] += sigma * normals[c, i]
        # converter: saturation, quantisation
        low, high, step = analog[c, 3], analog[c, 4], analog[c, 5]
        if low > -np.inf or high < np.inf:
            count = 0
            for i in range(m):
                v = b[i]
                count += (v > high) | (v < low)
                b[i] = min(max(v, low), high)
            saturated[c] += count
        if step > 0.0:
            inverse = 1.0 / step
            for i in range(m):
                b[i] = np.rint(b[i] * inverse) * step
        if fault[c] == STUCK:
            start, stop = fault_at[c, 0] - sample, fault_at[c, 1] - sample
            for i in range(m):
                if start <= i < stop:
                    if mem[c, 7] != mem[c, 7]:
                        mem[c, 7] = b[i]  # stuck from the first sample on
                    b[i] = mem[c, 7]
                elif i < start and fault_value[c, 0] != fault_value[c, 0]:
                    mem[c, 7] = b[i]
        # transmission: lost samples
        p = dropout[c]
        if p > 0.0:
            for i in range(m):
                if uniforms[c, i] < p:
                    missing[c] += 1
                    b[i] = mem[c, 6] if hold[c] else np.nan
                else:
                    mem[c, 6] = b[i]
        for i in range(m):
            out[row + i, c] = b[i]
