"""Thesis 4.3.5, 4.4.1: the quantities behind the signal events of a run, from what the observers make of it.

Six signals decide with the sensors for voltage, current, flow and differential pressure:

    yZn   fault coefficient of the motor's observer less its healthy value, 3|g_c - g_0|
    ymc   sideband of the current at supply plus shaft frequency, relative to the current
    yLT   lack of torque below that of the closed valve, N m
    yrT   torque less the map's at the measured flow, N m
    yrH   head less the map's, Pa
    yrTH  torque less the map's at the flow that the head asks for, N m

The sideband is found by turning the current back with the angle of the voltage and with that of the shaft, so it
follows speed and supply. The torque of the load is what the motor gives less what the inertia takes.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pumplib.errors import DataError
from pumplib.observers.residual_kernel import SHUT_OFF
from pumplib.observers.residual_monitor import PumpMonitor, PumpRecord
from pumplib.observers.stator import Estimates
from pumplib.observers.stator_sequences import admittance

Array = NDArray[Any]
SIGNALS = ("yZn", "ymc", "yLT", "yrT", "yrH", "yrTH")
SIGNED = np.array([False, False, False, True, True, True])
"""Which signals have both signs."""
EVERY = 20
"""Rows of the observers a row of the features stands for."""
WINDOW = 0.4
"""Length of the averages of fault coefficient and sideband, s."""
STILL = 0.3
"""Activity below which a signal is read; the thresholds of the residuals rise with it anyhow."""
QUIET = 0.3
"""Rest after which the sideband counts: a moving current has no clean spectrum, s."""
SMOOTH = 5.0
"""Bandwidth of the load torque, 1/s, as that of the residual observers."""
LAG = 0.16
"""Delay of the sideband, s: the current feels a change of the operating point before the activity shows it."""
VOLTAGE_STEP = 0.01
"""Relative change of the voltage's amplitude that counts as a change of the supply."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Features:
    """Signals of a run before any threshold, 50 rows a second.

    Parameters
    ----------
    t : ndarray, shape (n,)
        Time, s.
    values : ndarray, shape (n, 6)
        `SIGNALS`; of yZn the fault coefficient's modulus is in `g`. NaN where the observers say nothing.
    g : complex ndarray, shape (n,)
        Mean fault coefficient.
    unbalance : ndarray, shape (n,)
        Negative sequence of the voltage, share of the positive one.
    leverage : ndarray, shape (n,)
        Change of 3|g_c| per unbalance and per relative error of the believed impedance.
    flux : ndarray, shape (n,)
        Amplitude of the voltage over its angular frequency, V s.
    torque : ndarray, shape (n,)
        Size of the torque, N m.
    activity : ndarray, shape (n,)
        Of the operating point.
    exchange : ndarray, shape (n,)
        Head (Pa) that leakage or clogging takes per N m of torque they move, by the slopes of the maps.
    usable : ndarray of bool, shape (n, 6)
        Whether a signal says something at all.
    rest : ndarray of bool, shape (n, 6)
        Whether besides operating point and supply are at rest for as long as the signal remembers.
    """

    t: Array
    values: Array
    g: Array
    unbalance: Array
    leverage: Array
    flux: Array
    torque: Array
    activity: Array
    exchange: Array
    usable: Array
    rest: Array


def features(found: Estimates, record: PumpRecord, monitor: PumpMonitor) -> Features:
    """Signals of a run.

    Parameters
    ----------
    found : Estimates
        Rows of the motor's observer.
    record : PumpRecord
        The same with pressure and flow, see `pumplib.observers.residual_monitor.pump_record`.
    monitor : PumpMonitor
        Commissioned.

    Returns
    -------
    Features

    Raises
    ------
    DataError
        If the record is shorter than the averages.
    """
    n, dt = len(record.omega), record.dt
    length = round(WINDOW / 2 / dt)
    if n < 4 * length:
        raise DataError(f"features: record of {n * dt:.2f} s; give at least {4 * length * dt:.1f} s.")
    residuals, r, activity, judged, _ = monitor.evaluate(record)
    good = record.side.trusted[:n] & np.isfinite(record.omega)
    omega, T_e = np.where(good, record.omega, 0.0), np.where(good, record.T_e, 0.0)
    side = slice(EVERY - 1, n, EVERY)
    power = found.column("v2")[:n]
    vv = found.column("vv_re")[:n] + 1j * found.column("vv_im")[:n]
    y = (found.column("iv_re")[:n] + 1j * found.column("iv_im")[:n]) / np.maximum(power, 1e-12)
    g = _mean(np.where(good, found.g_c[:n], 0.0), length)
    level = np.sqrt(_mean(power, round(0.1 / dt)))
    slow = np.sqrt(_mean(power, round(0.5 / dt)))
    # four stages: what moves slowly while an operating point settles must not reach the shaft frequency
    short = round(WINDOW / 4 / dt)
    mean = _mean(y, short, 4)
    turned = _mean((y - mean) * np.exp(-1j * dt * np.cumsum(omega)), short, 4)
    sideband = np.abs(turned) / np.maximum(np.abs(mean), 1e-12)
    belief = monitor.belief
    w, Q = residuals["omega"], residuals["Q"]
    lack = belief.B * w + belief.a_t0 * w**2 - _load(omega, T_e, belief.J, dt)
    moving = (activity >= STILL) | (np.abs(level / np.maximum(slow, 1e-9) - 1.0) > VOLTAGE_STEP)
    still = judged & _since(moving | ~good, round((QUIET + LAG) / dt))
    s_H, s_T = 2 * belief.a_h2 * Q - belief.a_h1 * w, belief.a_t1 * w - 2 * belief.a_t2 * Q
    least = 0.1 * belief.a_t1 * np.abs(w)  # towards run-out the torque hardly changes with the flow
    shut_off = (residuals.flag & SHUT_OFF) != 0
    usable = np.column_stack((judged, still, judged, judged, judged, judged & ~shut_off))
    rest = usable & ~moving[:, None]
    omega_s = np.abs(found.omega_s[:n])
    conj_Z = monitor.motor.r_s - 1j * omega_s[side] * monitor.motor.L_ls
    Y_2 = admittance(monitor.motor, -omega_s[side], omega[side] * monitor.motor.z_p)
    zero = np.zeros(n)
    late = round(LAG / dt)
    delayed = np.concatenate((np.zeros(late), sideband[:-late]))
    values = np.column_stack((zero, delayed, lack, -r[:, 1], r[:, 0], -r[:, 2]))
    values[~usable] = np.nan
    return Features(
        t=residuals.t[side], values=values[side], g=g[side],
        unbalance=np.abs(_mean(vv, length))[side] / (2 * np.maximum(level[side] ** 2, 1e-12)),
        leverage=3 * np.abs(conj_Z * Y_2), flux=level[side] / np.maximum(omega_s[side], 1.0),
        torque=np.abs(residuals["T_e"][side]), activity=activity[side],
        exchange=np.maximum(s_H, 0.0)[side] / np.maximum(s_T, least)[side],
        usable=usable[side], rest=rest[side],
    )  # fmt: skip


def _mean(x: Array, length: int, stages: int = 2) -> Array:
    """Moving averages one after the other: a bell-shaped window that ends at the sample; zeros before the record."""
    for _ in range(stages):
        total = np.cumsum(np.concatenate((np.zeros(length, x.dtype), x)))
        # the cumulative sum of the first `length` zeros is zero: sums over the last `length` samples
        x = (total[length:] - total[:-length]) / length
    return x


def _since(event: Array, samples: int) -> Array:
    """True where the event has not been for that many samples, the record's beginning counting as one."""
    last = np.maximum.accumulate(np.where(event, np.arange(len(event)), -1))
    return np.asarray(np.arange(len(event)) - last > samples)


def _load(omega: Array, T_e: Array, J: float, dt: float) -> Array:
    """Torque of the load, low-passed: T_e - J domega/dt without a derivative."""
    from scipy.signal import lfilter

    gain = -math.expm1(-SMOOTH * dt)

    def low(x: Array) -> Array:
        return np.asarray(lfilter([gain], [1.0, gain - 1.0], x, zi=[(1.0 - gain) * x[0]])[0])

    return low(T_e) - J * SMOOTH * (omega - low(omega))
