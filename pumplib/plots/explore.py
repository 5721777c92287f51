"""Thesis 4.4.2, 6.7: the picture of the bench by hand, made once and redrawn in a fraction of a second."""

import io
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.layout_engine import PlaceHolderLayoutEngine
from numpy.typing import NDArray

from pumplib.errors import DataError
from pumplib.plots.style import COLOURS, LINES, PAGE, style

Array = NDArray[Any]
_ROWS, _COLUMNS = 3, 2


@dataclass(frozen=True, kw_only=True, eq=False)
class Panel:
    """What one set of axes shows.

    Parameters
    ----------
    title : str
        Quantity and unit.
    t, y : ndarray, shape (n,)
        Times (s) and values.
    span : float
        Least height of the axes, in the unit of `y`, so that a steady signal does not become a picture of its noise.
    band : float, optional
        Half width of the band around zero that the healthy residual stays in; None for a signal.
    """

    title: str
    t: Array
    y: Array
    span: float
    band: float | None = None


class BenchPicture:
    """Six sets of axes whose lines are moved instead of drawn anew.

    Parameters
    ----------
    duration : float
        End of the time axes, s.
    shown : bool
        Whether pyplot knows the figure, so that a notebook shows it below its cell.
    """

    def __init__(self, duration: float, *, shown: bool = False) -> None:
        with style():
            # fixed margins: an automatic layout costs as much time as the drawing
            fixed = PlaceHolderLayoutEngine(adjust_compatible=True, colorbar_gridspec=True)
            self.figure = (plt.figure if shown else Figure)(figsize=(PAGE, 5.0), layout=fixed)
            self.figure.subplots_adjust(left=0.075, right=0.985, bottom=0.085, top=0.885, hspace=0.42, wspace=0.24)
            self._canvas: FigureCanvasAgg | None = None
            self._axes: list[Axes] = list(
                self.figure.subplots(_ROWS, _COLUMNS, sharex=True).ravel(order="F")  # first column, then second
            )
            self._headline = self.figure.text(0.075, 0.98, "", va="top", fontsize=9, weight="bold")
            colours = ("blue",) * _ROWS + ("red",) * _ROWS
            self._lines = [
                ax.plot([], [], color=COLOURS[colour], lw=0.9)[0]
                for ax, colour in zip(self._axes, colours, strict=True)
            ]
            self._bands = [ax.axhspan(0, 0, color=COLOURS["green"], alpha=0.18, lw=0) for ax in self._axes[_ROWS:]]
            self._onsets = [ax.axvline(0.0, color=COLOURS["black"], lw=1.0, ls=LINES[3]) for ax in self._axes]
            for ax in self._axes:
                ax.ticklabel_format(axis="y", useOffset=False)
                ax.locator_params(axis="y", nbins=5)
                # given places save the search for free ones
                ax.xaxis.set_label_coords(0.5, -0.26)
                ax.yaxis.set_label_coords(-0.1, 0.5)
            for ax in self._axes[_ROWS - 1 :: _ROWS]:
                ax.set_xlabel("time / s")
            self._axes[0].set_xlim(0.0, duration)

    def update(self, panels: Sequence[Panel], headline: str, onset: float | None) -> None:
        """Show other signals.

        Parameters
        ----------
        panels : sequence of Panel
            Three signals from top to bottom, then three residuals.
        headline : str
            One line above all.
        onset : float, optional
            Time of the fault, s; None if there is none.

        Raises
        ------
        DataError
            If the panels are not three signals and three residuals with a band.
        """
        if [panel.band is None for panel in panels] != [True] * _ROWS + [False] * _ROWS:
            raise DataError("BenchPicture.update: give three signals, then three residuals with a band.")
        with style():
            self._headline.set_text(headline)
            for ax, line, panel in zip(self._axes, self._lines, panels, strict=True):
                line.set_data(panel.t, panel.y)
                ax.set_title(panel.title, y=1.0)  # likewise
                ax.set_ylim(_limits(panel))
            for mark in self._onsets:
                mark.set_visible(onset is not None)
                mark.set_xdata([onset or 0.0] * 2)
            for patch, panel in zip(self._bands, panels[_ROWS:], strict=True):
                patch.set_y(-(panel.band or 0.0))
                patch.set_height(2 * (panel.band or 0.0))

    def png(self) -> bytes:
        """Draw.

        Returns
        -------
        bytes
            A PNG file; equal signals give equal bytes.
        """
        # one canvas for all drawings: it remembers how wide every text is
        self._canvas = self._canvas or FigureCanvasAgg(self.figure)
        buffer = io.BytesIO()
        with style():
            # the canvas draws once where savefig draws twice; little compression: the time counts, not the size
            self._canvas.print_png(buffer, metadata={"Software": None}, pil_kwargs={"compress_level": 1})
        return buffer.getvalue()


def _limits(panel: Panel) -> tuple[float, float]:
    low, high = float(np.min(panel.y)), float(np.max(panel.y))
    if panel.band is not None:
        low, high = min(low, -panel.band), max(high, panel.band)
    span = max(1.12 * (high - low), panel.span)
    middle = 0.5 * (low + high)
    return middle - 0.5 * span, middle + 0.5 * span
