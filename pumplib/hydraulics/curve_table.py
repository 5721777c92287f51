"""Thesis 3.3.2, 3.3.3: measured pump curves: the data class and the strict reading of tables (beyond the thesis)."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pumplib.errors import DataError
from pumplib.machines import from_si, to_si
from pumplib.tables import read_table

Array = NDArray[Any]
_COLUMNS = ("speed_rpm", "flow_m3_per_s", "pressure_Pa", "power_W")
_LEAST_POINTS = 4  # three coefficients and one point to judge them by
_SLOWEST_RPM, _FASTEST_RPM = 400.0, 60_000.0
_LEAST_PRESSURE = 1000.0  # Pa, a tenth of a metre: below it the numbers are bar, kPa or m
_LEAST_EFFICIENCY = 0.01


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class PumpCurve:
    """Measured curve of one pump, sorted by speed and flow, SI.

    Parameters
    ----------
    name : str
        Name of the pump.
    omega, flow, pressure, power : ndarray, shape (n,)
        Shaft speed, rad/s; flow, m3/s; pressure rise, Pa; power, W.
    notes : tuple of str
        What was done to the rows when they were read (sorted, a duplicate removed, ...).
    """

    name: str
    omega: Array
    flow: Array
    pressure: Array
    power: Array
    notes: tuple[str, ...] = ()

    @property
    def torque(self) -> Array:
        """Torque T = P/omega, N m; the shaft torque only if the power is shaft power."""
        return self.power / self.omega

    @property
    def efficiency(self) -> Array:
        """Hydraulic power over the stated power; NaN where the power is zero."""
        hydraulic = self.flow * self.pressure
        return np.divide(hydraulic, self.power, out=np.full(hydraulic.shape, np.nan), where=self.power > 0)


def read_curves(path: str | Path, *, slowest_rpm: float = _SLOWEST_RPM) -> list[PumpCurve]:
    """Read pump curves from a CSV file and refuse what is implausible.

    Parameters
    ----------
    path : str or Path
        File with the columns ``pump,speed_rpm,flow_m3_per_s,pressure_Pa,power_W``. A pump may have several
        speeds; rows may come in any order.
    slowest_rpm : float
        Lower speeds are refused, since they are more likely rad/s or Hz; lower it for a really slow pump.

    Returns
    -------
    list of PumpCurve
        In the order of first appearance. Rows are sorted by speed and flow; sorting, removed duplicates and
        repeated flows are named in `PumpCurve.notes`.

    Raises
    ------
    DataError
        If the table cannot be read (see `read_table`), a flow or power is negative, a speed implausible, a pump
        has fewer than four different points, or flow, pressure and power contradict each other in a way that
        a wrong unit explains; the message names the likely unit.
    """
    table = read_table(path, numbers=_COLUMNS, texts=("pump",))
    speed, flow, pressure, power = (np.array(table.numbers[column]) for column in _COLUMNS)
    names = table.texts["pump"]
    rules = (
        ("speed_rpm", speed, speed < slowest_rpm, f"rpm is below {slowest_rpm:g} rpm: probably rad/s or Hz"),
        ("speed_rpm", speed, speed > _FASTEST_RPM, f"rpm is above {_FASTEST_RPM:g} rpm: check the unit"),
        ("flow_m3_per_s", flow, flow < 0, "m3/s is negative: (3.24) and (3.19) hold for forward flow"),
        ("power_W", power, power < 0, "W is negative: a pump takes power"),
    )
    for column, x, bad, rule in rules:
        if np.any(bad):
            k = int(np.argmax(bad))
            raise DataError(f"{table.name}, line {table.lines[k]} ({names[k]}): {column} = {x[k]:g} {rule}.")
    curves = []
    for name in dict.fromkeys(names):
        rows = np.flatnonzero([other == name for other in names])
        values = np.stack([speed[rows], flow[rows], pressure[rows], power[rows]])
        curves.append(_curve(table.name, name, values))
    return curves


def _curve(file: str, name: str, values: Array) -> PumpCurve:
    """Sort and check the rows of one pump; `values` holds speed, flow, pressure and power."""
    notes = []
    order = np.lexsort((values[1], values[0]))
    if np.any(np.diff(order) < 0):
        notes.append("rows sorted by speed and flow")
    values = values[:, order]
    kept = np.unique(values, axis=1, return_index=True)[1]
    if kept.size < values.shape[1]:
        notes.append(f"{values.shape[1] - kept.size} exact duplicate rows removed")
        values = values[:, np.sort(kept)]
    repeated = int(np.sum(np.all(np.diff(values[:2], axis=1) == 0, axis=0)))
    if repeated:
        notes.append(f"{repeated} flows are repeated with other values; all are kept")
    speed, flow, pressure, power = values
    omega = np.asarray(to_si(speed, "rpm"))
    where = f"{file}, pump {name!r}"
    # by affinity (3.24) and (3.19) depend on Q/omega alone, so this is the number of points that count
    different = different_values(flow / omega)
    if different < _LEAST_POINTS:
        raise DataError(
            f"{where}: {different} different flows; three coefficients and a check need at least {_LEAST_POINTS}."
        )
    curve = PumpCurve(name=name, omega=omega, flow=flow, pressure=pressure, power=power, notes=tuple(notes))
    _check_units(where, curve)
    return curve


def _check_units(where: str, curve: PumpCurve) -> None:
    if not np.any(curve.power > 0):
        raise DataError(f"{where}: power_W is zero everywhere; give the measured power in W.")
    highest = float(curve.pressure.max())
    if highest < _LEAST_PRESSURE:
        raise DataError(
            f"{where}: the largest pressure_Pa is {highest:g} Pa, below 0.1 m of water: probably bar "
            "(multiply by 1e5), kPa (1e3) or metres of head (about 9.8e3)."
        )
    efficiency = curve.efficiency
    free = (curve.power == 0) & (curve.flow * curve.pressure > 0)
    if np.any(free):
        k = int(np.argmax(free))
        raise DataError(f"{where}: power_W = 0 W at {curve.flow[k]:g} m3/s and {curve.pressure[k]:g} Pa.")
    best = float(np.nanmax(efficiency))
    if best > 1:
        k = int(np.nanargmax(efficiency))
        likely = [f"flow in {unit}" for unit in ("m3/h", "l/min", "l/s") if 0.05 < to_si(best, unit) < 0.95]
        likely += ["power in kW"] if 0.05 < from_si(best, "kW") < 0.95 else []
        guess = f" Probably {' or '.join(likely)}." if likely else " Check the units of all three columns."
        raise DataError(
            f"{where}: at {curve.flow[k]:g} m3/s and {curve.pressure[k]:g} Pa the hydraulic power of "
            f"{curve.flow[k] * curve.pressure[k]:.4g} W exceeds power_W = {curve.power[k]:g} W.{guess}"
        )
    if best < _LEAST_EFFICIENCY:
        likely = [f"pressure in {unit}" for unit in ("kPa", "bar") if 0.05 < to_si(best, unit) < 0.95]
        guess = f" Probably {' or '.join(likely)}." if likely else " Check the units of all three columns."
        raise DataError(f"{where}: the hydraulic power reaches only {100 * best:.2g} % of power_W.{guess}")


def different_values(x: Array) -> int:
    """Count values that differ by more than rounding.

    Parameters
    ----------
    x : ndarray
        Values.

    Returns
    -------
    int
    """
    return int(np.unique(np.round(x / max(np.abs(x).max(), 1e-300), 9)).size)
