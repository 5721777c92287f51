"""Thesis 6.4-6.6: the pump of the residual observers solved forwards, with a fault: their model as the truth.

Speed and flow are prescribed, torque and pressure follow from c1 to c4. Results on it are nominal: they show what the
structure promises, not what a pump does that was modelled wrongly.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pumplib.errors import ParameterError
from pumplib.observers.residual_model import PumpBelief
from pumplib.observers.residual_signature import CAVITATION_TORQUE, DRY_TORQUE, FAULTS

Array = NDArray[Any]
SHIFT = 1.0
"""Healthy rest before the fault in the records made here, s."""
_RAMP = 0.5


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class NominalRecord:
    """Signals of the nominal pump.

    Parameters
    ----------
    dt : float
        Sampling interval, s.
    omega, T_e, H, Q : ndarray, shape (n,)
        Speed (rad/s), torque of the motor (N m), pressure (Pa) and delivered flow (m3/s), without noise.
    Q_i : ndarray, shape (n,)
        Flow through the impeller, m3/s; not measured.
    """

    dt: float
    omega: Array
    T_e: Array
    H: Array
    Q: Array
    Q_i: Array

    @property
    def t(self) -> Array:
        """Times, s."""
        return self.dt * np.arange(len(self.omega))


def _check_fault(fault: str) -> None:
    if fault not in (*FAULTS, "none"):
        raise ParameterError(f"fault {fault!r}: must be one of none, {', '.join(FAULTS)}.")


def nominal_signals(
    belief: PumpBelief, omega: ArrayLike, Q: ArrayLike, fault: str = "none", size: ArrayLike = 0.0,
    omega_rate: ArrayLike = 0.0, Q_rate: ArrayLike = 0.0, size_rate: ArrayLike = 0.0,
) -> tuple[Array, Array, Array]:  # fmt: skip
    """Solve c1 to c4 for torque, pressure and impeller flow.

    Parameters
    ----------
    belief : PumpBelief
        The pump; here it is the truth.
    omega, Q : array_like, shape (n,)
        Speed, rad/s, and delivered flow, m3/s.
    fault : str
        "none" or one of `pumplib.observers.residual_signature.FAULTS`.
    size : array_like, shape (n,)
        Of the fault, in its unit.
    omega_rate, Q_rate, size_rate : array_like, shape (n,)
        Rates of speed, flow and size, each in its unit per second; zero in steady state.

    Returns
    -------
    T_e, H, Q_i : ndarray, shape (n,)
        Torque of the motor, N m, pressure, Pa, and flow through the impeller, m3/s.

    Raises
    ------
    ParameterError
        If the fault is unknown, a size is negative, or the pump delivers no pressure at such a point.
    """
    _check_fault(fault)
    w, q, s, dw, dq, ds = (np.asarray(one, float) for one in np.broadcast_arrays(
        omega, Q, size, omega_rate, Q_rate, size_rate))  # fmt: skip
    if (s < 0).any() or not np.isfinite(w + q + s + dw + dq + ds).all():
        raise ParameterError(f"nominal_signals: sizes of {fault} and the operating points must be finite, sizes >= 0.")
    none = np.zeros_like(s)
    K_f, dK_f = (s, ds) if fault == "clogging" else (none, none)
    K_l, dK_l = (s, ds) if fault == "leakage" else (none, none)
    lost, dlost = (s, ds) if fault in ("cavitation", "dry_running") else (none, none)
    share = DRY_TORQUE if fault == "dry_running" else CAVITATION_TORQUE

    def pressure(flow: Array) -> Array:
        return belief.head(flow, w) * (1 - lost) - K_f * flow**2

    Q_i = q.copy()
    for _ in range(100):  # the leakage moves the flow by a per cent of its own change: a fast contraction
        H = pressure(Q_i)
        if not (H >= 0).all():
            raise ParameterError(
                f"nominal_signals: the pump delivers no pressure ({float(np.min(H)):.3g} Pa) with {fault} of this "
                "size; lower the flow or the size."
            )
        before, Q_i = Q_i, q + K_l * np.sqrt(H)
        if np.array_equal(before, Q_i):
            break
    else:
        if not np.allclose(before, Q_i, rtol=1e-14, atol=0.0):
            raise ParameterError("nominal_signals: no flow through the leak satisfies c2 and c4; lower the size.")
    H = pressure(Q_i)
    # rate of Q_i from the derivatives of c2 and c4
    slope_Q = (belief.a_h1 * w - 2 * belief.a_h2 * Q_i) * (1 - lost) - 2 * K_f * Q_i
    rest = (2 * belief.a_h0 * w + belief.a_h1 * Q_i) * (1 - lost) * dw - belief.head(Q_i, w) * dlost - Q_i**2 * dK_f
    root = np.sqrt(H)
    leak = np.divide(K_l, 2 * root, out=np.zeros_like(s), where=root > 0)
    dQ_i = (dq + dK_l * root + leak * rest) / (1 - leak * slope_Q)
    friction = belief.B + (s if fault == "friction" else none)
    T_e = belief.J * dw + friction * w + belief.torque(Q_i, w) * (1 - share * lost) - belief.K_Q * dQ_i
    return T_e, H, Q_i


def steady_record(
    belief: PumpBelief, omega: float, Q: float, fault: str = "none", size: float = 0.0,
    dt: float = 1e-3, duration: float = 11.0,
) -> NominalRecord:  # fmt: skip
    """One operating point; after a second the fault steps in and everything is at its new rest at once.

    Parameters
    ----------
    belief : PumpBelief
        The pump.
    omega, Q : float
        Speed, rad/s, and delivered flow, m3/s.
    fault : str
        "none" or one of `pumplib.observers.residual_signature.FAULTS`.
    size : float
        In the unit of the fault.
    dt, duration : float
        s.

    Returns
    -------
    NominalRecord
    """
    t = dt * np.arange(round(duration / dt))
    w, q = np.full(len(t), float(omega)), np.full(len(t), float(Q))
    T_e, H, Q_i = nominal_signals(belief, w, q, fault, np.where(t >= SHIFT, size, 0.0))
    return NominalRecord(dt=dt, omega=w, T_e=T_e, H=H, Q=q, Q_i=Q_i)


def moving_record(
    belief: PumpBelief, fault: str = "none", size: float = 0.0, dt: float = 1e-3, duration: float = 8.0
) -> NominalRecord:
    """Speed and flow swing all the time, and the fault grows smoothly within half a second.

    Parameters
    ----------
    belief : PumpBelief
        The pump.
    fault : str
        "none" or one of `pumplib.observers.residual_signature.FAULTS`.
    size : float
        In the unit of the fault.
    dt, duration : float
        s.

    Returns
    -------
    NominalRecord
        With sensors as fast as the sampling.
    """
    t = dt * np.arange(round(duration / dt))
    a, b = 2 * np.pi * 0.4, 2 * np.pi * 0.7
    w, dw = 260.0 + 25.0 * np.sin(a * t), 25.0 * a * np.cos(a * t)
    q, dq = 1.25e-3 + 1.5e-4 * np.sin(b * t), 1.5e-4 * b * np.cos(b * t)
    x = np.clip((t - SHIFT) / _RAMP, 0.0, 1.0)
    s, ds = size * x**3 * (10 - 15 * x + 6 * x**2), size * 30 * x**2 * (1 - x) ** 2 / _RAMP
    T_e, H, Q_i = nominal_signals(belief, w, q, fault, s, dw, dq, ds)
    return NominalRecord(dt=dt, omega=w, T_e=T_e, H=H, Q=q, Q_i=Q_i)


def ideal(belief: PumpBelief) -> PumpBelief:
    """The same pump with sensors without lag.

    Parameters
    ----------
    belief : PumpBelief
        The pump.

    Returns
    -------
    PumpBelief
    """
    return replace(belief, flow_lag=0.0, pressure_lag=0.0)
