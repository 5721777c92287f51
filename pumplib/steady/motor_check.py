"""Thesis 3.2, 7.2: sets for speed and shaft power of a motor beside its measured load points (beyond the thesis).

The table states voltage and frequency once for all points and rounds the power factor to three digits. The default
bounds say this: 0.5 % for the voltage and 0.05 % for the frequency, which nobody read point by point (0.05 % is the
usual band of a large grid, 25 mHz), 0.2 % for the current (instruments of accuracy class 0.2) and 0.0012 rad for the
angle (half a digit of the power factor at full load). With the voltage to 0.2 % as well, the lightest point, where
half of the power taken is loss and the place of the core loss matters, lies 0.2 % outside its set.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pumplib.machines import Motor, MotorLosses
from pumplib.motor.load_points import LoadPoints
from pumplib.steady.enclose import Enclosure, Method, set_model
from pumplib.steady.relations import motor_relations, parameter_values
from pumplib.steady.sets import MeasurementErrors, box

Array = NDArray[Any]
TABLE_ERRORS = MeasurementErrors(
    relative={"V_rms": 0.005, "I_rms": 0.002, "omega_e": 5e-4}, absolute={"phi": 0.0012}
)  # fmt: skip


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class MotorCheck:
    """Sets beside the measured values of the loaded points.

    Parameters
    ----------
    points : LoadPoints
        The measurement.
    enclosure : Enclosure
        Sets of omega, torque_shaft, power_shaft at the loaded points.
    omega, power_shaft : ndarray, shape (n,)
        Measured speed, rad/s, and shaft power, W, at the loaded points.
    """

    points: LoadPoints
    enclosure: Enclosure
    omega: Array
    power_shaft: Array

    @property
    def contained(self) -> Array:
        """Whether speed and shaft power of a point both lie in their sets, shape (n,)."""
        e = self.enclosure
        speed = (e.lo[:, 0] <= self.omega) & (self.omega <= e.hi[:, 0])
        power = (e.lo[:, 2] <= self.power_shaft) & (self.power_shaft <= e.hi[:, 2])
        return np.asarray(speed & power)

    @property
    def power_width(self) -> Array:
        """Width of the set of the shaft power over the measured one, shape (n,)."""
        return np.asarray(self.enclosure.width[:, 2] / self.power_shaft)


def motor_check(
    motor: Motor,
    losses: MotorLosses | None,
    points: LoadPoints,
    *,
    voltage_line_rms: float,
    frequency_hz: float,
    relative: float = 0.02,
    errors: MeasurementErrors = TABLE_ERRORS,
    method: Method = "affine",
) -> MotorCheck:
    """Enclose speed and shaft power of every loaded point.

    Parameters
    ----------
    motor : Motor
        The motor.
    losses : MotorLosses or None
        Its losses; the core loss sits behind r_s.
    points : LoadPoints
        The measurement.
    voltage_line_rms, frequency_hz : float
        Supply, V line to line and Hz.
    relative : float
        Half width of the box of all parameters, -.
    errors : MeasurementErrors
        Bounds of the measurement.
    method : str
        Of `pumplib.steady.enclose.METHODS`.

    Returns
    -------
    MotorCheck

    References
    ----------
    Thesis 7.3 (reconstructed); the comparison is ours.
    """
    loaded = points.loaded
    n = int(loaded.sum())
    model = set_model(motor_relations(motor), box(parameter_values(motor, losses=losses), relative=relative), errors)
    signals = {
        "V_rms": np.full(n, voltage_line_rms / math.sqrt(3)),
        "I_rms": points.current_line_rms[loaded],
        "omega_e": np.full(n, 2 * math.pi * frequency_hz),
        "phi": np.arccos(points.power_factor[loaded]),
    }
    return MotorCheck(
        points=points,
        enclosure=model.enclose(signals, method),
        omega=points.omega[loaded],
        power_shaft=points.power_shaft[loaded],
    )
