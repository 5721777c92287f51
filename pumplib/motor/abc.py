"""Thesis 3.2.1, 3.2.3: the induction motor in phase coordinates, untransformed.

The reference that the dq model is tested against: six coupled coils with inductances that depend on the
rotor angle, no transformation anywhere. The star-point voltage of a Y-connected stator follows from the
condition that the currents sum to zero, not from the theory of zero sequences. Slow on purpose; nothing
else in the package uses it.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pumplib.errors import SimulationError
from pumplib.machines.parameters import Motor
from pumplib.motor.frames import K_DELTA

Array = NDArray[Any]
_SHIFT = 2 * np.pi / 3 * (np.arange(3)[None, :] - np.arange(3)[:, None])  # rotor phase k against stator phase i


@dataclass(frozen=True, kw_only=True, eq=False)
class PhaseTrajectory:
    """Result of a run in phase coordinates; SI units, time first.

    Parameters
    ----------
    t : ndarray, shape (n,)
        Times, s.
    i_s, i_r : ndarray, shape (n, 3)
        Stator (winding) and rotor currents, A.
    theta, omega : ndarray, shape (n,)
        Shaft angle, rad, and speed, rad/s.
    i_t : ndarray, shape (n, 3)
        Terminal currents, A.
    v_0 : ndarray, shape (n,)
        Star-point voltage to the supply's neutral, V (zero for delta, which has no star point).
    torque : ndarray, shape (n,)
        Electromagnetic torque, N m.
    """

    t: Array
    i_s: Array
    i_r: Array
    theta: Array
    omega: Array
    i_t: Array
    v_0: Array
    torque: Array


def mutual_inductance(motor: Motor, theta_e: float) -> Array:
    """Mutual inductances l_m(theta_e) between stator (rows) and rotor phases.

    Parameters
    ----------
    motor : Motor
        The motor.
    theta_e : float
        Electrical rotor angle z_p theta_r, rad.

    Returns
    -------
    ndarray, shape (3, 3)
        H.

    References
    ----------
    Thesis (3.3).
    """
    return motor.L_m / 1.5 * np.cos(theta_e + _SHIFT)


def inductance(motor: Motor, theta_e: float) -> Array:
    """Inductance matrix of the six coils.

    Parameters
    ----------
    motor : Motor
        The motor.
    theta_e : float
        Electrical rotor angle, rad.

    Returns
    -------
    ndarray, shape (6, 6)
        H; psi = L (i_sabc, i_rabc).

    References
    ----------
    Thesis (3.2), (3.3).
    """
    own, cross = mutual_inductance(motor, 0.0), mutual_inductance(motor, theta_e)
    L = np.empty((6, 6))
    L[:3, :3] = motor.L_ls * np.eye(3) + own
    L[3:, 3:] = motor.L_lr * np.eye(3) + own
    L[:3, 3:], L[3:, :3] = cross, cross.T
    return L


def inductance_slope(motor: Motor, theta_e: float) -> Array:
    """Derivative of the inductance matrix by the electrical angle.

    Parameters
    ----------
    motor : Motor
        The motor.
    theta_e : float
        Electrical rotor angle, rad.

    Returns
    -------
    ndarray, shape (6, 6)
        H/rad.
    """
    cross = -motor.L_m / 1.5 * np.sin(theta_e + _SHIFT)
    slope = np.zeros((6, 6))
    slope[:3, 3:], slope[3:, :3] = cross, cross.T
    return slope


def phase_derivatives(
    motor: Motor, x: Array, v_t: Array, load: Callable[[float], float], inertia: float
) -> tuple[Array, float, float]:
    """Right-hand side of (3.1)-(3.3) with the connection of the stator.

    Parameters
    ----------
    motor : Motor
        The motor.
    x : ndarray, shape (8,)
        Stator currents, rotor currents (A), shaft angle (rad), speed (rad/s).
    v_t : ndarray, shape (3,)
        Terminal voltages, V.
    load : callable
        Load torque in N m as a function of the speed.
    inertia : float
        kg m2.

    Returns
    -------
    dx : ndarray, shape (8,)
        Time derivatives.
    v_0 : float
        Star-point voltage, V; zero for delta.
    torque : float
        N m.

    References
    ----------
    Thesis (3.1)-(3.3), 3.2.3, torque i_s^T dl_m/dtheta_r i_r of 3.2.4.
    """
    i, theta_e, omega = x[:6], motor.z_p * x[6], x[7]
    L, slope = inductance(motor, theta_e), inductance_slope(motor, theta_e)
    drop = np.concatenate((motor.r_s * i[:3], motor.r_r * i[3:])) + motor.z_p * omega * slope @ i
    star = np.zeros(6)
    if motor.connection == "Y":
        source = np.concatenate((v_t, np.zeros(3)))
        star[:3] = 1.0
    else:
        source = np.concatenate((K_DELTA @ v_t, np.zeros(3)))
    free, per_volt = np.linalg.solve(L, np.stack((source - drop, star), axis=1)).T
    # Y: the star point takes the voltage that keeps the sum of the stator currents at zero
    v_0 = free[:3].sum() / per_volt[:3].sum() if motor.connection == "Y" else 0.0
    torque = motor.z_p * float(i[:3] @ slope[:3, 3:] @ i[3:])
    domega = (torque - motor.B * omega - load(omega)) / inertia
    return np.concatenate((free - v_0 * per_volt, [omega, domega])), v_0, torque


def simulate_phases(
    motor: Motor,
    voltage: Callable[[float], Array],
    load: Callable[[float], float],
    *,
    inertia: float,
    t: Array,
    rtol: float = 1e-12,
) -> PhaseTrajectory:
    """Simulate the motor in phase coordinates from standstill (DOP853, adaptive step).

    Parameters
    ----------
    motor : Motor
        The motor.
    voltage : callable
        Terminal voltages in V, shape (3,), at a time in s.
    load : callable
        Load torque in N m as a function of the speed in rad/s.
    inertia : float
        Moment of inertia on the shaft, kg m2.
    t : ndarray, shape (n,)
        Times of the result, s.
    rtol : float
        Relative tolerance of the integration.

    Returns
    -------
    PhaseTrajectory

    Raises
    ------
    SimulationError
        If the integration fails.

    References
    ----------
    Thesis (3.1)-(3.3).
    """
    from scipy.integrate import solve_ivp

    solution = solve_ivp(
        lambda time, x: phase_derivatives(motor, x, voltage(time), load, inertia)[0],
        (t[0], t[-1]),
        np.zeros(8),
        method="DOP853",
        t_eval=t,
        rtol=rtol,
        atol=1e-11,
    )
    if not solution.success:
        raise SimulationError(f"phase model stopped at t = {solution.t[-1]:g} s: {solution.message}")
    x = solution.y.T
    extras = [phase_derivatives(motor, row, voltage(time), load, inertia)[1:] for time, row in zip(t, x, strict=True)]
    i_s = x[:, :3]
    return PhaseTrajectory(
        t=t,
        i_s=i_s,
        i_r=x[:, 3:6],
        theta=x[:, 6],
        omega=x[:, 7],
        i_t=i_s @ K_DELTA if motor.connection == "delta" else i_s,
        v_0=np.array([e[0] for e in extras]),
        torque=np.array([e[1] for e in extras]),
    )
