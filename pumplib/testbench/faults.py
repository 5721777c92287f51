"""Thesis 4.3.3, 5.3, 6.3.2, 6.7, 7.4: the bench's fault catalogue: which physics a fault changes, how much, when."""

from dataclasses import dataclass
from typing import Annotated, Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from pumplib.errors import ParameterError
from pumplib.machines.quantity import Choice, Parameters, Quantity

Array = NDArray[Any]
Kind = Literal[
    "inter_turn", "ground", "clogging", "friction", "leakage", "cavitation", "dry_running", "outlet_leak",
    "inlet_obstruction", "bearing", "blocked_rotor",
]  # fmt: skip
KINDS: tuple[str, ...] = get_args(Kind)
# fault -> quantity of the plant, unit and allowed size
SIZES: dict[str, tuple[str, str, float, float]] = {
    "inter_turn": ("gamma", "shorted share of the turns", 1e-4, 0.9),
    "ground": ("G_ground", "conductance to ground, S", 0.0, 1e3),
    "clogging": ("K_f", "Pa s2/m6", 0.0, 1e14),
    "friction": ("dB", "N m s", 0.0, 1.0),
    "leakage": ("K_l", "m3/s/sqrt(Pa)", 0.0, 1e-4),
    "cavitation": ("f_c", "share of head", 0.0, 0.3499),
    "dry_running": ("f_d", "share of head", 0.35, 1.0),
    "outlet_leak": ("K_ext", "m3/s/sqrt(Pa)", 0.0, 1e-4),
    "inlet_obstruction": ("K_in", "Pa s2/m6", 0.0, 1e14),
    "bearing": ("bearing", "torque ripple, N m", 0.0, 100.0),
    "blocked_rotor": ("block", "brake, 1/s", 0.0, 1e4),
}
PHASES = {"a": (1, 0, 0), "b": (0, 1, 0), "c": (0, 0, 1), "ab": (1, -1, 0), "bc": (0, 1, -1), "ca": (-1, 0, 1)}


@dataclass(frozen=True, kw_only=True, slots=True)
class Fault(Parameters):
    """One fault with its course in time; it acts on the physics only.

    Parameters
    ----------
    kind : str
        One of `KINDS`.
    size : float
        In the unit of `SIZES`; for a short between two phases the share of the turns of each.
    onset : float
        s.
    shape : {"step", "ramp", "intermittent"}
        A ramp reaches the size after `ramp`; an intermittent fault is there for `share` of every `period`.
    ramp, period : float
        s.
    share : float
        Part of the period with the fault.
    phase : str
        Of an inter-turn short: "a", "b", "c", or between two phases "ab", "bc", "ca".
    r_f : float
        Contact resistance of an inter-turn short, ohm.
    ripple : float
        Torque ripple at shaft frequency that a rub brings along with its friction, N m.
    drag : float
        Friction that a bearing fault brings along with its torque ripple, N m s.
    """

    kind: Annotated[Kind, Choice("fault", KINDS)]
    size: Annotated[float, Quantity("-", "size of the fault in its own unit", 0.0, 1e15)]
    onset: Annotated[float, Quantity("s", "time of the onset", 0.0, 1e9)] = 0.0
    shape: Annotated[
        Literal["step", "ramp", "intermittent"], Choice("course in time", ("step", "ramp", "intermittent"))
    ] = "step"
    ramp: Annotated[float, Quantity("s", "duration of the ramp", 0.0, 1e9, True)] = 10.0
    period: Annotated[float, Quantity("s", "period of an intermittent fault", 0.0, 1e9, True)] = 1.0
    share: Annotated[float, Quantity("-", "part of the period with the fault", 0.0, 1.0)] = 0.5
    phase: Annotated[str, Choice("faulty phase", tuple(PHASES))] = "a"
    r_f: Annotated[float, Quantity("ohm", "contact resistance", 0.0, 1e6)] = 0.0
    ripple: Annotated[float, Quantity("N m", "torque ripple of a rub", 0.0, 100.0)] = 0.0
    drag: Annotated[float, Quantity("N m s", "friction of a damaged bearing", 0.0, 1.0)] = 0.0

    def _check_together(self) -> None:
        quantity, unit, low, high = SIZES[self.kind]
        if not low <= self.size <= high:
            raise ParameterError(
                f"Fault.size = {self.size:g} for {self.kind} ({quantity}, {unit}): must be {low:g} to {high:g}."
            )

        for name, value, owner in (("ripple", self.ripple, "friction"), ("drag", self.drag, "bearing")):
            if value > 0 and self.kind != owner:
                raise ParameterError(f"Fault.{name} = {value:g}: belongs to {owner}, not to {self.kind}; leave it out.")

    def course(self, t: Array) -> Array:
        """Share of the full size over time.

        Parameters
        ----------
        t : ndarray, shape (n,)
            Times, s.

        Returns
        -------
        ndarray, shape (n,)
            0..1.
        """
        # half a millisecond of tolerance: an onset of 0.5 s is the tick 500
        after = t - self.onset + 5e-5
        if self.shape == "ramp":
            return np.clip((t - self.onset) / self.ramp, 0.0, 1.0)
        if self.shape == "intermittent":
            return np.where(after >= 0, np.mod(after, self.period) < self.share * self.period, False).astype(float)
        return (after >= 0).astype(float)

    def columns(self, t: Array) -> dict[str, Array]:
        """Quantities of the plant that the fault changes.

        Parameters
        ----------
        t : ndarray, shape (n,)
            Times of the ticks, s.

        Returns
        -------
        dict of str to ndarray, shape (n,)
            By the names of `pumplib.testbench.plant.Slow`.
        """
        size = self.size * self.course(t)
        if self.kind != "inter_turn":
            more = {"bearing": self.ripple, "dB": self.drag}
            together = {name: value * self.course(t) for name, value in more.items() if value > 0}
            return {SIZES[self.kind][0]: size, **together}
        signs = PHASES[self.phase]
        names = ("gamma_a", "gamma_b", "gamma_c")
        loop = {name: sign * size for name, sign in zip(names, signs, strict=True) if sign}
        return {**loop, "r_f": np.full(len(t), self.r_f)}
