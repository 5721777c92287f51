"""Thesis 2.1, 2.1.1-2.1.4: figures of the primer: kinds of faults, three approaches on one run, thresholds."""

from collections.abc import Mapping, Sequence
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import NullLocator
from numpy.typing import NDArray

from pumplib.errors import ParameterError
from pumplib.plots.style import COLOURS, LINES, PAGE, style
from pumplib.primer import Comparison, Estimate, Example, Monitor, Outcome, Scored, Spectrum, Windows

Array = NDArray[Any]
_MARKS = (("clogging", "red", "o"), ("friction", "green", "s"), ("leakage", "purple", "^"), ("cavitation", "blue", "D"))
_TITLES = {
    "signal-based": "signal-based: limit check of $H$, $Q$, $I_{rms}$",
    "model-based": "model-based: residual $r = H - f_H(Q, \\omega)$",
    "model-based, CUSUM": "model-based: CUSUM of the residual at rest",
    "parameter estimation": "parameter estimation: distance of $\\hat\\theta$ from $\\theta_0$",
}
_LABELS = {
    "signal-based": "distance /\nhalf band",
    "model-based": "$r$ / kPa",
    "model-based, CUSUM": r"$g$ / $\sigma$",
    "parameter estimation": "Mahalanobis\ndistance / -",
}


def _instants(ax: Axes, shown: Example, names: bool = False) -> None:
    """Changes of the operating point and onset of the fault."""
    for k, instant in enumerate(shown.run.course.changes):
        label = "operating-point change" if names and k == 0 else None
        ax.axvline(instant, color=COLOURS["grey"], lw=0.8, ls=LINES[3], zorder=1, label=label)
    if shown.onset is not None:
        ax.axvline(shown.onset, color=COLOURS["black"], lw=1.2, zorder=1, label="fault" if names else None)


def three_approaches(shown: Example, outcomes: Sequence[Outcome]) -> Figure:
    """Operating point of a run, and below what each approach makes of it.

    Parameters
    ----------
    shown : Example
        The run.
    outcomes : sequence of Outcome
        One row each.

    Returns
    -------
    Figure

    Raises
    ------
    ParameterError
        If there is no outcome.
    """
    if not outcomes:
        raise ParameterError("three_approaches: no outcome to show; give at least one.")
    with style():
        figure, grid = plt.subplots(len(outcomes) + 1, 1, figsize=(PAGE, 1.2 + 1.35 * len(outcomes)), sharex=True)
        top = grid[0]
        top.plot(shown.w.t, 1e3 * shown.w.Q, color=COLOURS["blue"], label="flow $Q$")
        top.set_ylabel("$Q$ / (l/s)")
        twin = top.twinx()
        twin.spines["right"].set_visible(True)
        twin.grid(False)
        twin.plot(shown.w.t, shown.w.omega, color=COLOURS["orange"], ls="--", label=r"speed $\hat\omega$")
        twin.set_ylabel(r"$\hat\omega$ / (rad/s)")
        _instants(top, shown, names=True)
        handles = [*top.get_legend_handles_labels()[0], *twin.get_legend_handles_labels()[0]]
        figure.legend(handles=handles, loc="outside upper center", ncols=4)
        for ax, one in zip(grid[1:], outcomes, strict=True):
            scale = 1e-3 if one.unit == "Pa" else 1.0
            ax.set_title(_TITLES.get(one.approach, one.approach))
            _instants(ax, shown)
            ax.plot(one.t, scale * one.statistic, color=COLOURS["blue"])
            for sign in (1, -1) if one.unit == "Pa" else (1,):
                ax.plot(one.t, sign * scale * one.threshold, color=COLOURS["green"], lw=1.1, ls="--")
            if one.unit == "Pa":
                reach = scale * 1.5 * max(np.abs(one.statistic).max(), np.quantile(one.threshold, 0.75))
                ax.set_ylim(-reach, reach)
            else:
                ax.set_ylim(0, max(1.15 * one.statistic.max(), 1.6 * one.threshold.max()))
            _alarm(ax, shown, one)
            ax.set_ylabel(_LABELS.get(one.approach, one.unit))
        grid[-1].set_xlabel("time / s")
        top.set_xlim(0.0, shown.run.course.duration)
    return figure


def _alarm(ax: Axes, shown: Example, one: Outcome) -> None:
    """First alarm before and after the fault, with its delay."""
    onset = np.inf if shown.onset is None else shown.onset
    early = next((t for t in one.alarms if t < onset), None)
    late = next((t for t in one.alarms if t >= onset), None)
    text = [] if early is None else [(early, "false alarm", "purple")]
    text += [] if late is None else [(late, f"alarm after {late - onset:.1f} s", "red")]
    for time, words, colour in text:
        ax.axvline(time, color=COLOURS[colour], lw=1.2, ls=LINES[1])
        ax.annotate(
            words, (time, 0.97), xycoords=ax.get_xaxis_transform(), xytext=(3, 0), textcoords="offset points",
            va="top", fontsize=7.5, color=COLOURS[colour], zorder=9,
            bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 0.8},
        )  # fmt: skip


def current_spectra(before: Spectrum, after: Spectrum, shaft_hz: float) -> Figure:
    """Stator current beside its fundamental, before and after a bearing fault.

    Parameters
    ----------
    before, after : Spectrum
        Of one run at one operating point.
    shaft_hz : float
        Rotational frequency of the shaft, Hz.

    Returns
    -------
    Figure
    """
    with style():
        figure, ax = plt.subplots(figsize=(PAGE, 2.6))
        for one, name, colour, ls in ((before, "healthy part", "blue", "-"), (after, "bearing fault", "red", "-")):
            near = np.abs(one.offset) < 60.0
            ax.semilogy(
                one.offset[near], 100 * one.amplitude[near], color=COLOURS[colour], ls=ls, label=name,
                alpha=0.75 if colour == "red" else 1.0, zorder=3 if colour == "blue" else 2,
            )  # fmt: skip
        for sign in (-1, 1):
            ax.axvline(sign * shaft_hz, color=COLOURS["grey"], lw=1.0, ls=":", zorder=1,
                       label="supply $\\pm$ shaft frequency" if sign > 0 else None)  # fmt: skip
        ax.set_xlabel("frequency less the supply's / Hz")
        ax.set_ylabel("current / (% of fundamental)")
        ax.set_xlim(-60, 60)
        figure.legend(loc="outside upper center", ncols=3)
    return figure


def fault_types(monitor: Monitor, additive: Windows, multiplicative: Windows, onset: float, size: float) -> Figure:
    """Pressure residual of an additive and of a multiplicative fault, over time and over the flow.

    Parameters
    ----------
    monitor : Monitor
        Monitor of the machine.
    additive, multiplicative : Windows
        Runs with a sensor offset and with a clogging.
    onset : float
        True time of both faults, s.
    size : float
        K_f of the clogging, Pa s2/m6.

    Returns
    -------
    Figure
    """
    rows = (
        (additive, "additive $f$: sensor offset", "purple", "o"),
        (multiplicative, "multiplicative $\\theta_f$: clogging", "red", "s"),
    )
    with style():
        figure, (left, right) = plt.subplots(
            1, 2, figsize=(PAGE, 2.7), sharey=True, gridspec_kw={"width_ratios": (1.5, 1)}
        )
        for w, name, colour, mark in rows:
            r = 1e-3 * monitor.model.residual(w)
            left.plot(w.t, r, color=COLOURS[colour], ls="-" if mark == "o" else "--", label=name)
            after = w.rest & (w.t > onset + 1.0)
            right.plot((1e3 * w.Q[after]) ** 2, r[after], mark, color=COLOURS[colour], mfc="none", ms=3)
        flow = np.linspace(0.0, (1e3 * multiplicative.Q.max()) ** 2, 2)
        right.plot(flow, -size * 1e-6 * flow * 1e-3, color=COLOURS["black"], lw=1.0, ls=":", label="$-K_f Q^2$")
        left.axvline(onset, color=COLOURS["black"], lw=1.1)
        left.set_xlabel("time / s")
        left.set_ylabel("pressure residual / kPa")
        right.set_xlabel("$Q^2$ / (l/s)$^2$, at rest after the fault")
        left.legend(loc="lower left")
        right.legend(loc="lower left")
    return figure


def residual_made_visible(shown: Example, monitor: Monitor) -> Figure:
    """Measured pressure, what the model expects, and their difference.

    Parameters
    ----------
    shown : Example
        The run.
    monitor : Monitor
        Monitor of the machine.

    Returns
    -------
    Figure
    """
    w, r = shown.w, monitor.model.residual(shown.w)
    with style():
        figure, (ax, below) = plt.subplots(2, 1, figsize=(PAGE, 3.6), sharex=True)
        ax.plot(w.t, 1e-3 * w.H, color=COLOURS["blue"], label="measured $H$")
        ax.plot(w.t, 1e-3 * (w.H - r), color=COLOURS["orange"], ls="--", label=r"expected $f_H(Q, \hat\omega)$")
        ax.set_ylabel("pressure / kPa")
        below.plot(w.t, 1e-3 * r, color=COLOURS["blue"])
        below.set_ylabel("residual $r$ / kPa")
        below.set_xlabel("time / s")
        _instants(ax, shown, names=True)
        _instants(below, shown)
        figure.legend(handles=ax.get_legend_handles_labels()[0], loc="outside upper center", ncols=4)
        ax.set_xlim(0.0, shown.run.course.duration)
    return figure


def isolation(points: Mapping[str, Array]) -> Figure:
    """Directions in which faults move the two residuals.

    Parameters
    ----------
    points : mapping of str to ndarray, shape (n, 2)
        Residuals at rest by fault, in units of their healthy spread; "none" is healthy.

    Returns
    -------
    Figure

    Raises
    ------
    ParameterError
        If a fault has no mark.
    """
    strange = sorted(set(points) - {"none"} - {name for name, _, _ in _MARKS})
    if strange:
        raise ParameterError(f"isolation: no mark for {', '.join(strange)}.")
    with style():
        figure, ax = plt.subplots(figsize=(0.75 * PAGE, 3.6))
        for name, colour, mark in _MARKS:
            if name in points:
                ax.plot(*points[name].T, mark, color=COLOURS[colour], mfc="none", ms=3.5, label=name)
        if "none" in points:
            ax.plot(*points["none"].T, ".", color=COLOURS["black"], ms=4, label="healthy")
        ax.axhline(0.0, color=COLOURS["grey"], lw=0.7)
        ax.axvline(0.0, color=COLOURS["grey"], lw=0.7)
        ax.set_xlabel(r"pressure residual $r_H/\sigma_H$ / -")
        ax.set_ylabel(r"torque residual $r_T/\sigma_T$ / -")
        ticks = (-100, -30, -10, -3, 0, 3, 10, 30, 100)
        ax.set_xscale("symlog", linthresh=3.0)
        ax.set_yscale("symlog", linthresh=3.0)
        for axis, column in ((ax.xaxis, 0), (ax.yaxis, 1)):
            every = np.concatenate([one[:, column] for one in points.values()])
            axis.set_ticks([tick for tick in ticks if 1.5 * every.min() - 1 <= tick <= 1.5 * every.max() + 1])
            axis.set_major_formatter("{x:g}")
            axis.set_minor_locator(NullLocator())
        figure.legend(loc="outside right center")
    return figure


def size_estimate(shown: Example, found: Estimate, monitor: Monitor, size: float | None) -> Figure:
    """Residual of the parameters over time, and the size of the fault that follows from it.

    Parameters
    ----------
    shown : Example
        The run.
    found : Estimate
        Estimated coefficients.
    monitor : Monitor
        Monitor of the machine.
    size : float, optional
        True K_f, Pa s2/m6, if the fault is a clogging.

    Returns
    -------
    Figure
    """
    with style():
        figure, (ax, below) = plt.subplots(2, 1, figsize=(PAGE, 3.8), sharex=True)
        names = ("$a_{h0}$", "$a_{h1}$", "$a_{h2}$")
        for k, (name, ls) in enumerate(zip(names, LINES, strict=False)):
            ax.plot(shown.w.t, 1e-3 * found.residual[:, k] * monitor.model.scale[k], ls=ls, label=name)
        ax.set_ylabel("$\\theta_0 - \\hat\\theta$, as pressure\nat the largest $Q$, $\\omega$ / kPa")
        ax.legend(loc="upper left", ncols=3)
        below.plot(shown.w.t, found.clogging, color=COLOURS["blue"], label=r"$\hat K_f$, if the fault is a clogging")
        if size is not None and shown.onset is not None:
            below.step([0.0, shown.onset, shown.run.course.duration], [0.0, size, size], where="post",
                       color=COLOURS["black"], ls="--", label="true $K_f$ (scoring only)")  # fmt: skip
        below.set_ylabel("$K_f$ / (Pa s$^2$/m$^6$)")
        below.set_xlabel("time / s")
        below.legend(loc="upper left")
        for one in (ax, below):
            _instants(one, shown)
        ax.set_xlim(0.0, shown.run.course.duration)
    return figure


def thresholds(
    healthy: Example, monitor: Monitor, comparison: Comparison, scored: Sequence[Scored], sizes: Sequence[float]
) -> Figure:
    """A healthy run under both thresholds at equal detection, and the trade of detection for false alarms.

    Parameters
    ----------
    healthy : Example
        A healthy run.
    monitor : Monitor
        Monitor of the machine.
    comparison : Comparison
        Sets the constant threshold; names the size that it belongs to.
    scored : sequence of Scored
        Runs of the study.
    sizes : sequence of float
        Sizes of the fault for the lower row, K_f in Pa s2/m6; at most four.

    Returns
    -------
    Figure

    Raises
    ------
    ParameterError
        If there is no size, or more than four.
    """
    if not 0 < len(sizes) <= 4:
        raise ParameterError(f"thresholds: {len(sizes)} sizes; give one to four.")
    k0 = 1e-3 * monitor.threshold.k0[0]
    w = healthy.w
    r, adaptive = 1e-3 * monitor.model.residual(w), 1e-3 * monitor.threshold.at(w.activity)[:, 0]
    level = comparison.factor * k0
    with style():
        figure = plt.figure(figsize=(PAGE, 5.0))
        grid = figure.add_gridspec(2, len(sizes), height_ratios=(1.3, 1.0))
        ax = figure.add_subplot(grid[0, :])
        _instants(ax, healthy, names=True)
        ax.plot(w.t, r, color=COLOURS["blue"], lw=1.0, label="residual, healthy")
        outside = np.where(np.abs(r) > level, r, np.nan)
        ax.plot(w.t, outside, color=COLOURS["red"], lw=2.0, marker=".", label="beyond the constant threshold")
        for sign in (1, -1):
            name = r"adaptive $\kappa(t)$" if sign > 0 else None
            ax.plot(w.t, sign * adaptive, color=COLOURS["green"], lw=1.1, label=name)
            ax.axhline(sign * level, color=COLOURS["black"], ls="--", lw=1.0,
                       label="constant, equal detection" if sign > 0 else None)  # fmt: skip
        reach = 1.4 * max(np.abs(r).max(), level)
        ax.set_ylim(-reach, reach)
        ax.set_xlim(0.0, healthy.run.course.duration)
        ax.set_xlabel("time / s")
        ax.set_ylabel("residual / kPa")
        figure.legend(handles=ax.get_legend_handles_labels()[0], loc="outside upper center", ncols=3)
        for k, size in enumerate(sizes):
            low = figure.add_subplot(grid[1, k])
            for name, colour, ls in (("constant", "black", "--"), ("adaptive", "green", "-")):
                false, hits = roc(scored, size, name)
                low.step(100 * false, 100 * hits, where="post", color=COLOURS[colour], ls=ls, lw=1.4)
            n = sum(one.size == 0 for one in scored)
            found = np.mean([one.adaptive > 1.0 for one in scored if one.size == size])
            spoilt = sum(one.adaptive > 1.0 for one in scored if one.size == 0) / n
            low.plot([100 * spoilt], [100 * found], "o", color=COLOURS["green"], ms=6, clip_on=False, zorder=9)
            power = int(np.floor(np.log10(size)))
            low.set_title(rf"$K_f = {size / 10.0**power:.2g}\cdot 10^{{{power}}}$")
            low.set_xlim(-2, 102)
            low.set_ylim(0, 104)
            low.set_xlabel("false-alarm runs / %")
            if k == 0:
                low.set_ylabel("detected runs / %")
            else:
                low.tick_params(labelleft=False)
    return figure


def roc(scored: Sequence[Scored], size: float, threshold: str) -> tuple[Array, Array]:
    """Shares of false-alarm and of detected runs while a threshold is lowered from infinity.

    Parameters
    ----------
    scored : sequence of Scored
        Runs of the study.
    size : float
        K_f of the faulty runs, Pa s2/m6.
    threshold : str
        "adaptive" or "constant".

    Returns
    -------
    false, detected : ndarray, shape (n,)
        0..1.
    """
    healthy = np.array([getattr(one, threshold) for one in scored if one.size == 0])
    faulty = np.array([getattr(one, threshold) for one in scored if one.size == size])
    levels = np.concatenate(([np.inf], np.sort(np.concatenate((healthy, faulty)))[::-1]))
    return (healthy >= levels[:, None]).mean(axis=1), (faulty >= levels[:, None]).mean(axis=1)
