"""Thesis 3.2.1, 3.3.2, 3.3.4: parameter files, every value with unit, status and source.

A file has one table per parameter class (``[motor]``, ``[losses]``, ``[inverse_gamma]``, ``[pump]``,
``[impeller]``, ``[application]``, ``[liquid]``) and a table ``[sources]``. Each value is written as
``r_s = { value = 4.1, unit = "ohm", status = "assumed", source = "key of [sources]" }``.
"""

import tomllib
from dataclasses import MISSING, dataclass, fields
from pathlib import Path
from types import MappingProxyType
from typing import Any

from pumplib.errors import ParameterError
from pumplib.machines.parameters import Application, Impeller, Liquid, Motor, MotorLosses, Pump
from pumplib.machines.quantity import Choice, Parameters, Quantity, check_value, quantities, whole_fields
from pumplib.machines.units import to_si
from pumplib.paths import DATA

STATUSES = ("measured", "data sheet", "typical", "assumed")
_KINDS: dict[str, type[Parameters]] = {
    "motor": Motor,
    "losses": MotorLosses,
    "pump": Pump,
    "impeller": Impeller,
    "application": Application,
    "liquid": Liquid,
}
# An inverse-gamma equivalent circuit fixes the terminal behaviour but not the split of the leakage.
_INVERSE_GAMMA = {
    "R_s": Quantity("ohm", "stator resistance", 0.0, 1e3, True),
    "R_R": Quantity("ohm", "rotor resistance of the inverse-gamma circuit", 0.0, 1e3, True),
    "L_sigma": Quantity("H", "total leakage inductance of the inverse-gamma circuit", 0.0, 10.0, True),
    "L_M": Quantity("H", "magnetising inductance of the inverse-gamma circuit", 0.0, 100.0, True),
}


@dataclass(frozen=True, slots=True)
class Origin:
    """Where one value of a parameter file comes from.

    Parameters
    ----------
    value : object
        As written in the file.
    unit : str
        As written in the file.
    status : str
        One of `STATUSES`.
    source : str
        Full citation.
    """

    value: object
    unit: str
    status: str
    source: str


@dataclass(frozen=True, slots=True)
class Sheet:
    """One parameter file, read and checked.

    Parameters
    ----------
    name, description : str
        From the file.
    path : Path
        The file.
    parts : mapping
        Table name to parameter object, for example ``parts["motor"]``.
    origins : mapping
        ``"table.field"`` to `Origin`.
    """

    name: str
    description: str
    path: Path
    parts: MappingProxyType[str, Parameters]
    origins: MappingProxyType[str, Origin]


def from_inverse_gamma(
    *, R_s: float, R_R: float, L_sigma: float, L_M: float, leakage_ratio: float = 1.0
) -> dict[str, float]:
    """Convert an inverse-gamma circuit to the thesis's T circuit.

    The inverse-gamma quantities are the primed ones of (3.7): R_R = R_r', L_sigma = L_s', L_M = L_m'. Any split
    of the leakage gives the same terminal behaviour and torque; the split is chosen by `leakage_ratio`.

    Parameters
    ----------
    R_s, R_R : float
        Resistances, ohm.
    L_sigma, L_M : float
        Inductances, H.
    leakage_ratio : float
        L_ls / L_lr of the result.

    Returns
    -------
    dict
        ``r_s, r_r`` in ohm, ``L_m, L_ls, L_lr`` in H.

    Raises
    ------
    ParameterError
        If `leakage_ratio` is not positive.

    References
    ----------
    Thesis equation (3.7), definitions of R_r', L_s', L_m'.
    """
    if not leakage_ratio > 0:
        raise ParameterError(f"leakage_ratio = {leakage_ratio!r}: must be > 0 (L_ls/L_lr, 1 for an equal split).")
    # With k = L_m/L_r: L_M = k L_m, L_lr = L_m (1/k - 1), L_sigma = L_ls + k L_lr.
    # Inserting L_ls = c L_lr gives L_sigma/L_M = (1/k^2 - 1/k)(c + k), a quadratic in 1/k.
    c, s = leakage_ratio, L_sigma / L_M
    # (1/k - 1)(c/k + 1) = s  ->  c x^2 + (1 - c) x - (1 + s) = 0 with x = 1/k
    x = ((c - 1) + ((1 - c) ** 2 + 4 * c * (1 + s)) ** 0.5) / (2 * c)
    L_m = L_M * x
    L_lr = L_m * (x - 1)
    return {"r_s": R_s, "r_r": R_R * x**2, "L_m": L_m, "L_ls": c * L_lr, "L_lr": L_lr}


def _entry(where: str, raw: Any, rule: Quantity | Choice, whole: bool, sources: dict[str, str]) -> tuple[Any, Origin]:
    if not isinstance(raw, dict):
        raise ParameterError(
            f'{where} = {raw!r}: write {{ value = ..., unit = "...", status = "...", source = "..." }}.'
        )
    needed = {"value", "status", "source"} | ({"unit"} if isinstance(rule, Quantity) else set())
    for key in sorted(needed - raw.keys()):
        raise ParameterError(f"{where}: {key} is missing; {rule.meaning} needs value, unit, status and source.")
    for key in sorted(raw.keys() - needed - {"unit", "note"}):
        raise ParameterError(f"{where}: unknown key {key!r}; allowed are value, unit, status, source, note.")
    if raw["status"] not in STATUSES:
        raise ParameterError(f"{where}.status = {raw['status']!r}: must be one of {', '.join(STATUSES)}.")
    if raw["source"] not in sources:
        raise ParameterError(
            f"{where}.source = {raw['source']!r}: not in [sources]; there are {', '.join(sources) or 'none'}."
        )
    value, unit = raw["value"], raw.get("unit", "-")
    origin = Origin(value, unit, raw["status"], sources[raw["source"]])
    if isinstance(rule, Choice):
        return value, origin
    owner, name = where.rsplit(".", 1)
    many = value if isinstance(value, list) else [value]
    converted = []
    for item in many:
        if isinstance(item, bool) or not isinstance(item, int | float):
            raise ParameterError(f"{where} = {item!r}: must be a number in {unit} ({rule.meaning}).")
        try:
            number = to_si(item, unit, rule.unit)
        except ParameterError as error:
            raise ParameterError(f"{where} = {item!r} {unit}: {error}") from None
        try:
            check_value(owner, name, number, rule, whole)
        except ParameterError as error:
            raise ParameterError(f"{error} The file has {item!r} {unit}.") from None
        converted.append(int(number) if whole else float(number))
    return (tuple(converted) if isinstance(value, list) else converted[0]), origin


def _part(
    table: str, cls: type[Parameters], raw: dict[str, Any], path: Path, sources: dict[str, str]
) -> tuple[Parameters, dict[str, Origin]]:
    rules = quantities(cls)  # type: ignore[arg-type]
    whole = whole_fields(cls)  # type: ignore[arg-type]
    prefix = f"{path.name}: {table}"
    for name in raw:
        if name not in rules:
            raise ParameterError(f"{prefix}.{name}: unknown field; allowed are {', '.join(rules)}.")
    values: dict[str, Any] = {}
    origins: dict[str, Origin] = {}
    for field in fields(cls):  # type: ignore[arg-type]
        rule = rules[field.name]
        if field.name not in raw:
            if field.default is MISSING:
                unit = f" in {rule.unit}" if isinstance(rule, Quantity) else ""
                raise ParameterError(f"{prefix}.{field.name} is missing: give the {rule.meaning}{unit}.")
            continue
        values[field.name], origins[f"{table}.{field.name}"] = _entry(
            f"{prefix}.{field.name}", raw[field.name], rule, field.name in whole, sources
        )
    try:
        return cls(**values), origins
    except ParameterError as error:
        raise ParameterError(f"{path.name}: {error}") from None


def _expand_inverse_gamma(raw: dict[str, Any], path: Path, sources: dict[str, str]) -> dict[str, Origin]:
    """Replace ``[inverse_gamma]`` by the T-circuit fields of ``[motor]``; return the origins of the facts."""
    facts = raw.pop("inverse_gamma")
    prefix = f"{path.name}: inverse_gamma"
    for name in sorted(facts.keys() ^ _INVERSE_GAMMA.keys()):
        known = name in _INVERSE_GAMMA
        raise ParameterError(
            f"{prefix}.{name}: {'is missing' if known else 'unknown field'}; "
            f"the table has exactly {', '.join(_INVERSE_GAMMA)}."
        )
    values: dict[str, float] = {}
    origins: dict[str, Origin] = {}
    for name, rule in _INVERSE_GAMMA.items():
        values[name], origins[f"inverse_gamma.{name}"] = _entry(f"{prefix}.{name}", facts[name], rule, False, sources)
    key = next(iter(facts.values()))["source"]
    for name, value in from_inverse_gamma(**values).items():
        if name in raw["motor"]:
            raise ParameterError(f"{path.name}: motor.{name} and [inverse_gamma] give the same thing; keep one.")
        unit = "ohm" if name.startswith("r_") else "H"
        status = facts["R_s"]["status"]
        raw["motor"][name] = {"value": value, "unit": unit, "status": status, "source": key}
    return origins


def read_sheet(path: str | Path) -> Sheet:
    """Read and check a parameter file.

    Parameters
    ----------
    path : str or Path
        TOML file.

    Returns
    -------
    Sheet

    Raises
    ------
    ParameterError
        If the file is absent, is no TOML, or a field is missing, unknown, of the wrong type or unit, or
        outside its physical limits; the message names file, field, value, unit and remedy.
    """
    path = Path(path)
    try:
        raw = tomllib.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise ParameterError(f"{path}: no such parameter file; shipped ones are {', '.join(shipped())}.") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ParameterError(f"{path}: not readable as TOML: {error}") from None
    for key in ("name", "description", "sources"):
        if key not in raw:
            raise ParameterError(f"{path.name}: {key} is missing at the top of the file.")
    name, description, sources = raw.pop("name"), raw.pop("description"), raw.pop("sources")
    origins: dict[str, Origin] = {}
    if "inverse_gamma" in raw and "motor" in raw:
        origins |= _expand_inverse_gamma(raw, path, sources)
    for table in raw:
        if table not in _KINDS:
            raise ParameterError(
                f"{path.name}: unknown table [{table}]; allowed are {', '.join(_KINDS)}, inverse_gamma."
            )
    parts: dict[str, Parameters] = {}
    for table, content in raw.items():
        parts[table], more = _part(table, _KINDS[table], content, path, sources)
        origins |= more
    return Sheet(name, description, path, MappingProxyType(parts), MappingProxyType(origins))


def shipped() -> dict[str, Path]:
    """Return the parameter files that come with the workbook.

    Returns
    -------
    dict
        Short name, for example ``"motors/reference_1k5"``, to file.
    """
    found = sorted(p for kind in ("motors", "pumps") for p in (DATA / kind).glob("*.toml"))
    return {f"{p.parent.name}/{p.stem}": p for p in found}


def _load(kind: str, folder: str, name: str | Path) -> Any:
    path = Path(name)
    if path.suffix != ".toml":
        path = shipped().get(f"{folder}/{name}", path)
    if path.suffix != ".toml":
        known = ", ".join(key.split("/")[1] for key in shipped() if key.startswith(folder))
        raise ParameterError(
            f"{kind} {str(name)!r}: no such shipped file; give one of {known}, or a path ending in .toml."
        )
    sheet = read_sheet(path)
    if kind not in sheet.parts:
        raise ParameterError(f"{path.name}: has no table [{kind}]; it holds {', '.join(sheet.parts)}.")
    return sheet.parts[kind]


def load_motor(name: str | Path) -> Motor:
    """Load a motor by its shipped name or from a file of your own.

    Parameters
    ----------
    name : str or Path
        For example ``"reference_1k5"`` or ``"my_motor.toml"``.

    Returns
    -------
    Motor

    Raises
    ------
    ParameterError
        See `read_sheet`.
    """
    return _load("motor", "motors", name)


def load_losses(name: str | Path) -> MotorLosses:
    """Load the loss figures of a motor; see `load_motor`.

    Parameters
    ----------
    name : str or Path
        As for `load_motor`.

    Returns
    -------
    MotorLosses

    Raises
    ------
    ParameterError
        See `read_sheet`; also if the file has no table ``[losses]``.
    """
    return _load("losses", "motors", name)


def load_pump(name: str | Path) -> Pump:
    """Load a pump by its shipped name or from a file of your own.

    Parameters
    ----------
    name : str or Path
        For example ``"multistage_1k5"`` or ``"my_pump.toml"``.

    Returns
    -------
    Pump

    Raises
    ------
    ParameterError
        See `read_sheet`.
    """
    return _load("pump", "pumps", name)


def load_application(name: str | Path) -> Application:
    """Load the application (pipe and valve) that a pump file describes.

    Parameters
    ----------
    name : str or Path
        As for `load_pump`.

    Returns
    -------
    Application

    Raises
    ------
    ParameterError
        See `read_sheet`; also if the file has no table ``[application]``.
    """
    return _load("application", "pumps", name)
