"""Thesis 4.4.2, 5.3: what sensors make of the true signals, in pieces or at once.

The kernel is in `pumplib.testbench.filters`; here are its tables, the random numbers and the bookkeeping.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pumplib.decide.checks import generator
from pumplib.errors import DataError, ParameterError
from pumplib.machines.quantity import Quantity, check_value
from pumplib.testbench.filters import (
    BLOCK,
    CLIP,
    DRIFT,
    GAIN,
    N_ANALOG,
    N_FILTER,
    N_MEMORY,
    NEVER,
    NO_FAULT,
    SPIKE,
    STUCK,
    filter_coefficients,
    sensor_block,
)
from pumplib.testbench.sensors import HYDRAULIC_RATE, FastSignals, Sensor, SensorFault, SensorSet

Array = NDArray[Any]


@dataclass(frozen=True, kw_only=True, eq=False, slots=True)
class SensorState:
    """Where a run of measurements stands; hand it to the next `measure` to go on. It is not changed there.

    Parameters
    ----------
    sensors : tuple of Sensor
        The sensors of the run.
    dt : float
        Step of the simulation, s.
    points : int
        Simulation points seen.
    samples : int
        Samples given out.
    memory : ndarray, shape (channels, 8)
        Filters and last values.
    random : tuple of dict
        Random-number states of the defects that are on.
    saturated, missing : ndarray of int, shape (channels,)
        Samples that were cut to the range, and that were lost, since the start.
    faults : tuple
        Faults of the run.
    """

    sensors: tuple[Sensor, ...]
    dt: float
    points: int
    samples: int
    memory: Array
    random: tuple[Any, ...]
    saturated: Array
    missing: Array
    faults: tuple[tuple[int, SensorFault], ...]


def _ratio(sensors: tuple[Sensor, ...], dt: float) -> Fraction:
    """Simulation points between two samples; every sensor must agree."""
    rates = {sensor.rate for sensor in sensors}
    if len(rates) > 1:
        shown = ", ".join("none" if rate is None else f"{rate:g} Hz" for rate in sorted(rates, key=lambda r: r or 0))
        raise ParameterError(
            f"Sensor.rate: {shown} in one call of measure; measure the sensors of each rate in a call of their own."
        )
    rate = rates.pop()
    if rate is None:
        return Fraction(1)
    exact = 1.0 / (rate * dt)
    ratio = Fraction(exact).limit_denominator(1000)
    if ratio < 1:
        raise ParameterError(
            f"Sensor.rate = {rate:g} Hz: is above the simulation's {1 / dt:g} Hz; lower it or simulate finer."
        )
    if abs(exact - ratio) > 1e-9 * exact:
        raise ParameterError(
            f"Sensor.rate = {rate:g} Hz: is no simple fraction of the simulation's {1 / dt:g} Hz; take a rate such "
            f"as {1 / dt / round(exact):g} Hz."
        )
    return ratio


def _count(points: int, ratio: Fraction) -> int:
    """Samples that are complete after `points` simulation points: sample j needs point ceil(j ratio)."""
    return 0 if points == 0 else (points - 1) * ratio.denominator // ratio.numerator + 1


def _faults(faults: Mapping[int, SensorFault] | None, channels: int) -> tuple[tuple[int, SensorFault], ...]:
    """Faults in the order of their channels, checked."""
    for channel, fault in (faults or {}).items():
        if not isinstance(fault, SensorFault):
            raise ParameterError(f"faults[{channel!r}] = {fault!r}: must be a SensorFault.")
        if isinstance(channel, bool) or not isinstance(channel, int) or not 0 <= channel < channels:
            raise ParameterError(f"faults: channel {channel!r}: must be one of 0 ... {channels - 1}.")
    return tuple(sorted((faults or {}).items(), key=lambda item: item[0]))


def _fault_table(sensors: tuple[Sensor, ...], faults: Mapping[int, SensorFault], rate: float) -> tuple[Array, ...]:
    kinds = {"drift": DRIFT, "gain": GAIN, "spike": SPIKE, "stuck": STUCK}
    n = len(sensors)
    kind, at, value = np.full(n, NO_FAULT), np.full((n, 3), NEVER), np.full((n, 2), np.nan)
    for channel, fault in faults.items():
        kind[channel] = kinds[fault.kind]
        at[channel, 0] = math.ceil(fault.onset * rate - 1e-6)
        if fault.end is not None:
            at[channel, 1] = math.ceil(fault.end * rate - 1e-6)
        if fault.period is not None:
            at[channel, 2] = max(1, round(fault.period * rate))
        value[channel] = (np.nan if fault.size is None else fault.size), fault.onset
    return kind, at, value


def _truth(truth: ArrayLike, sensors: tuple[Sensor, ...]) -> Array:
    try:
        x = np.asarray(truth, dtype=float)
    except (TypeError, ValueError) as error:
        raise DataError(f"truth is not an array of numbers ({error}).") from error
    if x.ndim == 1 and len(sensors) == 1:
        x = x[:, None]
    if x.ndim != 2 or x.shape[1] != len(sensors):
        raise DataError(
            f"truth has shape {x.shape}: must be (points, {len(sensors)}), time first, one column for each sensor."
        )
    if not np.isfinite(x).all():
        k, c = (int(i) for i in np.argwhere(~np.isfinite(x))[0])
        raise DataError(
            f"truth of channel {c} at point {k} is {x[k, c]} {sensors[c].unit}: must be finite; the simulation failed "
            "there."
        )
    return np.ascontiguousarray(x)


def _wanted(sensors: tuple[Sensor, ...]) -> list[tuple[int, int]]:
    """(channel, kind of random numbers) that are needed: 0 noise, 1 jitter, 2 drop-outs."""
    amounts = ((c, (s.noise, s.jitter, s.dropout)) for c, s in enumerate(sensors))
    return [(c, k) for c, three in amounts for k, amount in enumerate(three) if amount > 0]


def measure(
    sensors: Sequence[Sensor],
    truth: ArrayLike,
    dt: float,
    rng: np.random.Generator,
    state: SensorState | None = None,
    *,
    faults: Mapping[int, SensorFault] | None = None,
) -> tuple[Array, SensorState]:
    """Measure true signals with sensors of one sampling rate.

    Order of the defects: lag (exact for a straight line between simulation points), anti-alias filter,
    sampling at t = j/rate plus jitter (parabola through the last three points; jitter cut at four standard
    deviations), gain error, offset, sensor fault, noise, saturation, quantisation, stuck reading, lost samples.
    Before the first point the truth is taken as constant and the filters as settled.

    Random numbers: at the start three seeds a channel are taken from `rng` (noise, jitter, drop-outs; channel
    after channel), each for a stream of its own. So switching on one defect leaves the numbers of all others as
    they were, and a run in pieces is bit for bit the run as a whole. `rng` is not used when `state` is given.

    Parameters
    ----------
    sensors : sequence of Sensor
        One a channel, all of one rate.
    truth : array_like, shape (n, channels) or (n,) for one channel
        True values on the simulation grid, in the sensors' units.
    dt : float
        Step of the simulation, s.
    rng : numpy.random.Generator
        Randomness of the run.
    state : SensorState, optional
        From the piece before; it stays valid, so that a run can be continued twice.
    faults : mapping of int to SensorFault, optional
        Sensor faults by channel, times from the start of the run; given with the first piece.

    Returns
    -------
    values : ndarray, shape (samples, channels)
        Readings; the sample k of the whole run belongs to the time k/rate.
    state : SensorState
        To go on with; holds the counts of saturated and lost samples.

    Raises
    ------
    ParameterError
        If sensors, step or faults are wrong or do not fit each other or the state.
    DataError
        If the truth has the wrong shape or is not finite.

    References
    ----------
    Thesis 4.4.2, 5.3, 6.7, 7.4.
    """
    sensors = tuple(sensors)
    if not sensors or not all(isinstance(sensor, Sensor) for sensor in sensors):
        raise ParameterError("measure.sensors: give one Sensor a channel, at least one.")
    check_value("measure", "dt", dt, Quantity("s", "step of the simulation", 0.0, 1e3, True))
    dt = float(dt)
    ratio = _ratio(sensors, dt)
    longest = max(sensor.jitter for sensor in sensors)
    if longest * CLIP > dt:
        raise ParameterError(
            f"Sensor.jitter = {longest:g} s: must be at most a quarter of the simulation step, {dt / CLIP:g} s; take "
            "less jitter or a coarser grid."
        )
    x = _truth(truth, sensors)
    n, channels = x.shape
    wanted = _wanted(sensors)
    if state is None:
        seeds = generator(rng, "measure").integers(2**63, size=(channels, 3))
        streams = [np.random.SFC64(int(seeds[c, k])) for c, k in wanted]
        told = _faults(faults, channels)
        memory = np.zeros((channels, N_MEMORY))
        if n:
            memory[:, [0, 1, 3, 4, 5]] = x[0][:, None]
        memory[:, 6] = np.nan
        memory[:, 7] = [fault.size if (fault := dict(told).get(c)) and fault.size is not None else np.nan
                        for c in range(channels)]  # fmt: skip
        points, samples = 0, 0
        saturated, missing = np.zeros(channels, dtype=np.int64), np.zeros(channels, dtype=np.int64)
    else:
        if state.sensors != sensors or state.dt != dt:
            raise ParameterError(
                f"measure.state: belongs to other sensors or another step ({state.dt:g} s, now {dt:g} s); start anew "
                "with state=None."
            )
        told = state.faults
        if faults is not None and _faults(faults, channels) != told:
            raise ParameterError(
                "measure.faults: differ from those of the run's start; give them with its first piece."
            )
        streams = []
        for saved in state.random:
            stream = np.random.SFC64(0)
            stream.state = saved
            streams.append(stream)
        memory, points, samples = state.memory.copy(), state.points, state.samples
        saturated, missing = state.saturated.copy(), state.missing.copy()
        if points == 0 and n:
            memory[:, [0, 1, 3, 4, 5]] = x[0][:, None]
    rate = ratio.denominator / (ratio.numerator * dt)
    kind, at, value = _fault_table(sensors, dict(told), rate)
    filters, analog = np.empty((channels, N_FILTER)), np.empty((channels, N_ANALOG))
    kinds = np.empty(channels, dtype=np.int64)
    for c, s in enumerate(sensors):
        kinds[c], filters[c] = filter_coefficients(s.lag, s.anti_alias, dt)
        analog[c] = (1.0 + s.gain_error, s.offset, s.noise, *s.limits, s.resolution)
    jitter = np.array([s.jitter / dt for s in sensors])
    dropout = np.array([s.dropout for s in sensors])
    hold = np.array([s.on_dropout == "hold" for s in sensors])
    numbers = [np.random.Generator(stream) for stream in streams]
    room = _count(BLOCK, ratio) + 1
    random = np.empty((3, channels, room))
    y, b = np.empty(BLOCK + 2), np.empty(room)
    out = np.empty((_count(points + n, ratio) - samples, channels))
    row = 0
    for begin in range(0, n, BLOCK):
        size = min(BLOCK, n - begin)
        m = _count(points + size, ratio) - samples
        for (c, k), one in zip(wanted, numbers, strict=True):
            if k < 2:
                one.standard_normal(out=random[k, c, :m])
            else:
                one.random(out=random[k, c, :m])
        sensor_block(
            x, points, begin, size, samples, m, ratio.numerator, ratio.denominator, kinds, filters, analog, jitter,
            dropout, hold, kind, at, value, rate, random[0], random[1], random[2], memory, saturated, missing, y, b,
            out, row,
        )  # fmt: skip
        points, samples, row = points + size, samples + m, row + m
    after = SensorState(
        sensors=sensors,
        dt=dt,
        points=points,
        samples=samples,
        memory=memory,
        random=tuple(stream.state for stream in streams),
        saturated=saturated,
        missing=missing,
        faults=told,
    )
    return out, after


@dataclass(frozen=True, kw_only=True, eq=False, slots=True)
class SetState:
    """Where the measurements of a `SensorSet` stand.

    Parameters
    ----------
    electrical, hydraulic : SensorState or None
        Of the two groups.
    """

    electrical: SensorState
    hydraulic: SensorState | None


def measure_set(
    sensors: SensorSet,
    truth: Mapping[str, ArrayLike],
    dt: float,
    rng: np.random.Generator,
    state: SetState | None = None,
    *,
    faults: Mapping[str, SensorFault] | None = None,
) -> tuple[FastSignals, SetState]:
    """Measure all signals of a machine; `measure` for the electrical and then for the hydraulic ones.

    Parameters
    ----------
    sensors : SensorSet
        The machine's sensors.
    truth : mapping of str to array_like
        "voltage" and "current", shape (n, 3), V and A; "H" and "Q", shape (n,), Pa and m3/s, where there are
        sensors for them. All on the simulation grid.
    dt : float
        Step of the simulation, s.
    rng : numpy.random.Generator
        Randomness of the run.
    state : SetState, optional
        From the piece before.
    faults : mapping of str to SensorFault, optional
        Sensor faults by the names of `CHANNELS`.

    Returns
    -------
    signals : FastSignals
    state : SetState
        To go on with.

    Raises
    ------
    ParameterError
        If sensors, step, faults or state are wrong.
    DataError
        If a signal is missing, has the wrong shape or is not finite.
    """
    for name in faults or {}:
        if name not in sensors.channels:
            raise ParameterError(f"faults: channel {name!r}: must be one of {', '.join(sensors.channels)}.")
    named = {sensors.channels.index(name): fault for name, fault in (faults or {}).items()}
    wanted = ["voltage", "current", *(name for name in ("H", "Q") if name in sensors.channels)]
    parts = []
    for name in wanted:
        if name not in truth:
            raise DataError(f"truth[{name!r}] is missing; there is a sensor for it.")
        part = np.asarray(truth[name], dtype=float)
        if (part.shape[1:] != (3,)) if name in ("voltage", "current") else (part.ndim != 1):
            need = "(points, 3)" if name in ("voltage", "current") else "(points,)"
            raise DataError(f"truth[{name!r}] has shape {part.shape}: must be {need}, time first.")
        if len(part) != len(np.asarray(truth["voltage"])):
            raise DataError(f"truth[{name!r}] has {len(part)} points, voltage {len(truth['voltage'])}: must agree.")  # type: ignore[arg-type]
        parts.append(part)
    given = faults is not None
    first = state.electrical.samples if state else 0
    values, electrical = measure(
        sensors.electrical, np.hstack(parts[:2]), dt, rng, state.electrical if state else None,
        faults={c: fault for c, fault in named.items() if c < 6} if given else None,
    )  # fmt: skip
    rate = 1 / (float(_ratio(sensors.electrical, dt)) * dt)
    found: dict[str, Array | None] = {"H": None, "Q": None}
    hydraulic, slow_rate, slow_first = None, HYDRAULIC_RATE, 0
    if sensors.hydraulic:
        slow_first = state.hydraulic.samples if state and state.hydraulic else 0
        readings, hydraulic = measure(
            sensors.hydraulic, np.column_stack(parts[2:]), dt, rng, state.hydraulic if state else None,
            faults={c - 6: fault for c, fault in named.items() if c >= 6} if given else None,
        )  # fmt: skip
        found.update(zip(wanted[2:], readings.T, strict=True))
        slow_rate = 1 / (float(_ratio(sensors.hydraulic, dt)) * dt)
    signals = FastSignals(
        rate=rate,
        voltage=values[:, :3],
        current=values[:, 3:],
        hydraulic_rate=slow_rate,
        H=found["H"],
        Q=found["Q"],
        start=first / rate,
        hydraulic_start=slow_first / slow_rate,
    )
    return signals, SetState(electrical=electrical, hydraulic=hydraulic)
