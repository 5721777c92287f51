"""Thesis 6.1: the structure of a model: which constraint contains which unknown, as bit sets, without its equations.

An unknown is a bit; the row of a constraint is a Python integer with the bits of its unknowns. All structural analysis
works on this form, so a model may also be given as plain facts (constraint -> unknowns) where no equation is published.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from pumplib.errors import ParameterError


def bits(mask: int) -> list[int]:
    """Positions of the ones of a bit set, lowest first.

    Parameters
    ----------
    mask : int
        Bit set, not negative.

    Returns
    -------
    list of int
    """
    found = []
    while mask:
        low = mask & -mask
        found.append(low.bit_length() - 1)
        mask ^= low
    return found


def _repeated(names: Sequence[str]) -> str | None:
    seen: set[str] = set()
    for name in names:
        if name in seen:
            return name
        seen.add(name)
    return None


@dataclass(frozen=True, kw_only=True, slots=True)
class Structure:
    """Bipartite graph of constraints and unknown variables, with the faults of each constraint.

    Parameters
    ----------
    name : str
        Name of the model, shown in errors.
    constraints : tuple of str
        Names of the constraints, in the order of the model.
    unknowns : tuple of str
        Names of the unknown variables.
    rows : tuple of int
        Of each constraint, the bit set of its unknowns.
    faults : tuple of str
        Names of the faults.
    fault_rows : tuple of int
        Of each constraint, the bit set of the faults that enter it.
    differential : tuple of (str, str, str)
        Constraint, rate and state of each differential constraint.

    Raises
    ------
    ParameterError
        If a name is there twice or a row does not fit the names.
    """

    name: str
    constraints: tuple[str, ...]
    unknowns: tuple[str, ...]
    rows: tuple[int, ...]
    faults: tuple[str, ...] = ()
    fault_rows: tuple[int, ...] = ()
    differential: tuple[tuple[str, str, str], ...] = ()

    def __post_init__(self) -> None:
        if not self.fault_rows:
            object.__setattr__(self, "fault_rows", (0,) * len(self.constraints))
        for what, names in (("constraint", self.constraints), ("unknown", self.unknowns), ("fault", self.faults)):
            twice = _repeated(names)
            if twice is not None:
                raise ParameterError(f"{self.name}: {what} {twice} is there twice; give each its own name.")
        for what, rows, count in (
            ("unknowns", self.rows, len(self.unknowns)),
            ("faults", self.fault_rows, len(self.faults)),
        ):
            if len(rows) != len(self.constraints):
                raise ParameterError(
                    f"{self.name}: {len(rows)} rows of {what} for {len(self.constraints)} constraints; give one each."
                )
            for constraint, row in zip(self.constraints, rows, strict=True):
                if row < 0 or row.bit_length() > count:
                    raise ParameterError(f"{self.name}: constraint {constraint} refers to more than {count} {what}.")

    @classmethod
    def from_sets(
        cls,
        name: str,
        constraints: Mapping[str, Iterable[str]],
        faults: Mapping[str, Iterable[str]] | None = None,
        differential: Sequence[tuple[str, str, str]] = (),
        unknowns: Sequence[str] | None = None,
    ) -> Structure:
        """Structure from names.

        Parameters
        ----------
        name : str
            Name of the model.
        constraints : mapping
            Constraint -> names of its unknowns.
        faults : mapping, optional
            Constraint -> names of the faults that enter it.
        differential : sequence of (str, str, str)
            Constraint, rate and state of each differential constraint.
        unknowns : sequence of str, optional
            Order of the unknowns; by default that of their first occurrence.

        Returns
        -------
        Structure

        Raises
        ------
        ParameterError
            If an unknown is not in the given order, or a fault is given for a constraint that does not exist.
        """
        sets = {constraint: tuple(dict.fromkeys(found)) for constraint, found in constraints.items()}
        order = tuple(unknowns) if unknowns is not None else tuple(dict.fromkeys(v for s in sets.values() for v in s))
        place = {variable: k for k, variable in enumerate(order)}
        entering = {constraint: tuple(found) for constraint, found in (faults or {}).items()}
        for constraint in entering:
            if constraint not in sets:
                raise ParameterError(
                    f"{name}: faults {entering[constraint]} enter {constraint}, which is no constraint."
                )
        names = tuple(dict.fromkeys(f for found in entering.values() for f in found))
        rows = []
        for constraint, found in sets.items():
            for variable in found:
                if variable not in place:
                    raise ParameterError(
                        f"{name}: constraint {constraint} contains {variable}, not among the unknowns."
                    )
            rows.append(sum(1 << place[variable] for variable in found))
        return cls(
            name=name,
            constraints=tuple(sets),
            unknowns=order,
            rows=tuple(rows),
            faults=names,
            fault_rows=tuple(sum(1 << names.index(f) for f in set(entering.get(c, ()))) for c in sets),
            differential=tuple((c, rate, state) for c, rate, state in differential),
        )

    @classmethod
    def from_matrix(cls, name: str, matrix: ArrayLike) -> Structure:
        """Structure from a matrix whose entries other than zero say which constraint contains which unknown.

        Parameters
        ----------
        name : str
            Name of the model.
        matrix : array_like, shape (constraints, unknowns)
            Incidence.

        Returns
        -------
        Structure
            Constraints e1, e2, ... and unknowns x1, x2, ...

        Raises
        ------
        ParameterError
            If it is not a matrix or contains something that is not a number.
        """
        given = np.asarray(matrix)
        if given.ndim != 2 or given.dtype.kind not in "biuf" or (given.dtype.kind == "f" and np.isnan(given).any()):
            raise ParameterError(
                f"{name}: incidence of shape {given.shape}, {given.dtype}; must be a matrix of numbers."
            )
        weights = [1 << k for k in range(given.shape[1])]
        return cls(
            name=name,
            constraints=tuple(f"e{k + 1}" for k in range(given.shape[0])),
            unknowns=tuple(f"x{k + 1}" for k in range(given.shape[1])),
            rows=tuple(sum(weights[k] for k in np.flatnonzero(row)) for row in given),
        )

    def index(self, constraints: Iterable[str]) -> tuple[int, ...]:
        """Positions of constraints.

        Parameters
        ----------
        constraints : iterable of str
            Names.

        Returns
        -------
        tuple of int
            In the order asked for.

        Raises
        ------
        ParameterError
            If there is no such constraint.
        """
        place = {name: k for k, name in enumerate(self.constraints)}
        found = []
        for name in constraints:
            if name not in place:
                raise ParameterError(f"{self.name}: no constraint {name!r}; there are {', '.join(self.constraints)}.")
            found.append(place[name])
        return tuple(found)

    def unknowns_of(self, constraints: Iterable[str]) -> tuple[str, ...]:
        """Unknowns that occur in some constraints, in the order of the model.

        Parameters
        ----------
        constraints : iterable of str
            Names.

        Returns
        -------
        tuple of str
        """
        mask = 0
        for k in self.index(constraints):
            mask |= self.rows[k]
        return tuple(self.unknowns[k] for k in bits(mask))

    def faults_of(self, constraints: Iterable[str]) -> tuple[str, ...]:
        """Faults that enter some constraints, in the order of the model.

        Parameters
        ----------
        constraints : iterable of str
            Names.

        Returns
        -------
        tuple of str
        """
        mask = 0
        for k in self.index(constraints):
            mask |= self.fault_rows[k]
        return tuple(self.faults[k] for k in bits(mask))

    def sub(self, constraints: Iterable[str], known: Iterable[str] = ()) -> Structure:
        """Part of the structure: some constraints, with some unknowns taken as known.

        Parameters
        ----------
        constraints : iterable of str
            Names; they keep the order of the model.
        known : iterable of str
            Unknowns that another part of the system determines.

        Returns
        -------
        Structure
            With the unknowns and faults that are left in it; the differential constraints of states or rates that
            are known now are plain constraints.

        Raises
        ------
        ParameterError
            If a constraint or an unknown does not exist.
        """
        chosen = sorted(set(self.index(constraints)))
        given = tuple(known)
        for variable in given:
            if variable not in self.unknowns:
                raise ParameterError(f"{self.name}: {variable!r} is no unknown; there are {', '.join(self.unknowns)}.")
        removed = sum(1 << self.unknowns.index(variable) for variable in set(given))
        rows = [self.rows[k] & ~removed for k in chosen]
        fault_rows = [self.fault_rows[k] for k in chosen]
        names = tuple(self.constraints[k] for k in chosen)
        return Structure(
            name=self.name,
            constraints=names,
            unknowns=tuple(self.unknowns[k] for k in _columns(rows)),
            rows=_packed(rows),
            faults=tuple(self.faults[k] for k in _columns(fault_rows)),
            fault_rows=_packed(fault_rows),
            differential=tuple(
                d for d in self.differential if d[0] in names and d[1] not in given and d[2] not in given
            ),
        )

    def incidence(self) -> Any:
        """Incidence of constraints and unknowns.

        Returns
        -------
        scipy.sparse.csr_array of int8, shape (constraints, unknowns)
        """
        return _sparse(self.rows, len(self.unknowns))

    def fault_incidence(self) -> Any:
        """Incidence of constraints and faults.

        Returns
        -------
        scipy.sparse.csr_array of int8, shape (constraints, faults)
        """
        return _sparse(self.fault_rows, len(self.faults))


def _columns(rows: Sequence[int]) -> list[int]:
    """Columns that any row uses."""
    mask = 0
    for row in rows:
        mask |= row
    return bits(mask)


def _packed(rows: Sequence[int]) -> tuple[int, ...]:
    """Rows after the columns that none uses are left out."""
    place = {column: k for k, column in enumerate(_columns(rows))}
    return tuple(sum(1 << place[column] for column in bits(row)) for row in rows)


def _sparse(rows: Sequence[int], columns: int) -> Any:
    from scipy.sparse import csr_array

    found = [bits(row) for row in rows]
    pointers = np.cumsum([0, *map(len, found)], dtype=np.int32)
    indices = np.array([k for row in found for k in row], dtype=np.int32)
    return csr_array((np.ones(len(indices), dtype=np.int8), indices, pointers), shape=(len(rows), columns))
