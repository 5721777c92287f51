"""Thesis 4.1.1, 4.2.1, 4.2.2: the FMEA tables of a whole system as one object.

`pumplib.fmea.load` reads it from tables; it can be built in code as well. Everything in it is data.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pumplib.errors import ParameterError
from pumplib.fmea.entries import (
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
    Sign,
    Signal,
    SignalKind,
    Variant,
    nearest,
)
from pumplib.fmea.incidence import Incidence

__all__ = [
    "EDGE_KINDS",
    "OBSERVATION",
    "SIGNAL_KINDS",
    "SIGNS",
    "Cause",
    "Component",
    "Disturbance",
    "Edge",
    "EdgeKind",
    "Effect",
    "Event",
    "Fault",
    "Group",
    "Incidence",
    "Scenario",
    "Sensor",
    "Sign",
    "Signal",
    "SignalKind",
    "System",
    "Variant",
    "nearest",
]


def _unique(what: str, names: Sequence[str]) -> None:
    seen: set[str] = set()
    for name in names:
        if name in seen:
            raise ParameterError(f"System: {what} {name!r} is there twice; give each its own id.")
        seen.add(name)


def _known(owner: str, what: str, names: Iterable[str], allowed: Iterable[str]) -> None:
    known = dict.fromkeys(allowed)
    for name in names:
        if name not in known:
            raise ParameterError(f"System: {owner}: unknown {what} {name!r}; {nearest(name, known)}")


@dataclass(frozen=True, kw_only=True)
class System:
    """FMEA tables of a whole system.

    Parameters
    ----------
    name, description, source : str
        For people.
    components : tuple of Component
        Components, without the block of the signal events.
    events : tuple of Event
        Events of the components, then signal events (component ``"OBS"``).
    faults : tuple of Fault
        Faults.
    disturbances : tuple of Disturbance
        Disturbing events.
    edges : tuple of Edge
        Nonzeros of the propagation matrices.
    signals : tuple of Signal
        Signals.
    sensors : tuple of Sensor
        Sensors.
    groups : tuple of Group
        Groups of faults, disjoint.
    variants : tuple of Variant
        Other choices for one group.
    scenarios : tuple of Scenario
        Sets of disturbing events.

    Raises
    ------
    ParameterError
        If an id is there twice or a name is used that does not exist.
    """

    name: str
    components: tuple[Component, ...]
    events: tuple[Event, ...]
    faults: tuple[Fault, ...]
    disturbances: tuple[Disturbance, ...]
    edges: tuple[Edge, ...]
    signals: tuple[Signal, ...]
    sensors: tuple[Sensor, ...]
    groups: tuple[Group, ...] = ()
    variants: tuple[Variant, ...] = ()
    scenarios: tuple[Scenario, ...] = ()
    description: str = ""
    source: str = ""
    _position: dict[str, int] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        parts: dict[str, Sequence[Any]] = {
            "component": self.components, "event": self.events, "edge": self.edges, "signal": self.signals,
            "sensor": self.sensors, "group": self.groups, "variant": self.variants, "scenario": self.scenarios,
        }  # fmt: skip
        for what in parts:
            _unique(what, [item.id for item in parts[what]])
        # one name space: the causes of a fault name events and faults, an error names either
        _unique("fault or disturbing event", [*(f.id for f in self.faults), *(d.id for d in self.disturbances)])
        object.__setattr__(self, "_position", {event.id: k for k, event in enumerate(self.events)})
        self._check_names()

    def _check_names(self) -> None:
        blocks = [*(component.id for component in self.components), OBSERVATION]
        home = {event.id: event.component for event in self.events}
        faults = [fault.id for fault in self.faults]
        for event in self.events:
            _known(f"event {event.id!r}", "component", [event.component], blocks)
        for fault in self.faults:
            owner = f"fault {fault.id!r}"
            _known(owner, "component", [fault.component], blocks[:-1])
            _known(owner, "event", (effect.event for effect in fault.effects), home)
            started_by = (name for cause in fault.causes for name in cause.started_by)
            _known(owner, "event or fault", started_by, [*home, *faults])
        for disturbance in self.disturbances:
            owner = f"disturbing event {disturbance.id!r}"
            _known(owner, "component", [disturbance.component], blocks[:-1])
            _known(owner, "event", (effect.event for effect in disturbance.effects), home)
        for edge in self.edges:
            _known(f"edge {edge.id!r}", "event", (edge.cause, edge.effect), home)
            _known(f"edge {edge.id!r}", "kind", [edge.kind], EDGE_KINDS)
            if edge.component != home[edge.effect]:
                raise ParameterError(
                    f"System: edge {edge.id!r}: component = {edge.component!r}, but its effect belongs to "
                    f"{home[edge.effect]!r}; give the component of the effect."
                )
        sensors = [sensor.id for sensor in self.sensors]
        for signal in self.signals:
            _known(f"signal {signal.id!r}", "event", signal.symbols, home)
            for needed in signal.alternatives:
                _known(f"signal {signal.id!r}", "sensor", sorted(needed), sensors)
        for group in (*self.groups, *(variant.group for variant in self.variants)):
            _known(f"group {group.id!r}", "fault", group.faults, faults)
        _unique("fault in the groups", [name for group in self.groups for name in group.faults])
        for variant in self.variants:
            _known(f"variant {variant.id!r}", "group", [variant.group.id], [group.id for group in self.groups])
        for scenario in self.scenarios:
            names = [disturbance.id for disturbance in self.disturbances]
            _known(f"scenario {scenario.id!r}", "disturbing event", scenario.disturbances, names)

    def position(self, event: str) -> int:
        """Index of an event.

        Parameters
        ----------
        event : str
            Event.

        Returns
        -------
        int

        Raises
        ------
        ParameterError
            If there is no such event; the closest one is named.
        """
        if event not in self._position:
            raise ParameterError(f"event {event!r}: not in system {self.name!r}; {nearest(event, self._position)}")
        return self._position[event]

    def _named(self, what: str, name: str, items: Sequence[Any]) -> Any:
        for item in items:
            if item.id == name:
                return item
        allowed = ", ".join(item.id for item in items) or "none"
        raise ParameterError(f"{what} {name!r}: not in system {self.name!r}; allowed are {allowed}.")

    def event(self, name: str) -> Event:
        """Event of this name.

        Parameters
        ----------
        name : str
            Event.

        Returns
        -------
        Event
        """
        return self.events[self.position(name)]

    def fault(self, name: str) -> Fault:
        """Fault of this name.

        Parameters
        ----------
        name : str
            Fault.

        Returns
        -------
        Fault
        """
        found: Fault = self._named("fault", name, self.faults)
        return found

    def disturbance(self, name: str) -> Disturbance:
        """Disturbing event of this name.

        Parameters
        ----------
        name : str
            Disturbing event.

        Returns
        -------
        Disturbance
        """
        found: Disturbance = self._named("disturbing event", name, self.disturbances)
        return found

    def signal(self, name: str) -> Signal:
        """Signal of this name.

        Parameters
        ----------
        name : str
            Signal.

        Returns
        -------
        Signal
        """
        found: Signal = self._named("signal", name, self.signals)
        return found

    def scenario(self, name: str) -> Scenario:
        """Scenario of this name.

        Parameters
        ----------
        name : str
            Scenario.

        Returns
        -------
        Scenario
        """
        found: Scenario = self._named("scenario", name, self.scenarios)
        return found

    def group(self, name: str) -> Group:
        """Group of this name.

        Parameters
        ----------
        name : str
            Group.

        Returns
        -------
        Group
        """
        found: Group = self._named("group", name, self.groups)
        return found

    @cached_property
    def ends(self) -> tuple[str, ...]:
        """Signal events, in the order of the signals."""
        return tuple(symbol for signal in self.signals for symbol in signal.symbols)

    @cached_property
    def progressions(self) -> tuple[tuple[str, str], ...]:
        """Pairs (event or fault, fault that it can start), from the causes of the faults."""
        return tuple(
            (source, fault.id) for fault in self.faults for cause in fault.causes for source in cause.started_by
        )

    def choose(self, variant: str) -> "System":
        """System with another choice for its uncertain group.

        Parameters
        ----------
        variant : str
            Id of a variant.

        Returns
        -------
        System
        """
        chosen: Variant = self._named("variant", variant, self.variants)
        groups = tuple(chosen.group if group.id == chosen.group.id else group for group in self.groups)
        return replace(self, groups=groups)

    def select(self, *, kinds: Iterable[str] = EDGE_KINDS, certain_only: bool = False) -> "System":
        """System with some kinds of edges only.

        Parameters
        ----------
        kinds : iterable of str
            Edge kinds to keep.
        certain_only : bool
            Keep must entries only, in edges and in the effects of faults and disturbing events.

        Returns
        -------
        System

        Raises
        ------
        ParameterError
            If a kind does not exist.
        """
        kept = frozenset(kinds)
        for name in sorted(kept - set(EDGE_KINDS)):
            raise ParameterError(f"kinds: unknown edge kind {name!r}; allowed are {', '.join(EDGE_KINDS)}.")
        edges = tuple(e for e in self.edges if e.kind in kept and (e.certain or not certain_only))
        if not certain_only:
            return replace(self, edges=edges)

        def sure(effects: tuple[Effect, ...]) -> tuple[Effect, ...]:
            return tuple(effect for effect in effects if effect.certain)

        return replace(
            self,
            edges=edges,
            faults=tuple(replace(fault, effects=sure(fault.effects)) for fault in self.faults),
            disturbances=tuple(replace(item, effects=sure(item.effects)) for item in self.disturbances),
        )

    def drop(self, edges: Iterable[str]) -> "System":
        """System without some edges.

        Parameters
        ----------
        edges : iterable of str
            Edges by name, ``"Q+ -> hf+"``.

        Returns
        -------
        System
        """
        gone = self._edge_names(edges)
        return replace(self, edges=tuple(edge for edge in self.edges if edge.id not in gone))

    def weaken(self, edges: Iterable[str]) -> "System":
        """System in which some edges are may instead of must.

        Parameters
        ----------
        edges : iterable of str
            Edges by name.

        Returns
        -------
        System
        """
        weak = self._edge_names(edges)
        return replace(
            self, edges=tuple(replace(edge, certain=False) if edge.id in weak else edge for edge in self.edges)
        )

    def _edge_names(self, edges: Iterable[str]) -> frozenset[str]:
        names = tuple(edges)
        known = {edge.id for edge in self.edges}
        for name in names:
            if name not in known:
                raise ParameterError(f"edge {name!r}: not in system {self.name!r}; {nearest(name, sorted(known))}")
        return frozenset(names)

    def incidence(self) -> Incidence:
        """Index arrays of the whole system; use `select`, `drop` and `weaken` before.

        Returns
        -------
        Incidence
        """
        blocks = [component.id for component in self.components]
        if any(event.component == OBSERVATION for event in self.events):
            blocks.append(OBSERVATION)
        number = {name: k for k, name in enumerate(blocks)}
        at = self._position

        def index(values: Iterable[int]) -> NDArray[np.intp]:
            return np.fromiter(values, dtype=np.intp)

        def flags(values: Iterable[bool]) -> NDArray[np.bool_]:
            return np.fromiter(values, dtype=np.bool_)

        raised_by_fault = [(effect, k) for k, fault in enumerate(self.faults) for effect in fault.effects]
        raised_by_disturbance = [(effect, k) for k, item in enumerate(self.disturbances) for effect in item.effects]
        return Incidence(
            events=tuple(event.id for event in self.events),
            blocks=tuple(blocks),
            block=index(number[event.component] for event in self.events),
            cause=index(at[edge.cause] for edge in self.edges),
            effect=index(at[edge.effect] for edge in self.edges),
            certain=flags(edge.certain for edge in self.edges),
            kind=np.fromiter((EDGE_KINDS.index(edge.kind) for edge in self.edges), dtype=np.int8),
            edges=self.edges,
            faults=tuple(fault.id for fault in self.faults),
            fault_event=index(at[effect.event] for effect, _ in raised_by_fault),
            fault=index(k for _, k in raised_by_fault),
            fault_certain=flags(effect.certain for effect, _ in raised_by_fault),
            disturbances=tuple(item.id for item in self.disturbances),
            disturbance_event=index(at[effect.event] for effect, _ in raised_by_disturbance),
            disturbance=index(k for _, k in raised_by_disturbance),
            disturbance_certain=flags(effect.certain for effect, _ in raised_by_disturbance),
            ends=index(at[name] for name in self.ends),
        )
