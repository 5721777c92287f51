"""Thesis 7.4: the steady-state scheme on the bench: false alarms, detection, delay, class, hypotheses, sizes.

One unit of work is one machine: drawn, commissioned on one healthy run, asked about ten others, scored on further
ones. Each run is judged by the methods of `pumplib.steady.bench_monitor`; beside them stand

    moving   single points with the steady-state detector switched off
    strict   the window with no margin of the model, whatever the ten runs asked for
"""

from dataclasses import dataclass, replace
from functools import cache
from typing import Annotated, Any, Literal

import numpy as np

from pumplib.campaign.residual import parse_fault
from pumplib.campaign.schemes import Row
from pumplib.machines.profiles import load_profile, profile_machine
from pumplib.machines.quantity import Choice, Parameters, Quantity
from pumplib.steady.bench_monitor import (
    Judged,
    MonitorSettings,
    Statement,
    SteadyMonitor,
    commission,
    pump_statement,
    teach,
)
from pumplib.testbench.data_sheets import sensor_spreads
from pumplib.testbench.faults import Fault
from pumplib.testbench.run import Bench, draw_bench, run
from pumplib.testbench.scenario import load_scenario
from pumplib.testbench.slow import SlowSignals

TAUGHT = 10
"""Healthy runs that may enlarge the margin, beside the one for commissioning."""
QUANTITIES = {"clogging": "K_f", "friction": "dB", "leakage": "K_l", "cavitation": "f_c", "dry_running": "f_d"}
"""Fault of the bench to the hypothesis that holds it."""
OUTSIDE = "outside"
"""No hypothesis is left: two faults at once, a fault that changes, or something the model does not hold."""
METHODS = ("plain", "single", "window")


@dataclass(frozen=True, kw_only=True, slots=True)
class SteadyCampaign(Parameters):
    """Runs that one machine is scored on.

    Parameters
    ----------
    profile : {"pump"}
        Bench profile.
    healthy : int
        Scored healthy runs.
    faults : tuple of str
        Fault and size, as "clogging:1e10".
    faulty : int
        Scored runs of each.
    ramp : float
        Time over which the fault grows, s; 0 is a step.
    """

    profile: Annotated[Literal["pump"], Choice("bench profile", ("pump",))] = "pump"
    healthy: Annotated[int, Quantity("-", "scored healthy runs of a machine", 0, 10_000)] = 20
    faults: tuple[str, ...] = ()
    faulty: Annotated[int, Quantity("-", "scored runs of a machine and fault", 1, 10_000)] = 20
    ramp: Annotated[float, Quantity("s", "growth of the fault", 0.0, 30.0)] = 0.0

    def _check_together(self) -> None:
        for one in self.faults:
            parse_fault(one, self.ramp)


name = "steady"
settings = SteadyCampaign
groups = ("fault", "size")


@cache
def stated() -> Statement:
    """What is stated about the bench's machines before any measurement.

    Returns
    -------
    Statement
    """
    return pump_statement(profile_machine("pump").motor, sensor_spreads(load_profile("pump")))


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Machine:
    """A machine with its monitor.

    Parameters
    ----------
    bench : Bench
        The machine.
    monitor : SteadyMonitor
        Commissioned, its margin taught.
    strict : SteadyMonitor or None
        Without a margin; None if the commissioning run cannot be explained without one.
    """

    bench: Bench
    monitor: SteadyMonitor
    strict: SteadyMonitor | None


def monitors(healthy: list[SlowSignals]) -> tuple[SteadyMonitor, SteadyMonitor | None]:
    """Monitor of a machine, and the one without a margin.

    Parameters
    ----------
    healthy : list of SlowSignals
        The commissioning run first, then those that teach.

    Returns
    -------
    taught : SteadyMonitor
    strict : SteadyMonitor or None
        None if the first run cannot be explained without a margin.
    """
    first = commission(healthy[0], stated())
    strict = first if not any(first.margin) else None
    return teach(first, healthy[1:]), strict


def set_up(rng: np.random.Generator) -> Machine:
    """Draw, commission and teach a machine.

    Parameters
    ----------
    rng : Generator
        Source of randomness.

    Returns
    -------
    Machine
    """
    bench = draw_bench("pump", rng)
    scenario, step = load_scenario("pump_healthy"), MonitorSettings().step
    taught, strict = monitors([run(scenario, rng, bench).slow(step, step) for _ in range(1 + TAUGHT)])
    return Machine(bench=bench, monitor=taught, strict=strict)


def score_one(machine: Machine, fault: Fault | None, rng: np.random.Generator) -> dict[str, Any]:
    """Run a machine once and let every method judge.

    Parameters
    ----------
    machine : Machine
        Set up.
    fault : Fault or None
        With the onset left open.
    rng : Generator
        Source of randomness.

    Returns
    -------
    dict
        A row, see `row_of`.
    """
    done = run(replace(load_scenario("pump_healthy"), fault=fault), rng, machine.bench)
    step = machine.monitor.settings.step
    return row_of(machine.monitor, machine.strict, done.slow(step, step), done.course.fault)


def row_of(
    monitor: SteadyMonitor, strict: SteadyMonitor | None, slow: SlowSignals, fault: Fault | None
) -> dict[str, Any]:
    """Judge the slow signals of a run and compare with the truth.

    Parameters
    ----------
    monitor : SteadyMonitor
        Of the machine.
    strict : SteadyMonitor or None
        Without a margin.
    slow : SlowSignals
        Of the run.
    fault : Fault or None
        With its onset.

    Returns
    -------
    dict
        ``fault``, ``size``, ``onset``; steady ``points`` and those that lie after the onset; of the first of these the
        operating point, ``first_omega_e`` and ``first_Q``, and which methods see the fault in it; ``margin`` of R1 (Pa)
        and R2 (N m). Of each method an alarm before the fault (healthy runs: at any time), one after it, its delay.
        The class by signs, whether it is the true one, its delay. The hypotheses left over, whether the truth is among
        them or alone, when it was alone, range of the size under the true hypothesis and whether the true size is in.
    """
    onset = fault.onset if fault else np.inf
    said = monitor.judge(slow)
    row: dict[str, Any] = {
        "fault": fault.kind if fault else "none",
        "size": fault.size if fault else 0.0,
        "onset": onset if fault else None,
        "points": len(said.points),
        "points_after": int((said.points.start >= onset).sum()),
        **_first(said, onset),
        "margin_head": float(monitor.margin[0]),
        "margin_torque": float(monitor.margin[1]),
    }
    for method in METHODS:
        row |= _timed(method, said.alarms(method), onset)
    if strict is None:  # a healthy commissioning run that is refuted is a false alarm
        row |= {"strict_false": 1, "strict_found": 0, "strict_delay": None}
    else:
        other = said if strict is monitor else strict.judge(slow, sizes=False)
        row |= _timed("strict", other.alarms("window"), onset)
    row["moving_false"] = int(monitor.moving_alarm(slow, onset))
    return row | _named(said, fault, onset) | _possible(said, fault, onset)


def _first(said: Judged, onset: float) -> dict[str, Any]:
    after = np.flatnonzero(said.points.start >= onset)
    k = int(after[0]) if len(after) else None
    row: dict[str, Any] = {
        f"first_{name}": None if k is None else float(said.points.signals[name][k]) for name in ("omega_e", "Q")
    }
    for method in METHODS:
        row[f"first_{method}"] = None if k is None else int(said.points.t[k] in said.alarms(method))
    return row


def _timed(label: str, times: Any, onset: float) -> dict[str, Any]:
    late = [float(t) for t in times if t >= onset]
    return {
        f"{label}_false": int(any(t < onset for t in times)),
        f"{label}_found": int(bool(late)),
        f"{label}_delay": late[0] - onset if late else None,
    }


def _named(said: Judged, fault: Fault | None, onset: float) -> dict[str, Any]:
    times = said.alarms("single")
    # a class belongs to the first alarm; after a false alarm it says nothing about the fault
    counts = bool(len(times)) and times[0] >= onset
    name = said.signs if counts else ""
    return {
        "signs_class": name or None,
        "signs_right": int(fault is not None and name == QUANTITIES.get(fault.kind)),
        "signs_delay": said.signs_at - onset if counts and said.signs_at is not None else None,
    }


def _possible(said: Judged, fault: Fault | None, onset: float) -> dict[str, Any]:
    times = said.alarms("window")
    counts = bool(len(times)) and times[0] >= onset and said.tested > 0 and fault is not None
    truth = QUANTITIES.get(fault.kind, "") if fault else ""
    left = said.possible if counts else ()
    size = said.verdicts[truth].size if counts and truth in left else None
    alone = counts and left == (truth,)
    return {
        "tested": said.tested if counts else 0,
        "possible": ("|".join(left) or OUTSIDE) if counts else None,
        "truth_in": int(truth in left) if counts else None,
        "unique": int(alone),
        "unique_delay": said.single_at - onset if alone and said.single_at is not None else None,
        "size_low": size[0] if size else None,
        "size_high": size[1] if size else None,
        "size_in": int(size[0] <= fault.size <= size[1]) if size and fault else None,
    }


def score(settings: SteadyCampaign, rng: np.random.Generator) -> list[Row]:
    """Set up a machine and score its runs.

    Parameters
    ----------
    settings : SteadyCampaign
        Which runs.
    rng : numpy.random.Generator
        Source of randomness.

    Returns
    -------
    list of dict
        One row a run, see `row_of`.
    """
    machine = set_up(rng)
    plan: list[Fault | None] = [None] * settings.healthy
    plan += [parse_fault(text, settings.ramp) for text in settings.faults for _ in range(settings.faulty)]
    return [score_one(machine, fault, rng) for fault in plan]
