"""Thesis 4.2: the algorithm, the theorems and the decision logic against brute force on random systems.

Brute force enumerates what the definitions say: every fault vector, every disturbing event vector, every choice
of pulls. It shares nothing with the functions that it checks but the definitions.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations, product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pumplib.propagation.decision import DecisionTable
from pumplib.propagation.gates import gate_closure
from pumplib.propagation.graph import pack
from pumplib.propagation.loops import component_cut, cut_closure, plain_closure, scc_closure
from pumplib.propagation.symbols import separating
from pumplib.propagation.theorems import (
    decodable,
    detectable,
    disjunct,
    groups_isolable,
    isolable,
    private_rows,
    signatures,
)

Array = NDArray[Any]


@dataclass(frozen=True, kw_only=True, slots=True)
class Checked:
    """Outcome of a comparison.

    Parameters
    ----------
    systems : int
        Random systems.
    compared : dict of str to int
        Answers compared, by what was asked.
    wrong : dict of str to int
        Answers that differ.
    """

    systems: int
    compared: dict[str, int]
    wrong: dict[str, int]

    @property
    def mismatches(self) -> int:
        """Answers that differ, in all."""
        return sum(self.wrong.values())


class _Count:
    def __init__(self) -> None:
        self.compared: dict[str, int] = {}
        self.wrong: dict[str, int] = {}

    def same(self, what: str, ours: Any, true: Any) -> None:
        a, b = np.asarray(ours), np.asarray(true)
        self.compared[what] = self.compared.get(what, 0) + max(a.size, b.size)
        differ = int(np.count_nonzero(a != b)) if a.shape == b.shape else max(a.size, b.size)
        self.wrong[what] = self.wrong.get(what, 0) + differ


def _cut_any(rng: np.random.Generator, n: int, a: Array, b: Array) -> Array:
    """Some set of edges that leaves no loop: all against a random order, and some more."""
    rank = rng.permutation(n)
    cut: Array = (rank[a] >= rank[b]) | (rng.random(len(a)) < 0.2)
    return cut


def count_loop_mismatches(rng: np.random.Generator, n: int = 1000) -> Checked:
    """Theorem 1: on random systems with loops every way to close them gives the least solution.

    Compared with the plain iteration: condensation, a depth-first cut between random components, any cut; and for
    systems with AND gates a depth-first and any cut.

    Parameters
    ----------
    rng : numpy.random.Generator
        Source of the systems.
    n : int
        Number of systems.

    Returns
    -------
    Checked
        One comparison a system and way.
    """
    count = _Count()
    for _ in range(n):
        events, roots = int(rng.integers(2, 40)), int(rng.integers(1, 100))
        edges = int(rng.integers(1, 3 * events))
        a, b = rng.integers(0, events, edges), rng.integers(0, events, edges)
        seeds = pack(rng.integers(0, events, 2 * roots), rng.integers(0, roots, 2 * roots), events, roots)
        true = plain_closure(events, a, b, seeds).bits
        component = rng.integers(0, max(1, events // 4), events)
        order = rng.permutation(int(component.max()) + 1)
        by_component = component_cut(events, a, b, component, order)
        ways = {
            "condensed": scc_closure(events, a, b, seeds),
            "depth-first cut": cut_closure(events, a, b, seeds, cut=by_component, component=component).bits,
            "any cut": cut_closure(events, a, b, seeds, cut=_cut_any(rng, events, a, b)).bits,
        }
        for name, bits in ways.items():
            count.same(name, np.array_equal(bits, true), True)
        gate = (rng.random(events) < 0.4) & (np.bincount(b, minlength=events) > 0)
        least = gate_closure(events, a, b, gate, seeds, cut=np.ones(edges, bool)).bits
        for name, cut in (("gates, depth-first cut", None), ("gates, any cut", _cut_any(rng, events, a, b))):
            count.same(name, np.array_equal(gate_closure(events, a, b, gate, seeds, cut=cut).bits, least), True)
    return Checked(systems=n, compared=count.compared, wrong=count.wrong)


def _vectors(facets: Array) -> list[Array]:
    """Every disturbing event vector below a facet."""
    p = facets.shape[1]
    every = np.array(list(product((False, True), repeat=p)), bool).reshape(2**p, p)
    return [d for d in every if any(not np.any(d & ~facet) for facet in facets)]


def _looks(a_f: Array, a_d: Array, f: Array, vectors: list[Array]) -> frozenset[bytes]:
    """Everything that a fault vector can look like."""
    base = np.any(a_f[:, f], axis=1)
    return frozenset((base | np.any(a_d[:, d], axis=1)).tobytes() for d in vectors)


def count_theorem_mismatches(rng: np.random.Generator, n: int = 400) -> Checked:
    """Theorems 2, 3, 3a, 3b, 3c and 4 against brute force on random systems.

    Parameters
    ----------
    rng : numpy.random.Generator
        Source of the systems.
    n : int
        Number of systems for each theorem.

    Returns
    -------
    Checked
        By theorem.
    """
    count = _Count()
    for _ in range(n):
        ends, m, p = int(rng.integers(1, 7)), int(rng.integers(1, 6)), int(rng.integers(0, 5))
        a_f, a_d = rng.random((ends, m)) < rng.uniform(0.2, 0.6), rng.random((ends, p)) < rng.uniform(0.1, 0.5)
        facets = rng.random((int(rng.integers(1, 4)), p)) < 0.6
        groups = rng.integers(0, 3, m).tolist()
        _check_single(count, a_f, a_d, None, groups, "")
        _check_single(count, a_f, a_d, facets, groups, ", facets")
        _check_many(count, a_f, a_d, groups)
        _check_signs(count, rng)
    return Checked(systems=n, compared=count.compared, wrong=count.wrong)


def _check_single(count: _Count, a_f: Array, a_d: Array, facets: Array | None, groups: list[int], note: str) -> None:
    m = a_f.shape[1]
    vectors = _vectors(np.ones((1, a_d.shape[1]), bool) if facets is None else facets)
    looks = [_looks(a_f, a_d, one, vectors) for one in np.eye(m, dtype=bool)]
    nothing = _looks(a_f, a_d, np.zeros(m, bool), vectors)
    apart = np.array([[not x & y for y in looks] for x in looks])
    count.same("Theorem 2, detectable" + note, detectable(a_f, a_d, facets), [not x & nothing for x in looks])
    count.same("Theorem 3, isolable" + note, isolable(a_f, a_d, facets), apart)
    names, found = groups_isolable(a_f, a_d, groups, facets)
    of = [[k for k in range(m) if groups[k] == name] for name in names]
    whole = [[i != j and all(apart[a, b] for a in x for b in y) for j, y in enumerate(of)] for i, x in enumerate(of)]
    count.same("Theorem 3b, groups" + note, found, whole)
    if facets is None:
        number = signatures(a_f, a_d)
        count.same("Theorem 3b, signatures", number == -1, [bool(x & nothing) for x in looks])


def _check_many(count: _Count, a_f: Array, a_d: Array, groups: list[int]) -> None:
    """Several faults at once: what each set of faults can look like, over all sets."""
    m = a_f.shape[1]
    vectors = _vectors(np.ones((1, a_d.shape[1]), bool))
    every = [np.array(f, bool) for f in product((False, True), repeat=m)]
    looks = [_looks(a_f, a_d, f, vectors) for f in every]
    alike = [(f, g) for (f, x), (g, y) in combinations(zip(every, looks, strict=True), 2) if x & y]
    single = [not x & looks[0] for f, x in zip(every, looks, strict=True) if f.any()]
    count.same("Theorem 2, single faults are enough", bool(np.all(detectable(a_f, a_d))), all(single))
    count.same("Theorem 3c, all vectors", bool(np.all(private_rows(a_f, a_d))), not alike)
    names, found = decodable(a_f, a_d, groups)
    of = np.array(groups)
    read = [not any(np.any(f[of == name]) != np.any(g[of == name]) for f, g in alike) for name in names]
    count.same("Theorem 3c, groups", found, read)
    for k in (1, 2):
        few = [pair for pair in alike if max(int(one.sum()) for one in pair) <= k]
        # the condition is sufficient: what it promises must hold
        count.same("Theorem 3c, at most k", disjunct(a_f, a_d, k) and bool(few), False)


def _observations(must: Array, may: Array, hits: Array) -> frozenset[tuple[int, ...]]:
    """Everything that can be seen: all disturbing event vectors, all pulls between must and may."""
    shows = ((0,), (1,), (-1,), (-1, 0, 1))  # by the pulls that act: none, up, down, both
    seen = set[tuple[int, ...]]()
    for d in product((False, True), repeat=hits.shape[1]):
        possible = np.bitwise_or.reduce(hits[:, np.array(d, bool)], axis=1, initial=0)
        each = []
        for sure, some, pulled in zip(must.tolist(), may.tolist(), possible.tolist(), strict=True):
            pulls = {f | u for f in range(4) for u in range(4)
                     if not sure & ~f and not f & ~some and not u & ~pulled}  # fmt: skip
            each.append({symbol for one in pulls for symbol in shows[one]})
        seen.update(product(*each))
    return frozenset(seen)


def _check_signs(count: _Count, rng: np.random.Generator) -> None:
    x, m, p = int(rng.integers(1, 4)), int(rng.integers(1, 4)), int(rng.integers(0, 4))
    may = rng.integers(0, 4, (x, m)).astype(np.uint8)
    must = may & rng.integers(0, 4, (x, m)).astype(np.uint8)
    hits = (rng.integers(0, 4, (x, p)) * (rng.random((x, p)) < 0.3)).astype(np.uint8)
    pairs, alone = separating(must, may, np.bitwise_or.reduce(hits, axis=1, initial=0))
    seen = [_observations(must[:, k], may[:, k], hits) for k in range(m)]
    nothing = _observations(np.zeros(x, int), np.zeros(x, int), hits)
    count.same("Theorem 4, no fault", np.any(alone, axis=0), [not one & nothing for one in seen])
    count.same("Theorem 4, pairs", np.any(pairs, axis=0), [[not a & b for b in seen] for a in seen])


def random_observations(rng: np.random.Generator, table: DecisionTable, n: int) -> Iterator[tuple[Array, Array]]:
    """Symbols that the table's own hypotheses can cause, in blocks.

    A case draws a fault or none, which of its possible pulls act besides the certain ones, which pulls of the
    disturbing events act, what a signal pulled both ways shows, and whether two pulls on a phasor cancel.

    Parameters
    ----------
    rng : numpy.random.Generator
        Source of the cases.
    table : DecisionTable
        Compiled table.
    n : int
        Number of cases.

    Yields
    ------
    truth : ndarray of int, shape (k,)
        Fault, -1 for none.
    symbols : ndarray of int8, shape (k, signals)
    """
    x, m = len(table.signals), len(table.faults)
    must = np.concatenate((table.must.T, np.zeros((1, x), np.uint8)))
    may = np.concatenate((table.may.T, np.zeros((1, x), np.uint8)))
    while n > 0:
        k = min(n, 20_000)
        n -= k
        truth = rng.integers(-1, m, k)
        acting = must[truth] | (may[truth] & rng.integers(0, 4, (k, x), np.uint8))
        # often little is disturbed: cases with all pulls at once would hide errors in the clean signals' rows
        quiet = rng.random((k, 1)) < 0.3
        pulled = np.where(quiet, 0, table.hit & rng.integers(0, 4, (k, x), np.uint8)).astype(np.uint8)
        gone = table.cancels & (acting != 0) & (pulled != 0) & (rng.random((k, x)) < 0.3)
        acting = np.where(gone, 0, acting | pulled)
        one_way = np.array([0, 1, -1, 0], np.int8)[acting]
        yield truth, np.where(acting == 3, rng.integers(-1, 2, (k, x), np.int8), one_way)


def count_decision_losses(
    rng: np.random.Generator, table: DecisionTable, n: int = 100_000, missing: float = 0.0
) -> dict[str, int]:
    """Soundness and completeness of a decision table on random cases.

    Parameters
    ----------
    rng : numpy.random.Generator
        Source of the cases.
    table : DecisionTable
        Compiled table.
    n : int
        Number of cases.
    missing : float
        Share of signals that are not known.

    Returns
    -------
    dict of str to int
        `cases`; `truth_lost`: the true group is no candidate, or an alarm without fault; `missed`: "fault free"
        with a covered fault (lost, too); `not_isolated`: a covered fault with all signals known whose verdict names
        another group that Theorem 4 tells from it; `alarms_without_fault`, `isolated`, `covered_faults`: plain counts.
    """
    found = dict.fromkeys(
        ("cases", "truth_lost", "missed", "not_isolated", "alarms_without_fault", "isolated", "covered_faults"), 0
    )
    pairs = np.any(separating(table.must, table.may, table.hit)[0], axis=0)
    for truth, symbols in random_observations(rng, table, n):
        if missing > 0:
            symbols = np.where(rng.random(symbols.shape) < missing, 2, symbols).astype(np.int8)
        which, verdicts = table.decide_each(symbols)
        named = [frozenset(one[0] for one in v.candidates if len(one) == 1) for v in verdicts]
        cases, counts = np.unique(np.stack((truth, which), axis=1), axis=0, return_counts=True)
        for case, times in zip(cases.tolist(), counts.tolist(), strict=True):
            verdict, groups = verdicts[case[1]], named[case[1]]
            found["cases"] += times
            if case[0] < 0:
                found["truth_lost"] += times * verdict.alarm
                found["alarms_without_fault"] += times * verdict.alarm
                continue
            own = table.groups[case[0]]
            covered = own in table.covered
            found["covered_faults"] += times * covered
            found["missed"] += times * (verdict.status == "fault free" and covered)
            # without an alarm a group that the sensors do not cover is never excluded
            found["truth_lost"] += times * (own not in groups and (covered or verdict.alarm))
            found["isolated"] += times * (verdict.status == "isolated" and own in groups)
            told = {name for name in table.names if name != own and all(
                pairs[case[0], k] for k, one in enumerate(table.groups) if one == name)}  # fmt: skip
            found["not_isolated"] += times * (missing == 0 and covered and bool(groups & told))
    return found
