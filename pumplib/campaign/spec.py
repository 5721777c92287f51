"""Thesis, all chapters: a campaign as data: which scheme is run how often, with which settings and seeds."""

import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import MISSING as REQUIRED
from dataclasses import asdict, dataclass, field, fields
from itertools import product
from pathlib import Path
from typing import Annotated, Any, Literal

from pumplib import paths
from pumplib.campaign.schemes import Scheme, closest, load_scheme, scheme_path
from pumplib.errors import ParameterError
from pumplib.machines.quantity import Choice, Parameters, Quantity, check_value

Role = Literal["threshold", "healthy", "fault"]
ROLES = ("threshold", "healthy", "fault")
CLASSES = ("replicated", "reconstructed", "beyond")
_FIELDS = ("title", "section", "class", "seed", "scheme", "profile", "settings", "cells")
_CELL_FIELDS = ("name", "role", "runs", "settings", "each")
_COLUMNS = ("cell", "role", "run", "row")


@dataclass(frozen=True, kw_only=True, slots=True)
class Cell(Parameters):
    """One point of a campaign: the same settings, many runs.

    Parameters
    ----------
    name : str
        Unique in the campaign.
    role : {"threshold", "healthy", "fault"}
        What its runs are for.
    runs : int
        Units of work; a scheme may return several rows for each.
    settings : Parameters
        Settings of the scheme, complete.
    """

    name: str
    role: Annotated[Role, Choice("what the runs are for", ROLES)]
    runs: Annotated[int, Quantity("-", "units of work", 1, 1e9)]
    settings: Parameters


@dataclass(frozen=True, kw_only=True, slots=True)
class Campaign(Parameters):
    """A campaign as its file describes it.

    Parameters
    ----------
    name, title : str
        Name of the file and title for people.
    section : str
        Section of the thesis.
    kind : {"replicated", "reconstructed", "beyond"}
        Class of the result.
    seed : int
        Run k of cell c draws from ``numpy.random.default_rng([seed, c, k])``.
    scheme : str
        Name in the registry.
    path : str
        Where the scheme is.
    profile : str or None
        Bench profile.
    cells : tuple of Cell
        In the order of the file.
    swept : tuple of str
        Settings that differ between cells; they are columns of the table.
    """

    name: str
    title: str
    section: str
    kind: Annotated[Literal["replicated", "reconstructed", "beyond"], Choice("class of the result", CLASSES)]
    seed: Annotated[int, Quantity("-", "seed", 0, 2**63 - 1)]
    scheme: str
    path: str
    profile: str | None = None
    cells: tuple[Cell, ...]
    swept: tuple[str, ...] = field(default=())

    @property
    def runs(self) -> int:
        """Units of work of all cells."""
        return sum(cell.runs for cell in self.cells)

    def scaled(self, factor: float) -> tuple[int, ...]:
        """Units of work of each cell in a part of the campaign.

        Parameters
        ----------
        factor : float
            Share of the runs, at most 1; at least one run of each cell is left.

        Returns
        -------
        tuple of int

        Raises
        ------
        ParameterError
            If the factor is not above 0 and at most 1.
        """
        check_value("Campaign", "runs_scale", factor, Quantity("-", "share of the runs", 0.0, 1.0, True))
        return tuple(max(1, round(factor * cell.runs)) for cell in self.cells)

    def definition(self) -> dict[str, Any]:
        """What a run depends on, as plain data; numbers of runs are left out, a campaign may grow.

        Returns
        -------
        dict
        """
        cells = [{"name": one.name, "role": one.role, "settings": asdict(one.settings)} for one in self.cells]  # type: ignore[call-overload]
        return {"seed": self.seed, "scheme": self.scheme, "path": self.path, "cells": cells}


def campaigns(folder: Path | None = None) -> tuple[str, ...]:
    """Names of the campaigns of a folder.

    Parameters
    ----------
    folder : Path, optional
        ``data/campaigns`` by default.

    Returns
    -------
    tuple of str
    """
    return tuple(sorted(path.stem for path in (folder or paths.DATA / "campaigns").glob("*.toml")))


def load_campaign(name: str | Path, folder: Path | None = None) -> Campaign:
    """Load a campaign by its name or from a file.

    Parameters
    ----------
    name : str or Path
        Name in the folder, or a path that ends in ``.toml``.
    folder : Path, optional
        ``data/campaigns`` by default.

    Returns
    -------
    Campaign

    Raises
    ------
    ParameterError
        If it is not there, not readable, or a field is unknown, missing or wrong.
    """
    folder = folder or paths.DATA / "campaigns"
    path = Path(name) if str(name).endswith(".toml") else folder / f"{name}.toml"
    if not path.is_file():
        raise ParameterError(f"campaign {str(name)!r}: {closest(str(name), campaigns(folder))}")
    try:
        raw = tomllib.loads(path.read_text(encoding="utf-8"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ParameterError(f"{path.name}: not readable as TOML: {error}") from None
    return campaign_from(raw, path.stem)


def _check_keys(where: str, given: Mapping[str, Any], allowed: Iterable[str], required: Iterable[str]) -> None:
    known = tuple(allowed)
    for key in given:
        if key not in known:
            raise ParameterError(f"{where}.{key}: unknown; {closest(key, known)}")
    for key in required:
        if key not in given:
            raise ParameterError(f"{where}.{key}: is missing; needed are {', '.join(required)}.")


def _of_type(where: str, value: Any, wanted: type | tuple[type, ...], what: str) -> Any:
    if not isinstance(value, wanted) or isinstance(value, bool):
        raise ParameterError(f"{where} = {value!r}: must be {what}.")
    return value


def _frozen(value: Any) -> Any:
    return tuple(_frozen(item) for item in value) if isinstance(value, list) else value


def _settings(where: str, scheme: Scheme, given: Mapping[str, Any]) -> Parameters:
    cls = scheme.settings
    known: tuple[Any, ...] = fields(cls)  # type: ignore[arg-type]
    needed = [f.name for f in known if f.default is REQUIRED and f.default_factory is REQUIRED]
    _check_keys(where, given, [f.name for f in known], needed)
    try:
        return cls(**{key: _frozen(value) for key, value in given.items()})
    except ParameterError as error:
        raise ParameterError(f"{where}: {error}") from None


def _label(value: Any) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)


def _expanded(where: str, raw: Mapping[str, Any]) -> list[tuple[str, dict[str, Any]]]:
    """Names and settings of the cells that an entry stands for: one, or the product of the lists in ``each``."""
    own = _of_type(f"{where}.settings", raw.get("settings", {}), dict, "a table of settings")
    each = _of_type(f"{where}.each", raw.get("each", {}), dict, "a table of lists")
    for key, values in each.items():
        if not isinstance(values, list) or not values:
            raise ParameterError(f"{where}.each.{key} = {values!r}: must be a list with at least one value.")
        if key in own:
            raise ParameterError(f"{where}.each.{key}: is in settings as well; leave it out there.")
    found = []
    for values in product(*each.values()):
        chosen = dict(zip(each, values, strict=True))
        suffix = ", ".join(f"{key}={_label(value)}" for key, value in chosen.items())
        found.append((f"{raw['name']} {suffix}".strip(), {**own, **chosen}))
    return found


def campaign_from(raw: Mapping[str, Any], name: str) -> Campaign:
    """Build a campaign from plain data, as in a TOML file.

    Parameters
    ----------
    raw : mapping
        Fields ``title``, ``section``, ``class``, ``seed``, ``scheme``, ``profile`` (if the scheme has one),
        ``settings`` (of all cells) and ``cells``: a list of tables with ``name``, ``role``, ``runs``, ``settings``
        (of this cell) and ``each`` (settings with a list of values: one cell for each combination).
    name : str
        Name of the campaign.

    Returns
    -------
    Campaign

    Raises
    ------
    ParameterError
        If a field is unknown, missing or wrong.
    """
    where = f"campaign {name}"
    _check_keys(where, raw, _FIELDS, ("title", "section", "class", "seed", "scheme", "cells"))
    for key in ("title", "section", "scheme"):
        _of_type(f"{where}.{key}", raw[key], str, "a text")
    try:
        path = scheme_path(raw["scheme"])
        scheme = load_scheme(path)
    except ParameterError as error:
        raise ParameterError(f"{where}: {error}") from None
    fixed = dict(_of_type(f"{where}.settings", raw.get("settings", {}), dict, "a table of settings"))
    if "profile" in raw:
        if "profile" not in scheme.settings.__dataclass_fields__:  # type: ignore[attr-defined]
            raise ParameterError(f"{where}.profile: scheme {raw['scheme']} runs on no bench profile; leave it out.")
        fixed["profile"] = _of_type(f"{where}.profile", raw["profile"], str, "the name of a bench profile")
    entries = _of_type(f"{where}.cells", raw["cells"], list, "a list of tables [[cells]]")
    if not entries:
        raise ParameterError(f"{where}.cells: is empty; give at least one [[cells]].")
    cells: list[Cell] = []
    for number, entry in enumerate(entries):
        place = f"{where}, cell {number + 1}"
        _of_type(place, entry, dict, "a table")
        _check_keys(place, entry, _CELL_FIELDS, ("name", "role", "runs"))
        place = f"{where}, cell {_of_type(f'{place}.name', entry['name'], str, 'a text')!r}"
        _of_type(f"{place}.runs", entry["runs"], int, "a whole number")
        for label, own in _expanded(place, entry):
            if any(label == cell.name for cell in cells):
                raise ParameterError(f"{where}, cell {label!r}: is there twice; give every cell a name of its own.")
            settings = _settings(f"{where}, cell {label!r}.settings", scheme, {**fixed, **own})
            try:
                cells.append(Cell(name=label, role=entry["role"], runs=entry["runs"], settings=settings))
            except ParameterError as error:
                raise ParameterError(f"{where}, cell {label!r}: {error}") from None
    try:
        return Campaign(
            name=name, title=raw["title"], section=raw["section"], kind=raw["class"], seed=raw["seed"],
            scheme=raw["scheme"], path=path, profile=raw.get("profile"), cells=tuple(cells), swept=_swept(where, cells),
        )  # fmt: skip
    except ParameterError as error:
        raise ParameterError(f"{where}: {error}") from None


def _swept(where: str, cells: list[Cell]) -> tuple[str, ...]:
    """Settings that differ between cells."""
    found = []
    for name in cells[0].settings.__dataclass_fields__:  # type: ignore[attr-defined]
        values = [getattr(cell.settings, name) for cell in cells]
        if any(value != values[0] for value in values):
            if name in _COLUMNS:
                raise ParameterError(f"{where}: setting {name!r} has the name of a column of every table; rename it.")
            found.append(name)
    return tuple(found)
