"""Thesis 4.3, 4.4: faults and disturbing events of the FMEA tables as changes of the bench's physics.

Entries that the bench can act out; a fault changes physical quantities only, never a signal. Sizes are those of
clear faults, above the thresholds of the signal events.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pumplib.errors import ParameterError
from pumplib.motor.supply import Supply
from pumplib.testbench.machine import BenchMachine
from pumplib.testbench.simulate import Truth, simulate_bench, start_state

Array = NDArray[Any]
SETTLE, WINDOW = 0.7, 0.9
"""Time that passes before the record begins, and its length, s; the motor's observer settles within it."""
AMPLITUDE, RATED_HZ, BOOST = 325.0, 50.0, 3.0

FAULTS: dict[str, dict[str, float]] = {
    "EM1": {"gamma_a": 0.05},
    "EM2": {"gamma_a": 0.04, "gamma_b": -0.04},
    "EM3": {"G_ground": 5e-3},
    "MM1": {"dB": 5e-4, "bearing": 0.2},
    "MP1": {"dB": 5e-4, "bearing": 0.2},
    "MM2": {"dB": 1e-3, "bearing": 0.1},
    "MP2": {"dB": 1e-3, "bearing": 0.1},
    "HY1": {"K_f": 2e10},
    "HY2": {"K_l": 2.4e-7},
    "MP3": {"K_ext": 2.4e-7},
    "HY3": {"f_c": 0.1},
    "HY4": {"f_d": 0.9},
    "IN1": {"K_in": 5e10},
}
"""Fault of the tables -> quantities of the plant (`pumplib.testbench.plant.Slow`)."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Disturbance:
    """A disturbing event as a change of operating conditions.

    Parameters
    ----------
    valve, voltage, frequency, density, resistance : float
        Factors; the voltage of the drive follows the frequency.
    unbalance : float
        Negative sequence, share of the fundamental.
    source : float
        Pressure at the inlet, Pa.
    """

    valve: float = 1.0
    voltage: float = 1.0
    frequency: float = 1.0
    density: float = 1.0
    resistance: float = 1.0
    unbalance: float = 0.0
    source: float = 0.0


DISTURBANCES: dict[str, Disturbance] = {
    "d_load+": Disturbance(valve=1.6),
    "d_load-": Disturbance(valve=0.65),
    "d_V+": Disturbance(voltage=1.08),
    "d_V-": Disturbance(voltage=0.92),
    "d_fs+": Disturbance(frequency=1.06),
    "d_fs-": Disturbance(frequency=0.94),
    "d_unb": Disturbance(unbalance=0.025),
    "d_src+": Disturbance(source=3e4),
    "d_src-": Disturbance(source=-3e4),
    "d_amb": Disturbance(resistance=1.15),
    "d_liq+": Disturbance(density=1.08),
    "d_liq-": Disturbance(density=0.92),
}
"""Disturbing event of the tables -> operating conditions."""


@dataclass(frozen=True, kw_only=True, slots=True)
class OperatingPoint:
    """Supply and valve of one steady state.

    Parameters
    ----------
    hertz : float
        Supply frequency; the voltage follows in proportion.
    valve : float
        Pa s2/m6.
    """

    hertz: float
    valve: float


def draw_points(n: int, rng: np.random.Generator) -> tuple[OperatingPoint, ...]:
    """Operating points of the bench profile `pump`.

    Parameters
    ----------
    n : int
        Number.
    rng : Generator
        Source of randomness.

    Returns
    -------
    tuple of OperatingPoint
    """
    # a disturbing event moves the point further, so the range is kept a little inside the profile's
    hertz = rng.uniform(33.0, 47.0, n)
    valve = np.exp(rng.uniform(math.log(1.6e11), math.log(4.5e11), n))
    return tuple(OperatingPoint(hertz=float(f), valve=float(v)) for f, v in zip(hertz, valve, strict=True))


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class SteadyState:
    """The end of a run at constant conditions, without sensors.

    Parameters
    ----------
    truth : Truth
        Signals of the plant over the last `WINDOW` seconds.
    hertz, source : float
        Supply frequency, Hz, and pressure of the source, Pa: what the controller knows it asks for.
    inlet_loss : float
        Obstruction of the inlet, Pa s2/m6, for the pressure at the inlet flange.
    """

    truth: Truth
    hertz: float
    source: float
    inlet_loss: float = 0.0


def steady_state(
    machine: BenchMachine,
    point: OperatingPoint,
    disturbance: Disturbance,
    fault: Mapping[str, float],
    drift: float = 0.0,
) -> SteadyState:
    """Let the bench settle.

    Parameters
    ----------
    machine : BenchMachine
        The machine.
    point : OperatingPoint
        Supply and valve.
    disturbance : Disturbance
        Operating conditions.
    fault : mapping
        Quantities of the plant, see `FAULTS`.
    drift : float
        Relative change of the stator resistance that no event announces.

    Returns
    -------
    SteadyState

    Raises
    ------
    ParameterError
        If a fault or condition is impossible.
    """
    unknown = set(fault) & {"valve", "r_s", "r_r", "density", "p_source"}
    if unknown:
        raise ParameterError(f"fault {sorted(unknown)}: these are operating conditions; give them as a disturbance.")
    hertz = point.hertz * disturbance.frequency
    # a V/f drive: the voltage follows the frequency, so that a frequency event does not change the flux
    amplitude = (BOOST + (AMPLITUDE - BOOST) * hertz / RATED_HZ) * disturbance.voltage
    valve = point.valve * disturbance.valve * disturbance.density
    supply = Supply(amplitude=amplitude, rated_frequency=hertz)
    slow: dict[str, Any] = {
        "valve": valve, "density": disturbance.density, "p_source": disturbance.source,
        "r_s": disturbance.resistance * (1.0 + drift), "r_r": disturbance.resistance, **fault,
    }  # fmt: skip
    settled = simulate_bench(
        machine, supply, duration=SETTLE, slow=slow, negative=disturbance.unbalance,
        initial=start_state(machine, amplitude, hertz, valve),
    )  # fmt: skip
    angle = float(np.mod(2 * np.pi * hertz * SETTLE, 2 * np.pi))
    later = Supply(amplitude=amplitude, rated_frequency=hertz, phase=angle)
    truth = simulate_bench(
        machine, later, duration=WINDOW, slow=slow, negative=disturbance.unbalance,
        initial=settled.state, extra=settled.extra,
    )  # fmt: skip
    return SteadyState(truth=truth, hertz=hertz, source=disturbance.source, inlet_loss=float(fault.get("K_in", 0.0)))
