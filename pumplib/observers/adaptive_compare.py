"""Thesis 5.2, 5.3: the adaptive observers compared: sampling interval, convergence, noise, worth of the gain.

Records come from the class itself, except where a resistance is changed on purpose.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from pumplib.errors import SimulationError
from pumplib.machines.parameters import Motor
from pumplib.observers.adaptive import BilinearSystem, DirectObserver, Estimate, FilteredRegressorObserver
from pumplib.observers.adaptive_design import motor_boundary, polytopic_gain
from pumplib.observers.adaptive_examples import motor_speed_and_short
from pumplib.observers.adaptive_study import MotorRecord, motor_record

Array = NDArray[Any]
SPEEDS = (150.0, 340.0)  # electrical speeds of the gains, rad/s
LIMITS = ((100.0, 400.0), (-0.3, 0.3), (-0.3, 0.3))  # of speed and fault term, generous


@dataclass(frozen=True, kw_only=True, slots=True)
class Row:
    """One observer on one record.

    Parameters
    ----------
    method : str
        Observer and gain.
    h : float
        Sampling interval, s.
    slowest : float
        Slowest eigenvalue of the error dynamics over the speeds of the design, 1/s.
    certified : float
        Verified common decay rate over these speeds, 1/s; NaN where there is none.
    speed_settling : float
        Time until the speed stays within 1 rad/s before the fault, s; infinite if it never does.
    short_settling : float
        Time from the fault until g_c stays within 10 %, s; infinite if it does not within the record.
    speed_noise, short_noise : float
        Standard deviation of speed, rad/s, and of g_c, in the last 0.5 s.
    speed_error, short_error : float
        Size of the mean error of speed, rad/s, and of g_c, in the last 0.5 s.
    outcome : str
        "settled", "not settled" or "diverged".
    """

    method: str
    h: float
    slowest: float
    certified: float
    speed_settling: float
    short_settling: float
    speed_noise: float
    short_noise: float
    speed_error: float
    short_error: float
    outcome: str


def _last_outside(t: Array, outside: Array) -> float:
    bad = np.flatnonzero(outside)
    if len(bad) == 0:
        return 0.0
    return math.inf if bad[-1] == len(t) - 1 else float(t[bad[-1] + 1] - t[0])


def score(method: str, record: MotorRecord, found: Estimate | None, slowest: float, certified: float) -> Row:
    """Settling times, noise and errors of one run.

    Parameters
    ----------
    method : str
        Name.
    record : MotorRecord
        The record.
    found : Estimate or None
        What the observer gave; None if it diverged.
    slowest, certified : float
        See `Row`.

    Returns
    -------
    Row
    """
    h = float(record.t[1] - record.t[0])
    if found is None:
        nan = math.nan
        return Row(
            method=method, h=h, slowest=slowest, certified=certified, speed_settling=math.inf,
            short_settling=math.inf, speed_noise=nan, short_noise=nan, speed_error=nan, short_error=nan,
            outcome="diverged",
        )  # fmt: skip
    before, late = record.t < record.t_fault, record.t >= record.t[-1] - 0.5
    after = ~before
    speed = found.theta[:, 0] - record.omega
    short = found.theta[:, 1] + 1j * found.theta[:, 2] - record.g_c
    width = max(1, round(0.02 / h)) if record.noise > 0 else 1  # with noise: mean over 20 ms
    smooth = np.ones(width) / width
    smooth_speed = np.convolve(speed[before], smooth, "valid")
    smooth_short = np.convolve(short[after], smooth, "valid")
    first = _last_outside(record.t[before][width - 1 :], np.abs(smooth_speed) > 1.0) + (width - 1) * h
    second = _last_outside(record.t[after][width - 1 :], np.abs(smooth_short) > 0.1 * abs(record.g_c)) + (width - 1) * h
    return Row(
        method=method, h=h, slowest=slowest, certified=certified, speed_settling=first, short_settling=second,
        speed_noise=float(speed[late].std()), short_noise=float(short[late].std()),
        speed_error=float(abs(speed[late].mean())), short_error=float(abs(short[late].mean())),
        outcome="settled" if math.isfinite(first) and math.isfinite(second) else "not settled",
    )  # fmt: skip


def _try(observer: DirectObserver | FilteredRegressorObserver, record: MotorRecord, start: float) -> Estimate | None:
    try:
        return observer.run(
            record.u, record.y, float(record.t[1] - record.t[0]), x0=[0, 0], theta0=[record.omega - start, 0, 0]
        )
    except SimulationError:
        return None  # the outcome "diverged" is a result here


def _slowest(system: BilinearSystem, K: Array) -> float:
    omega = np.linspace(*SPEEDS, 39)
    theta = np.zeros((len(omega), len(system.names)))
    theta[:, 0] = omega
    full = K if K.ndim == 3 else np.concatenate([K[None], np.zeros((len(system.names), *K.shape))])
    closed = system.system_matrix(theta) - (full[0] + omega[:, None, None] * full[1]) @ system.C
    return float(-np.linalg.eigvals(closed).real.max())


def filtered_row(
    motor: Motor, record: MotorRecord, *, decay_rate: float | None, start: float = 35.0, noise: float = 0.01,
    method: str | None = None,
) -> Row:  # fmt: skip
    """Filtered-regressor observer, state from zero, speed off by `start`.

    Parameters
    ----------
    motor : Motor
        What the observer believes.
    record : MotorRecord
        The record.
    decay_rate : float or None
        Rate asked of the gain, 1/s; None for no gain.
    start : float
        Initial error of the speed, rad/s.
    noise : float
        Variance in the observer, A2.
    method : str, optional
        Name.

    Returns
    -------
    Row
    """
    system = motor_speed_and_short(motor)
    h = float(record.t[1] - record.t[0])
    K, certified = np.zeros((4, 2, 1), complex), math.nan
    if decay_rate is not None:
        gain = polytopic_gain(system, [SPEEDS[0], -1, -1], [SPEEDS[1], 1, 1], h=h, decay_rate=decay_rate)
        K, certified = gain.K, gain.certificate.decay
    observer = FilteredRegressorObserver(
        system=system, K=K, noise=noise, lags=np.array([0.02, 0.1, 0.1]), spread=np.array([30.0, 0.03, 0.03]),
        limits=LIMITS,
    )  # fmt: skip
    name = method or ("filtered regressor, K = 0" if decay_rate is None else f"filtered regressor, {decay_rate:g} 1/s")
    return score(name, record, _try(observer, record, start), _slowest(system, K), certified)


def direct_row(
    motor: Motor, record: MotorRecord, *, k1: float = 200.0, mu: float = 1e-3, speed_rate: float = 1e4,
    short_rate: float = 1e-2, start: float = 35.0,
) -> Row:  # fmt: skip
    """Direct observer with the scheduled boundary gain, and a gradient on the feedthrough for the short.

    Parameters
    ----------
    motor : Motor
        What the observer believes.
    record : MotorRecord
        The record.
    k1, mu : float
        Gain, 1/s, and weight, H2, of `motor_boundary`.
    speed_rate, short_rate : float
        Rates of dw/dt = rate Re(conj(e) (-j L_m'/L_s') i_m) and dg_c/dt = rate e w.
    start : float
        Initial error of the speed, rad/s.

    Returns
    -------
    Row
    """
    system = motor_speed_and_short(motor)
    design = motor_boundary(motor, k1=k1, mu=mu)
    K, F = np.zeros((4, 2, 1), complex), np.zeros((3, 1, 2), complex)
    K[:2], F[0] = design.K, design.F[0]
    observer = DirectObserver(
        system=system, K=K, F=F, G=np.zeros((3, 1, 2)), rates=np.array([speed_rate / mu, short_rate, short_rate]),
        limits=LIMITS,
    )  # fmt: skip
    name = f"direct, k1 {k1:g} 1/s, mu {mu:g}, rates {speed_rate:g} and {short_rate:g}"
    return score(name, record, _try(observer, record, start), _slowest(system, K), math.nan)


def compare_observers(motor: Motor) -> tuple[Row, ...]:
    """Direct law against filtered regressor on the nominal record, at several sampling intervals.

    Parameters
    ----------
    motor : Motor
        The motor.

    Returns
    -------
    tuple of Row
        Direct at 20 us, 100 us (two sets of rates) and 500 us (eight sets); filtered at 100, 200 and 500 us.
    """
    record = motor_record(motor, unbalance=0.0)
    coarse, coarser, coarsest = record.every(5), record.every(10), record.every(25)
    rows = [
        direct_row(motor, record),
        direct_row(motor, coarse),
        direct_row(motor, coarse, speed_rate=1e3, short_rate=1e-3),
    ]
    for k1 in (50.0, 200.0):
        for speed_rate in (1e3, 1e4):
            for short_rate in (1e-3, 1e-2):
                rows.append(direct_row(motor, coarsest, k1=k1, speed_rate=speed_rate, short_rate=short_rate))
    rows += [filtered_row(motor, one, decay_rate=60.0) for one in (coarse, coarser, coarsest)]
    return tuple(rows)


def gain_value(
    motor: Motor, rng: Generator, *, rates: Sequence[float] = (60.0, 160.0, 400.0), noise: float = 0.05,
    hot: float = 1.1,
) -> tuple[tuple[Row, Row], ...]:  # fmt: skip
    """What the matrix-inequality gain is worth: convergence, noise and a wrong resistance for several gains.

    Parameters
    ----------
    motor : Motor
        The motor.
    rng : numpy.random.Generator
        Source of the noise.
    rates : sequence of float
        Decay rates of the gains, 1/s.
    noise : float
        Standard deviation of a real part of the current, A.
    hot : float
        Factor of the true stator resistance in the second record.

    Returns
    -------
    tuple of (Row, Row)
        For no gain, each gain and the direct law (at its 20 us): on the nominal noisy record, and on one of a motor
        with the changed resistance.
    """
    records = []
    for factor in (1.0, hot):
        record = motor_record(replace(motor, r_s=motor.r_s * factor), noise=noise, rng=rng)
        # the observer filters the voltage with what it believes
        if factor != 1.0:
            record = replace(record, u=motor_record(motor).u)
        records.append(record)
    found = []
    for rate in (None, *rates):
        first, second = (filtered_row(motor, one.every(5), decay_rate=rate) for one in records)
        found.append((first, second))
    first, second = (direct_row(motor, one) for one in records)
    found.append((first, second))
    return tuple(found)
