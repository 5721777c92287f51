"""Thesis 4.4.2, 5.3, 6.7, 7.4: scenarios as data, and what a bench profile draws anew for machine and run."""

import math
import tomllib
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from pumplib.errors import ParameterError
from pumplib.machines import Motor, Profile, PumpSet, load_application, load_pump
from pumplib.machines.profiles import load_profile, profile_machine
from pumplib.machines.quantity import Choice, Parameters, Quantity
from pumplib.motor.supply import Supply
from pumplib.paths import DATA
from pumplib.testbench.faults import Fault
from pumplib.testbench.kernels import Source
from pumplib.testbench.machine import BenchMachine, source
from pumplib.testbench.nuisances import Nuisance

Array = NDArray[Any]
_TICK = 1e-3
# link of a rectified 460 V grid, so that 325 V with all harmonics stay within the linear range; the carrier is no
# multiple of the sampling rate, so the ripple is sampled at every phase
INVERTER: dict[str, float] = {"dc_link": 650.0, "switching_hz": 4300.0, "dead_time_s": 2e-6}
Test = Literal["drawn", "steady", "ramp", "torque_step", "changes"]


@dataclass(frozen=True, kw_only=True, slots=True)
class Scenario(Parameters):
    """One test on the bench, as data.

    Parameters
    ----------
    name, description : str
        For people.
    profile : {"stator", "pump", "pump_hot"}
        Frozen conditions, `data/bench`.
    duration : float
        s.
    test : str
        Operating-point changes: "steady", "ramp" or "torque_step" (stator; "drawn" takes one of them with equal
        chances), "changes" (pump: speed and valve).
    changes : int
        Number of operating-point changes of a pump run.
    fault : Fault or None
        None is healthy. An onset of a pump fault left at 0 is put into segment `fault_segment`.
    fault_segment : int
        Counted from 1.
    supply : {"grid", "inverter"}
        An inverter brings pulses and dead time in place of the grid's harmonics.
    nuisances : tuple of Nuisance
        Disturbances on top of the profile; in a file a list of tables.
    seeds : tuple of int
        First seeds of the development and of the held-out scoring runs.
    """

    name: str
    description: str = ""
    profile: Annotated[
        Literal["stator", "pump", "pump_hot"], Choice("frozen bench profile", ("stator", "pump", "pump_hot"))
    ]
    duration: Annotated[float, Quantity("s", "duration of the run", 0.0, 1e6, True)]
    test: Annotated[Test, Choice("operating-point changes", ("drawn", "steady", "ramp", "torque_step", "changes"))] = (
        "drawn"
    )
    changes: Annotated[int, Quantity("-", "operating-point changes of a pump run", 0, 1000)] = 12
    fault: Fault | None = None
    fault_segment: Annotated[int, Quantity("-", "segment of the fault's onset, from 1", 1, 1000)] = 7
    supply: Annotated[Literal["grid", "inverter"], Choice("supply", ("grid", "inverter"))] = "grid"
    nuisances: tuple[Nuisance, ...] = ()
    seeds: tuple[int, int] = (0, 100_000)

    def _check_together(self) -> None:
        if self.profile == "stator" and self.test == "changes":
            raise ParameterError(f'Scenario {self.name}: test "changes" belongs to the pump profiles.')
        if self.profile != "stator" and self.test in ("ramp", "torque_step"):
            raise ParameterError(f"Scenario {self.name}: test {self.test!r} belongs to the profile stator.")
        # a change takes up to 20 Hz at 20 Hz/s
        if self.test == "changes" and self.duration / (self.changes + 1) <= 1.0:
            raise ParameterError(
                f"Scenario {self.name}: {self.changes} changes in {self.duration:g} s leave "
                f"{self.duration / (self.changes + 1):.2g} s each: give more than 1 s a change, or fewer changes."
            )


@dataclass(frozen=True, kw_only=True)
class Course:
    """What happens in one run: drawn once, then simulated.

    Parameters
    ----------
    duration : float
        s.
    supply : Supply
        Amplitude and frequency.
    negative : complex
        Negative sequence of the supply.
    wave : Source
        Harmonics.
    slow : dict
        Prescribed quantities of the plant.
    changes : tuple of float
        Times of the operating-point changes, s.
    fault : Fault or None
        With its onset.
    nuisances : tuple of Nuisance
        With their onsets and angles.
    """

    duration: float
    supply: Supply
    negative: complex
    wave: Source
    slow: dict[str, Any] = field(default_factory=dict)
    changes: tuple[float, ...] = ()
    fault: Fault | None = None
    nuisances: tuple[Nuisance, ...] = ()


def load_scenario(name: str | Path) -> Scenario:
    """Load a scenario by its shipped name or from a TOML file.

    Parameters
    ----------
    name : str or Path
        For example ``"pump_clogging"``.

    Returns
    -------
    Scenario

    Raises
    ------
    ParameterError
        If it is not there, a field is unknown, missing, or wrong.
    """
    path = Path(name)
    if path.suffix != ".toml":
        path = DATA / "scenarios" / f"{name}.toml"
    if not path.exists():
        raise ParameterError(f"scenario {str(name)!r}: not found; shipped are {', '.join(scenarios())}.")
    try:
        raw: dict[str, Any] = tomllib.loads(path.read_text(encoding="utf-8"))
    except tomllib.TOMLDecodeError as error:
        raise ParameterError(f"{path.name}: not readable as TOML: {error}") from None
    return scenario_from(raw, path.stem)


def scenario_from(raw: dict[str, Any], name: str) -> Scenario:
    """Build a scenario from a dictionary, as in a TOML file.

    Parameters
    ----------
    raw : dict
        Fields of `Scenario`; ``fault`` is a table with the fields of `Fault`, ``nuisances`` a list of tables with
        those of `Nuisance`.
    name : str
        Name of the scenario.

    Returns
    -------
    Scenario

    Raises
    ------
    ParameterError
        If a field is unknown, missing, or wrong.
    """
    values = dict(raw)
    try:
        if "fault" in values:
            values["fault"] = Fault(**values["fault"])
        if "nuisances" in values:
            values["nuisances"] = tuple(Nuisance(**one) for one in values["nuisances"])
        if "seeds" in values:
            values["seeds"] = tuple(values["seeds"])
        return Scenario(**{"name": name, **values})
    except TypeError as error:
        fields = ", ".join(Scenario.__dataclass_fields__)
        parts = ", ".join(Fault.__dataclass_fields__)
        further = ", ".join(Nuisance.__dataclass_fields__)
        raise ParameterError(
            f"scenario {name}: {error}; fields are {fields}; of a fault {parts}; of a nuisance {further}."
        ) from None


def scenarios() -> tuple[str, ...]:
    """Return the names of the shipped scenarios.

    Returns
    -------
    tuple of str
    """
    return tuple(sorted(path.stem for path in (DATA / "scenarios").glob("*.toml")))


def draw_machine(profile: str, rng: Generator, connection: Literal["Y", "delta"] = "Y") -> BenchMachine:
    """Draw a machine of a profile: what stays the same from commissioning to every test.

    Parameters
    ----------
    profile : str
        "stator", "pump" or "pump_hot".
    rng : Generator
        Source of randomness.
    connection : {"Y", "delta"}
        Of the stator; the profiles say Y, claims may say delta.

    Returns
    -------
    BenchMachine

    Raises
    ------
    ParameterError
        If there is no such profile.
    """
    data = load_profile(profile)
    if profile == "stator":
        return _stator_machine(data, rng, connection)
    truth = data["truth"]
    base = profile_machine(profile)
    base = replace(base, motor=replace(base.motor, connection=connection))
    # 2 % of rated power at rated speed, read as one half iron loss and one half drag: the profile does not say
    rated = 1500.0
    return BenchMachine(
        base=base,
        saturation="rotor",
        sat_0=1.0,
        sat_6=1.0,
        sat_flux=1.6,
        iron_loss=0.01 * rated,
        stray_loss=0.01 * rated,
        loss_voltage=325.0 * (math.sqrt(3) if connection == "delta" else 1.0),
        loss_speed=2 * math.pi * 50.0,
        head_cubic=3e12,
        leakage_gain=truth["healthy_leakage"],
        leakage_lag=truth["leakage_lag_s"],
        valve_lag=0.4,
        check_valve=True,
    )


def _stator_machine(data: dict[str, Any], rng: Generator, connection: Literal["Y", "delta"]) -> BenchMachine:
    truth, believed = data["truth"], data["motor"]
    scatter = rng.uniform(0.95, 1.05, 5)
    electrical = {
        name: believed[name] * f for name, f in zip(("r_s", "r_r", "L_m", "L_ls", "L_lr"), scatter, strict=True)
    }
    motor = Motor(**electrical, z_p=believed["z_p"], connection=connection, J=believed["J"], B=0.0)
    s = rng.uniform(0.1, 0.3)
    size, angle = rng.uniform(0.0, 0.002), rng.uniform(0.0, 2 * math.pi)
    # the load is a torque that grows with the squared speed: 5 N m at 300 rad/s, scaled per run
    idle = replace(
        load_pump("multistage_1k5"), a_t0=5.0 / 300.0**2 / 10, a_t1=0.0, a_t2=0.0, J=0.0, J_Mv=0.0, K_Q=0.0, B=0.0
    )
    return BenchMachine(
        base=PumpSet(motor=motor, pump=idle, application=load_application("multistage_1k5")),
        saturation="main",
        sat_0=1.0 - s,
        sat_6=s,
        sat_flux=1.0,
        asymmetry=tuple(size * math.cos(angle + 2 * math.pi * k / 3) for k in range(3)),
        kappa_c=float(rng.choice(truth["leakage_coupling"])),
    )


def draw_course(scenario: Scenario, rng: Generator) -> Course:
    """Draw what happens in one run of a scenario.

    Parameters
    ----------
    scenario : Scenario
        The test.
    rng : Generator
        Source of randomness.

    Returns
    -------
    Course
    """
    course = _stator_course(scenario, rng) if scenario.profile == "stator" else _pump_course(scenario, rng)
    # drawn last, so that the same seed gives the same run without them
    nuisances = tuple(_drawn(one, scenario.duration, rng) for one in scenario.nuisances)
    wave = source(**INVERTER) if scenario.supply == "inverter" else course.wave
    return replace(course, nuisances=nuisances, wave=wave)


def _drawn(nuisance: Nuisance, duration: float, rng: Generator) -> Nuisance:
    onset, angle = rng.uniform(0.1, 0.5) * duration, rng.uniform(0, 2 * math.pi)
    return replace(
        nuisance,
        onset=nuisance.onset or _tick(onset),
        angle=angle if math.isnan(nuisance.angle) else nuisance.angle,
    )


def _stator_course(scenario: Scenario, rng: Generator) -> Course:
    duration = scenario.duration
    kind = scenario.test
    if kind == "drawn":
        kind = ("steady", "ramp", "torque_step")[int(rng.integers(3))]
    hertz, load = rng.uniform(30.0, 50.0), rng.uniform(0.6, 1.1)
    start = _tick(rng.uniform(0.2, 0.7) * duration)
    frequency, torque = Profile(((0.0, hertz),), "lines"), Profile(((0.0, load),))
    changes: tuple[float, ...] = (start,)
    if kind == "ramp":
        slope = 10.0 * rng.choice((-1.0, 1.0))
        end = _tick(min(duration, start + 1.0))
        last = float(np.clip(hertz + slope * (end - start), 30.0, 50.0))
        end = _ramp_end(start, abs(last - hertz) / 10.0)
        frequency = Profile(((0.0, hertz), (start, hertz), (end, last)), "lines")
    elif kind == "torque_step":
        torque = Profile(((0.0, load), (start, load * rng.uniform(0.5, 1.5))))
    else:
        changes = ()
    hot = rng.uniform(1.0, 1.2)
    negative = rng.uniform(0.01, 0.03) * np.exp(1j * rng.uniform(0, 2 * math.pi))
    fifth = rng.uniform(0.005, 0.02) * np.exp(1j * rng.uniform(0, 2 * math.pi))
    seventh = rng.uniform(0.003, 0.015) * np.exp(1j * rng.uniform(0, 2 * math.pi))
    slow: dict[str, Any] = {"density": torque, "r_s": hot, "r_r": hot}
    return Course(
        duration=duration,
        supply=Supply(amplitude=325.0, frequency=frequency, phase=rng.uniform(0, 2 * math.pi)),
        negative=complex(negative),
        wave=source(fifth=fifth, seventh=seventh),
        slow=slow,
        changes=changes,
        fault=scenario.fault,
    )


def _pump_course(scenario: Scenario, rng: Generator) -> Course:
    duration, n = scenario.duration, scenario.changes
    count = 0 if scenario.test == "steady" else n
    length = duration / (count + 1)
    times = tuple(_tick(length * k) for k in range(1, count + 1))
    hertz = rng.uniform(30.0, 50.0, count + 1)
    valve = np.exp(rng.uniform(math.log(1.25e11), math.log(6e11), count + 1))
    points = [(0.0, float(hertz[0]))]
    for start, before, after in zip(times, hertz, hertz[1:], strict=False):
        # 20 Hz/s; a change in both quantities at once, as the profile's twelve changes of speed and valve
        points += [
            (start, float(before)),
            (_ramp_end(start, abs(after - before) / 20.0), float(after)),
        ]
    openings = tuple(zip((0.0, *times), map(float, valve), strict=True))
    drift = rng.uniform(-0.04, 0.08)
    warm: float | Profile = 1.0 + drift
    rotor: float | Profile = 1.0
    if scenario.profile == "pump_hot":
        t = np.linspace(0.0, duration, 34)
        curve = 1.0 + 0.2 * (1 - np.exp(-3 * t / duration)) / (1 - math.exp(-3))
        warm = rotor = Profile(tuple(zip(map(float, t), map(float, curve), strict=True)), "lines")
    fault = scenario.fault
    if fault is not None and fault.onset == 0.0:
        begin = length * (min(scenario.fault_segment, count + 1) - 1)
        fault = replace(fault, onset=_tick(begin + rng.uniform(0.3, 0.7) * length))
    return Course(
        duration=duration,
        supply=Supply(
            amplitude=325.0,
            boost=3.0,
            frequency=Profile(tuple(points), "lines"),
            phase=rng.uniform(0, 2 * math.pi),
        ),
        negative=0.0,
        wave=source(),
        slow={"valve": Profile(openings), "r_s": warm, "r_r": rotor},
        changes=times,
        fault=fault,
    )


def _tick(t: float) -> float:
    return round(t / _TICK) * _TICK


def _ramp_end(start: float, length: float) -> float:
    """End of a ramp on the next millisecond, so that it is never steeper than it may be."""
    return start + max(1, math.ceil(length / _TICK)) * _TICK
