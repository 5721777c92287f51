"""Thesis 6.1: Dulmage-Mendelsohn decomposition: the parts of a model with too few, enough and too many constraints."""

from __future__ import annotations

from dataclasses import dataclass

from pumplib.structure.graph import Structure, bits
from pumplib.structure.matching import Matching, maximum_matching


@dataclass(frozen=True, kw_only=True, slots=True)
class Block:
    """Constraints with the unknowns that belong to them.

    Parameters
    ----------
    constraints : tuple of str
        Constraints.
    unknowns : tuple of str
        Unknowns.
    """

    constraints: tuple[str, ...]
    unknowns: tuple[str, ...]


@dataclass(frozen=True, kw_only=True, slots=True)
class Decomposition:
    """Dulmage-Mendelsohn decomposition.

    Parameters
    ----------
    structure : Structure
        What was decomposed.
    under : Block
        Part with fewer constraints than unknowns.
    square : tuple of Block
        Strongly connected blocks of the exactly determined part, in the order in which they can be solved once the
        over-determined part is.
    over : Block
        Part with more constraints than unknowns.
    classes : tuple of Block
        The over-determined part again, by equivalence classes: constraints that leave it together, with the unknowns
        that leave with them. Unknowns that stay whichever class leaves are in none.
    """

    structure: Structure
    under: Block
    square: tuple[Block, ...]
    over: Block
    classes: tuple[Block, ...]

    @property
    def redundancy(self) -> int:
        """Constraints of the over-determined part beyond its unknowns."""
        return len(self.over.constraints) - len(self.over.unknowns)


def decompose(structure: Structure) -> Decomposition:
    """Decompose a model.

    Parameters
    ----------
    structure : Structure
        The graph.

    Returns
    -------
    Decomposition

    References
    ----------
    A. L. Dulmage and N. S. Mendelsohn, Coverings of bipartite graphs, Canadian J. Mathematics 10 (1958).
    M. Blanke et al., Diagnosis and Fault-Tolerant Control (2016), chapter 5. Thesis 6.1.
    """
    matching = maximum_matching(structure)
    over_rows = matching.reached()
    over_columns = 0
    for k in bits(over_rows):
        over_columns |= structure.rows[k]
    under_rows, under_columns = _under(matching)
    rest = ((1 << len(structure.constraints)) - 1) & ~over_rows & ~under_rows
    return Decomposition(
        structure=structure,
        under=_block(structure, under_rows, under_columns),
        square=tuple(_block(structure, *pair) for pair in _strong_blocks(matching, rest)),
        over=_block(structure, over_rows, over_columns),
        classes=_classes(structure, over_rows, over_columns),
    )


def _block(structure: Structure, rows: int, columns: int) -> Block:
    return Block(
        constraints=tuple(structure.constraints[k] for k in bits(rows)),
        unknowns=tuple(structure.unknowns[k] for k in bits(columns)),
    )


def _under(matching: Matching) -> tuple[int, int]:
    """Rows and columns on alternating paths from the unknowns without a constraint."""
    structure = matching.structure
    users = [0] * len(structure.unknowns)
    for k, row in enumerate(structure.rows):
        for x in bits(row):
            users[x] |= 1 << k
    waiting = [x for x, k in enumerate(matching.constraint_of) if k < 0]
    columns, rows = sum(1 << x for x in waiting), 0
    while waiting:
        new = users[waiting.pop()] & ~rows
        rows |= new
        for k in bits(new):
            x = matching.unknown_of[k]
            columns |= 1 << x
            waiting.append(x)
    return rows, columns


def _strong_blocks(matching: Matching, rows: int) -> list[tuple[int, int]]:
    """Strong components of a set of rows that need each other, those first that need no other."""
    from scipy.sparse import csr_matrix
    from scipy.sparse.csgraph import connected_components

    chosen = bits(rows)
    if not chosen:
        return []
    place = {k: i for i, k in enumerate(chosen)}
    needs = [
        [place[j] for x in bits(matching.structure.rows[k]) if (j := matching.constraint_of[x]) in place and j != k]
        for k in chosen
    ]
    edges = [(i, j) for i, needed in enumerate(needs) for j in needed]
    graph = csr_matrix(
        ([1] * len(edges), ([i for i, _ in edges], [j for _, j in edges])), shape=(len(chosen), len(chosen))
    )
    count, label = connected_components(graph, directed=True, connection="strong")
    waits = [{int(label[j]) for i in range(len(chosen)) if label[i] == c for j in needs[i]} - {c} for c in range(count)]
    done: list[int] = []
    while len(done) < count:  # the components form no cycle, so one is always free
        free = next(c for c in range(count) if c not in done and waits[c] <= set(done))
        done.append(free)
    found = []
    for c in done:
        members = [chosen[i] for i in range(len(chosen)) if label[i] == c]
        found.append((sum(1 << k for k in members), sum(1 << matching.unknown_of[k] for k in members)))
    return found


def _classes(structure: Structure, rows: int, columns: int) -> tuple[Block, ...]:
    """Equivalence classes of the over-determined part, in the order of their first constraints."""
    names = [structure.constraints[k] for k in bits(rows)]
    part = structure.sub(names)
    unknown_names = [structure.unknowns[k] for k in bits(columns)]
    found, left = [], dict.fromkeys(range(len(names)))
    while left:
        first = next(iter(left))
        staying_rows = [k for k in range(len(names)) if k != first]
        rest = part.sub(names[k] for k in staying_rows)
        kept = {staying_rows[k] for k in bits(maximum_matching(rest).reached())}
        kept_columns = 0
        for k in kept:
            kept_columns |= part.rows[k]
        group = [k for k in range(len(names)) if k not in kept]
        for k in group:
            left.pop(k, None)
        found.append(
            Block(
                constraints=tuple(names[k] for k in group),
                unknowns=tuple(name for k, name in enumerate(unknown_names) if not kept_columns >> k & 1),
            )
        )
    return tuple(found)
