"""Thesis, all chapters: units, the only conversions in the package.

Inside, everything is SI with the angle in radians. Data sheets and logs are not; their numbers
pass through `to_si` with the unit written beside them.
"""

import math
from dataclasses import dataclass
from typing import Any, TypeVar

from numpy.typing import NDArray

from pumplib.errors import ParameterError

Value = TypeVar("Value", float, NDArray[Any])

RPM = 2 * math.pi / 60  # rad/s
GRAVITY = 9.80665  # m/s2, standard gravity (exact by definition)


@dataclass(frozen=True, slots=True)
class _Unit:
    si: str  # SI unit that values are converted to; two units are compatible when these agree
    factor: float
    offset: float = 0.0


# unit as written -> SI unit, factor, offset: si_value = factor * value + offset
_UNITS: dict[str, _Unit] = {
    "-": _Unit("-", 1.0),
    "%": _Unit("-", 0.01),
    "rad": _Unit("rad", 1.0),
    "deg": _Unit("rad", math.pi / 180),
    "s": _Unit("s", 1.0),
    "ms": _Unit("s", 1e-3),
    "min": _Unit("s", 60.0),
    "h": _Unit("s", 3600.0),
    "Hz": _Unit("Hz", 1.0),
    "kHz": _Unit("Hz", 1e3),
    "rad/s": _Unit("rad/s", 1.0),
    "rpm": _Unit("rad/s", RPM),
    "rad/s2": _Unit("rad/s2", 1.0),
    "V": _Unit("V", 1.0),
    "kV": _Unit("V", 1e3),
    "A": _Unit("A", 1.0),
    "mA": _Unit("A", 1e-3),
    "V s": _Unit("V s", 1.0),
    "Wb": _Unit("V s", 1.0),
    "ohm": _Unit("ohm", 1.0),
    "mohm": _Unit("ohm", 1e-3),
    "H": _Unit("H", 1.0),
    "mH": _Unit("H", 1e-3),
    "W": _Unit("W", 1.0),
    "kW": _Unit("W", 1e3),
    "hp": _Unit("W", 745.69987158227022),
    # data sheets of motors give inductances as reactances
    "ohm at 50 Hz": _Unit("H", 1 / (100 * math.pi)),
    "ohm at 60 Hz": _Unit("H", 1 / (120 * math.pi)),
    "J": _Unit("J", 1.0),
    "kg m2": _Unit("kg m2", 1.0),
    "N m": _Unit("N m", 1.0),
    "N m s": _Unit("N m s", 1.0),
    "N m s2": _Unit("N m s2", 1.0),
    "N m s2/m3": _Unit("N m s2/m3", 1.0),
    "N m s2/m6": _Unit("N m s2/m6", 1.0),
    "m": _Unit("m", 1.0),
    "mm": _Unit("m", 1e-3),
    "m s2": _Unit("m s2", 1.0),
    "s2/m2": _Unit("s2/m2", 1.0),
    "s2/m5": _Unit("s2/m5", 1.0),
    "m3": _Unit("m3", 1.0),
    "m3/s": _Unit("m3/s", 1.0),
    "m3/h": _Unit("m3/s", 1 / 3600),
    "l/s": _Unit("m3/s", 1e-3),
    "l/min": _Unit("m3/s", 1e-3 / 60),
    "Pa": _Unit("Pa", 1.0),
    "kPa": _Unit("Pa", 1e3),
    "MPa": _Unit("Pa", 1e6),
    "bar": _Unit("Pa", 1e5),
    "Pa s2": _Unit("Pa s2", 1.0),
    "Pa s2/m3": _Unit("Pa s2/m3", 1.0),
    "Pa s2/m6": _Unit("Pa s2/m6", 1.0),
    "kg/m3": _Unit("kg/m3", 1.0),
    "m/s2": _Unit("m/s2", 1.0),
    "K": _Unit("K", 1.0),
    "degC": _Unit("K", 1.0, 273.15),
    "1/K": _Unit("1/K", 1.0),
}


def known_units() -> tuple[str, ...]:
    """Return every unit that `to_si` understands, as it is to be written.

    Returns
    -------
    tuple of str
    """
    return tuple(_UNITS)


def si_unit(unit: str) -> str:
    """Return the SI unit that values in `unit` are converted to.

    Parameters
    ----------
    unit : str
        Unit as written in data files, for example ``"l/min"``.

    Returns
    -------
    str

    Raises
    ------
    ParameterError
        If the unit is not known.
    """
    try:
        return _UNITS[unit].si
    except KeyError:
        raise ParameterError(f"unknown unit {unit!r}; write one of: {', '.join(_UNITS)}") from None


def to_si(value: Value, unit: str, expected: str | None = None) -> Value:
    """Convert `value` from `unit` to SI.

    Parameters
    ----------
    value : float or ndarray
        Number in `unit`.
    unit : str
        Unit of `value`.
    expected : str, optional
        SI unit that the result must have.

    Returns
    -------
    float or ndarray
        Value in SI units.

    Raises
    ------
    ParameterError
        If the unit is unknown or not one of the `expected` kind.
    """
    si = si_unit(unit)
    if expected is not None and si != expected:
        fitting = ", ".join(name for name, u in _UNITS.items() if u.si == expected)
        raise ParameterError(f"unit {unit!r} does not measure {expected}; write one of: {fitting}")
    entry = _UNITS[unit]
    return entry.factor * value + entry.offset


def from_si(value: Value, unit: str) -> Value:
    """Convert an SI `value` to `unit`; the inverse of `to_si`.

    Parameters
    ----------
    value : float or ndarray
        Number in SI units.
    unit : str
        Unit wanted.

    Returns
    -------
    float or ndarray
        Value in `unit`.

    Raises
    ------
    ParameterError
        If the unit is unknown.
    """
    si_unit(unit)
    entry = _UNITS[unit]
    return (value - entry.offset) / entry.factor
