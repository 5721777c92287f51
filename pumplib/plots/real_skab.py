"""Thesis 7.3, 8.1: figures of the SKAB test bed (beyond the thesis): what was learned, judged and scored."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from numpy.typing import NDArray

from pumplib.errors import ParameterError
from pumplib.monitor.skab import TRAIN_ROWS, SkabRun
from pumplib.monitor.skab_flow import FlowBand, Learned, flow_alarms, residual, windowed_mean
from pumplib.monitor.skab_leaderboard import Published
from pumplib.monitor.skab_protocol import Counts
from pumplib.monitor.skab_score import ALL, ALWAYS, CLOCK, RESIDUAL, FolderScore
from pumplib.plots.style import COLOURS, LINES, PAGE, style

Array = NDArray[Any]
_PERCENT = 100.0
_OURS = {RESIDUAL: "blue", ALWAYS: "grey", CLOCK: "grey"}


@style()
def learning(healthy: SkabRun, learned: Learned) -> Figure:
    """Show how the healthy set was learned on the anomaly-free record.

    Three panels: the record, the Allan deviation over the length of the mean, and the share of rows of pretended
    runs that a set of given half-width holds.

    Parameters
    ----------
    healthy : SkabRun
        The record.
    learned : Learned
        What was learned from it.

    Returns
    -------
    Figure
    """
    figure = plt.figure(figsize=(PAGE, 4.4), layout="constrained")
    grid = figure.add_gridspec(2, 2, height_ratios=(1, 1.15))
    record, allan, share = (
        figure.add_subplot(grid[0, :]),
        figure.add_subplot(grid[1, 0]),
        figure.add_subplot(grid[1, 1]),
    )
    minutes = healthy.seconds / 60
    smooth = windowed_mean(healthy.seconds, healthy.flow, learned.band.averaging)
    record.plot(minutes, healthy.flow, color=COLOURS["sky"], lw=0.5, label="measured, one row a second")
    record.plot(minutes, smooth, color=COLOURS["blue"], lw=0.9, label=f"mean of {learned.band.averaging:g} s")
    record.set_xlabel("time in min")
    record.set_ylabel("flow in l/min")
    record.set_title("Anomaly-free record: slow drift and short dips")
    record.legend(loc="lower right", ncols=2)

    good = np.isfinite(learned.allan)
    allan.semilogx(learned.lengths[good], _PERCENT * learned.allan[good], "o-")
    allan.axvline(learned.band.averaging, color=COLOURS["red"], ls="--")
    allan.text(
        0.97, 0.06, f"used (dashed): {learned.band.averaging:g} s",
        transform=allan.transAxes, ha="right", fontsize=7.5,
    )  # fmt: skip
    allan.set_ylim(bottom=0)
    allan.set_xlabel("length of the mean in s")
    allan.set_ylabel("Allan deviation in % of flow")
    allan.set_title("How much neighbouring means differ")
    allan.xaxis.set_major_formatter("{x:g}")
    allan.xaxis.set_minor_formatter("")
    allan.set_xticks([1, 2, 5, 10, 20, 60])

    width = learned.band.half_width
    held = np.searchsorted(learned.deviations, width, side="right") / len(learned.deviations)
    shown = np.linspace(0, len(learned.deviations) - 1, 600).astype(int)
    share.plot(
        _PERCENT * learned.deviations[shown],
        _PERCENT * (shown + 1) / len(learned.deviations),
        label=f"{learned.runs} pretended runs (overlapping)",
    )
    share.axvline(_PERCENT * width, color=COLOURS["red"], ls="--", label=f"b = {_PERCENT * width:.2f} %")
    share.axhline(_PERCENT * held, color=COLOURS["grey"], ls=":", label=f"holds {_PERCENT * held:.0f} % of the rows")
    share.set_xlabel("distance from the training rows in %")
    share.set_ylabel("rows inside in %")
    share.set_title("The healthy set holds the share asked for")
    share.legend(loc="lower right")
    return figure


@style()
def judged_runs(runs: Sequence[SkabRun], band: FlowBand) -> Figure:
    """Show runs as the detector sees them: relative flow, healthy set, alarms, and the labels behind them.

    Parameters
    ----------
    runs : sequence of SkabRun
        One panel each.
    band : FlowBand
        The healthy set.

    Returns
    -------
    Figure

    Raises
    ------
    ParameterError
        If there is no run.
    """
    if not runs:
        raise ParameterError("runs: none is given; give at least one run.")
    figure, grid = plt.subplots(
        len(runs), 1, figsize=(PAGE, 0.7 + 1.55 * len(runs)), layout="constrained", squeeze=False
    )
    for axes, run in zip(grid[:, 0], runs, strict=True):
        _one_run(axes, run, band)
    grid[-1, 0].set_xlabel("row of the file (about one a second)")
    handles = [
        Line2D([], [], color=COLOURS["blue"], label="mean flow over training flow, minus one"),
        Patch(color=COLOURS["green"], alpha=0.3, label="healthy set"),
        Patch(color=COLOURS["orange"], alpha=0.35, label="labelled as anomaly"),
        Line2D([], [], color=COLOURS["black"], ls=":", label="change point"),
        Line2D([], [], color=COLOURS["red"], lw=4, label="alarm"),
    ]
    figure.legend(handles=handles, loc="outside upper center", ncols=5, handlelength=1.6, columnspacing=1.2)
    return figure


def _one_run(axes: Axes, run: SkabRun, band: FlowBand) -> None:
    rows = np.arange(run.rows)
    percent = _PERCENT * residual(run, band)
    width = _PERCENT * band.half_width
    edge = 4.2 * width
    over = axes.get_xaxis_transform()
    axes.broken_barh(_spans(run.anomaly), (0, 1), transform=over, color=COLOURS["orange"], alpha=0.35, lw=0)
    axes.axhspan(-width, width, color=COLOURS["green"], alpha=0.3, lw=0)
    axes.axvspan(0, TRAIN_ROWS, color="#e8e8e8", lw=0, zorder=0)
    axes.plot(rows, np.clip(percent, -edge, edge), lw=0.9, color=COLOURS["blue"])
    for point in np.flatnonzero(run.changepoint):
        axes.axvline(float(point), color=COLOURS["black"], ls=":", lw=1.0)
    alarm = np.concatenate([np.zeros(TRAIN_ROWS, dtype=bool), flow_alarms(run, band)])
    axes.broken_barh(_spans(alarm), (0, 0.07), transform=over, color=COLOURS["red"], lw=0, zorder=3)
    axes.set_xlim(0, run.rows)
    axes.set_ylim(-1.25 * edge, 1.1 * edge)
    axes.set_ylabel("residual in %")
    beyond = " (values beyond the edge are drawn at it)" if (np.abs(percent) > edge).any() else ""
    axes.set_title(f"{run.name}: {np.mean(run.flow[:TRAIN_ROWS]):.1f} l/min in the training rows{beyond}")
    axes.text(TRAIN_ROWS / 2, 0.86, "training", ha="center", fontsize=7, transform=over)


def _spans(where: Array) -> list[tuple[int, int]]:
    """First row and number of rows of each stretch of True."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], where, [False]]).astype(np.int8)))
    return [(int(first), int(last - first)) for first, last in zip(edges[::2], edges[1::2], strict=True)]


@style()
def scores(score: FolderScore, published: Sequence[Published]) -> Figure:
    """Compare the set-valued residual with trivial baselines and the published leaderboard.

    Parameters
    ----------
    score : FolderScore
        Scores of the files at hand.
    published : sequence of Published
        The leaderboard.

    Returns
    -------
    Figure
    """
    lines = [(item.name, item.f1, item.far, item.mar, "") for item in published]
    lines += [(name, part[ALL].f1, part[ALL].far, part[ALL].mar, name) for name, part in score.scores.items()]
    lines.sort(key=lambda line: np.nan_to_num(line[1], nan=-1.0))
    figure, (left, right) = plt.subplots(
        1, 2, figsize=(PAGE, 0.95 + 0.25 * len(lines)), sharey=True, layout="constrained"
    )
    place = np.arange(len(lines))
    left.barh(
        place,
        [line[1] for line in lines],
        color=[COLOURS[_OURS.get(line[4], "sky")] for line in lines],
        hatch=["//" if line[4] in (ALWAYS, CLOCK) else "" for line in lines],
        edgecolor="white",
    )
    for k, line in enumerate(lines):
        left.text(line[1] + 0.01, k, f"{line[1]:.2f}", va="center", fontsize=7)
    left.set_yticks(place, [line[0] for line in lines])
    left.set_xlim(0, 1.08)
    left.set_xlabel("F1")
    left.set_title("F1, larger is better")
    left.grid(axis="y", visible=False)
    right.plot([_PERCENT * line[2] for line in lines], place, "s", color=COLOURS["red"], label="false alarms (FAR)")
    right.plot(
        [_PERCENT * line[3] for line in lines],
        place,
        "o",
        color=COLOURS["purple"],
        label="missed rows (MAR)",
        mfc="none",
    )
    right.set_xlim(-3, 103)
    right.set_xlabel("share of rows in %")
    right.set_title("Rates, smaller is better")
    files = score.overall.files
    handles = [
        Patch(color=COLOURS["blue"], label=f"this notebook, {files} files"),
        Patch(facecolor=COLOURS["grey"], hatch="//", edgecolor="white", label=f"trivial, {files} files"),
        Patch(color=COLOURS["sky"], label="published, all 34 files"),
        *right.lines,
    ]
    figure.legend(handles=handles, loc="outside upper center", ncols=5, handlelength=1.4, columnspacing=1.0)
    return figure


@style()
def sensitivity(half_widths: Array, sweep: Mapping[str, Sequence[Counts]], score: FolderScore) -> Figure:
    """Show how the scores depend on the half-width that was learned.

    Parameters
    ----------
    half_widths : ndarray of float, shape (k,)
        Relative half-widths.
    sweep : mapping of str to sequence of Counts
        One entry a half-width for each group and `ALL`.
    score : FolderScore
        For the half-width in use and the baselines.

    Returns
    -------
    Figure
    """
    figure, (left, right) = plt.subplots(1, 2, figsize=(PAGE, 3.0), layout="constrained", sharex=True)
    percent = _PERCENT * np.asarray(half_widths)
    for k, (group, counts) in enumerate(sweep.items()):
        bold = group == ALL
        left.plot(
            percent,
            [c.f1 for c in counts],
            lw=2.0 if bold else 1.1,
            color=COLOURS["black"] if bold else None,
            ls="-" if bold else LINES[(k + 1) % len(LINES)],
            label="all files" if bold else group,
        )
    for name, ls in ((ALWAYS, (0, (1, 1))), (CLOCK, (0, (5, 3)))):
        value = score.scores[name][ALL].f1
        left.axhline(value, color=COLOURS["grey"], ls=ls, lw=1.0)
        left.text(percent[-1], value + 0.008, name, fontsize=7, ha="right", va="bottom", color=COLOURS["grey"])
    right.plot(percent, [_PERCENT * c.far for c in sweep[ALL]], color=COLOURS["red"], label="false alarms (FAR)")
    right.plot(
        percent, [_PERCENT * c.mar for c in sweep[ALL]], "--", color=COLOURS["purple"], label="missed rows (MAR)"
    )
    used = _PERCENT * score.band.half_width
    origin = "given" if score.learned is None else f"from {score.learned.source}"
    for axes in (left, right):
        axes.axvline(used, color=COLOURS["orange"], lw=1.2, ls="-.", label=f"b = {used:.2f} %, {origin}")
        axes.set_xlabel("half-width b of the healthy set in %")
    left.set_ylim(0, 1)
    left.set_ylabel("F1")
    left.set_title("F1 by experiment")
    right.set_ylim(0, 100)
    right.set_ylabel("share of rows in %")
    right.set_title("The price of a wider set, all files")
    handles = [*(line for line in left.lines if not line.get_label().startswith("_")), *right.lines[:2]]
    figure.legend(handles=handles, loc="outside upper center", ncols=4, columnspacing=1.2)
    return figure
