"""Thesis 3.2, 3.3: what is simulated: a 1.5 kW motor-pump set that starts direct on line on a 400 V grid."""

from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pumplib.machines import PumpSet, load_application, load_motor, load_pump
from pumplib.motor.supply import Supply, grid, terminal_voltage
from pumplib.plant.equations import Coefficients, coefficients

Array = NDArray[Any]

DURATION = 1.0
STEP = 1e-4  # also the recorded step: 10 kHz
SAMPLES = 10_000


def reference_set() -> PumpSet:
    """The reference motor with the multistage pump and its application."""
    return PumpSet(
        motor=load_motor("reference_1k5"),
        pump=load_pump("multistage_1k5"),
        application=load_application("multistage_1k5"),
    )


def supply() -> Supply:
    """Stiff grid, 400 V, 50 Hz."""
    return grid(400)


@dataclass(frozen=True)
class Inputs:
    """Inputs of a kernel at half steps."""

    v_d: Array
    v_q: Array
    K_v: Array
    T_load: Array


def inputs(machine: PumpSet, seconds: float = DURATION) -> Inputs:
    """Inputs of a start of `seconds` as `simulate` gives them to its kernel, no load torque beside the pump's."""
    n = 2 * round(seconds / STEP) + 1
    v, _ = terminal_voltage(supply(), 0.0, STEP / 2, n)
    return Inputs(v.real, v.imag, np.full(n, machine.application.K_v), np.zeros(n))


def varied(machine: PumpSet, count: int, rng: np.random.Generator, spread: float = 0.1) -> list[Coefficients]:
    """Coefficients of `count` sets, every positive real parameter of motor and pump drawn within +-`spread`."""
    found = []
    for _ in range(count):
        parts = {}
        for part in ("motor", "pump"):
            whole = getattr(machine, part)
            new = {
                f.name: value * rng.uniform(1 - spread, 1 + spread)
                for f in fields(whole)
                if isinstance(value := getattr(whole, f.name), float) and not f.name.startswith("rated")
            }
            parts[part] = replace(whole, **new)
        found.append(coefficients(replace(machine, **parts)))
    return found
