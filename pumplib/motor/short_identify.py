"""Thesis 5.1, 5.3: what an inter-turn short circuit leaves in the terminal currents, and what can be read from it.

A short of gamma of the turns of phase k draws a current that is the answer of an admittance Y_f to the voltage of
that phase. With the voltage filtered by the stator impedance, ``L_ls dw/dt + r_s w = v_s``, it adds

    g_0 w + g_c conj(w),   g_c = a_k^2 conj(g_hat) / 3,   g_hat = Y_f (r_s + j omega_s L_ls)

to the space vector of the winding currents. g_0 has the sequence of the healthy current and cannot be told from
it; g_c turns against it. With no contact resistance and uncoupled leakage g_hat is the real number g; with any
other its angle lies between 0 and that of the stator impedance, less than the 120 degrees between two phases.
All functions take scalars or arrays that broadcast; currents and voltages of a delta are those of the windings.
"""

from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pumplib.errors import ParameterError
from pumplib.motor.frames import PHASE_AXES

Array = NDArray[Any]
Connection = Literal["Y", "delta"]


def _offset(connection: str) -> float:
    """1/gamma - 1/g: the rest of the winding carries the return current, in Y also through the other phases."""
    if connection not in ("Y", "delta"):
        raise ParameterError(f'connection = {connection!r}: must be "Y" or "delta".')
    return 2 / 3 if connection == "Y" else 1.0


def _numbers(name: str, value: ArrayLike, unit: str, low: float, high: float, open_low: bool = False) -> Array:
    x = np.asarray(value, dtype=float)
    wrong = ~((x > low if open_low else x >= low) & (x <= high))
    if wrong.any():
        raise ParameterError(
            f"{name} = {x[wrong].flat[0]:g} {unit}: must be {'>' if open_low else '>='} {low:g} and <= {high:g} {unit}."
        )
    return x


def _complex(name: str, value: ArrayLike, unit: str) -> Array:
    x = np.asarray(value, dtype=complex)
    if not np.isfinite(x).all():
        raise ParameterError(f"{name} holds a value that is not finite ({unit}); leave such records out.")
    return x


def g_of_gamma(gamma: ArrayLike, connection: str) -> Array:
    """Size of the fault term of a bolted short with uncoupled leakage.

    Parameters
    ----------
    gamma : array_like
        Shorted share of the turns of one phase, 0..1 (delta: below 1).
    connection : {"Y", "delta"}
        Connection of the stator.

    Returns
    -------
    ndarray
        g, dimensionless: gamma/(1 - 2 gamma/3) in Y, gamma/(1 - gamma) in delta.

    Raises
    ------
    ParameterError
        If the share lies outside 0..1, a delta winding is shorted as a whole, or the connection is unknown.
    """
    x, offset = _numbers("gamma", gamma, "-", 0.0, 1.0), _offset(connection)
    if connection == "delta" and np.any(x == 1.0):
        raise ParameterError("gamma = 1 in delta shorts two lines: no loop resistance is left; give less than 1.")
    return np.asarray(x / (1 - offset * x))


def gamma_of_g(g: ArrayLike, connection: str) -> Array:
    """Shorted share of the turns from the size of the fault term; the inverse of `g_of_gamma`.

    Parameters
    ----------
    g : array_like
        Size, dimensionless, 0..3 in Y (all turns of a phase), any in delta.
    connection : {"Y", "delta"}
        Connection of the stator.

    Returns
    -------
    ndarray
        gamma = g/(1 + 2g/3) in Y, g/(1 + g) in delta.

    Raises
    ------
    ParameterError
        If g is negative or not finite, or the connection is unknown.
    """
    x, offset = _numbers("g", g, "-", 0.0, np.finfo(float).max), _offset(connection)
    return np.asarray(x / (1 + offset * x))


def stator_impedance(r_s: ArrayLike, L_ls: ArrayLike, omega_s: ArrayLike) -> Array:
    """Resistance and leakage of a stator phase as an impedance, which filters the voltage to w.

    Parameters
    ----------
    r_s : array_like
        Stator resistance, ohm.
    L_ls : array_like
        Stator leakage inductance, H.
    omega_s : array_like
        Angular frequency of the supply, rad/s; negative where the phases are swapped.

    Returns
    -------
    complex ndarray
        ohm.

    Raises
    ------
    ParameterError
        If the resistance or inductance is not positive or a value not finite.
    """
    r = _numbers("r_s", r_s, "ohm", 0.0, 1e6, True)
    L = _numbers("L_ls", L_ls, "H", 0.0, 1e3, True)
    return np.asarray(r + 1j * _numbers("omega_s", omega_s, "rad/s", -1e5, 1e5) * L)


def phi_z(r_s: ArrayLike, L_ls: ArrayLike, omega_s: ArrayLike) -> Array:
    """Width of the sector in which the fault term of one phase lies, the angle of the stator impedance.

    Parameters
    ----------
    r_s, L_ls, omega_s : array_like
        As in `stator_impedance`.

    Returns
    -------
    ndarray
        rad; negative for a negative frequency.
    """
    return np.angle(stator_impedance(r_s, L_ls, omega_s))


def sector_centres(r_s: float, L_ls: float, omega_s: float) -> Array:
    """Angle of g_c in the middle of what a single-phase short can give, for each phase.

    Parameters
    ----------
    r_s : float
        Stator resistance, ohm.
    L_ls : float
        Stator leakage inductance, H.
    omega_s : float
        Angular frequency of the supply, rad/s.

    Returns
    -------
    ndarray, shape (3,)
        rad in (-pi, pi]; the sectors reach `phi_z`/2 to either side.
    """
    return np.angle(PHASE_AXES**2 * np.exp(-0.5j * phi_z(r_s, L_ls, omega_s)))


def _loop(gammas: ArrayLike, connection: str) -> tuple[Array, Array, Array]:
    """Signed shares, sigma and s_0 of a loop, the last axis of the shares being the phases."""
    _offset(connection)
    shares = np.asarray(gammas, dtype=float)
    if shares.ndim == 0 or shares.shape[-1] != 3 or not (np.abs(shares) <= 1).all():
        raise ParameterError(f"gammas = {gammas!r}: give the signed shares of phases a, b, c, each within -1..1.")
    sigma = np.abs(shares).sum(axis=-1) - (shares**2).sum(axis=-1)
    s_0 = shares.sum(axis=-1) ** 2 / 3 if connection == "Y" else np.zeros_like(sigma)
    return shares, sigma, s_0


def loop_impedance(
    gammas: ArrayLike, r_s: float, L_ls: float, omega_s: ArrayLike, *, connection: str, r_f: ArrayLike = 0.0,
    kappa_c: ArrayLike = 1.0,
) -> Array:  # fmt: skip
    """Impedance of the short-circuit loop behind the voltage that drives it, gamma^T v_s.

    Parameters
    ----------
    gammas : array_like, shape (..., 3)
        Signed shares of the turns in the loop.
    r_s, L_ls : float
        Stator resistance, ohm, and leakage inductance, H.
    omega_s : array_like
        Angular frequency, rad/s.
    connection : {"Y", "delta"}
        Connection of the stator.
    r_f : array_like
        Contact resistance, ohm.
    kappa_c : array_like
        Uncoupled share of the leakage of two sections of a winding, 0..1.

    Returns
    -------
    complex ndarray
        ohm.

    Raises
    ------
    ParameterError
        If a value is outside its range.
    """
    _, sigma, s_0 = _loop(gammas, connection)
    Z = stator_impedance(r_s, L_ls, omega_s)
    contact = _numbers("r_f", r_f, "ohm", 0.0, 1e9)
    kappa = _numbers("kappa_c", kappa_c, "-", 0.0, 1.0)
    return np.asarray(contact + Z.real * (sigma + s_0) + 1j * Z.imag * (kappa * sigma + s_0))


def fault_coefficient(
    gammas: ArrayLike, r_s: float, L_ls: float, omega_s: ArrayLike, *, connection: str, r_f: ArrayLike = 0.0,
    kappa_c: ArrayLike = 1.0,
) -> Array:  # fmt: skip
    """Fault term g_c that a loop causes under a supply of one frequency.

    Turning the loop's signed shares into one space vector s = sum gamma_k a_k gives
    g_c = s^2 conj(Z/Z_loop)/3: a loop between two phases has the angle 2 arg(s), not that of either phase.

    Parameters
    ----------
    gammas : array_like, shape (..., 3)
        Signed shares of the turns in the loop.
    r_s, L_ls, omega_s, connection, r_f, kappa_c
        As in `loop_impedance`.

    Returns
    -------
    complex ndarray
        Dimensionless.

    Raises
    ------
    ParameterError
        If a value is outside its range, or nothing limits the current of the loop.
    """
    shares, _, _ = _loop(gammas, connection)
    loop = loop_impedance(gammas, r_s, L_ls, omega_s, connection=connection, r_f=r_f, kappa_c=kappa_c)
    s = shares @ PHASE_AXES
    empty = ~shares.any(axis=-1) & (loop == 0)
    if np.any((loop == 0) & ~empty):
        raise ParameterError("the loop has no impedance (a whole delta winding shorted, r_f = 0): raise r_f.")
    return np.asarray(s**2 / 3 * np.conj(stator_impedance(r_s, L_ls, omega_s) / np.where(empty, 1.0, loop)))


def g_hat_of_phase(g_c: ArrayLike, phase: ArrayLike) -> Array:
    """Fault term turned back to the axis of a phase: real and positive for a bolted short of uncoupled leakage.

    Parameters
    ----------
    g_c : array_like
        Fault term less its healthy value, dimensionless.
    phase : array_like of int
        Faulty phase, 0, 1 or 2.

    Returns
    -------
    complex ndarray
        g_hat = 3 conj(g_c conj(a_k^2)).

    Raises
    ------
    ParameterError
        If the phase is none of 0, 1, 2 or g_c not finite.
    """
    k = np.asarray(phase)
    if not np.isin(k, (0, 1, 2)).all():
        raise ParameterError(f"phase = {phase!r}: must be 0, 1 or 2 for phases a, b, c.")
    axes = PHASE_AXES[k.astype(int)]
    return np.asarray(3 * np.conj(_complex("g_c", g_c, "-")) * axes**2)


def fault_admittance(g_hat: ArrayLike, r_s: ArrayLike, L_ls: ArrayLike, omega_s: ArrayLike) -> Array:
    """Admittance that the short adds to the faulty phase.

    Parameters
    ----------
    g_hat : array_like
        Fault term on the axis of the phase, see `g_hat_of_phase`.
    r_s, L_ls, omega_s : array_like
        As in `stator_impedance`.

    Returns
    -------
    complex ndarray
        Y_f, S. 1/Y_f = (1/gamma - c) r_s + r_f/gamma^2 + j omega_s L_ls (...), with c = 2/3 in Y and 1 in delta.

    Raises
    ------
    ParameterError
        If a value is not finite or outside its range.
    """
    return np.asarray(_complex("g_hat", g_hat, "-") / stator_impedance(r_s, L_ls, omega_s))


def gamma_R(Y_f: ArrayLike, r_s: ArrayLike, connection: str) -> Array:
    """Shorted share of the turns from the resistance of the branch, whatever the leakage.

    The real part of 1/Y_f does not contain the leakage. A contact resistance makes the branch look like a
    smaller short: the result is then the bolted short of equal resistance, gamma/(1 + r_f/(gamma r_s)), a lower
    bound of the true share.

    Parameters
    ----------
    Y_f : array_like
        Admittance of the branch, S; zero for a healthy phase.
    r_s : array_like
        Stator resistance, ohm. An error of it comes back in the result with the opposite sign.
    connection : {"Y", "delta"}
        Connection of the stator.

    Returns
    -------
    ndarray
        Equivalent gamma.

    Raises
    ------
    ParameterError
        If an admittance feeds power back (negative real part), which no short does: too much noise, or not a short.

    References
    ----------
    Thesis 5.1, number of shorted turns; reconstructed.
    """
    Y = _complex("Y_f", Y_f, "S")
    r = _numbers("r_s", r_s, "ohm", 0.0, 1e6, True)
    offset = _offset(connection)
    wrong = (Y.real <= 0) & (Y != 0)
    if wrong.any():
        raise ParameterError(
            f"Y_f = {complex(Y[wrong].flat[0]):.3g} S: a short takes power, its admittance has a positive real part; "
            "decide on detection and phase first."
        )
    q = r * np.abs(Y) ** 2 / np.where(wrong | (Y == 0), 1.0, Y.real)
    return np.asarray(q / (1 + offset * q))


def contact_resistance_bound(Y_f: complex, r_s: float, gamma: float, connection: str) -> float:
    """Contact resistance that goes with an assumed share of the turns.

    One frequency gives one resistance: every share above `gamma_R` explains it with its own contact resistance.

    Parameters
    ----------
    Y_f : complex
        Admittance of the branch, S.
    r_s : float
        Stator resistance, ohm.
    gamma : float
        Assumed share of the turns, 0..1.
    connection : {"Y", "delta"}
        Connection of the stator.

    Returns
    -------
    float
        r_f = gamma^2 (Re(1/Y_f) - (1/gamma - c) r_s), ohm.

    Raises
    ------
    ParameterError
        If the share is below the equivalent bolted short: the resistance would be negative.
    """
    share = float(_numbers("gamma", gamma, "-", 0.0, 1.0, True))
    least = float(gamma_R(Y_f, r_s, connection))
    if share < least * (1 - 1e-9):
        raise ParameterError(f"gamma = {share:g} is below the equivalent bolted short {least:g}: give more turns.")
    return max(0.0, share**2 * ((1 / complex(Y_f)).real - (1 / share - _offset(connection)) * r_s))
