"""Thesis 7.1, 7.2: what can still be said without a channel, and whether the numbers are in the units they claim.

Wrong units are the usual mistake with a new installation. The channels are checked against each other by the data of
motor and pump; where they do not fit, other units in use are tried and those that fit are named. Nothing is converted
silently.
"""

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from itertools import combinations, product
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pumplib.errors import DataError, ParameterError
from pumplib.machines import Motor
from pumplib.machines.units import GRAVITY, to_si
from pumplib.steady.phasors import air_gap, electrical_parameters
from pumplib.steady.relations import CHANNELS, FAULTS, NEEDS, UNITS, head

Array = NDArray[Any]


@dataclass(frozen=True, kw_only=True, slots=True)
class Coverage:
    """What the channels that are there allow.

    Parameters
    ----------
    relations : tuple of str
        Residuals that can be evaluated.
    detectable : tuple of str
        Faults that change at least one of them.
    isolable : tuple of tuple
        Groups of faults that the residuals' pattern of zeros cannot tell apart, each sorted; faults of a group of one
        are isolable by it.
    lost : tuple of str
        Sentences on what is lost, for a report.
    """

    relations: tuple[str, ...]
    detectable: tuple[str, ...]
    isolable: tuple[tuple[str, ...], ...]
    lost: tuple[str, ...]


_WORDS = {"K_f": "clogging", "dB": "friction", "K_l": "leakage", "f_c": "cavitation", "f_d": "dry running"}


def available_relations(channels: Iterable[str]) -> Coverage:
    """Residuals that some channels allow, and what the missing ones cost.

    Parameters
    ----------
    channels : iterable of str
        Channels that are there.

    Returns
    -------
    Coverage

    Raises
    ------
    ParameterError
        If a name is no channel.
    """
    there = set(channels)
    unknown = there - set(CHANNELS)
    if unknown:
        raise ParameterError(f"{', '.join(sorted(unknown))}: no channel; channels are {', '.join(CHANNELS)}.")
    kept = tuple(name for name, needs in NEEDS.items() if set(needs) <= there)
    every = tuple(_WORDS)
    pattern = {fault: tuple(fault in FAULTS[name] for name in kept) for fault in every}
    detectable = tuple(fault for fault in every if any(pattern[fault]))
    groups: dict[tuple[bool, ...], list[str]] = {}
    for fault in detectable:
        groups.setdefault(pattern[fault], []).append(fault)
    lost = []
    for name in CHANNELS:
        if name in there:
            continue
        gone = [residual for residual, needs in NEEDS.items() if name in needs]
        lost.append(f"without {name} ({UNITS[name]}) there is no {', '.join(gone)}")
    blind = [f"{_WORDS[f]} ({f})" for f in every if f not in detectable]
    if blind:
        lost.append(f"not detectable: {', '.join(blind)}")
    elif lost:
        mixed = [", ".join(_WORDS[f] for f in group) for group in groups.values() if len(group) > 1]
        lost.append(f"told apart only by size, not by which residuals react: {'; '.join(mixed)}")
    return Coverage(
        relations=kept,
        detectable=detectable,
        isolable=tuple(tuple(sorted(g)) for g in groups.values()),
        lost=tuple(lost),
    )


@dataclass(frozen=True, kw_only=True, slots=True)
class Finding:
    """A channel whose numbers do not fit.

    Parameters
    ----------
    channel : str
        Which; "all" if no single channel can be blamed.
    value : float
        Typical value as given; NaN for "all".
    likely : tuple of str
        What the numbers probably are, best first; empty if nothing in use fits.
    message : str
        For the user.
    """

    channel: str
    value: float
    likely: tuple[str, ...]
    message: str


Convert = Callable[[Array], Array]
_ROOT3 = math.sqrt(3.0)


def _unit(name: str) -> Convert:
    return lambda x: np.asarray(to_si(x, name))


# what the numbers of a channel may be -> conversion to what they should be
READINGS: Mapping[str, Mapping[str, Convert]] = {
    "V_rms": {"line-to-line voltage": lambda x: x / _ROOT3, "kV": _unit("kV"),
              "amplitude of the phase voltage": lambda x: x / math.sqrt(2)},
    "I_rms": {"amplitude of the current": lambda x: x / math.sqrt(2), "mA": _unit("mA")},
    "omega_e": {"Hz": lambda x: 2 * math.pi * x, "rpm": _unit("rpm")},
    "phi": {"degrees": _unit("deg"), "the power factor cos phi": np.arccos},
    "H": {"bar": _unit("bar"), "kPa": _unit("kPa"), "MPa": _unit("MPa"), "m of water": lambda x: 998.2 * GRAVITY * x},
    "Q": {"m3/h": _unit("m3/h"), "l/min": _unit("l/min"), "l/s": _unit("l/s")},
}  # fmt: skip
# a quantity over its expectation may deviate by this factor either way
LIMITS = {"V/f": 1.3, "frequency": 4.0, "air-gap flux": 1.5, "head": 2.0, "efficiency": 4.0}


def _deviations(motor: Motor, parameters: Mapping[str, float], x: Mapping[str, Array]) -> dict[str, float]:
    """Logarithm of each quantity that the channels allow over its expectation; infinite where impossible."""
    hertz, volts = motor.rated_frequency or 50.0, (motor.rated_voltage or 400.0) / _ROOT3
    rated = 2 * math.pi * hertz
    found: dict[str, Array] = {}
    with np.errstate(all="ignore"):
        if "omega_e" in x:
            found["frequency"] = x["omega_e"] / (0.5 * rated)
        if {"V_rms", "omega_e"} <= x.keys():
            found["V/f"] = x["V_rms"] / (volts * x["omega_e"] / rated)
        if {"V_rms", "I_rms", "omega_e", "phi"} <= x.keys():
            e = electrical_parameters(motor)
            V, I = e.voltage * x["V_rms"], e.current * x["I_rms"]
            i, E_d, E_q, power = air_gap(V, I, x["omega_e"], x["phi"], e.r_s, e.L_s_prime, 0.0)
            found["air-gap flux"] = (
                np.where(power > 0, (E_d**2 + E_q**2) / (x["omega_e"] * i * E_q), -1.0) / e.L_m_prime
            )
            if {"H", "Q"} <= x.keys():
                used = 3 * x["V_rms"] * x["I_rms"] * np.cos(x["phi"])
                share = x["H"] * x["Q"] / used
                found["efficiency"] = np.where(share < 0.9, share / 0.4, -1.0)
        if {"H", "Q", "omega_e"} <= x.keys():
            p = parameters
            omega = 0.97 * x["omega_e"] / motor.z_p
            found["head"] = x["H"] / head(x["Q"], omega, p["a_h0"], p["a_h1"], p["a_h2"])
        logs = {name: np.log(value) for name, value in found.items()}
    return {name: float(np.median(np.abs(np.where(np.isnan(v), np.inf, v)))) for name, v in logs.items()}


def check_units(motor: Motor, parameters: Mapping[str, float], signals: Mapping[str, ArrayLike]) -> tuple[Finding, ...]:
    """Check whether the numbers of a running, healthy pump can be in SI units, and say what else they may be.

    Voltage over frequency, magnetising inductance, head over the pump's curve and efficiency are compared with
    what motor and pump should have. Where one is far off, other readings of the channels are tried, as few at once as
    possible, and those that bring everything in order are named.

    Parameters
    ----------
    motor : Motor
        The motor, with rated voltage and frequency as far as known (400 V and 50 Hz else).
    parameters : mapping of str to float
        Pump coefficients a_h0, a_h1, a_h2.
    signals : mapping of str to array_like, shape (n,)
        Channels as delivered; any subset.

    Returns
    -------
    tuple of Finding
        Empty if everything fits.

    Raises
    ------
    DataError
        If a channel has no finite value, another length, or its name is unknown.
    """
    unknown = [name for name in signals if name not in CHANNELS]
    if unknown:
        raise DataError(f"{', '.join(unknown)}: no channel; channels are {', '.join(CHANNELS)}.")
    columns = {name: np.atleast_1d(np.asarray(signals[name], dtype=float)) for name in CHANNELS if name in signals}
    if len({x.shape for x in columns.values()}) > 1:
        raise DataError(f"channels have different shapes: { ({name: x.shape for name, x in columns.items()}) }.")
    for name, x in columns.items():
        if not np.isfinite(x).any():
            raise DataError(f"channel {name} ({UNITS[name]}): no finite value.")
    good = np.all([np.isfinite(x) for x in columns.values()], axis=0)
    if not good.any():
        raise DataError("channels: no sample in which all of them have a value.")
    columns = {name: x[good] for name, x in columns.items()}

    def score(x: Mapping[str, Array]) -> float:
        """Largest deviation over its limit; at most 1 is plausible."""
        parts = _deviations(motor, parameters, x)
        return max((value / math.log(LIMITS[name]) for name, value in parts.items()), default=0.0)

    if score(columns) <= 1.0:
        return ()
    for count in range(1, len(columns) + 1):
        options = []
        for changed in combinations(columns, count):
            for readings in product(*(READINGS[name] for name in changed)):
                with np.errstate(invalid="ignore"):
                    other = {n: READINGS[n][r](columns[n]) for n, r in zip(changed, readings, strict=True)}
                value = score(columns | other)
                if value <= 1.0:
                    options.append((value, dict(zip(changed, readings, strict=True))))
        if options:
            options.sort(key=lambda option: option[0])
            best = options[0][1]
            return tuple(_finding(name, columns[name], options) for name in best)
    off = [n for n, v in _deviations(motor, parameters, columns).items() if v > math.log(LIMITS[n])]
    return (
        Finding(
            channel="all", value=math.nan, likely=(),
            message=f"{', '.join(off)} implausible for this motor and pump, and no unit in use explains it: check the "
            "sensors, the data of motor and pump, and that the pump was delivering.",
        ),
    )  # fmt: skip


def _finding(name: str, x: Array, options: list[tuple[float, dict[str, str]]]) -> Finding:
    likely = tuple(dict.fromkeys(readings[name] for _, readings in options if name in readings))
    value = float(np.median(x))
    return Finding(
        channel=name, value=value, likely=likely,
        message=(
            f"{name} = {value:.4g} (median) does not fit the other channels in {UNITS[name]}; it is probably "
            f"{' or '.join(likely)}. Convert it before use."
        ),
    )  # fmt: skip
