"""Thesis 6.5-6.7: figures of the residual observers: convergence, runs with alarms, directions, campaign results."""

from collections.abc import Mapping, Sequence
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import ArrayLike, NDArray

from pumplib.errors import ParameterError
from pumplib.observers.residual_bench import Shown
from pumplib.observers.residual_model import PumpBelief
from pumplib.observers.residual_monitor import Judged
from pumplib.observers.residual_signature import directions
from pumplib.plots.ch06_structure import symbol
from pumplib.plots.style import COLOURS, PAGE, style

Array = NDArray[Any]
_LOOK = {
    "clogging": ("K_f", "red", "o"),
    "friction": ("dB", "blue", "s"),
    "leakage": ("K_l", "green", "^"),
    "cavitation": ("f_c", "purple", "D"),
    "dry_running": ("f_d", "orange", "v"),
    "none": ("", "black", "x"),
}
_UNITS = (("$r_1$ / kPa", 1e-3), ("$r_2$ / (N m)", 1.0), ("$r_3$ / (N m)", 1.0))
_STEP = 25  # samples of a record of 1 kHz from one drawn point to the next


def _fault_name(fault: str) -> str:
    text, *_ = _LOOK[fault]
    return f"{fault.replace('_', ' ')} {symbol(text)}" if text else fault


def _marks(ax: Axes, shown: Shown, names: bool = False) -> None:
    for k, instant in enumerate(shown.run.course.changes):
        label = "operating-point change" if names and k == 0 else None
        ax.axvline(instant, color=COLOURS["grey"], lw=0.8, ls=":", zorder=1, label=label)
    if shown.onset is not None:
        ax.axvline(shown.onset, color=COLOURS["black"], lw=1.2, zorder=1, label="fault" if names else None)


def _note(ax: Axes, time: float, words: str, colour: str, level: float = 0.96, left: bool = False) -> None:
    ax.annotate(
        words, (time, level), xycoords=ax.get_xaxis_transform(), xytext=(-3 if left else 3, 0),
        textcoords="offset points", va="top", ha="right" if left else "left", fontsize=7.5, color=COLOURS[colour],
        zorder=9, bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 0.8},
    )  # fmt: skip


def _operating_point(ax: Axes, shown: Shown, said: Judged) -> list[Any]:
    r = said.residuals
    ax.plot(r.t[::_STEP], 1e3 * r["Q"][::_STEP], color=COLOURS["blue"], label="flow $Q$")
    ax.set_ylabel("$Q$ / (l/s)")
    twin = ax.twinx()
    twin.spines["right"].set_visible(True)
    twin.grid(False)
    twin.plot(r.t[::_STEP], r["omega"][::_STEP], color=COLOURS["orange"], ls="--", label=r"speed $\hat\omega$")
    twin.set_ylabel(r"$\hat\omega$ / (rad/s)")
    _marks(ax, shown, names=True)
    return [*ax.get_legend_handles_labels()[0], *twin.get_legend_handles_labels()[0]]


def residuals(shown: Shown, said: Judged, *, calibrated_until: float = 0.0) -> Figure:
    """Operating point and the three residuals of a run with their thresholds, fault and first alarms.

    Parameters
    ----------
    shown : Shown
        The run.
    said : Judged
        What the monitor made of it.
    calibrated_until : float
        End of the healthy beginning that the residuals were calibrated on, s; 0 for none.

    Returns
    -------
    Figure
    """
    with style():
        figure, grid = plt.subplots(4, 1, figsize=(PAGE, 6.2), sharex=True)
        handles = _operating_point(grid[0], shown, said)
        onset = np.inf if shown.onset is None else shown.onset
        for j, (ax, (label, scale)) in enumerate(zip(grid[1:], _UNITS, strict=True)):
            t = said.residuals.t[::_STEP]
            lines = ax.plot(t, scale * said.r[::_STEP, j], color=COLOURS["blue"], lw=1.0, label="residual")
            for sign in (1, -1):
                lines += ax.plot(
                    t, sign * scale * said.kappa[::_STEP, j], color=COLOURS["green"], ls="--", lw=1.0,
                    label=r"threshold $\pm\kappa(t)$",
                )  # fmt: skip
            _marks(ax, shown)
            if calibrated_until > 0:
                ax.axvspan(0.0, calibrated_until, color=COLOURS["sky"], alpha=0.15, lw=0)
                _note(ax, calibrated_until, "self calibration", "black", left=True)
            mine = [one for one in said.alarms if one.residual == f"r{j + 1}"]
            times = [float(said.residuals.t[one.sample]) for one in mine]
            early = next((x for x in times if x < onset), None)
            late = next((x for x in times if x >= onset), None)
            for x, words, colour in ((early, "false alarm", "purple"), (late, "", "red")):
                if x is not None:
                    ax.axvline(x, color=COLOURS[colour], lw=1.1, ls="--")
                    _note(ax, x, words if x is early else f"alarm after {x - onset:.2f} s", colour)
            ax.set_ylabel(label)
            _limits(ax, scale * said.r[:, j], scale * said.kappa[:, j])
            if j == 0:
                handles += lines[:2]
        grid[-1].set_xlabel("time / s")
        grid[0].set_xlim(0.0, shown.run.course.duration)
        figure.align_ylabels(grid)
        figure.legend(handles=handles, loc="outside upper center", ncols=3)
    return figure


def _limits(ax: Axes, r: Array, kappa: Array) -> None:
    """A dry pump would squeeze everything else: large residuals leave the picture at four thresholds and more."""
    good = np.isfinite(r)
    if good.any():
        reach = 1.15 * max(float(np.quantile(np.abs(r[good]), 0.995)), float(np.nanquantile(kappa, 0.9)))
        ax.set_ylim(-reach, reach)


def directions_plane(
    belief: PumpBelief, scale: ArrayLike, points: Mapping[str, tuple[float, float]], *,
    measured: ArrayLike | None = None, said: str = "",
) -> Figure:  # fmt: skip
    """Directions of the five faults in the plane of r1 and r2, both over their thresholds, at operating points.

    Parameters
    ----------
    belief : PumpBelief
        The pump.
    scale : array_like, shape (2,)
        Thresholds of r1 (Pa) and r2 (N m) at rest.
    points : mapping of str to tuple of float
        Name to speed, rad/s, and flow, m3/s; one or two.
    measured : array_like, shape (n, 2), optional
        r1 (Pa) and r2 (N m) at rest after an alarm; drawn as directions from the origin, too.
    said : str
        Legend of the measured points.

    Returns
    -------
    Figure

    Raises
    ------
    ParameterError
        If there is no point or more than two.
    """
    if not 1 <= len(points) <= 2:
        raise ParameterError(f"directions_plane: {len(points)} operating points; give one or two.")
    k = np.asarray(scale, dtype=float)
    with style():
        figure, axes = plt.subplots(1, len(points), figsize=(PAGE, 4.6), squeeze=False)
        for n, (ax, (name, (omega, Q))) in enumerate(zip(axes[0], points.items(), strict=True)):
            for fault, effect in directions(belief, omega, Q).items():
                d = effect[:2] / k
                d = d / np.hypot(*d)
                _, colour, marker = _LOOK[fault]
                ax.plot([0, d[0]], [0, d[1]], color=COLOURS[colour], ls="--" if fault == "dry_running" else "-")
                ax.plot(*d, ls="none", marker=marker, ms=7, color=COLOURS[colour], label=_fault_name(fault))
            if measured is not None and n == 0:
                m = np.atleast_2d(np.asarray(measured, dtype=float)) / k
                m = 0.85 * m / np.hypot(m[:, :1], m[:, 1:])
                ax.plot(*m.T, ls="none", marker="x", ms=6, mew=1.6, color=COLOURS["black"], label=said)
            ax.add_patch(plt.Circle((0, 0), 1.0, fill=False, ec=COLOURS["grey"], lw=0.7, ls=":"))
            ax.set_aspect("equal")
            ax.set_xlim(-1.25, 1.25)
            ax.set_ylim(-1.25, 1.25)
            ax.axhline(0, color=COLOURS["grey"], lw=0.7, zorder=1)
            ax.axvline(0, color=COLOURS["grey"], lw=0.7, zorder=1)
            ax.set_title(f"{name}: {omega:.0f} rad/s, {1e3 * Q:.2f} l/s")
            ax.set_xlabel("$r_1$ over its threshold, normalized / -")
        axes[0][0].set_ylabel("$r_2$ over its threshold, normalized / -")
        figure.legend(*axes[0][0].get_legend_handles_labels(), loc="outside lower center", ncols=3)
    return figure


def convergence(t: Array, errors: Mapping[str, tuple[Array, float]]) -> Figure:
    """Errors of observers that were started wrong, beside the bound of their proof.

    Parameters
    ----------
    t : ndarray, shape (n,)
        s.
    errors : mapping of str to (ndarray, float)
        Name to the error over time, any unit, and its proven rate, 1/s.

    Returns
    -------
    Figure
    """
    with style():
        figure, ax = plt.subplots(figsize=(PAGE, 2.7))
        for k, (name, (error, rate)) in enumerate(errors.items()):
            colour = COLOURS[("blue", "red", "green", "purple")[k % 4]]
            size = np.abs(error) / np.abs(error[0])
            shown = np.where(size > 1e-13, size, np.nan)
            ax.semilogy(t, shown, color=colour, lw=max(3.6 - 1.1 * k, 1.4), label=f"{name}")  # two may coincide
            ax.semilogy(t, np.exp(-rate * (t - t[0])), color=colour, ls="--", lw=1.0, label=f"bound {rate:.2f} / s")
        ax.set_xlabel("time / s")
        ax.set_ylabel("error over initial error / -")
        ax.set_ylim(1e-9, 2.0)
        figure.legend(loc="outside upper center", ncols=len(errors))
    return figure


def calibration(shown: Shown, plain: Judged, calibrated: Judged, until: float) -> Figure:
    """Residuals of one run as they are, and with what its healthy beginning showed taken off.

    Parameters
    ----------
    shown : Shown
        The run.
    plain, calibrated : Judged
        By a monitor without and one with self calibration.
    until : float
        End of the healthy beginning, s.

    Returns
    -------
    Figure
    """
    with style():
        figure, grid = plt.subplots(2, 1, figsize=(PAGE, 3.9), sharex=True)
        t = plain.residuals.t[::_STEP]
        for j, (ax, (label, scale)) in enumerate(zip(grid, _UNITS, strict=False)):
            for said, name, colour, ls in ((plain, "as is", "grey", "-"), (calibrated, "self-calibrated", "blue", "-")):
                ax.plot(t, scale * said.r[::_STEP, j], color=COLOURS[colour], ls=ls, lw=1.0, label=name)
                for sign in (1, -1):
                    ax.plot(
                        t, sign * scale * said.kappa[::_STEP, j], color=COLOURS[colour], ls="--", lw=1.0,
                        label=f"threshold, {name}" if sign > 0 else None,
                    )  # fmt: skip
            ax.axvspan(0.0, until, color=COLOURS["sky"], alpha=0.15, lw=0)
            _marks(ax, shown, names=j == 0)
            ax.set_ylabel(label)
            _limits(ax, scale * plain.r[:, j], scale * plain.kappa[:, j])
        _note(grid[0], until, "declared healthy", "black", left=True)
        grid[1].set_xlabel("time / s")
        grid[0].set_xlim(0.0, shown.run.course.duration)
        figure.align_ylabels(grid)
        figure.legend(*grid[0].get_legend_handles_labels(), loc="outside upper center", ncols=3)
    return figure


def winding(shown: Shown, believed: Judged, estimated: Judged, true_change: Array) -> Figure:
    """A warming winding: its resistance, and the torque residual with it ignored and estimated.

    Parameters
    ----------
    shown : Shown
        A healthy run with a warming winding.
    believed, estimated : Judged
        By a monitor that keeps the resistances and one that estimates them.
    true_change : ndarray, shape (n,)
        True change of r_s against the start of the commissioning, at the rate of the record.

    Returns
    -------
    Figure
    """
    with style():
        figure, (top, below) = plt.subplots(2, 1, figsize=(PAGE, 3.9), sharex=True)
        t = believed.residuals.t[::_STEP]
        top.plot(t, 100 * true_change[::_STEP], color=COLOURS["black"], ls="--", label="true (bench)")
        top.plot(t, 100 * estimated.winding[::_STEP], color=COLOURS["blue"], label="estimated")
        top.set_ylabel(r"change of $r_\mathrm{s}$ / %")
        top.legend(loc="lower right")
        for said, name, colour in ((believed, "ignored", "red"), (estimated, "estimated", "blue")):
            below.plot(t, said.r[::_STEP, 1], color=COLOURS[colour], lw=1.0, label=f"$r_2$, winding {name}")
            for sign in (1, -1):
                below.plot(
                    t, sign * said.kappa[::_STEP, 1], color=COLOURS[colour], ls="--", lw=1.0,
                    label="its threshold" if sign > 0 else None,
                )  # fmt: skip
        for ax in (top, below):
            _marks(ax, shown)
        below.set_ylabel("$r_2$ / (N m)")
        below.set_xlabel("time / s")
        top.set_xlim(0.0, shown.run.course.duration)
        both = np.concatenate((believed.r[:, 1], estimated.r[:, 1]))
        _limits(below, both, np.concatenate((believed.kappa[:, 1], estimated.kappa[:, 1])))
        figure.align_ylabels((top, below))
        figure.legend(*below.get_legend_handles_labels(), loc="outside upper center", ncols=4)
    return figure


def detection(
    healthy: Sequence[Mapping[str, Any]], found: Sequence[Mapping[str, Any]], monitors: Sequence[str]
) -> Figure:
    """Detection rates over the size of each fault, beside the false alarms of the same monitors.

    Parameters
    ----------
    healthy : sequence of mapping
        ``monitor``, ``rate``, ``low``, ``high`` of the false-alarm runs.
    found : sequence of mapping
        ``fault``, ``size``, ``monitor``, ``rate``, ``low``, ``high`` of the detections.
    monitors : sequence of str
        Which are shown, at most six.

    Returns
    -------
    Figure

    Raises
    ------
    ParameterError
        If a monitor has no false-alarm rate: detection is not shown without it.
    """
    known = {row["monitor"]: row for row in healthy}
    lacking = [one for one in monitors if one not in known]
    if lacking or not 0 < len(monitors) <= 6:
        raise ParameterError(
            f"detection: {', '.join(lacking) or len(monitors)}: give one to six monitors, each with its false alarms."
        )
    faults = list(dict.fromkeys(row["fault"] for row in found))
    looks = [("blue", "o"), ("green", "s"), ("purple", "^"), ("red", "D"), ("orange", "v"), ("grey", "P")]
    with style():
        figure, grid = plt.subplots(2, 3, figsize=(PAGE, 4.6), sharey=True)
        axes = grid.ravel()
        for k, name in enumerate(monitors):
            colour, marker = COLOURS[looks[k][0]], looks[k][1]
            one = known[name]
            _points(axes[0], [k], [one], colour, marker, name)
            for ax, fault in zip(axes[1:], faults, strict=False):
                rows = sorted(
                    (r for r in found if r["fault"] == fault and r["monitor"] == name), key=lambda r: r["size"]
                )
                shift = 0.09 * (k - (len(monitors) - 1) / 2)
                _points(ax, [j + shift for j in range(len(rows))], rows, colour, marker)
        axes[0].set_xticks(range(len(monitors)), monitors, rotation=40, ha="right", rotation_mode="anchor")
        axes[0].set_title("false alarms, healthy runs", color=COLOURS["black"])
        for ax, fault in zip(axes[1:], faults, strict=False):
            sizes = sorted({row["size"] for row in found if row["fault"] == fault})
            ax.set_xticks(range(len(sizes)), [_short(s) for s in sizes])
            ax.set_title(f"detected: {_fault_name(fault)}")
            ax.set_xlim(-0.5, len(sizes) - 0.5)
        for ax in axes:
            ax.axhline(0.9, color=COLOURS["black"], lw=0.7, ls=":")
            ax.set_ylim(-4e-2, 1.04)
        for ax in grid[:, 0]:
            ax.set_ylabel("share of runs / -")
        figure.legend(*axes[0].get_legend_handles_labels(), loc="outside upper center", ncols=len(monitors))
    return figure


def _short(size: float) -> str:
    """Number in few letters: 0.025, 1.25e-4, 5e9."""
    if 1e-3 <= size < 1e4:
        return f"{size:g}"
    mantissa, exponent = f"{size:.2e}".split("e")
    return f"{float(mantissa):g}e{int(exponent)}"


def _points(
    ax: Axes, x: Sequence[float], rows: Sequence[Mapping[str, Any]], colour: str, marker: str, label: str | None = None
) -> None:
    rate, low, high = (np.array([row[key] for row in rows], dtype=float) for key in ("rate", "low", "high"))
    ax.errorbar(
        x, rate, yerr=np.stack((rate - low, high - rate)), fmt=marker, color=colour, ms=4, mfc="white", capsize=2,
        lw=1.0, label=label,
    )  # fmt: skip


def confusion(tables: Mapping[str, tuple[Sequence[str], Sequence[str], Array]], alarms: Mapping[str, str]) -> Figure:
    """Confusion matrices: what was said about runs with each fault, in per cent of the runs.

    Parameters
    ----------
    tables : mapping of str to (sequence of str, sequence of str, ndarray)
        Name of the monitor to true faults, statements, and counts of shape (faults, statements).
    alarms : mapping of str to str
        Name of the monitor to its false alarms in words; shown in the title.

    Returns
    -------
    Figure

    Raises
    ------
    ParameterError
        If a monitor has no statement of its false alarms, or there is no table.
    """
    lacking = [name for name in tables if name not in alarms]
    if lacking or not tables:
        raise ParameterError(f"confusion: {', '.join(lacking) or 'no table'}: give tables, each with its false alarms.")
    with style():
        figure, axes = plt.subplots(1, len(tables), figsize=(PAGE, 3.2), squeeze=False)
        for ax, (name, (truth, said, counts)) in zip(axes[0], tables.items(), strict=True):
            total = np.asarray(counts).sum(axis=1, keepdims=True)
            share = np.divide(counts, total, out=np.zeros(np.shape(counts)), where=total > 0)
            ax.imshow(share, cmap="Blues", vmin=0, vmax=1, aspect="equal")
            for i, j in np.argwhere(np.asarray(counts) > 0):
                ax.text(
                    j, i, f"{100 * share[i, j]:.0f}" if share[i, j] >= 0.005 else "<1", ha="center", va="center",
                    color="white" if share[i, j] > 0.55 else "black", fontsize=8,
                )  # fmt: skip
            words = [symbol(_LOOK[one][0]) if one in _LOOK and _LOOK[one][0] else one for one in said]
            ax.set_xticks(range(len(said)), words, rotation=40, ha="right", rotation_mode="anchor")
            labels = [
                f"{symbol(_LOOK[one][0])} ({int(n)})" for one, n in zip(truth, total[:, 0], strict=True)
            ]  # fmt: skip
            ax.set_yticks(range(len(truth)), labels)
            ax.grid(False)
            ax.set_title(f"{name}\nfalse alarms: {alarms[name]}")
            ax.set_xlabel("said / % of the runs with the fault")
        axes[0][0].set_ylabel("true fault (runs)")
    return figure
