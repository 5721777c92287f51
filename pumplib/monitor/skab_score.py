"""Thesis 7.3, 8.1: a folder of SKAB files in, scores of each experiment out (beyond the thesis).

`score_folder` works on any number of files of the benchmark's form. The trivial baselines are scored with every
call, because a score on SKAB means little without them.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pumplib.errors import DataError, ParameterError
from pumplib.monitor import skab_protocol as protocol
from pumplib.monitor.skab import SENSORS, TRAIN_ROWS, SkabRun, find_healthy, read_folder, read_healthy
from pumplib.monitor.skab_flow import (
    BandSettings,
    FlowBand,
    Learned,
    always_alarm,
    clock_alarm,
    flow_alarms,
    learn_band,
    windowed_mean,
)

Array = NDArray[Any]
Judge = Callable[[SkabRun], Array]

ALL = "all"
RESIDUAL = "set-valued flow residual"
ALWAYS = "always alarm"
CLOCK = "clock"


@dataclass(frozen=True, kw_only=True, slots=True)
class GroupScore:
    """Score of one experiment, or of all files together.

    Parameters
    ----------
    group : str
        Name of the experiment, or `ALL`.
    files : int
        Number of files.
    counts : Counts
        Rows after the training rows, pooled.
    changes : Changes
        Change points after the training rows, pooled.
    tainted : int
        Training rows that are labelled as anomalies; the flow that is taken for healthy is wrong there.
    """

    group: str
    files: int
    counts: protocol.Counts
    changes: protocol.Changes
    tainted: int

    @property
    def f1(self) -> float:
        """F1 of the rows."""
        return self.counts.f1

    @property
    def far(self) -> float:
        """Share of healthy rows with alarm, 0..1."""
        return self.counts.far

    @property
    def mar(self) -> float:
        """Share of anomalous rows without alarm, 0..1."""
        return self.counts.mar

    @property
    def nab(self) -> float:
        """Score of the change points, standard profile."""
        return self.changes.nab()

    @property
    def delay(self) -> float:
        """Mean delay of the change points found, s."""
        return self.changes.mean_delay

    def row(self) -> dict[str, Any]:
        """Return one line for a table.

        Returns
        -------
        dict of str to object
            Rates in percent, delay in s, all numbers rounded as the leaderboard does.
        """
        return {
            "group": self.group,
            "files": self.files,
            "rows": self.counts.rows,
            "anomalous": self.counts.anomalous,
            "F1": round(self.f1, 3),
            "FAR %": round(100 * self.far, 2),
            "MAR %": round(100 * self.mar, 2),
            **{f"NAB {name}": round(self.changes.nab(name), 2) for name in protocol.PROFILES},
            "change points": self.changes.points,
            "missed": self.changes.missed,
            "false": self.changes.false,
            "delay s": round(self.delay, 1),
            "tainted training rows": self.tainted,
        }


@dataclass(frozen=True, kw_only=True, slots=True)
class FolderScore:
    """Scores of a folder.

    Parameters
    ----------
    runs : tuple of SkabRun
        What was judged.
    band : FlowBand
        The healthy set that was used.
    learned : Learned or None
        Where it comes from; None if the band was given.
    scores : dict of str to dict of str to GroupScore
        By detector (`RESIDUAL`, `ALWAYS`, `CLOCK`), then by group; the last group is `ALL`.
    """

    runs: tuple[SkabRun, ...]
    band: FlowBand
    learned: Learned | None
    scores: dict[str, dict[str, GroupScore]]

    @property
    def groups(self) -> dict[str, GroupScore]:
        """Scores of the set-valued residual by group."""
        return self.scores[RESIDUAL]

    @property
    def overall(self) -> GroupScore:
        """Score of the set-valued residual on all files."""
        return self.scores[RESIDUAL][ALL]

    def judge(self, run: SkabRun) -> Array:
        """Judge a further run by the same healthy set.

        Parameters
        ----------
        run : SkabRun
            The run; labels are not looked at.

        Returns
        -------
        ndarray of bool, shape (rows - 400,)
            Alarms after the training rows.
        """
        return flow_alarms(run, self.band)

    def table(self) -> list[dict[str, Any]]:
        """Return all scores as lines of a table.

        Returns
        -------
        list of dict
        """
        return [{"detector": name, **score.row()} for name, part in self.scores.items() for score in part.values()]


def score_runs(runs: Sequence[SkabRun], judge: Judge, *, window: float = protocol.NAB_WINDOW) -> dict[str, GroupScore]:
    """Score any detector on labelled runs by the benchmark's protocol.

    Parameters
    ----------
    runs : sequence of SkabRun
        Labelled runs.
    judge : callable
        Takes a run and returns one decision for each row after the training rows, array of bool.
    window : float
        Width of the window of a change point, s.

    Returns
    -------
    dict of str to GroupScore
        One a group, then `ALL`.

    Raises
    ------
    DataError
        If there is no run, a run has no labels or the decisions do not fit the rows.
    ParameterError
        If the window is not positive, or a group is named `ALL`.
    """
    if not runs:
        raise DataError("no runs to score; give at least one labelled run.")
    parts: dict[str, list[tuple[protocol.Counts, protocol.Changes, int]]] = {}
    for run in runs:
        if not run.labelled:
            raise DataError(f"{run.name}: has no labels and cannot be scored; leave it out.")
        if run.group == ALL:
            raise ParameterError(f"{run.name}: a group cannot be named {ALL!r}; rename the folder.")
        alarm = judge(run)
        try:
            counts = protocol.count(run.anomaly[TRAIN_ROWS:], alarm)
        except DataError as error:
            raise DataError(f"{run.name}: {error}") from None
        reported = protocol.reported_changes(alarm)
        changes = protocol.confront(run.seconds[TRAIN_ROWS:], run.changepoint[TRAIN_ROWS:], reported, window)
        parts.setdefault(run.group, []).append((counts, changes, int(run.anomaly[:TRAIN_ROWS].sum())))
    parts[ALL] = [item for group in list(parts.values()) for item in group]
    return {
        group: GroupScore(
            group=group,
            files=len(items),
            counts=protocol.pool_counts(item[0] for item in items),
            changes=protocol.pool_changes(item[1] for item in items),
            tainted=sum(item[2] for item in items),
        )
        for group, items in parts.items()
    }


def score_folder(
    folder: str | Path,
    *,
    healthy: str | Path | None = None,
    band: FlowBand | None = None,
    settings: BandSettings | None = None,
    averaging: float | None = None,
    half_width: float | None = None,
    window: float = protocol.NAB_WINDOW,
) -> FolderScore:
    """Judge and score all files below a folder.

    Parameters
    ----------
    folder : str or Path
        With files GROUP/NAME.csv of the SKAB form, any number of them.
    healthy : str or Path, optional
        Anomaly-free file to learn the healthy set from; the folder's own by default.
    band : FlowBand, optional
        A healthy set that was learned before; no anomaly-free file is needed then.
    settings : BandSettings, optional
        How the set is learned.
    averaging : float, optional
        Length of the mean, s, in place of the learned one.
    half_width : float, optional
        Relative half-width in place of the learned one.
    window : float
        Width of the window of a change point, s.

    Returns
    -------
    FolderScore

    Raises
    ------
    DataError
        If the folder, the anomaly-free file or a run is wrong; file, column, line and remedy are named.
    ParameterError
        If a value is out of its limits, or a band is given together with what would make another one.
    """
    if band is not None and any(item is not None for item in (healthy, settings, averaging, half_width)):
        raise ParameterError("band: is given together with healthy, settings, averaging or half_width; give only one.")
    runs = read_folder(folder)
    learned = None
    if band is None:
        record = read_healthy(find_healthy(folder) if healthy is None else healthy)
        learned = learn_band(record, settings, averaging=averaging, half_width=half_width)
        band = learned.band
    used = band
    judges: dict[str, Judge] = {
        RESIDUAL: lambda run: flow_alarms(run, used),
        ALWAYS: always_alarm,
        CLOCK: clock_alarm,
    }
    scores = {name: score_runs(runs, judge, window=window) for name, judge in judges.items()}
    return FolderScore(runs=runs, band=band, learned=learned, scores=scores)


def best_and_worst(runs: Sequence[SkabRun], judge: Judge) -> tuple[SkabRun, ...]:
    """Choose what to look at: of each group the runs with the largest and the smallest F1.

    Parameters
    ----------
    runs : sequence of SkabRun
        Labelled runs.
    judge : callable
        See `score_runs`.

    Returns
    -------
    tuple of SkabRun
        Best first, group by group; one run where a group has no other.

    Raises
    ------
    DataError
        See `score_runs`.
    """
    chosen: list[SkabRun] = []
    for group in dict.fromkeys(run.group for run in runs):
        mine = sorted((run for run in runs if run.group == group), key=lambda run: -_f1(run, judge))
        chosen += mine[:1] if len(mine) == 1 else [mine[0], mine[-1]]
    return tuple(chosen)


def _f1(run: SkabRun, judge: Judge) -> float:
    value = score_runs([run], judge)[ALL].f1
    return -1.0 if math.isnan(value) else value


def sweep_band(
    runs: Sequence[SkabRun], half_widths: Sequence[float], averaging: float
) -> dict[str, list[protocol.Counts]]:
    """Count the rows for many half-widths: how much a score owes to the one that was learned.

    Parameters
    ----------
    runs : sequence of SkabRun
        Labelled runs.
    half_widths : sequence of float
        Relative half-widths.
    averaging : float
        Length of the mean, s.

    Returns
    -------
    dict of str to list of Counts
        One list a group and `ALL`, one entry a half-width.

    Raises
    ------
    DataError
        See `score_runs`.
    """
    result: dict[str, list[protocol.Counts]] = {}
    for half_width in half_widths:
        band = FlowBand(half_width=float(half_width), averaging=averaging)
        for group, score in score_runs(runs, lambda run, band=band: flow_alarms(run, band)).items():  # type: ignore[misc]
            result.setdefault(group, []).append(score.counts)
    return result


def sensor_information(runs: Sequence[SkabRun], averaging: float) -> dict[str, float]:
    """Ask of each sensor how well its distance from the training rows ranks anomalous rows above healthy ones.

    Parameters
    ----------
    runs : sequence of SkabRun
        Labelled runs.
    averaging : float
        Length of the mean, s.

    Returns
    -------
    dict of str to float
        Area under the ROC curve of |mean - training mean| over the training standard deviation, rows pooled; 0.5
        is chance. Largest first. A sensor that stands still during a training is NaN.

    Raises
    ------
    DataError
        If there is no anomalous or no healthy row.
    """
    truth = np.concatenate([run.anomaly[TRAIN_ROWS:] for run in runs]) if runs else np.empty(0, dtype=bool)
    bad, good = int(truth.sum()), int((~truth).sum())
    if not bad or not good:
        raise DataError(f"{bad} anomalous and {good} healthy rows: both are needed to compare them.")
    result = {}
    for name in SENSORS:
        distance = np.concatenate([_distance(run, run.sensors[name], averaging) for run in runs])
        area = (float(_ranks(distance)[truth].sum()) - bad * (bad + 1) / 2) / (bad * good)
        result[name] = area if np.isfinite(distance).all() else math.nan
    return dict(sorted(result.items(), key=lambda item: -item[1] if item[1] == item[1] else 1.0))


def _ranks(values: Array) -> Array:
    """Ranks from 1, equal values share the mean of theirs."""
    _, place, number = np.unique(values, return_inverse=True, return_counts=True)
    middle: Array = np.cumsum(number) - (number - 1) / 2
    return middle[place]


def _distance(run: SkabRun, values: Array, averaging: float) -> Array:
    spread = float(np.std(values[:TRAIN_ROWS]))
    if spread == 0.0:
        return np.full(run.rows - TRAIN_ROWS, np.nan)
    smooth = windowed_mean(run.seconds, values, averaging)[TRAIN_ROWS:]
    distance: Array = np.abs(smooth - np.mean(values[:TRAIN_ROWS])) / spread
    return distance
