"""Thesis 5.2, 5.3: members of the bilinear class: the shorted motor in three forms, and a fouling heat exchanger.

The motor in the complex states (i', i_m), with the filtered voltage w of `pumplib.motor.short_identify` as an input:
its speed is a parameter of A, the short one of the output. The same short as a state F = g_c conj(w) of its own,
with the parameter in B, is the form of the direct observer. The heat exchanger is none of ours.
"""

import math
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray

from pumplib.errors import ParameterError
from pumplib.machines.parameters import Motor
from pumplib.machines.quantity import Parameters, Quantity
from pumplib.observers.adaptive import BilinearSystem

Array = NDArray[Any]


def motor_matrices(motor: Motor) -> tuple[Array, Array, Array]:
    """Complex motor equations in (i', i_m): known part, part of the electrical speed, input.

    Parameters
    ----------
    motor : Motor
        The motor.

    Returns
    -------
    A0, A1 : ndarray, shape (2, 2)
        1/s, and 1/rad.
    B : ndarray, shape (2, 1)
        1/H.

    References
    ----------
    Thesis (3.7).
    """
    R, L_s, L_m = motor.R_r_prime, motor.L_s_prime, motor.L_m_prime
    A0 = np.array([[-(motor.r_s + R) / L_s, R / L_s], [R / L_m, -R / L_m]], dtype=complex)
    A1 = np.array([[0, -1j * L_m / L_s], [0, 1j]])
    return A0, A1, np.array([[1 / L_s], [0]], dtype=complex)


def motor_speed(motor: Motor) -> BilinearSystem:
    """Healthy motor, unknown electrical speed; input v_s, output the stator current.

    Parameters
    ----------
    motor : Motor
        The motor.

    Returns
    -------
    BilinearSystem
        theta = (omega,), rad/s.
    """
    A0, A1, B = motor_matrices(motor)
    return BilinearSystem(
        A0=A0, A=A1[None], B0=B, B=np.zeros((1, 2, 1)), C=np.array([[1, 0]]), D=np.zeros((1, 1, 1)),
        names=("omega, rad/s",), name="motor, speed",
    )  # fmt: skip


def motor_speed_and_short(motor: Motor) -> BilinearSystem:
    """Motor with unknown electrical speed and unknown fault term g_c; inputs v_s, conj(w), output the current.

    The common-mode part g_0 w of a short is not in it: it turns with the healthy current and must be tied to g_c,
    which makes the problem nonlinear (see the stator observer).

    Parameters
    ----------
    motor : Motor
        The motor.

    Returns
    -------
    BilinearSystem
        theta = (omega, Re g_c, Im g_c).
    """
    A0, A1, B = motor_matrices(motor)
    nought = np.zeros((2, 2))
    D = np.zeros((3, 1, 2), complex)
    D[1, 0, 1], D[2, 0, 1] = 1, 1j
    return BilinearSystem(
        A0=A0, A=np.stack([A1, nought, nought]), B0=np.hstack([B, np.zeros((2, 1))]), B=np.zeros((3, 2, 2)),
        C=np.array([[1, 0]]), D=D, names=("omega, rad/s", "Re g_c, -", "Im g_c, -"), name="motor, speed and short",
    )  # fmt: skip


def motor_short_state(motor: Motor, omega_e: float | None = None) -> BilinearSystem:
    """Motor with the fault current as a third state F = g_c conj(w); inputs v_s, conj(v_s), output i' + F.

    Parameters
    ----------
    motor : Motor
        The motor.
    omega_e : float, optional
        Known electrical speed, rad/s; a parameter if left out.

    Returns
    -------
    BilinearSystem
        theta = (Re g_c, Im g_c), after the speed if that is unknown.

    Raises
    ------
    ParameterError
        If the speed is not finite.
    """
    A0, A1, B = motor_matrices(motor)
    first, second = np.zeros((3, 3), complex), np.zeros((3, 3), complex)
    first[:2, :2], first[2, 2], second[:2, :2] = A0, -motor.r_s / motor.L_ls, A1
    B0 = np.zeros((3, 2), complex)
    B0[:2, :1] = B
    drive = np.zeros((2, 3, 2), complex)
    drive[0, 2, 1], drive[1, 2, 1] = 1 / motor.L_ls, 1j / motor.L_ls
    names: tuple[str, ...] = ("Re g_c, -", "Im g_c, -")
    A = np.zeros((2, 3, 3), complex)
    if omega_e is None:
        names, A = ("omega, rad/s", *names), np.stack([second, *A])
        drive = np.concatenate([np.zeros((1, 3, 2)), drive])
    else:
        if not math.isfinite(omega_e):
            raise ParameterError(f"motor_short_state: omega_e = {omega_e!r} rad/s; must be finite.")
        first = first + omega_e * second
    return BilinearSystem(
        A0=first, A=A, B0=B0, B=drive, C=np.array([[1, 0, 1]]), D=np.zeros((len(names), 1, 2)), names=names,
        name="motor, short as a state",
    )  # fmt: skip


@dataclass(frozen=True, kw_only=True, slots=True)
class HeatExchanger(Parameters):
    """Counter-flow double-pipe heat exchanger as one cell on each side; water, of bench size (values assumed).

    The fouling lowers the heat-transfer coefficient times area, theta = U A in W/K.

    References
    ----------
    C.-M. Astorga-Zaragoza, V.-M. Alvarado-Martinez, A. Zavala-Rio, R.-M. Mendez-Ocana, G.-V. Guerrero-Ramirez,
    Observer-based monitoring of heat exchangers, ISA Transactions 47 (2008) 15-24: the model and the task.
    """

    flow_hot: Annotated[float, Quantity("m3/s", "hot flow", 0.0, 1.0, True)] = 3e-5
    flow_cold: Annotated[float, Quantity("m3/s", "cold flow", 0.0, 1.0, True)] = 1e-4
    volume_hot: Annotated[float, Quantity("-", "hot volume, m3", 0.0, 10.0, True)] = 2e-4
    volume_cold: Annotated[float, Quantity("-", "cold volume, m3", 0.0, 10.0, True)] = 4e-4
    heat: Annotated[float, Quantity("-", "heat capacity of the liquid, J/(m3 K)", 0.0, 1e8, True)] = 4.18e6


def heat_exchanger(cell: HeatExchanger, *, hot_outlet_measured: bool = False) -> BilinearSystem:
    """Heat exchanger with unknown heat transfer; states and inputs are outlet and inlet temperatures (hot, cold).

    With the cold outlet measured only, the known part (no heat transfer) does not show the hot side at all:
    (A_0, C) is unobservable, and yet state and parameter are found.

    Parameters
    ----------
    cell : HeatExchanger
        Flows, volumes, liquid.
    hot_outlet_measured : bool
        Whether both outlets are measured.

    Returns
    -------
    BilinearSystem
        theta = (U A,), W/K; temperatures in K or degrees, relative to any reference.
    """
    out_h, out_c = cell.flow_hot / cell.volume_hot, cell.flow_cold / cell.volume_cold
    per_h, per_c = 1 / (cell.heat * cell.volume_hot), 1 / (cell.heat * cell.volume_cold)
    C = np.eye(2) if hot_outlet_measured else np.array([[0.0, 1.0]])
    return BilinearSystem(
        A0=np.diag([-out_h, -out_c]),
        A=np.array([[[-per_h, per_h], [per_c, -per_c]]]),
        B0=np.diag([out_h, out_c]),
        B=np.zeros((1, 2, 2)),
        C=C,
        D=np.zeros((1, len(C), 2)),
        names=("U A, W/K",),
        name="heat exchanger",
    )
