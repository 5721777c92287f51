"""Thesis 6.6, 6.7: where each fault moves the residuals, what cannot be told apart, and the level rule.

With s_H = -df_H/dQ and s_T = df_T/dQ, both positive in the working range, a small fault moves (r1, r2, r3) by

    friction dB       (0, -w, -w) dB
    clogging K_f      (-Q^2, 0, s_T/s_H Q^2) K_f
    leakage K_l       (-s_H, -s_T, 0) sqrt(H) K_l
    cavitation f_c    (-f_H, 0.45 f_T, 0.45 f_T + s_T/s_H f_H) f_c
    dry running f_d   the same with 0.93

The factors 0.45 and 0.93 and the level that separates the last two are assumptions.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pumplib.decide import Isolation, isolate_direction
from pumplib.errors import DataError
from pumplib.observers.residual_model import PumpBelief

Array = NDArray[Any]
FAULTS = ("clogging", "friction", "leakage", "cavitation", "dry_running")
CAVITATION_TORQUE, DRY_TORQUE = 0.45, 0.93
DRY_LEVEL = 0.34
"""Loss of head, as a share, from which on the pump counts as dry: 0.35 less what sensors may be off."""


def directions(belief: PumpBelief, omega: float, Q: float) -> dict[str, Array]:
    """Effect of each fault of unit size on r1, r2, r3 at an operating point.

    Parameters
    ----------
    belief : PumpBelief
        The pump.
    omega, Q : float
        Operating point, rad/s and m3/s.

    Returns
    -------
    dict of str to ndarray, shape (3,)
        By `FAULTS`; Pa and N m per unit of the fault.

    Raises
    ------
    DataError
        If the pump does not turn, or the head map has no falling slope there.
    """
    s_H = 2 * belief.a_h2 * Q - belief.a_h1 * omega
    s_T = belief.a_t1 * omega - 2 * belief.a_t2 * Q
    if not (omega > 0 and s_H > 0):
        raise DataError(
            f"directions: at omega = {omega:g} rad/s, Q = {Q:g} m3/s the head map does not fall with the flow "
            f"(slope {-s_H:.3g} Pa s/m3); faults cannot be told apart there, open the valve."
        )
    f_H, f_T = float(belief.head(np.array(Q), np.array(omega))), float(belief.torque(np.array(Q), np.array(omega)))
    ratio, root = s_T / s_H, math.sqrt(max(f_H, 0.0))

    def lost(torque: float) -> Array:
        return np.array([-f_H, torque * f_T, torque * f_T + ratio * f_H])

    return {
        "clogging": np.array([-(Q**2), 0.0, ratio * Q**2]),
        "friction": np.array([0.0, -omega, -omega]),
        "leakage": np.array([-s_H * root, -s_T * root, 0.0]),
        "cavitation": lost(CAVITATION_TORQUE),
        "dry_running": lost(DRY_TORQUE),
    }


@dataclass(frozen=True, kw_only=True, slots=True)
class Classified:
    """Which fault explains the residuals, and what else does.

    Parameters
    ----------
    fault : str
        Best of `FAULTS`, or "none" if no direction is near.
    size : float
        Size by least squares along that direction, in the unit of the fault.
    isolation : Isolation
        Ranking by angle.
    alternatives : tuple of str
        Other explanations, in words, with what to do about them.
    """

    fault: str
    size: float
    isolation: Isolation
    alternatives: tuple[str, ...]


def classify(r: Array, scale: Array, belief: PumpBelief, omega: float, Q: float) -> Classified:
    """Isolate the fault behind residuals at rest.

    Parameters
    ----------
    r : ndarray, shape (3,)
        Mean r1 (Pa), r2, r3 (N m).
    scale : ndarray, shape (3,)
        Healthy thresholds at rest, same units.
    belief : PumpBelief
        The pump.
    omega, Q : float
        Operating point, rad/s and m3/s.

    Returns
    -------
    Classified

    Raises
    ------
    DataError
        If a value is not finite or the operating point is near shut-off.
    """
    effects = directions(belief, omega, Q)
    f_H = float(belief.head(np.array(Q), np.array(omega)))
    lost = -float(r[0]) / f_H if f_H > 0 else 0.0
    # one direction for the loss of prime: the level decides between its two names
    small = {name: effect for name, effect in effects.items() if name != "dry_running"}
    if lost > DRY_LEVEL:
        found = isolate_direction(r, scale, effects, names=("r1", "r2", "r3"), widest_deg=45.0)
        fault = "dry_running"
    else:
        found = isolate_direction(r, scale, small, names=("r1", "r2", "r3"), widest_deg=45.0)
        fault = found.ranking[0].fault if found.ranking[0].fits else "none"
    size = 0.0
    if fault != "none":
        d, u = effects[fault] / scale, np.asarray(r) / scale
        size = float(u @ d / (d @ d))
    return Classified(fault=fault, size=size, isolation=found, alternatives=_alternatives(fault, found, omega, Q))


def _alternatives(fault: str, found: Isolation, omega: float, Q: float) -> tuple[str, ...]:
    near = tuple(name for name in found.ambiguous if name != fault)
    words = [f"{name}: within {10:g} degrees of the best direction" for name in near]
    match fault:
        case "leakage":
            words.append("clogging with friction at once: change the valve and classify again")
            words.append("flow sensor that reads too little: compare with a second reading")
        case "clogging":
            words.append("cavitation with little loss of torque: raise the inlet pressure")
        case "friction":
            words.append("warm winding or saturation read as torque: compare with the winding temperature")
        case "cavitation":
            words.append("clogging with something that lowers the torque: raise the inlet pressure")
        case "none":
            words.append("outside the fault model: a sensor, the motor, or two faults at once")
    return tuple(words)


def mimic(belief: PumpBelief, omega: float, Q: float, K_l: float) -> tuple[float, float]:
    """Clogging and friction that together look like a leakage at one operating point.

    Parameters
    ----------
    belief : PumpBelief
        The pump.
    omega, Q : float
        Operating point, rad/s and m3/s.
    K_l : float
        Leakage, m3/s/sqrt(Pa).

    Returns
    -------
    K_f : float
        Pa s2/m6.
    dB : float
        N m s.
    """
    effects = directions(belief, omega, Q)
    both = np.column_stack((effects["clogging"][:2], effects["friction"][:2]))
    K_f, dB = np.linalg.solve(both, K_l * effects["leakage"][:2])
    return float(K_f), float(dB)
