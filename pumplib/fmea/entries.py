"""Thesis 4.1.1, 4.2.2: the entries of FMEA tables: events, effects, faults, edges, signals, groups.

A deviation of a quantity in one direction is an event, written ``Hi-``. A fault or a disturbing event raises events
by itself, an edge raises one event from another, and signal events (``yrH-``) are what sensors can show.
Chapter 4 and appendix A of the thesis do not survive: the classes follow the nomenclature, the attributes of edges
are a reconstruction.
"""

import difflib
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal, get_args

from pumplib.errors import ParameterError

Sign = Literal["+", "-"]
EdgeKind = Literal["effect", "progression", "drift"]
SignalKind = Literal["raw", "phasor", "spectral", "slope", "residual"]
EDGE_KINDS: tuple[str, ...] = get_args(EdgeKind)
SIGNAL_KINDS: tuple[str, ...] = get_args(SignalKind)
OBSERVATION = "OBS"
"""Name of the block that holds the signal events; it is no component."""
SIGNS = ("+", "-")


def nearest(value: str, allowed: Iterable[str]) -> str:
    """Remedy for a misspelt name: the closest allowed one, else all of them.

    Parameters
    ----------
    value : str
        What was written.
    allowed : iterable of str
        What could have been meant.

    Returns
    -------
    str
        Text to be put at the end of a message.
    """
    names = list(dict.fromkeys(allowed))
    # case is the commonest slip; difflib alone would rank "q+" far from "Q+"
    folded = {name.casefold(): name for name in names}
    guess = folded.get(value.casefold())
    close = [guess] if guess else difflib.get_close_matches(value, names, 1, 0.5)
    if close:
        return f"did you mean {close[0]!r}?"
    shown = ", ".join(names[:24]) + (", ..." if len(names) > 24 else "")
    return f"there are {shown}." if names else "there are none."


@dataclass(frozen=True, kw_only=True, slots=True)
class Component:
    """One part of the system, with a table of its own.

    Parameters
    ----------
    id : str
        Short name, ``"HY"``.
    name : str
        For people.
    section : str
        Where the table belongs, ``"A.5"``.
    """

    id: str
    name: str
    section: str = ""


@dataclass(frozen=True, kw_only=True, slots=True)
class Event:
    """Deviation of one quantity in one direction.

    Parameters
    ----------
    id : str
        Quantity and sign, ``"Hi-"``.
    quantity : str
        ``"Hi"``.
    sign : {"+", "-"}
        Direction.
    component : str
        Component that the event belongs to, or ``"OBS"`` for a signal event.
    meaning : str
        Of the quantity, for people.
    """

    id: str
    quantity: str
    sign: Sign
    component: str
    meaning: str = ""

    def __post_init__(self) -> None:
        if self.sign not in SIGNS or self.id != self.quantity + self.sign:
            raise ParameterError(
                f"Event.id = {self.id!r}: must be the quantity {self.quantity!r} followed by its sign + or -."
            )


@dataclass(frozen=True, kw_only=True, slots=True)
class Effect:
    """Event that a fault or a disturbing event raises by itself.

    Parameters
    ----------
    event : str
        Event.
    certain : bool
        Whether it must appear (else it may).
    provenance : str
        Where the entry comes from.
    """

    event: str
    certain: bool
    provenance: str = ""


@dataclass(frozen=True, kw_only=True, slots=True)
class Cause:
    """What can start a fault.

    Parameters
    ----------
    text : str
        For people.
    started_by : tuple of str
        Events or faults of the same system that can be this cause.
    provenance : str
        Where the entry comes from.
    """

    text: str
    started_by: tuple[str, ...] = ()
    provenance: str = ""


@dataclass(frozen=True, kw_only=True, slots=True)
class Fault:
    """One fault of one component.

    Parameters
    ----------
    id : str
        ``"HY1"``.
    name : str
        For people.
    component : str
        The component in whose table it stands; its effects may lie in another one.
    effects : tuple of Effect
        At least one.
    causes : tuple of Cause
        For people, and for the progression of one fault to another.
    provenance : str
        Where the entry comes from.
    """

    id: str
    name: str
    component: str
    effects: tuple[Effect, ...]
    causes: tuple[Cause, ...] = ()
    provenance: str = ""


@dataclass(frozen=True, kw_only=True, slots=True)
class Disturbance:
    """Disturbing event: happens in healthy operation and must not raise an alarm.

    Parameters
    ----------
    id : str
        ``"d_load+"``.
    name : str
        For people.
    component : str
        The component in whose table it stands.
    effects : tuple of Effect
        At least one.
    provenance : str
        Where the entry comes from.
    """

    id: str
    name: str
    component: str
    effects: tuple[Effect, ...]
    provenance: str = ""


@dataclass(frozen=True, kw_only=True, slots=True)
class Edge:
    """One nonzero of a propagation matrix: the cause raises the effect.

    Parameters
    ----------
    cause, effect : str
        Events.
    component : str
        The component of the effect; the matrix is A_{component, component of the cause}.
    certain : bool
        Must (else may).
    kind : {"effect", "progression", "drift"}
        Ordinary effect; an effect that starts another fault; drift of a parameter.
    provenance : str
        Where the entry comes from.
    reason : str
        Physics behind it, for people.
    """

    cause: str
    effect: str
    component: str
    certain: bool
    kind: EdgeKind = "effect"
    provenance: str = ""
    reason: str = ""

    @property
    def id(self) -> str:
        """Name of the edge, ``"Q+ -> Hi-"``."""
        return f"{self.cause} -> {self.effect}"


@dataclass(frozen=True, kw_only=True, slots=True)
class Signal:
    """Quantity that a diagnosis can look at, made from measurements.

    Parameters
    ----------
    id : str
        ``"yrH"``.
    meaning : str
        For people.
    symbols : tuple of str
        Its events, ``("yrH+", "yrH-")``, or only one of them.
    alternatives : tuple of frozenset of str
        Each set of sensors suffices to make it.
    kind : {"raw", "phasor", "spectral", "slope", "residual"}
        How it is made.
    condition : str
        When it can be used, empty for always.
    provenance : str
        Where the entry comes from.
    """

    id: str
    meaning: str
    symbols: tuple[str, ...]
    alternatives: tuple[frozenset[str], ...]
    kind: SignalKind = "raw"
    condition: str = ""
    provenance: str = ""

    def revealed(self, sensors: Iterable[str]) -> bool:
        """Whether a set of sensors suffices.

        Parameters
        ----------
        sensors : iterable of str
            Sensors.

        Returns
        -------
        bool
        """
        present = frozenset(sensors)
        return any(needed <= present for needed in self.alternatives)


@dataclass(frozen=True, kw_only=True, slots=True)
class Sensor:
    """Sensor that could be fitted.

    Parameters
    ----------
    id : str
        ``"dp"``.
    name : str
        For people.
    cost : float
        Relative cost, > 0.
    provenance : str
        Where the cost comes from.
    """

    id: str
    name: str
    cost: float = 1.0
    provenance: str = ""

    def __post_init__(self) -> None:
        if not 0 < self.cost < float("inf"):
            raise ParameterError(f"Sensor {self.id!r}: cost = {self.cost!r} must be a finite number > 0.")


@dataclass(frozen=True, kw_only=True, slots=True)
class Group:
    """Faults that need not be told from each other.

    Parameters
    ----------
    id : str
        ``"G3"``.
    name : str
        For people.
    faults : tuple of str
        Faults.
    provenance : str
        Where the choice comes from.
    """

    id: str
    name: str
    faults: tuple[str, ...]
    provenance: str = ""


@dataclass(frozen=True, kw_only=True, slots=True)
class Variant:
    """Another choice for an uncertain group.

    Parameters
    ----------
    id : str
        ``"blocked_rotor"``.
    group : Group
        What the group of the same id becomes.
    """

    id: str
    group: Group


@dataclass(frozen=True, kw_only=True, slots=True)
class Scenario:
    """Disturbing events to be tolerated.

    Parameters
    ----------
    id : str
        ``"D_B"``.
    name : str
        For people.
    disturbances : tuple of str
        Disturbing events; any combination of them may be present.
    provenance : str
        Where the choice comes from.
    """

    id: str
    name: str
    disturbances: tuple[str, ...]
    provenance: str = ""
