"""Thesis 4.1.1, 4.3.2: FMEA tables read from files, every mistake named with file, entry, value and remedy.

A system is a folder: ``system.toml`` lists the components, each component has a file of its own name
(``HY.toml``), ``signals.toml`` holds sensors and signals, ``groups.toml`` (if there) groups and scenarios.
"""

import re
import tomllib
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, cast

from pumplib.errors import ParameterError
from pumplib.fmea.model import (
    EDGE_KINDS,
    OBSERVATION,
    SIGNAL_KINDS,
    SIGNS,
    Cause,
    Component,
    Disturbance,
    Edge,
    EdgeKind,
    Effect,
    Event,
    Fault,
    Group,
    Scenario,
    Sensor,
    Signal,
    SignalKind,
    System,
    Variant,
    nearest,
)
from pumplib.paths import DATA

FOLDER = DATA / "fmea"
ORIGINS = ("text", "definition", "literature", "assumption")
_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*")
_WHERE = re.compile(r"\d+(\.\d+)*|(figure|equation) \d+\.\d+|nomenclature")
_COMMON = ("system", "signals", "groups")


class _Entry:
    """One table of a file with strict access to its fields; its errors name file, entry and field."""

    def __init__(self, where: str, raw: Any, fields: Iterable[str]) -> None:
        if not isinstance(raw, dict):
            raise ParameterError(f"{where} = {raw!r}: must be a table with the fields {', '.join(fields)}.")
        self.where, self.raw = where, raw
        allowed = list(fields)
        for key in raw:
            if key not in allowed:
                raise ParameterError(f"{where}: unknown field {key!r}; {nearest(key, allowed)}")

    def fail(self, name: str, problem: str) -> ParameterError:
        return ParameterError(f"{self.where}: {name} = {self.raw.get(name)!r}: {problem}")

    def _get(self, name: str, default: Any) -> Any:
        if name in self.raw:
            return self.raw[name]
        if default is None:
            raise ParameterError(f"{self.where}: {name} is missing; every such entry needs it.")
        return default

    def text(self, name: str, default: str | None = None) -> str:
        value = self._get(name, default)
        if not isinstance(value, str) or (default is None and not value.strip()):
            raise self.fail(name, "must be a text that is not empty.")
        return value

    def flag(self, name: str) -> bool:
        value = self._get(name, None)
        if not isinstance(value, bool):
            raise self.fail(name, "must be true (it must appear) or false (it may appear).")
        return value

    def names(self, name: str, default: list[str] | None = None) -> list[str]:
        value = self._get(name, default)
        if not isinstance(value, list) or not all(isinstance(item, str) for item in value):
            raise self.fail(name, "must be a list of texts.")
        for item in value:
            if value.count(item) > 1:
                raise self.fail(name, f"{item!r} is there twice; keep one.")
        return list(value)

    def choice(self, name: str, allowed: Iterable[str]) -> str:
        value, names = self.text(name), list(allowed)
        if value not in names:
            raise self.fail(name, f"unknown; {nearest(value, names)} Allowed are {', '.join(names)}.")
        return value

    def tables(self, name: str) -> list[Any]:
        value = self._get(name, [])
        if not isinstance(value, list):
            raise self.fail(name, "must be a list of tables.")
        return value

    def provenance(self) -> str:
        if "provenance" not in self.raw:
            raise ParameterError(
                f"{self.where}: provenance is missing; say where the entry comes from: {', '.join(ORIGINS)}."
            )
        value = self.text("provenance")
        for part in value.split("; "):
            kind, _, place = part.partition(" ")
            if kind not in ORIGINS:
                raise self.fail("provenance", f"unknown kind {kind!r}; {nearest(kind, ORIGINS)}")
            if kind == "text" and not all(_WHERE.fullmatch(item) for item in place.split(", ")):
                raise self.fail(
                    "provenance", "text needs the place, such as 'text 2.3', 'text figure 3.2', 'text nomenclature'."
                )
        return value


def _read(path: Path) -> dict[str, Any]:
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise ParameterError(f"{path}: no such file; a system needs {path.name}.") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ParameterError(f"{path.name}: not readable as TOML: {error}") from None


@dataclass
class _Tables:
    """What has been read so far; names are resolved only when all events are known."""

    home: dict[str, str] = field(default_factory=dict)
    events: list[Event] = field(default_factory=list)
    faults: dict[str, Fault] = field(default_factory=dict)
    disturbances: dict[str, Disturbance] = field(default_factory=dict)
    edges: dict[str, tuple[Edge, str]] = field(default_factory=dict)
    seen: dict[str, str] = field(default_factory=dict)

    def claim(self, what: str, name: str, where: str) -> None:
        """Refuse an id that is there already."""
        key = f"{what} {name}"
        if key in self.seen:
            raise ParameterError(f"{where}: {what} {name!r} is there already ({self.seen[key]}); rename or remove one.")
        self.seen[key] = where

    def add_event(self, event: Event, where: str) -> None:
        self.claim("event", event.id, where)
        self.events.append(event)
        self.home[event.id] = event.component

    def event(self, name: str, where: str) -> str:
        """Check a name of an event."""
        if name in self.home:
            return name
        signed = [name + sign for sign in SIGNS if name + sign in self.home]
        if signed:
            raise ParameterError(f"{where}: event {name!r}: the sign is missing; write {' or '.join(signed)}.")
        raise ParameterError(f"{where}: unknown event {name!r}; {nearest(name, self.home)}")

    def effects(self, entry: _Entry) -> tuple[Effect, ...]:
        found: dict[str, Effect] = {}
        for raw in entry.tables("effects"):
            item = _Entry(f"{entry.where}: effects", raw, ("event", "certain", "provenance"))
            name = self.event(item.text("event"), item.where)
            if name in found:
                raise item.fail("event", "is there twice; keep one.")
            if self.home[name] == OBSERVATION:
                raise item.fail("event", "a signal event is no effect of a fault; go through an event of a component.")
            found[name] = Effect(event=name, certain=item.flag("certain"), provenance=item.provenance())
        if not found:
            raise ParameterError(f"{entry.where}: effects is missing or empty; give at least one event.")
        return tuple(found.values())

    def propagation(self, raw: Any, block: str, blocks: Iterable[str], where: str) -> None:
        entry = _Entry(where, raw, ("from", "kind", "provenance", "reason", "must", "may"))
        source = entry.choice("from", blocks)
        kind, provenance, reason = (
            cast(EdgeKind, entry.choice("kind", EDGE_KINDS)),
            entry.provenance(),
            entry.text("reason", ""),
        )
        links = [(link, True) for link in entry.names("must", [])] + [(link, False) for link in entry.names("may", [])]
        if not links:
            raise ParameterError(f"{where}: has neither must nor may links; give links such as 'Q+ -> Hi-'.")
        for link, certain in links:
            here = f"{where}: link {link!r}"
            parts = link.split(" -> ")
            if len(parts) != 2:
                raise ParameterError(f"{here}: write cause and effect as 'Q+ -> Hi-', with spaces around the arrow.")
            cause, effect = (self.event(name, here) for name in parts)
            if cause == effect:
                raise ParameterError(f"{here}: an event cannot raise itself; remove the link.")
            for name, belongs, wanted in ((cause, source, "from"), (effect, block, "this file")):
                if self.home[name] != belongs:
                    raise ParameterError(
                        f"{here}: {name} belongs to {self.home[name]}, not to {belongs} ({wanted}); "
                        + (f"write from = {self.home[name]!r}." if wanted == "from" else "move the link to that file.")
                    )
            edge = Edge(
                cause=cause, effect=effect, component=block, certain=certain, kind=kind, provenance=provenance,
                reason=reason,
            )  # fmt: skip
            self.claim("link", edge.id, here)
            self.edges[edge.id] = (edge, here)


def _quantities(raw: Any, component: str, file: str, tables: _Tables) -> None:
    where = f"{file}: quantities"
    for name, content in _Entry(where, raw, raw if isinstance(raw, dict) else ()).raw.items():
        entry = _Entry(f"{where}.{name}", content, ("signs", "meaning"))
        if not _NAME.fullmatch(name):
            raise ParameterError(f"{entry.where}: a quantity is letters and digits without sign; {name!r} is not.")
        meaning = entry.text("meaning")
        for sign in _signs(entry):
            event = Event(id=name + sign, quantity=name, sign=sign, component=component, meaning=meaning)
            tables.add_event(event, entry.where)


def _signs(entry: _Entry) -> Any:
    if "signs" not in entry.raw:
        raise ParameterError(f"{entry.where}: the sign is missing; write signs = '+-', '+' or '-'.")
    if entry.raw["signs"] not in ("+-", "+", "-"):
        raise entry.fail("signs", "must be '+-', '+' or '-'.")
    return entry.raw["signs"]


def _identified(raw: Any, file: str, what: str, fields: Iterable[str]) -> tuple[_Entry, str]:
    """Entry of a list and its id; messages name the entry by its id as soon as there is one."""
    known = raw.get("id") if isinstance(raw, dict) else None
    entry = _Entry(f"{file}: {what} {known}" if isinstance(known, str) else f"{file}: {what}", raw, ("id", *fields))
    return entry, entry.text("id")


def _fault(raw: Any, component: str, file: str, tables: _Tables) -> None:
    entry, name = _identified(raw, file, "fault", ("name", "provenance", "effects", "causes"))
    tables.claim("fault or disturbance", name, entry.where)
    causes = []
    for item in entry.tables("causes"):
        cause = _Entry(f"{entry.where}: causes", item, ("text", "started_by", "provenance"))
        causes.append(
            Cause(
                text=cause.text("text"),
                started_by=tuple(cause.names("started_by", [])),
                provenance=cause.provenance(),
            )
        )
    tables.faults[name] = Fault(
        id=name, name=entry.text("name"), component=component, effects=tables.effects(entry), causes=tuple(causes),
        provenance=entry.provenance(),
    )  # fmt: skip


def _disturbance(raw: Any, component: str, file: str, tables: _Tables) -> None:
    entry, name = _identified(raw, file, "disturbance", ("name", "provenance", "effects"))
    tables.claim("fault or disturbance", name, entry.where)
    tables.disturbances[name] = Disturbance(
        id=name, name=entry.text("name"), component=component, effects=tables.effects(entry),
        provenance=entry.provenance(),
    )  # fmt: skip


def _sensor(raw: Any, file: str, tables: _Tables) -> Sensor:
    entry, name = _identified(raw, file, "sensor", ("name", "cost", "provenance"))
    tables.claim("sensor", name, entry.where)
    cost = entry.raw.get("cost", 1.0)
    if isinstance(cost, bool) or not isinstance(cost, int | float) or not 0 < cost < float("inf"):
        raise entry.fail("cost", "must be a number > 0 (relative cost).")
    return Sensor(id=name, name=entry.text("name"), cost=float(cost), provenance=entry.provenance())


def _signal(raw: Any, file: str, sensors: Iterable[str], tables: _Tables) -> Signal:
    fields = ("meaning", "signs", "sensors", "kind", "condition", "provenance")
    entry, name = _identified(raw, file, "signal", fields)
    tables.claim("signal", name, entry.where)
    known = list(sensors)
    alternatives = []
    for needed in entry.tables("sensors"):
        if not isinstance(needed, list) or not needed:
            raise entry.fail("sensors", 'each alternative is a list of sensors that is not empty: [["dp"], ["pin"]].')
        for sensor in needed:
            if sensor not in known:
                raise ParameterError(f"{entry.where}: unknown sensor {sensor!r}; {nearest(str(sensor), known)}")
        alternatives.append(frozenset(needed))
    if not alternatives:
        raise ParameterError(f"{entry.where}: sensors is missing or empty; give at least one set of sensors.")
    meaning = entry.text("meaning")
    symbols = []
    for sign in _signs(entry):
        event = Event(id=name + sign, quantity=name, sign=sign, component=OBSERVATION, meaning=meaning)
        tables.add_event(event, entry.where)
        symbols.append(event.id)
    return Signal(
        id=name, meaning=meaning, symbols=tuple(symbols), alternatives=tuple(alternatives),
        kind=cast(SignalKind, entry.choice("kind", SIGNAL_KINDS)), condition=entry.text("condition", ""),
        provenance=entry.provenance(),
    )  # fmt: skip


def _members(entry: _Entry, field_name: str, what: str, known: Iterable[str]) -> tuple[str, ...]:
    names = list(known)
    for item in entry.names(field_name):
        if item not in names:
            raise ParameterError(f"{entry.where}: unknown {what} {item!r}; {nearest(item, names)}")
    return tuple(entry.raw[field_name])


def _groups(
    raw: dict[str, Any], file: str, tables: _Tables
) -> tuple[tuple[Group, ...], tuple[Variant, ...], tuple[Scenario, ...]]:
    top = _Entry(file, raw, ("group", "variant", "scenario"))
    groups: dict[str, Group] = {}
    owner: dict[str, str] = {}
    for item in top.tables("group"):
        entry, name = _identified(item, file, "group", ("name", "faults", "provenance"))
        tables.claim("group", name, entry.where)
        groups[name] = _group(entry, name, tables, owner)
        owner |= dict.fromkeys(groups[name].faults, name)
    variants = []
    for item in top.tables("variant"):
        entry, name = _identified(item, file, "variant", ("group", "name", "faults", "provenance"))
        tables.claim("variant", name, entry.where)
        target = entry.choice("group", groups)
        others = {fault: group for fault, group in owner.items() if group != target}
        variants.append(Variant(id=name, group=_group(entry, target, tables, others)))
    scenarios = []
    for item in top.tables("scenario"):
        entry, name = _identified(item, file, "scenario", ("name", "disturbances", "provenance"))
        tables.claim("scenario", name, entry.where)
        members = _members(entry, "disturbances", "disturbance", tables.disturbances)
        scenario = Scenario(id=name, name=entry.text("name"), disturbances=members, provenance=entry.provenance())
        scenarios.append(scenario)
    return tuple(groups.values()), tuple(variants), tuple(scenarios)


def _group(entry: _Entry, name: str, tables: _Tables, taken: Mapping[str, str]) -> Group:
    faults = _members(entry, "faults", "fault", tables.faults)
    if not faults:
        raise entry.fail("faults", "must not be empty; a group has at least one fault.")
    for fault in faults:
        if fault in taken:
            raise ParameterError(f"{entry.where}: fault {fault!r} is in group {taken[fault]} already; keep it in one.")
    return Group(id=name, name=entry.text("name"), faults=faults, provenance=entry.provenance())


def _component_files(folder: Path, top: _Entry) -> list[str]:
    names = top.names("components")
    if not names:
        raise top.fail("components", "must name at least one component.")
    for name in names:
        if not _NAME.fullmatch(name) or name in (OBSERVATION, *_COMMON):
            raise top.fail("components", f"{name!r} cannot be the id of a component; use letters and digits.")
    for path in sorted(folder.glob("*.toml")):
        if path.stem not in (*names, *_COMMON):
            raise ParameterError(
                f"{path.name}: is not in components of system.toml; add {path.stem!r} there or remove the file."
            )
    return names


def load_system(folder: str | Path) -> System:
    """Read and check the FMEA tables of a system.

    Parameters
    ----------
    folder : str or Path
        Folder with ``system.toml``, one file a component, ``signals.toml`` and perhaps ``groups.toml``.

    Returns
    -------
    System

    Raises
    ------
    ParameterError
        If a file is absent or no TOML; if a field is missing, unknown or of the wrong type; if an id is there twice;
        if an event, component, kind, sensor, fault or disturbing event is named that does not exist; if a sign or
        a provenance is missing; if a link dangles or stands in the wrong file; if an event is never used. The
        message names file, entry, value and remedy.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise ParameterError(f"{folder}: no such folder; shipped systems are {', '.join(shipped_names())}.")
    top = _Entry("system.toml", _read(folder / "system.toml"), ("name", "description", "source", "components"))
    names = _component_files(folder, top)
    raw = {name: _read(folder / f"{name}.toml") for name in (*names, "signals")}
    tables = _Tables()
    components = []
    for name in names:
        file = f"{name}.toml"
        fields = ("id", "name", "section", "quantities", "fault", "disturbance", "propagation")
        entry = _Entry(file, raw[name], fields)
        if entry.text("id") != name:
            raise ParameterError(f"{file}: id = {entry.raw['id']!r}: must be {name!r}, the name of the file.")
        components.append(Component(id=name, name=entry.text("name"), section=entry.text("section", "")))
        _quantities(entry.raw.get("quantities", {}), name, file, tables)
    observed = _Entry("signals.toml", raw["signals"], ("sensor", "signal", "propagation"))
    sensors = tuple(_sensor(item, "signals.toml", tables) for item in observed.tables("sensor"))
    known = [sensor.id for sensor in sensors]
    signals = tuple(_signal(item, "signals.toml", known, tables) for item in observed.tables("signal"))
    readers: tuple[tuple[str, Callable[[Any, str, str, _Tables], None]], ...]
    readers = (("fault", _fault), ("disturbance", _disturbance))
    for block in (*names, OBSERVATION):
        file = "signals.toml" if block == OBSERVATION else f"{block}.toml"
        content = raw["signals" if block == OBSERVATION else block]
        entry = _Entry(file, content, content)
        for what, reader in readers if block != OBSERVATION else ():
            for item in entry.tables(what):
                reader(item, block, file, tables)
        for number, item in enumerate(entry.tables("propagation"), 1):
            tables.propagation(item, block, names, f"{file}: propagation {number}")
    _check_started_by(tables)
    _check_used(tables)
    path = folder / "groups.toml"
    groups, variants, scenarios = _groups(_read(path), path.name, tables) if path.is_file() else ((), (), ())
    return System(
        name=top.text("name"), description=top.text("description"), source=top.text("source"),
        components=tuple(components), events=tuple(tables.events), faults=tuple(tables.faults.values()),
        disturbances=tuple(tables.disturbances.values()), edges=tuple(edge for edge, _ in tables.edges.values()),
        signals=signals, sensors=sensors, groups=groups, variants=variants, scenarios=scenarios,
    )  # fmt: skip


def _check_started_by(tables: _Tables) -> None:
    known = [*tables.home, *tables.faults]
    for fault in tables.faults.values():
        for name in (name for cause in fault.causes for name in cause.started_by):
            if name not in known:
                raise ParameterError(
                    f"{fault.component}.toml: fault {fault.id}: causes: started_by = {name!r}: no such event or fault; "
                    f"{nearest(name, known)}"
                )


def _check_used(tables: _Tables) -> None:
    used = {name for edge, _ in tables.edges.values() for name in (edge.cause, edge.effect)}
    used |= {effect.event for fault in tables.faults.values() for effect in fault.effects}
    used |= {effect.event for disturbance in tables.disturbances.values() for effect in disturbance.effects}
    for event in tables.events:
        if event.id not in used:
            raise ParameterError(
                f"{tables.seen[f'event {event.id}']}: event {event.id!r} is neither raised nor raises anything; "
                "add a link or remove its sign."
            )


def shipped_names() -> tuple[str, ...]:
    """Names of the systems that come with the workbook.

    Returns
    -------
    tuple of str
        For `shipped`.
    """
    return tuple(sorted(path.parent.name for path in FOLDER.glob("*/system.toml")))


def shipped(name: str) -> System:
    """System that comes with the workbook.

    Parameters
    ----------
    name : str
        One of `shipped_names`, for example ``"pump"``.

    Returns
    -------
    System

    Raises
    ------
    ParameterError
        If there is no such system.
    """
    if name not in shipped_names():
        raise ParameterError(f"system {name!r}: is not shipped; allowed are {', '.join(shipped_names())}.")
    return load_system(FOLDER / name)
