"""Thesis 2.1, 2.1.1, 2.1.2: block diagrams of a system with a fault and of the two structures of FDI.

Drawn here after the captions and labels of figures 2.1, 2.2 and 2.3; no drawing of the thesis survives.
"""

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from pumplib.plots import drawing as d
from pumplib.plots.style import COLOURS, COLUMN, PAGE, style

FAULT, SIGNAL = COLOURS["red"], COLOURS["blue"]
_FRAME = COLOURS["grey"]


def system_with_fault() -> Figure:
    """System with inputs u, outputs y and a fault f.

    Returns
    -------
    Figure

    References
    ----------
    Thesis figure 2.1.
    """
    with style():
        figure, axes = d.sheet(COLUMN, 1.3)
        _system(axes, (1.75, 0.45), 0.35, 3.15)
    return figure


def signal_based() -> Figure:
    """Signal-based FDI: signal processing, residual evaluation, fault scenario database; the input is not used.

    Returns
    -------
    Figure

    References
    ----------
    Thesis figure 2.2.
    """
    with style():
        figure, axes = d.sheet(PAGE, 2.3)
        y = 1.45
        _system(axes, (1.1, y), 0.2, 2.65)
        axes.add_patch(Rectangle((2.35, 0.12), 4.2, 2.02, fc="none", ec=_FRAME, lw=0.9, ls="--", zorder=1))
        d.label(axes, (2.45, 1.98), "Fault detection and isolation", ha="left", weight="bold")
        d.block(axes, (3.25, y), (1.2, 0.6), "Signal\nprocessing")
        d.block(axes, (5.5, y), (1.2, 0.6), "Residual\nevaluation", d.LIQUID)
        d.block(axes, (5.5, 0.47), (1.2, 0.5), "Fault scenario\ndatabase", d.ROTATING)
        d.arrow(axes, [(3.85, y), (4.9, y)], SIGNAL)
        d.label(axes, (4.37, y + 0.13), "$r$", d.SYMBOLS)
        d.arrow(axes, [(5.5, 0.72), (5.5, y - 0.3)])
        d.arrow(axes, [(6.1, y), (6.85, y)], SIGNAL)
        d.label(axes, (6.96, y), "$v$", d.SYMBOLS)
    return figure


def model_based() -> Figure:
    """Model-based FDI: the residual filter uses inputs and outputs, the residual evaluation decides.

    Returns
    -------
    Figure

    References
    ----------
    Thesis figure 2.3.
    """
    with style():
        figure, axes = d.sheet(PAGE, 2.5)
        y, low = 1.65, 0.5
        _system(axes, (1.6, y), 0.2, 2.85)
        d.dot(axes, (0.55, y))
        d.dot(axes, (2.6, y))
        d.block(axes, (3.75, low), (1.3, 0.66), "Model-based\nresidual filter", d.ROTATING)
        d.wire(axes, [(0.55, y), (0.55, low - 0.16)], SIGNAL, 1.1)
        d.arrow(axes, [(0.55, low - 0.16), (3.1, low - 0.16)], SIGNAL)
        d.wire(axes, [(2.6, y), (2.6, low + 0.16)], SIGNAL, 1.1)
        d.arrow(axes, [(2.6, low + 0.16), (3.1, low + 0.16)], SIGNAL)
        d.block(axes, (5.6, low), (1.2, 0.66), "Residual\nevaluation", d.LIQUID)
        d.arrow(axes, [(4.4, low), (5.0, low)], SIGNAL)
        d.label(axes, (4.7, low + 0.13), "$r$", d.SYMBOLS)
        d.arrow(axes, [(6.2, low), (6.85, low)], SIGNAL)
        d.label(axes, (6.96, low), "$v$", d.SYMBOLS)
    return figure


def _system(axes: Axes, centre: d.Point, start: float, stop: float) -> None:
    """System with its input from `start`, its output to `stop`, and a fault from above."""
    x, y = centre
    half, high = 0.55, 0.3
    d.block(axes, centre, (2 * half, 2 * high), "System")
    d.arrow(axes, [(start, y), (x - half, y)], SIGNAL)
    d.label(axes, (start + 0.12, y + 0.13), "$u$", d.SYMBOLS)
    d.arrow(axes, [(x + half, y), (stop, y)], SIGNAL)
    d.label(axes, (x + half + 0.3, y + 0.13), "$y$", d.SYMBOLS)
    d.arrow(axes, [(x, y + high + 0.4), (x, y + high)], FAULT)
    d.label(axes, (x + 0.13, y + high + 0.27), "$f$", d.SYMBOLS)
