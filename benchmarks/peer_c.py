"""Thesis 3.4, 3.5: the same Runge-Kutta step in C, compiled here, one run and 1000 parameter sets."""

import ctypes
import os
import shutil
import subprocess
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from benchmarks.case import STEP, Array, Inputs
from pumplib.plant.equations import Coefficients
from pumplib.plant.kernels import LANES, N_COEFFICIENTS, N_STATES, run_many, run_one

SOURCE = Path(__file__).with_name("c") / "plant.c"
FLAGS = ("-std=c99", "-O3", "-march=native", "-ffp-contract=fast", "-fPIC", "-shared")
TUNED = ("-fno-tree-slp-vectorize", "-fno-math-errno", "-fno-trapping-math")  # a little quicker, scalar
WIDTHS = (4, 8, 16, 32)  # lanes a block of the C batch may have; the fastest counts

Contender = tuple[Callable[[], None], Callable[[], Array]]


def compiler() -> str | None:
    """The C compiler, or None."""
    return shutil.which(os.environ.get("CC", "gcc"))


def compiler_version() -> str:
    """First line that the compiler prints about itself."""
    found = compiler()
    if found is None:
        return "none"
    text = subprocess.run([found, "--version"], capture_output=True, text=True, check=True).stdout
    return text.splitlines()[0]


class Library:
    """The compiled C code for one block width."""

    def __init__(self, lanes: int = 8, extra: Sequence[str] = ()) -> None:
        found = compiler()
        if found is None:
            raise RuntimeError("no C compiler: install gcc or set CC")
        self.lanes = lanes
        self._kept: list[Array] = []
        with tempfile.TemporaryDirectory(prefix="pumplib-bench-", ignore_cleanup_errors=True) as folder:
            target = Path(folder) / f"plant{lanes}.so"
            command = [found, *FLAGS, *extra, f"-DLANES={lanes}", str(SOURCE), "-o", str(target), "-lm"]
            subprocess.run(command, check=True, capture_output=True, text=True)
            library = ctypes.CDLL(str(target))  # stays loaded when the file is gone
        real, size = ctypes.c_void_p, ctypes.c_ssize_t
        self._one, self._many = library.run_one, library.run_many
        self._one.argtypes = [real] * 5 + [ctypes.c_double, size, real, size, real]
        self._many.argtypes = [real] * 5 + [ctypes.c_double, size, real, size, size, real]
        self._one.restype = self._many.restype = None

    def _addresses(self, *arrays: Array) -> list[int]:
        kept = [np.ascontiguousarray(a) for a in arrays]
        self._kept += kept  # as long as the library lives
        return [a.ctypes.data for a in kept]

    def one(self, u: Inputs, c: Array, every: int, out: Array) -> Callable[[], None]:
        """A call that simulates one machine from standstill."""
        x = np.zeros(N_STATES)
        first, coefficients, target = self._addresses(x, u.v_d, u.v_q, u.K_v, u.T_load), *self._addresses(c, out)

        def call() -> None:
            x[:] = 0.0
            self._one(*first, STEP, every, coefficients, len(out), target)

        return call

    def many(self, u: Inputs, c: Array, every: int, out: Array) -> Callable[[], None]:
        """A call that simulates all blocks from standstill."""
        x = np.zeros((len(c), N_STATES, self.lanes))
        first, coefficients, target = self._addresses(x, u.v_d, u.v_q, u.K_v, u.T_load), *self._addresses(c, out)

        def call() -> None:
            x[:] = 0.0
            self._many(*first, STEP, every, coefficients, out.shape[1], len(c), target)

        return call


def _rows(u: Inputs, every: int) -> int:
    return (len(u.v_d) - 1) // 2 // every


def scalar_calls(u: Inputs, c: Coefficients) -> dict[str, Contender]:
    """All scalar kernels as calls without arguments, each with a function that returns its states."""
    rows = _rows(u, 1)
    x, ours = np.zeros(N_STATES), np.empty((rows, N_STATES))

    def numba() -> None:
        x[:] = 0.0
        run_one(x, u.v_d, u.v_q, u.K_v, u.T_load, STEP, 1, c, ours)

    found: dict[str, Contender] = {"pumplib": (numba, lambda: ours)}
    for name, extra in (("C", ()), ("C, tuned flags", TUNED)):
        out = np.empty((rows, N_STATES))
        call = Library(extra=extra).one(u, np.array(c), 1, out)
        found[name] = (call, lambda out=out: out)  # type: ignore[misc]
    return found


def _blocks(sets: Sequence[Coefficients], lanes: int) -> Array:
    """Coefficients as (blocks, coefficients, lanes); the last block is filled with copies of the last set."""
    count = -(-len(sets) // lanes) * lanes
    rows = np.array([*sets, *[sets[-1]] * (count - len(sets))])
    return np.ascontiguousarray(rows.reshape(-1, lanes, N_COEFFICIENTS).transpose(0, 2, 1))


def batch_calls(u: Inputs, sets: Sequence[Coefficients], every: int) -> dict[str, Contender]:
    """All batch kernels as calls, each with a function that returns its states as (rows, machines, 7)."""
    rows = _rows(u, every)

    def states(out: Array) -> Callable[[], Array]:
        return lambda: out.transpose(1, 0, 3, 2).reshape(rows, -1, N_STATES)[:, : len(sets)]

    def arrays(lanes: int) -> tuple[Array, Array]:
        c = _blocks(sets, lanes)
        return c, np.empty((len(c), rows, N_STATES, lanes))

    c, out = arrays(LANES)
    x = np.zeros((len(c), N_STATES, LANES))

    def numba() -> None:
        x[:] = 0.0
        run_many(x, u.v_d, u.v_q, u.K_v, u.T_load, STEP, every, c, out)

    found: dict[str, Contender] = {"pumplib": (numba, states(out))}
    for width in WIDTHS:
        library = Library(width)
        c_lanes, out_lanes = arrays(width)
        call = library.many(u, c_lanes, every, out_lanes)
        found[f"C, blocks of {library.lanes}"] = (call, states(out_lanes))
    return found


def difference(a: Array, b: Array) -> float:
    """Largest difference of two state arrays, relative to the largest value of the state."""
    axes = tuple(range(a.ndim - 1))
    return float((np.abs(a - b).max(axis=axes) / np.abs(b).max(axis=axes)).max())
