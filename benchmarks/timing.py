"""Thesis, all chapters: time several contenders in one run, in turn, so that a drifting machine hits all alike."""

import statistics
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass


@dataclass(frozen=True)
class Times:
    """Seconds per call of one contender, one entry a round."""

    rounds: tuple[float, ...]

    @property
    def median(self) -> float:
        return statistics.median(self.rounds)

    @property
    def low(self) -> float:
        return min(self.rounds)

    @property
    def high(self) -> float:
        return max(self.rounds)

    def row(self) -> dict[str, float | int]:
        return {"median_s": self.median, "min_s": self.low, "max_s": self.high, "rounds": len(self.rounds)}

    def __str__(self) -> str:
        return f"{_short(self.median)} ({_short(self.low)} - {_short(self.high)}, {len(self.rounds)} rounds)"


def _short(seconds: float) -> str:
    for factor, unit in ((1.0, "s"), (1e3, "ms"), (1e6, "us")):
        if seconds * factor >= 1:
            return f"{seconds * factor:.3g} {unit}"
    return f"{seconds * 1e9:.3g} ns"


def interleaved(contenders: Mapping[str, Callable[[], object]], rounds: int, block: float = 0.0) -> dict[str, Times]:
    """Time every contender once a round, in an order that is turned from round to round.

    `block`: seconds that one measurement lasts at least; a quick contender is called so often that its
    measurement sees the same disturbances as a slow one. The result is the mean of a block's calls.
    """
    calls = {}
    for name, call in contenders.items():
        call()  # compiles, fills caches
        start = time.perf_counter()
        call()
        calls[name] = max(1, round(block / (time.perf_counter() - start)))
    found: dict[str, list[float]] = {name: [] for name in contenders}
    names = list(contenders)
    for k in range(rounds):
        for name in names[k % len(names) :] + names[: k % len(names)]:
            call, n = contenders[name], calls[name]
            start = time.perf_counter()
            for _ in range(n):
                call()
            found[name].append((time.perf_counter() - start) / n)
    return {name: Times(tuple(values)) for name, values in found.items()}


def ratio(slow: Times, quick: Times) -> tuple[float, float, float]:
    """Ratio of the medians, and the smallest and largest ratio within a round."""
    each = [a / b for a, b in zip(slow.rounds, quick.rounds, strict=True)]
    return slow.median / quick.median, min(each), max(each)
