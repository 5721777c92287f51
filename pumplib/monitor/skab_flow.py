"""Thesis 7.3: a set-valued residual on flow, its healthy set learned on one anomaly-free record (beyond the thesis).

SKAB has no speed, frequency or phase angle, so the residuals of chapters 6 and 7 cannot be formed. What is left is
their last step. The flow Q_0 of a run is what its training rows hold on average; the healthy set of the flow is
Q_0 [1 - b, 1 + b]. The residual of a row is the interval [m/Q_0 - 1 - b, m/Q_0 - 1 + b] with m the mean over the
last seconds; an alarm is raised when zero is not in it. Length of the mean and half-width b come from the
anomaly-free record alone: the length from its least Allan deviation (longer means average noise away, still longer
ones collect drift), b from pretended runs in it, as the share of their rows that the set is to hold.
"""

import math
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray

from pumplib.errors import DataError, ParameterError
from pumplib.machines.quantity import Parameters, Quantity
from pumplib.monitor.skab import TRAIN_ROWS, SkabRun

Array = NDArray[Any]

AVERAGING = (1.0, 2.0, 3.0, 5.0, 8.0, 10.0, 15.0, 20.0, 30.0, 45.0, 60.0)  # s, lengths that are tried
CLOCK_ROWS = (570, 970)  # first row with alarm, first row without: what the labels of SKAB look like on average
_STRIDE = 10  # rows between the starts of pretended runs
_PAIRS = 20  # fewest neighbouring means for an Allan deviation


@dataclass(frozen=True, kw_only=True, slots=True)
class BandSettings(Parameters):
    """How the healthy set is learned."""

    coverage: Annotated[float, Quantity("-", "share of the rows of pretended runs inside the set", 0.5, 1.0)] = 0.95
    run_rows: Annotated[
        int, Quantity("rows", "length of a pretended run, training rows included", TRAIN_ROWS + 1, 1e6,
                      hint="A run of SKAB takes about 20 min.")
    ] = 1150  # fmt: skip
    margin: Annotated[float, Quantity("-", "factor on the learned half-width", 0.0, 100.0, True)] = 1.0


@dataclass(frozen=True, kw_only=True, slots=True)
class FlowBand(Parameters):
    """Healthy set of the flow, relative to the flow of the training rows."""

    half_width: Annotated[float, Quantity("-", "half-width b of the healthy set", 0.0, 1.0, True)]
    averaging: Annotated[float, Quantity("s", "length of the mean", 0.0, 3600.0, True)]


@dataclass(frozen=True, kw_only=True, slots=True)
class Learned:
    """A band with what it was learned from.

    Parameters
    ----------
    band : FlowBand
        The result.
    deviations : ndarray of float, shape (n,)
        Sorted absolute relative deviations of all rows of all pretended runs after their training rows.
    runs : int
        Pretended runs; they overlap, so they are no independent repetitions.
    lengths, allan : ndarray of float, shape (k,)
        Lengths of the mean that were tried, s, and the relative Allan deviation of the flow at each.
    source : str
        Name of the record.
    """

    band: FlowBand
    deviations: Array
    runs: int
    lengths: Array
    allan: Array
    source: str


def windowed_mean(seconds: Array, values: Array, length: float) -> Array:
    """Return the mean over the last seconds of each row, over the rows that are there.

    Parameters
    ----------
    seconds : ndarray of float, shape (rows,)
        Increasing times, s. After a gap the mean starts again from fewer rows.
    values : ndarray of float, shape (rows,)
        Any unit.
    length : float
        Length, s; one row is always in it.

    Returns
    -------
    ndarray of float, shape (rows,)
    """
    first = np.minimum(np.searchsorted(seconds, seconds - length, side="right"), np.arange(len(seconds)))
    total = np.concatenate([[0.0], np.cumsum(values - values[0])])  # differences of small sums round less
    here = np.arange(1, len(seconds) + 1)
    mean = values[0] + (total[here] - total[first]) / (here - first)
    return np.where(here - first == 1, values, mean)  # a single row is its own mean to the last bit


def allan_deviation(seconds: Array, values: Array, length: float) -> float:
    """Return the Allan deviation of a record: how much neighbouring means of a given length differ.

    Parameters
    ----------
    seconds : ndarray of float, shape (rows,)
        Increasing times, s.
    values : ndarray of float, shape (rows,)
        Any unit.
    length : float
        Length of the means, s.

    Returns
    -------
    float
        In the unit of the values; NaN with fewer than 20 neighbouring pairs.

    References
    ----------
    D. W. Allan, Statistics of atomic frequency standards, Proc. IEEE 54 (1966).
    """
    bins = np.floor_divide(seconds - seconds[0], length).astype(int)
    rows = np.bincount(bins)
    filled = rows > 0
    means = np.bincount(bins, weights=values)[filled] / rows[filled]
    neighbours = np.diff(np.flatnonzero(filled)) == 1
    steps = np.diff(means)[neighbours]
    return math.sqrt(0.5 * float(np.mean(steps**2))) if len(steps) >= _PAIRS else math.nan


def learn_band(
    healthy: SkabRun,
    settings: BandSettings | None = None,
    *,
    averaging: float | None = None,
    half_width: float | None = None,
) -> Learned:
    """Learn the healthy set on an anomaly-free record.

    Parameters
    ----------
    healthy : SkabRun
        The record, see `pumplib.monitor.skab.read_healthy`.
    settings : BandSettings, optional
        How; the defaults otherwise.
    averaging : float, optional
        Length of the mean, s; learned otherwise.
    half_width : float, optional
        Half-width, relative; learned otherwise.

    Returns
    -------
    Learned

    Raises
    ------
    DataError
        If the record has anomalies, is too short for a pretended run, or the flow stands still.
    ParameterError
        If a given value is out of its limits.
    """
    settings = BandSettings() if settings is None else settings
    if healthy.anomaly.any():
        raise DataError(f"{healthy.name}: has rows labelled as anomalies; learn from an anomaly-free record.")
    if healthy.rows < settings.run_rows:
        raise DataError(
            f"{healthy.name}: {healthy.rows} rows, but a pretended run takes run_rows = {settings.run_rows}; give a "
            "longer anomaly-free record or lower run_rows."
        )
    _flow_of_training(healthy)
    mean_flow = float(np.mean(healthy.flow))
    lengths = np.array(AVERAGING)
    allan = np.array([allan_deviation(healthy.seconds, healthy.flow, length) for length in lengths]) / mean_flow
    if averaging is None:
        if not np.isfinite(allan).any():
            raise DataError(f"{healthy.name}: too short to choose the length of the mean; give averaging in s.")
        averaging = float(lengths[np.nanargmin(allan)])
    check = FlowBand(half_width=1.0 if half_width is None else half_width, averaging=averaging)
    smooth = windowed_mean(healthy.seconds, healthy.flow, check.averaging)
    starts = np.arange(0, healthy.rows - settings.run_rows + 1, _STRIDE)
    total = np.concatenate([[0.0], np.cumsum(healthy.flow)])
    centres = (total[starts + TRAIN_ROWS] - total[starts]) / TRAIN_ROWS
    judged = np.lib.stride_tricks.sliding_window_view(smooth[TRAIN_ROWS:], settings.run_rows - TRAIN_ROWS)[starts]
    deviations = np.sort(np.abs(judged / centres[:, None] - 1.0).ravel())
    if half_width is None:
        # the smallest set that really holds the share: the next larger value, no interpolation
        learned = float(np.quantile(deviations, settings.coverage, method="higher")) * settings.margin
        if not 0.0 < learned <= 1.0:
            raise DataError(
                f"{healthy.name}: the learned half-width is {learned:g}, it must be > 0 and <= 1; the flow sensor "
                "stands still or the record is not one operating point."
            )
        half_width = learned
    return Learned(
        band=FlowBand(half_width=half_width, averaging=averaging),
        deviations=deviations,
        runs=len(starts),
        lengths=lengths,
        allan=allan,
        source=healthy.name,
    )


def residual(run: SkabRun, band: FlowBand) -> Array:
    """Return the centre of the residual of each row: mean flow over the flow of the training rows, minus one.

    Parameters
    ----------
    run : SkabRun
        The run.
    band : FlowBand
        Gives the length of the mean.

    Returns
    -------
    ndarray of float, shape (rows,)

    Raises
    ------
    DataError
        If there is no flow in the training rows.
    """
    centre: Array = windowed_mean(run.seconds, run.flow, band.averaging) / _flow_of_training(run) - 1.0
    return centre


def residual_set(run: SkabRun, band: FlowBand) -> tuple[Array, Array]:
    """Return the residual of each row as an interval.

    Parameters
    ----------
    run : SkabRun
        The run.
    band : FlowBand
        The healthy set.

    Returns
    -------
    low, high : ndarray of float, shape (rows,)
        Zero inside: the row is explained by the healthy set.

    Raises
    ------
    DataError
        See `residual`.
    """
    centre = residual(run, band)
    return centre - band.half_width, centre + band.half_width


def flow_alarms(run: SkabRun, band: FlowBand) -> Array:
    """Judge the rows after the training rows by the set-valued residual.

    Parameters
    ----------
    run : SkabRun
        The run.
    band : FlowBand
        The healthy set.

    Returns
    -------
    ndarray of bool, shape (rows - 400,)
        Whether zero is outside the residual.

    Raises
    ------
    DataError
        See `residual`.
    """
    low, high = residual_set(run, band)
    alarms: Array = ((low > 0.0) | (high < 0.0))[TRAIN_ROWS:]
    return alarms


def always_alarm(run: SkabRun) -> Array:
    """Raise an alarm in each row: the first trivial baseline.

    Parameters
    ----------
    run : SkabRun
        The run; only its length matters.

    Returns
    -------
    ndarray of bool, shape (rows - 400,)
    """
    return np.ones(run.rows - TRAIN_ROWS, dtype=bool)


def clock_alarm(run: SkabRun, rows: tuple[int, int] = CLOCK_ROWS) -> Array:
    """Raise an alarm by the number of the row and nothing else: the second trivial baseline.

    Parameters
    ----------
    run : SkabRun
        The run; only its length matters.
    rows : tuple of int
        First row with alarm and first row without, counted from 0 at the start of the file.

    Returns
    -------
    ndarray of bool, shape (rows - 400,)

    Raises
    ------
    ParameterError
        If the rows are no increasing pair that starts after the training rows.
    """
    if len(rows) != 2 or not TRAIN_ROWS <= rows[0] < rows[1]:
        raise ParameterError(f"rows {rows}: give two rows, {TRAIN_ROWS} <= first < last.")
    number = np.arange(TRAIN_ROWS, run.rows)
    alarms: Array = (number >= rows[0]) & (number < rows[1])
    return alarms


def _flow_of_training(run: SkabRun) -> float:
    flow = float(np.mean(run.flow[:TRAIN_ROWS]))
    if not flow > 0.0:
        raise DataError(
            f"{run.name}: the mean flow of the {TRAIN_ROWS} training rows is {flow:g} l/min, so a relative residual "
            "does not exist; leave the file out or check the flow sensor."
        )
    return flow
