"""Thesis 2.1.4: constant against adaptive threshold over many runs on the bench, at equal detection.

Each machine is commissioned on one healthy run, its thresholds are learned on ten others, and everything is scored
on runs with seeds of their own. The constant threshold is then raised, with hindsight and in its own favour, as
far as it still detects as many faulty runs as the adaptive one; what is compared are the false alarms left.
"""

import json
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pumplib.errors import DataError, ParameterError
from pumplib.machines.profiles import profile_machine
from pumplib.paths import DATA
from pumplib.primer.approaches import METHODS, Monitor, critical_factor, train
from pumplib.primer.windows import Windows, windows
from pumplib.testbench.faults import Fault
from pumplib.testbench.run import Bench, Run, draw_bench, run
from pumplib.testbench.scenario import load_scenario

Array = NDArray[Any]
TRAINING = 10
"""Healthy runs that set the thresholds of a machine."""
RESULT = DATA / "measured" / "primer.json"
LADDER = (1.2e9, 2.5e9, 5e9, 1e10)
"""Sizes of the clogging, K_f in Pa s2/m6: 0.6, 1.3, 2.7 and 5.3 % of the nominal head."""
APPROACHES = ("limits", *METHODS, "parameters")
_BENCH, _COMMISSIONING, _TRAINING, _HEALTHY, _FAULTY = range(5)
_HEALTHY_RUN, _CLOGGED_RUN = "pump_healthy", "pump_clogging"


@dataclass(frozen=True, kw_only=True, eq=False, slots=True)
class Machine:
    """A machine on the bench with the monitor that was set up on it.

    Parameters
    ----------
    bench : Bench
        The machine.
    monitor : Monitor
        Its monitor.
    commissioning : Windows
        The run that the model comes from.
    """

    bench: Bench
    monitor: Monitor
    commissioning: Windows


def measured(run_: Run) -> Windows:
    """Windows of a run on the pump bench, with the believed motor.

    Parameters
    ----------
    run_ : Run
        A run of the profiles "pump" or "pump_hot".

    Returns
    -------
    Windows

    Raises
    ------
    ParameterError
        If the run's profile has no pump.
    """
    return windows(run_.fast, profile_machine(run_.scenario.profile).motor)


def set_up(seed: int, number: int = 0) -> Machine:
    """Draw a machine, commission it and learn its thresholds.

    Parameters
    ----------
    seed, number : int
        Seed of the study and number of the machine.

    Returns
    -------
    Machine
    """
    bench = draw_bench("pump", np.random.default_rng([seed, number, _BENCH]))
    first = measured(run(_HEALTHY_RUN, np.random.default_rng([seed, number, _COMMISSIONING]), bench))
    others = [
        measured(run(_HEALTHY_RUN, np.random.default_rng([seed, number, _TRAINING, k]), bench)) for k in range(TRAINING)
    ]
    return Machine(bench=bench, monitor=train(first, others, profile_machine("pump").pump.B), commissioning=first)


@dataclass(frozen=True, kw_only=True, slots=True)
class Scored:
    """One scored run.

    Parameters
    ----------
    size : float
        K_f, Pa s2/m6; 0 is healthy.
    adaptive, constant : float
        Factor up to which the adaptive and the constant threshold raise an alarm, counted from the fault on.
    alarms : tuple of bool
        Whether each of `APPROACHES` with its thresholds as learned is in alarm at some time from the fault on.
    """

    size: float
    adaptive: float
    constant: float
    alarms: tuple[bool, ...]


def score_run(machine: Machine, size: float, rng: np.random.Generator) -> Scored:
    """Make a run and score it.

    Parameters
    ----------
    machine : Machine
        The machine.
    size : float
        K_f, Pa s2/m6; 0 for a healthy run.
    rng : Generator
        Randomness of the run.

    Returns
    -------
    Scored

    Raises
    ------
    ParameterError
        If the size is negative.
    """
    if not size >= 0:
        raise ParameterError(f"score_run.size = {size!r}: must be 0 (healthy) or a positive K_f in Pa s2/m6.")
    scenario = load_scenario(_CLOGGED_RUN if size else _HEALTHY_RUN)
    if size:
        scenario = replace(scenario, fault=Fault(kind="clogging", size=size))
    done = run(scenario, rng, machine.bench)
    w, monitor = measured(done), machine.monitor
    onset = 0.0 if done.course.fault is None else done.course.fault.onset
    first = int(np.searchsorted(w.t, onset))
    r = monitor.model.residual(w)
    adaptive = critical_factor(monitor.threshold, r, w.activity, first)
    constant = critical_factor(monitor.threshold.constant(), r, w.activity, first)
    limits, parameters = (
        bool((one.statistic > one.threshold)[first:].any())
        for one in (monitor.signal_based(w), monitor.parameter_estimation(w))
    )
    cusum = any(time >= onset for time in monitor.model_based(w, "cusum").alarms)
    return Scored(
        size=size,
        adaptive=adaptive,
        constant=constant,
        alarms=(limits, adaptive > 1.0, constant > 1.0, cusum, parameters),
    )


@dataclass(frozen=True, kw_only=True, slots=True)
class Task:
    """What one process does: one machine with all its runs.

    Parameters
    ----------
    seed, number : int
        Seed of the study, number of the machine.
    healthy : int
        Scored healthy runs.
    faulty : int
        Scored runs of each size.
    sizes : tuple of float
        K_f, Pa s2/m6.
    """

    seed: int
    number: int
    healthy: int
    faulty: int
    sizes: tuple[float, ...]


def score_machine(task: Task) -> tuple[Scored, ...]:
    """Set a machine up and score all its runs.

    Parameters
    ----------
    task : Task
        Machine and numbers of runs.

    Returns
    -------
    tuple of Scored
    """
    machine = set_up(task.seed, task.number)
    key = (task.seed, task.number)
    plan: list[tuple[float, tuple[int, ...]]] = [(0.0, (*key, _HEALTHY, k)) for k in range(task.healthy)]
    plan += [(size, (*key, _FAULTY, s, k)) for s, size in enumerate(task.sizes) for k in range(task.faulty)]
    return tuple(score_run(machine, size, np.random.default_rng(list(entropy))) for size, entropy in plan)


@dataclass(frozen=True, kw_only=True, slots=True)
class Comparison:
    """Constant and adaptive threshold at equal detection of one fault.

    Parameters
    ----------
    size : float
        K_f, Pa s2/m6.
    healthy, faulty : int
        Scored runs.
    detected : int
        Faulty runs that the adaptive threshold detects; the constant one detects at least as many.
    adaptive : int
        Healthy runs with a false alarm of the adaptive threshold.
    constant : int
        Healthy runs with a false alarm of the constant threshold.
    factor : float
        Factor on k0 of the constant threshold.
    """

    size: float
    healthy: int
    faulty: int
    detected: int
    adaptive: int
    constant: int
    factor: float

    @property
    def ratio(self) -> float:
        """False-alarm runs, constant over adaptive; no adaptive one counts as one."""
        return self.constant / max(1, self.adaptive)


def false_alarm_rows(comparisons: Sequence[Comparison], level: float = 0.95) -> list[dict[str, str]]:
    """Comparisons as text, counts with Clopper-Pearson intervals.

    Parameters
    ----------
    comparisons : sequence of Comparison
        One a size.
    level : float
        Confidence level.

    Returns
    -------
    list of dict
        One row a size.
    """
    return [
        {
            "K_f": f"{one.size:.2g}",
            "detected": _share(one.detected, one.faulty, level),
            "false alarms, constant": _share(one.constant, one.healthy, level),
            "false alarms, adaptive": _share(one.adaptive, one.healthy, level),
            "ratio": f"{one.ratio:.3g}",
            "constant / k0": f"{one.factor:.2f}",
        }
        for one in comparisons
    ]


def _share(k: int, n: int, level: float) -> str:
    from scipy.stats import binomtest

    found = binomtest(k, n).proportion_ci(level, "exact")
    return f"{k} of {n}  ({100 * found.low:.1f}-{100 * found.high:.1f} %)"


def compare(scored: Sequence[Scored], size: float, factor: float = 1.0) -> Comparison:
    """Compare the two thresholds for one size of the fault.

    Parameters
    ----------
    scored : sequence of Scored
        Healthy runs and runs of this size, others are ignored.
    size : float
        K_f, Pa s2/m6.
    factor : float
        On the adaptive threshold; 1 is as learned.

    Returns
    -------
    Comparison

    Raises
    ------
    ParameterError
        If there are no healthy or no faulty runs.
    """
    healthy = [one for one in scored if one.size == 0]
    faulty = [one for one in scored if one.size == size and size > 0]
    if not healthy or not faulty:
        raise ParameterError(f"compare: {len(healthy)} healthy runs, {len(faulty)} of size {size:g}: needs both.")
    detected = sum(one.adaptive > factor for one in faulty)
    levels = sorted((one.constant for one in faulty), reverse=True)
    # just below the critical factor of the last run that has to be detected
    level = levels[detected - 1] * (1.0 - 1e-9) if detected else float("inf")
    return Comparison(
        size=size,
        healthy=len(healthy),
        faulty=len(faulty),
        detected=detected,
        adaptive=sum(one.adaptive > factor for one in healthy),
        constant=sum(one.constant > level for one in healthy),
        factor=level,
    )


def rates(counts: Sequence[tuple[float, int, tuple[int, ...]]], level: float = 0.95) -> list[dict[str, str]]:
    """Counts of `alarm_counts` as text with Clopper-Pearson intervals.

    Parameters
    ----------
    counts : sequence of tuple
        Size, runs, runs with alarm.
    level : float
        Confidence level.

    Returns
    -------
    list of dict
        One row a size: "runs" and each of `APPROACHES`.
    """
    table = []
    for size, n, hits in counts:
        row = {"runs": "healthy" if size == 0 else f"K_f = {size:.2g}"}
        for name, k in zip(APPROACHES, hits, strict=True):
            row[name] = _share(k, n, level)
        table.append(row)
    return table


def alarm_counts(scored: Sequence[Scored]) -> list[tuple[float, int, tuple[int, ...]]]:
    """Runs with alarm, by size of the fault.

    Parameters
    ----------
    scored : sequence of Scored
        Scored runs.

    Returns
    -------
    list of tuple
        Size (0 is healthy), runs, runs with alarm of each of `APPROACHES`.
    """
    rows = []
    for size in sorted({one.size for one in scored}):
        runs = [one.alarms for one in scored if one.size == size]
        rows.append((size, len(runs), tuple(int(n) for n in np.sum(runs, axis=0))))
    return rows


@dataclass(frozen=True, kw_only=True, eq=False, slots=True)
class Study:
    """The committed study.

    Parameters
    ----------
    date : str
        Of the measurement.
    size : float
        K_f of the claim, Pa s2/m6.
    seed : int
        Of the scored machines.
    healthy, faulty : int
        Runs of each machine: healthy ones, and of each size.
    sizes : tuple of float
        K_f, Pa s2/m6.
    scored : tuple of Scored
        All runs, machine by machine.
    """

    date: str
    size: float
    seed: int
    healthy: int
    faulty: int
    sizes: tuple[float, ...]
    scored: tuple[Scored, ...]

    def again(self, number: int = 0, healthy: int = 3, faulty: int = 1) -> list[tuple[Scored, Scored]]:
        """Repeat some runs of one machine.

        Parameters
        ----------
        number : int
            The machine.
        healthy, faulty : int
            How many healthy runs, and how many of each size.

        Returns
        -------
        list of tuple of Scored
            Committed and repeated score of each run.

        Raises
        ------
        ParameterError
            If the study has no such machine or fewer runs.
        """
        block = self.healthy + self.faulty * len(self.sizes)
        machines = len(self.scored) // block
        if not (0 <= number < machines and 0 < healthy <= self.healthy and 0 < faulty <= self.faulty):
            raise ParameterError(
                f"again: machine {number}, {healthy} healthy runs, {faulty} of each size: the study has machines 0 to "
                f"{machines - 1}, {self.healthy} healthy runs, {self.faulty} of each size."
            )
        fresh = score_machine(Task(seed=self.seed, number=number, healthy=healthy, faulty=faulty, sizes=self.sizes))
        rows = list(range(healthy))
        rows += [self.healthy + s * self.faulty + k for s in range(len(self.sizes)) for k in range(faulty)]
        return [(self.scored[number * block + row], one) for row, one in zip(rows, fresh, strict=True)]


def load_study(path: Path = RESULT) -> Study:
    """Read the committed study.

    Parameters
    ----------
    path : Path
        The file; that of the workbook by default.

    Returns
    -------
    Study

    Raises
    ------
    DataError
        If the file is absent or has another form.
    """
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        details, plan = content["details"], content["details"]["plan"]
        return Study(
            date=content["date"],
            size=float(details["size"]),
            seed=plan["seed"],
            healthy=plan["healthy"],
            faulty=plan["faulty"],
            sizes=tuple(plan["sizes"]),
            scored=tuple(
                Scored(size=float(size), adaptive=float(a), constant=float(c), alarms=tuple(x == "1" for x in alarms))
                for size, a, c, alarms in details["runs"]
            ),
        )
    except FileNotFoundError:
        raise DataError(f"{path.name} is absent; measure it by `python -m benchmarks.primer_study --write`.") from None
    except (KeyError, TypeError, ValueError) as error:
        raise DataError(f"{path.name}: not a result of `python -m benchmarks.primer_study` ({error}).") from None


def stored(scored: Sequence[Scored]) -> list[list[Any]]:
    """Scored runs as `load_study` reads them.

    Parameters
    ----------
    scored : sequence of Scored
        Scored runs.

    Returns
    -------
    list of list
        Size, adaptive and constant factor, alarms as zeros and ones.
    """
    return [
        [one.size, round(one.adaptive, 5), round(one.constant, 5), "".join("01"[yes] for yes in one.alarms)]
        for one in scored
    ]


def smallest_detected(scored: Sequence[Scored], share: float = 0.9) -> float:
    """Smallest size of which the adaptive threshold detects a share of the runs.

    Parameters
    ----------
    scored : sequence of Scored
        Scored runs.
    share : float
        Share to detect.

    Returns
    -------
    float
        K_f, Pa s2/m6.

    Raises
    ------
    ParameterError
        If no size is detected so often.
    """
    for size in sorted({one.size for one in scored} - {0.0}):
        hits = [one.adaptive > 1.0 for one in scored if one.size == size]
        if np.mean(hits) >= share:
            return size
    raise ParameterError(f"smallest_detected: no size is detected in {100 * share:g} % of the runs; try larger ones.")


def threshold_study(
    *,
    seed: int,
    machines: int,
    healthy: int,
    faulty: int,
    sizes: Sequence[float],
    mapper: Callable[[Callable[[Task], tuple[Scored, ...]], Iterable[Task]], Iterable[tuple[Scored, ...]]] = map,
) -> tuple[Scored, ...]:
    """Score runs of many machines.

    Parameters
    ----------
    seed : int
        Seed of the study.
    machines : int
        Number of machines.
    healthy, faulty : int
        Scored runs of each machine: healthy ones, and of each size.
    sizes : sequence of float
        K_f, Pa s2/m6.
    mapper : callable
        `map`, or that of an executor for several processes.

    Returns
    -------
    tuple of Scored

    Raises
    ------
    ParameterError
        If a number is not positive.
    """
    for name, value in (("machines", machines), ("healthy", healthy), ("faulty", faulty)):
        if not (isinstance(value, int) and value > 0):
            raise ParameterError(f"threshold_study.{name} = {value!r}: must be a positive whole number.")
    tasks = [
        Task(seed=seed, number=k, healthy=healthy, faulty=faulty, sizes=tuple(map(float, sizes)))
        for k in range(machines)
    ]
    return tuple(one for part in mapper(score_machine, tasks) for one in part)
