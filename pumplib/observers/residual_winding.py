"""Thesis 6.5, 7.1, 8.3: a warm winding is not friction: stator resistance from the motor's own signals.

In the sinusoidal steady state voltage, current and frequency leave one equation over, the only one that contains
the main inductance: L_m' = |E|^2 / (omega_s I E_q) with E = v - (r_s + j omega_s L_s') i. A wrong r_s shows as a
wrong L_m', by about 0.1 % for 1 %, so it can be told only against what the same motor showed when it was
commissioned: a smooth map of L_m' over flux and load, which takes saturation, iron loss and the sensors' gains
along. Without such a map the estimate is worthless (the published inductances are never that exact).
"""

import math
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray

from pumplib.decide.strict import strict_kernel
from pumplib.errors import DataError
from pumplib.machines.parameters import Motor
from pumplib.machines.quantity import Parameters, Quantity
from pumplib.observers.stator import Estimates

Array = NDArray[Any]
_LEAST = 2000


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Electrical:
    """Electrical side of a record, one row a sample.

    Parameters
    ----------
    omega_s : ndarray, shape (n,)
        Angular frequency of the supply, rad/s.
    v2, i2 : ndarray, shape (n,)
        Squared amplitudes of the space vectors, V2 and A2.
    p, q : ndarray, shape (n,)
        Real and imaginary part of v times conj(i), V A; 1.5 times them is active and reactive power.
    trusted : ndarray of bool, shape (n,)
        Where the motor's observer stands behind its rows.
    """

    omega_s: Array
    v2: Array
    i2: Array
    p: Array
    q: Array
    trusted: Array


def electrical(found: Estimates) -> Electrical:
    """Take the electrical rows out of the observer's estimates.

    Parameters
    ----------
    found : Estimates
        Of the motor's observer.

    Returns
    -------
    Electrical
    """
    return Electrical(
        omega_s=np.abs(found.omega_s), v2=found.column("v2"), i2=found.column("i2"),
        p=found.column("iv_re"), q=-found.column("iv_im"), trusted=found.trusted & np.isfinite(found.omega),
    )  # fmt: skip


@dataclass(frozen=True, kw_only=True, slots=True)
class WindingSettings(Parameters):
    """How fast the estimated resistance may follow.

    Parameters
    ----------
    memory : float
        Time of rest over which the estimate forgets.
    prior : float
        Time of rest that the belief "as commissioned" counts for.
    """

    memory: Annotated[float, Quantity("s", "memory of the estimate", 0.0, 1e5, True)] = 5.0
    prior: Annotated[float, Quantity("s", "weight of the belief", 0.0, 1e5)] = 1.5


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class WindingMap:
    """Main inductance of one motor over flux and load, as commissioned.

    Parameters
    ----------
    motor : Motor
        What is believed; its r_s is the reference.
    coefficients : ndarray, shape (5,)
        Of ln L_m' over 1, f, f^2, x, x^2, with f = flux^2 less its mean and x = E_d/E_q.
    centre : float
        Mean squared flux, V2 s2.
    misfit : float
        Root mean square of ln L_m' at rest.
    """

    motor: Motor
    coefficients: Array
    centre: float
    misfit: float


def _features(e: Electrical, motor: Motor, centre: float | None) -> tuple[Array, Array, Array, float]:
    """Logarithm of L_m', its change per relative change of r_s, the regressors, and the centre of the squared flux."""
    r, X = motor.r_s, e.omega_s * motor.L_s_prime
    E2 = e.v2 - 2 * (r * e.p + X * e.q) + (r**2 + X**2) * e.i2
    reactive, active = e.q - X * e.i2, e.p - r * e.i2
    with np.errstate(invalid="ignore", divide="ignore"):
        L = np.log(E2 / (e.omega_s * reactive))
        slope = -2 * active / E2 * r
        flux2, x = E2 / e.omega_s**2, active / reactive
    middle = float(np.nanmedian(flux2)) if centre is None else centre
    f = flux2 - middle
    return L, slope, np.column_stack((np.ones_like(f), f, f**2, x, x**2)), middle


def steady(e: Electrical, dt: float) -> Array:
    """Where the electrical side is at rest.

    Parameters
    ----------
    e : Electrical
        The record.
    dt : float
        Sampling interval, s.

    Returns
    -------
    ndarray of bool, shape (n,)
    """
    out = np.zeros(len(e.omega_s), dtype=np.bool_)
    power = np.where(e.trusted, e.p, 0.0)
    _rest(np.where(e.trusted, e.omega_s, 0.0), power, e.trusted, -math.expm1(-dt / 0.25), round(0.5 / dt), out)
    return out


@strict_kernel
def _rest(w: Any, p: Any, trusted: Any, gain: float, hold: int, out: Any) -> None:
    """At rest: frequency and power near their low-passed values for half a second."""
    low_w, low_p, age, running = 0.0, 0.0, 0, False
    for k in range(len(w)):
        if not trusted[k]:
            running, age = False, 0
            continue
        if not running:
            low_w, low_p, running = w[k], p[k], True
        low_w += gain * (w[k] - low_w)
        low_p += gain * (p[k] - low_p)
        quiet = abs(w[k] - low_w) < 0.5 and abs(p[k] - low_p) < 0.05 * abs(low_p)
        age = age + 1 if quiet else 0
        out[k] = age > hold


def commission_winding(e: Electrical, motor: Motor, dt: float) -> WindingMap:
    """Learn the map of the main inductance from a healthy record with several operating points.

    The resistance may drift during the record: a parabola in time is fitted beside the map and thrown away, so that
    the reference is the resistance at the start.

    Parameters
    ----------
    e : Electrical
        The record.
    motor : Motor
        What is believed about the motor.
    dt : float
        Sampling interval, s.

    Returns
    -------
    WindingMap

    Raises
    ------
    DataError
        If the record has too little rest.
    """
    rest = steady(e, dt)
    if rest.sum() < _LEAST:
        raise DataError(
            f"commission_winding: {rest.sum() * dt:g} s at rest, {_LEAST * dt:g} s are needed; "
            "hold the operating points longer."
        )
    L, slope, X, centre = _features(e, motor, None)
    t = np.linspace(0.0, 1.0, len(L))
    everything = np.column_stack((X, slope * t, slope * t**2))[rest]
    scale = np.abs(everything).max(axis=0)
    # weak ridge: few operating points do not tell saturation, load and drift apart completely
    ridge = np.sqrt(np.array([0.0, 0.0, 1e-6, 1e-6, 1e-6, 1e-6, 1e-6]))
    n = int(rest.sum())
    A = np.vstack((everything / scale / math.sqrt(n), np.diag(ridge)))
    b = np.concatenate((L[rest] / math.sqrt(n), np.zeros(7)))
    found = np.linalg.lstsq(A, b, rcond=None)[0] / scale
    return WindingMap(
        motor=motor, coefficients=found[:5], centre=centre,
        misfit=float(np.sqrt(np.mean((L[rest] - everything @ found) ** 2))),
    )  # fmt: skip


def winding_change(e: Electrical, reference: WindingMap, dt: float, settings: WindingSettings | None = None) -> Array:
    """Relative change of the stator resistance against the commissioning.

    Parameters
    ----------
    e : Electrical
        The record.
    reference : WindingMap
        Of this motor.
    dt : float
        Sampling interval, s.
    settings : WindingSettings, optional
        Memory and prior.

    Returns
    -------
    ndarray, shape (n,)
        Causal estimate; follows at rest only and starts at zero.
    """
    settings = settings or WindingSettings()
    L, slope, X, _ = _features(e, reference.motor, reference.centre)
    with np.errstate(invalid="ignore", divide="ignore"):
        raw = (X @ reference.coefficients - L) / slope  # ln L rises by -slope when the true r_s is larger
    good = steady(e, dt) & np.isfinite(raw)
    out = np.empty(len(raw))
    _average(np.where(good, raw, 0.0), good, math.exp(-dt / settings.memory), dt, settings.prior, out)
    return out


@strict_kernel
def _average(raw: Any, good: Any, keep: float, dt: float, prior: float, out: Any) -> None:
    total, weight = 0.0, prior + 1e-12
    for k in range(len(raw)):
        if good[k]:
            total = keep * total + dt * raw[k]
            weight = keep * weight + dt
        out[k] = total / weight


def corrected(
    omega: Array, T_e: Array, e: Electrical, motor: Motor, change: Array, rotor_share: float
) -> tuple[Array, Array]:
    """Speed and torque with the estimated resistances.

    Parameters
    ----------
    omega, T_e : ndarray, shape (n,)
        Of the motor's observer with its believed resistances.
    e : Electrical
        The record.
    motor : Motor
        What is believed.
    change : ndarray, shape (n,)
        Relative change of r_s.
    rotor_share : float
        Relative change of r_r per relative change of r_s; learned, see `residual_monitor.commission_monitor`.

    Returns
    -------
    omega, T_e : ndarray, shape (n,)
        rad/s, N m.
    """
    T = T_e - 1.5 * motor.z_p * change * motor.r_s * e.i2 / e.omega_s
    slip = e.omega_s / motor.z_p - omega
    return omega - rotor_share * change * slip, T
