"""Thesis 4.2.2, 4.3.5: what the choice of sensors hangs on: single table entries, and faults outside the groups."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pumplib.errors import ParameterError
from pumplib.fmea import System
from pumplib.propagation.build import Effects, propagate
from pumplib.propagation.sensors import Goal, demands, minimal_sets
from pumplib.propagation.symbols import separating

Array = NDArray[Any]
Sets = tuple[frozenset[str], ...]


@dataclass(frozen=True, kw_only=True, slots=True)
class Change:
    """One table entry and what the minimal sets of sensors become without it.

    Parameters
    ----------
    entry : str
        Edge, ``"Zn+ -> yZn+"``, or entry of a fault, ``"HY1: kh-"``.
    how : {"weakened", "dropped"}
        Must became may, or the entry was taken out.
    provenance : str
        Where the entry comes from.
    sets : dict of str to tuple of frozenset of str
        Minimal sets of the goals that changed.
    """

    entry: str
    how: str
    provenance: str
    sets: dict[str, Sets]


def weaken_effect(system: System, fault: str, event: str) -> System:
    """System in which a fault may, instead of must, raise an event.

    Parameters
    ----------
    system : System
        FMEA tables.
    fault : str
        Fault.
    event : str
        Event that the fault raises.

    Returns
    -------
    System

    Raises
    ------
    ParameterError
        If the fault does not raise the event.
    """
    chosen = system.fault(fault)
    if event not in [effect.event for effect in chosen.effects]:
        raise ParameterError(f"fault {fault!r}: raises {[e.event for e in chosen.effects]}, not {event!r}.")
    effects = tuple(replace(one, certain=False) if one.event == event else one for one in chosen.effects)
    weaker = replace(chosen, effects=effects)
    return replace(system, faults=tuple(weaker if one.id == fault else one for one in system.faults))


def _variations(system: System, dropped: Callable[[str], bool]) -> Iterable[tuple[str, str, str, System]]:
    for edge in system.edges:
        if edge.kind == "effect" and edge.certain:
            yield edge.id, "weakened", edge.provenance, system.weaken([edge.id])
        if edge.kind == "effect" and dropped(edge.provenance):
            yield edge.id, "dropped", edge.provenance, system.drop([edge.id])
    grouped = {name for group in system.groups for name in group.faults}
    for fault in system.faults:
        for effect in fault.effects:
            if effect.certain and fault.id in grouped:
                weaker = weaken_effect(system, fault.id, effect.event)
                yield f"{fault.id}: {effect.event}", "weakened", effect.provenance, weaker


def sensitivity(
    system: System,
    scenario: str,
    goals: Mapping[str, tuple[Goal, Sequence[str]]],
    dropped: Callable[[str], bool] = lambda provenance: "assumption" in provenance,
) -> tuple[Change, ...]:
    """Table entries that the minimal sets of sensors depend on, each changed alone.

    Parameters
    ----------
    system : System
        FMEA tables.
    scenario : str
        Disturbing events to be tolerated.
    goals : mapping of str to (goal, groups)
        ``{"isolate G1-G6": ("isolate", ["G1", ...])}``.
    dropped : callable, optional
        Whether an edge of this provenance is also dropped; by default those that are assumptions.

    Returns
    -------
    tuple of Change
        Entries that change something: the ones to verify first.
    """
    disturbances = system.scenario(scenario).disturbances

    def answer(tables: System) -> dict[str, Sets]:
        effects = propagate(tables).narrow(disturbances=disturbances)
        return {name: minimal_sets(demands(effects, goal, groups)) for name, (goal, groups) in goals.items()}

    base, found = answer(system), []
    for entry, how, provenance, tables in _variations(system, dropped):
        sets = answer(tables)
        if changed := {name: sets[name] for name in goals if sets[name] != base[name]}:
            found.append(Change(entry=entry, how=how, provenance=provenance, sets=changed))
    return tuple(found)


@dataclass(frozen=True, kw_only=True, slots=True)
class Outsider:
    """A fault outside the groups, as the decision logic sees it.

    Parameters
    ----------
    fault : str
        Fault.
    shows : bool
        Whether it shows for certain, whatever the disturbing events do.
    taken_for : tuple of str
        Groups that it can look like.
    """

    fault: str
    shows: bool
    taken_for: tuple[str, ...]


def outsiders(effects: Effects, sensors: Iterable[str], groups: Iterable[str]) -> tuple[Outsider, ...]:
    """What faults outside the groups look like.

    Parameters
    ----------
    effects : Effects
        Of all faults, narrowed to the disturbing events to be tolerated.
    sensors : iterable of str
        Sensors that are fitted.
    groups : iterable of str
        Groups that are watched.

    Returns
    -------
    tuple of Outsider
        One for each fault outside.
    """
    system, fitted = effects.system, list(sensors)
    seen = effects.narrow(signals=[name for name in effects.signals if system.signal(name).revealed(fitted)])
    pairs, alone = separating(seen.must, seen.may, seen.hit)
    apart, visible = np.any(pairs, axis=0), np.any(alone, axis=0)
    members = {name: [seen.faults.index(fault) for fault in system.group(name).faults] for name in groups}
    inside = {k for some in members.values() for k in some}
    return tuple(
        Outsider(
            fault=fault,
            shows=bool(visible[k]),
            taken_for=tuple(name for name, some in members.items() if not all(apart[k, j] for j in some)),
        )
        for k, fault in enumerate(seen.faults)
        if k not in inside
    )
