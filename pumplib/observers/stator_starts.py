"""Thesis 5.2.3, 5.3: two more tests of the stator observer: switched on during a run-up, and on its own model.

The second is the only result on an identical model; it shows the accuracy of the algorithm, not robustness.
"""

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from pumplib.errors import ParameterError
from pumplib.machines import Profile
from pumplib.motor.short_identify import g_of_gamma
from pumplib.motor.supply import Supply
from pumplib.observers.certificate import Gain
from pumplib.observers.stator import Estimates, StatorObserver
from pumplib.observers.stator_decision import PHASES
from pumplib.observers.stator_design import design_gain
from pumplib.observers.stator_score import belief
from pumplib.observers.stator_study import Conditions, StatorMachine, observed
from pumplib.testbench.data_sheets import ideal_sensors
from pumplib.testbench.faults import Fault
from pumplib.testbench.machine import source
from pumplib.testbench.run import draw_bench, play, read
from pumplib.testbench.scenario import Course
from pumplib.testbench.simulate import simulate_bench

Array = NDArray[Any]


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class RunUp:
    """Observer that is switched on while the machine runs up.

    Parameters
    ----------
    name : str
        Kind of start.
    t : ndarray, shape (m,)
        s.
    omega, omega_s : ndarray, shape (m,)
        True shaft speed, and angular frequency of the supply over the pole pairs, rad/s.
    estimates : Estimates
        Of the observer.
    restarts : int
        How often the observer left a wrong solution.
    """

    name: str
    t: Array
    omega: Array
    omega_s: Array
    estimates: Estimates
    restarts: int

    @property
    def trusted_error(self) -> float:
        """Largest error of the speed in rows that carry no flag, rad/s; NaN if there is none."""
        good = self.estimates.trusted
        return float(np.abs(self.estimates.omega - self.omega)[good].max()) if good.any() else math.nan


def run_up_test(machine: StatorMachine, rng: Generator, *, duration: float = 3.5) -> tuple[RunUp, RunUp]:
    """Start the healthy machine from standstill with the observer running: direct on line, and with a ramp.

    Parameters
    ----------
    machine : StatorMachine
        The machine.
    rng : numpy.random.Generator
        Of the sensors' noise.
    duration : float
        s.

    Returns
    -------
    direct, ramp : RunUp
    """
    conditions = machine.conditions
    amplitude = 325.0 / (math.sqrt(3) if conditions.connection == "delta" else 1.0)
    ramp = Profile(((0.0, 1.0), (0.7 * duration, 50.0)), "lines")
    found = []
    for name, supply in (
        ("direct on line", Supply(amplitude=amplitude)),
        ("ramp of frequency", Supply(amplitude=amplitude, boost=0.06 * amplitude, frequency=ramp)),
    ):
        truth = simulate_bench(machine.bench.machine, supply, duration=duration, slow={"density": 0.8}, negative=0.01)
        signals = read(machine.bench.sensors, truth, rng)
        observer = StatorObserver(
            machine.motor, conditions.rate, machine.gain, every=max(1, round(conditions.rate / 1000))
        )
        estimates = observer.run(signals.voltage, signals.current)
        t = estimates.t
        found.append(
            RunUp(
                name=name, t=t, omega=np.interp(t, truth.t, truth["omega"]),
                omega_s=2 * np.pi * np.interp(t, truth.t, truth.frequency) / machine.motor.z_p,
                estimates=estimates, restarts=observer.restarts,
            )
        )  # fmt: skip
    return found[0], found[1]


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Nominal:
    """Observer on the machine that it believes in, with ideal sensors.

    Parameters
    ----------
    estimates : Estimates
        Of the observer.
    g_error : ndarray, shape (m,)
        3|g_c - true|.
    speed_error : ndarray, shape (m,)
        Estimated less true shaft speed, rad/s.
    omega : ndarray, shape (m,)
        True shaft speed, rad/s.
    onset : float
        s.
    """

    estimates: Estimates
    g_error: Array
    speed_error: Array
    omega: Array
    onset: float

    def worst(self, settled: float = 1.0) -> tuple[float, float]:
        """Largest errors from some time after the fault to the end.

        Parameters
        ----------
        settled : float
            Time allowed after the fault, s.

        Returns
        -------
        g : float
        speed : float
            Relative to the true speed.
        """
        late = self.estimates.t > self.onset + settled
        return float(self.g_error[late].max()), float(np.abs(self.speed_error / self.omega)[late].max())


def nominal_test(
    conditions: Conditions, gain: Gain | None = None, *, gamma: float = 0.02, phase: str = "a", duration: float = 6.0,
    negative: complex = 0.0,
) -> Nominal:  # fmt: skip
    """Test the observer on its own model: no saturation, no spread of parameters, ideal sensors.

    Parameters
    ----------
    conditions : Conditions
        Connection, sampling rate and decay rate; the rest does not matter here.
    gain : Gain, optional
        Of the observer; designed if left out.
    gamma : float
        Shorted share of the turns, from 1.5 s on.
    phase : str
        Faulty phase.
    duration : float
        s.
    negative : complex
        Negative sequence of the supply.

    Returns
    -------
    Nominal

    Raises
    ------
    ParameterError
        If the phase is not one.
    """
    if phase not in PHASES:
        raise ParameterError(f"phase = {phase!r}: must be one of {', '.join(PHASES)}.")
    motor = belief(conditions.connection)
    drawn = draw_bench("stator", np.random.default_rng(0), connection=conditions.connection).machine
    plant = replace(
        drawn, base=replace(drawn.base, motor=motor), saturation="none", sat_0=1.0, sat_6=0.0,
        asymmetry=(0.0, 0.0, 0.0), kappa_c=1.0,
    )  # fmt: skip
    amplitude = 325.0 / (math.sqrt(3) if conditions.connection == "delta" else 1.0)
    onset = 1.5
    course = Course(
        duration=duration, supply=Supply(amplitude=amplitude, frequency=Profile(((0.0, 50.0),), "lines")),
        negative=negative, wave=source(), slow={"density": 1.0},
        fault=Fault(kind="inter_turn", size=gamma, onset=onset, phase=phase) if gamma > 0 else None,
    )  # fmt: skip
    truth = play(plant, course)
    signals = read(ideal_sensors(rate=conditions.rate, pump=False), truth, np.random.default_rng(0))
    if gain is None:
        gain = design_gain(motor, conditions.rate, decay_rate=conditions.decay_rate)[0]
    found = observed(conditions, motor, gain, signals)
    expected = np.exp(2j * np.pi / 3 * 2 * PHASES.index(phase)) * float(g_of_gamma(gamma, conditions.connection)) / 3
    omega = np.interp(found.t, truth.t, truth["omega"])
    return Nominal(
        estimates=found, g_error=3 * np.abs(found.g_c - np.where(found.t > onset, expected, 0.0)),
        speed_error=found.omega - omega, omega=omega, onset=onset,
    )  # fmt: skip
