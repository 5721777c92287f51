"""Thesis 7.1, 7.2: the three analytical redundancy relations of the pump in steady state (reconstructed).

With torque and speed from the electrical signals, the steady pump leaves three relations between known signals:

    R1 = H - f_H(Q, omega)                           without friction
    R2 = T - B omega - f_T(Q, omega)                 without head, so without clogging
    R3 = T - B omega - f_T(Q_hat(H, omega), omega)   without flow, so without leakage between the two sensors

f_H and f_T are (3.19) and (3.24), Q_hat is the larger flow that gives the head H, T is the electromagnetic torque
less the stray-load torque. Extra load makes R2 and R3 positive. These are the relations that the structural analysis
finds on the steady equations; each is written once, for every kind of operand (`pumplib.steady.algebra`).
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pumplib.decide.strict import strict_kernel
from pumplib.errors import DataError, ParameterError
from pumplib.machines import Motor, MotorLosses, Pump
from pumplib.steady.algebra import inner, operand_function, overload, root
from pumplib.steady.phasors import electrical_parameters, shaft_power, torque_and_speed

Array = NDArray[Any]
CHANNELS = ("V_rms", "I_rms", "omega_e", "phi", "H", "Q")
PARAMETERS = (
    "r_s", "L_s_prime", "R_r_prime", "G_core", "B", "stray", "a_h0", "a_h1", "a_h2", "a_t0", "a_t1", "a_t2",
)  # fmt: skip
UNITS = {
    "V_rms": "V", "I_rms": "A", "omega_e": "rad/s", "phi": "rad", "H": "Pa", "Q": "m3/s",
    "r_s": "ohm", "L_s_prime": "H", "R_r_prime": "ohm", "G_core": "S", "B": "N m s", "stray": "N m/A2",
    "a_h0": "Pa s2", "a_h1": "Pa s2/m3", "a_h2": "Pa s2/m6",
    "a_t0": "N m s2", "a_t1": "N m s2/m3", "a_t2": "N m s2/m6",
}  # fmt: skip
NEEDS = {
    "R1": ("V_rms", "I_rms", "omega_e", "phi", "H", "Q"),
    "R2": ("V_rms", "I_rms", "omega_e", "phi", "Q"),
    "R3": ("V_rms", "I_rms", "omega_e", "phi", "H"),
}
FAULTS = {
    "R1": ("K_f", "K_l", "f_c", "f_d"),
    "R2": ("dB", "K_l", "f_c", "f_d"),
    "R3": ("dB", "K_f", "f_c", "f_d"),
}


@operand_function
def head(Q, omega, a_h0, a_h1, a_h2):  # type: ignore[no-untyped-def]
    """Pressure difference of the healthy pump; any kind of operand.

    Parameters
    ----------
    Q, omega : float or operand
        Flow, m3/s, and speed, rad/s.
    a_h0, a_h1, a_h2 : float or operand
        Coefficients with rho g absorbed, Pa s2, Pa s2/m3, Pa s2/m6.

    Returns
    -------
    float or operand
        Pa.

    References
    ----------
    Thesis (3.19), (3.24).
    """
    return inner((a_h0, a_h1, a_h2), (omega**2, omega * Q, -(Q**2)))


@operand_function
def load_torque(Q, omega, B, a_t0, a_t1, a_t2):  # type: ignore[no-untyped-def]
    """Torque that friction and the healthy pump take; any kind of operand.

    Parameters
    ----------
    Q, omega : float or operand
        Flow, m3/s, and speed, rad/s.
    B, a_t0, a_t1, a_t2 : float or operand
        Friction, N m s, and coefficients of the pump, N m s2, N m s2/m3, N m s2/m6.

    Returns
    -------
    float or operand
        N m.

    References
    ----------
    Thesis (3.12), (3.20), (3.21).
    """
    return inner((B, a_t0, a_t1, a_t2), (omega, omega**2, omega * Q, -(Q**2)))


@operand_function
def _root_of_head(H, omega, a_h0, a_h1, a_h2):  # type: ignore[no-untyped-def]
    # omega^2 taken out of both terms: it appears once, so sets of it are not counted twice
    D = (a_h1**2 + 4.0 * (a_h0 * a_h2)) * omega**2 - 4.0 * (a_h2 * H)
    return (a_h1 * omega + root(D)) / (2.0 * a_h2)


def flow_from_head(H, omega, a_h0, a_h1, a_h2):  # type: ignore[no-untyped-def]
    """Flow at which the healthy pump gives a pressure, the larger of two roots; any kind of operand.

    Parameters
    ----------
    H, omega : float or operand
        Pressure, Pa, and speed, rad/s.
    a_h0, a_h1, a_h2 : float or operand
        Coefficients as in `head`.

    Returns
    -------
    float or operand
        m3/s; not a number where the pressure is above the pump's largest.
    """
    if not hasattr(H, "anchor"):
        return _root_of_head(H, omega, a_h0, a_h1, a_h2)
    # A set: with any number Q_0, n = f_H(Q_0) - H and the slope s = 2 a_h2 Q_0 - a_h1 omega, the root is exactly
    # Q_0 + 2 n / (sqrt(s^2 + 4 a_h2 n) + s). With Q_0 in the middle, n is small and holds the coefficients in one
    # inner product, so what they have in common cancels.
    Q_0 = _root_of_head(*(x.anchor() if hasattr(x, "anchor") else x for x in (H, omega, a_h0, a_h1, a_h2)))
    Q_0 = Q_0.anchor() if hasattr(Q_0, "anchor") else Q_0
    n = head(Q_0, omega, a_h0, a_h1, a_h2) - H
    s = inner((a_h2, a_h1), (2.0 * Q_0, -omega))
    return Q_0 + (2.0 * n) / (root(s**2 + 4.0 * (a_h2 * n)) + s)


@overload(flow_from_head, inline="always")
def _flow_from_head(H, omega, a_h0, a_h1, a_h2):  # type: ignore[no-untyped-def]
    return lambda H, omega, a_h0, a_h1, a_h2: _root_of_head(H, omega, a_h0, a_h1, a_h2)


@operand_function
def residuals(  # type: ignore[no-untyped-def]
    V_rms, I_rms, omega_e, phi, H, Q,
    r_s, L_s_prime, R_r_prime, G_core, B, stray, a_h0, a_h1, a_h2, a_t0, a_t1, a_t2,
    z_p, voltage, current,
):  # fmt: skip
    """R1, R2 and R3; any kind of operand.

    Parameters
    ----------
    V_rms, I_rms, omega_e, phi, H, Q : float or operand
        The six slow signals (`CHANNELS`), SI.
    r_s, L_s_prime, R_r_prime, G_core, B, stray : float or operand
        Motor (`pumplib.steady.phasors.ElectricalParameters`); B is the friction of the whole shaft.
    a_h0, a_h1, a_h2, a_t0, a_t1, a_t2 : float or operand
        Pump, whole machine.
    z_p, voltage, current : float
        Pole pairs; winding over terminal quantity.

    Returns
    -------
    tuple
        R1, Pa, R2 and R3, N m.

    References
    ----------
    Thesis 7.1, 7.2 (reconstructed); (3.7), (3.11), (3.19)-(3.24).
    """
    i = current * I_rms
    T_e, omega = torque_and_speed(voltage * V_rms, i, omega_e, phi, r_s, L_s_prime, R_r_prime, G_core, z_p)
    T = T_e - stray * i**2
    R1 = H - head(Q, omega, a_h0, a_h1, a_h2)
    R2 = T - load_torque(Q, omega, B, a_t0, a_t1, a_t2)
    R3 = T - load_torque(flow_from_head(H, omega, a_h0, a_h1, a_h2), omega, B, a_t0, a_t1, a_t2)
    return R1, R2, R3


@dataclass(frozen=True, kw_only=True, slots=True)
class Relations:
    """A set of relations as a function of measured channels, uncertain parameters and exact constants.

    Parameters
    ----------
    name : str
        For messages.
    function : callable
        Takes channels, parameters and constants in this order; returns the outputs.
    channels, parameters : tuple of str
        Names of its first arguments.
    constants : tuple of float
        Its last arguments, without uncertainty.
    outputs : tuple of str
        Names of what it returns.
    """

    name: str
    function: Callable[..., Any]
    channels: tuple[str, ...]
    parameters: tuple[str, ...]
    constants: tuple[float, ...]
    outputs: tuple[str, ...]

    def __call__(self, channels: Any, parameters: Any) -> tuple[Any, ...]:
        """Evaluate.

        Parameters
        ----------
        channels, parameters : sequence
            Operands in the order of the names.

        Returns
        -------
        tuple
            One entry an output.
        """
        return tuple(self.function(*channels, *parameters, *self.constants))


def pump_relations(motor: Motor) -> Relations:
    """The three residuals of a motor's pump set.

    Parameters
    ----------
    motor : Motor
        For pole pairs and connection; its other values are parameters of the relations.

    Returns
    -------
    Relations
    """
    e = electrical_parameters(motor)
    return Relations(
        name="pump",
        function=residuals,
        channels=CHANNELS,
        parameters=PARAMETERS,
        constants=(float(e.z_p), e.voltage, e.current),
        outputs=("R1", "R2", "R3"),
    )


def motor_relations(motor: Motor) -> Relations:
    """Speed, shaft torque and shaft power of a motor from its electrical signals.

    Parameters
    ----------
    motor : Motor
        For pole pairs and connection.

    Returns
    -------
    Relations
    """
    e = electrical_parameters(motor)
    return Relations(
        name="motor",
        function=shaft_power,
        channels=CHANNELS[:4],
        parameters=PARAMETERS[:6],
        constants=(float(e.z_p), e.voltage, e.current),
        outputs=("omega", "torque_shaft", "power_shaft"),
    )


def parameter_values(motor: Motor, pump: Pump | None = None, losses: MotorLosses | None = None) -> dict[str, float]:
    """Nominal parameters of the relations from data sheets.

    Parameters
    ----------
    motor : Motor
        The motor.
    pump : Pump, optional
        The pump; head and torque of its stages are summed. Without it only the motor's parameters are returned.
    losses : MotorLosses, optional
        Losses of the motor.

    Returns
    -------
    dict of str to float
        SI, by the names of `PARAMETERS`.
    """
    e = electrical_parameters(motor, losses)
    found = {name: float(getattr(e, name)) for name in PARAMETERS[:6]}
    if pump is not None:
        found["B"] += pump.B
        found |= {name: pump.stages * float(getattr(pump, name)) for name in PARAMETERS[6:]}
    return found


def evaluate(relations: Relations, signals: Mapping[str, ArrayLike], parameters: Mapping[str, float]) -> Array:
    """Evaluate relations at measured values, without any set.

    Parameters
    ----------
    relations : Relations
        What to evaluate.
    signals : mapping of str to array_like, shape (n,)
        Channels, SI.
    parameters : mapping of str to float
        Values by name.

    Returns
    -------
    ndarray, shape (n, outputs)

    Raises
    ------
    DataError
        If a channel is missing, or lengths differ.
    ParameterError
        If a parameter is missing.

    References
    ----------
    Thesis 7.2 (reconstructed).
    """
    values = stack(relations, signals)
    missing = [name for name in relations.parameters if name not in parameters]
    if missing:
        raise ParameterError(f"parameters: {', '.join(missing)} missing for the relations {relations.name!r}.")
    found = relations(values.T, [float(parameters[name]) for name in relations.parameters])
    return np.stack(np.broadcast_arrays(*found), axis=-1)


def stack(relations: Relations, signals: Mapping[str, ArrayLike]) -> Array:
    """Channels of some relations as one array, checked.

    Parameters
    ----------
    relations : Relations
        Which channels.
    signals : mapping of str to array_like, shape (n,)
        Values, SI.

    Returns
    -------
    ndarray, shape (n, channels)

    Raises
    ------
    DataError
        If a channel is missing, not one-dimensional, of another length or not finite.
    """
    columns = []
    for name in relations.channels:
        if name not in signals:
            raise DataError(
                f"channel {name} ({UNITS[name]}) is missing; see pumplib.steady.channels.available_relations."
            )
        x = np.atleast_1d(np.asarray(signals[name], dtype=float))
        if x.ndim != 1:
            raise DataError(f"channel {name} has shape {x.shape}: must be one-dimensional, time first.")
        if not np.isfinite(x).all():
            k = int(np.argmin(np.isfinite(x)))
            raise DataError(f"channel {name} = {x[k]:g} {UNITS[name]} at sample {k}: must be finite; drop such points.")
        columns.append(x)
    if len({len(x) for x in columns}) > 1:
        lengths = ", ".join(f"{name} {len(x)}" for name, x in zip(relations.channels, columns, strict=True))
        raise DataError(f"channels have different lengths: {lengths}.")
    return np.stack(columns, axis=1)


@strict_kernel
def truths(x, radii, center, generators, zeta, lo, hi, constants, counts):  # type: ignore[no-untyped-def]
    """Compare residuals at known errors with sets: one truth a row of `zeta`, samples repeated in turn.

    Parameters
    ----------
    x, radii : ndarray, shape (samples, 6)
        Measured channels and the radii of their errors.
    center, generators : ndarray, shape (12,), (12, n)
        Parameter set.
    zeta : ndarray, shape (count, n + 6)
        Truths in the unit box.
    lo, hi : ndarray, shape (samples, 3)
        Sets.
    constants : tuple of float
        z_p, voltage, current.
    counts : ndarray of int, shape (3, 2)
        Truths outside the set and not a number, for each residual; added to.
    """
    n = generators.shape[1]
    p = np.empty(12)
    for t in range(zeta.shape[0]):
        s = t % x.shape[0]
        for i in range(12):
            p[i] = center[i]
            for j in range(n):
                p[i] += generators[i, j] * zeta[t, j]
        R1, R2, R3 = residuals(
            x[s, 0] + radii[s, 0] * zeta[t, n], x[s, 1] + radii[s, 1] * zeta[t, n + 1],
            x[s, 2] + radii[s, 2] * zeta[t, n + 2], x[s, 3] + radii[s, 3] * zeta[t, n + 3],
            x[s, 4] + radii[s, 4] * zeta[t, n + 4], x[s, 5] + radii[s, 5] * zeta[t, n + 5],
            p[0], p[1], p[2], p[3], p[4], p[5], p[6], p[7], p[8], p[9], p[10], p[11],
            constants[0], constants[1], constants[2],
        )  # fmt: skip
        counts[0, 0] += not (lo[s, 0] <= R1 <= hi[s, 0])
        counts[1, 0] += not (lo[s, 1] <= R2 <= hi[s, 1])
        counts[2, 0] += not (lo[s, 2] <= R3 <= hi[s, 2])
        counts[0, 1] += R1 != R1
        counts[1, 1] += R2 != R2
        counts[2, 1] += R3 != R3


@strict_kernel
def residual_batch(x, p, constants, out):  # type: ignore[no-untyped-def]
    """Residuals of many samples with one parameter vector each or for all.

    Parameters
    ----------
    x : ndarray, shape (n, 6)
        Channels.
    p : ndarray, shape (1 or n, 12)
        Parameters.
    constants : tuple of float
        z_p, voltage, current.
    out : ndarray, shape (n, 3)
        Receives R1, R2, R3.
    """
    for s in range(x.shape[0]):
        q = s if p.shape[0] > 1 else 0
        out[s, 0], out[s, 1], out[s, 2] = residuals(
            x[s, 0], x[s, 1], x[s, 2], x[s, 3], x[s, 4], x[s, 5],
            p[q, 0], p[q, 1], p[q, 2], p[q, 3], p[q, 4], p[q, 5],
            p[q, 6], p[q, 7], p[q, 8], p[q, 9], p[q, 10], p[q, 11],
            constants[0], constants[1], constants[2],
        )  # fmt: skip
