"""Thesis 7.3, 7.4: figures of the steady-state scheme on the bench: sets over time, hypotheses, transients."""

from collections.abc import Mapping, Sequence
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import ArrayLike, NDArray

from pumplib.errors import DataError
from pumplib.plots.ch06_structure import symbol
from pumplib.plots.ch07_study import Said
from pumplib.plots.style import COLOURS, PAGE, style
from pumplib.steady.bench_monitor import Judged
from pumplib.steady.enclose import Enclosure
from pumplib.steady.windows import HYPOTHESES, Verdict

Array = NDArray[Any]
_UNITS = (("$R_1$ / kPa", 1e-3), ("$R_2$ / (N m)", 1.0), ("$R_3$ / (N m)", 1.0))
_WORDS = {"none": "healthy", "K_f": "clogging", "dB": "friction", "K_l": "leakage", "f_c": "cavitation",
          "f_d": "dry running"}  # fmt: skip


def hypothesis(name: str) -> str:
    """Words and symbol of a hypothesis.

    Parameters
    ----------
    name : str
        Of `pumplib.steady.windows.HYPOTHESES`.

    Returns
    -------
    str
    """
    return _WORDS[name] if name == "none" else f"{_WORDS[name]} {symbol(name)}"


def _marks(ax: Axes, changes: ArrayLike, onset: float | None, names: bool) -> None:
    for k, instant in enumerate(np.asarray(changes, dtype=float)):
        label = "operating-point change" if names and k == 0 else None
        ax.axvline(instant, color=COLOURS["grey"], lw=0.8, ls=":", zorder=1, label=label)
    if onset is not None:
        ax.axvline(onset, color=COLOURS["black"], lw=1.3, zorder=1, label="fault" if names else None)


def sets_over_time(
    judged: Judged,
    moving: tuple[Array, Enclosure] | None = None,
    *,
    plain: Enclosure | None = None,
    changes: ArrayLike = (),
    onset: float | None = None,
    said: Sequence[Said] = (),
) -> Figure:
    """Residual sets of a run over time with zero marked, and below them what the window says.

    Parameters
    ----------
    judged : Judged
        Steady points with their sets.
    moving : tuple of (ndarray, Enclosure), optional
        End, s, and sets of every window, at rest or not; drawn pale.
    plain : Enclosure, optional
        Sets of the points from the parameter set alone in place of those in `judged`.
    changes : array_like
        Times of operating-point changes, s.
    onset : float, optional
        Time of the fault, s.
    said : sequence of Said
        Hypotheses tested and left at the points.

    Returns
    -------
    Figure
    """
    wide, time = plain or judged.plain, judged.points.t
    with style():
        figure, grid = plt.subplots(
            4 if said else 3, 1, figsize=(PAGE, 6.4 if said else 4.8), sharex=True,
            height_ratios=(1, 1, 1, 0.9) if said else None,
        )  # fmt: skip
        for k, (ax, (label, scale)) in enumerate(zip(grid, _UNITS, strict=False)):
            if moving is not None:
                t, sets = moving
                ax.fill_between(
                    t, scale * sets.lo[:, k], scale * sets.hi[:, k], color=COLOURS["grey"], alpha=0.25, lw=0,
                    label="sets of all windows, transients too",
                )  # fmt: skip
            _bars(ax, time, wide, k, scale, 2.0, ("green", "purple"), "parameter set alone")
            _bars(ax, time, judged.sets, k, scale, 5.0, ("blue", "red"), "given the healthy block")
            ax.axhline(0, color=COLOURS["black"], lw=1.0)
            _marks(ax, changes, onset, True)
            ax.set_ylabel(label)
            _limits(ax, scale, k, (wide, judged.sets))
        if said:
            _strip(grid[3], said, changes, onset)
        grid[-1].set_xlabel("time / s")
        last = float(time[-1]) if moving is None else max(float(moving[0][-1]), float(time[-1]) if len(time) else 0.0)
        grid[0].set_xlim(0.0, 1.02 * last)
        figure.align_ylabels(grid)
        figure.legend(*grid[0].get_legend_handles_labels(), loc="outside upper center", ncols=2)
    return figure


def windows_over_time(
    t: ArrayLike, sets: Enclosure, judged: Judged, *, changes: ArrayLike = (), onset: float | None = None
) -> Figure:
    """Residual sets of all windows of a run as if the detector were switched off, beside the points it lets through.

    Parameters
    ----------
    t : array_like, shape (n,)
        End of the windows, s.
    sets : Enclosure
        Their sets.
    judged : Judged
        The steady points of the same run.
    changes : array_like
        Times of operating-point changes, s.
    onset : float, optional
        Time of the fault, s.

    Returns
    -------
    Figure

    Raises
    ------
    DataError
        If lengths differ.
    """
    time = np.asarray(t, dtype=float)
    if len(time) != len(sets.lo):
        raise DataError(f"windows_over_time: t {time.shape}, sets {sets.lo.shape}: must agree.")
    with style():
        figure, grid = plt.subplots(3, 1, figsize=(PAGE, 4.8), sharex=True)
        for k, (ax, (label, scale)) in enumerate(zip(grid, _UNITS, strict=True)):
            _bars(ax, time, sets, k, scale, 3.5, ("grey", "red"), "every window, detector off")
            _bars(
                ax,
                judged.points.t,
                judged.sets,
                k,
                scale,
                6.0,
                ("blue", "purple"),
                "points that the detector lets through",
            )
            ax.axhline(0, color=COLOURS["black"], lw=1.0)
            _marks(ax, changes, onset, True)
            ax.set_yscale("symlog", linthresh=10.0 if k == 0 else 0.2)
            ax.margins(y=0.12)
            ax.set_ylabel(label)
        grid[-1].set_xlabel("time / s")
        grid[0].set_xlim(0.0, 1.02 * float(time[-1]))
        figure.align_ylabels(grid)
        figure.legend(*grid[0].get_legend_handles_labels(), loc="outside upper center", ncols=2)
    return figure


def _bars(
    ax: Axes, t: Array, sets: Enclosure, k: int, scale: float, lw: float, colours: tuple[str, str], words: str
) -> None:
    lo, hi = scale * sets.lo[:, k], scale * sets.hi[:, k]
    out = (lo > 0) | (hi < 0)
    for chosen, colour, text in ((~out, colours[0], words), (out, colours[1], f"{words}: zero outside")):
        finite = chosen & np.isfinite(lo) & np.isfinite(hi)
        ax.vlines(t[finite], lo[finite], hi[finite], color=COLOURS[colour], lw=lw, label=text)


def _limits(ax: Axes, scale: float, k: int, every: Sequence[Enclosure]) -> None:
    ends = scale * np.concatenate([end[:, k] for sets in every for end in (sets.lo, sets.hi)])
    ends = ends[np.isfinite(ends)]
    if len(ends):
        low, high = min(float(ends.min()), 0.0), max(float(ends.max()), 0.0)
        ax.set_ylim(low - 0.25 * (high - low), high + 0.25 * (high - low))


def _strip(ax: Axes, said: Sequence[Said], changes: ArrayLike, onset: float | None) -> None:
    for one in said:
        for k, name in enumerate(HYPOTHESES):
            if name not in one.tested:
                continue
            held = name in one.possible
            colour = ("blue" if name == "none" else "red") if held else "grey"
            ax.plot([one.t], [k], ls="none", marker="s" if held else "x", ms=6 if held else 4, color=COLOURS[colour])
    ax.set_yticks(range(len(HYPOTHESES)), [hypothesis(name) for name in HYPOTHESES])
    ax.set_ylim(len(HYPOTHESES) - 0.4, -0.6)
    ax.set_title("window: possible (square), refuted (cross)")
    _marks(ax, changes, onset, False)


def hypotheses(
    found: Mapping[str, Verdict], units: Mapping[str, float], truth: tuple[str, float] | None = None, before: str = ""
) -> Figure:
    """Hypotheses of a window: by how much each is refuted, and guaranteed sizes of those that are left.

    Parameters
    ----------
    found : mapping of str to Verdict
        By hypothesis.
    units : mapping of str to float
        Size of each fault that the sizes are divided by.
    truth : tuple of (str, float), optional
        True fault and size.
    before : str
        What the sizes are divided by, in words.

    Returns
    -------
    Figure
    """
    names = list(found)
    with style():
        figure, (left, right) = plt.subplots(1, 2, figsize=(PAGE, 2.8), sharey=True)
        for k, name in enumerate(names):
            one = found[name]
            colour = "red" if not one.possible else "blue" if name == "none" else "green"
            left.barh(k, one.margin, color=COLOURS[colour], alpha=0.8, height=0.6)
            words = "possible" if one.possible else "refuted"
            left.annotate(
                words, (max(one.margin, 0.0), k), xytext=(4, 0), textcoords="offset points", va="center", fontsize=7.5
            )  # fmt: skip
            if one.size is not None:
                low, high = (value / units[name] for value in one.size)
                right.hlines(k, max(low, 1e-4), high, color=COLOURS["green"], lw=5, alpha=0.7)
            elif not one.possible:
                right.annotate("refuted", (0.02, k), xycoords=("axes fraction", "data"), va="center", fontsize=7.5,
                               color=COLOURS["red"])  # fmt: skip
        if truth is not None and truth[0] in names and truth[0] != "none":
            right.plot(truth[1] / units[truth[0]], names.index(truth[0]), "*", color=COLOURS["black"], ms=9,
                       label="true size")  # fmt: skip
            figure.legend(loc="outside upper right")
        left.axvline(0, color=COLOURS["black"], lw=1.0)
        left.set_xscale("symlog", linthresh=0.1)
        left.margins(x=0.3)
        left.set_xticks((-1, -0.1, 0, 0.1, 1, 10, 100, 1000), ("-1", "", "0", "", "1", "10", "100", "1000"))
        left.set_xlim(-1.0, 100 * max(1.0, *(one.margin for one in found.values())))
        left.set_yticks(range(len(names)), [hypothesis(name) for name in names])
        left.invert_yaxis()
        left.set_xlabel("margin needed, over what each row allows / -")
        right.set_xscale("log")
        right.xaxis.set_major_formatter("{x:g}")
        right.xaxis.set_minor_formatter("{x:g}")
        right.set_xlabel(f"guaranteed range of the size over\n{before} / -")
        left.set_title("left of zero: explains the window")
        right.set_title("how large, if it is this fault")
    return figure
