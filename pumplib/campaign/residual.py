"""Thesis 6.7: the pump's residual observers on the bench: detection, delay, isolation, false alarms, baselines.

One unit of work is one machine: drawn, commissioned on one healthy run, taught on ten others, scored on further
ones. Three monitors and three baselines judge the same runs:

    observers     residual observers with adaptive thresholds
    calibrated    the same; after 15 s declared healthy the run's own corrections are taken off
    winding       the same as observers with the winding resistance estimated on line
    limits        bands of pressure, flow and current
    constant      the observers' residuals against k0 alone
    estimation    recursive re-estimation of the head map with the Mahalanobis distance
"""

from dataclasses import dataclass, replace
from typing import Annotated, Any, Literal

import numpy as np

from pumplib import primer
from pumplib.campaign.schemes import Row
from pumplib.decide import Evaluator
from pumplib.errors import ParameterError
from pumplib.machines.quantity import Choice, Parameters, Quantity
from pumplib.observers.residual_bench import knowledge, record_of
from pumplib.observers.residual_monitor import (
    Judged,
    MonitorSettings,
    PumpMonitor,
    commission_monitor,
    spans,
    teach,
)
from pumplib.testbench.faults import Fault
from pumplib.testbench.run import Bench, draw_bench, run
from pumplib.testbench.scenario import load_scenario

TAUGHT = 10
"""Healthy runs that teach thresholds, beside the one for commissioning."""
HEALTHY_BEGINNING = 15.0
"""Seconds declared healthy for self calibration; the fault comes in segment seven, after 15.2 s."""
MONITORS: dict[str, MonitorSettings] = {
    "observers": MonitorSettings(),
    "calibrated": MonitorSettings(self_calibration=HEALTHY_BEGINNING, margin=1.18),
    "winding": MonitorSettings(winding="estimated"),
}


@dataclass(frozen=True, kw_only=True, slots=True)
class ResidualCampaign(Parameters):
    """Runs that one machine is scored on.

    Parameters
    ----------
    profile : {"pump", "pump_hot"}
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

    profile: Annotated[Literal["pump", "pump_hot"], Choice("bench profile", ("pump", "pump_hot"))] = "pump"
    healthy: Annotated[int, Quantity("-", "scored healthy runs of a machine", 0, 10_000)] = 40
    faults: tuple[str, ...] = ()
    faulty: Annotated[int, Quantity("-", "scored runs of a machine and fault", 1, 10_000)] = 20
    ramp: Annotated[float, Quantity("s", "growth of the fault", 0.0, 30.0)] = 0.0

    def _check_together(self) -> None:
        for one in self.faults:
            parse_fault(one, self.ramp)


name = "residual"
settings = ResidualCampaign
groups = ("fault", "size")


def parse_fault(text: str, ramp: float = 0.0) -> Fault:
    """Read a fault written as "kind:size".

    Parameters
    ----------
    text : str
        For example "leakage:6e-8".
    ramp : float
        Time over which it grows, s; 0 is a step.

    Returns
    -------
    Fault

    Raises
    ------
    ParameterError
        If it is written differently or impossible.
    """
    kind, _, size = str(text).partition(":")
    try:
        number = float(size)
    except ValueError:
        raise ParameterError(f'fault {text!r}: write it as "kind:size", for example "clogging:1e10".') from None
    shape: Any = {"shape": "ramp", "ramp": ramp} if ramp > 0 else {}
    return Fault(kind=kind, size=number, **shape)  # type: ignore[arg-type]


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Machine:
    """A machine with everything that was taught on its healthy runs.

    Parameters
    ----------
    bench : Bench
        The machine.
    monitors : dict of str to PumpMonitor
        By `MONITORS`.
    simple : pumplib.primer.Monitor
        Limits and re-estimation.
    """

    bench: Bench
    monitors: dict[str, PumpMonitor]
    simple: primer.Monitor


def set_up(profile: str, rng: np.random.Generator) -> Machine:
    """Draw, commission and teach a machine.

    Parameters
    ----------
    profile : str
        Bench profile.
    rng : Generator
        Source of randomness.

    Returns
    -------
    Machine
    """
    motor, prior, _ = knowledge(profile)
    bench = draw_bench(profile, rng)
    healthy = load_scenario("pump_healthy" if profile == "pump" else "pump_hot_healthy")
    records, windows = [], []
    for _ in range(1 + TAUGHT):
        done = run(healthy, rng, bench)
        records.append(record_of(done, profile))
        windows.append(primer.measured(done))
    monitors = {}
    for label, chosen in MONITORS.items():
        commissioned = commission_monitor(records[0], prior, motor, chosen)
        monitors[label] = teach(commissioned, records[0], records[1:])
    return Machine(bench=bench, monitors=monitors, simple=primer.train(windows[0], windows[1:], prior.B))


def score_one(machine: Machine, fault: Fault | None, profile: str, rng: np.random.Generator) -> dict[str, Any]:
    """Run a machine once and let everybody judge.

    Parameters
    ----------
    machine : Machine
        Set up.
    fault : Fault or None
        With the onset left open.
    profile : str
        Bench profile.
    rng : Generator
        Source of randomness.

    Returns
    -------
    dict
        A row: of each monitor whether there was an alarm before the fault (healthy runs: at any time), whether and
        how long after it, the class and how long after the fault it was said.
    """
    scenario = load_scenario("pump_healthy" if profile == "pump" else "pump_hot_healthy")
    done = run(replace(scenario, fault=fault), rng, machine.bench)
    record = record_of(done, profile)
    onset = done.course.fault.onset if done.course.fault else np.inf
    row: dict[str, Any] = {
        "fault": fault.kind if fault else "none",
        "size": fault.size if fault else 0.0,
        "onset": onset if fault else None,
    }
    judged = {label: monitor.judge(record) for label, monitor in machine.monitors.items()}
    for label, said in judged.items():
        times = list(said.t)
        if label == "calibrated":  # until the calibration has ended the uncalibrated monitor keeps watch
            times += [t for t in judged["observers"].t if t < HEALTHY_BEGINNING]
        row |= _timed(label, sorted(times), onset) | _named(label, said, onset)
    windows = primer.measured(done)
    row |= _timed("limits", machine.simple.signal_based(windows).alarms, onset)
    row |= _timed("constant", _constant(machine.monitors["observers"], judged["observers"], record.dt), onset)
    row |= _timed("estimation", machine.simple.parameter_estimation(windows).alarms, onset)
    return row


def _timed(label: str, times: Any, onset: float) -> dict[str, Any]:
    late = [t for t in times if t >= onset]
    return {
        f"{label}_false": int(any(t < onset for t in times)),
        f"{label}_found": int(bool(late)),
        f"{label}_delay": late[0] - onset if late else None,
    }


def _named(label: str, said: Judged, onset: float) -> dict[str, Any]:
    # a class belongs to the first alarm; after a false alarm it says nothing about the fault
    counts = said.classified is not None and said.first is not None and said.first >= onset
    early_dry = said.dry is not None and said.dry >= onset
    return {
        f"{label}_class": said.classified.fault if counts and said.classified else None,
        f"{label}_estimate": said.classified.size if counts and said.classified else None,
        f"{label}_class_delay": said.classified_at - onset if counts and said.classified_at is not None else None,
        f"{label}_dry_delay": said.dry - onset if early_dry and said.dry is not None else None,
    }


def _constant(monitor: PumpMonitor, said: Judged, dt: float) -> list[float]:
    assert monitor.threshold is not None
    threshold = monitor.threshold.constant()
    times: list[float] = []
    for first, stop in spans(np.isfinite(said.r[:, 0])):
        found = Evaluator(threshold, dt).run(said.r[first:stop], said.activity[first:stop])
        times += [float(said.residuals.t[first + alarm.sample]) for alarm in found.alarms]
    return times


def score(settings: ResidualCampaign, rng: np.random.Generator) -> list[Row]:
    """Set up a machine and score its runs.

    Parameters
    ----------
    settings : ResidualCampaign
        Which runs.
    rng : numpy.random.Generator
        Source of randomness.

    Returns
    -------
    list of dict
        One row a run, see `score_one`.
    """
    machine = set_up(settings.profile, rng)
    plan: list[Fault | None] = [None] * settings.healthy
    plan += [parse_fault(text, settings.ramp) for text in settings.faults for _ in range(settings.faulty)]
    return [score_one(machine, fault, settings.profile, rng) for fault in plan]
