"""Thesis 5.3: from the fault coefficient to a verdict: alarm, faulty phase, number of shorted turns.

The difference d of the fault coefficient to that of the healthy machine is compared with its covariance. Its
direction names the phase: a short of phase k lies between a_k^2 and a_k^2 turned back by the angle of the stator
impedance, whatever contact resistance and leakage, so the sectors are centred half that angle behind a_k^2. A loop
between two phases lies midway between their sectors. A difference that fits neither is reported as something else
than a short. The size is that of a bolted short whose branch has the resistance found: it does not depend on the
leakage, and with a contact resistance it is a lower bound, since one frequency cannot tell the two apart.
"""

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from pumplib.errors import DataError, ParameterError
from pumplib.machines.quantity import Quantity, check_value
from pumplib.motor.frames import PHASE_AXES
from pumplib.motor.short_identify import fault_admittance, g_hat_of_phase, gamma_R, phi_z, sector_centres
from pumplib.observers.stator_commission import Commissioning
from pumplib.observers.stator_kernel import EXCITATION, REVERSED, SUM, UNBALANCE
from pumplib.observers.stator_sequences import Sequences, fault_coefficient

Array = NDArray[Any]
Kind = Literal["healthy", "one phase", "two phases", "undecided", "no short"]
PHASES = ("a", "b", "c")
PAIRS = ("ab", "bc", "ca")
TURNS = 250  # of a phase of the reference machine
# standard deviations: above every healthy run with one commissioning record or none, by a fifth; a machine that is
# commissioned with several needs less, see the campaign
THRESHOLD = 3.5
_FITS = 9.0  # squared distance, in standard deviations, up to which a direction fits
_RAYS = 31
CAVEAT = "equivalent bolted short: a contact resistance makes a larger short look like this one (lower bound)"


@dataclass(frozen=True, kw_only=True, slots=True)
class Verdict:
    """Decision about one window.

    Parameters
    ----------
    alarm : bool
        Whether the statistic exceeds the threshold.
    statistic : float
        Size of d in its own standard deviations.
    d : complex
        Fault coefficient less what the healthy machine would show.
    size_d : float
        3|d|, for small faults about the shorted share.
    kind : str
        "healthy" without alarm, else "one phase", "two phases", "undecided" (both fit), "no short" (none fits).
    phase : str
        Phase whose sector is nearest, also where there is no alarm; of a loop between two phases "ab", "bc", "ca".
    angle : float
        From the centre of the nearest phase's sector to d, rad; within +-phi_z/2 for an ideal short of that phase.
    gamma : float
        Equivalent shorted share of a phase's turns; NaN unless an alarm fits one phase.
    interval : tuple of float
        Limits that hold the equivalent share with 90 %.
    turns : float
        The same in turns; one turn is the smallest short there is.
    r_s : float
        Stator resistance used for the size, ohm.
    note : str
        What the numbers do not say.
    """

    alarm: bool
    statistic: float
    d: complex
    size_d: float
    kind: Kind
    phase: str
    angle: float
    gamma: float
    interval: tuple[float, float]
    turns: float
    r_s: float
    note: str


def deviation(
    healthy: Commissioning, s: Sequences, source: Literal["sequences", "observer"] = "sequences"
) -> tuple[Array, Array, Array]:
    """Difference to the healthy machine and how large it is in its own standard deviations.

    Parameters
    ----------
    healthy : Commissioning
        What is known about the machine.
    s : Sequences
        One window or many.
    source : {"sequences", "observer"}
        Fault coefficient from the window's sequences, or the observer's.

    Returns
    -------
    d : complex ndarray, shape (...)
    covariance : ndarray, shape (..., 2, 2)
    statistic : ndarray, shape (...)

    Raises
    ------
    ParameterError
        If the source is neither.
    """
    if source not in ("sequences", "observer"):
        raise ParameterError(f'source = {source!r}: must be "sequences" or "observer".')
    measured = fault_coefficient(healthy.motor, s) if source == "sequences" else s.g_c
    expected, C = healthy.predict(s)
    d = measured - expected
    return np.asarray(d), C, np.sqrt(_distance(d, C))


def _distance(d: Array, C: Array) -> Array:
    """Squared Mahalanobis distance."""
    a, b, c = C[..., 0, 0], C[..., 0, 1], C[..., 1, 1]
    x, y = np.real(d), np.imag(d)
    return np.asarray((c * x * x - 2 * b * x * y + a * y * y) / (a * c - b * b))


def _to_ray(d: complex, C: Array, angles: Array) -> Array:
    """Squared distance of d to rays from the origin."""
    inverse = np.linalg.inv(C)
    u = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    x = np.array([d.real, d.imag])
    along = np.maximum(u @ inverse @ x, 0.0) / np.einsum("ri,ij,rj->r", u, inverse, u)
    left = x - along[:, None] * u
    return np.asarray(np.einsum("ri,ij,rj->r", left, inverse, left))


def nearest_phase(d: Array, centres: Array) -> Array:
    """Phase whose sector's centre is nearest in angle.

    Parameters
    ----------
    d : complex ndarray, shape (...)
        Differences.
    centres : ndarray, shape (3,)
        Angles of `pumplib.motor.short_identify.sector_centres`, rad.

    Returns
    -------
    ndarray of int, shape (...)
    """
    return np.argmax(np.real(np.asarray(d)[..., None] * np.exp(-1j * centres)), axis=-1)


def size(d: complex, phase: int, r_s: float, s: Sequences, healthy: Commissioning) -> float:
    """Equivalent shorted share of the turns.

    Parameters
    ----------
    d : complex
        Difference to the healthy machine.
    phase : int
        Faulty phase, 0, 1, 2.
    r_s : float
        Present stator resistance, ohm.
    s : Sequences
        The window.
    healthy : Commissioning
        Whose belief d was computed with.

    Returns
    -------
    float
        NaN where the branch found feeds power back, which no short does.
    """
    motor = healthy.motor
    Y = fault_admittance(g_hat_of_phase(d, phase), motor.r_s, motor.L_ls, s.omega_s)
    if not Y.real > 0:
        return float("nan")
    return float(gamma_R(Y, r_s, motor.connection))


def decide(
    healthy: Commissioning, s: Sequences, *, threshold: float = THRESHOLD, r_s: float | None = None, turns: int = TURNS,
) -> Verdict:  # fmt: skip
    """Decide about one window.

    Parameters
    ----------
    healthy : Commissioning
        What is known about the machine.
    s : Sequences
        One window.
    threshold : float
        Of the statistic, standard deviations.
    r_s : float, optional
        Present stator resistance, ohm, where it is known better than from the commissioning.
    turns : int
        Turns of a phase.

    Returns
    -------
    Verdict

    Raises
    ------
    DataError
        If the window allows no decision: supply at standstill, phases swapped or lost, currents that do not sum to
        zero, sequences that are not finite.
    ParameterError
        If an argument is wrong.
    """
    check_value("decide", "threshold", threshold, Quantity("-", "threshold of the statistic", 0.0, 1e6, True))
    check_value("decide", "turns", turns, Quantity("-", "turns of a phase", 1, 1e5), whole=True)
    if r_s is not None:
        check_value("decide", "r_s", r_s, Quantity("ohm", "present stator resistance", 0.0, 1e3, True))
    flag = int(s.flag)
    if flag & REVERSED:
        raise DataError("the voltage rotates backwards: two phases are swapped; exchange two channels of v and of i.")
    if flag & EXCITATION:
        raise DataError("the supply is at or near standstill in this window: no short can be seen; use another window.")
    if flag & UNBALANCE:
        raise DataError("the voltage is far from balanced in this window: a phase is lost or a channel is dead.")
    if flag & SUM:
        raise DataError("the line currents do not sum to zero in this window: a channel is dead, or a fault to ground.")
    one, C, statistic = deviation(healthy, s)
    d = complex(one)
    if not np.isfinite(d):
        raise DataError("the window's sequences are not finite; check the record.")
    motor = healthy.motor
    centres = sector_centres(motor.r_s, motor.L_ls, float(s.omega_s))
    k = int(nearest_phase(np.array(d), centres))
    angle = float(np.angle(d * np.exp(-1j * centres[k])))
    alarm = bool(statistic > threshold)
    width = float(phi_z(motor.r_s, motor.L_ls, s.omega_s))
    rays = np.linspace(-0.5 * width, 0.5 * width, _RAYS)
    pair = int(nearest_phase(np.array(d), centres - np.pi / 3))  # between a and b, b and c, c and a
    single = _to_ray(d, C, centres[k] + rays).min()
    double = _to_ray(d, C, _pair_centres(centres)[pair] + rays).min()
    kind: Kind = "healthy"
    if alarm:
        one_fits, two_fit = single < _FITS, double < _FITS
        kind = ("undecided" if two_fit else "one phase") if one_fits else ("two phases" if two_fit else "no short")
    resistance, spread = healthy.r_s if r_s is None else (float(r_s), 0.0)
    gamma, interval = float("nan"), (float("nan"), float("nan"))
    if kind in ("one phase", "undecided"):
        gamma = size(d, k, resistance, s, healthy)
        step = 1e-3 * abs(d)
        slope = np.array([(size(d + change, k, resistance, s, healthy) - gamma) / step for change in (step, 1j * step)])
        variance = slope @ C @ slope + (gamma * spread / resistance) ** 2
        half = 1.645 * float(np.sqrt(variance))
        interval = (max(gamma - half, 0.0), gamma + half)
    return Verdict(
        alarm=alarm,
        statistic=float(statistic),
        d=d,
        size_d=3 * abs(d),
        kind=kind,
        phase=PAIRS[pair] if kind == "two phases" else PHASES[k],
        angle=angle,
        gamma=gamma,
        interval=interval,
        turns=gamma * turns,
        r_s=resistance,
        note=CAVEAT if np.isfinite(gamma) else "",
    )


def _pair_centres(centres: Array) -> Array:
    """Angles of loops between a and b, b and c, c and a, from those of single phases."""
    return np.angle(np.exp(1j * (np.asarray(centres) - np.pi / 3)))


def between_axes() -> Array:
    """Directions of g_c for uncoupled bolted loops between two phases, a-b, b-c, c-a.

    Returns
    -------
    complex ndarray, shape (3,)
        Of length 1.
    """
    s = PHASE_AXES - np.roll(PHASE_AXES, -1)
    return np.asarray(s**2 / np.abs(s) ** 2)
