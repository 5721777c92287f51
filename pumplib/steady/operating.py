"""Thesis 7.2, 7.4: exact steady operating points of the model behind the relations, healthy or with one of five faults.

What the six slow signals are when motor and pump obey (3.7), (3.11) and (3.19)-(3.24) exactly and the load is a valve
with H = K_v Q^2. The residuals are zero there without a fault; with one they show its effect to all orders, which the
linear signatures leave out.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pumplib.errors import ParameterError, SimulationError
from pumplib.machines import Motor
from pumplib.steady.phasors import electrical_parameters
from pumplib.steady.relations import PARAMETERS, load_torque

Array = NDArray[Any]
TORQUE_SHARE_CAVITATION = 0.45  # assumed: relative loss of torque per relative loss of head
TORQUE_SHARE_DRY = 0.93
FAULT_NAMES = ("K_f", "dB", "K_l", "f_c", "f_d")


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class SteadyPoints:
    """Exact operating points, all fields of one shape.

    Parameters
    ----------
    signals : dict of str to ndarray, shape (n,)
        V_rms, I_rms, omega_e, phi, H, Q, SI.
    omega, torque_em : ndarray, shape (n,)
        Speed, rad/s, and electromagnetic torque, N m.
    valve : ndarray, shape (n,)
        K_v, Pa s2/m6.
    """

    signals: dict[str, Array]
    omega: Array
    torque_em: Array
    valve: Array


def v_f_voltage(frequency_hz: ArrayLike, *, rated: float = 325.0, rated_hz: float = 50.0, boost: float = 3.0) -> Array:
    """Voltage of a V/f drive with boost.

    Parameters
    ----------
    frequency_hz : array_like
        Supply frequency, Hz.
    rated : float
        Amplitude of the phase voltage at `rated_hz`, V.
    rated_hz : float
        Hz.
    boost : float
        Amplitude at standstill, V.

    Returns
    -------
    ndarray
        V rms, phase to neutral.
    """
    f = np.asarray(frequency_hz, dtype=float)
    return np.asarray(np.minimum(boost + (rated - boost) * f / rated_hz, rated) / math.sqrt(2))


def steady_points(
    motor: Motor,
    parameters: Mapping[str, float],
    *,
    V_rms: ArrayLike,
    frequency_hz: ArrayLike,
    valve: ArrayLike,
    faults: Mapping[str, ArrayLike] | None = None,
) -> SteadyPoints:
    """Solve for operating points.

    Parameters
    ----------
    motor : Motor
        For L_m', pole pairs and connection.
    parameters : mapping of str to float
        By the names of `pumplib.steady.relations.PARAMETERS`; they override those of the motor.
    V_rms : array_like
        Phase-to-neutral voltage, V rms. All inputs broadcast.
    frequency_hz : array_like
        Supply frequency, Hz.
    valve : array_like
        K_v, Pa s2/m6.
    faults : mapping of str to array_like, optional
        K_f, Pa s2/m6, dB, N m s, K_l, m3/s/sqrt(Pa), f_c and f_d, shares of the head.

    Returns
    -------
    SteadyPoints

    Raises
    ------
    ParameterError
        If a parameter is missing or a fault unknown.
    SimulationError
        If the motor cannot carry the load.

    References
    ----------
    Thesis (3.7), (3.11), (3.19)-(3.25); fault terms reconstructed.
    """
    missing = [name for name in PARAMETERS if name not in parameters]
    if missing:
        raise ParameterError(f"steady_points: parameters {', '.join(missing)} missing.")
    given = dict(faults or {})
    unknown = [name for name in given if name not in FAULT_NAMES]
    if unknown:
        raise ParameterError(f"steady_points: unknown fault {', '.join(unknown)}; known are {', '.join(FAULT_NAMES)}.")
    e, p = electrical_parameters(motor), parameters
    arrays = [
        np.asarray(a, dtype=float) for a in (V_rms, frequency_hz, valve, *[given.get(f, 0.0) for f in FAULT_NAMES])
    ]
    V, f, K_v, K_f, dB, K_l, f_c, f_d = (np.atleast_1d(a) for a in np.broadcast_arrays(*arrays))
    w_e = 2 * math.pi * f
    head_share, torque_share = 1 - f_c - f_d, 1 - TORQUE_SHARE_CAVITATION * f_c - TORQUE_SHARE_DRY * f_d
    inner = 1 + K_l * np.sqrt(K_v)  # impeller flow over delivered flow

    def delivered(omega: Array) -> Array:
        a = K_v + (head_share * p["a_h2"] + K_f) * inner**2
        b = head_share * p["a_h1"] * omega * inner
        return np.asarray((b + np.sqrt(b**2 + 4 * a * head_share * p["a_h0"] * omega**2)) / (2 * a))

    def motor_side(omega: Array) -> tuple[Array, Array]:
        slip = w_e - e.z_p * omega
        magnetising = p["R_r_prime"] / (p["R_r_prime"] + 1j * slip * e.L_m_prime)  # i_m / i_s
        Z = 1j * w_e * (p["L_s_prime"] + e.L_m_prime * magnetising)
        admittance = 1 / Z + p["G_core"]
        behind = math.sqrt(2) * e.voltage * V / (1 + p["r_s"] * admittance)
        current = behind / Z
        T_e = 1.5 * e.z_p * e.L_m_prime * np.imag(np.conj(magnetising * current) * current)
        return np.asarray(T_e), np.asarray(behind * admittance)

    def excess(omega: Array) -> Array:
        Q_i = inner * delivered(omega)
        T_e, current = motor_side(omega)
        load = torque_share * load_torque(Q_i, omega, 0.0, p["a_t0"], p["a_t1"], p["a_t2"])
        return np.asarray(T_e - (p["B"] + dB) * omega - p["stray"] * np.abs(current) ** 2 / 2 - load)

    low, high = 0.75 * w_e / e.z_p, w_e / e.z_p
    if np.any(excess(low) < 0) or np.any(excess(high) > 0):
        k = int(np.argmax((excess(low) < 0) | (excess(high) > 0)))
        raise SimulationError(
            f"V_rms = {V[k]:g} V, {f[k]:g} Hz, K_v = {K_v[k]:g} Pa s2/m6: the motor cannot carry this load above 75 % "
            "of the synchronous speed; raise the voltage or lower the load."
        )
    for _ in range(80):  # bisection to the resolution of a double
        middle = 0.5 * (low + high)
        above = excess(middle) > 0
        low, high = np.where(above, middle, low), np.where(above, high, middle)
    omega = 0.5 * (low + high)
    T_e, current = motor_side(omega)
    Q = delivered(omega)
    return SteadyPoints(
        signals={
            "V_rms": V,
            "I_rms": np.abs(current) / math.sqrt(2) / e.current,
            "omega_e": w_e,
            "phi": -np.angle(current),
            "H": K_v * Q**2,
            "Q": Q,
        },
        omega=omega,
        torque_em=T_e,
        valve=K_v,
    )
