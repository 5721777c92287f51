"""Thesis 6.1, 6.4: which faults a model can detect and tell apart, before any residual is designed."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pumplib.errors import ParameterError
from pumplib.structure.graph import Structure
from pumplib.structure.matching import over_determined

Array = NDArray[Any]


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Isolability:
    """What can be detected and isolated.

    Parameters
    ----------
    faults : tuple of str
        Names.
    detectable : ndarray of bool, shape (faults,)
        Whether some residual may react to the fault.
    isolable : ndarray of bool, shape (faults, faults)
        Entry (i, j): some residual may react to fault i and is blind to fault j, so i cannot be taken for j alone.
    """

    faults: tuple[str, ...]
    detectable: Array
    isolable: Array

    @property
    def confused(self) -> dict[str, tuple[str, ...]]:
        """Each fault with the others that explain whatever it does."""
        return {
            name: tuple(other for j, other in enumerate(self.faults) if j != i and not self.isolable[i, j])
            for i, name in enumerate(self.faults)
        }


def isolability(structure: Structure) -> Isolability:
    """Best that any set of residuals of the model could do.

    Parameters
    ----------
    structure : Structure
        The graph with its faults. A fault may enter several constraints; being blind to it takes doing without all.

    Returns
    -------
    Isolability

    References
    ----------
    M. Krysander and E. Frisk, Sensor placement for fault diagnosis, IEEE Trans. Systems, Man, and Cybernetics A 38
    (2008). Thesis 6.1.
    """
    n = len(structure.faults)

    def visible(without: Iterable[str] = ()) -> Array:
        mask = 0
        for k in structure.index(over_determined(structure, without)):
            mask |= structure.fault_rows[k]
        return np.array([bool(mask >> i & 1) for i in range(n)], dtype=bool)

    isolable = np.zeros((n, n), dtype=bool)
    for j in range(n):
        hit = [c for c, row in zip(structure.constraints, structure.fault_rows, strict=True) if row >> j & 1]
        isolable[:, j] = visible(hit)
    return Isolability(faults=structure.faults, detectable=visible(), isolable=isolable)


def signature(structure: Structure, subsets: Iterable[Sequence[str]]) -> Array:
    """Fault signatures of residuals.

    Parameters
    ----------
    structure : Structure
        The graph with its faults.
    subsets : iterable of sequence of str
        Constraints that each residual uses.

    Returns
    -------
    ndarray of bool, shape (subsets, faults)
        Whether the fault enters the residual.

    Raises
    ------
    ParameterError
        If the model has no fault.
    """
    if not structure.faults:
        raise ParameterError(f"{structure.name}: has no fault; declare the faults to get signatures.")
    rows = [[f in structure.faults_of(subset) for f in structure.faults] for subset in subsets]
    return np.array(rows, dtype=bool).reshape(-1, len(structure.faults))


def isolability_of(structure: Structure, subsets: Iterable[Sequence[str]]) -> Isolability:
    """What certain residuals can do by reacting or not.

    Parameters
    ----------
    structure : Structure
        The graph with its faults.
    subsets : iterable of sequence of str
        Constraints that each residual uses.

    Returns
    -------
    Isolability
    """
    reacts = signature(structure, subsets)
    isolable = np.any(reacts[:, :, None] & ~reacts[:, None, :], axis=0)
    return Isolability(
        faults=structure.faults, detectable=np.asarray(np.any(reacts, axis=0)), isolable=np.asarray(isolable)
    )
