"""Thesis, all chapters: results to matplotlib figures."""

from pumplib.plots.style import COLOURS, save_figure, style

__all__ = ["COLOURS", "save_figure", "style"]
