"""Thesis, all chapters: what campaigns cost beside the runs themselves, and how they grow with workers and runs.

Run as `python -m benchmarks.campaign` on a quiet machine. The efficiency on n workers is the time of one loop in
one process over n times the time of a campaign in n processes; starting the processes is told apart, as it is paid
once. Where other work disturbs the clock, the ratio of processor times says what the campaign adds.
"""

import os
import resource
import sys
import tempfile
import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from pumplib.campaign import Campaign, campaign_from, load_scheme, local_pool, run_campaign
from pumplib.campaign.store import Store

KINDS = ("processes", "threads")


def compiled(runs: int, seed: int) -> Campaign:
    """Runs of a few milliseconds in one compiled kernel, which lets other threads run meanwhile."""
    settings = {"false_alarm_samples": 1e4, "batch": 20}
    cells = [{"name": "healthy", "role": "healthy", "runs": runs}]
    return _campaign("run_length", settings, cells, seed)


def bench(runs: int, seed: int) -> Campaign:
    """Machines on the pump bench: kernels, sensors and Python between them; seconds each."""
    settings = {"healthy": 1, "faulty": 1, "sizes": [1e10]}
    return _campaign("limits", settings, [{"name": "machines", "role": "fault", "runs": runs}], seed)


def _campaign(scheme: str, settings: Mapping[str, Any], cells: list[dict[str, Any]], seed: int) -> Campaign:
    head = {"title": "benchmark", "section": "2.1.4", "class": "beyond", "seed": seed, "scheme": scheme}
    return campaign_from({**head, "settings": settings, "cells": cells}, f"benchmark_{scheme}")


@dataclass(frozen=True)
class Spent:
    """Time and processor time of all processes, s."""

    seconds: float
    cpu: float

    def row(self) -> dict[str, float]:
        return {"seconds": round(self.seconds, 3), "cpu_s": round(self.cpu, 3)}


def one_loop(campaign: Campaign) -> Spent:
    """The same runs in one plain loop, the yardstick; nothing is written."""
    _loop(few(campaign, 1))  # compiles
    return _loop(campaign)


def _loop(campaign: Campaign) -> Spent:
    scheme = load_scheme(campaign.path)
    begun, cpu = time.perf_counter(), time.process_time()
    for number, cell in enumerate(campaign.cells):
        for run in range(cell.runs):
            scheme.score(cell.settings, np.random.default_rng([campaign.seed, number, run]))
    return Spent(time.perf_counter() - begun, time.process_time() - cpu)


def _cpu() -> float:
    used = os.times()
    return used.user + used.system + used.children_user + used.children_system


def as_campaign(campaign: Campaign, workers: int, kind: str) -> dict[str, Any]:
    """The campaign with its files, on warm workers: each has scored a run before."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        before = _cpu()
        begun = time.perf_counter()
        with local_pool(workers, threads=kind == "threads") as pool:
            # enough runs to wake all workers, with the code imported and compiled
            warm = few(campaign, 4 * workers)
            run_campaign(warm, pool, build=folder / "warm", results=folder / "warm")
            started = time.perf_counter() - begun
            own = time.process_time()
            done = run_campaign(campaign, pool, build=folder, results=folder)
            own = time.process_time() - own
        parts = len(Store(folder / campaign.name).parts())
    return {
        "seconds": done.seconds,
        "start_s": started,
        "busy_s": done.busy,
        "cpu_of_runs_s": done.cpu,
        "cpu_of_all_s": _cpu() - before,
        "cpu_of_parent_s": own,
        "parts": parts,
        "rows": done.rows,
    }


def few(campaign: Campaign, runs: int) -> Campaign:
    """The first cell with few runs."""
    return replace(campaign, cells=(replace(campaign.cells[0], runs=runs),))


def efficiency(campaign: Campaign, workers: int, rounds: int) -> dict[str, Any]:
    """Loop and campaigns in turn; medians of the ratios within a round."""
    found: dict[str, Any] = {"runs": campaign.runs, "workers": workers, "loop": [], **{kind: [] for kind in KINDS}}
    for _ in range(rounds):
        # in a process that is set up as a worker is: with one thread for linear algebra
        with local_pool(1) as pool:
            loop = pool.executor.submit(one_loop, campaign).result()
        found["loop"].append(loop.row())
        for kind in KINDS:
            row = as_campaign(campaign, workers, kind)
            row["efficiency"] = loop.seconds / (workers * row["seconds"])
            # unlike the clock, this does not see whether others use the machine; threads count all in the parent
            beside = row["cpu_of_parent_s"] - (row["cpu_of_runs_s"] if kind == "threads" else 0.0)
            row["cpu_overhead"] = beside / row["cpu_of_runs_s"]
            found[kind].append({key: round(value, 4) for key, value in row.items()})
    for kind in KINDS:
        for name in ("efficiency", "cpu_overhead"):
            found[f"{kind}_{name}"] = float(np.median([row[name] for row in found[kind]]))
    return found


def peak_memory(runs: int, seed: int) -> float:
    """Peak resident memory of this process after a campaign of quick runs, MB; for a fresh process."""
    settings = {"false_alarm_samples": 10.0, "batch": 2}
    one = _campaign("run_length", settings, [{"name": "healthy", "role": "healthy", "runs": runs}], seed)
    with tempfile.TemporaryDirectory() as name, local_pool(1, threads=True) as pool:
        run_campaign(one, pool, build=Path(name), results=Path(name))
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / (1e6 if sys.platform == "darwin" else 1e3)


def memory(runs: int, seed: int) -> dict[str, float]:
    """Peak resident memory of parent and worker together, MB, by the number of runs."""
    found = {}
    for count in (runs // 100, runs // 10, runs):
        with local_pool(1) as pool:
            found[str(count)] = pool.executor.submit(peak_memory, count, seed).result()
    return found


def measure(
    rounds: int = 3,
    runs: int = 4000,
    machines: int = 8,
    seed: int = 20071,
    workers: int = 2,
    memory_runs: int = 300_000,
) -> dict[str, Any]:
    """Numbers for the benchmark report.

    `compiled`, `bench`: efficiency with processes and with threads, medians and every round. `memory_MB`: peak of
    a campaign with all in one process, by the number of runs.
    """
    return {
        "compiled": efficiency(compiled(runs, seed), workers, rounds),
        "bench": efficiency(bench(machines, seed), workers, rounds),
        "memory_MB": memory(memory_runs, seed),
    }


def main() -> None:
    """Print the numbers."""
    import argparse
    import json

    parser = argparse.ArgumentParser(prog="python -m benchmarks.campaign", description=__doc__)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--runs", type=int, default=4000, help="compiled runs (default 4000, about 12 s of one core)")
    parser.add_argument("--machines", type=int, default=8, help="machines on the bench (default 8)")
    parser.add_argument("--workers", type=int, default=2)
    chosen = parser.parse_args()
    print(json.dumps(measure(chosen.rounds, chosen.runs, chosen.machines, workers=chosen.workers), indent=1))


if __name__ == "__main__":
    main()
