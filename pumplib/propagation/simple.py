"""Thesis 4.2.1: effects with signs along paths that visit no quantity twice."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pumplib.errors import ParameterError
from pumplib.kernels import kernel
from pumplib.propagation.graph import edge_arrays, indices, rows_by

Array = NDArray[Any]
MAX_STEPS = 50_000_000  # of a search over paths, some seconds


@kernel
def _simple_paths(first, start, to, quantity, on_path, path, place, row, limit):  # type: ignore[no-untyped-def]
    steps = 0
    depth = 0
    path[0] = first
    place[0] = start[first]
    on_path[quantity[first]] = True
    row[first] = True
    while depth >= 0:
        v = path[depth]
        if place[depth] < start[v + 1]:
            w = to[place[depth]]
            place[depth] += 1
            if not on_path[quantity[w]]:
                steps += 1
                if steps > limit:
                    return -1
                on_path[quantity[w]] = True
                row[w] = True
                depth += 1
                path[depth] = w
                place[depth] = start[w]
        else:
            on_path[quantity[v]] = False
            depth -= 1
    return steps


def simple_sign_reach(
    n: int, cause: ArrayLike, effect: ArrayLike, quantity: ArrayLike, limit: int = MAX_STEPS
) -> Array:
    """Events reached along paths that visit no quantity twice, so that no loop turns a deviation against itself.

    Holds where feedback weakens a deviation without reversing it. The number of paths can grow exponentially.

    Parameters
    ----------
    n : int
        Number of events.
    cause, effect : array_like of int, shape (edges,)
        Edges.
    quantity : array_like of int, shape (n,)
        Quantity of each event: q+ and q- share one.
    limit : int
        Steps of the search from one event.

    Returns
    -------
    ndarray of bool, shape (n, n)
        Row: event reached, column: event it starts from; the diagonal is True.

    Raises
    ------
    ParameterError
        If a search takes more than `limit` steps.
    """
    a, b = edge_arrays(n, cause, effect)
    of = indices(quantity, n, "quantity")
    if len(of) != n:
        raise ParameterError(f"quantity has {len(of)} entries: give one for each of the {n} events.")
    start, to, _ = rows_by(n, a, b)
    found = np.zeros((n, n), bool)
    path, place = np.empty(n + 1, np.int32), np.empty(n + 1, np.int32)
    for first in range(n):
        on_path = np.zeros(n, bool)
        if _simple_paths(first, start, to, of, on_path, path, place, found[first], limit) < 0:
            raise ParameterError(f"event {first}: more than {limit} steps over simple paths; use the closure.")
    return found.T
