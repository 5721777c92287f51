"""Thesis 4.4.2, 7.4: the slow signals V_rms, I_rms, omega_e, phi, H, Q that a cheap controller sees.

All six are means over the same window with the same Hann weight, so they belong to one instant, the window's
centre. The electrical ones describe the fundamental of positive sequence at the terminals, phase to neutral:
harmonics, unbalance and offsets of the wave forms are not in them. Positive phi: the current lags.

The angle of the voltage is followed first: frequency from the phase advance of the space vector over 2 ms, then
correction by the phase of Hann windows of 0.2 s. Voltages and currents are then turned back by this angle and
averaged; a taper is needed here, a rectangular window lets the fundamental leak into everything else.

Deviations at 30-50 Hz, measured: below 1e-9 for sinusoids; with unbalance 3 %, harmonics 2 % and offsets 1 %
together below 2e-5 of V_rms and I_rms, 2e-3 rad/s and 1e-6 rad; on V/f ramps of 20 Hz/s, also where a ramp
begins or ends inside the window, below 2e-5, 3e-3 rad/s and 5e-5 rad against the Hann-weighted means of
amplitude, frequency and angle. An angle phi that moves inside the window makes I_rms low by half its variance.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pumplib.errors import DataError
from pumplib.kernels import kernel
from pumplib.machines.quantity import Quantity, check_value
from pumplib.motor.frames import PHASE_AXES
from pumplib.testbench.sensors import FastSignals

Array = NDArray[Any]
_HOP = 0.025  # s between the knots of the angle
_LAG = 0.002  # s over which the phase advance is taken
_SIDE = 4  # hops on each side of a knot


@dataclass(frozen=True, kw_only=True, eq=False, slots=True)
class SlowSignals:
    """Slow signals of a run, time first.

    A delta-connected winding has sqrt(3) V_rms and I_rms/sqrt(3), and the same phi.

    Parameters
    ----------
    t : ndarray, shape (n,)
        Centres of the windows, s.
    V_rms : ndarray, shape (n,)
        Fundamental phase voltage (terminal to neutral), positive sequence, V rms.
    I_rms : ndarray, shape (n,)
        Fundamental line current, positive sequence, A rms.
    omega_e : ndarray, shape (n,)
        Angular frequency of the supply, rad/s; negative if two phases are swapped.
    phi : ndarray, shape (n,)
        Angle from the current to the voltage, rad, in (-pi, pi]; positive where the current lags.
    H, Q : ndarray, shape (n,), or None
        Differential pressure, Pa, and flow, m3/s; None where there is no sensor.
    missing_electrical : ndarray, shape (n,)
        Share of the window's weight in which a voltage or current was missing.
    missing_H, missing_Q : ndarray, shape (n,), or None
        The same for pressure and flow.
    max_missing : float
        Share above which a value is NaN.

    References
    ----------
    Thesis 7.2, 7.4 (the inputs of the steady-state scheme).
    """

    t: Array
    V_rms: Array
    I_rms: Array
    omega_e: Array
    phi: Array
    H: Array | None
    Q: Array | None
    missing_electrical: Array
    missing_H: Array | None
    missing_Q: Array | None
    max_missing: float

    @property
    def rejected(self) -> dict[str, int]:
        """Windows without a value for too many missing samples: "electrical", "H", "Q"."""
        shares = {"electrical": self.missing_electrical, "H": self.missing_H, "Q": self.missing_Q}
        return {k: int((share > self.max_missing).sum()) for k, share in shares.items() if share is not None}

    @property
    def power(self) -> Array:
        """Electrical power of the fundamental, 3 V I cos(phi), W."""
        found: Array = 3.0 * self.V_rms * self.I_rms * np.cos(self.phi)
        return found


@kernel
def advance(v, lag, hop, blocks):  # type: ignore[no-untyped-def]
    """Sums of v[k] conj(v[k-lag]) over blocks of `hop` samples, missing ones left out.

    Parameters
    ----------
    v : complex ndarray, shape (n,)
        Space vector, NaN where missing.
    lag, hop, blocks : int
        Samples between the two, samples a block, number of blocks.

    Returns
    -------
    complex ndarray, shape (blocks,)
    """
    out = np.zeros(blocks, dtype=np.complex128)
    for b in range(blocks):
        re = im = 0.0
        for k in range(max(b * hop, lag), min((b + 1) * hop, v.shape[0])):
            x, y = v[k], v[k - lag]
            p = x.real * y.real + x.imag * y.imag
            q = x.imag * y.real - x.real * y.imag
            if p == p and q == q:
                re += p
                im += q
        out[b] = complex(re, im)
    return out


@kernel
def turn_back(v, i, theta, omega, hop, both, v_out, i_out, rate):  # type: ignore[no-untyped-def]
    """Turn space vectors back by an angle whose frequency is a straight line in every block.

    Parameters
    ----------
    v, i : complex ndarray, shape (n,)
        Voltage and current.
    theta : ndarray, shape (blocks,)
        Angle at the start of the blocks, rad.
    omega : ndarray, shape (blocks, 2)
        Frequency at start and end of the blocks, rad a sample.
    hop : int
        Samples a block.
    both : bool
        Whether the current is turned too.
    v_out, i_out : complex ndarray, shape (n,)
        Receive the turned vectors.
    rate : ndarray, shape (n,)
        Receives the frequency, rad a sample.
    """
    for b in range(theta.shape[0]):
        w = omega[b, 0]
        alpha = (omega[b, 1] - omega[b, 0]) / hop
        r = complex(math.cos(theta[b]), -math.sin(theta[b]))
        s = complex(math.cos(w + 0.5 * alpha), -math.sin(w + 0.5 * alpha))
        z = complex(math.cos(alpha), -math.sin(alpha))
        for k in range(b * hop, min((b + 1) * hop, v.shape[0])):
            v_out[k] = v[k] * r
            if both:
                i_out[k] = i[k] * r
                rate[k] = w + alpha * (k - b * hop)
            r = r * s
            s = s * z


@kernel
def local_means(d, hop, side, blocks):  # type: ignore[no-untyped-def]
    """Hann-weighted means around every block boundary, over `side` blocks on each side.

    The weight 0.5 (1 + cos) is split into sums over the blocks, so that each sample is read once.

    Parameters
    ----------
    d : complex ndarray, shape (n,)
        Signal, NaN where missing.
    hop, side, blocks : int
        Samples a block, blocks on each side, number of blocks.

    Returns
    -------
    mean : complex ndarray, shape (blocks + 1,)
        NaN where less than a quarter of the weight is there.
    """
    part = np.zeros((blocks, 3), dtype=np.complex128)
    mass = np.zeros((blocks, 3))
    cosine, sine = np.empty(hop), np.empty(hop)
    for k in range(hop):
        cosine[k], sine[k] = math.cos(math.pi * k / (side * hop)), math.sin(math.pi * k / (side * hop))
    for b in range(blocks):
        for k in range(b * hop, min((b + 1) * hop, d.shape[0])):
            x = d[k]
            if x == x:
                c, s = cosine[k - b * hop], sine[k - b * hop]
                part[b, 0] += x
                part[b, 1] += x * c
                part[b, 2] += x * s
                mass[b, 0] += 1.0
                mass[b, 1] += c
                mass[b, 2] += s
    out = np.empty(blocks + 1, dtype=np.complex128)
    for b in range(blocks + 1):
        total, weight = 0.0j, 0.0
        for q in range(-side, side):
            if 0 <= b + q < blocks:
                c, s = math.cos(math.pi * q / side), math.sin(math.pi * q / side)
                total += part[b + q, 0] + c * part[b + q, 1] - s * part[b + q, 2]
                weight += mass[b + q, 0] + c * mass[b + q, 1] - s * mass[b + q, 2]
        out[b] = total / weight if weight > 0.25 * side * hop else complex(np.nan, np.nan)
    return out


@kernel
def window_means(v, i, rate, taper, starts, out):  # type: ignore[no-untyped-def]
    """Tapered means of turned voltage, turned current and frequency; a sample counts if both vectors are there.

    Parameters
    ----------
    v, i : complex ndarray, shape (n,)
        Turned space vectors.
    rate : ndarray, shape (n,)
        Frequency.
    taper : ndarray, shape (N,)
        Weights.
    starts : ndarray of int, shape (windows,)
        First samples.
    out : ndarray, shape (windows, 6)
        Receives voltage and current (real, imaginary), frequency, weight that is there.
    """
    for m in range(starts.shape[0]):
        v_d = v_q = i_d = i_q = w = mass = 0.0
        for k in range(taper.shape[0]):
            x, y, g = v[starts[m] + k], i[starts[m] + k], taper[k]
            if x == x and y == y:
                v_d += g * x.real
                v_q += g * x.imag
                i_d += g * y.real
                i_q += g * y.imag
                w += g * rate[starts[m] + k]
                mass += g
        out[m, 0], out[m, 1], out[m, 2], out[m, 3], out[m, 4], out[m, 5] = v_d, v_q, i_d, i_q, w, mass


def _knots(v: Array, rate: float, hop: int, blocks: int) -> tuple[Array, Array]:
    """Angle at the start of every block and frequency at its ends, rad and rad a sample."""
    lag = max(1, round(_LAG * rate))
    sums = np.pad(advance(v, lag, hop, blocks), _SIDE)
    weight = np.cos(np.pi * (np.arange(-_SIDE, _SIDE) + 0.5) / (2 * _SIDE)) ** 2
    around = np.lib.stride_tricks.sliding_window_view(sums, 2 * _SIDE)[: blocks + 1] @ weight
    good = np.flatnonzero(np.abs(around) > 0)
    at = np.arange(blocks + 1)
    if not len(good):
        return np.zeros(blocks), np.zeros((blocks, 2))
    omega = np.interp(at, good, np.angle(around[good]) / lag)
    theta = np.concatenate(([0.0], np.cumsum(0.5 * hop * (omega[1:] + omega[:-1]))))
    ends = np.column_stack((omega[:-1], omega[1:]))
    turned, unused = np.empty_like(v), np.empty(0)
    turn_back(v, v, theta[:-1], ends, hop, False, turned, turned, unused)
    mean = local_means(turned, hop, _SIDE, blocks)
    good = np.flatnonzero(np.isfinite(mean))
    if len(good):
        rest = np.interp(at, good, np.unwrap(np.angle(mean[good])))
        theta = theta + rest
        ends = ends + (np.diff(rest) / hop)[:, None]
    return theta[:-1], ends


def _array(x: ArrayLike | None, name: str, columns: int) -> Array:
    a = np.asarray(x, dtype=float)
    shape = f"(n, {columns})" if columns else "(n,)"
    if a.ndim != (2 if columns else 1) or (columns and a.shape[1] != columns):
        raise DataError(f"FastSignals.{name} has shape {a.shape}: must be {shape}, time first.")
    if np.isinf(a).any():
        raise DataError(f"FastSignals.{name} has infinite values: mark missing samples by NaN.")
    return a


def _mean(x: Array, taper: Array, starts: Array, max_missing: float) -> tuple[Array, Array]:
    rows = np.lib.stride_tricks.sliding_window_view(x, len(taper))[starts]
    there = np.isfinite(rows)
    mass = there @ taper
    missing = np.clip(1.0 - mass / taper.sum(), 0.0, 1.0)
    missing[there.all(axis=1)] = 0.0
    total = np.where(there, rows, 0.0) @ taper
    enough = (missing <= max_missing) & (mass > 0)
    mean = np.full(len(starts), np.nan)
    mean[enough] = total[enough] / mass[enough]
    return mean, missing


def _taper(n: int) -> Array:
    weights: Array = np.sin(np.pi * (np.arange(n) + 0.5) / n) ** 2
    return weights


def slow_signals(
    fast: FastSignals,
    *,
    window: float = 1.0,
    step: float = 1.0,
    max_missing: float = 0.1,
    min_voltage: float = 1.0,
) -> SlowSignals:
    """Slow signals of a run from its measured fast signals; see the module for definition and accuracy.

    Missing samples (NaN) are left out of the means; a sample in which one of the six electrical channels is
    missing is left out for all of them.

    Parameters
    ----------
    fast : FastSignals
        Measured signals; hydraulic ones may be absent.
    window : float
        Length of the windows, s.
    step : float
        Time from window to window, s.
    max_missing : float
        Share of a window's weight that may be missing; its values are NaN above.
    min_voltage : float
        Voltage below which there is no supply, V rms: omega_e and phi are NaN then.

    Returns
    -------
    SlowSignals

    Raises
    ------
    ParameterError
        If a number is outside its limits.
    DataError
        If a signal has the wrong shape, is sampled too slowly or is shorter than a window.

    References
    ----------
    Thesis 7.2, 7.4. F. J. Harris, On the use of windows for harmonic analysis with the discrete Fourier
    transform, Proc. IEEE 66 (1978).
    """
    check_value("slow_signals", "window", window, Quantity("s", "length of a window", 0.2, 3600.0))
    check_value("slow_signals", "step", step, Quantity("s", "time between windows", 0.0, 3600.0, True))
    check_value("slow_signals", "max_missing", max_missing, Quantity("-", "share that may be missing", 0.0, 0.9))
    check_value("slow_signals", "min_voltage", min_voltage, Quantity("V", "least voltage, rms", 0.0, 1e6, True))
    voltage, current = _array(fast.voltage, "voltage", 3), _array(fast.current, "current", 3)
    if len(voltage) != len(current):
        raise DataError(f"FastSignals: {len(voltage)} samples of voltage, {len(current)} of current: must agree.")
    check_value("FastSignals", "rate", fast.rate, Quantity("Hz", "rate of voltages and currents", 1000.0, 1e9))
    n, size = len(voltage), round(window * fast.rate)
    if n < size:
        raise DataError(f"record of {n / fast.rate:g} s: is shorter than a window of {window:g} s; record longer.")
    count = math.floor((n - size) / (step * fast.rate) + 1e-9) + 1
    starts = np.round(np.arange(count) * step * fast.rate).astype(np.int64)
    t = fast.start + (starts + 0.5 * (size - 1)) / fast.rate

    axes = 2 / 3 * PHASE_AXES
    v, i = (voltage @ axes.real) + 1j * (voltage @ axes.imag), (current @ axes.real) + 1j * (current @ axes.imag)
    hop = round(_HOP * fast.rate)
    blocks = -(-n // hop)
    theta, ends = _knots(v, fast.rate, hop, blocks)
    v_turned, i_turned, omega = np.empty_like(v), np.empty_like(i), np.empty(n)
    turn_back(v, i, theta, ends, hop, True, v_turned, i_turned, omega)
    taper = _taper(size)
    sums = np.empty((count, 6))
    window_means(v_turned, i_turned, omega, taper, starts, sums)
    mass = sums[:, 5]
    missing = np.clip(1.0 - mass / taper.sum(), 0.0, 1.0)
    missing[missing < 1e-12] = 0.0
    enough = (missing <= max_missing) & (mass > 0)
    mean = np.full((count, 5), np.nan)
    mean[enough] = sums[enough, :5] / mass[enough, None]
    v_mean, i_mean = mean[:, 0] + 1j * mean[:, 1], mean[:, 2] + 1j * mean[:, 3]
    V_rms, I_rms = np.abs(v_mean) / math.sqrt(2), np.abs(i_mean) / math.sqrt(2)
    omega_e = mean[:, 4] * fast.rate
    # with two phases swapped both vectors turn backwards, and so does the angle between them
    phi = np.angle(v_mean * i_mean.conj()) * np.where(omega_e < 0, -1.0, 1.0)
    dead = ~(V_rms >= min_voltage)
    omega_e[dead], phi[dead] = np.nan, np.nan

    found: dict[str, tuple[Array | None, Array | None]] = {"H": (None, None), "Q": (None, None)}
    for name, signal in (("H", fast.H), ("Q", fast.Q)):
        if signal is None:
            continue
        x = _array(signal, name, 0)
        check_value("FastSignals", "hydraulic_rate", fast.hydraulic_rate, Quantity("Hz", "rate of H and Q", 1.0, 1e9))
        length = round(window * fast.hydraulic_rate)
        # centred on the electrical windows
        first = np.round((t - fast.hydraulic_start) * fast.hydraulic_rate - 0.5 * (length - 1)).astype(np.int64)
        if first[0] < 0 or first[-1] + length > len(x):
            raise DataError(
                f"FastSignals.{name}: covers {fast.hydraulic_start:g} ... "
                f"{fast.hydraulic_start + len(x) / fast.hydraulic_rate:g} s, the windows need more; record all signals "
                "over the same time."
            )
        found[name] = _mean(x, _taper(length), first, max_missing)
    return SlowSignals(
        t=t,
        V_rms=V_rms,
        I_rms=I_rms,
        omega_e=omega_e,
        phi=phi,
        H=found["H"][0],
        Q=found["Q"][0],
        missing_electrical=missing,
        missing_H=found["H"][1],
        missing_Q=found["Q"][1],
        max_missing=max_missing,
    )
