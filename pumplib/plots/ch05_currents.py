"""Thesis 5.3: figures of measured line currents with inter-turn shorts (beyond the thesis)."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from pumplib.errors import ParameterError
from pumplib.observers.stator_currents import PHASES, Convention
from pumplib.observers.stator_currents_score import LEVEL_SHARE, CurrentScore, ScoredRecord
from pumplib.plots.style import COLOURS, COLUMN, PAGE, style

Array = NDArray[Any]
_LOOK = {"a": ("blue", "o"), "b": ("red", "s"), "c": ("green", "^"), "": ("black", "D")}
_THIRD = 2 * np.pi / 3


def _some(score: CurrentScore) -> None:
    if not score.rows:
        raise ParameterError("the score holds no record; score one at least.")


def _point(ax: Axes, x: float, y: float, row: ScoredRecord, size: float = 5.5) -> None:
    colour, marker = _LOOK[row.record.phase]
    fill = "white" if row.record.unseen else COLOURS[colour]
    ax.plot(x, y, marker=marker, ms=size, mew=1.1, ls="none", color=COLOURS[colour], mfc=fill, zorder=4)
    if row.record.suspect:
        ax.plot(x, y, marker="x", ms=size + 5, mew=1.5, ls="none", color=COLOURS["purple"], zorder=6)


def _handles(score: CurrentScore) -> list[Line2D]:
    made = []
    for phase in (*PHASES, ""):
        if any(row.record.phase == phase for row in score.rows):
            colour, marker = _LOOK[phase]
            label = f"labelled phase {phase}" if phase else "healthy"
            made.append(Line2D([], [], marker=marker, ms=5.5, ls="none", color=COLOURS[colour], label=label))
    if any(row.record.unseen for row in score.rows):
        made.append(
            Line2D([], [], marker="o", ms=5.5, ls="none", color=COLOURS["grey"], mfc="white", label="unseen repetition")
        )
    if any(row.record.suspect for row in score.rows):
        made.append(Line2D([], [], marker="x", ms=9, mew=1.5, ls="none", color=COLOURS["purple"], label="suspect file"))
    return made


def _spiral(rule: Convention, k: float, size: Array) -> Array:
    """Points whose straightened angle is k thirds of a turn from the centre of phase a."""
    return size * np.exp(1j * (rule.offset - rule.turn * size + k * _THIRD))


def _sectors(ax: Axes, rule: Convention, low: float, high: float) -> None:
    size = np.linspace(low, high, 60)
    for k, phase in enumerate(PHASES):
        first, last = _spiral(rule, k - 0.5, size), _spiral(rule, k + 0.5, size)
        middle = _spiral(rule, k, size)
        # the outer edge is an arc, not a chord
        arcs = [np.exp(1j * np.linspace(-_THIRD / 2, _THIRD / 2, 40)) * end for end in (middle[-1], middle[0])]
        edge = np.concatenate([first, arcs[0], last[::-1], arcs[1][::-1]])
        colour = COLOURS[_LOOK[phase][0]]
        ax.fill(edge.real, edge.imag, color=colour, alpha=0.09, lw=0, zorder=0)
        ax.plot(middle.real, middle.imag, color=colour, lw=0.9, ls="--", zorder=2)
        ax.plot(first.real, first.imag, color=COLOURS["grey"], lw=0.9, zorder=1)


def _disc(ax: Axes, radius: float, *, ls: str, label: str) -> Line2D:
    turn = np.linspace(0, 2 * np.pi, 181)
    (line,) = ax.plot(
        radius * np.cos(turn), radius * np.sin(turn), color=COLOURS["black"], lw=1.0, ls=ls, zorder=3, label=label
    )
    return line


@style()
def difference_plane(score: CurrentScore) -> Figure:
    """All differences in the complex plane with the threshold and the sectors of the phases.

    Left all files, right the surroundings of the threshold.

    Parameters
    ----------
    score : CurrentScore
        Scored records.

    Returns
    -------
    Figure

    Raises
    ------
    ParameterError
        If there is no record.
    """
    _some(score)
    rule = score.reference.convention
    largest = max([row.size for row in score.rows] + [2 * rule.threshold])
    near = max(3.2 * rule.threshold, 1.3 * score.reference.spread if math.isfinite(score.reference.spread) else 0.0)
    figure, (whole, detail) = plt.subplots(1, 2, figsize=(PAGE, 4.15), layout="constrained")
    for ax, reach in ((whole, 1.12 * largest), (detail, near)):
        _sectors(ax, rule, rule.threshold, 1.5 * reach)
        circle = _disc(ax, rule.threshold, ls="-", label="threshold")
        for row in score.rows:
            d = row.verdict.difference
            if abs(d.real) < reach and abs(d.imag) < reach:
                _point(ax, d.real, d.imag, row)
        ax.set(xlim=(-reach, reach), ylim=(-reach, reach), xlabel=r"Re $d$ / -", ylabel=r"Im $d$ / -")
        ax.set_aspect("equal")
    for k, phase in enumerate(PHASES):
        at = complex(_spiral(rule, k + 0.2, np.array([0.93 * largest]))[0])
        whole.text(
            at.real, at.imag, f"sector {phase}", color=COLOURS[_LOOK[phase][0]], ha="center", va="center", fontsize=8
        )
    whole.set_title("all files")
    detail.set_title("near the threshold")
    centre = Line2D([], [], color=COLOURS["grey"], lw=0.9, ls="--", label="centre of a sector")
    figure.legend(
        handles=[*_handles(score), circle, centre], loc="outside upper center", ncols=4, frameon=False
    )  # fmt: skip
    return figure


@style()
def detection_statistic(score: CurrentScore) -> Figure:
    """Detection statistic of every file by labelled level, with the threshold.

    Parameters
    ----------
    score : CurrentScore
        Scored records.

    Returns
    -------
    Figure

    Raises
    ------
    ParameterError
        If there is no record.
    """
    _some(score)
    figure, ax = plt.subplots(figsize=(PAGE, 3.0), layout="constrained")
    for place, row in _placed(score.rows):
        _point(ax, place, row.size, row)
        if row.record.suspect:
            # names of neighbours do not meet: one goes up, the other down
            above = row.record.phase == "b"
            ax.annotate(
                row.record.name, (place, row.size), xytext=(0, 8 if above else -8), textcoords="offset points",
                fontsize=7, ha="center", va="bottom" if above else "top",
            )  # fmt: skip
    rule = score.reference.convention
    lines = [ax.axhline(rule.threshold, color=COLOURS["black"], lw=1.2, label=f"threshold {rule.threshold:.3g}")]
    if math.isfinite(score.reference.spread):
        label = f"largest healthy deviation {score.reference.spread:.3g}"
        lines.append(ax.axhline(score.reference.spread, color=COLOURS["black"], lw=1.0, ls=":", label=label))
    ax.set_yscale("log")
    low, high = ax.get_ylim()
    ax.set_ylim(0.75 * low, 1.15 * high)
    _level_axis(ax, score)
    ax.set_ylabel(r"$|d|$ / -")
    figure.legend(handles=[*_handles(score), *lines], loc="outside upper center", ncols=4, frameon=False)
    return figure


def _placed(rows: Sequence[ScoredRecord]) -> list[tuple[float, ScoredRecord]]:
    """Abscissa of every file: its level, phases side by side, repetitions beside each other."""
    repetitions = sorted({row.record.repetition for row in rows})
    inner = np.linspace(-0.09, 0.09, len(repetitions)) if len(repetitions) > 1 else np.zeros(1)
    outer = {"a": -0.27, "b": 0.0, "c": 0.27, "": 0.0}
    return [
        (row.record.level + outer[row.record.phase] + float(inner[repetitions.index(row.record.repetition)]), row)
        for row in rows
    ]


def _level_axis(ax: Axes, score: CurrentScore, healthy: bool = True) -> None:
    levels = sorted({row.record.level for row in score.rows if healthy or row.record.phase})
    names = [
        f"level {level}\n({100 * LEVEL_SHARE * level:.0f} % of a phase)" if level else "healthy" for level in levels
    ]
    ax.set_xticks(levels, names)
    ax.set_xlim(levels[0] - 0.5, levels[-1] + 0.5)
    ax.grid(False, axis="x")


@style()
def phase_confusion(score: CurrentScore) -> Figure:
    """Labelled against decided phase: repetitions of the convention and unseen ones, suspect files apart.

    Parameters
    ----------
    score : CurrentScore
        Scored records.

    Returns
    -------
    Figure

    Raises
    ------
    ParameterError
        If there is no record.
    """
    _some(score)
    groups = [
        (title, score.confusion(suspect=suspect, unseen=unseen))
        for title, suspect, unseen in (
            ("repetitions 1 and 2", False, False),
            ("unseen repetitions", False, True),
            ("suspect files", True, None),
        )
        if score.select(suspect=suspect, unseen=unseen)
    ]
    width = max(COLUMN, 2.4 * len(groups))
    figure, axes = plt.subplots(1, len(groups), figsize=(width, 2.6), layout="constrained", squeeze=False, sharey=True)
    for ax, (title, table) in zip(axes.flat, groups, strict=True):
        share = table / np.maximum(table.sum(axis=1, keepdims=True), 1)
        ax.imshow(share, cmap="Blues", vmin=0, vmax=1.6, aspect="auto")
        for (r, c), number in np.ndenumerate(table):
            if table[r].any():
                weight = "bold" if r == c and number else "normal"
                ax.text(c, r, str(number) if number else "·", ha="center", va="center", weight=weight)
        ax.set_xticks(range(4), [*PHASES, "none"])
        ax.set_yticks(range(4), [*PHASES, "healthy"])
        ax.set_xlabel("said")
        ax.set_title(f"{title}: {int(table.sum())} files")
        ax.grid(False)
        ax.spines[:].set_visible(False)
        ax.tick_params(length=0)
    axes[0, 0].set_ylabel("labelled phase")
    return figure


@style()
def severity_by_level(score: CurrentScore) -> Figure:
    """Severity against the labelled share of the turns, and the angle left in the sector.

    Parameters
    ----------
    score : CurrentScore
        Scored records.

    Returns
    -------
    Figure

    Raises
    ------
    ParameterError
        If there is no record with a short.
    """
    shorts = tuple(row for row in score.rows if row.record.phase)
    if not shorts:
        raise ParameterError("the score holds no record with a short; severity against level needs one.")
    figure, (size, angle) = plt.subplots(1, 2, figsize=(PAGE, 3.1), layout="constrained")
    levels = sorted({row.record.level for row in shorts})
    for k, level in enumerate(levels):
        label = "labelled share" if k == 0 else None
        labelled = 100 * LEVEL_SHARE * level
        size.plot([level - 0.42, level + 0.42], [labelled] * 2, color=COLOURS["black"], lw=1.1, label=label)
    for place, row in _placed(shorts):
        _point(size, place, 100 * row.verdict.severity, row)
        if row.verdict.detected:
            off = row.verdict.angle + _THIRD * (PHASES.index(row.verdict.phase) - PHASES.index(row.record.phase))
            _point(angle, place, math.degrees(math.remainder(off, 2 * np.pi)), row)
    size.set_ylabel("severity (% of the turns of a phase)")
    size.set_ylim(bottom=-2)  # markers at zero stay whole
    angle.set_ylabel("angle from the centre of\nthe labelled sector (°)")
    for edge in (-60, 60):
        angle.axhline(edge, color=COLOURS["grey"], lw=1.0, label="edge of the sector" if edge > 0 else None)
    low, high = angle.get_ylim()
    angle.set_ylim(min(low, -70), max(high, 70))
    angle.set_yticks(range(-180, 181, 30) if low < -70 or high > 70 else range(-60, 61, 20))
    angle.axhline(0, color=COLOURS["grey"], lw=0.7, ls="--")
    angle.set_title("detected files")
    for ax in (size, angle):
        _level_axis(ax, score, healthy=False)
        ax.set_xticks(levels, [str(level) for level in levels])
        ax.set_xlabel("labelled level")
    lines = [*size.get_legend_handles_labels()[0], *angle.get_legend_handles_labels()[0]]
    made = [one for one in _handles(score) if one.get_label() != "healthy"]
    figure.legend(handles=[*made, *lines], loc="outside upper center", ncols=4, frameon=False)
    return figure
