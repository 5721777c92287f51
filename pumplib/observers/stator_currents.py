"""Thesis 5.3: inter-turn shorts from line currents alone, referred to a healthy machine (beyond the thesis).

Without voltages the fault coefficient cannot be had, but its cause can: a short adds a negative-sequence current.
Each record gives one number q = I_2/I_1, the ratio of the sequence phasors, in which the origin of time drops out.
Its difference to the healthy q, on the scale of the healthy current, grows about as the shorted share; its angle
turns by 120 degrees from phase to phase. The angle also falls as the short grows: a large short is less resistive
than a small one (its leakage grows with the turns), and the positive sequence it refers to turns with it. A
straight line in |d| describes that. At no load the healthy current lags the voltage by nearly 90 degrees, so the
difference of a resistive short of phase a leads it by about as much: the offset of the convention is no accident.

The convention was fixed on repetitions 001 and 002 of the ITSC records and on nothing else.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pumplib.errors import DataError
from pumplib.machines.quantity import Parameters, Quantity, check_value
from pumplib.motor.frames import PHASE_AXES

Array = NDArray[Any]
PHASES = ("a", "b", "c")
_SPAN = 0.02  # of the frequency that is searched around the nominal one
_FEWEST = 3.0  # periods in a record


@dataclass(frozen=True, kw_only=True, slots=True)
class Convention(Parameters):
    """How a difference of the negative sequence is read; the defaults belong to the ITSC test rig."""

    frequency: Annotated[float, Quantity("Hz", "nominal supply frequency", 1.0, 1e3)] = 60.0
    threshold: Annotated[float, Quantity("-", "smallest difference that is a short", 0.0, 10.0, True)] = 0.041
    offset: Annotated[float, Quantity("rad", "angle of a vanishing short of phase a", -10.0, 10.0)] = 1.755
    turn: Annotated[float, Quantity("rad", "fall of the angle per unit of difference", -100.0, 100.0)] = 2.25
    share: Annotated[float, Quantity("-", "shorted share of the turns per unit of difference", 0.0, 100.0, True)] = 1.03


@dataclass(frozen=True, kw_only=True, slots=True)
class CurrentPhasors:
    """Fundamental of three line currents.

    Parameters
    ----------
    frequency : float
        Fitted fundamental, Hz.
    I_1, I_2 : complex
        Positive- and negative-sequence phasor, amplitude, A.
    rest : float
        Root mean square of what the fundamental leaves, A.
    """

    frequency: float
    I_1: complex
    I_2: complex
    rest: float

    @property
    def q(self) -> complex:
        """I_2/I_1."""
        return self.I_2 / self.I_1


@dataclass(frozen=True, kw_only=True, slots=True)
class CurrentReference:
    """The healthy machine.

    Parameters
    ----------
    q : complex
        Mean I_2/I_1.
    current : float
        Mean amplitude of I_1, A.
    spread : float
        Largest deviation of one healthy record from the mean of the others; NaN with a single record.
    records : int
        Healthy records.
    convention : Convention
        How a difference is read.
    """

    q: complex
    current: float
    spread: float
    records: int
    convention: Convention


@dataclass(frozen=True, kw_only=True, slots=True)
class CurrentVerdict:
    """Decision about one record.

    Parameters
    ----------
    detected : bool
        Whether the difference exceeds the threshold.
    phase : str
        Phase whose sector is nearest, "a", "b" or "c"; without detection it means little.
    severity : float
        Shorted share of the turns of a phase, by the rig's proportion.
    difference : complex
        (I_2 - q_healthy I_1) over the healthy current.
    angle : float
        From the centre of the sector, rad, within +-pi/3.
    phasors : CurrentPhasors
        What was fitted.
    """

    detected: bool
    phase: str
    severity: float
    difference: complex
    angle: float
    phasors: CurrentPhasors


def fundamental(currents: ArrayLike, rate: float, frequency: float) -> CurrentPhasors:
    """Fit the fundamental to three line currents by least squares, its frequency included.

    Parameters
    ----------
    currents : array_like, shape (n, 3)
        Line currents, columns a, b, c, A.
    rate : float
        Sampling rate, Hz.
    frequency : float
        Nominal frequency, Hz; the fit searches 2 % around it.

    Returns
    -------
    CurrentPhasors

    Raises
    ------
    DataError
        If the record is too short, not finite, has a dead phase, rotates backwards, or holds no such fundamental.
    ParameterError
        If rate or frequency is impossible.
    """
    check_value("fundamental", "rate", rate, Quantity("Hz", "sampling rate", 1.0, 1e7))
    check_value("fundamental", "frequency", frequency, Quantity("Hz", "nominal frequency", 1.0, 0.45 * rate))
    x = np.asarray(currents, dtype=float)
    if x.ndim != 2 or x.shape[1] != 3:
        raise DataError(f"currents have shape {x.shape}: must be (n, 3), time first, columns a, b, c.")
    if not np.isfinite(x).all():
        k, c = (int(j) for j in np.argwhere(~np.isfinite(x))[0])
        raise DataError(f"i_{PHASES[c]} at sample {k} is {x[k, c]} A: must be finite; repair or cut the record.")
    n = len(x)
    if n < _FEWEST * rate / frequency:
        raise DataError(f"{n} samples at {rate:g} Hz: needs {_FEWEST:g} periods of {frequency:g} Hz or more.")
    rms = (x - x.mean(axis=0)).std(axis=0)
    if rms.min() < 0.05 * rms.max() or rms.max() == 0:
        raise DataError(
            f"i_{PHASES[int(rms.argmin())]} carries {rms.min():.3g} A of {rms.max():.3g} A: a phase is missing."
        )
    t = (np.arange(n) - 0.5 * (n - 1)) / rate

    def fit(f: float) -> tuple[Array, float]:
        basis = np.stack([np.cos(2 * np.pi * f * t), np.sin(2 * np.pi * f * t), np.ones(n)], axis=1)
        found = np.linalg.solve(basis.T @ basis, basis.T @ x)
        return found[0] - 1j * found[1], float(np.sum((x - basis @ found) ** 2))

    low, high = (1 - _SPAN) * frequency, (1 + _SPAN) * frequency
    # the residual has one minimum between f +- rate/n; a grid finds its valley, thirds its bottom
    grid = np.linspace(low, high, max(9, 4 * math.ceil((high - low) * n / rate)))
    best = int(np.argmin([fit(f)[1] for f in grid]))
    low, high = grid[max(best - 1, 0)], grid[min(best + 1, len(grid) - 1)]
    while high - low > 1e-7 * frequency:
        third = (high - low) / 3
        if fit(low + third)[1] < fit(high - third)[1]:
            high -= third
        else:
            low += third
    f = 0.5 * (low + high)
    phasors, left = fit(f)
    rest = math.sqrt(left / (3 * n))
    if rest > 0.5 * rms.max():
        raise DataError(
            f"no fundamental near {frequency:g} Hz: the fit leaves {rest:.3g} A of {rms.max():.3g} A; check the "
            f"sampling rate ({rate:g} Hz) and the nominal frequency."
        )
    I_1, I_2 = phasors @ PHASE_AXES / 3, phasors @ PHASE_AXES.conj() / 3
    if abs(I_1) < abs(I_2):
        raise DataError("the currents rotate backwards: two phases are swapped; exchange two columns.")
    return CurrentPhasors(frequency=float(f), I_1=complex(I_1), I_2=complex(I_2), rest=rest)


def current_reference(
    healthy: ArrayLike | Sequence[ArrayLike], rate: float, convention: Convention | None = None
) -> CurrentReference:
    """Learn the healthy machine from one record or several.

    Parameters
    ----------
    healthy : array_like, shape (n, 3), or a sequence of them
        Line currents of the healthy machine, A.
    rate : float
        Sampling rate, Hz.
    convention : Convention, optional
        How a difference is read.

    Returns
    -------
    CurrentReference

    Raises
    ------
    DataError
        If there is no record or one cannot be used.
    """
    rule = convention or Convention()
    rows: Any = healthy
    if len(rows) == 0:
        raise DataError("current_reference: needs at least one healthy record.")
    many = [rows] if np.ndim(rows[0]) == 1 else list(rows)
    found = [fundamental(one, rate, rule.frequency) for one in many]
    q = np.array([one.q for one in found])
    m = len(q)
    spread = float(np.abs(q - (q.sum() - q) / (m - 1)).max()) if m > 1 else float("nan")
    return CurrentReference(
        q=complex(q.mean()),
        current=float(np.mean([abs(one.I_1) for one in found])),
        spread=spread,
        records=m,
        convention=rule,
    )


def score_currents(reference: CurrentReference, currents: ArrayLike, rate: float) -> CurrentVerdict:
    """Decide about one record of line currents.

    Parameters
    ----------
    reference : CurrentReference
        The healthy machine.
    currents : array_like, shape (n, 3)
        Line currents, columns a, b, c, A.
    rate : float
        Sampling rate, Hz.

    Returns
    -------
    CurrentVerdict

    Raises
    ------
    DataError
        If the record cannot be used.
    """
    rule = reference.convention
    found = fundamental(currents, rate, rule.frequency)
    # on the scale of the healthy current, with the angle of the present one
    d = (found.q - reference.q) * abs(found.I_1) / reference.current
    straight = np.angle(d) - rule.offset + rule.turn * abs(d)
    off = np.angle(np.exp(1j * (straight - 2 * np.pi / 3 * np.arange(3))))
    k = int(np.argmin(np.abs(off)))
    return CurrentVerdict(
        detected=abs(d) > rule.threshold,
        phase=PHASES[k],
        severity=rule.share * abs(d),
        difference=complex(d),
        angle=float(off[k]),
        phasors=found,
    )


def detect_short(
    healthy: ArrayLike | Sequence[ArrayLike], currents: ArrayLike, rate: float, convention: Convention | None = None
) -> CurrentVerdict:
    """Healthy reference, currents and sampling rate in, detection, phase and severity out.

    Parameters
    ----------
    healthy : array_like, shape (n, 3), or a sequence of them
        Line currents of the healthy machine, A.
    currents : array_like, shape (n, 3)
        Line currents to decide about, A.
    rate : float
        Sampling rate, Hz.
    convention : Convention, optional
        How a difference is read.

    Returns
    -------
    CurrentVerdict

    Raises
    ------
    DataError
        If a record cannot be used.
    """
    return score_currents(current_reference(healthy, rate, convention), currents, rate)
