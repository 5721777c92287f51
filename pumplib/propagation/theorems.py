"""Thesis 4.2.2: robust detectability and isolability of faults under disturbing events (Theorems 2 and 3).

With the end-effects e = A_f f OR A_d d, a fault is robust against a set F_d of disturbing event vectors when no
choice of them makes it look like something else. F_d is the cube (any combination) or the vectors below some
maximal ones, the facets: ``[[1, 0], [0, 1]]`` says that the two events never come together. The statements are a
reconstruction; the proofs are short and stand with each function.
"""

from collections.abc import Hashable, Sequence
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pumplib.errors import ParameterError
from pumplib.propagation.graph import mask

Array = NDArray[Any]


def _matrices(a_f: ArrayLike, a_d: ArrayLike) -> tuple[Array, Array]:
    f = mask(a_f, (-1, -1), "A_f")
    return f, mask(a_d, (len(f), -1), "A_d")


def _facets(a_d: Array, facets: ArrayLike | None) -> Array:
    if facets is None:
        return np.ones((1, a_d.shape[1]), bool)
    found = mask(facets, (-1, a_d.shape[1]), "facets")
    if not len(found):
        raise ParameterError("facets: none is given; the empty set of disturbing events is one row of zeros.")
    return found


def _labels(groups: Sequence[Hashable], m: int) -> list[Hashable]:
    if len(groups) != m:
        raise ParameterError(f"groups has {len(groups)} entries: give one for each of the {m} faults.")
    return list(dict.fromkeys(groups))


def touched(a_d: ArrayLike, facets: ArrayLike | None = None) -> Array:
    """End-effects that disturbing events can raise: u = A_d d for the greatest d, one row a facet.

    Parameters
    ----------
    a_d : array_like of bool, shape (ends, p)
        A_d.
    facets : array_like of bool, shape (k, p), optional
        Maximal disturbing event vectors; any combination is allowed if not given.

    Returns
    -------
    ndarray of bool, shape (k, ends)
        One row for the cube.
    """
    d = mask(a_d, (-1, -1), "A_d")
    chosen = _facets(d, facets)
    found: Array = np.any(chosen[:, None, :] & d[None, :, :], axis=2)
    return found


def detectable(a_f: ArrayLike, a_d: ArrayLike, facets: ArrayLike | None = None) -> Array:
    """Theorem 2: which faults no combination of disturbing events can imitate or hide.

    Fault f is detectable when A_f f OR A_d d differs from A_d d' for all d, d' in F_d. If A_f f <= A_d d' for one d',
    take d = d': both sides are equal. If both sides are equal, A_f f <= A_d d'. So f is detectable exactly if it
    raises, for every facet, an end-effect that the facet does not. A fault vector above a detectable one is
    detectable, because the end-effect stays raised: looking at single faults is enough.

    Parameters
    ----------
    a_f : array_like of bool, shape (ends, m)
        A_f, or a column for every fault vector of interest.
    a_d : array_like of bool, shape (ends, p)
        A_d.
    facets : array_like of bool, shape (k, p), optional
        Maximal disturbing event vectors; any combination is allowed if not given.

    Returns
    -------
    ndarray of bool, shape (m,)

    References
    ----------
    Thesis 1.3 announces two theorems on robustness; their text does not survive.
    """
    f, d = _matrices(a_f, a_d)
    found: Array = np.all(np.any(f[None] & ~touched(d, facets)[:, :, None], axis=1), axis=0)
    return found


def signatures(a_f: ArrayLike, a_d: ArrayLike) -> Array:
    """Number the signatures of faults on undisturbed end-effects (Theorem 3b); equal numbers look alike.

    Parameters
    ----------
    a_f : array_like of bool, shape (ends, m)
        A_f.
    a_d : array_like of bool, shape (ends, p)
        A_d; any combination of disturbing events is allowed.

    Returns
    -------
    ndarray of int, shape (m,)
        In the order in which the signatures are met; -1 for one that is empty: not detectable.
    """
    f, d = _matrices(a_f, a_d)
    columns = np.packbits(f & ~np.any(d, axis=1)[:, None], axis=0).T
    number: dict[bytes, int] = {bytes(columns.shape[1]): -1}
    return np.array([number.setdefault(column.tobytes(), len(number) - 1) for column in columns], int)


def isolable(a_f: ArrayLike, a_d: ArrayLike, facets: ArrayLike | None = None) -> Array:
    """Theorems 3 and 3a: which pairs of faults no disturbing events can make look alike.

    Faults a, b are isolable when a OR A_d d differs from b OR A_d d' for all d, d' in F_d; d and d' may differ,
    since neither is known. With a greatest d only the end-effects that it leaves alone can tell them apart: take it
    on both sides, everything else is raised in both. Without one, every pair of facets is searched for the greatest
    d, d' with equal sides: a column of A_d that is not below b OR A_d d' cannot be part of d and is deleted,
    likewise for d', until nothing changes. Solutions are closed under OR and are never deleted, so what is left
    contains all of them; it is a solution exactly if there is one.

    Parameters
    ----------
    a_f : array_like of bool, shape (ends, m)
        A_f, or a column for every fault vector of interest.
    a_d : array_like of bool, shape (ends, p)
        A_d.
    facets : array_like of bool, shape (k, p), optional
        Maximal disturbing event vectors; any combination is allowed if not given.

    Returns
    -------
    ndarray of bool, shape (m, m)
        Symmetric, False on the diagonal.
    """
    f, d = _matrices(a_f, a_d)
    chosen = _facets(d, facets)
    if len(chosen) == 1:
        number = signatures(f, d & chosen[0])
        found: Array = number[:, None] != number[None, :]
        return found
    columns, faults = _whole_numbers(d), _whole_numbers(f)
    allowed = [[columns[k] for k in np.flatnonzero(facet)] for facet in chosen]
    found = np.zeros((len(faults), len(faults)), bool)
    for i, j in combinations(range(len(faults)), 2):
        alike = any(_alike(faults[i], faults[j], up, down) for up in allowed for down in allowed)
        found[i, j] = found[j, i] = not alike
    return found


def _whole_numbers(matrix: Array) -> list[int]:
    """Columns as whole numbers, one bit a row."""
    return [int.from_bytes(column.tobytes()) for column in np.packbits(matrix, axis=0).T]


def _union(columns: Sequence[int], start: int) -> int:
    for column in columns:
        start |= column
    return start


def _alike(a: int, b: int, up: list[int], down: list[int]) -> bool:
    """Whether a with some columns of `up` can look like b with some columns of `down`."""
    while True:
        left, right = _union(up, a), _union(down, b)
        fewer_up = [column for column in up if not column & ~right]
        fewer_down = [column for column in down if not column & ~left]
        if len(fewer_up) == len(up) and len(fewer_down) == len(down):
            return left == right
        up, down = fewer_up, fewer_down


def groups_isolable(
    a_f: ArrayLike, a_d: ArrayLike, groups: Sequence[Hashable], facets: ArrayLike | None = None
) -> tuple[list[Hashable], Array]:
    """Theorem 3b: which pairs of groups no single faults and disturbing events can make look alike.

    Parameters
    ----------
    a_f : array_like of bool, shape (ends, m)
        A_f.
    a_d : array_like of bool, shape (ends, p)
        A_d.
    groups : sequence of hashable, length m
        Group of each fault.
    facets : array_like of bool, shape (k, p), optional
        Maximal disturbing event vectors; any combination is allowed if not given.

    Returns
    -------
    names : list of hashable
        Groups in the order in which they are met.
    isolable : ndarray of bool, shape (groups, groups)
        True if no two members of different groups are confused.
    """
    pairs = isolable(a_f, a_d, facets)
    names = _labels(groups, len(pairs))
    at = np.array([names.index(name) for name in groups], int)
    found = ~np.eye(len(names), dtype=bool)
    confused = np.argwhere(~pairs)
    found[at[confused[:, 0]], at[confused[:, 1]]] = False
    return names, found


def private_rows(a_f: ArrayLike, a_d: ArrayLike) -> Array:
    """Theorem 3c: faults with an undisturbed end-effect that no other fault raises.

    If all have one, the faults present can be read off, however many there are. If fault i has none, its column is
    below the OR of the others, and all others look the same with and without i.

    Parameters
    ----------
    a_f : array_like of bool, shape (ends, m)
        A_f.
    a_d : array_like of bool, shape (ends, p)
        A_d; any combination of disturbing events is allowed.

    Returns
    -------
    ndarray of bool, shape (m,)
    """
    return decodable(a_f, a_d, range(mask(a_f, (-1, -1), "A_f").shape[1]))[1]


def decodable(a_f: ArrayLike, a_d: ArrayLike, groups: Sequence[Hashable]) -> tuple[list[Hashable], Array]:
    """Theorem 3c for groups: whose presence can be read off, whatever else is present at the same time.

    Group G is decodable when every member raises an undisturbed end-effect that no fault outside G raises: it shows
    G and nothing else does. If a member's column is below the OR of all columns outside, those together look the
    same with and without it.

    Parameters
    ----------
    a_f : array_like of bool, shape (ends, m)
        A_f.
    a_d : array_like of bool, shape (ends, p)
        A_d; any combination of disturbing events is allowed.
    groups : sequence of hashable, length m
        Group of each fault.

    Returns
    -------
    names : list of hashable
        Groups in the order in which they are met.
    decodable : ndarray of bool, shape (groups,)
    """
    f, d = _matrices(a_f, a_d)
    names = _labels(groups, f.shape[1])
    clean = f & ~np.any(d, axis=1)[:, None]
    at = np.array([names.index(name) for name in groups], int)
    found = np.zeros(len(names), bool)
    for k in range(len(names)):
        outside: Array = np.any(clean[:, at != k], axis=1)
        found[k] = np.all(np.any(clean[:, at == k] & ~outside[:, None], axis=0))
    return names, found


def disjunct(a_f: ArrayLike, a_d: ArrayLike, k: int) -> bool:
    """Whether no fault's signature is covered by k others: then any faults, at most k at once, can be told apart.

    Sufficient, not necessary: of two different sets one has a fault that the other lacks, and its signature is not
    below the at most k signatures of the other.

    Parameters
    ----------
    a_f : array_like of bool, shape (ends, m)
        A_f.
    a_d : array_like of bool, shape (ends, p)
        A_d; any combination of disturbing events is allowed.
    k : int
        Faults at once, >= 1.

    Returns
    -------
    bool

    Raises
    ------
    ParameterError
        If k is less than 1.

    References
    ----------
    W. H. Kautz and R. C. Singleton, Nonrandom binary superimposed codes, IEEE Trans. Inf. Theory 10 (1964).
    """
    if k < 1:
        raise ParameterError(f"k = {k}: at least one fault at once.")
    f, d = _matrices(a_f, a_d)
    columns = _whole_numbers(f & ~np.any(d, axis=1)[:, None])
    for i, own in enumerate(columns):
        others = [c for j, c in enumerate(columns) if j != i]
        if any(not own & ~_union(chosen, 0) for chosen in combinations(others, min(k, len(others)))):
            return False
    return True
