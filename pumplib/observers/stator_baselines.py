"""Thesis 5.3: what the stator observer is compared with: simpler statistics for the same fault.

All are taken from the same windows as the decision, and each gets its own threshold at an equal rate of false alarms.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pumplib.errors import DataError
from pumplib.machines.parameters import Motor
from pumplib.motor.frames import stator_voltage, to_space_vector
from pumplib.observers.stator_sequences import Sequences, admittance, fault_coefficient

Array = NDArray[Any]


def raw_negative_sequence(s: Sequences) -> Array:
    """Amplitude of the negative-sequence current, the usual monitor.

    Parameters
    ----------
    s : Sequences
        Windows.

    Returns
    -------
    ndarray
        A, of the winding current.
    """
    return np.asarray(np.abs(s.y_2) * s.V_1)


def compensated(motor: Motor, s: Sequences, records: Sequence[Sequences] = ()) -> Array:
    """Negative sequence less what the believed impedance lets the supply's unbalance drive, less its healthy mean.

    Parameters
    ----------
    motor : Motor
        What is believed about the motor.
    s : Sequences
        Windows.
    records : sequence of Sequences
        Healthy windows; none leaves the healthy mean in.

    Returns
    -------
    complex ndarray
        In the unit of g_c, so that 3|.| compares with the shorted share.
    """
    healthy = np.mean([fault_coefficient(motor, one) for one in records]) if records else 0.0
    return np.asarray(fault_coefficient(motor, s) - healthy)


def observer_difference(s: Sequences, records: Sequence[Sequences] = ()) -> Array:
    """Fault coefficient of the observer less its healthy mean.

    Parameters
    ----------
    s : Sequences
        Windows.
    records : sequence of Sequences
        Healthy windows; none leaves the healthy mean in.

    Returns
    -------
    complex ndarray
    """
    return np.asarray(s.g_c - (np.mean([one.g_c for one in records]) if records else 0.0))


def regressed(motor: Motor, s: Sequences, records: Sequence[Sequences], ridge: float = 1e-4) -> Array:
    """Fault coefficient of the observer less a healthy line in the supply's unbalance, c_0 + c_1 r.

    Parameters
    ----------
    motor : Motor
        What is believed about the motor.
    s : Sequences
        Windows.
    records : sequence of Sequences
        Healthy windows, at least one.
    ridge : float
        Weight that holds the slope c_1 near zero where the records hardly differ in their unbalance.

    Returns
    -------
    complex ndarray

    Raises
    ------
    DataError
        If there is no record.
    """
    if not records:
        raise DataError("regressed: needs at least one healthy window.")

    def slope(one: Sequences) -> Array:
        conj_Z = motor.r_s - 1j * one.omega_s * motor.L_ls
        return np.asarray(conj_Z * admittance(motor, -one.omega_s, one.omega) * one.rho)

    X = np.array([[1.0, slope(one)] for one in records])
    y = np.array([one.g_c for one in records])
    c = np.linalg.solve(X.conj().T @ X + ridge * np.diag([1e-3, 1.0]), X.conj().T @ y)
    return np.asarray(s.g_c - c[0] - c[1] * slope(s))


def star_point(v: ArrayLike, v_0: ArrayLike, connection: str) -> float:
    """Fundamental of the star-point voltage relative to the winding voltage; needs a wire to the star point.

    Parameters
    ----------
    v : array_like, shape (n, 3)
        Terminal voltages to the supply's neutral, V.
    v_0 : array_like, shape (n,)
        Star point to the supply's neutral, V.
    connection : {"Y", "delta"}
        Connection of the stator; a delta has no star point.

    Returns
    -------
    float
        NaN in delta.

    Raises
    ------
    DataError
        If the two differ in length.
    """
    if connection != "Y":
        return float("nan")
    x, zero = stator_voltage(to_space_vector(np.asarray(v, dtype=float)), "Y"), np.asarray(v_0, dtype=float)
    if x.shape != zero.shape:
        raise DataError(f"v has {len(x)} samples, v_0 {len(zero)}: must agree.")
    taper = np.hanning(len(x) + 2)[1:-1]
    return float(2 * abs(taper @ (x * zero)) / (taper @ np.abs(x) ** 2))
