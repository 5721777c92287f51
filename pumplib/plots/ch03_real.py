"""Thesis 3.2.4, 3.3.2, 3.3.3: figures of the measured machines of notebook 03: pump curves and motor load points."""

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from pumplib.errors import ParameterError
from pumplib.hydraulics.curves import CurveFit, Provenance, PumpCurve, PumpFit
from pumplib.machines import from_si
from pumplib.motor.load_points import LoadComparison
from pumplib.plots.style import COLOURS, PAGE, style

Array = NDArray[Any]
_COLUMNS = 5
_SMALL = 6.5


@style()
def pump_curve_fits(curves: Sequence[PumpCurve], fits: Sequence[PumpFit], flags: Sequence[Provenance]) -> Figure:
    """Measured head and torque of every pump with the thesis's forms through them.

    One small panel a pump: pressure above, torque below. Pumps that are no independent evidence have open
    markers, a shaded panel and a word why.

    Parameters
    ----------
    curves : sequence of PumpCurve
        Measured curves.
    fits : sequence of PumpFit
        Their fits, in the same order.
    flags : sequence of Provenance
        Where the rows come from, in the same order.

    Returns
    -------
    Figure

    Raises
    ------
    ParameterError
        If there is no curve or the three sequences do not belong together.
    """
    if not curves or not [c.name for c in curves] == [f.name for f in fits] == [p.name for p in flags]:
        raise ParameterError(
            f"{len(curves)} curves, {len(fits)} fits and {len(flags)} flags: give one fit and one flag a curve, "
            "in the same order."
        )
    columns = min(_COLUMNS, len(curves))
    rows = -(-len(curves) // columns)
    figure = plt.figure(figsize=(PAGE, 0.35 + 2.45 * rows), layout="constrained")
    blocks = figure.add_gridspec(rows, columns, wspace=0.04, hspace=0.06)
    head: Axes | None = None
    for k, (curve, fit, flag) in enumerate(zip(curves, fits, flags, strict=True)):
        cell = blocks[k // columns, k % columns].subgridspec(2, 1, height_ratios=(1.6, 1), hspace=0.06)
        head = figure.add_subplot(cell[0])
        torque = figure.add_subplot(cell[1], sharex=head)
        _form(head, curve, fit.head, "kPa", flag.independent, "blue", "o")
        _form(torque, curve, fit.torque, "N m", flag.independent, "red", "s")
        head.tick_params(labelbottom=False)
        head.set_title(_two_lines(curve.name), fontsize=_SMALL + 0.5, loc="left")
        head.text(
            0.04, 0.06, f"R² {_r2(fit.head.r2)}\nleft out {_r2(fit.head.loo_r2)}",
            transform=head.transAxes, fontsize=_SMALL - 0.5, va="bottom",
        )  # fmt: skip
        torque.text(
            0.96, 0.06, f"R² {_r2(fit.torque.r2)}",
            transform=torque.transAxes, fontsize=_SMALL - 0.5, va="bottom", ha="right",
        )  # fmt: skip
        if not flag.independent:
            word = "copied rows" if flag.copy_of is not None else "tabulated"
            head.text(0.04, 0.36, f"{word}:\nnot counted", transform=head.transAxes, fontsize=_SMALL)
            for axes in (head, torque):
                axes.set_facecolor("#e8e8e8")
        if k % columns == 0:
            head.set_ylabel("pressure (kPa)", fontsize=_SMALL + 0.5)
            torque.set_ylabel("torque (N m)", fontsize=_SMALL + 0.5)
        if k + columns >= len(curves):
            torque.set_xlabel("flow (m³/h)", fontsize=_SMALL + 0.5)
        for axes in (head, torque):
            axes.tick_params(labelsize=_SMALL)
            axes.locator_params(axis="x", nbins=3)
            axes.locator_params(axis="y", nbins=4)
    assert head is not None
    handles = [
        plt.Line2D([], [], color=COLOURS["blue"], marker="o", markersize=3.5, lw=1.1, label="pressure and (3.24)"),
        plt.Line2D(
            [], [], color=COLOURS["red"], marker="s", markersize=3.5, lw=1.1, ls="--", label="torque P/ω and (3.19)"
        ),
        plt.Rectangle((0, 0), 1, 1, color=COLOURS["grey"], alpha=0.35, lw=0, label="95 % band of the fit"),
    ]
    figure.legend(handles=handles, loc="outside upper center", ncols=3, fontsize=_SMALL + 0.5, frameon=False)
    return figure


def _form(axes: Axes, curve: PumpCurve, fit: CurveFit, unit: str, independent: bool, colour: str, marker: str) -> None:
    """Draw points, form and band of one quantity; one line a speed."""
    measured = fit.fitted + fit.residuals
    for omega in np.unique(curve.omega):
        own = curve.omega == omega
        flow = np.linspace(curve.flow[own].min(), curve.flow[own].max(), 60)
        low, high = (_shown(x, unit) for x in fit.band(flow, omega))
        x = from_si(flow, "m3/h")
        axes.fill_between(x, low, high, color=COLOURS["grey"], alpha=0.35, lw=0)
        axes.plot(x, _shown(fit(flow, omega), unit), color=COLOURS[colour], lw=1.1, ls="-" if marker == "o" else "--")
    axes.plot(
        from_si(curve.flow, "m3/h"), _shown(measured, unit), marker, ms=3.2, ls="none",
        color=COLOURS[colour], mfc=COLOURS[colour] if independent else "white", mew=0.8,
    )  # fmt: skip
    bottom, top = axes.get_ylim()
    axes.set_ylim(min(0.0, bottom), top + 0.06 * (top - min(0.0, bottom)))


def _shown(value: Array, unit: str) -> Array:
    return np.asarray(from_si(value, unit))


def _r2(value: float) -> str:
    """R² with four decimals, never rounded up to one."""
    return f"{math.floor(value * 1e4) / 1e4:.4f}"


def _two_lines(name: str) -> str:
    """Break a long name at the space nearest to its middle."""
    spaces = [k for k, letter in enumerate(name) if letter == " "]
    if len(name) <= 14 or not spaces:
        return "\n" + name
    k = min(spaces, key=lambda s: abs(s - len(name) / 2))
    return name[:k] + "\n" + name[k + 1 :]


@style()
def motor_load_points(comparison: LoadComparison) -> Figure:
    """Measured load points of a motor beside the two calculations.

    Parameters
    ----------
    comparison : LoadComparison
        Measured, computed from electrical quantities, and computed from the shaft power.

    Returns
    -------
    Figure
        Speed, its error, error of the shaft power, current, power factor and efficiency over the shaft power.
    """
    points, electrical, forward = comparison.points, comparison.electrical, comparison.forward
    load = _shown(points.power_shaft, "kW")
    figure, axes = plt.subplots(2, 3, figsize=(PAGE, 4.3), sharex=True, layout="constrained")
    speed, error, power, current, factor, efficiency = axes.flat

    def draw(ax: Axes, x: Array, y: Array, kind: str) -> None:
        colour, marker, line, fill = {
            "measured": ("black", "o", "none", "black"),
            "electrical": ("blue", "s", "--", "white"),
            "forward": ("red", "^", "-", "white"),
        }[kind]
        # measured points stay visible below the open markers of the calculations
        size = 3.2 if kind == "measured" else 5.0
        mfc = COLOURS["black"] if fill == "black" else "none"
        ax.plot(x, y, marker=marker, ms=size, mew=0.9, lw=0.9, ls=line, color=COLOURS[colour], mfc=mfc)

    rpm: Callable[[Array], Array] = lambda omega: _shown(omega, "rpm")  # noqa: E731
    draw(speed, load, rpm(points.omega), "measured")
    draw(speed, load, rpm(electrical.omega), "electrical")
    draw(speed, load, rpm(forward.omega), "forward")
    speed.set_ylabel("speed (rpm)")
    error.axhspan(-0.5, 0.5, color=COLOURS["grey"], alpha=0.25, lw=0)
    error.text(0.97, 0.03, "shaded: rounding of the measured speed", transform=error.transAxes, fontsize=6, ha="right")
    draw(error, load, rpm(comparison.speed_error()), "electrical")
    draw(error, load, rpm(comparison.speed_error(forward=True)), "forward")
    error.set_ylabel("speed error (rpm)")
    bottom, top = error.get_ylim()
    error.set_ylim(min(bottom, -0.75), max(top, 0.75))
    loaded = points.loaded
    draw(power, load[loaded], 100 * comparison.power_error()[loaded], "electrical")
    power.set_ylabel("shaft power error (%)")
    for ax in (error, power):
        ax.axhline(0, color=COLOURS["black"], lw=0.6)
    draw(current, load, points.current_line_rms, "measured")
    draw(current, load, forward.current_line_rms, "forward")
    current.set_ylabel("line current (A)")
    draw(factor, load, points.power_factor, "measured")
    draw(factor, load, forward.power_factor, "forward")
    factor.set_ylabel("power factor (-)")
    draw(efficiency, load[loaded], 100 * comparison.efficiency[loaded], "measured")
    draw(efficiency, load[loaded], 100 * electrical.efficiency[loaded], "electrical")
    draw(efficiency, load[loaded], 100 * forward.efficiency[loaded], "forward")
    efficiency.set_ylabel("efficiency (%)")
    for ax in axes[1]:
        ax.set_xlabel("shaft power (kW)")
    handles = [
        plt.Line2D([], [], color=COLOURS["black"], marker="o", ls="none", ms=3.2, label="measured"),
        plt.Line2D([], [], color=COLOURS["blue"], marker="s", mfc="none", ls="--", label="from V, I, f, cos φ"),
        plt.Line2D([], [], color=COLOURS["red"], marker="^", mfc="none", ls="-", label="from the shaft power"),
    ]
    figure.legend(handles=handles, loc="outside upper center", ncols=3, frameon=False)
    return figure
