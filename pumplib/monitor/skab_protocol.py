"""Thesis 2.1.4: the scores of the SKAB benchmark: rows as outliers, changes as change points (beyond the thesis).

Rows: the rows after the training rows of all files are counted together, right or wrong, alarm or not. Change
points: each opens a window to its right; the first reported change inside counts, the more the earlier, along a
scaled hyperbolic tangent; later ones inside are ignored, those outside are false, an empty window is a miss.
The sum is scaled so that a detector that never reports has 0 and one that reports each change at once has 100.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pumplib.errors import DataError, ParameterError

Array = NDArray[Any]

NAB_WINDOW = 60.0  # s, of the published leaderboard
# reward of a change reported at once, price of a false one, price of a missed one
PROFILES = {"standard": (1.0, -0.11, -1.0), "low_fp": (1.0, -0.22, -1.0), "low_fn": (1.0, -0.11, -2.0)}
_POSITIONS = 1000  # the benchmark reads its reward curve at so many positions of the window


@dataclass(frozen=True, kw_only=True, slots=True)
class Counts:
    """Rows judged.

    Parameters
    ----------
    tp, fp, fn, tn : int
        Anomalous with alarm, healthy with alarm, anomalous without, healthy without.
    """

    tp: int
    fp: int
    fn: int
    tn: int

    @property
    def f1(self) -> float:
        """TP/(TP + (FN + FP)/2); NaN if there is neither an anomaly nor an alarm."""
        return _ratio(self.tp, self.tp + (self.fn + self.fp) / 2)

    @property
    def far(self) -> float:
        """Share of the healthy rows with alarm, 0..1; NaN without healthy rows."""
        return _ratio(self.fp, self.fp + self.tn)

    @property
    def mar(self) -> float:
        """Share of the anomalous rows without alarm, 0..1; NaN without anomalous rows."""
        return _ratio(self.fn, self.fn + self.tp)

    @property
    def rows(self) -> int:
        """All rows."""
        return self.tp + self.fp + self.fn + self.tn

    @property
    def anomalous(self) -> int:
        """Anomalous rows."""
        return self.tp + self.fn


@dataclass(frozen=True, kw_only=True, slots=True)
class Changes:
    """Change points of one or more runs confronted with the reported ones.

    Parameters
    ----------
    delays : tuple of float
        From the left end of its window to the first report inside, s, for each change point found. The left end
        is the change point itself, unless the window before reaches beyond it.
    positions : tuple of float
        The same as share of the window, 0..1.
    missed : int
        Change points without a report in their window.
    false : int
        Reports outside all windows.
    """

    delays: tuple[float, ...]
    positions: tuple[float, ...]
    missed: int
    false: int

    @property
    def points(self) -> int:
        """True change points."""
        return len(self.delays) + self.missed

    @property
    def mean_delay(self) -> float:
        """Mean delay of the change points found, s; NaN if none is found."""
        return _ratio(math.fsum(self.delays), len(self.delays))

    def nab(self, profile: str = "standard") -> float:
        """Return the scaled score.

        Parameters
        ----------
        profile : str
            One of `PROFILES`.

        Returns
        -------
        float
            100 at best, 0 for no report at all, negative for many false ones; NaN without change points.

        Raises
        ------
        ParameterError
            If there is no such profile.
        """
        if profile not in PROFILES:
            raise ParameterError(f"profile {profile!r}: choose one of {', '.join(PROFILES)}.")
        reward, price_false, price_missed = PROFILES[profile]
        gained = math.fsum(_reward(position, reward, price_false) for position in self.positions)
        got = gained + price_false * self.false + price_missed * self.missed
        least = price_missed * self.points
        return _ratio(100.0 * (got - least), reward * self.points - least)


def count(anomaly: ArrayLike, alarm: ArrayLike) -> Counts:
    """Count the rows of one run.

    Parameters
    ----------
    anomaly, alarm : array of bool, shape (rows,)
        Labels and decisions of the rows that are judged.

    Returns
    -------
    Counts

    Raises
    ------
    DataError
        If the two are no truth values of the same shape.
    """
    truth, said = _truth("anomaly", anomaly), _truth("alarm", alarm)
    if len(truth) != len(said):
        raise DataError(f"{len(truth)} labels and {len(said)} decisions; give one decision a row that is judged.")
    return Counts(
        tp=int((truth & said).sum()),
        fp=int((~truth & said).sum()),
        fn=int((truth & ~said).sum()),
        tn=int((~truth & ~said).sum()),
    )


def reported_changes(alarm: ArrayLike) -> Array:
    """Return the rows where the decision changes; the first one counts if it is an alarm.

    Parameters
    ----------
    alarm : array of bool, shape (rows,)
        Decisions.

    Returns
    -------
    ndarray of bool, shape (rows,)
    """
    said = _truth("alarm", alarm)
    changed = np.empty(len(said), dtype=bool)
    if len(said):
        changed[0] = said[0]
        changed[1:] = said[1:] != said[:-1]
    return changed


def confront(seconds: ArrayLike, changepoint: ArrayLike, reported: ArrayLike, window: float = NAB_WINDOW) -> Changes:
    """Compare the reported changes of one run with the true ones.

    Parameters
    ----------
    seconds : array of float, shape (rows,)
        Increasing times of the rows, s.
    changepoint, reported : array of bool, shape (rows,)
        True and reported changes.
    window : float
        Width of the window to the right of a change point, s. Where two overlap the later one is cut.

    Returns
    -------
    Changes

    Raises
    ------
    DataError
        If the shapes differ or the times do not increase.
    ParameterError
        If the window is not positive.
    """
    times = np.asarray(seconds, dtype=float)
    truth, said = _truth("changepoint", changepoint), _truth("reported", reported)
    if not times.shape == truth.shape == said.shape:
        raise DataError(f"shapes {times.shape}, {truth.shape}, {said.shape}: give times and changes of the same rows.")
    if not np.isfinite(times).all() or (np.diff(times) <= 0).any():
        raise DataError("seconds: the times must be finite and increase from row to row; sort the run.")
    if not (math.isfinite(window) and window > 0):
        raise ParameterError(f"window {window!r} s: must be finite and > 0 s, the benchmark uses {NAB_WINDOW:g} s.")
    reports = times[said]
    outside = np.ones(len(reports), dtype=bool)
    delays, positions, missed, left_end = [], [], 0, -math.inf
    for point in times[truth]:
        start, end = max(float(point), left_end), float(point) + window
        inside = (reports >= start) & (reports <= end)
        outside &= ~inside
        if inside.any():
            delay = float(reports[inside][0]) - start
            delays.append(delay)
            positions.append(delay / (end - start))
        else:
            missed += 1
        left_end = end
    return Changes(delays=tuple(delays), positions=tuple(positions), missed=missed, false=int(outside.sum()))


def pool_counts(parts: Iterable[Counts]) -> Counts:
    """Add the counts of several runs.

    Parameters
    ----------
    parts : iterable of Counts
        One a run.

    Returns
    -------
    Counts
    """
    every = list(parts)
    return Counts(
        tp=sum(c.tp for c in every),
        fp=sum(c.fp for c in every),
        fn=sum(c.fn for c in every),
        tn=sum(c.tn for c in every),
    )


def pool_changes(parts: Iterable[Changes]) -> Changes:
    """Add the changes of several runs.

    Parameters
    ----------
    parts : iterable of Changes
        One a run.

    Returns
    -------
    Changes
    """
    every = list(parts)
    return Changes(
        delays=tuple(d for c in every for d in c.delays),
        positions=tuple(p for c in every for p in c.positions),
        missed=sum(c.missed for c in every),
        false=sum(c.false for c in every),
    )


def _reward(position: float, best: float, worst: float) -> float:
    """Reward of a report at a share of the window: `best` at its left end, `worst` at its right."""
    index = min(int(position * _POSITIONS), _POSITIONS - 1)
    x = math.pi * (index / (_POSITIONS - 1) - 0.5)
    return (best + worst) / 2 - (best - worst) / 2 * math.tanh(x) / math.tanh(math.pi / 2)


def _ratio(part: float, whole: float) -> float:
    return part / whole if whole else math.nan


def _truth(name: str, values: ArrayLike) -> Array:
    array = np.asarray(values)
    if array.dtype != np.bool_ or array.ndim != 1:
        raise DataError(f"{name}: {array.dtype} of shape {array.shape}; give one truth value a row.")
    return array
