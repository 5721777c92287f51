"""Thesis 4.4.2, 5.3: sensors as data sheets describe them, and what they make of the true signals.

The defects act in the order of the signal's way: first-order lag of the transducer, anti-alias filter, sampling
at jittering instants, gain error, offset, noise, saturation, quantisation, lost samples. With all of them off
the sensor gives back the truth.

Gain errors and offsets belong to a machine: they are drawn once (`draw`, `sensor_set`) and stay for all its
runs. Noise, jitter and drop-outs belong to a run: `measure` gets a generator for them.
"""

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pumplib.decide.checks import generator, one_of
from pumplib.errors import DataError, ParameterError
from pumplib.machines.quantity import Choice, Parameters, Quantity, check_value, quantities
from pumplib.machines.units import si_unit
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

Array = NDArray[Any]
Accuracy = Literal["A", "B"]
CLASSES: dict[str, float] = {"A": 0.005, "B": 0.01}
"""Largest gain error of the accuracy classes of voltage and current probes."""
ELECTRICAL_RATE = 10_000.0  # Hz, of voltages and currents where a profile gives none
HYDRAULIC_RATE = 1_000.0  # Hz, of pressure and flow where a profile gives none
CHANNELS = ("v_a", "v_b", "v_c", "i_a", "i_b", "i_c", "H", "Q")
_UNIT = "unit of the reading"


@dataclass(frozen=True, kw_only=True, slots=True)
class Sensor(Parameters):
    """One sensor of one machine; a defect whose field keeps its default is absent.

    The converter's highest code lies one `resolution` below the full scale, as in data sheets: a symmetric
    converter of 12 bit has the codes -2048 ... 2047.

    References
    ----------
    Thesis 4.4.2, 5.3, 6.7, 7.4 (test set-ups); the defects are those of data sheets.
    """

    unit: str
    full_scale: Annotated[float, Quantity(_UNIT, "largest value", 0.0, math.inf, True)] | None = None
    sides: Annotated[Literal["both", "positive"], Choice("range, +-full scale or 0 ... full scale",
                                                         ("both", "positive"))] = "both"  # fmt: skip
    gain_error: Annotated[
        float, Quantity("-", "relative gain error", -1.0, 10.0, True, "Write 0.005 for 0.5 %.")
    ] = 0.0  # fmt: skip
    offset: Annotated[float, Quantity(_UNIT, "offset", -math.inf)] = 0.0
    lag: Annotated[float, Quantity("s", "time constant of the first-order lag", 0.0, 1e3)] = 0.0
    anti_alias: Annotated[
        float,
        Quantity("Hz", "cut-off of the anti-alias filter", 0.0, 1e9, True, "Leave it out (None) for no filter."),
    ] | None = None  # fmt: skip
    rate: Annotated[
        float, Quantity("Hz", "samples a second", 0.0, 1e9, True, "Leave it out (None) for every simulation point.")
    ] | None = None  # fmt: skip
    jitter: Annotated[float, Quantity("s", "standard deviation of the sampling instants", 0.0, 1.0)] = 0.0
    noise: Annotated[float, Quantity(_UNIT, "standard deviation of the noise of a sample")] = 0.0
    resolution: Annotated[float, Quantity(_UNIT, "quantisation step")] = 0.0
    dropout: Annotated[
        float, Quantity("-", "probability that a sample is lost", 0.0, 1.0, False, "Write 0.01 for 1 %.")
    ] = 0.0  # fmt: skip
    on_dropout: Annotated[Literal["nan", "hold"], Choice("value in place of a lost sample", ("nan", "hold"))] = "nan"

    def __post_init__(self) -> None:
        if not isinstance(self.unit, str) or si_unit(self.unit) != self.unit:
            raise ParameterError(
                f"Sensor.unit = {self.unit!r}: must be an SI unit of pumplib.machines.units; convert the data "
                "sheet's numbers with to_si."
            )
        # first with the sensor's own unit, so that an error shows it
        for name, rule in quantities(Sensor).items():
            value = getattr(self, name)
            if isinstance(rule, Quantity) and rule.unit == _UNIT and not (value is None and name == "full_scale"):
                check_value("Sensor", name, value, replace(rule, unit=self.unit))
        Parameters.__post_init__(self)

    def _check_together(self) -> None:
        if self.full_scale is not None and self.resolution >= self.full_scale:
            raise ParameterError(
                f"Sensor.resolution = {self.resolution:g} {self.unit}: must be smaller than full_scale = "
                f"{self.full_scale:g} {self.unit}; give one step, not the range."
            )
        if self.rate is not None and self.jitter * self.rate > 0.1:
            raise ParameterError(
                f"Sensor.jitter = {self.jitter:g} s at {self.rate:g} Hz: must be at most a tenth of the sampling "
                f"interval, {0.1 / self.rate:g} s; check the unit (microseconds?)."
            )

    @classmethod
    def converter(
        cls, *, unit: str, full_scale: float, bits: int, noise_lsb: float = 0.0, sides: str = "both", **others: Any
    ) -> "Sensor":
        """Return a sensor whose resolution and noise are given by its analog-to-digital converter.

        Parameters
        ----------
        unit : str
            Unit of the reading.
        full_scale : float
            Largest value.
        bits : int
            Number of bits; the range is divided into 2^bits steps.
        noise_lsb : float
            Standard deviation of the noise in steps.
        sides : {"both", "positive"}
            Range.
        **others : object
            Further fields of `Sensor`.

        Returns
        -------
        Sensor

        Raises
        ------
        ParameterError
            If a value is outside its limits.
        """
        check_value("Sensor", "bits", bits, Quantity("-", "bits of the converter", 1, 32), whole=True)
        check_value("Sensor", "noise_lsb", noise_lsb, Quantity("-", "noise in steps", 0.0, 1e6))
        check_value("Sensor", "full_scale", full_scale, Quantity(unit, "largest value", 0.0, math.inf, True))
        step = (2.0 if sides == "both" else 1.0) * full_scale / 2 ** int(bits)
        return cls(
            unit=unit, full_scale=full_scale, sides=sides, resolution=step, noise=noise_lsb * step, **others  # type: ignore[arg-type]
        )  # fmt: skip

    @property
    def limits(self) -> tuple[float, float]:
        """Lowest and highest reading, in `unit`."""
        if self.full_scale is None:
            return -math.inf, math.inf
        low = -self.full_scale if self.sides == "both" else 0.0
        if self.resolution == 0.0:
            return low, self.full_scale
        step = self.resolution
        codes = math.floor(self.full_scale / step * (1 + 1e-12))
        return (-codes * step if self.sides == "both" else 0.0), (codes - 1) * step


@dataclass(frozen=True, kw_only=True, slots=True)
class SensorSpread(Parameters):
    """A type of sensor: what all machines have in common, and the ranges of gain error and offset.

    Parameters
    ----------
    sensor : Sensor
        The type; its own gain error and offset are replaced by `draw`.
    gain_error : tuple of float
        Smallest and largest gain error, uniform between them.
    offset : tuple of float
        Smallest and largest offset, in the sensor's unit.
    offset_draw : {"uniform", "ends"}
        Offset uniform between the two, or one of the two with equal probability.
    """

    sensor: Sensor
    gain_error: Annotated[tuple[float, float], Quantity("-", "range of the gain error", -1.0, 10.0, True)] = (0.0, 0.0)
    offset: Annotated[tuple[float, float], Quantity(_UNIT, "range of the offset", -math.inf)] = (0.0, 0.0)
    offset_draw: Annotated[Literal["uniform", "ends"], Choice("how the offset is drawn", ("uniform", "ends"))] = (
        "uniform"
    )

    def _check_together(self) -> None:
        if not isinstance(self.sensor, Sensor):
            raise ParameterError(f"SensorSpread.sensor = {self.sensor!r}: must be a Sensor.")
        for name, unit in (("gain_error", "-"), ("offset", self.sensor.unit)):
            span = getattr(self, name)
            if not isinstance(span, tuple) or len(span) != 2 or span[0] > span[1]:
                raise ParameterError(
                    f"SensorSpread.{name} = {span!r} {unit}: must be (smallest, largest); swap them or give both."
                )


def draw(spread: SensorSpread, rng: np.random.Generator) -> Sensor:
    """Draw the sensor of one machine from its type.

    Two random numbers are taken, for the gain and for the offset, also where a range is empty.

    Parameters
    ----------
    spread : SensorSpread
        The type.
    rng : numpy.random.Generator
        Randomness of the machine.

    Returns
    -------
    Sensor

    Raises
    ------
    ParameterError
        If `rng` is not a generator.
    """
    part = generator(rng, "draw").random(2)
    low, high = spread.offset
    share = part[1] if spread.offset_draw == "uniform" else float(part[1] >= 0.5)
    gain = spread.gain_error[0] + (spread.gain_error[1] - spread.gain_error[0]) * part[0]
    return replace(spread.sensor, gain_error=float(gain), offset=float(low + (high - low) * share))


def _probe(unit: str, full_scale: float, accuracy: str, rate: float, anti_alias: float | None) -> SensorSpread:
    one_of("probe", "accuracy", accuracy, tuple(CLASSES))
    gain, offset = CLASSES[accuracy], 0.005 * full_scale
    sensor = Sensor.converter(
        unit=unit, full_scale=full_scale, bits=12, noise_lsb=1.0, rate=rate, anti_alias=anti_alias
    )
    return SensorSpread(sensor=sensor, gain_error=(-gain, gain), offset=(-offset, offset), offset_draw="ends")


def voltage_probe(
    accuracy: Accuracy = "A", *, rate: float = ELECTRICAL_RATE, anti_alias: float | None = None
) -> SensorSpread:
    """Phase-voltage probe: +-600 V, 12 bit, noise 1 LSB rms, offset +-0.5 % of full scale.

    Parameters
    ----------
    accuracy : {"A", "B"}
        Gain error within 0.5 % or 1 %.
    rate : float
        Samples a second, Hz.
    anti_alias : float, optional
        Cut-off of the anti-alias filter, Hz.

    Returns
    -------
    SensorSpread

    Raises
    ------
    ParameterError
        If the class is unknown or a value outside its limits.
    """
    return _probe("V", 600.0, accuracy, rate, anti_alias)


def current_probe(
    accuracy: Accuracy = "A", *, rate: float = ELECTRICAL_RATE, anti_alias: float | None = None
) -> SensorSpread:
    """Line-current probe: +-20 A, 12 bit, noise 1 LSB rms, offset +-0.5 % of full scale.

    Parameters
    ----------
    accuracy : {"A", "B"}
        Gain error within 0.5 % or 1 %.
    rate : float
        Samples a second, Hz.
    anti_alias : float, optional
        Cut-off of the anti-alias filter, Hz.

    Returns
    -------
    SensorSpread

    Raises
    ------
    ParameterError
        If the class is unknown or a value outside its limits.
    """
    return _probe("A", 20.0, accuracy, rate, anti_alias)


def pump_current_sensor(*, rate: float = ELECTRICAL_RATE) -> SensorSpread:
    """Line-current sensor of the pump profiles: gain error within 0.3 %, noise 5 mA.

    Parameters
    ----------
    rate : float
        Samples a second, Hz.

    Returns
    -------
    SensorSpread

    Raises
    ------
    ParameterError
        If the rate is outside its limits.
    """
    return SensorSpread(sensor=Sensor(unit="A", noise=0.005, rate=rate), gain_error=(-0.003, 0.003))


def pressure_transmitter(*, rate: float = HYDRAULIC_RATE) -> SensorSpread:
    """Differential-pressure transmitter of the pump profiles: lag 50 ms, noise 800 Pa, bias +-1500 Pa, step 200 Pa.

    Parameters
    ----------
    rate : float
        Samples a second, Hz.

    Returns
    -------
    SensorSpread

    Raises
    ------
    ParameterError
        If the rate is outside its limits.
    """
    sensor = Sensor(unit="Pa", lag=0.05, noise=800.0, resolution=200.0, rate=rate)
    return SensorSpread(sensor=sensor, offset=(-1500.0, 1500.0))


def flow_meter(*, rate: float = HYDRAULIC_RATE) -> SensorSpread:
    """Flow meter of the pump profiles: lag 150 ms, noise 4e-6, bias +-8e-6, step 2e-6 m3/s.

    Parameters
    ----------
    rate : float
        Samples a second, Hz.

    Returns
    -------
    SensorSpread

    Raises
    ------
    ParameterError
        If the rate is outside its limits.
    """
    sensor = Sensor(unit="m3/s", lag=0.15, noise=4e-6, resolution=2e-6, rate=rate)
    return SensorSpread(sensor=sensor, offset=(-8e-6, 8e-6))


@dataclass(frozen=True, kw_only=True, slots=True)
class SensorFault(Parameters):
    """A sensor that fails during the run.

    "stuck" repeats the last reading before the onset, or shows `size` if it is given; "drift" adds `size` a
    second; "gain" multiplies by 1 + `size`; "spike" adds `size` to one sample, and again every `period`. Drift,
    gain and spike act before noise and saturation, stuck after quantisation.
    """

    kind: Annotated[
        Literal["stuck", "drift", "gain", "spike"], Choice("what fails", ("stuck", "drift", "gain", "spike"))
    ]
    onset: Annotated[float, Quantity("s", "begin of the fault")]
    end: Annotated[float, Quantity("s", "end of the fault")] | None = None
    size: Annotated[float, Quantity("unit of the reading, unit/s or -", "size", -math.inf)] | None = None
    period: Annotated[float, Quantity("s", "time between two spikes", 0.0, math.inf, True)] | None = None

    def _check_together(self) -> None:
        if self.size is None and self.kind != "stuck":
            raise ParameterError(f'SensorFault.size is missing: kind "{self.kind}" needs one; only "stuck" does not.')
        if self.end is not None and self.end <= self.onset:
            raise ParameterError(f"SensorFault.end = {self.end:g} s: must come after onset = {self.onset:g} s.")
        if self.period is not None and self.kind != "spike":
            raise ParameterError(f'SensorFault.period = {self.period:g} s: only for "spike", not "{self.kind}".')


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


def saturated(sensor: Sensor, values: ArrayLike) -> Array:
    """Tell which readings lie at an end of the range, as the user of the readings can see it.

    Parameters
    ----------
    sensor : Sensor
        The sensor.
    values : array_like, shape (n,)
        Readings.

    Returns
    -------
    ndarray of bool, shape (n,)
    """
    x = np.asarray(values, dtype=float)
    low, high = sensor.limits
    return (x <= low) | (x >= high)


@dataclass(frozen=True, kw_only=True, slots=True)
class SensorSet:
    """The sensors of one machine.

    Parameters
    ----------
    voltage : tuple of Sensor
        Of the three phase voltages (terminal to the supply's neutral).
    current : tuple of Sensor
        Of the three line currents, with the voltages' rate.
    pressure, flow : Sensor or None
        Of the pump's differential pressure and flow, of one rate; None where there is no pump.
    """

    voltage: tuple[Sensor, Sensor, Sensor]
    current: tuple[Sensor, Sensor, Sensor]
    pressure: Sensor | None = None
    flow: Sensor | None = None

    def __post_init__(self) -> None:
        for name, unit in (("voltage", "V"), ("current", "A")):
            three = getattr(self, name)
            if not isinstance(three, tuple) or len(three) != 3 or not all(isinstance(s, Sensor) for s in three):
                raise ParameterError(f"SensorSet.{name} = {three!r}: must be three Sensors, phases a, b, c.")
            if any(sensor.unit != unit for sensor in three):
                raise ParameterError(f"SensorSet.{name}: unit {three[0].unit!r}: must be {unit!r}.")
        for name, unit in (("pressure", "Pa"), ("flow", "m3/s")):
            one = getattr(self, name)
            if one is not None and (not isinstance(one, Sensor) or one.unit != unit):
                raise ParameterError(f"SensorSet.{name} = {one!r}: must be a Sensor in {unit!r}, or None.")
        if len({sensor.rate for sensor in self.electrical}) > 1:
            raise ParameterError("SensorSet.voltage, current: rates differ (Hz); give all six the same rate.")
        if len({sensor.rate for sensor in self.hydraulic}) > 1:
            raise ParameterError("SensorSet.pressure, flow: rates differ (Hz); give both the same rate.")

    @property
    def electrical(self) -> tuple[Sensor, ...]:
        """Sensors of v_a, v_b, v_c, i_a, i_b, i_c."""
        return self.voltage + self.current

    @property
    def hydraulic(self) -> tuple[Sensor, ...]:
        """Sensors of pressure and flow, those that exist."""
        return tuple(sensor for sensor in (self.pressure, self.flow) if sensor is not None)

    @property
    def channels(self) -> tuple[str, ...]:
        """Names of the channels that exist, of `CHANNELS`."""
        there = (*(True,) * 6, self.pressure is not None, self.flow is not None)
        return tuple(name for name, yes in zip(CHANNELS, there, strict=True) if yes)


@dataclass(frozen=True, kw_only=True, eq=False, slots=True)
class FastSignals:
    """What the fast sensors of a run say.

    Parameters
    ----------
    rate, hydraulic_rate : float
        Samples a second of the electrical and of the hydraulic signals, Hz.
    voltage, current : ndarray, shape (n, 3)
        Phase voltages (terminal to neutral), V, and line currents, A; columns a, b, c.
    H, Q : ndarray, shape (m,), or None
        Differential pressure, Pa, and flow, m3/s; None where there is no sensor.
    start : float
        Time of the first sample, s.
    hydraulic_start : float
        Time of the first hydraulic sample, s.
    """

    rate: float
    voltage: Array
    current: Array
    hydraulic_rate: float = HYDRAULIC_RATE
    H: Array | None = None
    Q: Array | None = None
    start: float = 0.0
    hydraulic_start: float = 0.0

    @property
    def t(self) -> Array:
        """Nominal times of voltages and currents, s."""
        return self.start + np.arange(len(self.voltage)) / self.rate

    @property
    def t_hydraulic(self) -> Array:
        """Nominal times of pressure and flow, s."""
        n = max((len(x) for x in (self.H, self.Q) if x is not None), default=0)
        return self.hydraulic_start + np.arange(n) / self.hydraulic_rate


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


# --- bench profiles -------------------------------------------------------------------------------------------

_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_UNIFORM = re.compile(rf"U\(\s*({_NUMBER})\s*,\s*({_NUMBER})\s*\)(?: per channel)?")
_NORMAL = re.compile(rf"N\(\s*({_NUMBER})\s*\)")
_SHARE = re.compile(rf"({_NUMBER})\s*% of full scale")
_SUFFIX = re.compile(r"_(?:s|Pa|A|V|Hz|m3_s)$")
_KEYS = (
    *("gain", "offset", "bias", "full_scale", "bits", "noise", "noise_lsb", "step", "lag", "rate", "jitter"),
    *("anti_alias", "dropout", "on_dropout", "sides"),
)
_KINDS = {"voltage": "V", "current": "A", "pressure": "Pa", "flow": "m3/s"}


def _plain(where: str, value: Any, pattern: re.Pattern[str] | None = None) -> float:
    if isinstance(value, str) and pattern and (found := pattern.fullmatch(value.strip())):
        return float(found[1])
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ParameterError(f"{where} = {value!r}: must be a number.")
    return float(value)


def _range(where: str, value: Any, full_scale: float | None) -> tuple[tuple[float, float], str]:
    """Range of a drawn quantity, and how it is drawn."""
    if isinstance(value, str):
        if found := _UNIFORM.fullmatch(value.strip()):
            return (float(found[1]), float(found[2])), "uniform"
        if found := _SHARE.fullmatch(value.strip()):
            if full_scale is None:
                raise ParameterError(f"{where} = {value!r}: needs a full_scale.")
            size = abs(float(found[1])) / 100 * full_scale
            return (-size, size), "ends"
        raise ParameterError(f'{where} = {value!r}: write a number, "U(low, high)" or "x % of full scale".')
    number = _plain(where, value)
    return (number, number), "uniform"


def _spread(kind: str, entry: dict[str, Any], rate: float) -> SensorSpread:
    """Sensor type of one entry with bare keys; a key that is absent means a defect that is absent."""
    where = f"[sensors] {kind}"
    unit = _KINDS[kind]
    full_scale = _plain(f"{where}.full_scale", entry["full_scale"]) if "full_scale" in entry else None
    others: dict[str, Any] = {"rate": _plain(f"{where}.rate", entry.get("rate", rate))}
    for key, name in (("step", "resolution"), ("lag", "lag"), ("jitter", "jitter"), ("anti_alias", "anti_alias"),
                      ("dropout", "dropout")):  # fmt: skip
        if key in entry:
            others[name] = _plain(f"{where}.{key}", entry[key])
    others.update({key: entry[key] for key in ("on_dropout", "sides") if key in entry})
    if "noise" in entry:
        others["noise"] = _plain(f"{where}.noise", entry["noise"], _NORMAL)
    if "bits" in entry:
        if full_scale is None or "step" in entry or "noise" in entry:
            raise ParameterError(f"{where}.bits: needs full_scale and noise_lsb, and no step or noise beside it.")
        bits = entry["bits"]
        lsb = _plain(f"{where}.noise_lsb", entry.get("noise_lsb", 0.0))
        sensor = Sensor.converter(unit=unit, full_scale=full_scale, bits=bits, noise_lsb=lsb, **others)
    elif "noise_lsb" in entry:
        raise ParameterError(f"{where}.noise_lsb = {entry['noise_lsb']!r}: needs bits; give the noise in {unit} else.")
    else:
        sensor = Sensor(unit=unit, full_scale=full_scale, **others)
    if "offset" in entry and "bias" in entry:
        raise ParameterError(f"{where}: offset and bias are the same thing; give one.")
    gain, _ = _range(f"{where}.gain", entry.get("gain", 0.0), None)
    bias = entry.get("offset", entry.get("bias", 0.0))
    offset, how = _range(f"{where}.offset", bias, full_scale)
    return SensorSpread(sensor=sensor, gain_error=gain, offset=offset, offset_draw=how)  # type: ignore[arg-type]


def sensor_spreads(
    profile: Mapping[str, Any], *, accuracy: Accuracy | None = None, rate: float | None = None
) -> dict[str, SensorSpread]:
    """Read the sensor types of a bench profile.

    Entries ``pressure``, ``flow``, ``current``, ``voltage`` are tables of their own; keys beside them hold for
    voltages and currents. What a profile does not list is ideal: the pump profiles have ideal voltage probes.
    "x % of full scale" is an offset of exactly that size whose sign is drawn; a number is the value itself.

    Parameters
    ----------
    profile : mapping
        The profile as `pumplib.machines.profiles.load_profile` reads it.
    accuracy : {"A", "B"}, optional
        Gain range of voltages and currents in place of the profile's.
    rate : float, optional
        Rate of voltages and currents in place of the profile's, Hz; else 10 kHz. Pressure and flow have 1 kHz.

    Returns
    -------
    dict of str to SensorSpread
        "voltage" and "current", and "pressure" and "flow" where the profile has them.

    Raises
    ------
    ParameterError
        If the profile has no sensors, or an entry is unknown or wrong.
    """
    if not isinstance(profile.get("sensors"), Mapping):
        raise ParameterError("profile has no table [sensors]; use one of the bench profiles.")
    if accuracy is not None:
        one_of("sensor_spreads", "accuracy", accuracy, tuple(CLASSES))
    common: dict[str, Any] = {}
    own: dict[str, dict[str, Any]] = {"voltage": {}, "current": {}}

    def put(table: dict[str, Any], where: str, key: str, value: Any) -> None:
        bare = _SUFFIX.sub("", key)
        if bare not in _KEYS:
            raise ParameterError(f"{where}.{key} = {value!r}: unknown; allowed are {', '.join(_KEYS)}.")
        if bare in table:
            raise ParameterError(f"{where}.{key} = {value!r}: {bare} comes twice; give it once.")
        table[bare] = value

    for key, value in profile["sensors"].items():
        if key in _KINDS:
            if not isinstance(value, Mapping):
                raise ParameterError(f"[sensors].{key} = {value!r}: must be a table.")
            own.setdefault(key, {})
            for name, item in value.items():
                put(own[key], f"[sensors] {key}", name, item)
        elif isinstance(value, Mapping):
            # one key for several kinds: full_scale = { voltage_V = 600, current_A = 20 }
            for name, item in value.items():
                kind = _SUFFIX.sub("", name)
                if kind not in _KINDS:
                    raise ParameterError(f"[sensors].{key}.{name} = {item!r}: allowed are {', '.join(_KINDS)}.")
                put(own.setdefault(kind, {}), f"[sensors] {kind}", key, item)
        else:
            put(common, "[sensors]", key, value)
    found: dict[str, SensorSpread] = {}
    for kind, entry in own.items():
        if kind in ("voltage", "current"):
            entry = {**common, **entry}
            if rate is not None:
                entry["rate"] = rate
            if accuracy is not None:
                entry["gain"] = f"U({-CLASSES[accuracy]}, {CLASSES[accuracy]})"
        found[kind] = _spread(kind, entry, ELECTRICAL_RATE if kind in ("voltage", "current") else HYDRAULIC_RATE)
    return found


def sensor_set(
    profile: Mapping[str, Any],
    rng: np.random.Generator,
    *,
    accuracy: Accuracy | None = None,
    rate: float | None = None,
) -> SensorSet:
    """Draw the sensors of one machine from a bench profile; every channel has its own gain and offset.

    Two random numbers are taken for each of v_a, v_b, v_c, i_a, i_b, i_c, pressure and flow, in this order.

    Parameters
    ----------
    profile : mapping
        The profile as `pumplib.machines.profiles.load_profile` reads it.
    rng : numpy.random.Generator
        Randomness of the machine.
    accuracy : {"A", "B"}, optional
        Gain range of voltages and currents in place of the profile's.
    rate : float, optional
        Rate of voltages and currents in place of the profile's, Hz.

    Returns
    -------
    SensorSet

    Raises
    ------
    ParameterError
        If the profile has no sensors, or an entry is unknown or wrong.
    """
    types = sensor_spreads(profile, accuracy=accuracy, rate=rate)
    voltage, current = ([draw(types[kind], rng) for _ in range(3)] for kind in ("voltage", "current"))
    pressure, flow = (draw(types[kind], rng) if kind in types else None for kind in ("pressure", "flow"))
    return SensorSet(
        voltage=(voltage[0], voltage[1], voltage[2]),
        current=(current[0], current[1], current[2]),
        pressure=pressure,
        flow=flow,
    )


def ideal_sensors(*, rate: float | None = None, hydraulic_rate: float | None = None, pump: bool = True) -> SensorSet:
    """Sensors without any defect.

    Parameters
    ----------
    rate, hydraulic_rate : float, optional
        Samples a second, Hz; every simulation point by default.
    pump : bool
        Whether pressure and flow are measured.

    Returns
    -------
    SensorSet

    Raises
    ------
    ParameterError
        If a rate is outside its limits.
    """
    v, i = Sensor(unit="V", rate=rate), Sensor(unit="A", rate=rate)
    return SensorSet(
        voltage=(v, v, v),
        current=(i, i, i),
        pressure=Sensor(unit="Pa", rate=hydraulic_rate) if pump else None,
        flow=Sensor(unit="m3/s", rate=hydraulic_rate) if pump else None,
    )
