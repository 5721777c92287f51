"""Thesis 4.1.1, 4.2.1: order, curves and nodes for the pictures of graphs, by rules without chance.

The same system always gives the same picture.
"""

import math
import textwrap
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import FancyBboxPatch
from numpy.typing import NDArray

from pumplib.errors import ParameterError
from pumplib.fmea.entries import EDGE_KINDS, OBSERVATION, nearest
from pumplib.fmea.model import System
from pumplib.plots import drawing as d
from pumplib.plots.style import COLOURS, PAGE

Array = NDArray[Any]
Pair = tuple[str, str]
Box = tuple[Array, Array]
"""Centre and half width and height, in."""
LEGEND: Box = (np.array([PAGE / 2, 0.13]), np.array([PAGE / 2, 0.13]))
"""Where `legend` stands; curves keep off it."""
CUT, PLAIN, FAINT = COLOURS["red"], "#5A6570", "#C9D0D6"
LOOP_FACE, WIDER_FACE, FACE = "#CFE3F1", "#EFF6FA", "white"
KIND_LINES: dict[str, Any] = {"effect": "-", "progression": (0, (1, 1.3)), "drift": (0, (3, 1, 1, 1))}
_BENDS = (0.05, 0.1, 0.0, -0.05, 0.15, -0.1, 0.2, -0.15, 0.26, -0.2, 0.33, -0.26, 0.4, -0.33, 0.5, -0.4)


def strong_parts(nodes: Sequence[str], pairs: Iterable[Pair]) -> list[list[str]]:
    """Loops: the strongly connected parts of a graph with more than one node.

    Parameters
    ----------
    nodes : sequence of str
        Nodes.
    pairs : iterable of tuple of str
        Edges, from and to.

    Returns
    -------
    list of list of str
        In the order of the nodes.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    number = {name: k for k, name in enumerate(nodes)}
    edges = np.array([(number[a], number[b]) for a, b in pairs], dtype=int).reshape(-1, 2)
    matrix = coo_array((np.ones(len(edges), dtype=np.int8), edges.T), shape=(len(nodes), len(nodes)))
    _, label = connected_components(matrix, directed=True, connection="strong")
    parts: dict[int, list[str]] = {}
    for name, part in zip(nodes, label.tolist(), strict=True):
        parts.setdefault(part, []).append(name)
    return [part for part in parts.values() if len(part) > 1]


def component_pairs(system: System, kinds: Iterable[str] = EDGE_KINDS) -> dict[Pair, tuple[bool, str]]:
    """Edges of the graph G_e between components, without the signal events.

    Parameters
    ----------
    system : System
        System.
    kinds : iterable of str
        Edge kinds to look at.

    Returns
    -------
    dict
        (from, to) to (whether an edge of it is a must edge, its first kind in the order of `EDGE_KINDS`).
    """
    home = {event.id: event.component for event in system.events}
    found: dict[Pair, tuple[bool, str]] = {}
    for edge in system.select(kinds=kinds).edges:
        pair = (home[edge.cause], edge.component)
        if pair[0] != pair[1] and OBSERVATION not in pair:
            certain, kind = found.get(pair, (False, edge.kind))
            found[pair] = (certain or edge.certain, min(kind, edge.kind, key=EDGE_KINDS.index))
    return found


def _crossings(order: Sequence[int], pairs: Array) -> float:
    """Crossings of chords on a circle, plus a little for long chords."""
    place = np.empty(len(order), dtype=int)
    place[np.asarray(order)] = np.arange(len(order))
    ends = np.sort(place[pairs], axis=1)
    a, b = ends[:, 0], ends[:, 1]
    crossed = (a[:, None] < a) & (a < b[:, None]) & (b[:, None] < b)
    gap = np.minimum(b - a, len(order) - (b - a))
    return float(crossed.sum()) + 0.2 * float((gap - 1).sum())


def circle_order(nodes: Sequence[str], pairs: Iterable[Pair]) -> list[str]:
    """Order on a circle with few crossings, by exchanging nodes until nothing helps any more.

    Parameters
    ----------
    nodes : sequence of str
        Nodes; the first one keeps its place.
    pairs : iterable of tuple of str
        Edges.

    Returns
    -------
    list of str
    """
    number = {name: k for k, name in enumerate(nodes)}
    edges = np.array(sorted({tuple(sorted((number[a], number[b]))) for a, b in pairs}), dtype=int).reshape(-1, 2)
    order = list(range(len(nodes)))
    best = _crossings(order, edges)
    improved = True
    while improved:
        improved = False
        for i in range(1, len(order)):
            for j in range(1, len(order)):
                if i == j:
                    continue
                moved = order.copy()
                moved.insert(j, moved.pop(i))
                swapped = order.copy()
                swapped[i], swapped[j] = swapped[j], swapped[i]
                for trial in (moved, swapped):
                    value = _crossings(trial, edges)
                    if value < best - 1e-9:
                        order, best, improved = trial, value, True
    return [nodes[k] for k in order]


def cut_pairs(cut: Iterable[Pair], allowed: Iterable[Pair]) -> set[Pair]:
    """Cut edges, checked.

    Parameters
    ----------
    cut : iterable of tuple of str
        Cut edges, from and to.
    allowed : iterable of tuple of str
        Edges of the graph.

    Returns
    -------
    set of tuple of str

    Raises
    ------
    ParameterError
        If a cut edge is no edge of the graph.
    """
    known = {f"{a} -> {b}": (a, b) for a, b in allowed}
    chosen = set()
    for a, b in cut:
        if (a, b) not in known.values():
            raise ParameterError(f"cut edge {a} -> {b}: is no edge of the graph; {nearest(f'{a} -> {b}', known)}")
        chosen.add((a, b))
    return chosen


def _bent(start: Array, stop: Array, bend: float) -> Array:
    """Curve between two points, bulging to the right of its way by a share of its length."""
    way = stop - start
    control = 0.5 * (start + stop) + 2 * bend * np.array([way[1], -way[0]])
    t = np.linspace(0.0, 1.0, 301)[:, None]
    curve: Array = (1 - t) ** 2 * start + 2 * t * (1 - t) * control + t**2 * stop
    return curve


def _inside(curve: Array, box: Box, margin: float) -> Array:
    """Which points of a curve lie in a box."""
    inside: Array = np.all(np.abs(curve - box[0]) <= box[1] + margin, axis=1)
    return inside


def _along(curve: Array, other: Array) -> int:
    """How many of some points of a curve lie close to another one."""
    apart = np.linalg.norm(curve[::6, None] - other[None, ::6], axis=-1)
    return int(np.count_nonzero(apart.min(axis=1) < 0.09))


def route(start: Box, stop: Box, others: Sequence[Box], drawn: Sequence[Array]) -> Array:
    """Least bent curve from box to box that passes no other box and keeps off curves that are there already.

    Parameters
    ----------
    start, stop : tuple of ndarray
        Boxes to join.
    others : sequence of tuple of ndarray
        Boxes to keep off.
    drawn : sequence of ndarray, shape (n, 2)
        Curves that are there already, in.

    Returns
    -------
    ndarray, shape (m, 2)
        in.
    """
    best: Array | None = None
    least = math.inf
    for bend in _BENDS:
        curve = _bent(start[0], stop[0], bend)
        curve = curve[~_inside(curve, start, 0.0) & ~_inside(curve, stop, 0.02)]
        blocked = sum(int(_inside(curve, box, 0.04).sum()) for box in others)
        # lines side by side, and arrow heads at one place, cannot be told apart
        close = sum(_along(curve, other) for other in drawn)
        cost = 5 * blocked + 2 * close + 20 * abs(bend)
        if cost < least - 1e-9:
            best, least = curve, cost
    assert best is not None
    return best


def cut_mark(axes: Axes, curve: Array) -> None:
    """Two short strokes across the middle of a cut edge.

    Parameters
    ----------
    axes : Axes
        Page.
    curve : ndarray, shape (n, 2)
        The edge, in.
    """
    k = len(curve) // 2
    way = curve[k + 1] - curve[k - 1]
    way /= np.linalg.norm(way)
    across = 0.075 * np.array([-way[1], way[0]])
    for shift in (-0.022, 0.022):
        centre = curve[k] + shift * way
        d.wire(axes, [centre - across, centre + across], CUT, 1.3, zorder=6)


def draw_box(axes: Axes, box: Box, face: str) -> None:
    """Node with round corners.

    Parameters
    ----------
    axes : Axes
        Page.
    box : tuple of ndarray
        Centre and half width and height, in.
    face : str
        Colour of the inside.
    """
    centre, half = box
    shape = "round,pad=0,rounding_size=0.05"
    corner = (centre[0] - half[0], centre[1] - half[1])
    axes.add_patch(
        FancyBboxPatch(corner, 2 * half[0], 2 * half[1], boxstyle=shape, fc=face, ec=d.INK, lw=0.9, zorder=7)
    )


def wrapped(text: str, width: int) -> list[str]:
    """Text in at most two lines.

    Parameters
    ----------
    text : str
        Text.
    width : int
        Letters a line.

    Returns
    -------
    list of str
    """
    lines = textwrap.wrap(text, width)
    return lines if len(lines) <= 2 else [lines[0], f"{lines[1]} …"]


def legend(axes: Axes, *, faces: dict[str, str], cuts: bool, kinds: Iterable[str], may: bool = False) -> None:
    """Legend at the lower edge of the page.

    Parameters
    ----------
    axes : Axes
        Page.
    faces : dict of str to str
        Meaning of the colours of nodes.
    cuts : bool
        Whether there are cut edges.
    kinds : iterable of str
        Kinds of edges that are drawn.
    may : bool
        Whether may edges are told apart.
    """
    words = {"effect": "effect", "progression": "starts another fault", "drift": "drift of a parameter"}
    handles: list[Any] = [
        Line2D([], [], color=PLAIN, ls=KIND_LINES[kind], lw=1.1, label=words[kind])
        for kind in EDGE_KINDS
        if kind in kinds
    ]
    if may:
        handles.insert(1, Line2D([], [], color=PLAIN, ls="--", lw=1.1, label="may"))
    if cuts:
        handles.append(Line2D([], [], color=CUT, lw=1.8, label="cut"))
    for text, face in faces.items():
        handles.append(Line2D([], [], ls="none", marker="s", ms=9, mfc=face, mec=d.INK, mew=0.9, label=text))
    axes.legend(
        handles=handles, loc="lower center", bbox_to_anchor=(0.5, 0.0), ncols=len(handles), frameon=False,
        columnspacing=1.2, handletextpad=0.5, borderaxespad=0.2,
    )  # fmt: skip


def signed(name: str) -> str:
    """Name with a true minus sign.

    Parameters
    ----------
    name : str
        Name of an event.

    Returns
    -------
    str
    """
    return name.replace("-", "−")
