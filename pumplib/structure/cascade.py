"""Thesis 1.3, 6.3: split of a system into two cascade-connected parts, found from its structure.

The upstream part can be tested on its own and determines the few variables that it shares with the rest; the downstream
part takes them as known. Every minimal over-constrained subset is a seed. It takes in every constraint without a new
unknown, then one after the other those that determine one new unknown. Of all parts passed on the way the one is chosen
that spends least redundancy, contains fewest faults, shares fewest variables, and then leaves least for downstream.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import sympy as sp

from pumplib.errors import ParameterError
from pumplib.structure.graph import Structure, bits
from pumplib.structure.matching import redundancy
from pumplib.structure.model import Constraint, StructuralModel
from pumplib.structure.mso import mso_matrix


@dataclass(frozen=True, kw_only=True, slots=True)
class Split:
    """Two parts of a system in cascade.

    Parameters
    ----------
    upstream, downstream : tuple of str
        Constraints of the two parts.
    shared : tuple of str
        Unknowns of the upstream part that the downstream part contains.
    redundancy : tuple of int
        Of the two parts, the shared variables taken as known downstream.
    """

    upstream: tuple[str, ...]
    downstream: tuple[str, ...]
    shared: tuple[str, ...]
    redundancy: tuple[int, int]


def cascade(structure: Structure, *, limit: int = 10_000) -> Split:
    """Split a system into two cascade-connected parts.

    Parameters
    ----------
    structure : Structure
        The whole system.
    limit : int
        Number of minimal over-constrained subsets beyond which the search is given up.

    Returns
    -------
    Split

    Raises
    ------
    ParameterError
        If there is no split with something to test in both parts, or there are more subsets than `limit`.
    """
    every = (1 << len(structure.constraints)) - 1
    seeds = [
        _absorb(structure, sum(1 << k for k in row.nonzero()[0].tolist()), every)
        for row in mso_matrix(structure, limit=limit)
    ]
    excess = {seed: seed.bit_count() - _columns(structure, seed).bit_count() for seed in seeds}
    total = redundancy(structure)
    best: tuple[tuple[int, int, int, int], int] | None = None
    for seed in sorted(seeds):
        # what is absorbed raises the redundancy, so a part never falls below its seed
        if best is not None and excess[seed] > best[0][0]:
            continue
        for part in _growth(structure, seed, every):
            spent = part.bit_count() - _columns(structure, part).bit_count()
            if spent >= total or not _shared(structure, part, every):
                continue
            key = (spent, _faults(structure, part), _shared(structure, part, every).bit_count(), -part.bit_count())
            if best is None or key < best[0]:
                best = key, part
    if best is None:
        raise ParameterError(
            f"{structure.name}: no split in cascade: redundancy {total}; both parts need something to test."
        )
    part = best[1]
    upstream = tuple(structure.constraints[k] for k in bits(part))
    downstream = tuple(structure.constraints[k] for k in bits(every & ~part))
    shared = tuple(structure.unknowns[x] for x in bits(_shared(structure, part, every)))
    return Split(
        upstream=upstream,
        downstream=downstream,
        shared=shared,
        redundancy=(redundancy(structure.sub(upstream)), redundancy(structure.sub(downstream, shared))),
    )


def split_model(
    model: StructuralModel, split: Split, *, measured: Mapping[str, str] | None = None
) -> tuple[StructuralModel, StructuralModel]:
    """Models of the two parts; downstream each shared variable gets a measurement, the upstream part's result.

    Parameters
    ----------
    model : StructuralModel
        The whole system.
    split : Split
        Its split.
    measured : mapping of str to str, optional
        Shared variable -> suffix of its measurement y_<suffix> and constraint m_<suffix>; by default its own name.

    Returns
    -------
    tuple of StructuralModel
        Upstream and downstream.

    Raises
    ------
    ParameterError
        If a name of the split is not in the model, or that of a new measurement is taken.
    """
    parts = model.submodel(split.upstream), model.submodel(split.downstream)
    extra, signals = [], []
    taken = {s.name for s in (*model.unknown, *model.known, *model.faults, *model.parameters)} | set(model.names)
    for name in split.shared:
        suffix = (measured or {}).get(name, name)
        if {f"y_{suffix}", f"m_{suffix}"} & taken:
            raise ParameterError(f"{model.name}: y_{suffix} or m_{suffix} is taken; give {name} another suffix.")
        variable = model.symbol(name)
        signal = sp.Symbol(f"y_{suffix}", **variable.assumptions0)
        extra.append(Constraint(name=f"m_{suffix}", relation=signal - variable))
        signals.append(signal)
    down = parts[1]
    return parts[0], StructuralModel(
        name=f"{model.name}, downstream part",
        constraints=(*down.constraints, *extra),
        unknown=down.unknown,
        known=(*down.known, *signals),
        faults=down.faults,
        parameters=down.parameters,
        part=True,
    )


def _columns(structure: Structure, part: int) -> int:
    mask = 0
    for k in bits(part):
        mask |= structure.rows[k]
    return mask


def _faults(structure: Structure, part: int) -> int:
    mask = 0
    for k in bits(part):
        mask |= structure.fault_rows[k]
    return mask.bit_count()


def _shared(structure: Structure, part: int, every: int) -> int:
    return _columns(structure, part) & _columns(structure, every & ~part)


def _absorb(structure: Structure, part: int, every: int) -> int:
    """The part with every constraint that has no further unknown."""
    columns = _columns(structure, part)
    for k in bits(every & ~part):
        if not structure.rows[k] & ~columns:
            part |= 1 << k
    return part


def _growth(structure: Structure, part: int, every: int) -> Iterator[int]:
    """Parts on the way from a seed: always that next constraint with one new unknown that costs least."""
    while part != every:
        yield part
        columns = _columns(structure, part)
        following = [
            _absorb(structure, part | 1 << k, every)
            for k in bits(every & ~part)
            if (structure.rows[k] & ~columns).bit_count() == 1
        ]
        if not following:
            return
        part = min(
            following,
            key=lambda one: (_faults(structure, one), _shared(structure, one, every).bit_count(), -one.bit_count()),
        )
