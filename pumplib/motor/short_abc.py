"""Thesis 5.1: the shorted motor in phase coordinates, every winding section a coil of its own.

The reference for `pumplib.motor.short`: nine coupled coils (a healthy and a shorted section of each stator phase,
three rotor phases) with inductances that depend on the rotor angle, joined by Kirchhoff's laws; no transformation,
no effective current. Vectorised over machines and states. Nothing else in the package uses it.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pumplib.machines.parameters import Motor
from pumplib.motor.abc import inductance, inductance_slope, mutual_inductance
from pumplib.motor.frames import K_DELTA
from pumplib.motor.short import Short

Array = NDArray[Any]
MESHES = ("i_a", "i_b", "i_c", "i_f", "i_ra", "i_rb", "i_rc")


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class CoilModel:
    """Coils of one or many machines, in their meshes; the inductance is constant + cosine cos(theta_e) + ...

    Parameters
    ----------
    constant, cosine, sine : ndarray, shape (n, 7, 7)
        Mesh inductance, H.
    resistance : ndarray, shape (n, 7, 7)
        Mesh resistance with the contact, ohm.
    is_delta, z_p : ndarray, shape (n,)
        Connection; pole pairs.
    """

    constant: Array
    cosine: Array
    sine: Array
    resistance: Array
    is_delta: Array
    z_p: Array


def _coils(motor: Motor, short: Short) -> tuple[Array, Array, Array, Array]:
    """Inductances of the nine coils (constant, cosine, sine) and the meshes of one machine."""
    share = np.abs(np.array(short.gamma))
    turns = np.stack((1 - share, share))  # sections (healthy, shorted) by phase
    wound = np.zeros((6, 3))  # which section is wound on which phase's axis, in turns
    for k in range(3):
        wound[k, k], wound[3 + k, k] = turns[0, k], turns[1, k]
    own = mutual_inductance(motor, 0.0)
    leak = np.zeros((6, 6))
    for k in range(3):
        n = turns[:, k]
        two = motor.L_ls * (short.kappa_c * np.diag(n) + (1 - short.kappa_c) * np.outer(n, n))
        leak[np.ix_((k, 3 + k), (k, 3 + k))] = two
    constant = np.zeros((9, 9))
    constant[:6, :6] = leak + wound @ own @ wound.T
    constant[6:, 6:] = inductance(motor, 0.0)[3:, 3:]
    parts = []
    for cross in (mutual_inductance(motor, 0.0), inductance_slope(motor, 0.0)[:3, 3:]):
        one = np.zeros((9, 9))
        one[:6, 6:] = wound @ cross
        one[6:, :6] = one[:6, 6:].T
        parts.append(one)
    # Kirchhoff: coil currents from mesh currents
    mesh = np.zeros((9, 7))
    mesh[:3, :3] = mesh[3:6, :3] = np.eye(3)
    mesh[3:6, 3] = -np.sign(short.gamma)
    mesh[6:, 4:] = np.eye(3)
    ohms = np.concatenate((motor.r_s * turns[0], motor.r_s * turns[1], np.full(3, motor.r_r)))
    resistance = mesh.T @ (ohms[:, None] * mesh)
    resistance[3, 3] += short.r_f
    inductances = np.stack([mesh.T @ one @ mesh for one in (constant, *parts)])
    if not any(short.gamma):
        # no loop: its mesh has neither resistance nor inductance; a unit resistor keeps it at zero
        inductances[0][3, 3], resistance[3, 3] = motor.L_ls, motor.r_s
    return inductances[0], inductances[1], inductances[2], resistance


def coil_model(machines: Sequence[tuple[Motor, Short]]) -> CoilModel:
    """Coils of a list of machines.

    Parameters
    ----------
    machines : sequence of (Motor, Short)
        The machines.

    Returns
    -------
    CoilModel
    """
    parts = [_coils(motor, short) for motor, short in machines]
    constant, cosine, sine, resistance = (np.stack([one[k] for one in parts]) for k in range(4))
    return CoilModel(
        constant=constant,
        cosine=cosine,
        sine=sine,
        resistance=resistance,
        is_delta=np.array([motor.connection == "delta" for motor, _ in machines]),
        z_p=np.array([float(motor.z_p) for motor, _ in machines]),
    )


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class CoilRates:
    """Derivatives and outputs of the coil model.

    Parameters
    ----------
    di : ndarray, shape (n, 7)
        Derivatives of the mesh currents, A/s.
    v_0 : ndarray, shape (n,)
        Star-point voltage, V; zero for delta.
    torque : ndarray, shape (n,)
        N m, from the change of the field's co-energy with the angle.
    """

    di: Array
    v_0: Array
    torque: Array


def coil_voltages(model: CoilModel, i: Array, theta_e: Array, omega: Array) -> tuple[Array, Array]:
    """Mesh inductance, and resistive voltage plus the one induced by the rotation.

    Parameters
    ----------
    model : CoilModel
        Coils of n machines.
    i : ndarray, shape (n, 7)
        Mesh currents, A.
    theta_e, omega : ndarray, shape (n,)
        Electrical angle, rad; shaft speed, rad/s.

    Returns
    -------
    inductance : ndarray, shape (n, 7, 7)
        H.
    voltage : ndarray, shape (n, 7)
        V.
    """
    c, s = np.cos(theta_e)[:, None, None], np.sin(theta_e)[:, None, None]
    slope = c * model.sine - s * model.cosine
    fixed = model.constant + c * model.cosine + s * model.sine
    return fixed, np.einsum("nij,nj->ni", model.resistance + (model.z_p * omega)[:, None, None] * slope, i)


def coil_rates(model: CoilModel, i: Array, theta_e: Array, omega: Array, v_t: Array) -> CoilRates:
    """Right-hand side of the coil model.

    Parameters
    ----------
    model : CoilModel
        Coils of n machines; every mesh must have an inductance.
    i : ndarray, shape (n, 7)
        Mesh currents in the order of `MESHES`, A. In Y the stator currents sum to zero.
    theta_e, omega : ndarray, shape (n,)
        Electrical angle, rad; shaft speed, rad/s.
    v_t : ndarray, shape (n, 3)
        Terminal voltages, V.

    Returns
    -------
    CoilRates
    """
    n = len(i)
    fixed, drop = coil_voltages(model, i, theta_e, omega)
    # the voltage of the star point is what keeps the sum of the stator currents at zero; a delta has none
    system = np.zeros((n, 8, 8))
    system[:, :7, :7] = fixed
    system[:, :3, 7] = system[:, 7, :3] = np.where(model.is_delta, 0.0, 1.0)[:, None]
    system[:, 7, 7] = np.where(model.is_delta, 1.0, 0.0)
    right = np.zeros((n, 8))
    right[:, :7] = -drop
    right[:, :3] += np.where(model.is_delta[:, None], v_t @ K_DELTA.T, v_t)
    found = np.linalg.solve(system, right[..., None])[..., 0]
    return CoilRates(di=found[:, :7], v_0=found[:, 7], torque=coil_torque(model, i, theta_e))


def coil_torque(model: CoilModel, i: Array, theta_e: Array) -> Array:
    """Torque from the change of the co-energy with the angle.

    Parameters
    ----------
    model : CoilModel
        Coils of n machines.
    i : ndarray, shape (n, 7)
        Mesh currents, A.
    theta_e : ndarray, shape (n,)
        Electrical angle, rad.

    Returns
    -------
    ndarray, shape (n,)
        N m.
    """
    slope = np.cos(theta_e)[:, None, None] * model.sine - np.sin(theta_e)[:, None, None] * model.cosine
    return np.asarray(0.5 * model.z_p * np.einsum("ni,nij,nj->n", i, slope, i))
