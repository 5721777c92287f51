"""Thesis 4.1.1, 4.2.1, 4.3.4: from FMEA tables to the matrices A, B_f, B_d, S, D_f, D_e and to A_f and A_d."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from pumplib.errors import ParameterError
from pumplib.fmea import EDGE_KINDS, Incidence, System
from pumplib.propagation.loops import reach
from pumplib.propagation.simple import simple_sign_reach
from pumplib.propagation.symbols import BOTH, DOWN, UP, observable

Array = NDArray[Any]
Signs = Literal["closure", "simple"]
SIGNS: tuple[str, ...] = get_args(Signs)


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class EventMatrices:
    """Event model of a system, e = A e OR B_f f OR B_d d, and its component graphs; all Boolean.

    Parameters
    ----------
    A : ndarray, shape (n, n)
        Effect (row) of cause (column).
    B_f, B_d : ndarray, shape (n, m), (n, p)
        Events raised by faults, by disturbing events.
    S : ndarray, shape (ends, n)
        Selects the end-effects.
    D_f : ndarray, shape (components, components)
        A fault in the table of component i (row) acts in component j (column).
    D_e : ndarray, shape (components, components)
        An event of component i (row) acts in component j (column); False on the diagonal.
    events, faults, disturbances, ends, components : tuple of str
        Names of rows and columns.
    """

    A: Array
    B_f: Array
    B_d: Array
    S: Array
    D_f: Array
    D_e: Array
    events: tuple[str, ...]
    faults: tuple[str, ...]
    disturbances: tuple[str, ...]
    ends: tuple[str, ...]
    components: tuple[str, ...]


def event_matrices(system: System) -> EventMatrices:
    """Matrices of the event model by the thesis's names.

    Parameters
    ----------
    system : System
        FMEA tables; narrow them with `System.select` before.

    Returns
    -------
    EventMatrices

    References
    ----------
    Thesis, nomenclature: (G_f, D_f), (G_e, D_e), A_ji, A^f_ji, A_f, A_d.
    """
    net = system.incidence()
    n, components = len(net.events), tuple(component.id for component in system.components)

    def matrix(shape: tuple[int, int], rows: Array, columns: Array) -> Array:
        found = np.zeros(shape, bool)
        found[rows, columns] = True
        return found

    table = np.array([net.blocks.index(fault.component) for fault in system.faults], int)
    k = len(net.blocks)
    d_f = matrix((k, k), table[net.fault], net.block[net.fault_event])
    d_e = matrix((k, k), net.block[net.cause], net.block[net.effect])
    np.fill_diagonal(d_e, False)
    inside = slice(len(components))  # without the block of the signal events
    return EventMatrices(
        A=matrix((n, n), net.effect, net.cause),
        B_f=matrix((n, len(net.faults)), net.fault_event, net.fault),
        B_d=matrix((n, len(net.disturbances)), net.disturbance_event, net.disturbance),
        S=matrix((len(net.ends), n), np.arange(len(net.ends)), net.ends),
        D_f=d_f[inside, inside],
        D_e=d_e[inside, inside],
        events=net.events,
        faults=net.faults,
        disturbances=net.disturbances,
        ends=system.ends,
        components=components,
    )


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Effects:
    """What faults and disturbing events do to the signals of a system.

    Parameters
    ----------
    system : System
        The tables.
    ends, signals, faults, disturbances : tuple of str
        Names of rows and columns.
    A_f, A_f_must : ndarray of bool, shape (ends, m)
        End-effects that each fault may and must raise.
    A_d : ndarray of bool, shape (ends, p)
        End-effects that each disturbing event may raise.
    may, must : ndarray of uint8, shape (signals, m)
        The same by signal, 1 up, 2 down, 3 both; see `pumplib.propagation.symbols`.
    hits : ndarray of uint8, shape (signals, p)
        Pulls of each disturbing event.
    """

    system: System
    ends: tuple[str, ...]
    signals: tuple[str, ...]
    faults: tuple[str, ...]
    disturbances: tuple[str, ...]
    A_f: Array
    A_f_must: Array
    A_d: Array
    may: Array
    must: Array
    hits: Array

    def narrow(
        self,
        *,
        faults: Iterable[str] | None = None,
        disturbances: Iterable[str] | None = None,
        signals: Iterable[str] | None = None,
    ) -> "Effects":
        """The same for some faults, disturbing events and signals only.

        Parameters
        ----------
        faults, disturbances, signals : iterable of str, optional
            Names to keep, in this order; all if not given.

        Returns
        -------
        Effects
        """
        f = _positions("fault", faults, self.faults)
        d = _positions("disturbing event", disturbances, self.disturbances)
        s = _positions("signal", signals, self.signals)
        rows = [
            self.ends.index(symbol) for k in s for symbol in self.system.signal(self.signals[k]).symbols
        ]  # signals keep their rows together
        return replace(
            self,
            ends=tuple(self.ends[k] for k in rows),
            signals=tuple(self.signals[k] for k in s),
            faults=tuple(self.faults[k] for k in f),
            disturbances=tuple(self.disturbances[k] for k in d),
            A_f=self.A_f[np.ix_(rows, f)],
            A_f_must=self.A_f_must[np.ix_(rows, f)],
            A_d=self.A_d[np.ix_(rows, d)],
            may=self.may[np.ix_(s, f)],
            must=self.must[np.ix_(s, f)],
            hits=self.hits[np.ix_(s, d)],
        )

    @property
    def hit(self) -> Array:
        """Pulls of all disturbing events together, shape (signals,)."""
        found: Array = np.bitwise_or.reduce(self.hits, axis=1, initial=0).astype(np.uint8)
        return found

    @property
    def ambiguous(self) -> Array:
        """Cells whose signal the fault may pull both ways, so that any symbol fits, shape (signals, m)."""
        found: Array = self.may == BOTH
        return found

    def shown(self, disturbed: bool = True) -> Array:
        """Symbols that each signal can show under each fault.

        Parameters
        ----------
        disturbed : bool
            With any combination of the disturbing events; else with none.

        Returns
        -------
        ndarray of uint8, shape (signals, m)
            Sets of symbols; see `pumplib.propagation.symbols`.
        """
        hits = self.hit if disturbed else np.zeros_like(self.hit)
        return observable(self.must, self.may, hits[:, None])


def _positions(what: str, names: Iterable[str] | None, known: tuple[str, ...]) -> list[int]:
    if names is None:
        return list(range(len(known)))
    found = []
    for name in names:
        if name not in known:
            raise ParameterError(f"{what} {name!r}: not known here; allowed are {', '.join(known)}.")
        found.append(known.index(name))
    return found


def propagate(
    system: System,
    *,
    fault_kinds: Sequence[str] = ("effect",),
    disturbance_kinds: Sequence[str] = ("effect",),
    signs: Signs = "closure",
    guarded: bool = False,
) -> Effects:
    """End-effects of every fault and disturbing event of a system.

    Disturbing events are carried along ordinary effects only: operation that starts a fault is a fault, and the
    thresholds of the signal events lie above the drift of parameters. Both can be dropped.

    Parameters
    ----------
    system : System
        FMEA tables.
    fault_kinds, disturbance_kinds : sequence of {"effect", "progression", "drift"}
        Edges that carry faults and disturbing events.
    signs : {"closure", "simple"}
        All paths, or only those that visit no quantity twice (feedback weakens a deviation, never reverses it).
    guarded : bool
        A must-effect is not carried on through a quantity that the same fault or any disturbing event may pull the
        other way, where it could vanish.

    Returns
    -------
    Effects

    Raises
    ------
    ParameterError
        If a kind or `signs` is not known.
    """
    if signs not in SIGNS:
        raise ParameterError(f"signs = {signs!r}: must be one of {', '.join(SIGNS)}.")
    for kind in (*fault_kinds, *disturbance_kinds):
        if kind not in EDGE_KINDS:
            raise ParameterError(f"kind {kind!r}: must be one of {', '.join(EDGE_KINDS)}.")
    net = system.incidence()
    quantity, opposite = _quantities(system)
    for_faults = np.isin(net.kind, [EDGE_KINDS.index(kind) for kind in fault_kinds])
    for_disturbances = np.isin(net.kind, [EDGE_KINDS.index(kind) for kind in disturbance_kinds])
    m, p, everywhere = len(net.faults), len(net.disturbances), np.arange(len(net.events))

    def spread(edges: Array, events: Array, roots: Array, r: int) -> Array:
        """Events (rows) raised by each root."""
        if signs == "closure":
            return reach(len(everywhere), net.cause[edges], net.effect[edges], events, roots, r, everywhere)
        along = simple_sign_reach(len(everywhere), net.cause[edges], net.effect[edges], quantity)
        found = np.zeros((len(everywhere), r), bool)
        for event, root in zip(events, roots, strict=True):
            found[:, root] |= along[:, event]
        return found

    may = spread(for_faults, net.fault_event, net.fault, m)
    hit = spread(for_disturbances, net.disturbance_event, net.disturbance, p)
    sure, first = for_faults & net.certain, net.fault_certain
    if guarded:
        must = np.zeros_like(may)
        pulled = np.any(hit, axis=1)
        for k in range(m):
            against = np.append(may[:, k] | pulled, False)[opposite]  # the last entry: no opposite event
            own = first & (net.fault == k)
            must[:, k] = spread(sure & ~against[net.cause], net.fault_event[own], net.fault[own] * 0, 1)[:, 0]
    else:
        must = spread(sure, net.fault_event[first], net.fault[first], m)
    return _effects(system, net, may, must, hit)


def _quantities(system: System) -> tuple[Array, Array]:
    """Number of the quantity of each event, and its event in the other direction (n if there is none)."""
    names = list(dict.fromkeys(event.quantity for event in system.events))
    number = {name: k for k, name in enumerate(names)}
    at = {event.id: k for k, event in enumerate(system.events)}
    other = {"+": "-", "-": "+"}
    quantity = np.array([number[event.quantity] for event in system.events], np.int32)
    return quantity, np.array([at.get(event.quantity + other[event.sign], len(at)) for event in system.events])


def _effects(system: System, net: Incidence, may: Array, must: Array, hit: Array) -> Effects:
    pull = {"+": UP, "-": DOWN}
    weight = np.zeros((len(system.signals), len(net.ends)), np.uint8)
    at = 0
    for k, signal in enumerate(system.signals):
        for symbol in signal.symbols:
            weight[k, at] = pull[system.event(symbol).sign]
            at += 1
    a_f, a_f_must, a_d = may[net.ends], must[net.ends], hit[net.ends]
    return Effects(
        system=system,
        ends=system.ends,
        signals=tuple(signal.id for signal in system.signals),
        faults=net.faults,
        disturbances=net.disturbances,
        A_f=a_f,
        A_f_must=a_f_must,
        A_d=a_d,
        may=weight @ a_f.astype(np.uint8),
        must=weight @ a_f_must.astype(np.uint8),
        hits=weight @ a_d.astype(np.uint8),
    )
