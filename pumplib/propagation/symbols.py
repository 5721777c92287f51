"""Thesis 4.2.2, 4.4.1: what a signal can show when deviations add up or cancel (Theorem 4).

A fault pulls a signal up, down, or both; it must do so, or it may. Pulls in one direction show it, pulls in both
can show either or nothing. A set of pulls is a whole number, 1 for up and 2 for down; a set of symbols one of
three bits: 1 for "0", 2 for "+", 4 for "-".
"""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pumplib.errors import ParameterError

Array = NDArray[Any]
UP, DOWN, BOTH = 1, 2, 3
ZERO, PLUS, MINUS, ANY = 1, 2, 4, 7
_SHOWN = (ZERO, PLUS, MINUS, ANY)  # symbols of the pulls that act: none, up, down, both


def _tables() -> tuple[Array, Array]:
    """Symbols for (must, may), and for (must, may, hits of disturbing events), by enumeration."""
    plain = np.zeros((4, 4), np.uint8)
    for must in range(4):
        for may in range(4):
            acting = [s for s in range(4) if not must & ~s and not s & ~may]
            plain[must, may] = np.bitwise_or.reduce([_SHOWN[s] for s in acting] or [0])
    disturbed = np.zeros((4, 4, 4), np.uint8)
    for hits in range(4):
        for u in range(4):
            if not u & ~hits:
                for must in range(4):
                    for may in range(4):
                        disturbed[must, may, hits] |= plain[must | u, may | u]
    return plain, disturbed


_PLAIN, _DISTURBED = _tables()


def _pulls(values: ArrayLike, name: str) -> Array:
    array = np.asarray(values)
    if array.size and (array.dtype.kind not in "iu" or array.min() < 0 or array.max() > BOTH):
        raise ParameterError(f"{name}: pulls are 0 none, 1 up, 2 down, 3 both; something else is given.")
    return array.astype(np.uint8)


def observable(must: ArrayLike, may: ArrayLike, hits: ArrayLike = 0) -> Array:
    """Symbols that a signal can show.

    Parameters
    ----------
    must, may : array_like of int
        Pulls that the fault must and may exert; must is part of may.
    hits : array_like of int
        Pulls that disturbing events may exert, in any combination.

    Returns
    -------
    ndarray of uint8
        Sets of symbols, three bits each.

    Raises
    ------
    ParameterError
        If a pull is none of 0 to 3, or must is no part of may.
    """
    sure, possible = _pulls(must, "must"), _pulls(may, "may")
    if (sure & ~possible).any():
        raise ParameterError("must: has a pull that is not in may; what must happen may happen.")
    found: Array = _DISTURBED[sure, possible, _pulls(hits, "hits")]
    return found


def separating(must: ArrayLike, may: ArrayLike, hits: ArrayLike) -> tuple[Array, Array]:
    """Theorem 4: which signals tell hypotheses apart, whatever the disturbing events and the pulls that act.

    A signal separates two hypotheses when no disturbing event pulls it, either way, and they have no symbol in
    common on it. If some signal does, no observation fits both. If none does, let all disturbing events act: a
    signal that they pull one way can show that way under both hypotheses, one that they pull both ways can show
    anything, the others have a common symbol by assumption; the pulls act independently, so one observation fits both.

    Parameters
    ----------
    must, may : array_like of int, shape (signals, m)
        Pulls of each fault; see `observable`.
    hits : array_like of int, shape (signals,)
        Pulls of all allowed disturbing events together.

    Returns
    -------
    pairs : ndarray of bool, shape (signals, m, m)
        Signal separates the two faults.
    alone : ndarray of bool, shape (signals, m)
        Signal separates the fault from no fault.

    Raises
    ------
    ParameterError
        If the shapes do not fit.
    """
    shown = observable(must, may)
    pulled = _pulls(hits, "hits")
    if shown.ndim != 2 or pulled.shape != shown.shape[:1]:
        raise ParameterError(f"must, may: {shown.shape}, hits: {pulled.shape}; needs (signals, faults) and (signals,).")
    clean = pulled == 0
    alone: Array = clean[:, None] & ((shown & ZERO) == 0)
    pairs: Array = clean[:, None, None] & ((shown[:, :, None] & shown[:, None, :]) == 0)
    return pairs, alone
