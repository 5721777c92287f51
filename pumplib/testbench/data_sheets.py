"""Thesis 4.4.2, 5.3, 6.7, 7.4: data sheets of the bench's sensors, and the sensors of a frozen profile."""

import re
from collections.abc import Mapping
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from pumplib.decide.checks import one_of
from pumplib.errors import ParameterError
from pumplib.testbench.sensors import ELECTRICAL_RATE, HYDRAULIC_RATE, Sensor, SensorSet, SensorSpread, draw

Array = NDArray[Any]
Accuracy = Literal["A", "B"]
CLASSES: dict[str, float] = {"A": 0.005, "B": 0.01}
"""Largest gain error of the accuracy classes of voltage and current probes."""


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
