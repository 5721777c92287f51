"""Thesis 2.1.2: the model that a monitor gets from one healthy run, and its residuals (Definition 2.1.1).

Pressure f_H = a_h0 w^2 + a_h1 w Q - a_h2 Q^2 and torque f_T of the same form are linear in their coefficients:
least squares on the windows at rest of a commissioning run finds them. The friction B is believed, not fitted.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pumplib.errors import DataError
from pumplib.primer.windows import Windows

Array = NDArray[Any]
_LEAST = 30  # windows at rest
_WORST = 1e4  # condition number of the scaled regressors


@dataclass(frozen=True, kw_only=True, eq=False, slots=True)
class Commissioned:
    """Model of one healthy machine.

    Parameters
    ----------
    head : ndarray, shape (3,)
        a_h0 (Pa s2), a_h1 (Pa s2/m3), a_h2 (Pa s2/m6).
    torque : ndarray, shape (3,)
        a_t0 (N m s2), a_t1 (N m s2/m3), a_t2 (N m s2/m6).
    friction : float
        Believed B, N m s.
    sigma_H, sigma_T : float
        Root mean square residuals at rest in the commissioning run, Pa and N m.
    scale : ndarray, shape (3,)
        Largest regressors of the run, which scale the coefficients to one size.
    information : ndarray, shape (3, 3)
        Mean of phi phi' of the scaled regressors.
    """

    head: Array
    torque: Array
    friction: float
    sigma_H: float
    sigma_T: float
    scale: Array
    information: Array

    def residual(self, w: Windows) -> Array:
        """Pressure residual r_H = H - f_H(Q, w).

        Parameters
        ----------
        w : Windows
            Measurements.

        Returns
        -------
        ndarray, shape (n,)
            Pa; negative if pressure is missing.
        """
        return np.asarray(w.H - regressors(w) @ self.head)

    def torque_residual(self, w: Windows) -> Array:
        """Torque residual r_T = T_e - B w - f_T(Q, w); valid at rest, the inertia is left out.

        Parameters
        ----------
        w : Windows
            Measurements.

        Returns
        -------
        ndarray, shape (n,)
            N m; positive if the pump needs more torque than it should.
        """
        return np.asarray(w.torque - self.friction * w.omega - regressors(w) @ self.torque)


def regressors(w: Windows) -> Array:
    """Regressors of both maps: w^2, w Q, -Q^2.

    Parameters
    ----------
    w : Windows
        Measurements.

    Returns
    -------
    ndarray, shape (n, 3)
    """
    return np.column_stack((w.omega**2, w.omega * w.Q, -(w.Q**2)))


def commission(w: Windows, friction: float) -> Commissioned:
    """Fit the model to a healthy run.

    Parameters
    ----------
    w : Windows
        A healthy run with several operating points.
    friction : float
        Believed B, N m s.

    Returns
    -------
    Commissioned

    Raises
    ------
    DataError
        If the run has too few windows at rest, or operating points too much alike to tell the coefficients apart.

    References
    ----------
    Thesis 2.1.2; (3.19) and (3.24) for the maps.
    """
    rest = w.rest
    if rest.sum() < _LEAST:
        raise DataError(f"commission: {int(rest.sum())} windows at rest, {_LEAST} are needed; record longer.")
    phi = regressors(w)[rest]
    scale = np.abs(phi).max(axis=0)
    scaled = phi / scale
    if np.linalg.cond(scaled) > _WORST:
        raise DataError("commission: the operating points are too much alike; change speed and valve during the run.")
    target = np.column_stack((w.H, w.torque - friction * w.omega))[rest]
    found = np.linalg.lstsq(scaled, target, rcond=None)[0]
    rms = np.sqrt(np.mean((target - scaled @ found) ** 2, axis=0))
    return Commissioned(
        head=found[:, 0] / scale,
        torque=found[:, 1] / scale,
        friction=friction,
        sigma_H=float(rms[0]),
        sigma_T=float(rms[1]),
        scale=scale,
        information=scaled.T @ scaled / len(scaled),
    )
