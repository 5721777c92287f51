"""Thesis 5.2.3, 5.3: positive and negative sequence of a window, from products of voltage and current.

With v = V_1 z + V_2 conj(z) and i = I_1 z + I_2 conj(z), z turning with the supply, the mean of v v is 2 V_1 V_2,
that of i v is I_1 V_2 + I_2 V_1, that of i conj(v) is I_1 conj(V_1) + I_2 conj(V_2). So the ratios V_2/conj(V_1),
I_1/V_1 and I_2/conj(V_1) need neither the angle of the supply nor its frequency, and go on through a ramp.
Harmonics meet only their own kind. The window is tapered: a rectangular one leaks V_1^2 into V_2.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pumplib.errors import DataError
from pumplib.machines.parameters import Motor
from pumplib.observers.stator import Estimates
from pumplib.observers.stator_kernel import COLUMNS

Array = NDArray[Any]
SHORTEST = 0.1  # s, of a window


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Sequences:
    """What a window of the observer's rows says; scalars, or arrays of many windows.

    Parameters
    ----------
    t : ndarray
        End of the window, s.
    omega_s : ndarray
        Angular frequency of the supply, rad/s.
    omega : ndarray
        Electrical speed of the observer, rad/s; synchronism where it does not run.
    V_1 : ndarray
        Amplitude of the positive-sequence winding voltage, V.
    rho : complex ndarray
        V_2/conj(V_1).
    y_1 : complex ndarray
        I_1/V_1, S.
    y_2 : complex ndarray
        I_2/conj(V_1), S.
    g_c : complex ndarray
        Mean fault coefficient of the observer; NaN where it does not run.
    flag : ndarray of int
        Flags of the observer that were up within the window.
    """

    t: Array
    omega_s: Array
    omega: Array
    V_1: Array
    rho: Array
    y_1: Array
    y_2: Array
    g_c: Array
    flag: Array


def sequences(estimates: Estimates, begin: float, end: float) -> Sequences:
    """Sequences of one window.

    Parameters
    ----------
    estimates : Estimates
        Of the observer, at 200 Hz or more.
    begin, end : float
        Window, s.

    Returns
    -------
    Sequences
        Of scalars.

    Raises
    ------
    DataError
        If the record does not hold the window, or the window is too short.
    """
    # a row's time is its last sample, so a row belongs to the window if it ends within
    first = math.ceil((begin - estimates.start) * estimates.rate - 1e-6)
    last = math.floor((end - estimates.start) * estimates.rate + 1e-6) + 1
    if first < -1 or last > len(estimates.rows) + 1 or end - begin < SHORTEST:
        raise DataError(
            f"window {begin:g} to {end:g} s: the record runs from {estimates.start:g} to "
            f"{estimates.start + len(estimates.rows) / estimates.rate:g} s, and a window needs {SHORTEST:g} s."
        )
    rows = estimates.rows[max(first, 0) : last]
    return _sequences(estimates, rows[None], np.array([end]), one=True)


def sliding(estimates: Estimates, window: float = 0.5, step: float = 0.01) -> Sequences:
    """Sequences of a window that slides over the record.

    Parameters
    ----------
    estimates : Estimates
        Of the observer, at 200 Hz or more.
    window, step : float
        Length and distance of the windows, s.

    Returns
    -------
    Sequences
        Of arrays, shape (windows,); `t` is the end of each window.

    Raises
    ------
    DataError
        If the record is shorter than the window, or the window is too short.
    """
    length, hop = round(window * estimates.rate), max(1, round(step * estimates.rate))
    if length > len(estimates.rows) or window < SHORTEST:
        raise DataError(
            f"window = {window:g} s: must be at least {SHORTEST:g} s and fit into the record of "
            f"{len(estimates.rows) / estimates.rate:g} s."
        )
    pieces = np.lib.stride_tricks.sliding_window_view(estimates.rows, length, axis=0)[::hop].transpose(0, 2, 1)
    ends = estimates.start + (length + hop * np.arange(len(pieces))) / estimates.rate
    return _sequences(estimates, pieces, ends, one=False)


def _sequences(estimates: Estimates, pieces: Array, ends: Array, one: bool) -> Sequences:
    if estimates.rate < 200:
        raise DataError(f"estimates at {estimates.rate:g} Hz: sequences need 200 Hz or more; lower `every`.")
    n = pieces.shape[1]
    taper = np.hanning(n + 2)[1:-1]
    mean = np.einsum("wnc,n->wc", pieces, taper / taper.sum())
    at = {name: mean[:, k] for k, name in enumerate(COLUMNS)}
    vv, iv, ii = (at[f"{name}_re"] + 1j * at[f"{name}_im"] for name in ("vv", "iv", "ii"))
    power = at["v2"]
    if not np.all(power > 0):
        raise DataError("a window has no voltage at all: connect the voltages or leave the window out.")
    rho, V2, y_1, y_2 = solve_products(vv, power, iv, ii)
    flag = np.bitwise_or.reduce(pieces[:, :, COLUMNS.index("flag")].astype(np.int64), axis=1)
    omega = np.where(np.isfinite(at["omega"]), at["omega"], at["omega_s"])
    values = (ends, at["omega_s"], omega, np.sqrt(V2), rho, y_1, y_2, at["g_re"] + 1j * at["g_im"], flag)
    names = ("t", "omega_s", "omega", "V_1", "rho", "y_1", "y_2", "g_c", "flag")
    return Sequences(**{name: value[0] if one else value for name, value in zip(names, values, strict=True)})


def solve_products(vv: Array, power: Array, iv: Array, ii: Array) -> tuple[Array, Array, Array, Array]:
    """Sequences from mean products.

    Parameters
    ----------
    vv, power : ndarray
        Means of v v and |v|^2, V2.
    iv, ii : ndarray
        Means of i conj(v) and i v, V A.

    Returns
    -------
    rho : complex ndarray
        V_2/conj(V_1), of size below one.
    V2 : ndarray
        |V_1|^2, V2.
    y_1, y_2 : complex ndarray
        I_1/V_1 and I_2/conj(V_1), S.
    """
    # |v|^2 = |V_1|^2 (1 + |rho|^2) and vv = 2 |V_1|^2 rho: the smaller root
    half = np.minimum(np.abs(vv) / power, 1.0)
    rho = vv / (power * (1 + np.sqrt(1 - half**2)))
    square = np.abs(rho) ** 2
    V2 = power / (1 + square)
    # iv/V2 = y_1 + y_2 conj(rho), ii/V2 = y_1 rho + y_2
    y_1 = (iv - ii * np.conj(rho)) / (V2 * np.maximum(1 - square, 1e-12))
    y_2 = ii / V2 - y_1 * rho
    return rho, V2, y_1, y_2


def admittance(motor: Motor, omega_s: Array, omega: Array) -> Array:
    """Admittance of the healthy motor for a voltage that turns with a given frequency.

    Parameters
    ----------
    motor : Motor
        The motor.
    omega_s : ndarray
        Angular frequency, rad/s; negative for the negative sequence.
    omega : ndarray
        Electrical speed, rad/s.

    Returns
    -------
    complex ndarray
        Winding current over winding voltage, S.

    References
    ----------
    Thesis (3.7a), (3.7c) with d/dt replaced by j omega_s.
    """
    rotor = motor.R_r_prime - 1j * np.asarray(omega) * motor.L_m_prime
    magnetising = rotor + 1j * np.asarray(omega_s) * motor.L_m_prime
    behind = rotor * motor.R_r_prime / magnetising
    return np.asarray(1 / (motor.r_s + motor.R_r_prime + 1j * np.asarray(omega_s) * motor.L_s_prime - behind))


def fault_coefficient(motor: Motor, s: Sequences) -> Array:
    """Fault coefficient from the sequences alone: what the belief does not explain of the negative sequence.

    Parameters
    ----------
    motor : Motor
        What is believed about the motor.
    s : Sequences
        Windows.

    Returns
    -------
    complex ndarray
        g_c, comparable with the observer's.
    """
    conj_Z = motor.r_s - 1j * s.omega_s * motor.L_ls
    return np.asarray(conj_Z * (s.y_2 - admittance(motor, -s.omega_s, s.omega) * s.rho))
