"""Thesis 6.1: maximum matching of constraints and unknowns, and what alternating paths reach from it."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from pumplib.structure.graph import Structure, bits


@dataclass(frozen=True, kw_only=True, slots=True)
class Matching:
    """Which constraint is used to compute which unknown, as many pairs as there can be.

    Parameters
    ----------
    structure : Structure
        What was matched.
    unknown_of : tuple of int
        Position of the unknown of each constraint, -1 where it has none.
    constraint_of : tuple of int
        Position of the constraint of each unknown, -1 where it has none.
    """

    structure: Structure
    unknown_of: tuple[int, ...]
    constraint_of: tuple[int, ...]

    @property
    def size(self) -> int:
        """Number of pairs, the structural rank."""
        return sum(k >= 0 for k in self.unknown_of)

    @property
    def pairs(self) -> dict[str, str]:
        """Constraint -> unknown."""
        s = self.structure
        return {s.constraints[k]: s.unknowns[x] for k, x in enumerate(self.unknown_of) if x >= 0}

    def reached(self) -> int:
        """Bit set of the constraints on alternating paths from those without an unknown: the over-determined part.

        Returns
        -------
        int
        """
        rows = self.structure.rows
        waiting = [k for k, x in enumerate(self.unknown_of) if x < 0]
        found, seen = sum(1 << k for k in waiting), 0
        while waiting:
            row = rows[waiting.pop()]
            for x in bits(row & ~seen):
                partner = self.constraint_of[x]
                if not found >> partner & 1:
                    found |= 1 << partner
                    waiting.append(partner)
            seen |= row
        return found


def maximum_matching(structure: Structure) -> Matching:
    """Match as many unknowns as possible, each with a constraint of its own.

    Parameters
    ----------
    structure : Structure
        The graph.

    Returns
    -------
    Matching

    References
    ----------
    J. E. Hopcroft and R. M. Karp, SIAM J. Computing 2 (1973), in scipy.sparse.csgraph. Thesis 6.1.
    """
    constraint_of = [-1] * len(structure.unknowns)
    if any(structure.rows):
        from scipy.sparse import csr_matrix
        from scipy.sparse.csgraph import maximum_bipartite_matching

        unknown_of = maximum_bipartite_matching(csr_matrix(structure.incidence()), perm_type="column").tolist()
    else:
        unknown_of = [-1] * len(structure.constraints)
    for k, x in enumerate(unknown_of):
        if x >= 0:
            constraint_of[x] = k
    return Matching(structure=structure, unknown_of=tuple(unknown_of), constraint_of=tuple(constraint_of))


def redundancy(structure: Structure) -> int:
    """Number of constraints of the over-determined part beyond its unknowns: independent ways to test the model.

    Parameters
    ----------
    structure : Structure
        The graph.

    Returns
    -------
    int
    """
    return len(structure.constraints) - maximum_matching(structure).size


def over_determined(structure: Structure, without: Iterable[str] = ()) -> tuple[str, ...]:
    """Constraints of the over-determined part: those that some test can use.

    Parameters
    ----------
    structure : Structure
        The graph.
    without : iterable of str
        Constraints that are taken away first.

    Returns
    -------
    tuple of str
        In the order of the model.
    """
    removed = set(structure.index(without))
    rest = structure.sub(c for k, c in enumerate(structure.constraints) if k not in removed)
    return tuple(rest.constraints[k] for k in bits(maximum_matching(rest).reached()))


def is_mso(structure: Structure, constraints: Iterable[str]) -> bool:
    """Whether some constraints are a minimal over-constrained subset, checked from the definition.

    Parameters
    ----------
    structure : Structure
        The graph.
    constraints : iterable of str
        Names.

    Returns
    -------
    bool
        True if there is one constraint more than unknowns and no proper subset is over-determined.
    """
    part = structure.sub(constraints)
    return redundancy(part) == 1 and len(over_determined(part)) == len(part.constraints)
