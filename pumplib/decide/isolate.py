"""Thesis 2.1, 2.1.4, 6.6: which fault it is: by the signs of the residuals, or by their direction.

Both ways return a ranking with margins, name every fault that cannot be told from the best one, and say
"none fits" where no fault of the table explains the residuals.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pumplib.decide.checks import block, channel_names, number
from pumplib.errors import DataError, ParameterError
from pumplib.machines.quantity import Quantity

Array = NDArray[Any]
NONE_FITS = "none fits"
_SYMBOLS = {"+": 1, "-": -1, "0": 0, "*": None}
_ANGLE = Quantity("deg", "angle", 0.0, 90.0)


@dataclass(frozen=True, kw_only=True, slots=True)
class Candidate:
    """One fault in a ranking.

    Parameters
    ----------
    fault : str
        Name.
    fits : bool
        Whether it explains the residuals.
    score : float
        What the ranking goes by. Signs: the smallest distance of a residual from the border of what the fault
        asks for, in thresholds, negative where one contradicts. Direction: cosine of the angle.
    against : tuple of str
        Residuals that contradict the fault; empty for a ranking by direction.
    """

    fault: str
    fits: bool
    score: float
    against: tuple[str, ...] = ()


@dataclass(frozen=True, kw_only=True, slots=True)
class Isolation:
    """Ranking of the faults.

    Parameters
    ----------
    ranking : tuple of Candidate
        Best first.
    ambiguous : tuple of str
        Faults that fit and cannot be told from the best one; the best one is among them. Empty if none fits.
    margin : float
        Lead of the best over the next fault outside `ambiguous`: thresholds for signs, degrees for directions;
        infinite without such a fault, NaN if none fits.
    """

    ranking: tuple[Candidate, ...]
    ambiguous: tuple[str, ...]
    margin: float

    @property
    def best(self) -> str:
        """Name of the best fault that fits, or ``"none fits"``."""
        return self.ranking[0].fault if self.ambiguous else NONE_FITS

    @property
    def unique(self) -> bool:
        """Whether exactly one fault is left."""
        return len(self.ambiguous) == 1


@dataclass(frozen=True, kw_only=True)
class SignatureTable:
    """Fault signature matrix: the sign of each residual under each fault.

    Parameters
    ----------
    residuals : tuple of str
        Names of the residuals.
    faults : mapping of str to str
        One symbol a residual: ``+``, ``-``, ``0``, or ``*`` for do not care; blanks are skipped.

    Raises
    ------
    ParameterError
        If a symbol or the number of symbols is wrong, or a fault has no visible residual.

    Examples
    --------
    >>> table = SignatureTable(residuals=("r1", "r2", "r3"), faults={"rub": "0--", "clogging": "-0+"})
    >>> table.isolate([0.1, -3.0, -2.0], [1.0, 1.0, 1.0]).best
    'rub'
    """

    residuals: tuple[str, ...]
    faults: Mapping[str, str]

    def __post_init__(self) -> None:
        channel_names(self.residuals, len(self.residuals))
        if not self.residuals or not self.faults:
            raise ParameterError("SignatureTable: give at least one residual and one fault.")
        for fault, signs in self.faults.items():
            symbols = signs.replace(" ", "")
            wrong = set(symbols) - set(_SYMBOLS)
            if wrong or len(symbols) != len(self.residuals):
                raise ParameterError(
                    f"SignatureTable.faults[{fault!r}] = {signs!r}: give {len(self.residuals)} of the symbols + - 0 *, "
                    f"one for each of {', '.join(self.residuals)}."
                )
            if not set(symbols) & {"+", "-"}:
                raise ParameterError(
                    f"SignatureTable.faults[{fault!r}] = {signs!r}: no residual reacts, so that the fault looks like "
                    "no fault; remove it or add a residual."
                )

    def signs(self, fault: str) -> tuple[int | None, ...]:
        """Signs of one fault.

        Parameters
        ----------
        fault : str
            Name.

        Returns
        -------
        tuple of int or None
            1, -1, 0, or None for do not care.

        Raises
        ------
        ParameterError
            If the table has no such fault.
        """
        if fault not in self.faults:
            raise ParameterError(f"SignatureTable: no fault {fault!r}; known are {', '.join(self.faults)}.")
        return tuple(_SYMBOLS[symbol] for symbol in self.faults[fault].replace(" ", ""))

    def indistinguishable(self) -> tuple[tuple[str, str], ...]:
        """Pairs of faults that some residuals fit both of.

        Returns
        -------
        tuple of (str, str)
            Empty if the table isolates every fault.
        """
        names = tuple(self.faults)
        return tuple(
            (one, two)
            for i, one in enumerate(names)
            for two in names[i + 1 :]
            if all(a is None or b is None or a == b for a, b in zip(self.signs(one), self.signs(two), strict=True))
        )

    def isolate(
        self, residuals: ArrayLike, thresholds: ArrayLike, available: Sequence[bool] | None = None
    ) -> Isolation:
        """Rank the faults by how well the signs of the residuals agree.

        A residual counts as + above its threshold, as - below minus its threshold, else as 0.

        Parameters
        ----------
        residuals : array_like, shape (residuals,)
            Residuals, for example means over a window after the alarm.
        thresholds : array_like, shape (residuals,)
            Their thresholds, same units.
        available : sequence of bool, optional
            Residuals that can be trusted now; the others are not looked at.

        Returns
        -------
        Isolation
            None fits if no residual exceeds its threshold.

        Raises
        ------
        DataError
            If shapes are wrong, a number is not finite or no residual is available.
        """
        scaled, usable = _normalised(residuals, thresholds, self.residuals, available)
        u = scaled.tolist()
        found = []
        for fault in self.faults:
            distance = []
            for j, sign in enumerate(self.signs(fault)):
                if usable[j] and sign is not None:
                    distance.append((1 - abs(u[j]) if sign == 0 else sign * u[j] - 1, self.residuals[j]))
            seen = any(usable[j] and sign for j, sign in enumerate(self.signs(fault)))
            score = min((d for d, _ in distance), default=-math.inf) if seen else -math.inf
            against = tuple(name for d, name in distance if d < 0)
            found.append(Candidate(fault=fault, fits=score >= 0, score=score, against=against))
        found.sort(key=lambda one: (-one.fits, len(one.against) if one.score > -math.inf else 99, -one.score))
        fitting = tuple(one.fault for one in found if one.fits)
        others = [one.score for one in found if not one.fits]
        margin = found[0].score - max(others, default=-math.inf) if fitting else math.nan
        return Isolation(ranking=tuple(found), ambiguous=fitting, margin=margin)


def _normalised(
    residuals: ArrayLike, thresholds: ArrayLike, names: Sequence[str], available: Sequence[bool] | None
) -> tuple[Array, list[bool]]:
    """Residuals in thresholds, and which of them count."""
    r, k = np.atleast_1d(np.asarray(residuals, dtype=float)), np.atleast_1d(np.asarray(thresholds, dtype=float))
    if r.shape != (len(names),) or k.shape != (len(names),):
        raise DataError(
            f"residuals have shape {r.shape} and thresholds {k.shape}: must be ({len(names)},), one for each of "
            f"{', '.join(names)}."
        )
    usable = [True] * len(names) if available is None else [bool(one) for one in available]
    if len(usable) != len(names) or not any(usable):
        raise DataError(f"available = {available!r}: give {len(names)} Booleans, at least one of them True.")
    for j, name in enumerate(names):
        if not (math.isfinite(k[j]) and k[j] > 0):
            raise DataError(f"threshold of {name}: {k[j]} must be finite and above zero, in the residual's unit.")
        if usable[j] and not math.isfinite(r[j]):
            raise DataError(f"residual {name}: {r[j]} is not finite; mark it as not available.")
    return np.where(usable, np.where(usable, r, 0.0) / k, 0.0), usable


def isolate_direction(
    residuals: ArrayLike,
    thresholds: ArrayLike,
    directions: Mapping[str, ArrayLike],
    *,
    names: Sequence[str] | None = None,
    ambiguity_deg: float = 10.0,
    widest_deg: float = 30.0,
    both_signs: bool = False,
    available: Sequence[bool] | None = None,
) -> Isolation:
    """Rank the faults by the angle between the residuals and the direction each fault moves them.

    Residuals and directions are divided by the thresholds first, so that every residual counts in its own noise.

    Parameters
    ----------
    residuals : array_like, shape (residuals,)
        Residuals, for example means over a window after the alarm.
    thresholds : array_like, shape (residuals,)
        Thresholds at rest k0, same units.
    directions : mapping of str to array_like, shape (residuals,)
        Effect of each fault on the residuals at the present operating point, any size, same units.
    names : sequence of str, optional
        Names of the residuals.
    ambiguity_deg : float
        Faults within this angle of the best angle count as not told apart, degrees.
    widest_deg : float
        Beyond this angle a fault does not fit, degrees.
    both_signs : bool
        Whether a fault may also act with the opposite sign, as a sensor fault does.
    available : sequence of bool, optional
        Residuals that can be trusted now.

    Returns
    -------
    Isolation
        None fits if all residuals are zero or no fault is near enough. A fault that is invisible in the available
        residuals never fits.

    Raises
    ------
    DataError
        If a shape is wrong or a number not finite.
    ParameterError
        If an angle is out of range or there is no fault.
    """
    number("isolate_direction", "ambiguity_deg", ambiguity_deg, _ANGLE)
    number("isolate_direction", "widest_deg", widest_deg, _ANGLE)
    if not directions:
        raise ParameterError("isolate_direction: directions is empty; give at least one fault.")
    labels = channel_names(names, len(np.atleast_1d(np.asarray(residuals))))
    u, usable = _normalised(residuals, thresholds, labels, available)
    size = float(np.linalg.norm(u))
    found = []
    for fault, effect in directions.items():
        try:
            d, _ = _normalised(effect, thresholds, labels, usable)
        except DataError as error:
            raise DataError(f"direction of {fault}: {error}") from error
        length = float(np.linalg.norm(d))
        cosine = float(u @ d) / (size * length) if size > 0 and length > 0 else -1.0
        cosine = min(max(abs(cosine) if both_signs and length > 0 and size > 0 else cosine, -1.0), 1.0)
        found.append(Candidate(fault=fault, fits=_degrees(cosine) <= widest_deg, score=cosine))
    found.sort(key=lambda one: -one.score)
    if not found[0].fits:
        return Isolation(ranking=tuple(found), ambiguous=(), margin=math.nan)
    best = _degrees(found[0].score)
    close = tuple(one.fault for one in found if one.fits and _degrees(one.score) - best <= ambiguity_deg)
    others = [_degrees(one.score) for one in found if one.fault not in close]
    return Isolation(ranking=tuple(found), ambiguous=close, margin=min(others, default=math.inf) - best)


def _degrees(cosine: float) -> float:
    return math.degrees(math.acos(cosine))


def window_mean(
    residuals: ArrayLike,
    alarm: int,
    dt: float,
    *,
    start: float = 0.7,
    stop: float = 1.3,
    names: Sequence[str] | None = None,
) -> Array:
    """Mean residuals in a window after an alarm, when the transient of the onset is over.

    Parameters
    ----------
    residuals : array_like, shape (n, residuals)
        Residuals, time first.
    alarm : int
        Sample of the alarm.
    dt : float
        Sampling interval, s.
    start, stop : float
        Window after the alarm, s.
    names : sequence of str, optional
        Names of the residuals.

    Returns
    -------
    ndarray, shape (residuals,)

    Raises
    ------
    DataError
        If the window does not lie inside the record or a value in the record is not finite.
    ParameterError
        If a number is wrong.
    """
    number("window_mean", "dt", dt, Quantity("s", "sampling interval", 0.0, 1e6, True))
    number("window_mean", "alarm", alarm, Quantity("samples", "sample of the alarm"), whole=True)
    number("window_mean", "start", start, Quantity("s", "begin of the window"))
    number("window_mean", "stop", stop, Quantity("s", "end of the window", start, open_low=True))
    shape = np.shape(residuals)
    x = block(residuals, channel_names(names, shape[1] if len(shape) == 2 else 1))
    first, last = alarm + round(start / dt), alarm + round(stop / dt)
    if last <= first:
        raise ParameterError(f"window_mean: no sample between {start:g} s and {stop:g} s at dt = {dt:g} s.")
    if last > len(x):
        raise DataError(
            f"window_mean: the window ends at {last * dt:g} s, the record at {len(x) * dt:g} s; record "
            f"{stop:g} s after the alarm."
        )
    return x[first:last].mean(axis=0)
