"""Thesis 3.2.3, 3.2.4: measured load points of a motor against the steady-state model (beyond the thesis).

Nothing is fitted: the parameters come from the motor's file, the load points only score them.
"""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pumplib.errors import DataError
from pumplib.machines import Motor, MotorLosses, from_si, to_si
from pumplib.motor.circuit import CoreAt, OperatingPoint, from_electrical, from_torque
from pumplib.tables import read_table

Array = NDArray[Any]
_COLUMNS = ("shaft_power_W", "current_A", "speed_rpm", "power_factor")


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class LoadPoints:
    """Measured load points, in order of the shaft power.

    Parameters
    ----------
    name : str
        Where they come from.
    power_shaft : ndarray, shape (n,)
        Shaft power, W.
    current_line_rms : ndarray, shape (n,)
        Line current, A rms.
    omega : ndarray, shape (n,)
        Shaft speed, rad/s.
    power_factor : ndarray, shape (n,)
        cos phi.
    """

    name: str
    power_shaft: Array
    current_line_rms: Array
    omega: Array
    power_factor: Array

    @property
    def loaded(self) -> Array:
        """Which points carry load; relative errors of power exist only there."""
        return self.power_shaft > 0


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class LoadComparison:
    """Load points beside what the model says about them; errors are computed minus measured.

    Parameters
    ----------
    points : LoadPoints
        The measurement.
    voltage_line_rms, frequency_hz : float
        Supply, V and Hz.
    electrical : OperatingPoint
        From measured voltage, current, frequency and power factor.
    forward : OperatingPoint
        From the measured shaft power.
    efficiency : ndarray, shape (n,)
        Measured shaft power over measured electric power.
    """

    points: LoadPoints
    voltage_line_rms: float
    frequency_hz: float
    electrical: OperatingPoint
    forward: OperatingPoint
    efficiency: Array

    def speed_error(self, forward: bool = False) -> Array:
        """Error of the speed at every point, rad/s.

        Parameters
        ----------
        forward : bool
            Of the calculation from the shaft power instead of from electrical quantities.

        Returns
        -------
        ndarray, shape (n,)
        """
        return (self.forward if forward else self.electrical).omega - self.points.omega

    def power_error(self) -> Array:
        """Relative error of the shaft power from electrical quantities; NaN at no load.

        Returns
        -------
        ndarray, shape (n,)
        """
        return self._relative(self.electrical.power_shaft, self.points.power_shaft)

    def current_error(self) -> Array:
        """Relative error of the current from the shaft power.

        Returns
        -------
        ndarray, shape (n,)
        """
        return self.forward.current_line_rms / self.points.current_line_rms - 1

    def efficiency_error(self, forward: bool = False) -> Array:
        """Error of the efficiency, a difference of fractions; NaN at no load.

        Parameters
        ----------
        forward : bool
            Of the calculation from the shaft power instead of from electrical quantities.

        Returns
        -------
        ndarray, shape (n,)
        """
        point = self.forward if forward else self.electrical
        return np.where(self.points.loaded, point.efficiency - self.efficiency, np.nan)

    def rows(self) -> list[dict[str, float]]:
        """Table of the points: measured and computed values with the units a data sheet uses.

        Returns
        -------
        list of dict
            One row a point, ready for a data frame; NaN where a relative error has no meaning.
        """
        points, electrical, forward = self.points, self.electrical, self.forward
        columns = {
            "shaft power / kW": from_si(points.power_shaft, "kW"),
            "speed / rpm": from_si(points.omega, "rpm"),
            "error from V, I, cos phi / rpm": from_si(self.speed_error(), "rpm"),
            "error forward / rpm ": from_si(self.speed_error(forward=True), "rpm"),
            "power error / %": from_si(self.power_error(), "%"),
            "current / A": points.current_line_rms,
            "current error forward / %": from_si(self.current_error(), "%"),
            "cos phi": points.power_factor,
            "cos phi forward": forward.power_factor,
            "efficiency / %": from_si(self.efficiency, "%"),
            "efficiency from V, I, cos phi / %": from_si(electrical.efficiency, "%"),
        }
        return [dict(zip(columns, map(float, row), strict=True)) for row in zip(*columns.values(), strict=True)]

    def _relative(self, value: Array, measured: Array) -> Array:
        relative = np.full(measured.shape, np.nan)
        np.divide(value - measured, measured, out=relative, where=self.points.loaded)
        return relative


def read_load_points(path: str | Path) -> LoadPoints:
    """Read measured load points from a CSV file.

    Parameters
    ----------
    path : str or Path
        File with the columns ``shaft_power_W,current_A,speed_rpm,power_factor``, in any order of rows.

    Returns
    -------
    LoadPoints

    Raises
    ------
    DataError
        If the table cannot be read (see `read_table`), a power is negative, a current or speed not positive,
        a power factor outside 0..1, a power occurs twice with other values or a row is there twice.
    """
    table = read_table(path, numbers=_COLUMNS)
    values = np.array([table.numbers[column] for column in _COLUMNS])
    power, current, speed, factor = values
    checks = (
        ("shaft_power_W", power, power < 0, "must be >= 0 W"),
        ("current_A", current, current <= 0, "must be > 0 A"),
        ("speed_rpm", speed, speed <= 0, "must be > 0 rpm"),
        ("power_factor", factor, (factor <= 0) | (factor > 1), "must be a fraction 0..1, not percent"),
    )
    for column, x, bad, rule in checks:
        if np.any(bad):
            k = int(np.argmax(bad))
            raise DataError(f"{table.name}, line {table.lines[k]}: {column} = {x[k]:g} {rule}.")
    order = np.argsort(power, kind="stable")
    power, current, speed, factor = values[:, order]
    same = np.diff(power) == 0
    if np.any(same):
        k = int(order[int(np.argmax(same)) + 1])
        raise DataError(
            f"{table.name}, line {table.lines[k]}: shaft_power_W = {values[0, k]:g} W is there twice; "
            "keep one row a load point."
        )
    return LoadPoints(
        name=table.name,
        power_shaft=power,
        current_line_rms=current,
        omega=np.asarray(to_si(speed, "rpm")),
        power_factor=factor,
    )


def compare_load_points(
    motor: Motor,
    losses: MotorLosses | None,
    points: LoadPoints,
    *,
    voltage_line_rms: float,
    frequency_hz: float,
    core_at: CoreAt = "airgap",
) -> LoadComparison:
    """Compute every load point from the electrical quantities and from the shaft power.

    Parameters
    ----------
    motor : Motor
        The motor.
    losses : MotorLosses or None
        Its losses; None for the thesis's model.
    points : LoadPoints
        The measurement.
    voltage_line_rms, frequency_hz : float
        Supply of the measurement, V and Hz.
    core_at : {"airgap", "stator"}
        See `pumplib.motor.circuit`.

    Returns
    -------
    LoadComparison

    Raises
    ------
    ParameterError
        See `from_electrical` and `from_torque`.
    DataError
        If a measured speed is more than 5 % above or 40 % below the synchronous speed: wrong unit, frequency
        or number of pole pairs.
    """
    synchronous = 2 * math.pi * frequency_hz / motor.z_p
    ratio = points.omega / synchronous
    if np.any((ratio > 1.05) | (ratio < 0.6)):
        k = int(np.argmax(np.abs(ratio - 0.97)))
        raise DataError(
            f"{points.name}: a speed of {points.omega[k]:g} rad/s at {points.power_shaft[k]:g} W does not fit the "
            f"synchronous speed of {synchronous:g} rad/s; check speed_rpm, the frequency and the pole pairs."
        )
    electrical = from_electrical(
        motor, losses, voltage_line_rms, points.current_line_rms, frequency_hz, points.power_factor,
        core_at=core_at,
    )  # fmt: skip
    forward = from_torque(
        motor, losses, voltage_line_rms, frequency_hz, shaft_power_w=points.power_shaft, core_at=core_at
    )
    return LoadComparison(
        points=points,
        voltage_line_rms=voltage_line_rms,
        frequency_hz=frequency_hz,
        electrical=electrical,
        forward=forward,
        efficiency=points.power_shaft / electrical.power_in,
    )
