"""Thesis 5.1: induction motor with an inter-turn short circuit, Y and delta, in stator-fixed dq0 coordinates.

One loop of turns is closed by a contact. It passes the share |gamma_k| of the turns of phase k, in the direction of
the sign of gamma_k, and carries the current i_f. What magnetises the machine is then i' = i_s - gamma i_f, and i'
obeys the equations of the healthy motor: the short only adds the equation of the loop,

    loop_L di_f/dt + loop_R i_f = gamma^T v_s,

and gamma i_f at the terminals. Two sections of one winding share the main flux; of the leakage flux the share
``kappa_c`` is their own. With ``kappa_c = 0`` the sections are perfectly coupled and the loop has no inductance of
its own: its current follows the voltage at once (delta, and Y where the signed shares sum to zero). In Y the
return current through the other phases keeps the loop inductive otherwise.
"""

import math
from dataclasses import dataclass
from typing import Annotated, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pumplib.errors import ParameterError
from pumplib.kernels import inline
from pumplib.machines.parameters import Motor
from pumplib.machines.quantity import Parameters, Quantity
from pumplib.motor.dq import current_derivatives
from pumplib.motor.frames import B_V_DELTA, PHASE_AXES

Array = NDArray[Any]
_INSTANT = 1e-12  # a loop with a shorter time constant, s, has no inductance


@dataclass(frozen=True, kw_only=True, slots=True)
class Short(Parameters):
    """Inter-turn short circuit: one loop through one or several phases.

    Parameters
    ----------
    gamma : tuple of float
        Signed shares of the turns of phases a, b, c in the loop. One positive entry is a short within a phase, two
        entries one between taps of two phases.
    r_f : float
        Contact resistance, ohm.
    kappa_c : float
        Share of the leakage flux that two sections of a winding do not have in common: 1 linear in the turns
        (sections apart), 0 quadratic (sections on top of each other).
    """

    gamma: Annotated[tuple[float, ...], Quantity("-", "signed share of the turns of a phase in the loop", -1.0, 1.0)]
    r_f: Annotated[float, Quantity("ohm", "contact resistance", 0.0, 1e9)] = 0.0
    kappa_c: Annotated[float, Quantity("-", "uncoupled share of the leakage of two sections", 0.0, 1.0)] = 1.0

    def _check_together(self) -> None:
        if not isinstance(self.gamma, tuple) or len(self.gamma) != 3:
            raise ParameterError(f"Short.gamma = {self.gamma!r}: give a tuple of three shares, for phases a, b, c.")

    @property
    def sigma(self) -> float:
        """Sum of |gamma_k| less gamma^T gamma: resistance of the loop in units of r_s, phases held apart."""
        return sum(abs(one) for one in self.gamma) - sum(one * one for one in self.gamma)

    @property
    def turned(self) -> float:
        """Sum of the signed shares."""
        return sum(self.gamma)

    @property
    def vector(self) -> complex:
        """Space vector of the signed shares, 2/3 sum gamma_k a_k."""
        return complex(2 / 3 * (np.array(self.gamma) @ PHASE_AXES))


class ShortConstants(NamedTuple):
    """Constants of the model; in vectorised use every field may be an array."""

    r_s: Any
    R_r: Any  # derived values of (3.7)
    L_m: Any
    inv_L_s: Any
    inv_L_m: Any
    k_T: Any
    z_p: Any
    L_ls: Any
    b_d: Any  # B_v of (3.10)
    b_q: Any
    g_d: Any  # space vector of the signed shares
    g_q: Any
    star: Any  # sum of the signed shares over 3; the part that moves the star point
    loop_R: Any
    loop_L: Any  # 0: the loop has no inductance
    inv_loop_L: Any  # 0 in that case
    open: Any  # 1 where no turns are shorted: no loop


def short_constants(motor: Motor, short: Short) -> ShortConstants:
    """Constants of a motor with a short circuit.

    Parameters
    ----------
    motor : Motor
        The healthy motor.
    short : Short
        The fault; all shares zero for none.

    Returns
    -------
    ShortConstants

    Raises
    ------
    ParameterError
        If nothing limits the current of the loop: a whole delta winding bolted.
    """
    b = B_V_DELTA if motor.connection == "delta" else 1.0 + 0j
    sigma = short.sigma
    s_0 = short.turned**2 / 3 if motor.connection == "Y" else 0.0
    loop_R = short.r_f + motor.r_s * (sigma + s_0)
    loop_L = motor.L_ls * (short.kappa_c * sigma + s_0)
    is_open = not any(short.gamma)
    if not is_open and loop_R <= 0:
        raise ParameterError(
            f"Short.gamma = {short.gamma}, r_f = 0 ohm on a delta winding: two lines are shorted without any "
            "resistance. Give a contact resistance."
        )
    if is_open or loop_L <= _INSTANT * loop_R:
        loop_L = 0.0
    return ShortConstants(
        r_s=motor.r_s,
        R_r=motor.R_r_prime,
        L_m=motor.L_m_prime,
        inv_L_s=1 / motor.L_s_prime,
        inv_L_m=1 / motor.L_m_prime,
        k_T=1.5 * motor.z_p * motor.L_m_prime,
        z_p=float(motor.z_p),
        L_ls=motor.L_ls,
        b_d=b.real,
        b_q=b.imag,
        g_d=short.vector.real,
        g_q=short.vector.imag,
        star=short.turned / 3,
        loop_R=1.0 if is_open else loop_R,
        loop_L=loop_L,
        inv_loop_L=1 / loop_L if loop_L > 0 else 0.0,
        open=float(is_open),
    )


@inline
def loop_voltage(v_sd: float, v_sq: float, c: ShortConstants) -> float:
    """Voltage that drives the loop current, gamma^T v_s without its zero sequence.

    Parameters
    ----------
    v_sd, v_sq : float or ndarray
        Stator (winding) voltage, V.
    c : ShortConstants
        Of motor and fault.

    Returns
    -------
    float or ndarray
        V.
    """
    return 1.5 * (c.g_d * v_sd + c.g_q * v_sq)


@inline
def short_derivatives(
    i_d: float, i_q: float, i_md: float, i_mq: float, i_f: float, omega_e: float, v_sd: float, v_sq: float,
    c: ShortConstants,
) -> tuple[float, float, float, float, float]:  # fmt: skip
    """Time derivatives of the faulted motor.

    Parameters
    ----------
    i_d, i_q : float or ndarray
        Effective stator current i' = i_s - gamma i_f, A.
    i_md, i_mq : float or ndarray
        Magnetising current psi_r / L_m, A.
    i_f : float or ndarray
        Loop current, A.
    omega_e : float or ndarray
        Electrical rotor speed z_p omega_r, rad/s.
    v_sd, v_sq : float or ndarray
        Stator (winding) voltage, V.
    c : ShortConstants
        Of motor and fault.

    Returns
    -------
    tuple of float
        Derivatives in the order of the states, A/s; zero for a loop current that is no state.

    References
    ----------
    Thesis (3.7), with i' for i_s; thesis 5.1, reconstructed.
    """
    di_d, di_q, dm_d, dm_q = current_derivatives(
        i_d, i_q, i_md, i_mq, omega_e, v_sd, v_sq, c.r_s, c.R_r, c.L_m, c.inv_L_s, c.inv_L_m
    )
    di_f = c.inv_loop_L * (loop_voltage(v_sd, v_sq, c) - c.loop_R * i_f)
    return di_d, di_q, dm_d, dm_q, di_f


@inline
def instant_current(v_sd: float, v_sq: float, c: ShortConstants) -> float:
    """Current of a loop without inductance.

    Parameters
    ----------
    v_sd, v_sq : float or ndarray
        Stator (winding) voltage, V.
    c : ShortConstants
        Of motor and fault; `loop_L` is zero.

    Returns
    -------
    float or ndarray
        i_f, A; zero where no turns are shorted.
    """
    return (1.0 - c.open) * loop_voltage(v_sd, v_sq, c) / c.loop_R


class Terminals(NamedTuple):
    """What the terminals of the faulted motor show, SI."""

    i_td: Any  # terminal current, A
    i_tq: Any
    i_s0: Any  # zero sequence of the winding currents, circulates in a delta
    v_0: Any  # star-point voltage to the supply's neutral, V; 0 for delta
    torque: Any  # N m


@inline
def terminals(
    i_d: float, i_q: float, i_md: float, i_mq: float, i_f: float, di_f: float, i_0: float, v_t0: float,
    c: ShortConstants,
) -> Terminals:  # fmt: skip
    """Terminal currents, star-point voltage and torque of the faulted motor.

    Parameters
    ----------
    i_d, i_q, i_md, i_mq, i_f : float or ndarray
        States as in `short_derivatives`, A.
    di_f : float or ndarray
        Derivative of the loop current, A/s.
    i_0 : float or ndarray
        Zero sequence of the effective current i', A: a state of the delta, which decays with L_ls/r_s; ignored in Y.
    v_t0 : float or ndarray
        Zero sequence of the terminal voltage, V.
    c : ShortConstants
        Of motor and fault.

    Returns
    -------
    Terminals

    References
    ----------
    Thesis (3.8)-(3.11), remark 3.2.1 for the healthy star point; thesis 5.1, reconstructed.
    """
    i_sd, i_sq = i_d + c.g_d * i_f, i_q + c.g_q * i_f
    is_delta = 2.0 * (c.b_d - 1.0)  # B_v has the real part 3/2 in delta, 1 in Y
    i_td, i_tq = c.b_d * i_sd + c.b_q * i_sq, c.b_d * i_sq - c.b_q * i_sd  # C_i is the conjugate of B_v
    v_0 = (1.0 - is_delta) * (v_t0 + c.star * (c.r_s * i_f + c.L_ls * di_f))
    return Terminals(i_td, i_tq, is_delta * (i_0 + c.star * i_f), v_0, c.k_T * (i_md * i_q - i_mq * i_d))


def stored_energy(i: Array, i_m: Array, i_f: Array, i_0: Array, c: ShortConstants) -> Array:
    """Energy of the magnetic field, of the loop and of the zero sequence.

    Parameters
    ----------
    i, i_m : complex ndarray, shape (...)
        Effective stator current and magnetising current, A.
    i_f, i_0 : ndarray, shape (...)
        Loop current and zero sequence of i', A (Y: the latter is -star i_f and already in the loop; give zero).
    c : ShortConstants
        Of motor and fault.

    Returns
    -------
    ndarray, shape (...)
        J.
    """
    field = 0.75 * (np.abs(i) ** 2 / c.inv_L_s + np.abs(i_m) ** 2 / c.inv_L_m)
    return np.asarray(field + 0.5 * c.loop_L * np.square(i_f) + 1.5 * c.L_ls * np.square(i_0))


def copper_losses(i: Array, i_m: Array, i_f: Array, i_0: Array, c: ShortConstants) -> Array:
    """Losses in stator, rotor, loop and contact.

    Parameters
    ----------
    i, i_m, i_f, i_0, c
        As in `stored_energy`.

    Returns
    -------
    ndarray, shape (...)
        W.
    """
    rotor = 1.5 * c.R_r * np.abs(i - i_m) ** 2
    loop = (1.0 - c.open) * c.loop_R * np.square(i_f)
    return np.asarray(1.5 * c.r_s * np.abs(i) ** 2 + rotor + loop + 3.0 * c.r_s * np.square(i_0))


def healthy(kappa_c: float = 1.0) -> Short:
    """No fault.

    Parameters
    ----------
    kappa_c : float
        As in `Short`.

    Returns
    -------
    Short
    """
    return Short(gamma=(0.0, 0.0, 0.0), kappa_c=kappa_c)


def phase_short(phase: int, gamma: float, *, r_f: float = 0.0, kappa_c: float = 1.0) -> Short:
    """Short within one phase.

    Parameters
    ----------
    phase : int
        0, 1 or 2 for phases a, b, c.
    gamma : float
        Share of the turns, 0..1.
    r_f, kappa_c : float
        As in `Short`.

    Returns
    -------
    Short

    Raises
    ------
    ParameterError
        If the phase or a value is outside its range.
    """
    if phase not in (0, 1, 2):
        raise ParameterError(f"phase_short: phase = {phase!r}; must be 0, 1 or 2 for phases a, b, c.")
    if not (gamma >= 0 and math.isfinite(gamma)):
        raise ParameterError(f"phase_short: gamma = {gamma!r}; a share of the turns of one phase is not negative.")
    shares = [0.0, 0.0, 0.0]
    shares[phase] = gamma
    return Short(gamma=(shares[0], shares[1], shares[2]), r_f=r_f, kappa_c=kappa_c)
