"""Thesis 3.2.3, 3.2.4, 7.2: exact electrical steady state from V_rms, I_rms, omega_e and phi (reconstructed).

In the frame whose d axis lies along the stator current, the phasor form of (3.7) can be solved for torque and speed
without the magnetising current. With E the voltage behind r_s and L_s',

    T_e = 1.5 z_p (E_d I) / omega_e              needs no inductance,
    omega_slip = R_r' omega_e (E_d I) / |E|^2    needs no L_m',

where the textbook route through (i_s - i_m) / i_m divides a small difference by a large current. Sets that are carried
through these cancelled forms stay narrower. What is left of L_m' is one further relation, `consistency`: it says
how much flux the measured reactive power leaves in the air gap.

Beyond the thesis: a core-loss conductance behind r_s. The angle phi is positive where the current lags; voltage and
current are those of a winding.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pumplib.errors import DataError, ParameterError
from pumplib.machines import Motor, MotorLosses
from pumplib.steady.algebra import cosine, operand_function, root, sine

Array = NDArray[Any]
ROOT2 = math.sqrt(2.0)


@operand_function
def air_gap(V_rms, I_rms, omega_e, phi, r_s, L_s_prime, G_core):  # type: ignore[no-untyped-def]
    """Voltage behind the leakage and the air-gap power, in the frame of the stator current; any kind of operand.

    Parameters
    ----------
    V_rms, I_rms : float or operand
        Voltage, V, and current, A, of a winding.
    omega_e, phi : float or operand
        Supply frequency, rad/s, and angle by which the current lags, rad.
    r_s, L_s_prime, G_core : float or operand
        Stator resistance, ohm, transient inductance, H, core-loss conductance behind r_s, S.

    Returns
    -------
    tuple
        I (amplitude, A), E_d and E_q (V), and E . I_eff (V A), of which 1.5 times is the air-gap power.

    References
    ----------
    Thesis (3.7a), (3.7c) in steady state, (3.8).
    """
    V = ROOT2 * V_rms
    I = ROOT2 * I_rms
    B_d = V * cosine(phi) - r_s * I
    B_q = V * sine(phi)
    X = omega_e * L_s_prime
    E_d = B_d - (X * G_core) * B_q
    E_q = B_q - X * (I - G_core * B_d)
    return I, E_d, E_q, B_d * I - G_core * (B_d**2 + B_q**2)


@operand_function
def torque_and_speed(V_rms, I_rms, omega_e, phi, r_s, L_s_prime, R_r_prime, G_core, z_p):  # type: ignore[no-untyped-def]
    """Electromagnetic torque and shaft speed; any kind of operand.

    Parameters
    ----------
    V_rms, I_rms, omega_e, phi : float or operand
        See `air_gap`.
    r_s, L_s_prime, R_r_prime, G_core : float or operand
        Parameters, ohm, H, ohm, S.
    z_p : float
        Pole pairs.

    Returns
    -------
    tuple
        T_e, N m, and omega, rad/s.

    References
    ----------
    Thesis (3.7), (3.11) in steady state; the cancelled forms are derived here.
    """
    _, E_d, E_q, P = air_gap(V_rms, I_rms, omega_e, phi, r_s, L_s_prime, G_core)
    p = P / omega_e
    slip = R_r_prime * (omega_e**2 * (p / (E_d**2 + E_q**2)))
    return (1.5 * z_p) * p, (omega_e - slip) / z_p


@operand_function
def shaft_power(V_rms, I_rms, omega_e, phi, r_s, L_s_prime, R_r_prime, G_core, B, stray, z_p, voltage, current):  # type: ignore[no-untyped-def]
    """Speed, shaft torque and shaft power from terminal quantities; any kind of operand.

    Parameters
    ----------
    V_rms, I_rms : float or operand
        Phase-to-neutral voltage, V, and line current, A.
    omega_e, phi : float or operand
        See `air_gap`.
    r_s, L_s_prime, R_r_prime, G_core, B, stray : float or operand
        Parameters, see `ElectricalParameters`.
    z_p : float
        Pole pairs.
    voltage, current : float
        Winding quantity over terminal quantity.

    Returns
    -------
    tuple
        omega, rad/s, torque at the shaft end, N m, shaft power, W.

    References
    ----------
    Thesis (3.7), (3.11); losses beyond the thesis.
    """
    i = current * I_rms
    T_e, omega = torque_and_speed(voltage * V_rms, i, omega_e, phi, r_s, L_s_prime, R_r_prime, G_core, z_p)
    T = T_e - B * omega - stray * i**2
    return omega, T, T * omega


@dataclass(frozen=True, kw_only=True, slots=True)
class ElectricalParameters:
    """Motor parameters as the steady state needs them, at working temperature.

    Parameters
    ----------
    r_s, R_r_prime : float
        Stator resistance and the rotor resistance of (3.7), ohm.
    L_s_prime, L_m_prime : float
        Transient and magnetising inductance of (3.7), H.
    G_core : float
        Core-loss conductance of a winding behind r_s, S.
    B : float
        Friction torque per speed, N m s.
    stray : float
        Stray-load torque per squared winding current, N m/A2.
    z_p : int
        Pole pairs.
    voltage, current : float
        Winding voltage over phase-to-neutral voltage, winding current over line current.
    """

    r_s: float
    R_r_prime: float
    L_s_prime: float
    L_m_prime: float
    G_core: float
    B: float
    stray: float
    z_p: int
    voltage: float
    current: float


def electrical_parameters(motor: Motor, losses: MotorLosses | None = None) -> ElectricalParameters:
    """Parameters of the steady state of a motor.

    Parameters
    ----------
    motor : Motor
        The motor; resistances at the reference temperature of `losses`.
    losses : MotorLosses, optional
        Core, friction and stray-load loss and the temperatures; the thesis's model without them.

    Returns
    -------
    ElectricalParameters

    References
    ----------
    Thesis (3.7), (3.8); losses beyond the thesis.
    """
    warm_s = warm_r = 1.0
    core = stray = 0.0
    friction = motor.B
    if losses is not None:
        rise = losses.temperature - losses.temperature_reference
        warm_s, warm_r = 1 + losses.alpha_s * rise, 1 + losses.alpha_r * rise
        core = losses.core_loss / (3 * losses.core_voltage**2)
        friction += losses.friction_loss / losses.loss_speed**2
        stray = losses.stray_loss / (losses.loss_speed * losses.stray_current**2)
    delta = motor.connection == "delta"
    return ElectricalParameters(
        r_s=motor.r_s * warm_s,
        R_r_prime=motor.R_r_prime * warm_r,
        L_s_prime=motor.L_s_prime,
        L_m_prime=motor.L_m_prime,
        G_core=core,
        B=friction,
        stray=stray,
        z_p=motor.z_p,
        voltage=math.sqrt(3) if delta else 1.0,
        current=1 / math.sqrt(3) if delta else 1.0,
    )


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class SteadyState:
    """Electrical steady state from measured phasors; every field has the common shape of the inputs.

    Parameters
    ----------
    torque_em, torque_shaft : ndarray
        Electromagnetic torque, and torque behind friction and stray-load torque, N m.
    omega : ndarray
        Shaft speed, rad/s.
    omega_slip : ndarray
        Electrical slip frequency, rad/s.
    power_shaft : ndarray
        W.
    E_d, E_q : ndarray
        Voltage behind r_s and L_s' along and across the stator current, amplitude, V.
    flux : ndarray
        Amplitude of the flux linkage behind L_s', V s.
    L_m_prime : ndarray
        Magnetising inductance that the measured phasors call for, H; see `consistency`.
    deviation : ndarray
        Relative residual of the consistency relation with the L_m' given.
    """

    torque_em: Array
    torque_shaft: Array
    omega: Array
    omega_slip: Array
    power_shaft: Array
    E_d: Array
    E_q: Array
    flux: Array
    L_m_prime: Array
    deviation: Array


def consistency(E_d, E_q, I_eff_d, I_eff_q, omega_e, L_m_prime):  # type: ignore[no-untyped-def]
    """Residual of the relation that ties the reactive current to L_m'; zero for exact inputs; any kind of operand.

    The rotor current has no part along the magnetising current in steady state, so the projection of the stator
    current on the air-gap flux is the magnetising current alone.

    Parameters
    ----------
    E_d, E_q : float or operand
        Voltage behind r_s and L_s', V.
    I_eff_d, I_eff_q : float or operand
        Current into L_s', A.
    omega_e : float or operand
        Supply frequency, rad/s.
    L_m_prime : float or operand
        Magnetising inductance, H.

    Returns
    -------
    float or operand
        omega_e L_m' (E_q I_d - E_d I_q) - |E|^2, V2.

    References
    ----------
    Thesis (3.7c) in steady state, real part.
    """
    return omega_e * L_m_prime * (E_q * I_eff_d - E_d * I_eff_q) - (E_d**2 + E_q**2)


def _inputs(**named: tuple[ArrayLike, float, float, str]) -> list[Array]:
    """Finite numbers inside their limits, broadcast to one shape; NaN is refused."""
    out = []
    for name, (value, low, high, remedy) in named.items():
        x = np.asarray(value, dtype=float)
        bad = ~np.isfinite(x) | (x < low) | (x > high)
        if np.any(bad):
            place = tuple(int(k) for k in np.argwhere(bad)[0])
            raise DataError(f"{name} = {x[bad].flat[0]:g} at index {place}: must be {low:g} to {high:g}. {remedy}")
        out.append(x)
    try:
        return list(np.broadcast_arrays(*out))
    except ValueError:
        shapes = ", ".join(f"{name} {x.shape}" for name, x in zip(named, out, strict=True))
        raise DataError(f"shapes do not fit together: {shapes}; give scalars or arrays of one shape.") from None


def steady_state(
    parameters: ElectricalParameters, V_rms: ArrayLike, I_rms: ArrayLike, omega_e: ArrayLike, phi: ArrayLike
) -> SteadyState:
    """Torque, speed and air-gap flux from the four slow electrical signals.

    Parameters
    ----------
    parameters : ElectricalParameters
        The motor.
    V_rms, I_rms : array_like
        Phase-to-neutral voltage, V rms, and line current, A rms. All four broadcast.
    omega_e : array_like
        Supply frequency, rad/s.
    phi : array_like
        Angle by which the current lags, rad.

    Returns
    -------
    SteadyState

    Raises
    ------
    DataError
        If an input is NaN, outside its limits or of another shape.

    References
    ----------
    Thesis (3.7), (3.11) in steady state; section 7.2 for the choice of the signals. Reconstructed.
    """
    p = parameters
    V, I, w, a = _inputs(
        V_rms=(V_rms, 1e-3, 2e4, "Give the phase-to-neutral voltage, V rms."),
        I_rms=(I_rms, 1e-6, 1e5, "Give the line current, A rms; without current there is nothing to evaluate."),
        omega_e=(omega_e, 1e-3, 2 * math.pi * 500, "Give the supply frequency in rad/s, 2 pi times the hertz."),
        phi=(phi, -math.pi, math.pi, "Give the angle in rad; a larger number is probably in degrees."),
    )
    v, i = p.voltage * V, p.current * I
    T_e, omega = torque_and_speed(v, i, w, a, p.r_s, p.L_s_prime, p.R_r_prime, p.G_core, p.z_p)
    amplitude, E_d, E_q, _ = air_gap(v, i, w, a, p.r_s, p.L_s_prime, p.G_core)
    B_d, B_q = ROOT2 * v * np.cos(a) - p.r_s * amplitude, ROOT2 * v * np.sin(a)
    I_d, I_q = amplitude - p.G_core * B_d, -p.G_core * B_q
    square, reactive = E_d**2 + E_q**2, E_q * I_d - E_d * I_q
    with np.errstate(divide="ignore"):
        inductance = np.where(reactive > 0, square / (w * reactive), np.inf)
    shaft = T_e - p.B * omega - p.stray * i**2
    return SteadyState(
        torque_em=T_e,
        torque_shaft=shaft,
        omega=omega,
        omega_slip=w - p.z_p * omega,
        power_shaft=shaft * omega,
        E_d=E_d,
        E_q=E_q,
        flux=np.sqrt(square) / w,
        L_m_prime=inductance,
        deviation=consistency(E_d, E_q, I_d, I_q, w, p.L_m_prime) / square,
    )


@dataclass(frozen=True, kw_only=True, slots=True)
class ResistanceCondition:
    """How the r_s that the consistency relation calls for reacts to errors; all relative, at one operating point.

    Parameters
    ----------
    estimate : float
        r_s from the relation, ohm.
    per_L_m, per_L_s : float
        Relative change of the estimate per relative change of L_m' and L_s'.
    per_V, per_I : float
        Per relative error of the voltage and the current.
    per_phi : float
        Per rad of error of the angle.
    relation_per_r_s : float
        Change of the relation's relative residual per relative change of r_s: how little r_s matters in it.
    """

    estimate: float
    per_L_m: float
    per_L_s: float
    per_V: float
    per_I: float
    per_phi: float
    relation_per_r_s: float


def resistance_from_consistency(V_rms, I_rms, omega_e, phi, L_s_prime, L_m_prime):  # type: ignore[no-untyped-def]
    """Stator resistance that makes the consistency relation hold (no core loss); see `resistance_condition`.

    Parameters
    ----------
    V_rms, I_rms : float or operand
        Voltage, V, and current, A, of a winding.
    omega_e, phi : float or operand
        Supply frequency, rad/s, and angle, rad.
    L_s_prime, L_m_prime : float or operand
        Inductances, H.

    Returns
    -------
    float or operand
        ohm; of the two roots the one with power into the rotor.
    """
    V, I = ROOT2 * V_rms, ROOT2 * I_rms
    E_q = V * sine(phi) - omega_e * L_s_prime * I
    return (V * cosine(phi) - root(omega_e * L_m_prime * I * E_q - E_q**2)) / I


def resistance_condition(
    parameters: ElectricalParameters, V_rms: float, I_rms: float, omega_e: float, phi: float
) -> ResistanceCondition:
    """Show why r_s cannot be had from the consistency relation: its sensitivity to everything else.

    The inputs are taken as they are; derivatives are central differences of the exact formula.

    Parameters
    ----------
    parameters : ElectricalParameters
        The motor; core loss is left out of this relation.
    V_rms, I_rms, omega_e, phi : float
        One operating point, as for `steady_state`.

    Returns
    -------
    ResistanceCondition

    Raises
    ------
    DataError
        If an input is NaN or outside its limits.
    ParameterError
        If no resistance fulfils the relation at this point.

    References
    ----------
    Derived here; beyond the thesis.
    """
    p = parameters
    point = steady_state(p, V_rms, I_rms, omega_e, phi)
    inputs = {
        "V": p.voltage * float(V_rms), "I": p.current * float(I_rms), "w": float(omega_e), "phi": float(phi),
        "L_s": p.L_s_prime, "L_m": p.L_m_prime,
    }  # fmt: skip

    def estimate(**changed: float) -> float:
        with np.errstate(invalid="ignore"):
            x = inputs | changed
            return float(resistance_from_consistency(x["V"], x["I"], x["w"], x["phi"], x["L_s"], x["L_m"]))

    middle = estimate()
    if not math.isfinite(middle) or middle == 0:
        raise ParameterError(
            f"V_rms = {V_rms:g} V, I_rms = {I_rms:g} A, phi = {phi:g} rad: no resistance fulfils the relation with "
            f"L_m' = {p.L_m_prime:g} H; the true L_m' here is {float(point.L_m_prime):.4g} H. Use that monitor instead."
        )

    def slope(name: str, step: float) -> float:
        high, low = estimate(**{name: inputs[name] + step}), estimate(**{name: inputs[name] - step})
        return (high - low) / (2 * step) / middle

    small = 1e-6
    relative = {name: slope(name, small * inputs[name]) * inputs[name] for name in ("L_m", "L_s", "V", "I")}

    def residual(r_s: float) -> float:
        amplitude, E_d, E_q, _ = air_gap(inputs["V"], inputs["I"], inputs["w"], inputs["phi"], r_s, p.L_s_prime, 0.0)
        return float(consistency(E_d, E_q, amplitude, 0.0, inputs["w"], p.L_m_prime) / (E_d**2 + E_q**2))

    step = small * p.r_s
    return ResistanceCondition(
        estimate=middle,
        per_L_m=relative["L_m"],
        per_L_s=relative["L_s"],
        per_V=relative["V"],
        per_I=relative["I"],
        per_phi=slope("phi", small),
        relation_per_r_s=(residual(p.r_s + step) - residual(p.r_s - step)) / (2 * small),
    )
