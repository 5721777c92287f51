"""Thesis 2.1, 2.1.3, 2.2: runs and faults that the primer shows, and the survey of motor faults."""

import tomllib
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from pumplib.decide.checks import one_of
from pumplib.errors import DataError
from pumplib.paths import DATA
from pumplib.primer.study import Machine, measured
from pumplib.primer.windows import STEP, Windows
from pumplib.testbench.faults import Fault
from pumplib.testbench.run import Run, run
from pumplib.testbench.scenario import load_scenario

Array = NDArray[Any]
PUMP_FAULTS: dict[str, float] = {"clogging": 1e10, "friction": 5e-4, "leakage": 1.2e-7, "cavitation": 0.05}
"""Faults whose directions are compared, and their sizes in the units of `pumplib.testbench.faults.SIZES`."""
DRIVES = ("changes", "steady")


@dataclass(frozen=True, kw_only=True, eq=False, slots=True)
class Example:
    """One run and what the monitor sees of it.

    Parameters
    ----------
    run : Run
        The run; course and truth serve the figures only.
    w : Windows
        The measurements.
    onset : float or None
        True time of the fault, s; None if healthy.
    """

    run: Run
    w: Windows
    onset: float | None


@dataclass(frozen=True, kw_only=True, slots=True)
class Share:
    """Share of one group of faults in induction motors.

    Parameters
    ----------
    group : str
        What fails.
    low, high : float
        Range of the share of all faults.
    source : str
        Who says so, and where the thesis cites it.
    """

    group: str
    low: float
    high: float
    source: str


def example_run(
    machine: Machine, fault: str, size: float, drive: Literal["changes", "steady"], rng: Generator
) -> Example:
    """Run a machine, healthy or with a fault that steps in at a random time.

    Parameters
    ----------
    machine : Machine
        The machine.
    fault : str
        "none" or one of `pumplib.testbench.faults.KINDS`.
    size : float
        Size in the unit of `pumplib.testbench.faults.SIZES`.
    drive : {"changes", "steady"}
        Twelve changes of speed and valve, or one operating point throughout.
    rng : Generator
        Randomness of the run.

    Returns
    -------
    Example

    Raises
    ------
    ParameterError
        If fault, size or drive is not known to the bench.
    """
    one_of("example_run", "drive", drive, DRIVES)
    scenario = replace(load_scenario("pump_healthy"), test=drive)
    if fault != "none":
        scenario = replace(scenario, fault=Fault(kind=fault, size=size))  # type: ignore[arg-type]
    done = run(scenario, rng, machine.bench)
    onset = None if done.course.fault is None else done.course.fault.onset
    return Example(run=done, w=measured(done), onset=onset)


def with_offset(w: Windows, offset: float, onset: float) -> Windows:
    """The same measurements with a pressure sensor that is off from an instant on: an additive fault.

    Parameters
    ----------
    w : Windows
        Measurements.
    offset : float
        Pa.
    onset : float
        s.

    Returns
    -------
    Windows
    """
    return replace(w, H=w.H + offset * (w.t >= onset))


def directions(machine: Machine, seed: int) -> dict[str, Array]:
    """Where each fault moves the two residuals, at rest, in units of their healthy spread.

    The first is the pressure residual, the second the torque residual.

    Parameters
    ----------
    machine : Machine
        The machine.
    seed : int
        Seed of the runs.

    Returns
    -------
    dict of str to ndarray, shape (n, 2)
        "none" and the names of `PUMP_FAULTS`.
    """
    model = machine.monitor.model
    spread = np.array([model.sigma_H, model.sigma_T])
    found = {}
    for k, (fault, size) in enumerate({"none": 0.0, **PUMP_FAULTS}.items()):
        shown = example_run(machine, fault, size, "changes", np.random.default_rng([seed, k]))
        kept = _settled(shown.w.rest) & (shown.w.t > (0.0 if shown.onset is None else shown.onset + 10 * STEP))
        both = np.column_stack((model.residual(shown.w), model.torque_residual(shown.w)))
        found[fault] = both[kept] / spread
    return found


def _settled(rest: Array) -> Array:
    """At rest for half a second before and two windows after: the torque residual leaves the inertia out."""
    around = np.lib.stride_tricks.sliding_window_view(np.pad(rest, (5, 2)), 8)
    return np.asarray(around.all(axis=1))


def load_survey(path: Path = DATA / "primer" / "survey.toml") -> tuple[Share, ...]:
    """Read the shares of motor faults.

    Parameters
    ----------
    path : Path
        The file.

    Returns
    -------
    tuple of Share

    Raises
    ------
    DataError
        If the file is absent, incomplete, or a share is no range between 0 and 1.
    """
    try:
        raw = tomllib.loads(path.read_text(encoding="utf-8"))
        shares = tuple(Share(**entry) for entry in raw["share"])
    except (OSError, KeyError, TypeError, tomllib.TOMLDecodeError) as error:
        raise DataError(f"{path.name}: cannot be read: {error}") from None
    for one in shares:
        if not (0 <= one.low <= one.high <= 1 and one.source):
            raise DataError(f"{path.name}: {one.group}: {one.low} to {one.high}: must rise from 0 to 1, with a source.")
    return shares
