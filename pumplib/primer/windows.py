"""Thesis 2.1, 7.1.1: what a monitor makes of the measured signals before any of the three approaches starts.

Every 0.1 s a window of 0.2 s (Hann weight) gives phasors of voltage and current, pressure and flow. Speed and
torque come from the electrical steady state, without a speed sensor. Pressure, speed and torque are then delayed
as the flow sensor delays the flow, so that all quantities belong to one instant also while they change.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pumplib.decide import Activity, ActivitySettings
from pumplib.errors import DataError, ParameterError
from pumplib.machines import Motor
from pumplib.machines.quantity import Quantity, check_value
from pumplib.testbench.sensors import FastSignals
from pumplib.testbench.slow import slow_signals

Array = NDArray[Any]
STEP = 0.1
"""Distance of two windows, s."""
WINDOW = 0.2
"""Length of a window, s."""
FLOW_LAG = 0.15
"""Time constant of the flow sensor by its data sheet (bench profile `pump`), s."""
PRESSURE_LAG = 0.05
"""Time constant of the pressure sensor by its data sheet, s."""
QUIET = 0.15
"""Activity below which the operating point counts as at rest."""
_ACTIVITY = ActivitySettings(signals=("Q", "omega"), scales=(1e-4, 3.0), time_constant=0.25)


@dataclass(frozen=True, kw_only=True, eq=False, slots=True)
class Windows:
    """Measured quantities of a run, one value a window.

    Parameters
    ----------
    t : ndarray, shape (n,)
        Centres of the windows, s.
    H, Q : ndarray, shape (n,)
        Pressure, Pa, and flow, m3/s.
    I_rms : ndarray, shape (n,)
        Fundamental of the line current, A rms.
    omega, torque : ndarray, shape (n,)
        Speed, rad/s, and air-gap torque, N m, estimated from voltages and currents.
    activity : ndarray, shape (n,)
        How far the operating point is from its own low-passed value.
    """

    t: Array
    H: Array
    Q: Array
    I_rms: Array
    omega: Array
    torque: Array
    activity: Array

    @property
    def rest(self) -> Array:
        """Where the operating point is at rest."""
        return np.asarray(self.activity < QUIET)

    def part(self, first: float, last: float) -> Array:
        """Windows whose centres lie in a span of time.

        Parameters
        ----------
        first, last : float
            s, the end excluded.

        Returns
        -------
        ndarray of bool, shape (n,)
        """
        return np.asarray((self.t >= first) & (self.t < last))


def steady_speed(
    V_rms: ArrayLike, I_rms: ArrayLike, omega_e: ArrayLike, phi: ArrayLike, motor: Motor
) -> tuple[Array, Array]:
    """Speed and torque of an induction motor in steady state from its terminal phasors.

    With the current real, E = V - (r_s + j omega_e L_s') I. Then T_e = 3/2 z_p E_d I/omega_e and the slip
    frequency is R_r' omega_e E_d I/|E|^2: the main inductance, which saturates, is not in it.

    Parameters
    ----------
    V_rms, I_rms : array_like, shape (n,)
        Phase voltage, V, and line current, A, both rms, of a motor in Y.
    omega_e : array_like, shape (n,)
        Supply frequency, rad/s.
    phi : array_like, shape (n,)
        Angle by which the current lags the voltage, rad.
    motor : Motor
        Believed parameters.

    Returns
    -------
    omega : ndarray, shape (n,)
        Speed of the shaft, rad/s.
    torque : ndarray, shape (n,)
        Air-gap torque, N m.

    Raises
    ------
    DataError
        If there is no supply.

    References
    ----------
    Thesis 3.2.2 (model), 7.1.1 (its steady state; reconstructed).
    """
    V, current = math.sqrt(2) * np.asarray(V_rms, dtype=float), math.sqrt(2) * np.asarray(I_rms, dtype=float)
    w_e, angle = np.asarray(omega_e, dtype=float), np.asarray(phi, dtype=float)
    if not (np.isfinite(w_e).all() and (w_e > 0).all()):
        raise DataError("steady_speed: omega_e must be positive and finite; cut the record where there is no supply.")
    E_d = V * np.cos(angle) - motor.r_s * current
    E_q = V * np.sin(angle) - w_e * motor.L_s_prime * current
    slip = motor.R_r_prime * w_e * E_d * current / (E_d**2 + E_q**2)
    return (w_e - slip) / motor.z_p, 1.5 * motor.z_p * E_d * current / w_e


def delayed(x: ArrayLike, lag: float, dt: float = STEP) -> Array:
    """First-order lag of a sampled signal that runs straight between its samples; it starts at rest.

    Parameters
    ----------
    x : array_like, shape (n,)
        Signal.
    lag : float
        Time constant, s.
    dt : float
        Sampling interval, s.

    Returns
    -------
    ndarray, shape (n,)
        Delayed signal, unit of x.

    Raises
    ------
    ParameterError
        If a time is not positive.
    """
    from scipy.signal import lfilter

    check_value("delayed", "lag", lag, Quantity("s", "time constant", 0.0, 1e6, True))
    check_value("delayed", "dt", dt, Quantity("s", "sampling interval", 0.0, 1e6, True))
    u = np.asarray(x, dtype=float)
    keep = math.exp(-dt / lag)
    now = 1.0 - lag / dt * (1.0 - keep)
    past = 1.0 - keep - now
    y, _ = lfilter([now, past], [1.0, -keep], u, zi=[u[0] * (1.0 - now)])
    return np.asarray(y)


def windows(fast: FastSignals, motor: Motor) -> Windows:
    """Measured signals of a run as windows.

    Parameters
    ----------
    fast : FastSignals
        Voltages, currents, pressure and flow as measured; the truth is never used.
    motor : Motor
        Believed parameters of the motor.

    Returns
    -------
    Windows

    Raises
    ------
    ParameterError
        If the motor is not connected in Y.
    DataError
        If pressure or flow is not measured, or too many samples are missing.

    References
    ----------
    Thesis 2.1 (measurements y and known inputs u).
    """
    if motor.connection != "Y":
        raise ParameterError(f"windows: motor.connection = {motor.connection!r}: this primer treats motors in Y.")
    slow = slow_signals(fast, window=WINDOW, step=STEP)
    if slow.H is None or slow.Q is None:
        raise DataError("windows: pressure and flow are needed; use a bench of profile pump.")
    if any(slow.rejected.values()):
        raise DataError(f"windows: too many samples missing, windows without value {slow.rejected}.")
    omega, torque = steady_speed(slow.V_rms, slow.I_rms, slow.omega_e, slow.phi, motor)
    omega, torque = delayed(omega, FLOW_LAG), delayed(torque, FLOW_LAG)
    # the pressure sensor has a lag of its own: (1 + 0.05 s)/(1 + 0.15 s) brings it to that of the flow
    share = PRESSURE_LAG / FLOW_LAG
    H = share * slow.H + (1.0 - share) * delayed(slow.H, FLOW_LAG)
    activity = Activity(_ACTIVITY, STEP).run(np.column_stack((slow.Q, omega)))
    return Windows(t=slow.t, H=H, Q=slow.Q, I_rms=slow.I_rms, omega=omega, torque=torque, activity=activity)
