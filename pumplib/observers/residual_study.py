"""Thesis 6.6, 6.7: what the residual observers do on a pump that obeys their model exactly, and what they leave open.

There a residual must be blind to what its structure leaves out, decay at its designed rate, and point where the table
of signatures says. What it leaves open are faults that look like others; the operating point decides between them.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pumplib.errors import DataError
from pumplib.observers.residual import RESIDUALS, ResidualObserver, ResidualSettings
from pumplib.observers.residual_model import PumpBelief
from pumplib.observers.residual_nominal import SHIFT, NominalRecord, ideal, moving_record, steady_record
from pumplib.observers.residual_signature import directions, mimic

Array = NDArray[Any]
SIZES = {"clogging": 1e10, "friction": 2.5e-4, "leakage": 6e-8, "cavitation": 0.025, "dry_running": 0.9}
"""Sizes of the detection claims: Pa s2/m6, N m s, m3/s/sqrt(Pa), shares of the head."""
CLASSIFIED = {"clogging": 2e10, "friction": 5e-4, "leakage": 2.4e-7, "cavitation": 0.1, "dry_running": 0.9}
"""Sizes of the classification claim."""
HALF = {"clogging": 5e9, "friction": 1.25e-4, "leakage": 3e-8, "cavitation": 0.0125, "dry_running": 0.45}
"""Half the sizes of the detection claims."""
BLIND = (("r1", "friction"), ("r2", "clogging"), ("r3", "leakage"))
"""Residual and the fault that its constraints leave out."""
POINTS = ((306.0, 1.6e-3), (306.0, 1.1e-3), (250.0, 1.3e-3), (190.0, 1.0e-3), (190.0, 0.7e-3))
"""Operating points, rad/s and m3/s, inside the bench's range."""


def observed(belief: PumpBelief, record: NominalRecord, settings: ResidualSettings | None = None) -> Array:
    """Residuals of a nominal record by the compiled observers.

    Parameters
    ----------
    belief : PumpBelief
        What the observers believe.
    record : NominalRecord
        The record.
    settings : ResidualSettings, optional
        Gains.

    Returns
    -------
    ndarray, shape (n, 4)
        r1 (Pa), r2, r3 (N m), r4 (Pa).
    """
    observer = ResidualObserver(belief, record.dt, settings)
    return observer.run(record.omega, record.T_e, record.H, record.Q).r


@dataclass(frozen=True, kw_only=True, slots=True)
class Sensitivity:
    """Reaction of one residual to a fault it should not see, over its smallest reaction to one that it should.

    Parameters
    ----------
    residual, fault : str
        Names.
    where : str
        Operating point, or "moving".
    reaction, scale : float
        Change of the residual by the fault, and its smallest change by one of the other four, in its unit.
    """

    residual: str
    fault: str
    where: str
    reaction: float
    scale: float

    @property
    def relative(self) -> float:
        """Reaction over scale."""
        return self.reaction / self.scale


def insensitivity(
    belief: PumpBelief, points: Sequence[tuple[float, float]] = POINTS, sizes: Mapping[str, float] = SIZES,
    settings: ResidualSettings | None = None,
) -> tuple[Sensitivity, ...]:  # fmt: skip
    """Structurally zero reactions, from the steady state before a fault to that with it.

    Parameters
    ----------
    belief : PumpBelief
        The pump, nominal: the observers know it exactly.
    points : sequence of tuple of float
        Operating points, rad/s and m3/s.
    sizes : mapping of str to float
        Of the five faults.
    settings : ResidualSettings, optional
        Gains.

    Returns
    -------
    tuple of Sensitivity
        One for each of `BLIND` and each point; `max(s.relative for s in ...)` is the claim.
    """
    found = []
    for omega, Q in points:
        moved = reactions(belief, omega, Q, sizes, settings)
        for residual, fault in BLIND:
            column = RESIDUALS.index(residual)
            found.append(
                Sensitivity(
                    residual=residual, fault=fault, where=f"{omega:g} rad/s, {1e3 * Q:g} l/s",
                    reaction=float(abs(moved[fault][column])),
                    scale=float(min(abs(one[column]) for name, one in moved.items() if name != fault)),
                )
            )  # fmt: skip
    return tuple(found)


def moving_insensitivity(
    belief: PumpBelief, dt: float = 1e-3, sizes: Mapping[str, float] = SIZES, settings: ResidualSettings | None = None
) -> tuple[Sensitivity, ...]:
    """The same while speed, flow and fault move: what remains is the error of the integration, of second order in dt.

    Parameters
    ----------
    belief : PumpBelief
        The pump; its sensors are taken without lag.
    dt : float
        Sampling interval, s.
    sizes : mapping of str to float
        Of the five faults.
    settings : ResidualSettings, optional
        Gains.

    Returns
    -------
    tuple of Sensitivity
        One for each of `BLIND`.
    """
    pump = ideal(belief)
    healthy = observed(pump, moving_record(pump, dt=dt), settings)
    moved = {
        name: np.abs(observed(pump, moving_record(pump, name, size, dt), settings) - healthy).max(axis=0)
        for name, size in sizes.items()
    }
    return tuple(
        Sensitivity(
            residual=residual, fault=fault, where="moving", reaction=float(moved[fault][RESIDUALS.index(residual)]),
            scale=float(min(one[RESIDUALS.index(residual)] for name, one in moved.items() if name != fault)),
        )
        for residual, fault in BLIND
    )  # fmt: skip


def reactions(
    belief: PumpBelief, omega: float, Q: float, sizes: Mapping[str, float] = SIZES,
    settings: ResidualSettings | None = None,
) -> dict[str, Array]:  # fmt: skip
    """What faults do to the residuals at an operating point, by nominal simulation.

    Parameters
    ----------
    belief : PumpBelief
        The pump.
    omega, Q : float
        Operating point, rad/s and m3/s.
    sizes : mapping of str to float
        Faults and sizes.
    settings : ResidualSettings, optional
        Gains.

    Returns
    -------
    dict of str to ndarray, shape (4,)
        Change of r1 (Pa), r2, r3 (N m), r4 (Pa) at rest.
    """
    found = {}
    for name, size in sizes.items():
        r = observed(belief, steady_record(belief, omega, Q, name, size), settings)
        found[name] = np.asarray(r[-1] - r[round(0.9 * SHIFT / 1e-3)])
    return found


def decay_rate(belief: PumpBelief, k: float, omega: ArrayLike, estimate: ArrayLike, Q: ArrayLike) -> Array:
    """Rate at which the error J (w - w_hat) of the fourth observer shrinks; exact, as both maps are quadratic in w.

    Parameters
    ----------
    belief : PumpBelief
        The pump.
    k : float
        Output injection, 1/s.
    omega, estimate : array_like
        True and estimated speed, rad/s.
    Q : array_like
        Flow, m3/s.

    Returns
    -------
    ndarray
        1/s; positive is convergence.
    """
    w, v, q = (np.asarray(one, dtype=float) for one in (omega, estimate, Q))
    gain = k / (belief.a_h1 * q + 2 * belief.a_h0 * np.maximum(v, 50.0))
    own = (belief.B + belief.a_t1 * q + belief.a_t0 * (w + v)) / belief.J
    return np.asarray(own + gain * (belief.a_h1 * q + belief.a_h0 * (w + v)))


def least_decay(
    belief: PumpBelief, k: float, speeds: tuple[float, float] = (180.0, 320.0), flows: tuple[float, float] = (0.0, 2e-3)
) -> float:
    """Smallest decay rate of the fourth observer over a part of the map, true and estimated speed inside it.

    Parameters
    ----------
    belief : PumpBelief
        The pump.
    k : float
        Output injection, 1/s.
    speeds, flows : tuple of float
        Ranges, rad/s and m3/s.

    Returns
    -------
    float
        1/s.
    """
    axis, flow = np.linspace(*speeds, 41), np.linspace(*flows, 41)
    return float(decay_rate(belief, k, axis[:, None, None], axis[None, :, None], flow[None, None, :]).min())


@dataclass(frozen=True, kw_only=True, slots=True)
class Mimicry:
    """A leakage and the pair of faults that looks like it, at an operating point.

    Parameters
    ----------
    where : str
        Name of the point.
    omega, Q : float
        rad/s and m3/s.
    K_f, dB : float
        Clogging and friction that would look like the leakage here, Pa s2/m6 and N m s.
    angle_deg : float
        Direction of the leakage in the plane of r1 and r2, both over their thresholds.
    apart : float
        Distance of leakage and the pair that fits the first point, in thresholds.
    """

    where: str
    omega: float
    Q: float
    K_f: float
    dB: float
    angle_deg: float
    apart: float


def mimicry(
    belief: PumpBelief, K_l: float, scale: ArrayLike, points: Mapping[str, tuple[float, float]]
) -> tuple[Mimicry, ...]:
    """Follow a leakage and the pair that mimics it at the first point to other points.

    Parameters
    ----------
    belief : PumpBelief
        The pump.
    K_l : float
        Leakage, m3/s/sqrt(Pa).
    scale : array_like, shape (2,)
        Thresholds of r1 (Pa) and r2 (N m) at rest.
    points : mapping of str to tuple of float
        Name to speed, rad/s, and flow, m3/s; the first is where the pair fits.

    Returns
    -------
    tuple of Mimicry

    Raises
    ------
    DataError
        If there is no point, or the thresholds are not two positive numbers.
    """
    k = np.asarray(scale, dtype=float)
    if k.shape != (2,) or not (k > 0).all() or not points:
        raise DataError(
            f"mimicry: scale = {scale!r}, {len(points)} points; give two positive thresholds and a point or more."
        )
    found: list[Mimicry] = []
    for where, (omega, Q) in points.items():
        effects = directions(belief, omega, Q)
        K_f, dB = mimic(belief, omega, Q, K_l)
        fitted = (found[0].K_f, found[0].dB) if found else (K_f, dB)
        leak = K_l * effects["leakage"][:2] / k
        pair = (fitted[0] * effects["clogging"][:2] + fitted[1] * effects["friction"][:2]) / k
        found.append(
            Mimicry(
                where=where, omega=omega, Q=Q, K_f=K_f, dB=dB,
                angle_deg=float(np.degrees(np.arctan2(leak[1], leak[0])) % 360.0),
                apart=float(np.hypot(*(leak - pair))),
            )
        )  # fmt: skip
    return tuple(found)


def wrong_start(
    belief: PumpBelief, k: float, *, error: float = 20.0, omega: float = 306.0, Q: float = 1.5e-3, duration: float = 4.0
) -> tuple[Array, dict[str, tuple[Array, float]]]:
    """Errors of the three observers with a state after a first sample with a wrong speed; everything else is nominal.

    Parameters
    ----------
    belief : PumpBelief
        The pump; its sensors are taken without lag.
    k : float
        Output injection, 1/s.
    error : float
        Of the first speed, rad/s.
    omega, Q : float
        Operating point, rad/s and m3/s.
    duration : float
        s.

    Returns
    -------
    t : ndarray, shape (n,)
        s, from the third sample on.
    errors : dict of str to tuple of (ndarray, float)
        r2 and r3 in N m, the speed of r4 in rad/s, each with the rate that is proven for it, 1/s: exact for the first
        two, a lower bound for the last.
    """
    pump = ideal(belief)
    record = steady_record(pump, omega, Q, duration=duration)
    wrong = record.omega.copy()
    wrong[0] += error
    r = ResidualObserver(pump, record.dt, ResidualSettings(k=k)).run(wrong, record.T_e, record.H, record.Q).r[2:]
    # speed behind r4: H - r4 is the head map at the estimated speed
    root = (belief.a_h1 * Q) ** 2 + 4 * belief.a_h0 * (record.H[2:] - r[:, 3] + belief.a_h2 * Q**2)
    estimate = (np.sqrt(root) - belief.a_h1 * Q) / (2 * belief.a_h0)
    lowest = float(decay_rate(belief, k, omega, np.array([omega, omega + error]), Q).min())
    errors = {"$r_2$": (r[:, 1], k), "$r_3$": (r[:, 2], k), r"$\hat\omega$ of $r_4$": (estimate - omega, lowest)}
    return record.t[2:], errors
