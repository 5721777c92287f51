"""Thesis 6.3-6.5: what the residual observers believe about a pump, and how one healthy run teaches it.

The second subsystem of the cascade (motor part first, pump part second):

    c1: J dw/dt = T_e - (B + dB) w - T_p + K_Q dQ_i/dt
    c2: H_p = f_H(Q_i, w) - K_f Q_i^2 - f_c or f_d share of f_H
    c3: T_p = f_T(Q_i, w) less a share of f_T
    c4: Q_i = Q_p + K_l sqrt(H_p)

with f_H = a_h0 w^2 + a_h1 w Q - a_h2 Q^2 and f_T of the same form (3.24), (3.19). The faults' shapes are assumed.
"""

from dataclasses import dataclass, replace
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray

from pumplib.errors import DataError
from pumplib.machines.parameters import PumpSet
from pumplib.machines.quantity import Parameters, Quantity

Array = NDArray[Any]
REST = 0.15
"""Activity below which an operating point counts as at rest."""
START = 1.5
"""Time after a start before residuals are judged, s: filters and the motor's observer settle."""
_THIN = 50  # samples at rest are alike: one in 50 ms is enough
_LEAST = 40
_RIDGE = 1e-6
_WORST = 5000.0  # a single operating point has 1e5 and more


@dataclass(frozen=True, kw_only=True, slots=True)
class PumpBelief(Parameters):
    """Pump as the observers see it; pressure form, sums over the stages, rho g absorbed.

    Parameters
    ----------
    a_h0, a_h1, a_h2 : float
        Head map f_H.
    a_t0, a_t1, a_t2 : float
        Torque map f_T.
    B : float
        Friction of the shaft.
    J : float
        Inertia with the liquid's.
    K_Q : float
        Torque per change of flow, (3.21).
    flow_lag, pressure_lag : float
        Time constants of the two sensors, from their data sheets.
    """

    a_h0: Annotated[float, Quantity("Pa s2", "head at zero flow over squared speed", 0.0, 1e6, True)]
    a_h1: Annotated[float, Quantity("Pa s2/m3", "mixed head coefficient", -1e12, 1e12)]
    a_h2: Annotated[float, Quantity("Pa s2/m6", "head loss with squared flow", 0.0, 1e18, True)]
    a_t0: Annotated[float, Quantity("N m s2", "torque at zero flow over squared speed", -1e3, 1e3)]
    a_t1: Annotated[float, Quantity("N m s2/m3", "mixed torque coefficient", -1e9, 1e9)]
    a_t2: Annotated[float, Quantity("N m s2/m6", "torque drop with squared flow", -1e15, 1e15)]
    B: Annotated[float, Quantity("N m s", "friction", 0.0, 1.0)]
    J: Annotated[float, Quantity("kg m2", "inertia with the liquid's", 0.0, 1000.0, True)]
    K_Q: Annotated[float, Quantity("N m s2/m3", "torque per change of flow", 0.0, 1e6)] = 0.0
    flow_lag: Annotated[float, Quantity("s", "time constant of the flow sensor", 0.0, 10.0)] = 0.0
    pressure_lag: Annotated[float, Quantity("s", "time constant of the pressure sensor", 0.0, 10.0)] = 0.0

    def head(self, Q: Array, omega: Array) -> Array:
        """Head map f_H, Pa.

        Parameters
        ----------
        Q, omega : ndarray, shape (...)
            Flow through the impeller, m3/s, and speed, rad/s.

        Returns
        -------
        ndarray, shape (...)
        """
        return np.asarray(self.a_h0 * omega**2 + self.a_h1 * omega * Q - self.a_h2 * Q**2)

    def torque(self, Q: Array, omega: Array) -> Array:
        """Torque map f_T, N m.

        Parameters
        ----------
        Q, omega : ndarray, shape (...)
            Flow through the impeller, m3/s, and speed, rad/s.

        Returns
        -------
        ndarray, shape (...)
        """
        return np.asarray(self.a_t0 * omega**2 + self.a_t1 * omega * Q - self.a_t2 * Q**2)


def believed(machine: PumpSet, *, flow_lag: float, pressure_lag: float) -> PumpBelief:
    """Belief from parameter sheets, before any measurement.

    Parameters
    ----------
    machine : PumpSet
        Motor and pump as the sheets say.
    flow_lag, pressure_lag : float
        Time constants of the sensors, s.

    Returns
    -------
    PumpBelief
    """
    pump, n = machine.pump, machine.pump.stages
    return PumpBelief(
        a_h0=n * pump.a_h0, a_h1=n * pump.a_h1, a_h2=n * pump.a_h2,
        a_t0=n * pump.a_t0, a_t1=n * pump.a_t1, a_t2=n * pump.a_t2,
        B=machine.friction, J=machine.inertia, K_Q=n * pump.K_Q, flow_lag=flow_lag, pressure_lag=pressure_lag,
    )  # fmt: skip


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Commissioned:
    """A belief taught by a healthy run, and how well it fits.

    Parameters
    ----------
    belief : PumpBelief
        With the maps of this pump.
    head_misfit, torque_misfit : float
        Root mean square at rest, Pa and N m.
    points : int
        Samples at rest that were used.
    condition : float
        Condition number of the scaled head regressors: how different the operating points were.
    """

    belief: PumpBelief
    head_misfit: float
    torque_misfit: float
    points: int
    condition: float


def commission(prior: PumpBelief, omega: Array, T_e: Array, H: Array, Q: Array, activity: Array) -> Commissioned:
    """Fit both maps to a healthy run with several operating points.

    Least squares in scaled units with a weak pull towards the parameter sheet, so that directions the run does not
    excite keep the sheet's values instead of running away. Steady samples only; all signals with the same lag.

    Parameters
    ----------
    prior : PumpBelief
        From the sheets.
    omega, T_e, H, Q : ndarray, shape (n,)
        Speed (rad/s), torque (N m), differential pressure (Pa), flow (m3/s) at 1 kHz.
    activity : ndarray, shape (n,)
        Of the operating point.

    Returns
    -------
    Commissioned

    Raises
    ------
    DataError
        If the run has too little rest, values are not finite, or the operating points are too much alike.
    """
    for name, values in (("omega", omega), ("T_e", T_e), ("H", H), ("Q", Q)):
        if len(values) != len(activity) or not np.isfinite(values).all():
            raise DataError(
                f"commission: {name} has {len(values)} samples, {int((~np.isfinite(values)).sum())} not finite, "
                f"and activity {len(activity)}; give complete records of one length."
            )
    rest = np.flatnonzero(activity < REST)[::_THIN]
    if len(rest) < _LEAST:
        raise DataError(
            f"commission: {len(rest)} samples at rest, {_LEAST} are needed ({_LEAST * _THIN / 1000:g} s of rest); "
            "record longer or hold the operating points longer."
        )
    w, T, h, q = omega[rest], T_e[rest], H[rest], Q[rest]
    maps = np.column_stack((w**2, w * q, -(q**2)))
    a_h, head_rms, condition = _fit(maps, h, np.array([prior.a_h0, prior.a_h1, prior.a_h2]))
    if condition > _WORST:
        raise DataError(
            f"commission: the operating points are too much alike (condition {condition:.0f} of the scaled regressors, "
            f"{_WORST:g} allowed); change speed and valve during the run."
        )
    a_t, torque_rms, _ = _fit(np.column_stack((w, maps)), T, np.array([prior.B, prior.a_t0, prior.a_t1, prior.a_t2]))
    belief = replace(
        prior, a_h0=float(a_h[0]), a_h1=float(a_h[1]), a_h2=float(a_h[2]), B=max(float(a_t[0]), 0.0),
        a_t0=float(a_t[1]), a_t1=float(a_t[2]), a_t2=float(a_t[3]),
    )  # fmt: skip
    return Commissioned(
        belief=belief, head_misfit=head_rms, torque_misfit=torque_rms, points=len(rest), condition=condition
    )


def _fit(regressors: Array, target: Array, prior: Array) -> tuple[Array, float, float]:
    scale = np.abs(regressors).max(axis=0)
    A = regressors / scale
    n = len(target)
    # augmented least squares: no normal matrix is formed
    rows = np.vstack((A / np.sqrt(n), np.sqrt(_RIDGE) * np.eye(A.shape[1])))
    gap = np.concatenate(((target - regressors @ prior) / np.sqrt(n), np.zeros(A.shape[1])))
    change = np.linalg.lstsq(rows, gap, rcond=None)[0]
    found = prior + change / scale
    return found, float(np.sqrt(np.mean((target - regressors @ found) ** 2))), float(np.linalg.cond(A))
