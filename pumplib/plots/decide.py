"""Thesis 2.1.4, B.1: figures of residual evaluation: run lengths, CUSUM over time, thresholds over time."""

from collections.abc import Mapping, Sequence
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import ArrayLike, NDArray

from pumplib.decide import Alarm, RunLengths, ThresholdAlarm, arl, siegmund
from pumplib.errors import DataError, ParameterError
from pumplib.plots.style import COLOURS, LINES, PAGE, style

Array = NDArray[Any]


def _line(ax: Axes, time: float, name: str, colour: str, ls: str, level: float, left: bool = False) -> None:
    """Vertical line at an instant, named beside it at a height between 0 and 1."""
    ax.axvline(time, color=COLOURS[colour], lw=1.1, ls=ls)
    ax.annotate(
        name,
        (time, level),
        xycoords=ax.get_xaxis_transform(),
        xytext=(-3 if left else 3, 0),
        textcoords="offset points",
        ha="right" if left else "left",
        fontsize=7.5,
        color=COLOURS[colour],
        va="top",
        bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.75, "pad": 0.8},
    )


def _same_length(**arrays: Array) -> None:
    lengths = {name: len(one) for name, one in arrays.items()}
    if len(set(lengths.values())) != 1:
        text = ", ".join(f"{name} {n}" for name, n in lengths.items())
        raise DataError(f"samples to plot: {text}; all must have the length of the time axis.")


def run_length(
    nu: Sequence[float], h: ArrayLike, simulated: Mapping[tuple[float, float], RunLengths], *, level: float = 0.95
) -> Figure:
    """Mean time between false alarms of a two-sided CUSUM over its threshold: formula, exact, simulated.

    Parameters
    ----------
    nu : sequence of float
        Drifts, sigma; one colour each, at most four.
    h : array_like, shape (n,)
        Thresholds of the curves, sigma.
    simulated : mapping of (float, float) to RunLengths
        Simulated run lengths by (nu, h), shown with confidence intervals.
    level : float
        Confidence level.

    Returns
    -------
    Figure

    Raises
    ------
    ParameterError
        If there is no drift or more than four, or a simulated point has another drift.
    """
    if not 0 < len(nu) <= 4:
        raise ParameterError(f"run_length: {len(nu)} drifts; give one to four.")
    strange = sorted({one for one, _ in simulated} - set(nu))
    if strange:
        raise ParameterError(f"run_length: simulated points for nu = {strange} sigma have no curve; add them to nu.")
    axis = np.asarray(h, dtype=float)
    colours = ("blue", "red", "green", "purple")
    with style():
        figure, (ax, below) = plt.subplots(
            2, 1, figsize=(PAGE, 5.0), sharex=True, gridspec_kw={"height_ratios": (2.2, 1.0)}
        )
        handles: list[Any] = []
        for k, one in enumerate(nu):
            colour = COLOURS[colours[k]]
            exact = np.array([arl(one, float(value)).value for value in axis])
            formula = np.array([siegmund(one, float(value)) / 2 for value in axis])
            handles += ax.plot(axis, exact, color=colour, label=rf"exact, $\nu$ = {one:g} $\sigma$")
            handles += ax.plot(axis, formula, color=colour, ls="--", lw=1.0, label="Siegmund")
            below.plot(axis, formula / exact, color=colour, ls="--", lw=1.0)
            points = [(value, runs) for (drift, value), runs in simulated.items() if drift == one]
            for j, (value, runs) in enumerate(points):
                low, high = runs.interval(level)
                true = arl(one, value).value
                for target, scale in ((ax, 1.0), (below, true)):
                    marks = target.errorbar(
                        [value],
                        [runs.mean / scale],
                        yerr=[[(runs.mean - low) / scale], [(high - runs.mean) / scale]],
                        fmt="o",
                        ms=3.5,
                        color=colour,
                        mfc="white",
                        capsize=3,
                        lw=1.0,
                        label=f"simulated, {100 * level:g} % interval",
                    )
                    if target is ax and j == 0:
                        handles.append(marks)
        ax.set_yscale("log")
        ax.set_ylabel("mean time between\nfalse alarms / samples")
        ax.legend(handles=handles, ncols=len(nu), loc="upper left")
        below.axhline(1.0, color=COLOURS["black"], lw=0.8)
        below.set_ylabel("over exact / -")
        below.set_xlabel(r"threshold $h$ / $\sigma$")
        below.set_xlim(axis.min(), axis.max())
    return figure


def cusum_trace(
    t: ArrayLike,
    residual: ArrayLike,
    up: ArrayLike,
    down: ArrayLike,
    h: float,
    *,
    alarm: Alarm | None = None,
    fault_time: float | None = None,
    unit: str = "-",
) -> Figure:
    """A residual and its CUSUM: threshold, fault, alarm and estimated onset.

    Parameters
    ----------
    t : array_like, shape (n,)
        Times of the samples, s; sample 0 is the first of the stream.
    residual : array_like, shape (n,)
        Residual.
    up, down : array_like, shape (n,)
        Statistics g+ and g-, sigma.
    h : float
        Threshold, sigma.
    alarm : Alarm, optional
        The alarm to mark.
    fault_time : float, optional
        True time of the fault, s.
    unit : str
        Unit of the residual.

    Returns
    -------
    Figure

    Raises
    ------
    DataError
        If lengths differ or the alarm lies outside the record.
    """
    time, r = np.asarray(t, dtype=float), np.asarray(residual, dtype=float)
    g_up, g_down = np.asarray(up, dtype=float), np.asarray(down, dtype=float)
    _same_length(t=time, residual=r, up=g_up, down=g_down)
    if alarm is not None and not 0 <= alarm.onset <= alarm.sample < len(time):
        raise DataError(f"cusum_trace: alarm at sample {alarm.sample} is outside the {len(time)} samples shown.")
    with style():
        figure, (ax, below) = plt.subplots(2, 1, figsize=(PAGE, 4.4), sharex=True)
        ax.plot(time, r, color=COLOURS["blue"], lw=0.7)
        ax.set_ylabel(f"residual / {unit}" if unit != "-" else "residual / -")
        below.plot(time, g_up, color=COLOURS["blue"], label="$g^+$, change upwards")
        below.plot(time, g_down, color=COLOURS["green"], ls="--", label="$g^-$, change downwards")
        below.axhline(h, color=COLOURS["black"], ls=":", label=f"threshold $h$ = {h:.3g} $\\sigma$")
        below.set_ylabel(r"CUSUM statistic / $\sigma$")
        below.set_xlabel("time / s")
        # a statistic that runs on after the alarm would hide the threshold: the axis ends at twice h
        below.set_ylim(0, min(2 * h, 1.12 * max(h, float(max(g_up.max(), g_down.max())))))
        below.legend(loc="upper left")
        if fault_time is not None:
            _line(ax, fault_time, "fault", "black", LINES[0], 1.0)
            below.axvline(fault_time, color=COLOURS["black"], lw=1.1)
        if alarm is not None:
            onset, instant = float(time[alarm.onset]), float(time[alarm.sample])
            _line(ax, onset, "estimated onset", "purple", LINES[2], 0.14, left=True)
            below.axvline(onset, color=COLOURS["purple"], lw=1.1, ls=LINES[2])
            _line(ax, instant, "alarm", "red", LINES[1], 0.86)
            below.axvline(instant, color=COLOURS["red"], lw=1.1, ls=LINES[1])
        ax.set_xlim(time[0], time[-1])
    return figure


def threshold_trace(
    t: ArrayLike,
    residual: ArrayLike,
    kappa: ArrayLike,
    k0: float,
    *,
    activity: ArrayLike | None = None,
    changes: Mapping[str, float] | None = None,
    fault_time: float | None = None,
    alarm: ThresholdAlarm | None = None,
    unit: str = "-",
) -> Figure:
    """A residual with constant and adaptive threshold, and the changes of the operating point.

    Parameters
    ----------
    t : array_like, shape (n,)
        Times, s; sample 0 is the first of the stream.
    residual : array_like, shape (n,)
        Residual.
    kappa : array_like, shape (n,)
        Adaptive threshold, unit of the residual.
    k0 : float
        Constant threshold, unit of the residual.
    activity : array_like, shape (n,), optional
        A(t), shown below.
    changes : mapping of str to float, optional
        Changes of the operating point, name to time in s.
    fault_time : float, optional
        True time of the fault, s.
    alarm : ThresholdAlarm, optional
        Alarm of the adaptive threshold.
    unit : str
        Unit of the residual.

    Returns
    -------
    Figure

    Raises
    ------
    DataError
        If lengths differ or the alarm lies outside the record.
    """
    time, r, level = (np.asarray(one, dtype=float) for one in (t, residual, kappa))
    a = np.zeros(len(time)) if activity is None else np.asarray(activity, dtype=float)
    _same_length(t=time, residual=r, kappa=level, activity=a)
    if alarm is not None and not 0 <= alarm.sample < len(time):
        raise DataError(f"threshold_trace: alarm at sample {alarm.sample} is outside the {len(time)} samples shown.")
    with style():
        rows = 1 if activity is None else 2
        figure, grid = plt.subplots(
            rows, 1, figsize=(PAGE, 2.9 if rows == 1 else 4.2), sharex=True, squeeze=False,
            gridspec_kw={"height_ratios": (2.4, 1.0)[:rows]},
        )  # fmt: skip
        ax = grid[0, 0]
        outside = np.abs(r) > k0
        ax.fill_between(time, -level, level, color=COLOURS["green"], alpha=0.15, lw=0)
        ax.plot(time, r, color=COLOURS["blue"], lw=0.8, label="residual")
        ax.plot(time, np.where(outside, r, np.nan), color=COLOURS["red"], lw=1.1, label="beyond the constant threshold")
        for sign in (1, -1):
            named = sign > 0
            ax.plot(
                time, sign * level, color=COLOURS["green"], lw=1.1, label=r"adaptive $\kappa(t)$" if named else None
            )
            ax.axhline(sign * k0, color=COLOURS["black"], ls="--", lw=1.0, label="constant $k_0$" if named else None)
        ax.set_ylabel(f"residual / {unit}")
        reach = 1.35 * max(float(np.abs(r).max()), float(np.quantile(level, 0.98)), k0)
        ax.set_ylim(-reach, reach)
        ax.legend(ncols=2, loc="lower left")
        named_instants = [(instant, name, "grey", LINES[3]) for name, instant in (changes or {}).items()]
        if fault_time is not None:
            named_instants.append((fault_time, "fault", "black", LINES[0]))
        last, row = -np.inf, 0
        for instant, name, colour, ls in sorted(named_instants):
            row = (row + 1) % 3 if instant - last < 0.12 * (time[-1] - time[0]) else 0  # close ones below each other
            _line(ax, instant, name, colour, ls, 0.99 - 0.08 * row)
            last = instant
        if alarm is not None:
            _line(ax, float(time[alarm.sample]), "alarm", "red", LINES[1], 0.73)
        if activity is not None:
            low = grid[1, 0]
            low.plot(time, a, color=COLOURS["purple"])
            low.set_ylabel("activity $A$ / -")
            for instant in (changes or {}).values():
                low.axvline(instant, color=COLOURS["grey"], lw=1.1, ls=LINES[3])
        grid[-1, 0].set_xlabel("time / s")
        ax.set_xlim(time[0], time[-1])
    return figure
