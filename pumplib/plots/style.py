"""Thesis, all chapters: the one look of all figures, and saving them with the same bytes every time."""

import io
import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import matplotlib
from cycler import cycler
from matplotlib.figure import Figure

from pumplib.errors import ParameterError

# Okabe and Ito (2008): distinguishable with the common colour-vision deficiencies
COLOURS = {
    "blue": "#0072B2",
    "orange": "#E69F00",
    "green": "#009E73",
    "red": "#D55E00",
    "purple": "#CC79A7",
    "sky": "#56B4E9",
    "yellow": "#F0E442",
    "black": "#000000",
    "grey": "#777777",
}
LINES = ("-", "--", "-.", ":")  # colour is never the only difference
COLUMN = 3.5  # in, width of a journal column
PAGE = 7.2  # in, width of a page

_RC: dict[str, Any] = {
    "axes.grid": True,
    "axes.prop_cycle": cycler(color=[COLOURS[c] for c in ("blue", "red", "green", "purple", "orange", "sky", "black")]),
    "axes.spines.right": False,
    "axes.spines.top": False,
    "axes.titlesize": 9,
    "axes.titlelocation": "left",
    "axes.labelsize": 8.5,
    "figure.constrained_layout.use": True,
    "figure.dpi": 110,
    "font.family": "DejaVu Sans",  # comes with matplotlib, so that it is the same everywhere
    "font.size": 8.5,
    "grid.alpha": 0.35,
    "grid.linewidth": 0.5,
    "legend.fontsize": 7.5,
    "legend.framealpha": 0.85,
    "legend.handlelength": 2.4,
    "lines.linewidth": 1.3,
    "lines.markersize": 4,
    "savefig.dpi": 200,
    "svg.fonttype": "path",
    "svg.hashsalt": "pumplib",
    "xtick.labelsize": 8,
    "ytick.labelsize": 8,
}


@contextmanager
def style() -> Iterator[None]:
    """Context in which figures are made: the workbook's look on top of matplotlib's defaults.

    Yields
    ------
    None
    """
    with matplotlib.rc_context():
        matplotlib.rcdefaults()
        matplotlib.rcParams.update(_RC)  # type: ignore[arg-type]
        yield


def save_figure(figure: Figure, folder: Path, name: str) -> list[Path]:
    """Write a figure as SVG and PNG; equal figures give equal bytes on the same platform.

    Parameters
    ----------
    figure : Figure
        The figure.
    folder : Path
        Where to; made if absent.
    name : str
        File name without ending, chapter and content: ``ch03_start_up``.

    Returns
    -------
    list of Path
        The SVG and the PNG.

    Raises
    ------
    ParameterError
        If the name does not follow the scheme.
    """
    if not re.fullmatch(r"ch\d\d_[a-z0-9_]+|overview_[a-z0-9_]+|own_[a-z0-9_]+", name):
        raise ParameterError(f"figure name {name!r}: write chapter and content in lower case, like ch03_start_up.")
    folder.mkdir(parents=True, exist_ok=True)
    paths = []
    with style():
        figure.draw_without_rendering()  # lays the figure out once for both files
        figure.set_layout_engine("none")
        for kind, metadata in (("svg", {"Date": None, "Creator": None}), ("png", {"Software": None})):
            path = folder / f"{name}.{kind}"
            buffer = io.BytesIO()
            figure.savefig(buffer, format=kind, metadata=metadata)
            path.write_bytes(buffer.getvalue())
            paths.append(path)
    return paths
