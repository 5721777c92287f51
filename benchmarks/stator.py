"""Thesis 5.2.3, 5.3: time per sample of the stator observer, with its alarm, and of the same loop in C.

Run as `python -m benchmarks.stator`. The record is a bench run of 1.5 s at 10 kHz with a short at 0.5 s. Three
contenders: the compiled kernel, the same kernel with the CUSUM alarm behind it, and C compiled with gcc -O3.
"""

import ctypes
import subprocess
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.peer_c import FLAGS, compiler, compiler_version
from benchmarks.timing import interleaved, ratio
from pumplib.decide import Cusum
from pumplib.observers.stator import StatorObserver
from pumplib.observers.stator_alarm import tune_alarm
from pumplib.observers.stator_design import design_gain, kernel_design
from pumplib.observers.stator_kernel import N_COLUMNS, N_STATE, run_observer
from pumplib.observers.stator_score import ScoreSettings, belief, draw_test

Array = NDArray[Any]
SOURCE = Path(__file__).with_name("c") / "stator.c"
EVERY = 10  # rows at 1 kHz
REPEATS = 2  # of the record in one call


def record(seed: int = 5) -> tuple[Array, Array]:
    """Voltages and currents of a bench run, repeated."""
    test = draw_test(ScoreSettings(gamma=0.02, records=0), np.random.default_rng(seed))
    return np.tile(test.signals.voltage, (REPEATS, 1)), np.tile(test.signals.current, (REPEATS, 1))


def load_c() -> Any:
    """The C function, or None without a compiler."""
    found = compiler()
    if found is None:
        return None
    with tempfile.TemporaryDirectory(prefix="pumplib-bench-", ignore_cleanup_errors=True) as folder:
        target = Path(folder) / "stator.so"
        subprocess.run(
            [found, *FLAGS, str(SOURCE), "-o", str(target), "-lm"], check=True, capture_output=True, text=True
        )
        function = ctypes.CDLL(str(target)).run_observer
    real, size = ctypes.c_void_p, ctypes.c_long
    function.argtypes = [real, real, size, real, real, real, size, real]
    function.restype = size
    return function


def contenders(seed: int = 5) -> tuple[dict[str, Callable[[], None]], dict[str, Array], int]:
    """Calls without arguments, the rows each writes, and the number of samples."""
    v, i = record(seed)
    motor = belief("Y")
    gain = design_gain(motor, 1e4)[0]
    observer = StatorObserver(motor, 1e4, gain, every=EVERY)
    design, p = kernel_design(motor, 1e4, gain, observer.settings)
    rows = {name: np.empty((len(v) // EVERY, N_COLUMNS)) for name in ("pumplib", "C")}
    state = np.zeros(N_STATE)

    def kernel() -> None:
        state[:] = 0.0
        run_observer(v, i, state, design, p, EVERY, rows["pumplib"])

    kernel()
    healthy = _signal(rows["pumplib"])[300:480]
    alarm = Cusum(tune_alarm([healthy], smallest=0.02), after_alarm="stop", missing="hold")

    def with_alarm() -> None:
        kernel()
        alarm.reset()
        alarm.run(_signal(rows["pumplib"]))

    calls: dict[str, Callable[[], None]] = {"pumplib": kernel, "pumplib with alarm": with_alarm}
    function = load_c()
    if function is not None:
        constants, own = np.array(design, dtype=float), np.zeros(N_STATE)
        where = [a.ctypes.data for a in (v, i, own, constants, p, rows["C"])]

        def in_c() -> None:
            own[:] = 0.0
            function(where[0], where[1], len(v), where[2], where[3], where[4], EVERY, where[5])

        calls["C"] = in_c
    return calls, rows, len(v)


def _signal(rows: Array) -> Array:
    """3|g_c| of trusted rows."""
    return np.where(rows[:, 7] == 0.0, 3 * np.hypot(rows[:, 2], rows[:, 3]), np.nan)


def difference(rows: dict[str, Array]) -> float:
    """Largest difference of the rows of C and numba, relative to the largest value of the column."""
    a, b = rows["pumplib"], rows["C"]
    if not np.array_equal(np.isnan(a), np.isnan(b)):
        return float("inf")
    scale = np.nanmax(np.abs(a), axis=0)
    return float(np.nanmax(np.abs(a - b) / np.where(scale > 0, scale, 1.0)))


def measure(rounds: int = 60, seed: int = 5) -> dict[str, Any]:
    """Numbers for the benchmark report: microseconds a sample, and the ratio to C within the rounds."""
    calls, rows, n = contenders(seed)
    times = interleaved(calls, rounds)
    found: dict[str, Any] = {
        "samples": n,
        "us_per_sample": {
            name: {"median": 1e6 * one.median / n, "min": 1e6 * one.low / n, "max": 1e6 * one.high / n}
            for name, one in times.items()
        },
        "compiler": compiler_version(),
    }
    if "C" in times:
        middle, low, high = ratio(times["pumplib"], times["C"])
        found["ratio_to_C"] = {"median": middle, "min": low, "max": high}
        found["ratio_of_minima"] = times["pumplib"].low / times["C"].low
        found["difference"] = difference(rows)
    return found


def main() -> None:
    """Print the numbers."""
    import json

    print(json.dumps(measure(), indent=2))


if __name__ == "__main__":
    main()
