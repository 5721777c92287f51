"""Thesis 4.1.1, 4.2.1, 4.3.4: the graph of the components and the graph of the events, with loops and cut edges."""

import math
from collections.abc import Iterable, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import FancyBboxPatch

from pumplib.errors import ParameterError
from pumplib.fmea.entries import EDGE_KINDS, OBSERVATION, Effect, nearest
from pumplib.fmea.model import System
from pumplib.plots import drawing as d
from pumplib.plots.ch04_layout import (
    CUT,
    FACE,
    FAINT,
    KIND_LINES,
    LEGEND,
    LOOP_FACE,
    PLAIN,
    WIDER_FACE,
    Array,
    Box,
    Pair,
    circle_order,
    component_pairs,
    cut_mark,
    cut_pairs,
    draw_box,
    legend,
    route,
    signed,
    strong_parts,
    wrapped,
)
from pumplib.plots.style import COLOURS, PAGE, style

Spot = tuple[float, float, float]
"""Left and right end of a name and its height, in."""
_COLUMNS = (0.1, 1.5, 3.15, 4.7, 6.55)
_TITLES = (
    "faults and\ndisturbing events",
    "events before\nthe loops",
    "events of\nthe loops",
    "events behind\nthe loops",
    "signal\nevents",
)


def component_graph(
    system: System, cut: Iterable[Pair] = (), *, kinds: Iterable[str] = EDGE_KINDS, height: float = 5.2
) -> Figure:
    """Graph G_e of the components: loops shaded, cut edges marked, progression and drift in their own lines.

    Parameters
    ----------
    system : System
        System.
    cut : iterable of tuple of str
        Cut edges as (from, to) components.
    kinds : iterable of str
        Edge kinds to draw.
    height : float
        Height of the figure, in.

    Returns
    -------
    Figure

    Raises
    ------
    ParameterError
        If a cut edge is no edge of the graph.
    """
    names = {component.id: component.name for component in system.components}
    pairs = component_pairs(system, kinds)
    cuts = cut_pairs(cut, pairs)
    order = circle_order(list(names), pairs)
    looped = {name for part in strong_parts(list(names), pairs) for name in part}
    plain = [pair for pair, (_, kind) in pairs.items() if kind == "effect"]
    inner = {name for part in strong_parts(list(names), plain) for name in part}
    half = np.array([0.66, 0.25])
    radius = np.array([PAGE / 2 - half[0] - 0.1, (height - 0.35) / 2 - half[1] - 0.1])
    middle = np.array([PAGE / 2, (height + 0.35) / 2])
    angles = math.pi / 2 - 2 * math.pi * np.arange(len(order)) / len(order)
    boxes = {
        name: (middle + radius * np.array([math.cos(a), math.sin(a)]), half)
        for name, a in zip(order, angles, strict=True)
    }
    with style():
        figure, axes = d.sheet(PAGE, height)
        drawn: list[Array] = []
        for pair, (certain, kind) in pairs.items():
            others = [LEGEND, *(box for name, box in boxes.items() if name not in pair)]
            drawn.append(route(boxes[pair[0]], boxes[pair[1]], others, drawn))
            colour = CUT if pair in cuts else PLAIN
            line = "--" if not certain and kind == "effect" else KIND_LINES[kind]
            d.arrow(axes, drawn[-1], colour, 1.8 if pair in cuts else 0.9, line, head=0.11, zorder=3)
            if pair in cuts:
                cut_mark(axes, drawn[-1])
        for name, box in boxes.items():
            draw_box(axes, box, LOOP_FACE if name in inner else WIDER_FACE if name in looped else FACE)
            words = wrapped(names[name], 24)
            x, y = box[0] + np.array([0.0, 0.07 + 0.06 * (len(words) - 1)])
            d.label(axes, (x, y), name, 8.5, weight="bold")
            for k, text in enumerate(words):
                d.label(axes, (x, y - 0.15 - 0.12 * k), text, 7)
        faces = {"in a loop": LOOP_FACE} if inner else {}
        if looped - inner:
            faces["in a loop if an effect starts a fault"] = WIDER_FACE
        legend(axes, faces=faces, cuts=bool(cuts), kinds={kind for _, kind in pairs.values()})
    return figure


def loop_graph(system: System, cut: Iterable[Pair] = (), *, kinds: Iterable[str] = ("effect",)) -> Figure:
    """Events of the largest loop, grouped by component, both signs of a quantity above each other.

    Parameters
    ----------
    system : System
        System.
    cut : iterable of tuple of str
        Cut edges as (from, to) components.
    kinds : iterable of str
        Edge kinds to look at.

    Returns
    -------
    Figure

    Raises
    ------
    ParameterError
        If the system has no loop or a cut edge is no edge of the graph of the components.
    """
    chosen = system.select(kinds=kinds)
    events = [event.id for event in system.events]
    parts = strong_parts(events, [(edge.cause, edge.effect) for edge in chosen.edges])
    if not parts:
        raise ParameterError(f"system {system.name!r}: has no loop of events of the kinds {', '.join(kinds)}.")
    cuts = cut_pairs(cut, component_pairs(system, EDGE_KINDS))
    inside = max(parts, key=len)
    home = {event.id: event.component for event in system.events}
    quantities = list(dict.fromkeys(name[:-1] for name in inside))
    links = [edge for edge in chosen.edges if {edge.cause, edge.effect} <= set(inside)]
    order = circle_order(quantities, [(e.cause[:-1], e.effect[:-1]) for e in links if e.cause[:-1] != e.effect[:-1]])
    height, half = 5.8, np.array([0.24, 0.13])
    middle, outer, inner = np.array([PAGE / 2, (height + 0.3) / 2]), np.array([2.75, 2.1]), np.array([1.95, 1.35])
    angles = math.pi / 2 - 2 * math.pi * (np.arange(len(order)) + 0.5) / len(order)
    ray = {q: np.array([math.cos(a), math.sin(a)]) for q, a in zip(order, angles, strict=True)}
    # one ring a sign: relations of equal sign stay in their ring, the others cross
    boxes = {name: (middle + (outer if name[-1] == "+" else inner) * ray[name[:-1]], half) for name in inside}
    with style():
        figure, axes = d.sheet(PAGE, height)
        names: list[Box] = [LEGEND]
        for quantity, direction in ray.items():
            ends = np.array([middle + outer * direction, middle + inner * direction])
            d.wire(axes, ends, LOOP_FACE, 46, solid_capstyle="round", zorder=1)
            owner = home[next(name for name in inside if name[:-1] == quantity)]
            beyond = ends[0] + np.array([0.45, 0.34]) * direction
            d.label(axes, beyond, owner, 8, weight="bold", color=COLOURS["blue"])
            names.append((beyond, np.array([0.14, 0.07])))
        drawn: list[Array] = []
        for edge in links:
            others = [box for name, box in boxes.items() if name not in (edge.cause, edge.effect)] + names
            drawn.append(route(boxes[edge.cause], boxes[edge.effect], others, drawn))
            is_cut = (home[edge.cause], edge.component) in cuts
            line: Any = "-" if edge.certain else "--"
            d.arrow(axes, drawn[-1], CUT if is_cut else PLAIN, 1.5 if is_cut else 0.8, line, head=0.1, zorder=4)
        for name, box in boxes.items():
            draw_box(axes, box, "white")
            d.label(axes, box[0], signed(name), 8)
        legend(axes, faces={}, cuts=bool(cuts), kinds={edge.kind for edge in links})
    return figure


def event_columns(system: System) -> tuple[list[str], list[str], list[str], list[str], list[str]]:
    """Columns of the graph of the events: roots, events before, in and after the loops, signal events.

    Parameters
    ----------
    system : System
        System.

    Returns
    -------
    tuple of list of str
        Roots (faults and disturbing events); events that no loop reaches; events of loops; events that a loop
        reaches; signal events.
    """
    pairs = [(edge.cause, edge.effect) for edge in system.select(kinds=("effect",)).edges]
    names = [event.id for event in system.events]
    loop = {name for part in strong_parts(names, pairs) for name in part}
    after = _reached(loop, pairs) - loop
    owned = [event.id for event in system.events if event.component != OBSERVATION]
    owner = [*((item.component, item.id) for item in system.faults)]
    owner += [(item.component, item.id) for item in system.disturbances]
    roots = [name for component in system.components for place, name in owner if place == component.id]
    return (
        roots,
        [name for name in owned if name not in loop and name not in after],
        [name for name in owned if name in loop],
        [name for name in owned if name in after],
        list(system.ends),
    )


def _reached(start: Iterable[str], pairs: Sequence[Pair]) -> set[str]:
    following: dict[str, list[str]] = {}
    for a, b in pairs:
        following.setdefault(a, []).append(b)
    found, waiting = set(start), list(start)
    while waiting:
        for name in following.get(waiting.pop(), ()):
            if name not in found:
                found.add(name)
                waiting.append(name)
    return found


def event_graph(
    system: System, cut: Iterable[Pair] = (), *, highlight: str | None = None, height: float = 9.2
) -> Figure:
    """Whole graph of the events in columns: roots, events before, in and after the loops, signal events.

    Parameters
    ----------
    system : System
        System.
    cut : iterable of tuple of str
        Cut edges as (from, to) components.
    highlight : str, optional
        Fault or disturbing event whose propagation is drawn strongly and the rest faintly.
    height : float
        Height of the figure, in.

    Returns
    -------
    Figure

    Raises
    ------
    ParameterError
        If the root or a cut edge does not exist.
    """
    cuts = cut_pairs(cut, component_pairs(system))
    columns = event_columns(system)
    if highlight is not None and highlight not in columns[0]:
        raise ParameterError(
            f"highlight = {highlight!r}: no such fault or disturbing event; {nearest(highlight, columns[0])}"
        )
    home = {event.id: event.component for event in system.events}
    rises: list[tuple[str, Effect]] = []
    for fault in system.faults:
        home[fault.id] = fault.component
        rises += [(fault.id, effect) for effect in fault.effects]
    for item in system.disturbances:
        home[item.id] = item.component
        rises += [(item.id, effect) for effect in item.effects]
    pairs = [(name, effect.event) for name, effect in rises]
    pairs += [(edge.cause, edge.effect) for edge in system.edges if edge.kind == "effect"]
    lit = _reached({highlight}, pairs) if highlight else None
    with style():
        figure, axes = d.sheet(PAGE, height)
        place: dict[str, Spot] = {}
        for left, title, names in zip(_COLUMNS, _TITLES, columns, strict=True):
            d.label(axes, (left, height - 0.2), title, 7, ha="left", weight="bold", linespacing=1.1)
            place |= _column(axes, left, names, home, height, lit)
        if columns[2]:
            axes.add_patch(
                FancyBboxPatch(
                    (_COLUMNS[2] - 0.06, 0.4), 0.5, height - 0.84, boxstyle="round,pad=0,rounding_size=0.05",
                    fc=LOOP_FACE, ec="none", zorder=0,
                )
            )  # fmt: skip
        for name, effect in rises:
            strong = None if lit is None else name in lit
            _event_edge(axes, place[name], place[effect.event], "-" if effect.certain else "--", False, strong)
        for edge in system.edges:
            effective = edge.kind == "effect"
            line = KIND_LINES[edge.kind] if edge.certain or not effective else "--"
            strong = None if lit is None else effective and edge.cause in lit
            is_cut = effective and (home[edge.cause], edge.component) in cuts
            _event_edge(axes, place[edge.cause], place[edge.effect], line, is_cut, strong)
        faces = {"in a loop": LOOP_FACE} if columns[2] else {}
        legend(axes, faces=faces, cuts=bool(cuts), kinds={edge.kind for edge in system.edges}, may=True)
    return figure


def _column(
    axes: Axes, left: float, names: Sequence[str], home: dict[str, str], height: float, lit: set[str] | None
) -> dict[str, Spot]:
    """Names below each other, each component under its heading."""
    lines: list[tuple[str, bool]] = []
    for before, name in pairwise(["", *names]):
        if home.get(before) != home[name] and home[name] != OBSERVATION:
            lines.append((home[name], True))
        lines.append((name, False))
    top, bottom = height - 0.45, 0.42
    step = (top - bottom) / max(len(lines), 1)
    place: dict[str, Spot] = {}
    face = LOOP_FACE if left == _COLUMNS[2] else "white"
    ground = {"boxstyle": "square,pad=0.06", "fc": face, "ec": "none"}
    for n, (name, heading) in enumerate(lines):
        y = top - (n + 0.5) * step
        if heading:
            d.label(
                axes, (left, y - 0.02), name, 7, ha="left", weight="bold", color=COLOURS["blue"], bbox=ground, zorder=9
            )
            continue
        colour = d.INK if lit is None or name in lit else "#8A949C"
        d.label(axes, (left + 0.03, y), signed(name), 7, ha="left", color=colour, bbox=ground, zorder=9)
        # right end from the number of letters: a line starts just behind the name
        place[name] = (left, left + 0.09 + 0.062 * len(name), y)
    return place


def _event_edge(axes: Axes, start: Spot, stop: Spot, line: Any, is_cut: bool, strong: bool | None) -> None:
    """Line from name to name; `strong` is None where nothing is highlighted."""
    if start[0] == stop[0]:  # within a column: a bow on its right side
        a, b = np.array(start[1:]), np.array(stop[1:])
        bow = np.array([0.12 + 0.05 * min(abs(b[1] - a[1]), 6.0), 0.0])
        p = [a, a + bow, b + bow, b]
    else:
        ahead = start[0] < stop[0]
        a = np.array([start[1] if ahead else start[0], start[2]])
        b = np.array([stop[0] if ahead else stop[1], stop[2]])
        pull = np.array([0.45 * (b[0] - a[0]), 0.0])
        p = [a, a + pull, b - pull, b]
    t = np.linspace(0.0, 1.0, 41)[:, None]
    curve = (1 - t) ** 3 * p[0] + 3 * t * (1 - t) ** 2 * p[1] + 3 * t**2 * (1 - t) * p[2] + t**3 * p[3]
    if strong is False:
        d.arrow(axes, curve, FAINT, 0.4, line, head=0.05, zorder=1)
    else:
        d.arrow(axes, curve, CUT if is_cut else PLAIN, 1.1 if strong or is_cut else 0.55, line, head=0.06, zorder=3)
