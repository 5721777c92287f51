"""Thesis 6.2, 6.6: the pump's residuals and published models realized, and C99 code beside the Python code."""

import ctypes
import shutil
import subprocess
import tempfile
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pumplib.errors import DataError, SimulationError
from pumplib.observers.residual_model import PumpBelief
from pumplib.observers.residual_nominal import NominalRecord
from pumplib.structure.codegen_c import c_source, identifier
from pumplib.structure.codegen_generator import ResidualGenerator, residual_generator
from pumplib.structure.realization_report import Realization, Report

Array = NDArray[Any]
SUBSETS: dict[str, tuple[str, ...]] = {
    "r1": ("c2", "c4", "m_w", "m_H", "m_Q"),
    "r2": ("c1", "c3", "c4", "m_w", "m_T", "m_H", "m_Q", "d1", "d2"),
    "r3": ("c1", "c2", "c3", "m_w", "m_T", "m_H", "d1", "d2"),
    "r4": ("c1", "c2", "c3", "c4", "m_T", "m_H", "m_Q", "d1", "d2"),
}
"""Constraints of each residual, with the acceleration of the liquid; d2 belongs to it."""


def parameters(belief: PumpBelief) -> dict[str, float]:
    """Parameters by the names of the structural model.

    Parameters
    ----------
    belief : PumpBelief
        The pump.

    Returns
    -------
    dict of str to float
        SI.
    """
    return {name: value for name, value in asdict(belief).items() if not name.endswith("_lag")}


def signals(record: NominalRecord) -> dict[str, Array]:
    """Known signals by the names of the structural model.

    Parameters
    ----------
    record : NominalRecord
        A record.

    Returns
    -------
    dict of str to ndarray, shape (n,)
    """
    return {"y_w": record.omega, "y_T": record.T_e, "y_H": record.H, "y_Q": record.Q}


def _point(belief: PumpBelief) -> dict[str, float]:
    """Operating point that decides between several solutions of an equation."""
    omega, Q = 300.0, 1.5e-3
    H = float(belief.head(np.array(Q), np.array(omega)))
    return parameters(belief) | {"omega": omega, "Q_i": Q, "H_p": H, "y_w": omega, "y_H": H, "y_Q": Q, "y_T": 4.0}


def pump_reports(belief: PumpBelief) -> dict[str, Report]:
    """Realize the four residuals of the pump; of two flows for one pressure the larger is meant.

    Parameters
    ----------
    belief : PumpBelief
        Its parameters decide between solutions; the results stay symbolic.

    Returns
    -------
    dict of str to Report
        By `SUBSETS`.
    """
    from pumplib.structure.elimination import largest_at
    from pumplib.structure.pump import pump_part
    from pumplib.structure.realization import realize

    model = pump_part(flow_acceleration=True)
    prefer = largest_at(_point(belief))
    return {name: realize(model, subset, prefer=prefer, name=name) for name, subset in SUBSETS.items()}


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Generated:
    """A residual generator written by the program, and the realization behind it.

    Parameters
    ----------
    realization : Realization
        Symbolic form.
    generator : ResidualGenerator
        Compiled, with output injection.
    """

    realization: Realization
    generator: ResidualGenerator

    def start(self, belief: PumpBelief, record: NominalRecord) -> tuple[float, ...]:
        """States at the first sample of a record.

        Parameters
        ----------
        belief : PumpBelief
            The pump.
        record : NominalRecord
            The record.

        Returns
        -------
        tuple of float
        """
        if not self.realization.states:
            return ()
        first = {"omega": float(record.omega[0]), "Q_i": float(record.Q[0])}
        return self.realization.start(parameters(belief) | first)


def pump_generators(reports: Mapping[str, Report], k: float) -> dict[str, Generated]:
    """Compile the realized residuals with output injection.

    r2 and r3 get the form with the linear error and put out k e in N m, r4 the gain of the rate k, r1 none; so they
    are the hand-written `pumplib.observers.residual_kernel` without its filters.

    Parameters
    ----------
    reports : mapping of str to Report
        Of `pump_reports`.
    k : float
        Output injection, 1/s.

    Returns
    -------
    dict of str to Generated
    """
    from pumplib.structure.realization_gain import identity_gain, rate_gain, with_linear_error

    found = {}
    for name, report in reports.items():
        form = report.require()
        if not form.states:
            made = residual_generator(form)
        elif name == "r4":
            made = residual_generator(form, gain=rate_gain(form, k))
        else:
            form = with_linear_error(form)
            made = residual_generator(form, gain=identity_gain(form, k), output="correction")
        found[name] = Generated(realization=form, generator=made)
    return found


def published_outcomes() -> list[dict[str, str]]:
    """Realize every minimal over-constrained subset of three published models.

    Returns
    -------
    list of dict
        ``model``, ``subset`` (constraints), ``outcome``, ``z`` (states found) and ``detail`` of each.
    """
    from pumplib.structure.examples import dc_motor, induction_motor, three_tanks
    from pumplib.structure.mso import mso_sets
    from pumplib.structure.realization import realize

    rows = []
    for model in (three_tanks(), dc_motor(), induction_motor()):
        for subset in mso_sets(model.structure()):
            report = realize(model, subset)
            z = () if report.realization is None else report.realization.definitions
            rows.append(
                {"model": model.name, "subset": " ".join(subset), "outcome": report.outcome.value,
                 "z": ", ".join(map(str, z)), "detail": report.detail}
            )  # fmt: skip
    return rows


@dataclass(frozen=True, kw_only=True, slots=True)
class Compared:
    """Residuals of compiled C code beside those of the Python code.

    Parameters
    ----------
    name : str
        Residual.
    samples : int
        Length of the record.
    worst : float
        Largest difference over the largest residual.
    flags_equal : bool
        Whether all flags agree.
    lines : int
        Of C source.
    """

    name: str
    samples: int
    worst: float
    flags_equal: bool
    lines: int


def c_compiler() -> str | None:
    """C compiler of this machine.

    Returns
    -------
    str or None
        Its path, None if there is none.
    """
    return shutil.which("gcc") or shutil.which("cc")


def compare_with_c(made: Generated, belief: PumpBelief, record: NominalRecord, compiler: str) -> Compared:
    """Compile the C99 source of a generator, all warnings errors, and run it beside the Python code.

    Parameters
    ----------
    made : Generated
        The generator.
    belief : PumpBelief
        The pump.
    record : NominalRecord
        The record.
    compiler : str
        Path of the C compiler, see `c_compiler`.

    Returns
    -------
    Compared

    Raises
    ------
    SimulationError
        If the source does not compile.
    DataError
        If the residual is zero throughout, so that there is nothing to compare with.
    """
    generator = made.generator
    values, given = parameters(belief), signals(record)
    start = made.start(belief, record)
    python = generator.run(record.t, given, values, start)
    largest = float(np.abs(python.residual).max())
    if largest == 0.0:
        raise DataError(f"compare_with_c: {generator.name} is zero throughout the record; take one with a fault.")
    source = c_source(generator)
    name = identifier(generator.name)
    with tempfile.TemporaryDirectory() as folder:
        file, library = Path(folder) / f"{name}.c", Path(folder) / f"{name}.so"
        file.write_text(source)
        command = [compiler, "-std=c99", "-Wall", "-Wextra", "-pedantic", "-Werror", "-O2", "-fPIC", "-shared"]
        done = subprocess.run([*command, str(file), "-o", str(library), "-lm"], capture_output=True, text=True)
        if done.returncode:
            raise SimulationError(f"compare_with_c: {name}.c does not compile: {done.stderr.strip()[:500]}")
        step = getattr(ctypes.CDLL(str(library)), f"{name}_step")
        found, flags = _run_c(step, generator, record, values, start)
    worst = float(np.abs(found - python.residual).max()) / largest
    return Compared(
        name=generator.name, samples=len(record.t), worst=worst, flags_equal=bool((flags == python.flags).all()),
        lines=source.count("\n"),
    )  # fmt: skip


def _run_c(
    step: Any,
    generator: ResidualGenerator,
    record: NominalRecord,
    values: Mapping[str, float],
    start: tuple[float, ...],
) -> tuple[Array, Array]:
    pointer = ctypes.POINTER(ctypes.c_double)
    step.argtypes, step.restype = [pointer, pointer, pointer, ctypes.c_double], ctypes.c_int
    rows, constants = generator.record(signals(record)), generator.values(values)
    state = np.concatenate([start, np.zeros(len(generator.signals) + generator.outputs)])
    found, flags = np.empty((len(rows), generator.outputs)), np.empty(len(rows), dtype=np.int64)
    own, fixed = state.ctypes.data_as(pointer), constants.ctypes.data_as(pointer)
    for k, dt in enumerate(np.diff(record.t, prepend=record.t[0])):
        flags[k] = step(own, rows[k].ctypes.data_as(pointer), fixed, dt)
        found[k] = state[len(state) - generator.outputs :]
    return found, flags
