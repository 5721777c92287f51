"""Thesis 2.1.4, B.1: CUSUM beside the offline change detection of `ruptures` on the same seeded series.

Run as `python -m benchmarks.decide`. The two answer different questions: CUSUM decides sample by sample and
does not see the future, the offline methods see the whole record and place the change in hindsight.
"""

import time
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.timing import interleaved
from pumplib.decide import Cusum, CusumSettings, design

Array = NDArray[Any]

LENGTH, CHANGE_AT = 1000, 600
SIZES = (1.0, 1.5, 2.0, 3.0)  # sigma
SEEDS = tuple(range(8))
MEAN_TIME = 1e6  # samples between false alarms


@dataclass(frozen=True)
class Found:
    """What each method says about one series; None where it found nothing."""

    size: float
    seed: int
    alarm: int | None
    onset: int | None
    pelt: int | None
    binseg: int | None


def series(size: float, seed: int) -> Array:
    """White noise of sigma 1 with a step of the mean at `CHANGE_AT`."""
    x = np.random.default_rng([seed, round(100 * size)]).standard_normal(LENGTH)
    x[CHANGE_AT:] += size
    return x


def settings() -> CusumSettings:
    """CUSUM for the smallest of the sizes."""
    return design(sigma=1.0, change=min(SIZES), dt=1.0, false_alarm_samples=MEAN_TIME).settings()


def pelt(x: Array) -> int | None:
    """First change of the optimal segmentation with the usual penalty 3 log n (sigma is 1)."""
    import ruptures

    found = ruptures.KernelCPD(kernel="linear", min_size=2).fit(x).predict(pen=3 * np.log(len(x)))
    return int(found[0]) if len(found) > 1 else None


def binseg(x: Array) -> int | None:
    """The one change of binary segmentation."""
    import ruptures

    found = ruptures.Binseg(model="l2", min_size=2, jump=1).fit(x).predict(n_bkps=1)
    return int(found[0]) if len(found) > 1 else None


def compare() -> list[Found]:
    """All methods on all series."""
    rule = settings()
    rows = []
    for size in SIZES:
        for seed in SEEDS:
            x = series(size, seed)
            alarm = Cusum(rule, after_alarm="stop").run(x).first()
            rows.append(
                Found(
                    size=size,
                    seed=seed,
                    alarm=alarm.sample if alarm else None,
                    onset=alarm.onset if alarm else None,
                    pelt=pelt(x),
                    binseg=binseg(x),
                )
            )
    return rows


def _error(values: list[int | None]) -> float:
    """Median distance to the true change, samples; missing ones count as infinite."""
    return float(np.median([abs(v - CHANGE_AT) if v is not None else np.inf for v in values]))


def kernel_nanoseconds(channels: int = 3, samples: int = 500_000, rounds: int = 5, trace: bool = False) -> float:
    """Time of the warm batch kernel per sample and channel, best of some rounds."""
    x = np.random.default_rng(1).standard_normal((samples, channels))
    detector = Cusum([CusumSettings(sigma=1.0, nu=0.5, h=20.0)] * channels)
    detector.run(x[:8], trace=trace)
    best = np.inf
    for _ in range(rounds):
        detector.reset()
        start = time.perf_counter()
        detector.run(x, trace=trace)
        best = min(best, time.perf_counter() - start)
    return 1e9 * best / (samples * channels)


def stream_microseconds(channels: int = 3, samples: int = 5000) -> float:
    """Time of one streaming update from Python."""
    x = np.random.default_rng(1).standard_normal((samples, channels))
    detector = Cusum([CusumSettings(sigma=1.0, nu=0.5, h=20.0)] * channels)
    detector.update(x[0])
    start = time.perf_counter()
    for row in x:
        detector.update(row)
    return 1e6 * (time.perf_counter() - start) / samples


def measure(rounds: int = 3, samples: int = 500_000, rows: list[Found] | None = None) -> dict[str, Any]:
    """Numbers for the benchmark report.

    `accuracy`: for each size of step the median delay of the CUSUM alarm and the median distance of each estimate
    to the true change, samples. `times`: seconds for one series. `ratio`: time of a method over that of CUSUM.
    `samples`: length of the record that the kernel is timed on; `rows`: a comparison made before.
    """
    rows = compare() if rows is None else rows
    accuracy = {}
    for size in SIZES:
        part = [row for row in rows if row.size == size]
        accuracy[f"{size:g}"] = {
            "cusum_delay": float(np.median([np.inf if r.alarm is None else r.alarm - CHANGE_AT for r in part])),
            "cusum_onset_error": _error([r.onset for r in part]),
            "pelt_error": _error([r.pelt for r in part]),
            "binseg_error": _error([r.binseg for r in part]),
        }
    x, rule = series(1.0, 0), settings()
    contenders: dict[str, Callable[[], object]] = {
        "cusum": lambda: Cusum(rule, after_alarm="stop").run(x),
        "pelt": lambda: pelt(x),
        "binseg": lambda: binseg(x),
    }
    times = interleaved(contenders, rounds)
    return {
        "series": {"samples": LENGTH, "change_at": CHANGE_AT, "seeds": len(SEEDS)},
        "accuracy": accuracy,
        "times": {name: value.row() for name, value in times.items()},
        "ratio": {name: times[name].median / times["cusum"].median for name in ("pelt", "binseg")},
        "kernel_ns_per_sample_and_channel": {
            "1 channel": kernel_nanoseconds(1, samples),
            "3 channels": kernel_nanoseconds(3, samples),
            "16 channels": kernel_nanoseconds(16, samples // 5),
            "3 channels with trace": kernel_nanoseconds(3, samples, trace=True),
        },
        "stream_us_per_sample": stream_microseconds(),
    }


def main() -> None:
    """Print the numbers."""
    import json

    with warnings.catch_warnings():
        warnings.simplefilter("error")
        print(json.dumps(measure(), indent=2))


if __name__ == "__main__":
    main()
