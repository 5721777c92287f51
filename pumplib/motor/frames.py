"""Thesis 3.2.2, 3.2.3: transformations between phase quantities, dq0 quantities and terminals.

Space vectors are complex, ``x = x_d + j x_q``; J of the thesis is then multiplication by j. Time runs along
the first axis, phases along the last. Three corrections of the printed text, each shown by a test:

* J = [0 -1; 1 0] (nomenclature), not the matrix printed after (3.6);
* the rotor is transformed with T(+z_p theta_r), not with the printed T(-z_p theta_r) of (3.4);
* the second derived inductance of the nomenclature is L_m', not a second L_s'.
"""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pumplib.errors import ParameterError

Array = NDArray[Any]
A = complex(-0.5, math.sqrt(3) / 2)  # rotation by a third of a turn
PHASE_AXES = np.array([1, A, A**2])  # axis of phase k in the complex plane
J_MATRIX = np.array([[0.0, -1.0], [1.0, 0.0]])  # J of the thesis (nomenclature)
K_DELTA = np.array([[1.0, -1.0, 0.0], [0.0, 1.0, -1.0], [-1.0, 0.0, 1.0]])  # v_s = K v_t (3.10)
# dq blocks of T K T^-1 and T K^T T^-1, B_v and C_i of (3.10), as complex factors
B_V_DELTA = math.sqrt(3) * complex(math.cos(math.pi / 6), math.sin(math.pi / 6))
C_I_DELTA = B_V_DELTA.conjugate()


def dq0_matrix(theta: float) -> Array:
    """Transformation matrix T_dq0(theta) of the thesis.

    Parameters
    ----------
    theta : float
        Angle, rad.

    Returns
    -------
    ndarray, shape (3, 3)
        x_dq0 = T x_abc.

    References
    ----------
    Thesis (3.4) and nomenclature.
    """
    angles = theta + np.array([0.0, 2.0, 4.0]) * math.pi / 3
    return 2 / 3 * np.array([np.cos(angles), np.sin(angles), np.full(3, 0.5)])


def _three(x: Array, what: str) -> Array:
    x = np.asarray(x, dtype=float)
    if x.ndim == 0 or x.shape[-1] != 3:
        raise ParameterError(f"{what} has shape {x.shape}: the last axis must be the three phases (a, b, c).")
    return x


def to_space_vector(abc: Array) -> Array:
    """Space vector of three phase quantities, x_d + j x_q with T_dq0(0).

    Parameters
    ----------
    abc : ndarray, shape (..., 3)
        Phase quantities.

    Returns
    -------
    complex ndarray, shape (...)

    Raises
    ------
    ParameterError
        If the last axis does not have three entries.

    References
    ----------
    Thesis (3.4); amplitude-invariant.
    """
    x = _three(abc, "abc")
    # written out: a product with a 3-vector is handed to threads that cost more than it does
    d, q = x[..., 0] - 0.5 * (x[..., 1] + x[..., 2]), (x[..., 1] - x[..., 2]) * (np.sqrt(3.0) / 2)
    return np.asarray(2 / 3 * (d + 1j * q))


def zero_sequence(abc: Array) -> Array:
    """Zero-sequence component, the mean of the phases.

    Parameters
    ----------
    abc : ndarray, shape (..., 3)
        Phase quantities.

    Returns
    -------
    ndarray, shape (...)

    Raises
    ------
    ParameterError
        If the last axis does not have three entries.
    """
    return _three(abc, "abc").mean(axis=-1)


def to_phases(vector: Array, zero: Array | float = 0.0) -> Array:
    """Phase quantities from space vector and zero sequence; the inverse of the two functions above.

    Parameters
    ----------
    vector : complex ndarray, shape (...)
        Space vector.
    zero : ndarray or float
        Zero-sequence component.

    Returns
    -------
    ndarray, shape (..., 3)

    References
    ----------
    Thesis nomenclature, T_dq0^-1.
    """
    vector = np.asarray(vector)
    return np.real(vector[..., None] * PHASE_AXES.conj()) + np.asarray(zero)[..., None]


def stator_voltage(terminal: Array, connection: str) -> Array:
    """Stator voltage space vector from the terminal voltage, v_s = B_v v_t.

    Parameters
    ----------
    terminal : complex ndarray
        Terminal voltage (line to the supply's neutral), V.
    connection : {"Y", "delta"}
        Connection of the stator.

    Returns
    -------
    complex ndarray
        V.

    Raises
    ------
    ParameterError
        If the connection is neither.

    References
    ----------
    Thesis (3.9), (3.10).
    """
    return terminal if _is_y(connection) else B_V_DELTA * terminal


def terminal_current(stator: Array, connection: str) -> Array:
    """Terminal current space vector from the stator current, i_t = C_i i_s.

    Parameters
    ----------
    stator : complex ndarray
        Stator (winding) current, A.
    connection : {"Y", "delta"}
        Connection of the stator.

    Returns
    -------
    complex ndarray
        A.

    Raises
    ------
    ParameterError
        If the connection is neither.

    References
    ----------
    Thesis (3.9c), (3.10c).
    """
    return stator if _is_y(connection) else C_I_DELTA * stator


def _is_y(connection: str) -> bool:
    if connection not in ("Y", "delta"):
        raise ParameterError(f'connection = {connection!r}: must be "Y" or "delta".')
    return connection == "Y"
