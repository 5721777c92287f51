"""Thesis 5.3: tests of the stator observer on one machine: traces, each phase, sweep of the size, unbalance.

A machine is drawn from the bench with its sensors and commissioned on cold healthy records. The tests are further runs
with another supply, load and temperature each. Truth is returned for drawings and scores; no decision sees it.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Annotated, Any, Literal

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from pumplib.decide import CusumSettings
from pumplib.errors import ParameterError
from pumplib.machines import Motor
from pumplib.machines.quantity import Choice, Parameters, Quantity, check_value
from pumplib.motor.short_identify import fault_coefficient, stator_impedance
from pumplib.observers.certificate import Certificate, Gain
from pumplib.observers.stator import Estimates, observe
from pumplib.observers.stator_alarm import fault_signal, run_alarm, tune_alarm
from pumplib.observers.stator_baselines import raw_negative_sequence
from pumplib.observers.stator_commission import Commissioning, Tolerances, commission
from pumplib.observers.stator_decision import PAIRS, PHASES, THRESHOLD, Verdict, decide, deviation
from pumplib.observers.stator_design import ObserverSettings, design_gain
from pumplib.observers.stator_score import belief
from pumplib.observers.stator_sequences import Sequences, sequences, sliding
from pumplib.testbench.faults import PHASES as LOOPS
from pumplib.testbench.faults import Fault
from pumplib.testbench.run import Bench, draw_bench, play, read
from pumplib.testbench.scenario import Course, Scenario, draw_course
from pumplib.testbench.sensors import FastSignals
from pumplib.testbench.simulate import Truth

Array = NDArray[Any]
WINDOW = 0.5  # s, of a decision
_QUIET = 4  # healthy runs that tune the fast alarm
_LARGE = 0.03  # share of the turns it is for: half of it is above what changes of the supply do to a healthy machine
_TIMES = 100.0  # Hz, of the sliding statistic


@dataclass(frozen=True, kw_only=True, slots=True)
class Conditions(Parameters):
    """Where a machine is tested; stays from its commissioning to the last test."""

    connection: Annotated[Literal["Y", "delta"], Choice("connection of the stator", ("Y", "delta"))] = "Y"
    accuracy: Annotated[Literal["A", "B"], Choice("class of the sensors", ("A", "B"))] = "A"
    rate: Annotated[float, Quantity("Hz", "sampling rate", 1e3, 1e4)] = 10_000.0
    supply: Annotated[Literal["grid", "inverter"], Choice("supply", ("grid", "inverter"))] = "grid"
    decay_rate: Annotated[float, Quantity("1/s", "decay rate asked of the gain", 0.0, 1e5, True)] = 60.0
    records: Annotated[int, Quantity("-", "commissioning records", 1, 100)] = 1


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class StatorMachine:
    """A machine, ready to be tested.

    Parameters
    ----------
    conditions : Conditions
        Where.
    bench : Bench
        Machine and sensors.
    motor : Motor
        What the observer believes.
    gain : Gain
        Of the observer.
    certificate : Certificate
        Of the gain.
    healthy : Commissioning
        What the cold records taught.
    fast_alarm : CusumSettings
        Alarm on the observer's fault coefficient, tuned on further healthy runs.
    """

    conditions: Conditions
    bench: Bench
    motor: Motor
    gain: Gain
    certificate: Certificate
    healthy: Commissioning
    fast_alarm: CusumSettings


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Tested:
    """One test of a machine.

    Parameters
    ----------
    course : Course
        Supply, load, temperature and fault.
    truth : Truth
        For drawings and scores only.
    signals : FastSignals
        What was measured.
    estimates : Estimates
        Of the observer, about 1 kHz.
    window : Sequences
        Of the last half second.
    verdict : Verdict
        Decision about it.
    known : Verdict
        The same with the true present r_s given, as a thermometer in the winding would give it.
    t : ndarray, shape (w,)
        Ends of sliding windows, s.
    statistic : ndarray, shape (w,)
        Their statistic, standard deviations.
    alarm, fast_alarm : float or None
        First time of the statistic above the threshold, and of the alarm on the fault coefficient, s.
    g_true : complex ndarray, shape (m,)
        Fault coefficient that the true loop gives at the times of the estimates, with the believed impedance.
    """

    course: Course
    truth: Truth
    signals: FastSignals
    estimates: Estimates
    window: Sequences
    verdict: Verdict
    known: Verdict
    t: Array
    statistic: Array
    alarm: float | None
    fast_alarm: float | None
    g_true: Array

    @property
    def onset(self) -> float | None:
        """Time of the fault, s, None without one."""
        return self.course.fault.onset if self.course.fault else None

    @property
    def raw_I2(self) -> float:
        """Amplitude of the negative-sequence current in the last half second, A."""
        return float(raw_negative_sequence(self.window))


def _draw(machine_in: Conditions, test: str, duration: float, rng: Generator) -> Course:
    scenario = Scenario(name="stator study", profile="stator", duration=duration, test=test, supply=machine_in.supply)  # type: ignore[arg-type]
    course = draw_course(scenario, rng)
    if machine_in.connection == "delta":
        # the profile's voltage is that of a winding: the same machine in delta hangs on a lower line voltage
        course = replace(course, supply=replace(course.supply, amplitude=course.supply.amplitude / math.sqrt(3)))
    return course


def observed(
    conditions: Conditions, motor: Motor, gain: Gain, signals: FastSignals, settings: ObserverSettings | None = None
) -> Estimates:
    """Run the observer over a record, a row of the result for a millisecond.

    Parameters
    ----------
    conditions : Conditions
        With the sampling rate.
    motor : Motor
        What is believed.
    gain : Gain
        Of the observer.
    signals : FastSignals
        Voltages and currents.
    settings : ObserverSettings, optional
        Time constants and limits.

    Returns
    -------
    Estimates
    """
    every = max(1, round(conditions.rate / 1000))
    return observe(
        signals.voltage, signals.current, motor, conditions.rate, gain, every=every, settings=settings
    )  # fmt: skip


def set_up(conditions: Conditions, rng: Generator) -> StatorMachine:
    """Draw a machine with its sensors, design its observer, commission it, and tune the fast alarm.

    Parameters
    ----------
    conditions : Conditions
        Where.
    rng : numpy.random.Generator
        All randomness.

    Returns
    -------
    StatorMachine

    Raises
    ------
    InfeasibleError
        If no gain reaches the decay rate.
    """
    motor = belief(conditions.connection)
    gain, certificate = design_gain(motor, conditions.rate, decay_rate=conditions.decay_rate)
    bench = draw_bench(
        "stator", rng, connection=conditions.connection, accuracy=conditions.accuracy, rate=conditions.rate
    )

    def healthy_run(cold: bool) -> Estimates:
        course = _draw(conditions, "drawn", 1.5, rng)
        if cold:
            course = replace(course, slow={**course.slow, "r_s": 1.0, "r_r": 1.0})
        return observed(conditions, motor, gain, read(bench.sensors, play(bench.machine, course), rng))

    windows = [sequences(healthy_run(True), 0.5, 1.5) for _ in range(conditions.records)]
    healthy = commission(windows, motor, Tolerances(gain=0.005 if conditions.accuracy == "A" else 0.01))
    quiet = [fault_signal(healthy_run(False), healthy.reference) for _ in range(_QUIET)]
    return StatorMachine(
        conditions=conditions, bench=bench, motor=motor, gain=gain, certificate=certificate, healthy=healthy,
        fast_alarm=tune_alarm(quiet, _LARGE, margin=2.0),
    )  # fmt: skip


def run_test(
    machine: StatorMachine, rng: Generator, *, gamma: float = 0.0, phase: str = "a", r_f: float = 0.0,
    test: str = "steady", duration: float = 2.0, onset: float = 1.0, unbalance: complex | None = None,
) -> Tested:  # fmt: skip
    """Run a machine once and decide about the last half second.

    Parameters
    ----------
    machine : StatorMachine
        The machine.
    rng : numpy.random.Generator
        All randomness.
    gamma : float
        Shorted share of the turns of a phase (of each of two phases); 0 is healthy.
    phase : str
        "a", "b", "c", or a loop between two phases, "ab", "bc", "ca".
    r_f : float
        Contact resistance, ohm.
    test : {"steady", "ramp", "torque_step", "drawn"}
        What the operating point does.
    duration, onset : float
        Of the run, and of the fault, s.
    unbalance : complex, optional
        Negative sequence of the supply relative to the positive one, in place of the drawn one.

    Returns
    -------
    Tested

    Raises
    ------
    ParameterError
        If an argument is wrong, or the fault comes too late for a decision.
    """
    if phase not in LOOPS:
        raise ParameterError(f"phase = {phase!r}: must be one of {', '.join(LOOPS)}.")
    check_value("run_test", "gamma", gamma, Quantity("-", "shorted share of the turns", 0.0, 0.9))
    if not 0 <= onset <= duration - WINDOW:
        raise ParameterError(f"onset = {onset:g} s in a run of {duration:g} s: must leave {WINDOW:g} s for a decision.")
    conditions = machine.conditions
    course = _draw(conditions, test, duration, rng)
    if gamma > 0:
        course = replace(course, fault=Fault(kind="inter_turn", size=gamma, onset=onset, phase=phase, r_f=r_f))
    if unbalance is not None:
        course = replace(course, negative=complex(unbalance))
    truth = play(machine.bench.machine, course)
    signals = read(machine.bench.sensors, truth, rng)
    estimates = observed(conditions, machine.motor, machine.gain, signals)
    window = sequences(estimates, duration - WINDOW, duration)
    verdict = decide(machine.healthy, window)
    r_s = float(truth["r_s"][-1]) * machine.bench.machine.base.motor.r_s
    moving = sliding(estimates, WINDOW, 1 / _TIMES)
    _, _, statistic = deviation(machine.healthy, moving)
    signal = fault_signal(estimates, machine.healthy.reference)
    fast = run_alarm(signal, machine.fast_alarm).alarms
    above = np.flatnonzero(statistic > THRESHOLD)
    return Tested(
        course=course, truth=truth, signals=signals, estimates=estimates, window=window, verdict=verdict,
        known=decide(machine.healthy, window, r_s=r_s), t=moving.t, statistic=statistic,
        alarm=float(moving.t[above[0]]) if len(above) else None,
        fast_alarm=float(estimates.t[fast[0].sample]) if fast else None,
        g_true=_true_coefficient(machine, truth, course, estimates),
    )  # fmt: skip


def _true_coefficient(machine: StatorMachine, truth: Truth, course: Course, estimates: Estimates) -> Array:
    """Phasor value at the frequency of the supply; the transient after the onset is not in it."""
    found = np.zeros(len(estimates.t), dtype=complex)
    if course.fault is None:
        return found
    plant, fault = machine.bench.machine, course.fault
    motor = plant.base.motor
    loop = fault.size * np.array(LOOPS[fault.phase], dtype=float)
    late = estimates.t >= fault.onset
    hertz = np.interp(estimates.t, truth.t, truth.frequency)
    omega_s = 2 * np.pi * hertz[late]
    r_s = motor.r_s * float(truth["r_s"][-1])
    g = fault_coefficient(
        loop, r_s, motor.L_ls, omega_s, connection=motor.connection, r_f=fault.r_f, kappa_c=plant.kappa_c
    )
    # the observer refers the current of the branch to the impedance that it believes
    believed = stator_impedance(machine.motor.r_s, machine.motor.L_ls, omega_s)
    found[late] = g * np.conj(believed / stator_impedance(r_s, motor.L_ls, omega_s))
    return found


def identification_test(
    machine: StatorMachine, rng: Generator, *, gamma: float, r_f: float = 0.0, repeats: int = 3, pairs: bool = True
) -> tuple[Tested, ...]:
    """Test every phase, and every loop between two phases, each with supplies and loads of its own.

    Parameters
    ----------
    machine : StatorMachine
        The machine.
    rng : numpy.random.Generator
        All randomness.
    gamma : float
        Shorted share of the turns.
    r_f : float
        Contact resistance, ohm.
    repeats : int
        Tests of each.
    pairs : bool
        Whether loops between two phases are tested as well.

    Returns
    -------
    tuple of Tested
        Healthy ones first.

    Raises
    ------
    ParameterError
        If there is no fault to identify, or no repeat.
    """
    check_value("identification_test", "gamma", gamma, Quantity("-", "shorted share of the turns", 0.0, 0.9, True))
    check_value("identification_test", "repeats", repeats, Quantity("-", "tests of each loop", 1, 1000), whole=True)
    loops = (*PHASES, *PAIRS) if pairs else PHASES
    short = {"duration": 1.5, "onset": 0.5, "test": "drawn"}
    found = [run_test(machine, rng, **short) for _ in range(repeats)]  # type: ignore[arg-type]
    found += [
        run_test(machine, rng, gamma=gamma, phase=one, r_f=r_f, **short)  # type: ignore[arg-type]
        for one in loops
        for _ in range(repeats)
    ]  # fmt: skip
    return tuple(found)


def estimation_test(
    machine: StatorMachine, rng: Generator, gammas: Iterable[float], *, phase: str = "a", r_f: float = 0.0,
    test: str = "steady",
) -> tuple[Tested, ...]:  # fmt: skip
    """Test one phase with several sizes, each with a supply, load and temperature of its own.

    Parameters
    ----------
    machine : StatorMachine
        The machine.
    rng : numpy.random.Generator
        All randomness.
    gammas : iterable of float
        Shorted shares of the turns.
    phase : str
        Faulty phase.
    r_f : float
        Contact resistance, ohm.
    test : str
        What the operating point does.

    Returns
    -------
    tuple of Tested
    """
    return tuple(
        run_test(machine, rng, gamma=float(one), phase=phase, r_f=r_f, test=test, duration=1.5, onset=0.5)
        for one in gammas
    )


def unbalance_test(
    machine: StatorMachine, rng: Generator, levels: Iterable[float], *, gamma: float, phase: str = "a"
) -> tuple[tuple[Tested, Tested], ...]:
    """Test the machine healthy and faulty on supplies of given unbalance, the angle drawn.

    Parameters
    ----------
    machine : StatorMachine
        The machine.
    rng : numpy.random.Generator
        All randomness.
    levels : iterable of float
        Negative sequence of the supply relative to the positive one.
    gamma : float
        Shorted share of the turns of the faulty tests.
    phase : str
        Faulty phase.

    Returns
    -------
    tuple of (Tested, Tested)
        Healthy and faulty, for each level.
    """
    found = []
    for level in levels:
        angles = rng.uniform(0, 2 * np.pi, 2)
        pair = [
            run_test(
                machine, rng, gamma=size, phase=phase, duration=1.5, onset=0.5,
                unbalance=complex(level * np.exp(1j * angle)),
            )
            for size, angle in zip((0.0, gamma), angles, strict=True)
        ]  # fmt: skip
        found.append((pair[0], pair[1]))
    return tuple(found)
