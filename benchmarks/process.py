"""Thesis, all chapters: measurements of whole processes: start of the package, wall time and memory of the workbook."""

import os
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Sequence
from pathlib import Path

import psutil

from benchmarks.timing import Times, interleaved
from pumplib.paths import NOTEBOOKS, ROOT

FIRST_SECOND = """
import pumplib.plant
from pumplib.machines import PumpSet, load_application, load_motor, load_pump
from pumplib.motor.supply import grid
machine = PumpSet(
    motor=load_motor("reference_1k5"),
    pump=load_pump("multistage_1k5"),
    application=load_application("multistage_1k5"),
)
assert pumplib.plant.simulate(machine, grid(400), duration=1.0).omega[-1] > 250
"""
NUMBA_ALONE = """
import numba, numpy
@numba.njit(cache=True)
def first(x):
    return x[0]
assert first(numpy.ones(3)) == 1
"""
HEAVY = ("scipy", "pandas", "cvxpy", "sympy", "matplotlib", "networkx")


def _run(command: Sequence[str], environment: dict[str, str]) -> float:
    start = time.perf_counter()
    subprocess.run(command, env=environment, cwd=ROOT, check=True, capture_output=True, text=True)
    return time.perf_counter() - start


def _environment(folder: Path) -> dict[str, str]:
    """As on a normal installation: compiled byte code is kept, here in a folder of its own."""
    environment = {k: v for k, v in os.environ.items() if k != "PYTHONDONTWRITEBYTECODE"}
    return environment | {
        "PYTHONPYCACHEPREFIX": str(folder / "bytecode"),
        "PUMPLIB_CACHE": str(folder / "kernels"),
    }


def first_second(processes: int) -> tuple[float, dict[str, Times], list[str]]:
    """Fresh processes that import the package and simulate one second.

    Returns the time of the first (nothing compiled), the times of `processes` later ones beside those of as
    many that only call a trivial cached numba function, and which heavy libraries are loaded at the end.
    """
    with tempfile.TemporaryDirectory(prefix="pumplib-bench-") as name:
        environment = _environment(Path(name))
        alone = Path(name) / "alone.py"  # numba caches only what is in a file
        alone.write_text(NUMBA_ALONE, encoding="utf-8")
        command = [sys.executable, "-c", FIRST_SECOND]
        cold = _run(command, environment)
        times = interleaved(
            {
                "pumplib": lambda: _run(command, environment),
                "numba alone": lambda: _run([sys.executable, str(alone)], environment),
            },
            processes,
        )
        seen = subprocess.run(
            [sys.executable, "-c", FIRST_SECOND + f"import sys; print(*[m for m in {HEAVY} if m in sys.modules])"],
            env=environment, cwd=ROOT, check=True, capture_output=True, text=True,
        ).stdout.split()  # fmt: skip
    return cold, times, seen


def has_notebook(name: str) -> bool:
    return (NOTEBOOKS / f"{name}.ipynb").is_file()


def workbook(*arguments: str) -> tuple[float, float]:
    """Run `python -m pumplib workbook`; returns wall time, s, and the peak of the summed memory, GB.

    Memory is the resident memory of all processes, polled 20 times a second; pages that processes share
    are counted once for each, so the figure is not too low.
    """
    peak, done = 0, threading.Event()

    def watch(root: psutil.Process) -> None:
        nonlocal peak
        while not done.wait(0.05):
            total = 0
            try:
                family = [root, *root.children(recursive=True)]
            except psutil.Error:
                return
            for process in family:
                try:
                    total += process.memory_info().rss
                except psutil.Error:
                    continue  # ended meanwhile
            peak = max(peak, total)

    environment = {k: v for k, v in os.environ.items() if k != "PYTHONDONTWRITEBYTECODE"}
    start = time.perf_counter()
    with tempfile.TemporaryFile() as output:
        process = subprocess.Popen(
            [sys.executable, "-m", "pumplib", "workbook", *arguments],
            cwd=ROOT, env=environment, stdout=output, stderr=subprocess.STDOUT,
        )  # fmt: skip
        watcher = threading.Thread(target=watch, args=(psutil.Process(process.pid),))
        watcher.start()
        code = process.wait()
        seconds = time.perf_counter() - start
        done.set()
        watcher.join()
        if code:
            output.seek(0)
            tail = output.read().decode(errors="replace")[-2000:]
            raise RuntimeError(f"the workbook ended with exit code {code}:\n{tail}")
    return seconds, peak / 1e9
