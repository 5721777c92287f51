"""Thesis 6.6: self calibration (beyond the text): what a healthy beginning of a run shows is taken off the residuals.

A run differs from the commissioning by slow things: winding temperature, drift of sensors. Their traces in the
residuals are smooth functions of the operating point. Ridge regression on the declared healthy beginning finds
them; the prior sizes keep directions that the beginning did not excite near zero.
"""

from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray

from pumplib.errors import DataError
from pumplib.machines.quantity import Parameters, Quantity

Array = NDArray[Any]
_THIN = 20


@dataclass(frozen=True, kw_only=True, slots=True)
class CalibrationSettings(Parameters):
    """Sizes of what may have changed since the commissioning, one standard deviation each.

    Parameters
    ----------
    head_offset, head_map : float
        Offset of the head residual, and its part that grows with w^2, w Q, Q^2 at the nominal point.
    torque_offset, torque_map, torque_copper : float
        Offset of the torque residuals, their parts in w and Q, and the part that goes with the copper loss.
    head_noise, torque_noise : float
        Healthy residual at rest.
    correlation : float
        Time after which healthy residuals count as new.
    """

    head_offset: Annotated[float, Quantity("Pa", "offset of the head residual", 0.0, 1e6, True)] = 1000.0
    head_map: Annotated[float, Quantity("Pa", "map error of the head", 0.0, 1e6, True)] = 1500.0
    torque_offset: Annotated[float, Quantity("N m", "offset of the torque residuals", 0.0, 1e3, True)] = 0.02
    torque_map: Annotated[float, Quantity("N m", "map error of the torque", 0.0, 1e3, True)] = 0.02
    torque_copper: Annotated[float, Quantity("N m", "torque error by the winding", 0.0, 1e3, True)] = 0.03
    head_noise: Annotated[float, Quantity("Pa", "healthy head residual", 0.0, 1e6, True)] = 400.0
    torque_noise: Annotated[float, Quantity("N m", "healthy torque residual", 0.0, 1e3, True)] = 0.012
    correlation: Annotated[float, Quantity("s", "correlation time of healthy residuals", 0.0, 1e3, True)] = 0.4


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Calibration:
    """Corrections found on one healthy beginning.

    Parameters
    ----------
    head : ndarray, shape (4,)
        Coefficients of r1 in units of their prior sizes.
    torque : ndarray, shape (2, 4)
        The same of r2 and r3.
    seconds : float
        Rest it was learned from.
    """

    head: Array
    torque: Array
    seconds: float


def _regressors(
    omega: Array, Q: Array, copper: Array, nominal: tuple[float, float], s: CalibrationSettings
) -> tuple[Array, Array]:
    w, q = omega / nominal[0], Q / nominal[1]
    one = np.ones_like(w)
    head = np.column_stack((one * s.head_offset, w**2 * s.head_map, q**2 * s.head_map, w * q * s.head_map))
    torque = np.column_stack((one * s.torque_offset, w * s.torque_map, copper * s.torque_copper, q * s.torque_map))
    return head, torque


def calibrate(
    r: Array, omega: Array, Q: Array, copper: Array, rest: Array, *, dt: float, nominal: tuple[float, float],
    settings: CalibrationSettings | None = None,
) -> Calibration:  # fmt: skip
    """Learn the corrections from residuals that are known to be healthy.

    Parameters
    ----------
    r : ndarray, shape (n, 3)
        r1 (Pa), r2, r3 (N m).
    omega, Q : ndarray, shape (n,)
        Operating point, rad/s and m3/s.
    copper : ndarray, shape (n,)
        Copper loss over frequency, relative to the nominal point.
    rest : ndarray of bool, shape (n,)
        Samples at rest.
    dt : float
        Sampling interval, s.
    nominal : tuple of float
        Nominal speed and flow, rad/s and m3/s.
    settings : CalibrationSettings, optional
        Prior sizes.

    Returns
    -------
    Calibration

    Raises
    ------
    DataError
        If there is less than a second of rest.
    """
    settings = settings or CalibrationSettings()
    if rest.sum() * dt < 1.0:
        raise DataError(
            f"calibrate: {rest.sum() * dt:.2g} s at rest in the healthy beginning, 1 s is needed; lengthen it."
        )
    chosen = np.flatnonzero(rest)[::_THIN]
    head, torque = _regressors(omega[chosen], Q[chosen], copper[chosen], nominal, settings)
    weight = np.sqrt(min(1.0, _THIN * dt / settings.correlation))
    found = []
    for X, y, noise in (
        (head, r[chosen, 0], settings.head_noise),
        (torque, r[chosen, 1], settings.torque_noise),
        (torque, r[chosen, 2], settings.torque_noise),
    ):
        A = np.vstack((X * weight / noise, np.eye(4)))
        b = np.concatenate((y * weight / noise, np.zeros(4)))
        found.append(np.linalg.lstsq(A, b, rcond=None)[0])
    return Calibration(head=found[0], torque=np.stack(found[1:]), seconds=float(rest.sum() * dt))


def apply_calibration(
    r: Array, omega: Array, Q: Array, copper: Array, found: Calibration, nominal: tuple[float, float],
    settings: CalibrationSettings | None = None,
) -> Array:  # fmt: skip
    """Take the corrections off the residuals.

    Parameters
    ----------
    r : ndarray, shape (n, 3)
        r1 (Pa), r2, r3 (N m).
    omega, Q : ndarray, shape (n,)
        Operating point, rad/s and m3/s.
    copper : ndarray, shape (n,)
        Copper loss over frequency, relative to the nominal point.
    found : Calibration
        Of this run.
    nominal : tuple of float
        As in `calibrate`.
    settings : CalibrationSettings, optional
        As in `calibrate`.

    Returns
    -------
    ndarray, shape (n, 3)
    """
    head, torque = _regressors(omega, Q, copper, nominal, settings or CalibrationSettings())
    return np.column_stack(
        (r[:, 0] - head @ found.head, r[:, 1] - torque @ found.torque[0], r[:, 2] - torque @ found.torque[1])
    )
