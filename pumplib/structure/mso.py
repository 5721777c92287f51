"""Thesis 6.1: all minimal over-constrained subsets (MSO) of a model, each of which can become one residual.

From the over-determined part one equivalence class is taken away after the other (constraints that leave the
over-determined part together) until one constraint more than unknowns is left. A class that was tried stays for good in
the branches that follow, so every subset is found exactly once. The search is compiled; it keeps one maximum matching a
level and changes it along one alternating path a step instead of computing it anew.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from pumplib.errors import ParameterError
from pumplib.kernels import kernel
from pumplib.structure.graph import Structure, bits
from pumplib.structure.matching import maximum_matching

Array = NDArray[Any]
_CHUNK = 4096  # subsets found before the compiled search hands them over


@kernel
def _spread(start, column, alive, partner, mate, skip, reached, seen, source, queue):  # type: ignore[no-untyped-def]
    """Rows on alternating paths from rows without an unknown, except one; returns their number.

    `partner` is the column of a row, `mate` the row of a column; `source` is set to the row from which a column was
    reached first.
    """
    rows = alive.shape[0]
    count = 0
    for k in range(rows):
        begin = alive[k] != 0 and partner[k] < 0 and k != skip
        reached[k] = begin
        if begin:
            queue[count] = k
            count += 1
    seen[:] = 0
    head = 0
    while head < count:
        k = queue[head]
        head += 1
        for p in range(start[k], start[k + 1]):
            x = column[p]
            if seen[x] == 0:
                seen[x] = 1
                source[x] = k
                other = mate[x]
                if reached[other] == 0:
                    reached[other] = 1
                    queue[count] = other
                    count += 1
    return count


@kernel
def search(start, column, alive, free, partner, mate, cursor, place, out):  # type: ignore[no-untyped-def]
    """Go on with the search until it ends or `out` is full; returns the number of subsets found.

    Parameters
    ----------
    start, column : ndarray of int32
        Rows of the incidence, compressed.
    alive, free : ndarray of uint8, shape (levels, rows)
        Rows of the present over-determined part of each level, and those of them that may still be taken away.
    partner : ndarray of int32, shape (levels, rows)
        Unknown of each row, -1 for none.
    mate : ndarray of int32, shape (levels, columns)
        Row of each unknown.
    cursor : ndarray of int32, shape (levels,)
        Next row to try on each level.
    place : ndarray of int64, shape (2,)
        Present level, -1 at the end, and the number of levels above a finished subset; the first is changed.
    out : ndarray of uint8, shape (capacity, rows)
        Subsets.

    Returns
    -------
    int
    """
    rows, columns = alive.shape[1], mate.shape[1]
    reached = np.empty(rows, np.uint8)
    seen = np.empty(columns, np.uint8)
    source = np.empty(columns, np.int32)
    queue = np.empty(rows, np.int32)
    level, last = place[0], place[1]
    count = 0
    while level >= 0 and count < out.shape[0]:
        e = cursor[level]
        while e < rows and free[level, e] == 0:
            e += 1
        cursor[level] = e + 1
        if e >= rows:
            level -= 1
            continue
        if partner[level, e] >= 0:  # another row takes over its unknown: shift along an alternating path
            _spread(start, column, alive[level], partner[level], mate[level], -1, reached, seen, source, queue)
            x = partner[level, e]
            partner[level, e] = -1
            while x >= 0:
                k = source[x]
                before = partner[level, k]
                partner[level, k] = x
                mate[level, x] = k
                x = before
        _spread(start, column, alive[level], partner[level], mate[level], e, reached, seen, source, queue)
        allowed = True
        for k in range(rows):  # the class of e is what is no longer reached
            if alive[level, k] != 0 and reached[k] == 0:
                allowed = allowed and free[level, k] != 0
                free[level, k] = 0
        if not allowed:
            continue
        if level == last:
            out[count, :] = reached
            count += 1
            continue
        alive[level + 1, :] = reached
        for k in range(rows):
            free[level + 1, k] = free[level, k] & reached[k]
        partner[level + 1, :] = partner[level, :]
        mate[level + 1, :] = mate[level, :]
        level += 1
        cursor[level] = 0
    place[0] = level
    return count


def mso_matrix(structure: Structure, *, limit: int = 1_000_000) -> Array:
    """Find all minimal over-constrained subsets.

    Parameters
    ----------
    structure : Structure
        The graph.
    limit : int
        Number of subsets beyond which the search is given up; they grow exponentially with the redundancy.

    Returns
    -------
    ndarray of bool, shape (subsets, constraints)
        Which subset contains which constraint; small subsets first, then in the order of the constraints.

    Raises
    ------
    ParameterError
        If there are more than `limit`.

    References
    ----------
    M. Krysander, J. Åslund, M. Nyberg, An efficient algorithm for finding minimal overconstrained subsystems for
    model-based diagnosis, IEEE Trans. Systems, Man, and Cybernetics A 38 (2008). Thesis 6.1.
    """
    matching = maximum_matching(structure)
    rows = bits(matching.reached())
    found = np.zeros((0, len(structure.constraints)), dtype=bool)
    if not rows:
        return found
    place_of_row = {k: i for i, k in enumerate(rows)}
    columns = sorted({x for k in rows for x in bits(structure.rows[k])})
    place_of_column = {x: i for i, x in enumerate(columns)}
    levels = max(len(rows) - len(columns) - 1, 1)
    subsets = np.ones((1, len(rows)), dtype=bool)
    if len(rows) - len(columns) > 1:
        contents = [[place_of_column[x] for x in bits(structure.rows[k])] for k in rows]
        start = np.cumsum([0, *map(len, contents)], dtype=np.int32)
        column = np.array([x for row in contents for x in row], dtype=np.int32)
        alive = np.ones((levels, len(rows)), dtype=np.uint8)
        partner = np.full((levels, len(rows)), -1, dtype=np.int32)
        mate = np.full((levels, len(columns)), -1, dtype=np.int32)
        for k in rows:
            x = matching.unknown_of[k]
            if x >= 0:
                partner[0, place_of_row[k]] = place_of_column[x]
                mate[0, place_of_column[x]] = place_of_row[k]
        subsets = _all(start, column, alive, partner, mate, limit, structure.name)
    _check_limit(structure.name, len(subsets), limit)
    # small subsets first, then by the first constraint in which two differ
    order = np.lexsort((*(~subsets).T[::-1], subsets.sum(axis=1)))
    found = np.zeros((len(subsets), len(structure.constraints)), dtype=bool)
    found[:, rows] = subsets[order]
    return found


def mso_sets(structure: Structure, *, limit: int = 100_000) -> tuple[tuple[str, ...], ...]:
    """Find all minimal over-constrained subsets, by names.

    Parameters
    ----------
    structure : Structure
        The graph.
    limit : int
        Number of subsets beyond which the search is given up.

    Returns
    -------
    tuple of tuple of str
        Constraints of each subset in the order of the model; small subsets first.

    Raises
    ------
    ParameterError
        If there are more than `limit`.
    """
    names = structure.constraints
    return tuple(tuple(names[k] for k in np.flatnonzero(row)) for row in mso_matrix(structure, limit=limit))


def _all(start: Array, column: Array, alive: Array, partner: Array, mate: Array, limit: int, name: str) -> Array:
    free = alive.copy()
    cursor = np.zeros(len(alive), dtype=np.int32)
    place = np.array([0, len(alive) - 1], dtype=np.int64)
    chunks, total = [], 0
    while place[0] >= 0:
        out = np.empty((min(_CHUNK, limit + 1 - total), alive.shape[1]), dtype=np.uint8)
        count = search(start, column, alive, free, partner, mate, cursor, place, out)
        chunks.append(out[:count])
        total += count
        _check_limit(name, total, limit)
    return np.concatenate(chunks).astype(bool)


def _check_limit(name: str, count: int, limit: int) -> None:
    if count > limit:
        raise ParameterError(
            f"{name}: more than limit = {limit} minimal over-constrained subsets; raise it or take unknowns as known."
        )
