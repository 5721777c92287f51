"""Thesis 2.4, 4.2.2: disturbances of supply, liquid and surroundings that no detector may take for a fault."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from pumplib.errors import ParameterError
from pumplib.machines.profile import Profile
from pumplib.machines.quantity import Choice, Parameters, Quantity
from pumplib.testbench.simulate import column

Array = NDArray[Any]
Kind = Literal["voltage", "unbalance", "source_pressure", "density", "temperature", "load"]
KINDS: tuple[str, ...] = get_args(Kind)
# nuisance -> meaning of the size with its unit, lowest and highest
LIMITS: dict[str, tuple[str, float, float]] = {
    "voltage": ("relative change of the supply's amplitude", -0.5, 0.5),
    "unbalance": ("negative sequence added, share of the fundamental", 0.0, 0.3),
    "source_pressure": ("change of the pressure at the inlet, Pa", -1e6, 1e6),
    "density": ("relative change of the liquid's density", -0.5, 1.0),
    "temperature": ("relative change of the winding resistances", -0.5, 1.0),
    "load": ("torque on the shaft beside the pump's, N m", -1e3, 1e3),
}


@dataclass(frozen=True, kw_only=True, slots=True)
class Nuisance(Parameters):
    """One disturbance with its course in time; it acts on the physics, as faults do.

    Parameters
    ----------
    kind : str
        One of `KINDS`.
    size : float
        In the unit of `LIMITS`.
    shape : {"step", "ramp"}
        A ramp from the onset to the end of the run is a drift.
    onset : float
        s; 0 draws it from the first half of the run.
    angle : float
        Of an added negative sequence, rad; NaN draws it.
    """

    kind: Annotated[Kind, Choice("disturbance", KINDS)]
    size: Annotated[float, Quantity("-", "size in the unit of the disturbance", -1e6, 1e6)]
    shape: Annotated[Literal["step", "ramp"], Choice("course in time", ("step", "ramp"))] = "step"
    onset: Annotated[float, Quantity("s", "time of the onset", 0.0, 1e9)] = 0.0
    angle: float = math.nan

    def _check_together(self) -> None:
        meaning, low, high = LIMITS[self.kind]
        if not low <= self.size <= high:
            raise ParameterError(
                f"Nuisance.size = {self.size:g} for {self.kind} ({meaning}): must be {low:g} to {high:g}."
            )
        if math.isinf(self.angle):
            raise ParameterError("Nuisance.angle = inf rad: give an angle, or leave it out to have it drawn.")

    def course(self, t: Array) -> Array:
        """Share of the full size over time.

        Parameters
        ----------
        t : ndarray, shape (n,)
            Times of the ticks of the whole run, s.

        Returns
        -------
        ndarray, shape (n,)
            0..1.
        """
        if self.shape == "ramp":
            return np.clip((t - self.onset) / max(float(t[-1]) - self.onset, 1e-3), 0.0, 1.0)
        return (t - self.onset + 5e-5 >= 0).astype(float)


def disturbed(
    nuisances: tuple[Nuisance, ...], slow: Mapping[str, float | Profile | Array], negative: complex, t: Array
) -> tuple[dict[str, float | Profile | Array], Array, Array]:
    """Put disturbances on top of what is prescribed.

    Parameters
    ----------
    nuisances : tuple of Nuisance
        With onset and angle.
    slow : mapping
        Prescribed quantities of the plant.
    negative : complex
        Negative sequence of the supply without them.
    t : ndarray, shape (n,)
        Times of the ticks, s.

    Returns
    -------
    slow : dict
        Prescribed quantities with the disturbances.
    negative : complex ndarray, shape (n,)
        Negative sequence.
    level : ndarray, shape (n,)
        Factor of the supply's amplitude.
    """
    quantities = dict(slow)
    sequence, level = np.full(len(t), negative, dtype=complex), np.ones(len(t))

    def change(name: str, neutral: float, size: Array, relative: bool) -> None:
        before = column(quantities.get(name, neutral), name, t)
        quantities[name] = before * (1.0 + size) if relative else before + size

    for one in nuisances:
        size = one.size * one.course(t)
        match one.kind:
            case "voltage":
                level = level * (1.0 + size)
            case "unbalance":
                sequence = sequence + size * np.exp(1j * one.angle)
            case "source_pressure":
                change("p_source", 0.0, size, relative=False)
            case "load":
                change("load", 0.0, size, relative=False)
            case "density":
                change("density", 1.0, size, relative=True)
                if "valve" in quantities:  # what the valve takes of the pressure is proportional to the density too
                    change("valve", 0.0, size, relative=True)
            case "temperature":
                change("r_s", 1.0, size, relative=True)
                change("r_r", 1.0, size, relative=True)
    return quantities, sequence, level
