"""Thesis 4.2.1: loop cutting for events that need one cause or all of them, the general form of Theorem 1."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pumplib.errors import ParameterError
from pumplib.kernels import kernel
from pumplib.propagation.graph import dfs_cut, edge_arrays, mask, rows_by, tarjan
from pumplib.propagation.loops import Passes, seed_rows

Array = NDArray[Any]


@kernel
def _gate(k, start, before, edges, cut, all_of, seed, old, new, words):  # type: ignore[no-untyped-def]
    """One event: its seed OR its gate; cut edges carry the value of the pass before."""
    for w in range(words):
        value = np.uint64(0)
        if all_of[k]:
            value = ~np.uint64(0)
            for p in range(start[k], start[k + 1]):
                value &= old[before[p], w] if cut[edges[p]] else new[before[p], w]
        else:
            for p in range(start[k], start[k + 1]):
                value |= old[before[p], w] if cut[edges[p]] else new[before[p], w]
        new[k, w] = seed[k, w] | value


@kernel
def _gate_passes(order, start, before, edges, cut, all_of, seed, old, new):  # type: ignore[no-untyped-def]
    words = seed.shape[1]
    passes = 0
    while True:
        passes += 1
        for k in order:
            _gate(k, start, before, edges, cut, all_of, seed, old, new, words)
        same = True
        for i in range(len(old)):
            for w in range(words):
                same = same and old[i, w] == new[i, w]
                old[i, w] = new[i, w]
        if same:
            return passes


def gate_closure(
    n: int, cause: ArrayLike, effect: ArrayLike, all_of: ArrayLike, seeds: Array, *, cut: ArrayLike | None = None
) -> Passes:
    """Algorithm 1 in the general form of Theorem 1: events that need one cause, or all of them (protection, voting).

    Every bit is a case of its own: with AND gates the effects of two roots are more than those of each, so a case
    is a set of roots and no matrix A_f exists.

    Parameters
    ----------
    n : int
        Number of events.
    cause, effect : array_like of int, shape (edges,)
        Edges.
    all_of : array_like of bool, shape (n,)
        Events that need all of their causes; a seed raises them without.
    seeds : ndarray of uint64, shape (n, words)
        Cases in which each event is raised directly.
    cut : array_like of bool, shape (edges,), optional
        Edges to cut, any set that leaves no loop; all edges gives the plain iteration, a depth-first cut if not given.

    Returns
    -------
    Passes
        The same bits for every cut.

    Raises
    ------
    ParameterError
        If the cut leaves a loop or an event needs all of no causes.
    """
    a, b = edge_arrays(n, cause, effect)
    every = mask(all_of, (n,), "all_of")
    if bare := np.flatnonzero(every & (np.bincount(b, minlength=n) == 0)).tolist():
        raise ParameterError(f"all_of: the events {bare[:10]} need all of no causes; add causes or take OR.")
    gone = dfs_cut(n, a, b) if cut is None else mask(cut, (len(a),), "cut")
    start, before, _ = rows_by(n, b[~gone], a[~gone])
    rank = np.empty(n, np.int32)
    if tarjan(start, before, rank) < n or (a[~gone] == b[~gone]).any():
        raise ParameterError("cut: a loop is left; cut one of its edges.")
    order = np.argsort(rank).astype(np.int32)
    given = seed_rows(seeds, n)
    new = np.zeros_like(given)
    passes = _gate_passes(order, *rows_by(n, b, a), gone, every, given, np.zeros_like(given), new)
    return Passes(bits=new, passes=int(passes), cut=gone)
