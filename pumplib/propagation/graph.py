"""Thesis 4.2.1: event graphs as index arrays: packed roots, strongly connected events, loop cuts.

An event graph with n events is two arrays, `cause[k] -> effect[k]`. A set of roots (faults, disturbing events)
at an event is a row of 64-bit words with one bit a root, so that one OR of two words moves 64 roots at once.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pumplib.errors import ParameterError
from pumplib.kernels import kernel

Array = NDArray[Any]
MAX_EXACT = 20  # vertices up to which all orders are searched


def indices(values: ArrayLike, size: int, name: str) -> Array:
    """Check an array of indices.

    Parameters
    ----------
    values : array_like of int, shape (k,)
        The indices.
    size : int
        They must lie in 0 .. size - 1.
    name : str
        What they are, for the message.

    Returns
    -------
    ndarray of int32, shape (k,)

    Raises
    ------
    ParameterError
        If they are not whole numbers in one dimension, or one is out of range.
    """
    array = np.asarray(values)
    if array.size == 0:
        return np.zeros(0, np.int32)
    if array.ndim != 1 or array.dtype.kind not in "iu":
        raise ParameterError(f"{name}: needs whole numbers in one dimension, got {array.dtype} of shape {array.shape}.")
    low, high = int(array.min()), int(array.max())
    if low < 0 or high >= size:
        raise ParameterError(f"{name} = {low if low < 0 else high}: must be 0 to {size - 1}.")
    return np.ascontiguousarray(array, np.int32)


def edge_arrays(n: int, cause: ArrayLike, effect: ArrayLike) -> tuple[Array, Array]:
    """Check the edges of a graph.

    Parameters
    ----------
    n : int
        Number of events.
    cause, effect : array_like of int, shape (edges,)
        Ends of each edge.

    Returns
    -------
    tuple of ndarray of int32
        Both, checked.

    Raises
    ------
    ParameterError
        If their lengths differ or an index is out of range.
    """
    if n < 1:
        raise ParameterError(f"events = {n}: a graph needs at least one.")
    a, b = indices(cause, n, "cause"), indices(effect, n, "effect")
    if len(a) != len(b):
        raise ParameterError(f"cause has {len(a)} entries, effect {len(b)}: give one pair an edge.")
    return a, b


def mask(values: ArrayLike, shape: tuple[int, ...], name: str) -> Array:
    """Check a Boolean array.

    Parameters
    ----------
    values : array_like of bool
        The array; only True and False (or 0 and 1) are taken.
    shape : tuple of int
        Shape that it must have, -1 for any length.
    name : str
        What it is, for the message.

    Returns
    -------
    ndarray of bool

    Raises
    ------
    ParameterError
        If the shape is another or an entry is neither 0 nor 1.
    """
    array = np.asarray(values)
    fits = array.ndim == len(shape) and all(b in (-1, a) for a, b in zip(array.shape, shape, strict=True))
    if not fits:
        raise ParameterError(f"{name}: has the shape {array.shape}, needs {shape} (-1: any).")
    if array.dtype != bool and not np.isin(array, (0, 1)).all():
        raise ParameterError(f"{name}: has entries other than 0 and 1; give True or False.")
    return np.ascontiguousarray(array, bool)


def pack(events: ArrayLike, roots: ArrayLike, n: int, r: int) -> Array:
    """Rows of bits from pairs of an event and a root that raises it.

    Parameters
    ----------
    events, roots : array_like of int, shape (pairs,)
        Which root raises which event.
    n, r : int
        Number of events and of roots.

    Returns
    -------
    ndarray of uint64, shape (n, ceil(r / 64))

    Raises
    ------
    ParameterError
        If an index is out of range or the lengths differ.
    """
    if r < 1:
        raise ParameterError(f"roots = {r}: at least one is needed.")
    e, k = indices(events, n, "seed event"), indices(roots, r, "seed root")
    if len(e) != len(k):
        raise ParameterError(f"seed events: {len(e)}, seed roots: {len(k)}: give one pair a seed.")
    bits = np.zeros((n, -(-r // 64)), np.uint64)
    _set_bits(bits, e, k)
    return bits


def unpack(bits: Array, r: int) -> Array:
    """Boolean matrix of rows of bits.

    Parameters
    ----------
    bits : ndarray of uint64, shape (n, words)
        Rows.
    r : int
        Number of roots.

    Returns
    -------
    ndarray of bool, shape (n, r)
    """
    octets = np.ascontiguousarray(bits).astype("<u8", copy=False).view(np.uint8)
    return np.unpackbits(octets, axis=1, count=r, bitorder="little").view(bool)


@kernel
def _set_bits(bits, events, roots):  # type: ignore[no-untyped-def]
    for k in range(len(events)):
        bits[events[k], roots[k] >> 6] |= np.uint64(1) << np.uint64(roots[k] & 63)


@kernel
def rows_by(n, key, value):  # type: ignore[no-untyped-def]
    """Compressed rows of a list of edges, by counting; within a row in the order of the list.

    Parameters
    ----------
    n : int
        Number of rows.
    key, value : ndarray of int32, shape (edges,)
        Row and entry of each edge.

    Returns
    -------
    start : ndarray of int32, shape (n + 1,)
        First place of each row.
    entries, edges : ndarray of int32, shape (edges,)
        Entries row by row, and from which edge each came.
    """
    start = np.zeros(n + 1, np.int32)
    for k in range(len(key)):
        start[key[k] + 1] += 1
    for i in range(n):
        start[i + 1] += start[i]
    place = start[:n].copy()
    entries = np.empty(len(key), np.int32)
    edges = np.empty(len(key), np.int32)
    for k in range(len(key)):
        at = place[key[k]]
        place[key[k]] += 1
        entries[at] = value[k]
        edges[at] = k
    return start, entries, edges


@kernel
def tarjan(start, before, label):  # type: ignore[no-untyped-def]
    """Number the strongly connected components; searching backwards, causes get the lower numbers.

    Parameters
    ----------
    start, before : ndarray of int32
        Compressed rows of the causes of each event.
    label : ndarray of int32, shape (n,)
        Filled with the component of each event.

    Returns
    -------
    int
        Number of components.
    """
    n = len(label)
    order = np.zeros(n, np.int32)  # 0: not seen
    low = np.empty(n, np.int32)
    stack = np.empty(n, np.int32)
    path = np.empty(n, np.int32)
    place = np.empty(n, np.int32)
    label[:] = -1
    seen, found, top = 0, 0, 0
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
                elif label[u] < 0:
                    low[v] = min(low[v], order[u])
            else:
                if low[v] == order[v]:
                    while True:
                        top -= 1
                        label[stack[top]] = found
                        if stack[top] == v:
                            break
                    found += 1
                depth -= 1
                if depth >= 0:
                    low[path[depth]] = min(low[path[depth]], low[v])
    return found


def strong_components(n: int, cause: ArrayLike, effect: ArrayLike) -> tuple[int, Array]:
    """Strongly connected components, numbered so that every edge between two goes to the higher number.

    Parameters
    ----------
    n : int
        Number of events.
    cause, effect : array_like of int, shape (edges,)
        Edges.

    Returns
    -------
    count : int
        Number of components.
    label : ndarray of int32, shape (n,)
        Component of each event.

    References
    ----------
    R. Tarjan, Depth-first search and linear graph algorithms, SIAM J. Comput. 1 (1972).
    """
    a, b = edge_arrays(n, cause, effect)
    start, before, _ = rows_by(n, b, a)
    label = np.empty(n, np.int32)
    return int(tarjan(start, before, label)), label


@kernel
def _back_edges(start, to, edges, order, back):  # type: ignore[no-untyped-def]
    n = len(start) - 1
    state = np.zeros(n, np.int8)  # 0 not seen, 1 on the path, 2 done
    path = np.empty(n, np.int32)
    place = start[:n].copy()
    for root in order:
        if state[root] != 0:
            continue
        depth = 0
        path[0] = root
        state[root] = 1
        while depth >= 0:
            v = path[depth]
            if place[v] < start[v + 1]:
                w = to[place[v]]
                if state[w] == 1:
                    back[edges[place[v]]] = True
                elif state[w] == 0:
                    state[w] = 1
                    depth += 1
                    path[depth] = w
                place[v] += 1
            else:
                state[v] = 2
                depth -= 1


def dfs_cut(n: int, cause: ArrayLike, effect: ArrayLike, order: Sequence[int] | Array | None = None) -> Array:
    """Cut of all loops: the edges that a depth-first search finds to lead back to its own path.

    Parameters
    ----------
    n : int
        Number of vertices.
    cause, effect : array_like of int, shape (edges,)
        Edges; an edge from a vertex to itself is cut, too.
    order : array_like of int, shape (n,), optional
        In which order the search starts at the vertices; another order gives another cut.

    Returns
    -------
    ndarray of bool, shape (edges,)
        Edges to cut.

    Raises
    ------
    ParameterError
        If an index is out of range or `order` is no permutation.
    """
    a, b = edge_arrays(n, cause, effect)
    first = np.arange(n, dtype=np.int32) if order is None else indices(order, n, "order")
    if len(first) != n or len(np.unique(first)) != n:
        raise ParameterError(f"order: must name each of the {n} vertices once.")
    back = np.zeros(len(a), bool)
    _back_edges(*rows_by(n, a, b), first, back)
    return back


def minimum_cut(adjacency: ArrayLike) -> tuple[tuple[int, int], ...]:
    """A smallest set of edges that cuts all loops, by dynamic programming over sets of vertices.

    Parameters
    ----------
    adjacency : array_like of bool, shape (n, n)
        Edge from row to column; n up to `MAX_EXACT`, the diagonal is ignored.

    Returns
    -------
    tuple of (int, int)
        Edges to cut, sorted.

    Raises
    ------
    ParameterError
        If there are more vertices.

    References
    ----------
    The problem (minimum feedback arc set) is NP-hard: R. M. Karp, Reducibility among combinatorial problems (1972).
    """
    edges = mask(adjacency, (-1, -1), "adjacency").copy()
    n = len(edges)
    if n > MAX_EXACT or edges.shape != (n, n):
        raise ParameterError(f"adjacency has the shape {edges.shape}: needs a square of at most {MAX_EXACT} vertices.")
    np.fill_diagonal(edges, False)
    out = [sum(1 << int(j) for j in np.flatnonzero(row)) for row in edges]
    # least[s]: fewest edges against the order when the vertices of s come first, in their best order
    least, last = [0] + [n * n] * ((1 << n) - 1), [0] * (1 << n)
    for done in range(1 << n):
        for v in range(n):
            if not done >> v & 1:
                cost = least[done] + (out[v] & done).bit_count()
                if cost < least[done | 1 << v]:
                    least[done | 1 << v], last[done | 1 << v] = cost, v
    rank, done = [0] * n, (1 << n) - 1
    while done:
        v = last[done]
        rank[v] = done.bit_count()
        done ^= 1 << v
    return tuple((int(i), int(j)) for i, j in np.argwhere(edges) if rank[i] > rank[j])
