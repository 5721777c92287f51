"""Thesis 4.4.2, 5.3, 6.7, 7.4: run a scenario: draw, simulate, measure; the truth is kept apart for scoring."""

from dataclasses import dataclass, replace
from typing import Annotated, Any, Literal

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from pumplib.errors import ParameterError
from pumplib.machines.profile import Profile
from pumplib.machines.profiles import load_profile
from pumplib.machines.quantity import Parameters, Quantity
from pumplib.testbench.data_sheets import sensor_set
from pumplib.testbench.machine import BenchMachine
from pumplib.testbench.measurement import measure
from pumplib.testbench.nuisances import disturbed
from pumplib.testbench.scenario import Course, Scenario, draw_course, draw_machine, load_scenario
from pumplib.testbench.sensors import CHANNELS, FastSignals, SensorFault, SensorSet
from pumplib.testbench.simulate import STEP, TICK_SECONDS, Truth, simulate_bench, start_state
from pumplib.testbench.slow import SlowSignals, slow_signals

Array = NDArray[Any]
_SETTLE = 0.5  # s that pass before the record begins, so that it starts in a steady state


@dataclass(frozen=True, kw_only=True, slots=True)
class Bench:
    """What belongs to one machine and stays from commissioning to every test.

    Parameters
    ----------
    profile : str
        Frozen conditions it was drawn from.
    machine : BenchMachine
        The machine.
    sensors : SensorSet
        Its sensors with their gains and biases.
    """

    profile: str
    machine: BenchMachine
    sensors: SensorSet


@dataclass(frozen=True, kw_only=True, slots=True)
class Extras(Parameters):
    """What the bench can do beyond the frozen profiles; off by default.

    Parameters
    ----------
    cavitation_noise : float
        Standard deviation of the broad-band pressure noise per unit of f_c, Pa.
    """

    cavitation_noise: Annotated[float, Quantity("Pa", "pressure noise per unit of cavitation", 0.0, 1e8)] = 0.0


@dataclass(frozen=True, kw_only=True, eq=False)
class Run:
    """One run on the bench.

    Parameters
    ----------
    scenario : Scenario
        What was asked for.
    course : Course
        What was drawn: operating points, supply, onset of the fault.
    fast : FastSignals
        Measured: voltages and currents at 10 kHz, pressure and flow at 1 kHz.
    truth : Truth
        For scoring only; no observer may see it.
    """

    scenario: Scenario
    course: Course
    fast: FastSignals
    truth: Truth

    def slow(self, window: float = 1.0, step: float = 1.0) -> SlowSignals:
        """Slow signals as a cheap controller sees them.

        Parameters
        ----------
        window, step : float
            Length of a window and distance of two, s.

        Returns
        -------
        SlowSignals
            V_rms, I_rms, omega_e, phi, H, Q.
        """
        return slow_signals(self.fast, window=window, step=step)


def draw_bench(
    profile: str,
    rng: Generator,
    *,
    connection: Literal["Y", "delta"] = "Y",
    accuracy: Literal["A", "B"] | None = None,
    rate: float | None = None,
) -> Bench:
    """Draw a machine with its sensors.

    Parameters
    ----------
    profile : str
        "stator", "pump" or "pump_hot".
    rng : Generator
        Randomness of the machine.
    connection : {"Y", "delta"}
        Of the stator.
    accuracy : {"A", "B"}, optional
        Class of the electrical sensors in place of the profile's.
    rate : float, optional
        Rate of the electrical sensors in place of the profile's, Hz.

    Returns
    -------
    Bench

    Raises
    ------
    ParameterError
        If there is no such profile.
    """
    machine = draw_machine(profile, rng, connection)
    return Bench(
        profile=profile, machine=machine, sensors=sensor_set(load_profile(profile), rng, accuracy=accuracy, rate=rate)
    )


def run(
    scenario: Scenario | str,
    rng: Generator,
    bench: Bench | None = None,
    *,
    extras: Extras | None = None,
    sensor_faults: dict[str, SensorFault] | None = None,
) -> Run:
    """Run a scenario.

    Parameters
    ----------
    scenario : Scenario or str
        The test, or the name of a shipped one.
    rng : Generator
        All randomness; the same generator state gives the same run.
    bench : Bench, optional
        The machine; drawn from `rng` if left out.
    extras : Extras, optional
        What goes beyond the profile.
    sensor_faults : dict, optional
        By channel, "v_a" ... "i_c", "H", "Q".

    Returns
    -------
    Run

    Raises
    ------
    ParameterError
        If the scenario's profile is not the bench's, or a quantity is impossible.
    SimulationError
        If the plant leaves the finite numbers.
    """
    scenario = load_scenario(scenario) if isinstance(scenario, str) else scenario
    bench = bench or draw_bench(scenario.profile, rng)
    if bench.profile != scenario.profile:
        raise ParameterError(
            f"scenario {scenario.name} needs profile {scenario.profile!r}, the bench was drawn from {bench.profile!r}."
        )
    course = draw_course(scenario, rng)
    truth = play(bench.machine, course)
    return Run(
        scenario=scenario,
        course=course,
        fast=read(bench.sensors, truth, rng, extras or Extras(), sensor_faults),
        truth=truth,
    )


def play(machine: BenchMachine, course: Course) -> Truth:
    """Simulate a drawn course from its steady state.

    Parameters
    ----------
    machine : BenchMachine
        The machine.
    course : Course
        What happens.

    Returns
    -------
    Truth

    Raises
    ------
    ParameterError
        If a quantity is impossible.
    SimulationError
        If the plant leaves the finite numbers.
    """
    supply, slow = course.supply, dict(course.slow)
    hertz = supply.rated_frequency if supply.frequency is None else float(supply.frequency.values[0])
    amplitude = min(supply.boost + (supply.amplitude - supply.boost) * hertz / supply.rated_frequency, supply.amplitude)
    first = {name: float(v.values[0]) if isinstance(v, Profile) else float(v) for name, v in slow.items()}
    valve = first.get("valve", machine.base.application.K_v)
    # the angle of the supply goes on without a jump into the record
    before = replace(
        supply,
        frequency=Profile(((0.0, hertz),), "lines"),
        phase=float(np.remainder(supply.phase - 2 * np.pi * hertz * _SETTLE, 2 * np.pi)),
    )
    settled = simulate_bench(
        machine,
        before,
        duration=_SETTLE,
        slow=first,
        negative=course.negative,
        wave=course.wave,
        initial=start_state(machine, amplitude, hertz, valve),
    )
    t = TICK_SECONDS * np.arange(round(course.duration / TICK_SECONDS))
    slow, negative, level = disturbed(course.nuisances, slow, course.negative, t)
    if course.fault is not None:
        slow |= course.fault.columns(t)
    return simulate_bench(
        machine,
        supply,
        duration=course.duration,
        slow=slow,
        negative=negative,
        level=level,
        wave=course.wave,
        initial=settled.state,
        extra=settled.extra,
    )


def read(
    sensors: SensorSet,
    truth: Truth,
    rng: Generator,
    extras: Extras | None = None,
    faults: dict[str, SensorFault] | None = None,
) -> FastSignals:
    """Measure the true signals.

    Parameters
    ----------
    sensors : SensorSet
        The machine's sensors.
    truth : Truth
        True signals.
    rng : Generator
        Noise of the run.
    extras : Extras, optional
        What goes beyond the profile.
    faults : dict, optional
        Sensor faults by channel, "v_a" ... "i_c", "H", "Q".

    Returns
    -------
    FastSignals

    Raises
    ------
    ParameterError
        If a faulty channel does not exist.
    """
    groups: tuple[dict[int, SensorFault], dict[int, SensorFault]] = ({}, {})
    for name, fault in (faults or {}).items():
        if name not in sensors.channels:
            raise ParameterError(
                f"sensor fault on {name!r}: this bench has the channels {', '.join(sensors.channels)}."
            )
        place = CHANNELS.index(name)
        groups[place // 6][place % 6] = fault
    electrical, _ = measure(sensors.electrical, truth.fast[:, :6], STEP, rng, faults=groups[0])
    H = Q = None
    rate = 1 / TICK_SECONDS
    if sensors.pressure is not None and sensors.flow is not None:
        pressure = truth["H_p"]
        if extras is not None and extras.cavitation_noise > 0:
            pressure = pressure + extras.cavitation_noise * truth["f_c"] * rng.standard_normal(len(pressure))
        signals = np.stack((pressure, truth["Q"]), 1)
        both, _ = measure(sensors.hydraulic, signals, TICK_SECONDS, rng, faults=groups[1])
        H, Q, rate = both[:, 0], both[:, 1], sensors.pressure.rate or rate
    return FastSignals(
        rate=sensors.electrical[0].rate or 1 / STEP,
        voltage=electrical[:, :3],
        current=electrical[:, 3:],
        hydraulic_rate=rate,
        H=H,
        Q=Q,
    )
