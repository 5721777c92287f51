"""Thesis 4.2.1: a system as index arrays, from which A_f, A_d and the graphs are made."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pumplib.fmea.entries import Edge


@dataclass(frozen=True, kw_only=True, eq=False, slots=True)
class Incidence:
    """A system as index arrays, in the order of its events, faults and disturbing events.

    Parameters
    ----------
    events : tuple of str, length n
        Events; signal events come last.
    blocks : tuple of str
        Components, then ``"OBS"`` if there are signal events.
    block : ndarray of int, shape (n,)
        Position in `blocks` of the component of each event.
    cause, effect : ndarray of int, shape (e,)
        Events of the edges; A[effect, cause] = 1.
    certain : ndarray of bool, shape (e,)
        Must edges.
    kind : ndarray of int8, shape (e,)
        Position in `EDGE_KINDS`.
    edges : tuple of Edge, length e
        The edges themselves.
    faults : tuple of str, length m
        Faults.
    fault_event, fault : ndarray of int, shape (b,)
        B_f[fault_event, fault] = 1.
    fault_certain : ndarray of bool, shape (b,)
        Must effects.
    disturbances : tuple of str, length p
        Disturbing events.
    disturbance_event, disturbance : ndarray of int, shape (c,)
        B_d[disturbance_event, disturbance] = 1.
    disturbance_certain : ndarray of bool, shape (c,)
        Must effects.
    ends : ndarray of int, shape (r,)
        Signal events, in the order of the signals.
    """

    events: tuple[str, ...]
    blocks: tuple[str, ...]
    block: NDArray[np.intp]
    cause: NDArray[np.intp]
    effect: NDArray[np.intp]
    certain: NDArray[np.bool_]
    kind: NDArray[np.int8]
    edges: tuple[Edge, ...]
    faults: tuple[str, ...]
    fault_event: NDArray[np.intp]
    fault: NDArray[np.intp]
    fault_certain: NDArray[np.bool_]
    disturbances: tuple[str, ...]
    disturbance_event: NDArray[np.intp]
    disturbance: NDArray[np.intp]
    disturbance_certain: NDArray[np.bool_]
    ends: NDArray[np.intp]
