"""Thesis 5.3: one scored run of the stator observer on the bench: statistics for a Monte Carlo campaign.

A run draws a machine with its sensors, commissions on healthy cold records of it, and tests it once, with another
supply, load and temperature. It returns numbers, not decisions: thresholds come from other, healthy runs. Everything
random comes from the generator, and in one order, so that runs that differ in the fault only share all draws.
"""

import math
from dataclasses import dataclass, replace
from functools import cache
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray

from pumplib.machines import Motor
from pumplib.machines.profiles import load_profile
from pumplib.machines.quantity import Choice, Parameters, Quantity
from pumplib.motor.short_identify import sector_centres
from pumplib.observers.certificate import Gain
from pumplib.observers.stator import Estimates, StatorObserver
from pumplib.observers.stator_baselines import (
    compensated,
    observer_difference,
    raw_negative_sequence,
    regressed,
    star_point,
)
from pumplib.observers.stator_commission import Commissioning, Tolerances, believed, commission
from pumplib.observers.stator_decision import PAIRS, PHASES, decide, deviation, nearest_phase
from pumplib.observers.stator_design import ObserverSettings, design_gain
from pumplib.observers.stator_sequences import Sequences, sequences, sliding
from pumplib.testbench.faults import Fault
from pumplib.testbench.machine import source
from pumplib.testbench.measurement import measure
from pumplib.testbench.run import Bench, draw_bench, play, read
from pumplib.testbench.scenario import INVERTER, Course, Scenario, draw_course
from pumplib.testbench.sensors import FastSignals
from pumplib.testbench.simulate import STEP, Truth

Array = NDArray[Any]
ONSET = 0.5  # s, of the fault
BEFORE, AFTER = (0.1, 0.5), (1.0, 1.5)  # s, windows of the test
_COMMISSIONING = (0.5, 1.5)
_NEVER = float("nan")


@dataclass(frozen=True, kw_only=True, slots=True)
class ScoreSettings(Parameters):
    """What a scored run is about.

    References
    ----------
    Thesis 5.3 (reconstructed): identification and estimation tests.
    """

    gamma: Annotated[float, Quantity("-", "shorted share of the turns; 0 is healthy", 0.0, 0.9)] = 0.0
    r_f: Annotated[float, Quantity("ohm", "contact resistance", 0.0, 1e6)] = 0.0
    loop: Annotated[Literal["phase", "pair"], Choice("short within a phase or between two", ("phase", "pair"))] = (
        "phase"
    )
    accuracy: Annotated[Literal["A", "B"], Choice("class of the sensors", ("A", "B"))] = "A"
    connection: Annotated[Literal["Y", "delta"], Choice("connection of the stator", ("Y", "delta"))] = "Y"
    rate: Annotated[float, Quantity("Hz", "sampling rate", 1e3, 1e4)] = 10_000.0
    test: Annotated[
        Literal["drawn", "steady", "ramp", "torque_step"],
        Choice("kind of test", ("drawn", "steady", "ramp", "torque_step")),
    ] = "drawn"
    supply: Annotated[Literal["grid", "pwm"], Choice("supply", ("grid", "pwm"))] = "grid"
    records: Annotated[int, Quantity("-", "commissioning records", 0, 100)] = 1
    statistic_threshold: Annotated[float, Quantity("-", "for the delay, standard deviations", 0.1, 1e3)] = 3.5
    instant_threshold: Annotated[float, Quantity("-", "for the delay of the observer's 3|d|", 1e-5, 1.0)] = 0.012


@cache
def belief(connection: Literal["Y", "delta"] = "Y") -> Motor:
    """What the observer believes about the motor of the profile.

    Parameters
    ----------
    connection : {"Y", "delta"}
        Connection of the stator.

    Returns
    -------
    Motor
    """
    data = load_profile("stator")["motor"]
    return Motor(**{**data, "connection": connection}, B=0.0, rated_frequency=50.0)


@cache
def _gain(connection: Literal["Y", "delta"], rate: float) -> Gain:
    return design_gain(belief(connection), rate)[0]


@dataclass(frozen=True, kw_only=True, eq=False)
class Drawn:
    """A machine, what is known about it, and a test of it.

    Parameters
    ----------
    bench : Bench
        Machine and sensors.
    records : tuple of Sequences
        Windows of the commissioning.
    healthy : Commissioning
        What they taught.
    course : Course
        Of the test, with its fault.
    phase : int
        Faulty phase, 0, 1, 2, or first of two.
    truth : Truth
        Of the test.
    signals : FastSignals
        Of the test.
    estimates : Estimates
        Of the test, 1 kHz.
    star : ndarray, shape (n,)
        Measured star-point voltage, V, for the baseline only.
    """

    bench: Bench
    records: tuple[Sequences, ...]
    healthy: Commissioning
    course: Course
    phase: int
    truth: Truth
    signals: FastSignals
    estimates: Estimates
    star: Array


def _observe(settings: ScoreSettings, signals: FastSignals) -> Estimates:
    observer = StatorObserver(
        belief(settings.connection), settings.rate, _gain(settings.connection, settings.rate),
        settings=ObserverSettings(start_speed=220.0), every=max(1, round(settings.rate / 1000)),
    )  # fmt: skip
    return observer.run(signals.voltage, signals.current)


def _course(settings: ScoreSettings, scenario: Scenario, rng: np.random.Generator) -> Course:
    course = draw_course(scenario, rng)
    if settings.connection == "delta":
        # the profile's voltage is that of a winding: the same machine in delta hangs on a lower line voltage
        course = replace(course, supply=replace(course.supply, amplitude=course.supply.amplitude / math.sqrt(3)))
    if settings.supply == "pwm":
        pulses = source(**INVERTER)
        wave = course.wave._replace(
            dead=pulses.dead, inv_dead_i=pulses.inv_dead_i, link=pulses.link, carrier=pulses.carrier
        )
        course = replace(course, wave=wave)  # beside the harmonics of the profile
    return course


def draw_test(settings: ScoreSettings, rng: np.random.Generator) -> Drawn:
    """Draw and simulate everything of one run.

    Parameters
    ----------
    settings : ScoreSettings
        What it is about.
    rng : numpy.random.Generator
        All randomness.

    Returns
    -------
    Drawn
    """
    bench = draw_bench("stator", rng, connection=settings.connection, accuracy=settings.accuracy, rate=settings.rate)
    scenario = Scenario(name="stator test", profile="stator", duration=1.5, test=settings.test)
    commissioning = replace(scenario, test="drawn")
    records = []
    for _ in range(settings.records):
        course = _course(settings, commissioning, rng)
        cold = replace(course, slow={**course.slow, "r_s": 1.0, "r_r": 1.0})
        records.append(
            sequences(_observe(settings, read(bench.sensors, play(bench.machine, cold), rng)), *_COMMISSIONING)
        )
    course, phase = _course(settings, scenario, rng), int(rng.integers(3))
    if settings.gamma > 0:
        place = PAIRS[phase] if settings.loop == "pair" else PHASES[phase]
        fault = Fault(kind="inter_turn", size=settings.gamma, onset=ONSET, phase=place, r_f=settings.r_f)
        course = replace(course, fault=fault)
    truth = play(bench.machine, course)
    signals = read(bench.sensors, truth, rng)
    star, _ = measure(bench.sensors.voltage[:1], truth["v_0"], STEP, rng)
    tolerances = Tolerances(gain=0.005 if settings.accuracy == "A" else 0.01)
    motor = belief(settings.connection)
    return Drawn(
        bench=bench,
        records=tuple(records),
        healthy=commission(records, motor, tolerances) if records else believed(motor, tolerances),
        course=course,
        phase=phase,
        truth=truth,
        signals=signals,
        estimates=_observe(settings, signals),
        star=star[:, 0],
    )


def _first(t: Array, above: Array) -> float:
    """Time from the onset to the first sample after it that is above; NaN if none is."""
    late = np.flatnonzero(above & (t > ONSET))
    return float(t[late[0]] - ONSET) if len(late) else _NEVER


def score_run(settings: ScoreSettings, rng: np.random.Generator) -> dict[str, float]:
    """Simulate one run and return its statistics.

    Parameters
    ----------
    settings : ScoreSettings
        What it is about.
    rng : numpy.random.Generator
        All randomness.

    Returns
    -------
    dict of str to float
        ``statistic`` (of the decision), ``statistic_observer`` (the same from the observer's g_c),
        ``statistic_watching`` (with the healthy part of the test as one more record), ``size_d`` (3|d|);
        ``angle`` (to the centre of the nearest sector, rad), ``phase_right``, ``phase_right_observer`` (0 or 1),
        ``kind`` (0 one phase, 1 undecided, 2 two phases, 3 no short, if the window were alarmed);
        ``gamma_R`` (r_s unknown), ``gamma_R_low``, ``gamma_R_high`` (90 %), ``gamma_R_watching`` (r_s from the healthy
        part of the test), ``gamma_R_known`` (r_s given), NaN where there is none; the baselines ``raw_I2`` (A),
        ``compensated`` (3|d|, less the healthy mean), ``observer`` and ``observer_V2`` (3|d| of the observer less its
        healthy mean, or less a line in V_2), ``star_point`` (share of the voltage, NaN in delta);
        ``delay_window``, ``delay_instant`` (s from the onset, NaN if never within the run); ``speed_rms`` (rad/s,
        last half second), ``warm`` (true factor of the resistances), ``r_s`` and ``r_s_true`` (ohm).
    """
    test = draw_test(settings, rng)
    healthy, motor = test.healthy, test.healthy.motor
    after, before = sequences(test.estimates, *AFTER), sequences(test.estimates, *BEFORE)
    verdict = decide(healthy, after, threshold=1e-9)
    d_observer, _, statistic_observer = deviation(healthy, after, "observer")
    watching = healthy.update(before, cold=False)
    _, _, statistic_watching = deviation(watching, after)
    centres = sector_centres(motor.r_s, motor.L_ls, float(after.omega_s))
    right = int(nearest_phase(np.array(verdict.d), centres)) == test.phase
    r_s_true = float(test.truth["r_s"][-1]) * test.bench.machine.base.motor.r_s
    gammas = {}
    for name, r_s in (("gamma_R", None), ("gamma_R_watching", watching.r_s[0]), ("gamma_R_known", r_s_true)):
        gammas[name] = decide(healthy, after, threshold=1e-9, r_s=r_s)
    moving = sliding(test.estimates)
    _, _, course = deviation(healthy, moving)
    reference = healthy.reference if test.records else 0.0
    instant = 3 * np.abs(test.estimates.g_c - reference)
    speed = test.truth["omega"][-500:] - test.estimates.omega[-500:]
    last = round(AFTER[0] * settings.rate)
    return {
        "statistic": verdict.statistic,
        "statistic_observer": float(statistic_observer),
        "statistic_watching": float(statistic_watching),
        "size_d": verdict.size_d,
        "angle": verdict.angle,
        "phase_right": float(right),
        "phase_right_observer": float(int(nearest_phase(d_observer, centres)) == test.phase),
        "kind": float(("one phase", "undecided", "two phases", "no short").index(verdict.kind)),
        **{name: value.gamma for name, value in gammas.items()},
        "gamma_R_low": verdict.interval[0],
        "gamma_R_high": verdict.interval[1],
        "raw_I2": float(raw_negative_sequence(after)),
        "compensated": 3 * float(np.abs(compensated(motor, after, test.records))),
        "observer": 3 * float(np.abs(observer_difference(after, test.records))),
        "observer_V2": 3 * float(np.abs(regressed(motor, after, test.records))) if test.records else _NEVER,
        "star_point": star_point(test.signals.voltage[last:], test.star[last:], settings.connection),
        "delay_window": _first(moving.t, course > settings.statistic_threshold),
        "delay_instant": _first(test.estimates.t, instant > settings.instant_threshold),
        "speed_rms": float(np.sqrt(np.mean(speed**2))),
        "warm": float(test.truth["r_s"][-1]),
        "r_s": verdict.r_s,
        "r_s_true": r_s_true,
    }
