"""Thesis 4.4.2: the signal-based scheme on the bench: groups of faults under disturbing events, false alarms.

One unit of work is one machine: drawn, commissioned on one healthy run, taught on ten others, scored on further
ones, healthy and faulty, with and without a disturbing event. The scheme sees voltages, currents, flow and pressure.
"""

from dataclasses import dataclass, replace
from functools import cache
from typing import Annotated, Any, Literal

import numpy as np

from pumplib.campaign.residual import TAUGHT
from pumplib.campaign.schemes import Row
from pumplib.errors import ParameterError
from pumplib.events.features import Features, features
from pumplib.events.scheme import EventScheme, EventSettings, Told, teach_events
from pumplib.machines.quantity import Choice, Parameters, Quantity
from pumplib.observers.residual_bench import knowledge, motor_part
from pumplib.observers.residual_monitor import MonitorSettings, PumpRecord, commission_monitor, pump_record, teach
from pumplib.observers.stator import Estimates
from pumplib.testbench.faults import PHASES, Fault
from pumplib.testbench.nuisances import Nuisance
from pumplib.testbench.run import Bench, Run, draw_bench, run
from pumplib.testbench.scenario import load_scenario

DISTURBANCES = {
    "none": None,
    "unbalance drift": "pump_unbalance_drift",
    "supply step": "pump_supply_step",
    "source pressure": "pump_source_pressure",
}
"""Disturbing event of a run -> scenario that has it; load and frequency change in every run."""
GROUP = {
    "inter_turn": "G1", "rub": "G2", "bearing": "G2", "clogging": "G3", "leakage": "G4", "outlet_leak": "G4",
    "cavitation": "G5", "dry_running": "G6",
}  # fmt: skip
"""Fault of a campaign -> group of the tables."""
RUB_RIPPLE, BEARING_DRAG = 100.0, 2.5e-3
"""Torque ripple (N m) that a rub brings per N m s of its friction, and friction that a bearing brings per N m of
its ripple: the proportions of the clear faults in `pumplib.events.physics`."""
MONITOR = MonitorSettings(margin=1.4)
"""Ten runs do not show how warm a winding gets; a wider margin than chapter 6's takes it in."""
SINGLE = tuple(name for name in PHASES if len(name) == 1)


@dataclass(frozen=True, kw_only=True, slots=True)
class EventCampaign(Parameters):
    """Runs that one machine is scored on.

    Parameters
    ----------
    profile : {"pump"}
        Bench profile.
    healthy : int
        Scored healthy runs; disturbing events take turns.
    faults : tuple of str
        Fault and size, as "clogging:1e10"; "rub" and "bearing" are those of group G2.
    faulty : int
        Scored runs of each; disturbing events take turns.
    disturbances : tuple of str
        Disturbing events that take turns.
    """

    profile: Annotated[Literal["pump"], Choice("bench profile", ("pump",))] = "pump"
    healthy: Annotated[int, Quantity("-", "scored healthy runs of a machine", 0, 10_000)] = 24
    faults: tuple[str, ...] = ()
    faulty: Annotated[int, Quantity("-", "scored runs of a machine and fault", 1, 10_000)] = 4
    disturbances: tuple[str, ...] = tuple(DISTURBANCES)

    def _check_together(self) -> None:
        for one in self.faults:
            parse_fault(one)
        for name in self.disturbances:
            if name not in DISTURBANCES:
                raise ParameterError(f"disturbance {name!r}: must be one of {', '.join(DISTURBANCES)}.")
        if not self.disturbances or (self.healthy == 0 and not self.faults):
            raise ParameterError("EventCampaign: nothing to score; give healthy runs or faults, and a disturbance.")


name = "events"
settings = EventCampaign
groups = ("group", "fault", "size")
data = ("bench", "fmea", "motors", "primer", "pumps", "scenarios")


def parse_fault(text: str, phase: str = "a") -> tuple[str, Fault]:
    """Read a fault written as "kind:size".

    Parameters
    ----------
    text : str
        For example "rub:2.5e-4".
    phase : str
        Of an inter-turn short.

    Returns
    -------
    kind : str
        Key of `GROUP`.
    fault : Fault
        Its onset left open.

    Raises
    ------
    ParameterError
        If it is written differently or impossible.
    """
    kind, _, written = str(text).partition(":")
    try:
        size = float(written)
    except ValueError:
        raise ParameterError(f'fault {text!r}: write it as "kind:size", for example "clogging:1e10".') from None
    match kind:
        case "rub":
            return kind, Fault(kind="friction", size=size, ripple=RUB_RIPPLE * size)
        case "bearing":
            return kind, Fault(kind="bearing", size=size, drag=BEARING_DRAG * size)
        case "inter_turn":
            return kind, Fault(kind="inter_turn", size=size, phase=phase)
        case "clogging" | "leakage" | "outlet_leak" | "cavitation" | "dry_running":
            return kind, Fault(kind=kind, size=size)
    raise ParameterError(f"fault {text!r}: kind must be one of {', '.join(GROUP)}.")


def _seen(done: Run) -> tuple[Estimates, PumpRecord]:
    fast = done.fast
    assert fast.H is not None
    assert fast.Q is not None
    found = motor_part(done, "pump")
    return found, pump_record(found, fast.H, fast.Q, fast.hydraulic_rate)


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Machine:
    """A machine with the scheme that was taught on its healthy runs.

    Parameters
    ----------
    bench : Bench
        The machine.
    scheme : EventScheme
        Its scheme.
    """

    bench: Bench
    scheme: EventScheme


def set_up(profile: str, rng: np.random.Generator, settings: EventSettings | None = None) -> Machine:
    """Draw, commission and teach a machine.

    Parameters
    ----------
    profile : str
        Bench profile.
    rng : Generator
        Source of randomness.
    settings : EventSettings, optional
        Of the scheme.

    Returns
    -------
    Machine
    """
    motor, prior, _ = knowledge(profile)
    bench = draw_bench(profile, rng)
    healthy = load_scenario("pump_healthy")
    seen = [_seen(run(healthy, rng, bench)) for _ in range(1 + TAUGHT)]
    records = [record for _, record in seen]
    monitor = commission_monitor(records[0], prior, motor, MONITOR)
    taught = teach(monitor, records[0], records[1:])
    found: list[Features] = [features(one, record, taught) for one, record in seen[1:]]
    return Machine(bench=bench, scheme=teach_events(taught, found, settings))


@cache
def _nuisances(disturbance: str) -> tuple[Nuisance, ...]:
    scenario = DISTURBANCES[disturbance]
    return load_scenario(scenario).nuisances if scenario else ()


def judge_one(
    machine: Machine, fault: Fault | None, disturbance: str, rng: np.random.Generator
) -> tuple[Told, float | None]:
    """Run a machine once and let the scheme judge.

    Parameters
    ----------
    machine : Machine
        Set up.
    fault : Fault or None
        With the onset left open.
    disturbance : str
        Of `DISTURBANCES`.
    rng : Generator
        Source of randomness.

    Returns
    -------
    told : Told
    onset : float or None
        Of the fault, s.
    """
    scenario = replace(load_scenario("pump_healthy"), fault=fault, nuisances=_nuisances(disturbance))
    done = run(scenario, rng, machine.bench)
    found, record = _seen(done)
    told = machine.scheme.judge(features(found, record, machine.scheme.monitor))
    return told, done.course.fault.onset if done.course.fault else None


def score_one(machine: Machine, text: str, disturbance: str, rng: np.random.Generator) -> dict[str, Any]:
    """Run a machine once and write down what the scheme said.

    Parameters
    ----------
    machine : Machine
        Set up.
    text : str
        Fault as for `parse_fault`; empty for none.
    disturbance : str
        Of `DISTURBANCES`.
    rng : Generator
        Source of randomness.

    Returns
    -------
    dict
        A row: the truth; whether there was an alarm before the fault (healthy runs: at any time), whether one after
        it and how long after; the group of the first verdict acted on that names one alone, or the status of the
        last alarm acted on; whether it is right; how long after the fault it was named; the group or status acted
        on at the end of the run.
    """
    kind, fault = parse_fault(text, str(rng.choice(SINGLE))) if text else ("none", None)
    told, onset = judge_one(machine, fault, disturbance, rng)
    decisions = told.decisions
    names = [_word(verdict.status, verdict.candidates) for verdict in decisions.verdicts]
    alarm = np.array([verdict.alarm for verdict in decisions.verdicts])[decisions.acted]
    alone = np.array([verdict.status == "isolated" for verdict in decisions.verdicts])[decisions.acted]
    begin = onset if onset is not None else np.inf
    false = bool(np.any(alarm & (decisions.t < begin)))
    after = decisions.t >= (onset or 0.0)
    first, named = np.flatnonzero(alarm & after), np.flatnonzero(alone & after)
    acted = "none"
    if len(named):
        acted = names[decisions.acted[named[0]]]
    elif len(first):
        acted = names[decisions.acted[first[-1]]]
    group = GROUP.get(kind, "none")
    delays = onset is not None
    return {
        "group": group,
        "fault": kind,
        "size": fault.size if fault else 0.0,
        "disturbance": disturbance,
        "false_alarm": int(false),
        "detected": int(len(first) > 0),
        "acted": acted,
        "correct": int(acted == group and not false),
        "final": names[decisions.acted[-1]] if alarm[-1] else "none",
        "delay": float(decisions.t[first[0]] - begin) if len(first) and delays else None,
        "group_delay": float(decisions.t[named[0]] - begin) if len(named) and delays else None,
    }


def _word(status: str, candidates: tuple[tuple[str, ...], ...]) -> str:
    return candidates[0][0] if status == "isolated" else status


def score(settings: EventCampaign, rng: np.random.Generator) -> list[Row]:
    """Set up a machine and score its runs.

    Parameters
    ----------
    settings : EventCampaign
        Which runs.
    rng : numpy.random.Generator
        Source of randomness.

    Returns
    -------
    list of dict
        One row a run, see `score_one`.
    """
    machine = set_up(settings.profile, rng)
    plan = [("", k) for k in range(settings.healthy)]
    plan += [(text, k) for text in settings.faults for k in range(settings.faulty)]
    turns = settings.disturbances
    return [score_one(machine, text, turns[k % len(turns)], rng) for text, k in plan]


__all__ = [
    "DISTURBANCES",
    "GROUP",
    "EventCampaign",
    "Machine",
    "data",
    "groups",
    "judge_one",
    "name",
    "parse_fault",
    "score",
    "score_one",
    "set_up",
    "settings",
]
