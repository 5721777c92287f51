"""Thesis 3.2.3, 3.2.4: sinusoidal steady state of the dq model, by complex phasors."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from pumplib.machines.parameters import Motor
from pumplib.motor.dq import torque

Array = NDArray[Any]


def steady_currents(motor: Motor, v_s: Array, omega_s: Array, omega: Array) -> tuple[Array, Array]:
    """Stator and magnetising current when all vectors rotate with the supply.

    Parameters
    ----------
    motor : Motor
        The motor.
    v_s : complex ndarray, shape (...)
        Stator voltage amplitude as a phasor, V.
    omega_s : ndarray, shape (...)
        Angular frequency of the supply, rad/s; negative for a negative sequence.
    omega : ndarray, shape (...)
        Shaft speed, rad/s.

    Returns
    -------
    i_s, i_m : complex ndarray, shape (...)
        A.

    References
    ----------
    Thesis (3.7a), (3.7c) with d/dt replaced by j omega_s.
    """
    rotor = motor.R_r_prime - 1j * motor.z_p * np.asarray(omega) * motor.L_m_prime
    magnetising = rotor + 1j * np.asarray(omega_s) * motor.L_m_prime
    ratio = motor.R_r_prime / magnetising  # i_m / i_s
    i_s = np.asarray(v_s) / (motor.r_s + motor.R_r_prime + 1j * np.asarray(omega_s) * motor.L_s_prime - rotor * ratio)
    return i_s, ratio * i_s


def steady_torque(motor: Motor, v_s: Array, omega_s: Array, omega: Array) -> Array:
    """Torque in the sinusoidal steady state.

    Parameters
    ----------
    motor : Motor
        The motor.
    v_s : complex ndarray, shape (...)
        Stator voltage amplitude, V.
    omega_s : ndarray, shape (...)
        Angular frequency of the supply, rad/s.
    omega : ndarray, shape (...)
        Shaft speed, rad/s.

    Returns
    -------
    ndarray, shape (...)
        N m.

    References
    ----------
    Thesis (3.11).
    """
    i_s, i_m = steady_currents(motor, v_s, omega_s, omega)
    k_T = 1.5 * motor.z_p * motor.L_m_prime
    return torque.py_func(i_s.real, i_s.imag, i_m.real, i_m.imag, k_T)


def power_gap(motor: Motor, v_s: complex, omega_s: float, omega: float, torque_speed: float) -> tuple[float, float]:
    """Torque and what is missing in the power balance of the steady state.

    Input power minus both copper losses has to equal torque times speed. With the other sign of J the model
    is the one of the mirrored speed, so `omega` and `torque_speed` of opposite sign give the negative control.

    Parameters
    ----------
    motor : Motor
        The motor.
    v_s : complex
        Stator voltage amplitude, V.
    omega_s : float
        Angular frequency, rad/s.
    omega : float
        Speed in the equations, rad/s.
    torque_speed : float
        Speed that the torque is said to work at, rad/s.

    Returns
    -------
    torque : float
        N m.
    imbalance : float
        Power balance error divided by the power of the torque, dimensionless.

    References
    ----------
    Thesis (3.7), (3.11); nomenclature against the matrix J printed after (3.6).
    """
    i_s, i_m = steady_currents(motor, np.array(v_s), np.array(omega_s), np.array(omega))
    supplied = 1.5 * (v_s * np.conj(i_s)).real
    copper = 1.5 * (motor.r_s * abs(i_s) ** 2 + motor.R_r_prime * abs(i_m - i_s) ** 2)
    T_e = float(steady_torque(motor, np.array(v_s), np.array(omega_s), np.array(omega)))
    return T_e, float((supplied - copper - T_e * torque_speed) / abs(T_e * torque_speed))
