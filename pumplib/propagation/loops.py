"""Thesis 4.2.1: the effects of every root at once, through loops: cut and iterate, or condense and sweep.

The effect vector of x = A x OR s is its least solution: what has no root is not there, even if it would keep
itself alive in a loop. All functions return it as rows of bits, one bit a root.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pumplib.errors import ParameterError
from pumplib.kernels import inline, kernel
from pumplib.propagation.graph import dfs_cut, edge_arrays, indices, mask, pack, rows_by, tarjan, unpack

Array = NDArray[Any]


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Passes:
    """Result of an iteration.

    Parameters
    ----------
    bits : ndarray of uint64, shape (n, words)
        Roots that reach each event.
    passes : int
        Sweeps over the graph, the last one changes nothing.
    cut : ndarray of bool, shape (edges,)
        Edges that were cut; empty for the plain iteration.
    """

    bits: Array
    passes: int
    cut: Array


@inline
def _add(bits, into, row, words):  # type: ignore[no-untyped-def]
    """OR one row into another; tells nothing about change, so that the loop is only words."""
    for w in range(words):
        bits[into, w] |= bits[row, w]


@inline
def _add_new(bits, into, row, words):  # type: ignore[no-untyped-def]
    """OR one row into another; tells whether it changed."""
    new = np.uint64(0)
    for w in range(words):
        new |= bits[row, w] & ~bits[into, w]
        bits[into, w] |= bits[row, w]
    return new != 0


@kernel
def _condense(start, before, bits):  # type: ignore[no-untyped-def]
    """Tarjan's search against the edges; a component is complete when all its causes are, and is filled at once."""
    n, words = bits.shape
    order = np.zeros(n, np.int32)
    low = np.empty(n, np.int32)
    stack = np.empty(n, np.int32)
    path = np.empty(n, np.int32)
    place = np.empty(n, np.int32)
    head = np.full(n, -1, np.int32)  # first event of the component; -1: not complete
    used = np.full(n, -1, np.int32)  # component that has already taken over the roots of this one
    seen, top = 0, 0
    for root in range(n):
        if order[root] != 0:
            continue
        depth = 0
        path[0] = root
        seen += 1
        order[root] = low[root] = seen
        place[root] = start[root]
        stack[top] = root
        top += 1
        while depth >= 0:
            v = path[depth]
            if place[v] < start[v + 1]:
                u = before[place[v]]
                place[v] += 1
                if order[u] == 0:
                    seen += 1
                    order[u] = low[u] = seen
                    place[u] = start[u]
                    stack[top] = u
                    top += 1
                    depth += 1
                    path[depth] = u
                elif head[u] < 0:
                    low[v] = min(low[v], order[u])
            else:
                if low[v] == order[v]:
                    below = top
                    while True:
                        below -= 1
                        u = stack[below]
                        if u != v:
                            _add(bits, v, u, words)
                        for k in range(start[u], start[u + 1]):
                            h = head[before[k]]
                            if h >= 0 and used[h] != v:
                                used[h] = v
                                _add(bits, v, h, words)
                        if u == v:
                            break
                    for k in range(below, top):
                        u = stack[k]
                        head[u] = v
                        if u != v:
                            for w in range(words):
                                bits[u, w] = bits[v, w]
                    top = below
                depth -= 1
                if depth >= 0:
                    low[path[depth]] = min(low[path[depth]], low[v])


def seed_rows(seeds: Array, n: int) -> Array:
    """Check rows of bits and copy them, to be worked on.

    Parameters
    ----------
    seeds : ndarray of uint64, shape (n, words)
        Rows of bits; see `pumplib.propagation.graph.pack`.
    n : int
        Number of events.

    Returns
    -------
    ndarray of uint64, shape (n, words)

    Raises
    ------
    ParameterError
        If the type or the number of rows is another.
    """
    bits = np.asarray(seeds)
    if bits.dtype != np.uint64 or bits.ndim != 2 or len(bits) != n:
        raise ParameterError(
            f"seeds: {bits.dtype} of shape {bits.shape}; needs uint64 of {n} rows, as pumplib.propagation.pack makes."
        )
    return bits.copy(order="C")


def scc_closure(n: int, cause: ArrayLike, effect: ArrayLike, seeds: Array) -> Array:
    """Algorithm 2: condense the loops and sweep once; for systems of OR only.

    All events of a loop have the same roots, so a strongly connected component is one vertex, and the graph of
    the components has no loops. Takes O((n + edges) words), without iteration.

    Parameters
    ----------
    n : int
        Number of events.
    cause, effect : array_like of int, shape (edges,)
        Edges.
    seeds : ndarray of uint64, shape (n, words)
        Roots that raise each event directly; see `pack`.

    Returns
    -------
    ndarray of uint64, shape (n, words)
        Roots that reach each event.
    """
    a, b = edge_arrays(n, cause, effect)
    bits = seed_rows(seeds, n)
    start, before, _ = rows_by(n, b, a)
    _condense(start, before, bits)
    return bits


@kernel
def _sweep_and_inject(cause, effect, cut_cause, cut_effect, bits, inject):  # type: ignore[no-untyped-def]
    words = bits.shape[1]
    passes = 0
    while True:
        passes += 1
        for k in range(len(cause)):
            _add(bits, effect[k], cause[k], words)
        changed = False
        if inject:
            for k in range(len(cut_cause)):
                changed = _add_new(bits, cut_effect[k], cut_cause[k], words) or changed
        if not changed:
            return passes


def component_cut(
    n: int, cause: ArrayLike, effect: ArrayLike, component: ArrayLike, order: ArrayLike | None = None
) -> Array:
    """Cut of the loops between components, by a depth-first search on the component graph.

    Parameters
    ----------
    n : int
        Number of events.
    cause, effect : array_like of int, shape (edges,)
        Edges between events.
    component : array_like of int, shape (n,)
        Component of each event.
    order : array_like of int, optional
        In which order the search starts at the components.

    Returns
    -------
    ndarray of bool, shape (edges,)
        Event edges to cut; edges inside a component are never cut.
    """
    a, b = edge_arrays(n, cause, effect)
    of = indices(component, n, "component")
    count = int(of.max()) + 1
    pairs, which = np.unique(of[a].astype(np.int64) * count + of[b], return_inverse=True)
    first, last = np.divmod(pairs, count)
    back = np.zeros(len(pairs), bool)
    between = first != last
    back[between] = dfs_cut(count, first[between], last[between], None if order is None else np.asarray(order))
    found: Array = back[which]
    return found


def cut_closure(
    n: int,
    cause: ArrayLike,
    effect: ArrayLike,
    seeds: Array,
    *,
    cut: ArrayLike | None = None,
    component: ArrayLike | None = None,
    inject: bool = True,
) -> Passes:
    """Algorithm 1: cut the loops, propagate along what is left, carry over the cuts, repeat.

    Parameters
    ----------
    n : int
        Number of events.
    cause, effect : array_like of int, shape (edges,)
        Edges.
    seeds : ndarray of uint64, shape (n, words)
        Roots that raise each event directly; see `pack`.
    cut : array_like of bool, shape (edges,), optional
        Edges to cut, any set that leaves no loop between components (`component_cut` if not given).
    component : array_like of int, shape (n,), optional
        Component of each event; a component is closed inside once, before. Each event alone if not given.
    inject : bool
        False leaves the cuts open, which loses effects; to show how many.

    Returns
    -------
    Passes
        The same bits for every cut.

    Raises
    ------
    ParameterError
        If the cut leaves a loop between components.
    """
    a, b = edge_arrays(n, cause, effect)
    of = np.arange(n, dtype=np.int32) if component is None else indices(component, n, "component")
    if len(of) != n:
        raise ParameterError(f"component has {len(of)} entries: give one for each of the {n} events.")
    gone = component_cut(n, a, b, of) if cut is None else mask(cut, (len(a),), "cut")
    inner = (of[a] == of[b]) & ~gone
    atom = np.empty(n, np.int32)
    start, before, _ = rows_by(n, b[inner], a[inner])
    atoms = tarjan(start, before, atom)
    left = ~gone & (atom[a] != atom[b])
    x, y = atom[a[left]], atom[b[left]]
    start, before, _ = rows_by(atoms, y, x)
    rank = np.empty(atoms, np.int32)
    if tarjan(start, before, rank) < atoms:
        loop = np.flatnonzero(np.bincount(rank)[rank[atom]] > np.bincount(atom)[atom])
        raise ParameterError(f"cut: a loop is left through the events {loop[:10].tolist()}; cut one of its edges.")
    order = np.argsort(rank[x], kind="stable")
    given = seed_rows(seeds, n)
    bits = np.zeros((atoms, given.shape[1]), np.uint64)
    np.bitwise_or.at(bits, atom, given)
    passes = _sweep_and_inject(x[order], y[order], atom[a[gone]], atom[b[gone]], bits, inject)
    return Passes(bits=bits[atom], passes=int(passes), cut=gone)


@kernel
def _sweeps(cause, effect, seed, old, new):  # type: ignore[no-untyped-def]
    n, words = seed.shape
    passes = 0
    while True:
        passes += 1
        new[:] = seed
        for k in range(len(cause)):
            for w in range(words):
                new[effect[k], w] |= old[cause[k], w]
        same = True
        for i in range(n):
            for w in range(words):
                same = same and old[i, w] == new[i, w]
        if same:
            return passes
        old, new = new, old


def plain_closure(n: int, cause: ArrayLike, effect: ArrayLike, seeds: Array) -> Passes:
    """Repeat x := s OR A x until nothing changes: the definition, as a reference.

    Parameters
    ----------
    n : int
        Number of events.
    cause, effect : array_like of int, shape (edges,)
        Edges.
    seeds : ndarray of uint64, shape (n, words)
        Roots that raise each event directly; see `pack`.

    Returns
    -------
    Passes
        Bits and number of sweeps.
    """
    a, b = edge_arrays(n, cause, effect)
    seed = seed_rows(seeds, n)
    new = np.empty_like(seed)
    passes = _sweeps(a, b, seed, seed.copy(), new)
    return Passes(bits=new, passes=int(passes), cut=np.zeros(len(a), bool))


def reach(
    n: int, cause: ArrayLike, effect: ArrayLike, seed_event: ArrayLike, seed_root: ArrayLike, r: int, ends: ArrayLike
) -> Array:
    """Which roots raise which end-effects, S A* B; searches from the side with fewer of them.

    Parameters
    ----------
    n : int
        Number of events.
    cause, effect : array_like of int, shape (edges,)
        Edges.
    seed_event, seed_root : array_like of int, shape (pairs,)
        Events that each root raises directly.
    r : int
        Number of roots.
    ends : array_like of int, shape (e,)
        End-effects.

    Returns
    -------
    ndarray of bool, shape (e, r)
        A_f for faults, A_d for disturbing events.
    """
    rows = indices(ends, n, "end-effect")
    if len(rows) == 0 or r == 0:
        return np.zeros((len(rows), r), bool)
    if -(-len(rows) // 64) >= -(-r // 64):
        return unpack(scc_closure(n, cause, effect, pack(seed_event, seed_root, n, r))[rows], r)
    back = scc_closure(n, effect, cause, pack(rows, np.arange(len(rows)), n, len(rows)))
    events, roots = indices(seed_event, n, "seed event"), indices(seed_root, r, "seed root")
    found = np.zeros((r, back.shape[1]), np.uint64)
    np.bitwise_or.at(found, roots, back[events])
    return unpack(found, len(rows)).T
