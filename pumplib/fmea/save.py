"""Thesis 4.1.1, 4.3.2: FMEA tables written as the files that `pumplib.fmea.load` reads."""

import json
from collections.abc import Iterable
from pathlib import Path

from pumplib.errors import ParameterError
from pumplib.fmea.entries import OBSERVATION, Disturbance, Effect, Fault, Signal
from pumplib.fmea.model import System


def _text(value: str) -> str:
    """TOML basic string; its escapes are those of JSON, except that DEL must be escaped too."""
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")


def _list(values: Iterable[str]) -> str:
    return "[" + ", ".join(_text(value) for value in values) + "]"


def _pairs(**values: str) -> str:
    return "".join(f"{key} = {_text(value)}\n" for key, value in values.items())


def _effects(effects: Iterable[Effect]) -> str:
    lines = (
        f"  {{ event = {_text(e.event)}, certain = {str(e.certain).lower()}, provenance = {_text(e.provenance)} }},\n"
        for e in effects
    )
    return "effects = [\n" + "".join(lines) + "]\n"


def _fault(fault: Fault) -> str:
    head = _pairs(id=fault.id, name=fault.name, provenance=fault.provenance) + _effects(fault.effects)
    causes = "".join(
        f"  {{ text = {_text(c.text)}, started_by = {_list(c.started_by)}, provenance = {_text(c.provenance)} }},\n"
        for c in fault.causes
    )
    return f"\n[[fault]]\n{head}causes = [\n{causes}]\n"


def _disturbance(item: Disturbance) -> str:
    return (
        f"\n[[disturbance]]\n{_pairs(id=item.id, name=item.name, provenance=item.provenance)}{_effects(item.effects)}"
    )


def _signal(signal: Signal, order: list[str]) -> str:
    signs = "".join(symbol.removeprefix(signal.id) for symbol in signal.symbols)
    sets = ", ".join(_list(sorted(needed, key=order.index)) for needed in signal.alternatives)
    head = _pairs(id=signal.id, meaning=signal.meaning, signs=signs)
    tail = _pairs(kind=signal.kind, condition=signal.condition, provenance=signal.provenance)
    return f"\n[[signal]]\n{head}sensors = [{sets}]\n{tail}"


def _links(system: System, block: str) -> str:
    home = {event.id: event.component for event in system.events}
    blocks: dict[tuple[str, ...], dict[bool, list[str]]] = {}
    for edge in (edge for edge in system.edges if edge.component == block):
        key = (home[edge.cause], edge.kind, edge.provenance, edge.reason)
        blocks.setdefault(key, {True: [], False: []})[edge.certain].append(edge.id)
    text = ""
    for (source, kind, provenance, reason), links in blocks.items():
        text += f"\n[[propagation]]\n{_pairs(**{'from': source}, kind=kind, provenance=provenance, reason=reason)}"
        text += f"must = {_list(links[True])}\nmay = {_list(links[False])}\n"
    return text


def _component(system: System, name: str) -> str:
    component = next(item for item in system.components if item.id == name)
    signs: dict[str, tuple[str, str]] = {}
    for event in (event for event in system.events if event.component == name):
        signs[event.quantity] = (signs.get(event.quantity, ("", ""))[0] + event.sign, event.meaning)
    quantities = "".join(
        f"{key} = {{ signs = {_text(sign)}, meaning = {_text(meaning)} }}\n" for key, (sign, meaning) in signs.items()
    )
    head = _pairs(id=name, name=component.name, section=component.section)
    faults = "".join(_fault(fault) for fault in system.faults if fault.component == name)
    disturbances = "".join(_disturbance(item) for item in system.disturbances if item.component == name)
    return f"{head}\n[quantities]\n{quantities}{faults}{disturbances}{_links(system, name)}"


def save_system(system: System, folder: str | Path) -> list[Path]:
    """Write a system as a folder of tables that `pumplib.fmea.load.load_system` reads back.

    Parameters
    ----------
    system : System
        System.
    folder : str or Path
        Where to; made if absent.

    Returns
    -------
    list of Path
        The files.

    Raises
    ------
    ParameterError
        If the folder holds tables already.
    """
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    if any(folder.glob("*.toml")):
        raise ParameterError(f"{folder}: is not empty; give a folder without tables, so that no old one is left in it.")
    order = [sensor.id for sensor in system.sensors]
    files = {"system": _pairs(name=system.name, description=system.description, source=system.source)}
    files["system"] += f"components = {_list(item.id for item in system.components)}\n"
    files |= {item.id: _component(system, item.id) for item in system.components}
    files["signals"] = "".join(
        f"\n[[sensor]]\n{_pairs(id=s.id, name=s.name)}cost = {s.cost!r}\n{_pairs(provenance=s.provenance)}"
        for s in system.sensors
    )
    files["signals"] += "".join(_signal(signal, order) for signal in system.signals) + _links(system, OBSERVATION)
    groups = "".join(
        f"\n[[group]]\n{_pairs(id=g.id, name=g.name, provenance=g.provenance)}faults = {_list(g.faults)}\n"
        for g in system.groups
    )
    groups += "".join(
        f"\n[[variant]]\n{_pairs(id=v.id, group=v.group.id, name=v.group.name, provenance=v.group.provenance)}"
        f"faults = {_list(v.group.faults)}\n"
        for v in system.variants
    )
    groups += "".join(
        f"\n[[scenario]]\n{_pairs(id=s.id, name=s.name, provenance=s.provenance)}"
        f"disturbances = {_list(s.disturbances)}\n"
        for s in system.scenarios
    )
    files["groups"] = groups
    paths = [folder / f"{name}.toml" for name in files]
    for path, text in zip(paths, files.values(), strict=True):
        path.write_bytes(text.lstrip("\n").encode("utf-8"))
    return paths
