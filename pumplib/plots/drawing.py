"""Thesis, all chapters: parts of schematic drawings: arrows, blocks, circuit and hydraulic symbols.

All coordinates are inches on the page, so that every figure is drawn at the size at which it is read.
"""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.layout_engine import PlaceHolderLayoutEngine
from matplotlib.patches import Circle, FancyBboxPatch, Polygon
from matplotlib.text import Text
from numpy.typing import ArrayLike, NDArray

from pumplib.plots.style import COLOURS

Array = NDArray[Any]
Point = tuple[float, float]
Points = ArrayLike | Sequence[ArrayLike]
Line = str | tuple[float, tuple[float, ...]]  # line style of matplotlib

WORDS = 8.0  # pt, names of parts
SYMBOLS = 9.5  # pt, letters of the thesis
NOTES = 7.2  # pt, remarks
INK = COLOURS["black"]
LIQUID = "#DCEEF8"  # light tint of sky: filled with liquid
METAL = "#BDBDBD"  # standing parts
ROTATING = "#F6DDA6"  # light tint of orange: turning parts


def sheet(width: float, height: float) -> tuple[Figure, Axes]:
    """Empty page whose data coordinates are inches.

    Parameters
    ----------
    width, height : float
        Size, in.

    Returns
    -------
    tuple of Figure and Axes
        The axes cover the whole figure and have no frame.
    """
    # an engine that does nothing: without one, saving would restore the engine of the rc parameters
    figure = Figure(figsize=(width, height), layout=PlaceHolderLayoutEngine(True, False))
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set_axis_off()
    axes.set_xlim(0.0, width)
    axes.set_ylim(0.0, height)
    return figure, axes


def turned(point: ArrayLike, origin: Point, angle: float) -> Array:
    """Points of a local frame in page coordinates.

    Parameters
    ----------
    point : array_like, shape (..., 2)
        Points in the local frame, in.
    origin : tuple of float
        Origin of the local frame on the page, in.
    angle : float
        Angle of its first axis, rad.

    Returns
    -------
    ndarray, shape (..., 2)
        in.
    """
    cos, sin = math.cos(angle), math.sin(angle)
    turned_points: Array = np.asarray(point, dtype=float) @ np.array([[cos, sin], [-sin, cos]]) + np.array(origin)
    return turned_points


def arc(centre: Point, radius: float, start: float, stop: float) -> Array:
    """Points of a circular arc.

    Parameters
    ----------
    centre : tuple of float
        Centre, in.
    radius : float
        Radius, in.
    start, stop : float
        Angles, rad; the arc runs from the first to the second.

    Returns
    -------
    ndarray, shape (n, 2)
        in.
    """
    phi = np.linspace(start, stop, max(8, int(abs(stop - start) * 24)))
    return np.column_stack((centre[0] + radius * np.cos(phi), centre[1] + radius * np.sin(phi)))


def smooth(points: Points) -> Array:
    """Smooth curve through points (Catmull-Rom spline).

    Parameters
    ----------
    points : array_like, shape (n, 2)
        Points to pass, in.

    Returns
    -------
    ndarray, shape (m, 2)
        in.
    """
    p = np.asarray(points, dtype=float)
    p = np.vstack((2 * p[0] - p[1], p, 2 * p[-1] - p[-2]))
    t = np.linspace(0.0, 1.0, 16, endpoint=False)[:, None]
    pieces = []
    for a, b, c, d in zip(p[:-3], p[1:-2], p[2:-1], p[3:], strict=True):
        pieces.append(0.5 * (2 * b + (c - a) * t + (2 * a - 5 * b + 4 * c - d) * t**2 + (3 * (b - c) + d - a) * t**3))
    return np.vstack((*pieces, p[-2:-1]))


def label(axes: Axes, at: ArrayLike, text: str, size: float = WORDS, **options: Any) -> Text:
    """Text, centred at a point unless told otherwise.

    Parameters
    ----------
    axes : Axes
        Page.
    at : array_like, shape (2,)
        Anchor, in.
    text : str
        Text; mathematics between dollar signs.
    size : float
        pt.
    **options
        Passed to ``Axes.text``.

    Returns
    -------
    Text
    """
    x, y = np.asarray(at, dtype=float)
    standard: dict[str, Any] = {"ha": "center", "va": "center", "color": INK, "zorder": 10}
    return axes.text(x, y, text, fontsize=size, **(standard | options))


def wire(axes: Axes, points: Points, colour: str = INK, width: float = 1.0, line: Line = "-", **more: Any) -> None:
    """Polyline.

    Parameters
    ----------
    axes : Axes
        Page.
    points : array_like, shape (n, 2)
        in.
    colour : str
        Colour.
    width : float
        pt.
    line : str or tuple
        Line style.
    **more
        Passed to ``Axes.plot``.
    """
    p = np.asarray(points, dtype=float)
    standard: dict[str, Any] = {"zorder": 4, "solid_joinstyle": "round", "solid_capstyle": "round"}
    axes.plot(p[:, 0], p[:, 1], color=colour, linewidth=width, linestyle=line, **(standard | more))


def area(axes: Axes, points: Points, face: str, edge: str = INK, width: float = 0.8, **more: Any) -> None:
    """Filled polygon.

    Parameters
    ----------
    axes : Axes
        Page.
    points : array_like, shape (n, 2)
        in.
    face, edge : str
        Colours.
    width : float
        Width of the edge, pt.
    **more
        Passed to ``Polygon``.
    """
    more = {"zorder": 3, "joinstyle": "round"} | more
    axes.add_patch(Polygon(np.asarray(points, float), closed=True, fc=face, ec=edge, lw=width, **more))


def _without_end(points: Array, length: float) -> tuple[Array, Array]:
    """Cut `length` off the end of a polyline; return the rest and the unit vector of the cut-off end."""
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    along = np.concatenate(([0.0], np.cumsum(steps)))
    keep = max(along[-1] - length, 0.0)
    cut = np.array([np.interp(keep, along, points[:, i]) for i in (0, 1)])
    direction = points[-1] - cut
    return np.vstack((points[along < keep], cut)), direction / np.linalg.norm(direction)


def arrow(
    axes: Axes,
    points: Points,
    colour: str = INK,
    width: float = 1.1,
    line: Line = "-",
    head: float = 0.1,
    both: bool = False,
    zorder: float = 5,
) -> None:
    """Arrow along a straight or curved line; its tip is exactly the last point.

    Parameters
    ----------
    axes : Axes
        Page.
    points : array_like, shape (n, 2)
        Line, in.
    colour : str
        Colour.
    width : float
        pt; 0 for the head alone, on a wire.
    line : str or tuple
        Line style; the head is always solid.
    head : float
        Length of the head, in.
    both : bool
        A head at both ends.
    zorder : float
        Drawing order.
    """
    body = np.asarray(points, dtype=float)
    for _ in range(1 + both):
        tip = body[-1]
        body, direction = _without_end(body, head)
        side = 0.36 * head * np.array([-direction[1], direction[0]])
        base = tip - head * direction
        axes.add_patch(Polygon(np.array([tip, base + side, base - side]), fc=colour, ec="none", zorder=zorder))
        body = body[::-1]
    wire(axes, body, colour, width, line, zorder=zorder, solid_capstyle="butt")


def dimension(axes: Axes, start: ArrayLike, stop: ArrayLike, text: str, at: ArrayLike, **options: Any) -> None:
    """Thin arrow with two heads and a text that gives a length.

    Parameters
    ----------
    axes : Axes
        Page.
    start, stop : array_like, shape (2,)
        Ends, in.
    text : str
        Symbol of the length.
    at : array_like, shape (2,)
        Place of the text, in.
    **options
        Passed to `label`.
    """
    arrow(axes, [start, stop], INK, 0.7, head=0.075, both=True)
    label(axes, at, text, **({"size": SYMBOLS} | options))


def leader(
    axes: Axes, text: str, at: ArrayLike, target: ArrayLike, start: ArrayLike | None = None, **options: Any
) -> None:
    """Name of a part with a thin line to a dot on the part.

    Parameters
    ----------
    axes : Axes
        Page.
    text : str
        Name.
    at : array_like, shape (2,)
        Anchor of the text, in.
    target : array_like, shape (2,)
        The part, in.
    start : array_like, shape (2,), optional
        Beginning of the line; the anchor if not given.
    **options
        Passed to `label`.
    """
    wire(axes, [at if start is None else start, target], INK, 0.6, zorder=8)
    dot(axes, target, 0.018)
    label(axes, at, text, **options)


def dot(axes: Axes, at: ArrayLike, radius: float = 0.03, hollow: bool = False, colour: str = INK) -> None:
    """Node (filled) or terminal (hollow).

    Parameters
    ----------
    axes : Axes
        Page.
    at : array_like, shape (2,)
        Centre, in.
    radius : float
        in.
    hollow : bool
        Terminal instead of node.
    colour : str
        Colour.
    """
    x, y = np.asarray(at, dtype=float)
    axes.add_patch(Circle((x, y), radius, fc="white" if hollow else colour, ec=colour, lw=0.9, zorder=9))


def block(axes: Axes, centre: Point, size: Point, text: str, face: str = "white", line: Line = "-") -> None:
    """Block of a signal-flow diagram.

    Parameters
    ----------
    axes : Axes
        Page.
    centre, size : tuple of float
        in.
    text : str
        Text in the block.
    face : str
        Colour of the inside.
    line : str
        Line style of the edge.
    """
    corner = (centre[0] - size[0] / 2, centre[1] - size[1] / 2)
    style = "round,pad=0,rounding_size=0.05"
    axes.add_patch(FancyBboxPatch(corner, *size, boxstyle=style, fc=face, ec=INK, lw=1.0, ls=line, zorder=3))
    lines = text.split("\n")
    for k, part in enumerate(lines):  # one by one, for even distances whatever the letters
        label(axes, (centre[0], centre[1] + 0.145 * (0.5 * (len(lines) - 1) - k) - 0.04), part, va="baseline")


def _frame(start: ArrayLike, stop: ArrayLike) -> tuple[Array, Array, float]:
    first, last = np.asarray(start, dtype=float), np.asarray(stop, dtype=float)
    length = float(np.linalg.norm(last - first))
    return first, (last - first) / length, length


def _along(first: Array, direction: Array, local: ArrayLike) -> Array:
    p = np.asarray(local, dtype=float)
    normal = np.array([-direction[1], direction[0]])
    placed: Array = first + p[..., :1] * direction + p[..., 1:] * normal
    return placed


def coil(axes: Axes, start: ArrayLike, stop: ArrayLike, colour: str = INK, turns: int = 4, size: float = 0.44) -> None:
    """Coil between two points, with straight leads.

    Parameters
    ----------
    axes : Axes
        Page.
    start, stop : array_like, shape (2,)
        Ends, in; the turns bulge to the left of the way from start to stop.
    colour : str
        Colour.
    turns : int
        Number of half circles.
    size : float
        Length of the turns, in.
    """
    first, direction, length = _frame(start, stop)
    radius, lead = size / (2 * turns), (length - size) / 2
    local = [np.array([[0.0, 0.0]])]
    for k in range(turns):
        local.append(arc((lead + (2 * k + 1) * radius, 0.0), radius, math.pi, 0.0))
    local.append(np.array([[length, 0.0]]))
    wire(axes, _along(first, direction, np.vstack(local)), colour, 1.2)


def resistor(axes: Axes, start: ArrayLike, stop: ArrayLike, colour: str = INK, size: float = 0.3) -> None:
    """Resistor between two points, with straight leads.

    Parameters
    ----------
    axes : Axes
        Page.
    start, stop : array_like, shape (2,)
        Ends, in.
    colour : str
        Colour.
    size : float
        Length of the body, in.
    """
    first, direction, length = _frame(start, stop)
    lead, half = (length - size) / 2, 0.055
    wire(axes, [start, stop], colour, 1.2)
    box = [[lead, -half], [lead + size, -half], [lead + size, half], [lead, half]]
    area(axes, _along(first, direction, box), "white", colour, 1.2, zorder=5)


def valve(axes: Axes, start: ArrayLike, stop: ArrayLike, colour: str = INK, size: float = 0.3) -> None:
    """Valve, the symbol of a pressure loss, between two points.

    Parameters
    ----------
    axes : Axes
        Page.
    start, stop : array_like, shape (2,)
        Ends, in.
    colour : str
        Colour.
    size : float
        Length of the body, in.
    """
    first, direction, length = _frame(start, stop)
    lead, half = (length - size) / 2, 0.4 * size
    wire(axes, [start, stop], colour, 1.2)
    tie = [[lead, -half], [lead + size, half], [lead + size, -half], [lead, half]]
    area(axes, _along(first, direction, tie), "white", colour, 1.2, zorder=5)


def pump(axes: Axes, start: ArrayLike, stop: ArrayLike, radius: float = 0.24) -> None:
    """Ideal pump between two points; the triangle points along the flow.

    Parameters
    ----------
    axes : Axes
        Page.
    start, stop : array_like, shape (2,)
        Inlet and outlet, in.
    radius : float
        in.
    """
    first, direction, length = _frame(start, stop)
    wire(axes, [start, stop], INK, 1.2)
    x, y = first + 0.5 * length * direction
    axes.add_patch(Circle((x, y), radius, fc="white", ec=INK, lw=1.2, zorder=5))
    half = radius / math.sqrt(2)
    triangle = [[length / 2 - half, -half], [length / 2 + radius, 0.0], [length / 2 - half, half]]
    area(axes, _along(first, direction, triangle), ROTATING, INK, 1.0, zorder=6)


def voltage(axes: Axes, plus: ArrayLike, minus: ArrayLike, text: str, at: ArrayLike, **options: Any) -> None:
    """Signs at the two ends of a voltage or pressure difference, and its symbol.

    Parameters
    ----------
    axes : Axes
        Page.
    plus, minus : array_like, shape (2,)
        Places of the signs, in.
    text : str
        Symbol; positive if the end marked + is higher.
    at : array_like, shape (2,)
        Place of the symbol, in.
    **options
        Passed to `label` for the symbol.
    """
    label(axes, plus, "+", 9)
    label(axes, minus, "−", 9)
    label(axes, at, text, **({"size": SYMBOLS} | options))


def chambers(axes: Axes, polygons: Sequence[Points], wall: float, zorder: float = 1.0) -> None:
    """Spaces filled with liquid and joined to each other, inside a wall of even thickness.

    Parameters
    ----------
    axes : Axes
        Page.
    polygons : sequence of array_like, shape (n, 2)
        Spaces, in; where they overlap they are joined.
    wall : float
        Thickness of the wall, in.
    zorder : float
        Drawing order of the wall; the liquid lies 0.1 above.
    """
    passes = ((INK, 144 * wall + 1.4), (METAL, 144 * wall), (INK, 1.4), (LIQUID, 0.1))
    for step, (colour, width) in enumerate(passes):
        for polygon in polygons:
            area(axes, polygon, colour, colour, width, zorder=zorder + 0.03 * step, joinstyle="miter")
