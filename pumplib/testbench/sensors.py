"""Thesis 4.4.2, 5.3: sensors as data sheets describe them, and what they make of the true signals.

The defects act in the order of the signal's way: first-order lag of the transducer, anti-alias filter, sampling
at jittering instants, gain error, offset, noise, saturation, quantisation, lost samples. With all of them off
the sensor gives back the truth.

Gain errors and offsets belong to a machine: they are drawn once (`draw`, `sensor_set`) and stay for all its
runs. Noise, jitter and drop-outs belong to a run: `measure` gets a generator for them.
"""

import math
from dataclasses import dataclass, replace
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pumplib.decide.checks import generator
from pumplib.errors import ParameterError
from pumplib.machines.quantity import Choice, Parameters, Quantity, check_value, quantities
from pumplib.machines.units import si_unit

Array = NDArray[Any]
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
