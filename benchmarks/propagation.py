"""Thesis 4.2.1: closing the loops of event graphs, beside plain iteration, a worklist and networkx.

Run as `python -m benchmarks.propagation`. All compiled contenders carry 64 roots in a word and are numba loops over
the same edges; networkx searches once for each root. Every result is compared before anything is timed. Times are
of whole calls: checks, compressed rows and the copy of the seeds are in them, compilation is not.
"""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.timing import Times, interleaved, ratio
from pumplib.kernels import kernel
from pumplib.propagation import cut_closure, pack, plain_closure, scc_closure, strong_components, unpack
from pumplib.propagation.graph import rows_by

Array = NDArray[Any]
DEGREE = 3  # edges out of an event
WIDTH = 50  # events of a layer
BACK = 0.003  # share of edges back to an earlier layer
SIZES = (1_000, 3_000, 10_000, 30_000, 100_000)
LARGE = 10_000


@dataclass(frozen=True)
class Case:
    """One graph with its seeds: n / 10 roots, each at one event."""

    name: str
    n: int
    cause: Array
    effect: Array
    roots: Array
    seeds: Array

    @property
    def largest(self) -> int:
        """Size of the largest loop, in events."""
        return int(np.bincount(strong_components(self.n, self.cause, self.effect)[1]).max())


def case(name: str, n: int, seed: int = 1, roots: int | None = None) -> Case:
    """Random graph "random", "layered" (forward to the next layer, some edges back) or "chain" of loops.

    Events and edges are shuffled: an order of the tables that suits an algorithm would be luck.
    """
    rng = np.random.default_rng([seed, n])
    a = np.repeat(np.arange(n), DEGREE)
    if name == "random":
        b = rng.integers(0, n, len(a))
    elif name == "layered":
        layers = max(2, n // WIDTH)
        layer = a // WIDTH
        back = (rng.random(len(a)) < BACK) | (layer >= layers - 1)
        to = np.where(back, rng.integers(0, np.maximum(layer, 1)), np.minimum(layer + 1, layers - 1))
        b = np.minimum(to * WIDTH + rng.integers(0, WIDTH, len(a)), n - 1)
    elif name == "chain":
        # every event to the next one; loops of four events here and there
        k = np.arange(0, n - 4, 12)
        a, b = np.concatenate((np.arange(n - 1), k + 3)), np.concatenate((np.arange(1, n), k))
    else:
        raise ValueError(f"graph {name!r}: must be random, layered or chain")
    shuffled, order = rng.permutation(n), rng.permutation(len(a))
    a, b = shuffled[a][order].astype(np.int32), shuffled[b][order].astype(np.int32)
    r = n // 10 if roots is None else roots
    at = rng.choice(n, r, replace=False)
    return Case(name, n, a, b, at, pack(at, np.arange(r), n, r))


@kernel
def _worklist(start, to, bits):  # type: ignore[no-untyped-def]
    n, words = bits.shape
    waiting = np.arange(n).astype(np.int32)
    queued = np.ones(n, np.bool_)
    head, count = 0, n
    while count > 0:
        v = waiting[head]
        head = (head + 1) % n
        count -= 1
        queued[v] = False
        for k in range(start[v], start[v + 1]):
            w = to[k]
            new = np.uint64(0)
            for j in range(words):
                new |= bits[v, j] & ~bits[w, j]
                bits[w, j] |= bits[v, j]
            if new != 0 and not queued[w]:
                queued[w] = True
                waiting[(head + count) % n] = w
                count += 1


@kernel
def _in_place(cause, effect, bits):  # type: ignore[no-untyped-def]
    changed = True
    while changed:
        changed = False
        for k in range(len(cause)):
            new = np.uint64(0)
            for j in range(bits.shape[1]):
                new |= bits[cause[k], j] & ~bits[effect[k], j]
                bits[effect[k], j] |= bits[cause[k], j]
            changed = changed or new != 0


def worklist(c: Case) -> Array:
    """Carry an event on whenever its roots have become more."""
    bits = c.seeds.copy()
    start, to, _ = rows_by(c.n, c.cause, c.effect)
    _worklist(start, to, bits)
    return bits


def in_place(c: Case) -> Array:
    """Plain iteration that uses new values at once."""
    bits = c.seeds.copy()
    _in_place(c.cause, c.effect, bits)
    return bits


def networkx_reach(c: Case) -> Callable[[], list[set[int]]]:
    """Search of networkx from every root; the graph is made before."""
    import networkx

    graph = networkx.DiGraph()
    graph.add_nodes_from(range(c.n))
    graph.add_edges_from(zip(c.cause.tolist(), c.effect.tolist(), strict=True))
    return lambda: [networkx.descendants(graph, int(root)) | {int(root)} for root in c.roots]


def contenders(c: Case) -> dict[str, Callable[[], Array]]:
    """Compiled ways to the same rows of bits."""
    return {
        "condensed": lambda: scc_closure(c.n, c.cause, c.effect, c.seeds),
        "cut": lambda: cut_closure(c.n, c.cause, c.effect, c.seeds).bits,
        "plain": lambda: plain_closure(c.n, c.cause, c.effect, c.seeds).bits,
        "in place": lambda: in_place(c),
        "worklist": lambda: worklist(c),
    }


def compare(c: Case, rounds: int, peers: bool = True) -> dict[str, Any]:
    """Times of all contenders on one graph, in one run; raises if results differ."""
    ways = contenders(c)
    true = ways["condensed"]()
    for name, call in ways.items():
        if not np.array_equal(call(), true):
            raise RuntimeError(f"{c.name} {c.n}: {name} gives another result")
    found: dict[str, Times] = interleaved(ways, rounds, block=0.02)
    row: dict[str, Any] = {
        "events": c.n,
        "edges": len(c.cause),
        "roots": len(c.roots),
        "largest_loop": c.largest,
        "plain_sweeps": plain_closure(c.n, c.cause, c.effect, c.seeds).passes,
        "cut_passes": cut_closure(c.n, c.cause, c.effect, c.seeds).passes,
    }
    if peers:
        search = networkx_reach(c)
        dense = unpack(true, len(c.roots))
        start = time.perf_counter()  # seconds: one call is enough
        sets = search()
        found["networkx"] = Times((time.perf_counter() - start,))
        for k, reached in enumerate(sets):
            if set(np.flatnonzero(dense[:, k]).tolist()) != reached:
                raise RuntimeError(f"{c.name} {c.n}: networkx reaches other events from root {k}")
        row["networkx_over_condensed"] = found["networkx"].median / found["condensed"].median
    row["times"] = {name: times.row() for name, times in found.items()}
    row["over_condensed"] = {
        name: ratio(times, found["condensed"])[0]
        for name, times in found.items()
        if name in ways and name != "condensed"
    }
    return row


def growth(name: str, sizes: Sequence[int] = SIZES, rounds: int = 5, roots: int = 64) -> dict[str, Any]:
    """Exponent of the time over the number of events at a fixed number of roots, by least squares in logarithms."""
    seconds = []
    for n in sizes:
        c = case(name, n, roots=roots)
        call = contenders(c)["condensed"]
        seconds.append(interleaved({"condensed": call}, rounds, block=0.02)["condensed"].median)
    exponent = float(np.polyfit(np.log(sizes), np.log(seconds), 1)[0])
    return {"events": list(sizes), "seconds": seconds, "exponent": exponent}


def speed(rounds: int = 9, n: int = LARGE) -> Times:
    """Claim ch4.speed: warm call of Algorithm 2 on a layered graph of n events and n / 10 roots."""
    c = case("layered", n)
    call = contenders(c)["condensed"]
    return interleaved({"condensed": call}, rounds, block=0.02)["condensed"]


def measure(
    rounds: int = 5, sizes: Sequence[int] = (100, 1_000, LARGE), fitted: Sequence[int] = SIZES
) -> dict[str, Any]:
    """Numbers for the benchmark report: all contenders on all graphs, growth, and the claim."""
    graphs = {
        f"{name} {n}": compare(case(name, n), rounds)
        for name in ("random", "layered", "chain")
        for n in sizes
        if name != "chain" or n < LARGE  # plain iteration takes a sweep an event there: minutes
    }
    return {
        "graphs": graphs,
        "growth": {name: growth(name, fitted) for name in ("random", "layered", "chain")},
        "speed": speed().row(),
    }


def main() -> None:
    """Print the numbers."""
    import json

    print(json.dumps(measure(), indent=2))


if __name__ == "__main__":
    main()
