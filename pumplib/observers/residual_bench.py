"""Thesis 6.6, 6.7: the residual observers on one machine of the bench: commissioned, taught, and shown on further runs.

The bench is not the observers' model: saturation, a cubic term of the head, leakage of the healthy pump, a drifting
winding, and sensors with gain and bias are in it, and the observers know none of them.
"""

from dataclasses import dataclass, replace
from functools import cache
from typing import Any, Literal

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from pumplib.errors import DataError, ParameterError
from pumplib.machines.parameters import Motor
from pumplib.machines.profiles import load_profile, profile_machine
from pumplib.observers.certificate import Gain
from pumplib.observers.residual import ResidualSettings
from pumplib.observers.residual_model import REST, PumpBelief, believed
from pumplib.observers.residual_monitor import (
    Judged,
    MonitorSettings,
    PumpMonitor,
    PumpRecord,
    commission_monitor,
    pump_record,
    teach,
)
from pumplib.observers.stator import Estimates, observe
from pumplib.observers.stator_design import design_gain
from pumplib.testbench.faults import Fault
from pumplib.testbench.run import Bench, Run, draw_bench, run
from pumplib.testbench.scenario import load_scenario

Array = NDArray[Any]
TESTS = ("changes", "steady")
PROFILES = {"pump": "pump_healthy", "pump_hot": "pump_hot_healthy"}
"""Bench profile and the scenario of its healthy runs."""


@cache
def knowledge(profile: str) -> tuple[Motor, PumpBelief, Gain]:
    """What the observers know before any measurement: the sheets, and the gain of the motor's observer.

    Parameters
    ----------
    profile : str
        One of `PROFILES`.

    Returns
    -------
    motor : Motor
    prior : PumpBelief
    gain : Gain

    Raises
    ------
    ParameterError
        If the profile has no pump.
    """
    if profile not in PROFILES:
        raise ParameterError(f"profile {profile!r}: must be one of {', '.join(PROFILES)}.")
    machine, sensors = profile_machine(profile), load_profile(profile)["sensors"]
    prior = believed(machine, flow_lag=sensors["flow"]["lag_s"], pressure_lag=sensors["pressure"]["lag_s"])
    return machine.motor, prior, design_gain(machine.motor, 1e4)[0]


def motor_part(done: Run, profile: str) -> Estimates:
    """Speed, torque and electrical side of a run by the motor's observer, at the rate of pressure and flow.

    Parameters
    ----------
    done : Run
        The run.
    profile : str
        Its bench profile.

    Returns
    -------
    Estimates
    """
    motor, _, gain = knowledge(profile)
    fast = done.fast
    return observe(fast.voltage, fast.current, motor, fast.rate, gain, every=round(fast.rate / fast.hydraulic_rate))


def record_of(done: Run, profile: str) -> PumpRecord:
    """What the pump part sees of a run.

    Parameters
    ----------
    done : Run
        The run.
    profile : str
        Its bench profile.

    Returns
    -------
    PumpRecord

    Raises
    ------
    DataError
        If the run has no pressure and flow.
    """
    if done.fast.H is None or done.fast.Q is None:
        raise DataError(f"record_of: the run of {profile} has no pressure and flow; take a bench with a pump.")
    return pump_record(motor_part(done, profile), done.fast.H, done.fast.Q, done.fast.hydraulic_rate)


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Prepared:
    """A machine and the healthy records that any monitor can be set up on.

    Parameters
    ----------
    profile : str
        Bench profile.
    bench : Bench
        The machine.
    commissioning : PumpRecord
        For the maps.
    healthy : tuple of PumpRecord
        For the thresholds.
    resistance : float
        True r_s at the start of the commissioning, ohm; for scoring only.
    """

    profile: str
    bench: Bench
    commissioning: PumpRecord
    healthy: tuple[PumpRecord, ...]
    resistance: float

    def monitor(self, settings: MonitorSettings | None = None, observer: ResidualSettings | None = None) -> PumpMonitor:
        """Commission and teach a monitor.

        Parameters
        ----------
        settings : MonitorSettings, optional
            How it decides.
        observer : ResidualSettings, optional
            Gains.

        Returns
        -------
        PumpMonitor
        """
        motor, prior, _ = knowledge(self.profile)
        commissioned = commission_monitor(self.commissioning, prior, motor, settings, observer)
        return teach(commissioned, self.commissioning, self.healthy)


def prepare(profile: str, rng: Generator, healthy: int = 10) -> Prepared:
    """Draw a machine and record healthy runs of it.

    Parameters
    ----------
    profile : str
        One of `PROFILES`.
    rng : Generator
        Source of randomness.
    healthy : int
        Runs beside the commissioning.

    Returns
    -------
    Prepared

    Raises
    ------
    ParameterError
        If the profile has no pump.
    """
    knowledge(profile)
    bench = draw_bench(profile, rng)
    scenario = load_scenario(PROFILES[profile])
    first = run(scenario, rng, bench)
    return Prepared(
        profile=profile,
        bench=bench,
        commissioning=record_of(first, profile),
        healthy=tuple(record_of(run(scenario, rng, bench), profile) for _ in range(healthy)),
        resistance=float(first.truth["r_s"][0]),
    )


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Shown:
    """One run of a prepared machine.

    Parameters
    ----------
    run : Run
        The run; course and truth are for marking and scoring only.
    motor : Estimates
        What the motor's observer says.
    record : PumpRecord
        What the pump part sees.
    onset : float or None
        True time of the fault, s.
    """

    run: Run
    motor: Estimates
    record: PumpRecord
    onset: float | None


def show(
    prepared: Prepared, rng: Generator, fault: str = "none", size: float = 0.0, *, onset: float | None = None,
    test: Literal["changes", "steady"] = "changes",
) -> Shown:  # fmt: skip
    """Run a prepared machine once more.

    Parameters
    ----------
    prepared : Prepared
        The machine.
    rng : Generator
        Source of randomness.
    fault : str
        "none" or one of `pumplib.testbench.faults.KINDS`.
    size : float
        In the unit of the fault.
    onset : float, optional
        Time of the step, s; drawn within segment seven if left out.
    test : {"changes", "steady"}
        Twelve changes of speed and valve, or one operating point.

    Returns
    -------
    Shown

    Raises
    ------
    ParameterError
        If fault, size, onset or test is not known to the bench.
    """
    if test not in TESTS:
        raise ParameterError(f"show: test = {test!r}; must be one of {', '.join(TESTS)}.")
    scenario = replace(load_scenario(PROFILES[prepared.profile]), test=test)
    if fault != "none":
        planned = Fault(kind=fault, size=size)  # type: ignore[arg-type]
        if onset is not None:
            if not 0.0 < onset < scenario.duration:
                raise ParameterError(
                    f"show: onset = {onset:g} s is not within the run; use 0 to {scenario.duration:g} s."
                )
            planned = replace(planned, onset=onset)
        scenario = replace(scenario, fault=planned)
    done = run(scenario, rng, prepared.bench)
    motor = motor_part(done, prepared.profile)
    assert done.fast.H is not None
    assert done.fast.Q is not None
    return Shown(
        run=done,
        motor=motor,
        record=pump_record(motor, done.fast.H, done.fast.Q, done.fast.hydraulic_rate),
        onset=None if done.course.fault is None else done.course.fault.onset,
    )


def true_winding(prepared: Prepared, shown: Shown) -> Array:
    """True change of the stator resistance against the start of the commissioning.

    Parameters
    ----------
    prepared : Prepared
        The machine.
    shown : Shown
        A run of it.

    Returns
    -------
    ndarray, shape (n,)
        Relative, at the instants of the record; for scoring only.
    """
    return np.asarray(shown.run.truth["r_s"][: len(shown.record.omega)] / prepared.resistance - 1.0)


@dataclass(frozen=True, kw_only=True, slots=True)
class MotorErrors:
    """Errors of the motor's observer against the bench's truth, where it stands behind its estimates.

    Parameters
    ----------
    speed_mean, speed_rms : float
        rad/s.
    torque_mean, torque_rms : float
        N m.
    trusted : float
        Share of the run.
    """

    speed_mean: float
    speed_rms: float
    torque_mean: float
    torque_rms: float
    trusted: float


def motor_errors(shown: Shown) -> MotorErrors:
    """Score the motor's observer on a run.

    Parameters
    ----------
    shown : Shown
        The run.

    Returns
    -------
    MotorErrors
    """
    n = min(len(shown.record.omega), len(shown.run.truth.t))
    good = shown.record.side.trusted[:n]
    speed = (shown.record.omega[:n] - shown.run.truth["omega"][:n])[good]
    torque = (shown.record.T_e[:n] - shown.run.truth["T_e"][:n])[good]
    return MotorErrors(
        speed_mean=float(speed.mean()), speed_rms=float(np.sqrt(np.mean(speed**2))),
        torque_mean=float(torque.mean()), torque_rms=float(np.sqrt(np.mean(torque**2))), trusted=float(good.mean()),
    )  # fmt: skip


def check_beginning(shown: Shown, settings: MonitorSettings) -> None:
    """Refuse a run whose fault begins within what is declared healthy: its trace would be calibrated away.

    Parameters
    ----------
    shown : Shown
        The run.
    settings : MonitorSettings
        Of the monitor.

    Raises
    ------
    ParameterError
        If the fault begins before the self calibration ends.
    """
    if shown.onset is not None and shown.onset < settings.self_calibration:
        raise ParameterError(
            f"the fault begins at {shown.onset:g} s, within the {settings.self_calibration:g} s that are declared "
            "healthy for self calibration; set a later onset, or self_calibration to less."
        )


def rest_after(said: Judged, time: float, seconds: float = 0.6) -> tuple[float, float, Array] | None:
    """Residuals of the first rest after an instant, such as that of a fault.

    Parameters
    ----------
    said : Judged
        A run.
    time : float
        s.
    seconds : float
        How much rest is taken.

    Returns
    -------
    tuple of (float, float, ndarray) or None
        Mean speed, rad/s, mean flow, m3/s, and r1 (Pa), r2, r3 (N m) of shape (n, 3); None if there is too little.
    """
    r = said.residuals
    chosen = np.flatnonzero(np.isfinite(said.r[:, 0]) & (said.activity < REST) & (r.t > time))
    need = round(seconds / r.dt)
    if len(chosen) < need:
        return None
    chosen = chosen[:need]
    return float(r["omega"][chosen].mean()), float(r["Q"][chosen].mean()), np.asarray(said.r[chosen])


def summary(said: Judged, onset: float | None) -> dict[str, Any]:
    """What a monitor said about a run, in words and numbers.

    Parameters
    ----------
    said : Judged
        Its judgement.
    onset : float or None
        True time of the fault, s.

    Returns
    -------
    dict
        False alarms before the fault, delay of the first alarm after it, fault named and size, other explanations.
    """
    start = np.inf if onset is None else onset
    late = [t for t in said.t if t >= start]
    named = said.classified
    return {
        "false alarms": sum(t < start for t in said.t),
        "delay / s": None if not late else round(late[0] - start, 3),
        "says": "no alarm" if not said.t else "too little rest to say" if named is None else named.fault,
        "size": "" if named is None or named.fault == "none" else f"{named.size:.3g}",
        "also possible": "; ".join(named.alternatives) if named is not None else "",
    }
