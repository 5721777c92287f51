"""Thesis 3.1, 3.3, 3.3.4: sections through the multistage pump and through one stage.

Drawn here after the captions and labels of figures 3.1, 3.5 and 3.9; no drawing of the thesis survives. Front views
look along the inlet flow; the impeller turns counter-clockwise and its blades are curved backward.
"""

import math

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from numpy.typing import ArrayLike

from pumplib.machines.parameters import Impeller
from pumplib.plots import drawing as d
from pumplib.plots.ch03_velocities import blade_line
from pumplib.plots.drawing import Array, Point
from pumplib.plots.style import COLOURS, PAGE, style

FLOW, LEAK, BLADE = COLOURS["blue"], COLOURS["red"], COLOURS["red"]


def pump_construction() -> Figure:
    """Simplified section of a multistage centrifugal pump with its motor.

    Returns
    -------
    Figure

    References
    ----------
    Thesis figure 3.1 (own drawing, with four stages).
    """
    with style():
        figure, axes = d.sheet(PAGE, 3.15)
        y, shaft, bore = 1.5, 0.06, 0.74
        stages, first, length = 4, 4.12, 0.56
        last = first + stages * length
        end = last + 0.5
        # spaces with liquid: casing, inlet downward, outlet upward
        casing = _box(3.52, y - bore, end, y + bore)
        inlet, outlet = _box(3.6, 0.3, 3.96, y), _box(end - 0.42, y, end - 0.06, 2.72)
        d.chambers(axes, [casing, inlet, outlet], 0.07)
        for x0, y0 in ((3.5, 0.18), (end - 0.52, 2.68)):  # open ends
            axes.add_patch(Rectangle((x0, y0), 0.6, 0.14, fc="white", ec="none", zorder=1.2))
        for x0, y0 in ((3.48, 0.3), (end - 0.54, 2.62)):  # flanges
            for x1 in (x0, x0 + 0.48):
                d.area(axes, _box(x1, y0, x1 + 0.12, y0 + 0.07), d.METAL, width=0.7, zorder=1.3)
        for k in range(stages):
            for sign in (1, -1):
                _stage(axes, (first + k * length, y), sign, length, bore, k == stages - 1)
        # shaft from motor to last stage, coupling, motor
        d.area(axes, _box(0.3, y - shaft, last - 0.06, y + shaft), "#8C8C8C", width=0.7, zorder=4)
        for sign in (1, -1):
            d.area(axes, _box(3.38, y + sign * shaft, 3.53, y + sign * 0.2), "#5A5A5A", width=0.6, zorder=4)
            stator = _box(0.62, y + sign * 0.42, 2.0, y + sign * 0.72)
            d.area(axes, stator, "#CFE2EE", width=0.8, hatch="////", zorder=2)
            d.area(axes, _box(0.7, y + sign * shaft, 1.92, y + sign * 0.36), d.ROTATING, width=0.8, zorder=2)
        d.area(axes, _box(0.42, y - 0.8, 2.2, y + 0.8), "none", width=1.4, zorder=3)
        for x in (2.62, 2.82):
            d.area(axes, _box(x, y - 0.26, x + 0.17, y + 0.26), d.ROTATING, width=0.8, zorder=5)
        # flow
        d.arrow(
            axes, d.smooth([(3.78, 0.16), (3.78, 0.7), (3.8, 1.1), (3.95, 1.33), (4.13, 1.345)]), FLOW, 1.5, zorder=6
        )
        d.arrow(axes, [(end - 0.24, y + 0.5), (end - 0.24, 2.95)], FLOW, 1.5, zorder=6)
        for k in range(stages):
            for sign in (1, -1):
                _stage_flow(axes, (first + k * length, y), sign, length, k == stages - 1)
        turn = np.linspace(-1.35, 1.35, 40)
        d.arrow(axes, np.column_stack((2.4 + 0.09 * np.cos(turn), y + 0.3 * np.sin(turn))), BLADE, 1.4, zorder=6)
        d.label(axes, (2.41, y - 0.45), r"$\omega_r$", d.SYMBOLS)
        # names
        d.label(axes, (1.3, 2.6), "Electrical motor", weight="bold")
        d.leader(axes, "stator", (0.85, 0.42), (0.95, y - 0.58), (0.85, 0.5), size=d.NOTES)
        d.leader(axes, "rotor", (1.65, 0.42), (1.6, y - 0.24), (1.65, 0.5), size=d.NOTES)
        d.leader(axes, "Shaft\nconnection", (2.81, 2.15), (2.81, y + 0.22), (2.81, 2.0))
        d.label(axes, (4.55, 2.6), "Centrifugal pump", weight="bold")
        for k in range(stages):
            d.wire(axes, [(4.95, 0.5), (first + k * length + 0.2, y - 0.4)], d.INK, 0.6, zorder=8)
            d.dot(axes, (first + k * length + 0.2, y - 0.4), 0.018)
        d.label(axes, (4.95, 0.41), "Impellers")
        d.label(axes, (3.4, 0.42), "Inlet", ha="right")
        d.label(axes, (end - 0.62, 2.75), "Outlet", ha="right")
    return figure


def _box(x0: float, y0: float, x1: float, y1: float) -> Array:
    return np.array([(x0, y0), (x1, y0), (x1, y1), (x0, y1)])


def _stage(axes: Axes, origin: Point, sign: int, length: float, bore: float, last: bool) -> None:
    """Half of a stage: wall with the eye, impeller and, except at the last stage, the guide to the next."""

    def at(points: ArrayLike) -> Array:
        return np.array(origin) + np.asarray(points) * (length / 0.46, sign)

    wall = [(0, 0.25), (0.04, 0.25), (0.04, bore), (0, bore)]
    d.area(axes, at(wall), d.METAL, width=0.6, zorder=2)
    front = d.smooth([(0.0, 0.225), (0.06, 0.228), (0.12, 0.265), (0.15, 0.36), (0.155, 0.54)])
    back = d.smooth([(0.06, 0.075), (0.15, 0.1), (0.21, 0.2), (0.23, 0.34), (0.23, 0.54)])
    d.area(axes, at(np.vstack((front[20:], back[::-1]))), d.ROTATING, "none", zorder=3)
    for shroud in (front, back):
        d.wire(axes, at(shroud), d.INK, 1.6)
    if not last:
        d.area(axes, at([(0.29, 0.1), (0.33, 0.1), (0.33, 0.61), (0.29, 0.61)]), d.METAL, width=0.6, zorder=2)


def _stage_flow(axes: Axes, origin: Point, sign: int, length: float, last: bool) -> None:
    path = [(-0.03, 0.155), (0.08, 0.16), (0.165, 0.25), (0.19, 0.4), (0.2, 0.55)]
    path += [(0.27, 0.65), (0.56, 0.66)] if last else [(0.26, 0.665), (0.35, 0.65), (0.39, 0.5), (0.395, 0.22)]
    points = np.array(origin) + np.array(path) * (length / 0.46, sign)
    d.arrow(axes, d.smooth(points), FLOW, 1.1, head=0.09, zorder=6)


# half of a meridional section, (axial, radial) in units of the outer radius r_2; the axial direction points upstream
_EYE = 0.44
_HUB = [(-0.07, 1.0), (-0.07, 0.6), (-0.03, 0.38), (0.08, 0.24), (0.24, 0.17), (0.3, 0.1)]
_SHROUD_IN = [(0.07, 1.0), (0.09, 0.68), (0.16, 0.53), (0.26, 0.455), (0.44, _EYE)]
_SHROUD_OUT = [(0.44, 0.5), (0.3, 0.515), (0.22, 0.58), (0.15, 0.72), (0.13, 1.0)]
_CAVITY = [(-0.24, 0.0), (-0.24, 1.07), (0.24, 1.07), (0.26, 0.75), (0.33, 0.62), (0.37, 0.55), (0.5, 0.55), (0.5, 0.0)]


def _meridional(
    axes: Axes,
    origin: Point,
    scale: float,
    upstream: int,
    pipe: float,
    rims: tuple[float, float],
    outlet: float | None = None,
) -> None:
    """Section through one stage: casing with diffuser and volute, impeller, shaft.

    `upstream` is the direction of the inlet along x, `pipe` the length of the inlet pipe and `rims` the
    radial depth of the volute above and below the axis, both in units of r_2. Up to the height `outlet`
    on the page, if given, the upper volute goes on as the outlet.
    """

    def at(points: ArrayLike, sign: int) -> Array:
        return np.array(origin) + scale * np.array(points) * (upstream, sign)

    spaces = [at([(0.48, -_EYE), (pipe, -_EYE), (pipe, _EYE), (0.48, _EYE)], 1)]
    for sign, depth in zip((1, -1), rims, strict=True):
        diffuser = [(-0.1, 1.0), (-0.1, 1.4), (0.1, 1.4), (0.1, 1.0)]
        half = 0.5 * depth
        volute = [(half * math.cos(t), 1.34 + half + half * math.sin(t)) for t in np.linspace(-math.pi, math.pi, 97)]
        if sign == 1 and outlet is not None:
            end = (outlet - origin[1]) / scale
            volute = [*volute[:49], (half, end), (-half, end)]
        spaces += [at(_CAVITY, sign), at(diffuser, sign), at(volute, sign)]
    d.chambers(axes, spaces, 0.07)
    face = at([(pipe, 0.0)], 1)[0]
    cut = _box(face[0], face[1] - 0.75 * scale, face[0] + upstream * 0.12, face[1] + 0.75 * scale)
    d.area(axes, cut, "white", "none", zorder=1.2)
    hub, inside, outside = (d.smooth(curve) for curve in (_HUB, _SHROUD_IN, _SHROUD_OUT))
    for sign in (1, -1):
        d.area(axes, at(np.vstack((hub, [(-0.13, 0.1), (-0.13, 1.0)])), sign), d.METAL, width=0.7)
        d.area(axes, at(np.vstack((inside, outside)), sign), d.METAL, width=0.7)
        blade = np.vstack((hub[:52], inside[:34][::-1]))
        d.area(axes, at(blade, sign), d.ROTATING, width=0.6, zorder=2.5)
    d.area(axes, at([(-0.75, -0.1), (0.3, -0.1), (0.3, 0.1), (-0.75, 0.1)], 1), "#8C8C8C", width=0.7, zorder=3.5)
    centre = at([(-0.85, 0.0), (pipe + 0.1, 0.0)], 1)
    d.wire(axes, centre, COLOURS["grey"], 0.7, "-.", zorder=6)


def impeller_section() -> Figure:
    """Single stage of a centrifugal pump from the front and from the side.

    Returns
    -------
    Figure

    References
    ----------
    Thesis figure 3.5 (own drawing).
    """
    with style():
        figure, axes = d.sheet(PAGE, 3.9)
        scale, centre = 0.78, (2.2, 1.75)
        base, growth = 1.34, 0.62  # volute: radius of the wall in units of r_2, and how far it opens in a turn
        phi = np.linspace(math.radians(22), 2 * math.pi, 181)  # from the cut-water once around
        radius = scale * (base + growth * phi / (2 * math.pi))
        spiral = np.column_stack((centre[0] + radius * np.cos(phi), centre[1] + radius * np.sin(phi)))
        top = 3.45
        inner, outer = centre[0] + scale * (base + 0.03), centre[0] + scale * (base + growth)
        d.chambers(axes, [np.vstack((spiral, [(outer, top), (inner, top)]))], 0.06)
        d.area(axes, _box(inner - 0.1, top, outer + 0.1, top + 0.12), "white", "none", zorder=1.2)
        for r, face in ((1.3, "#BFDDF0"), (1.0, d.ROTATING), (_EYE, d.LIQUID), (0.12, "#8C8C8C")):
            d.area(axes, d.arc(centre, scale * r, 0, 2 * math.pi), face, d.INK, 0.8, zorder=2)
        _blades(axes, centre, scale, 7)
        d.arrow(axes, d.arc(centre, 0.24 * scale, math.radians(-60), math.radians(200)), BLADE, 1.3, zorder=6)
        d.arrow(axes, [(0.5 * (inner + outer), 2.55), (0.5 * (inner + outer), 3.3)], FLOW, 1.6)
        d.arrow(axes, d.arc(centre, scale * 1.58, math.radians(205), math.radians(250)), FLOW, 1.3)
        d.label(axes, (0.1, 3.75), "Top view", ha="left", weight="bold")
        d.leader(axes, "Volute", (0.3, 0.35), d.turned((1.42 * scale, 0), centre, 3.75), (0.38, 0.43))
        d.leader(axes, "Outlet", (2.6, 3.55), (inner + 0.15, 3.15), (2.75, 3.47))
        d.leader(axes, "Diffuser", (0.55, 3.2), d.turned((1.15 * scale, 0), centre, 2.3), (0.7, 3.12))
        d.leader(axes, "Impeller", (1.35, 3.45), d.turned((0.72 * scale, 0), centre, 1.9), (1.45, 3.37))
        d.leader(axes, "Impeller eye", (0.42, 2.75), d.turned((0.35 * scale, 0), centre, 2.75), (0.75, 2.67))
        # side view: section in the vertical plane, seen so that the inlet is on the right
        origin = (5.3, centre[1])
        d.area(axes, _box(origin[0] - 0.24, 2.45, origin[0] + 0.24, top), d.METAL, width=0.8, zorder=0.5)
        d.area(axes, _box(origin[0] - 0.18, 2.45, origin[0] + 0.18, top), d.LIQUID, width=0.8, zorder=0.6)
        _meridional(axes, origin, scale, 1, 1.9, (0.22, 0.52))
        d.label(axes, (3.95, 3.75), "Side view", ha="left", weight="bold")
        d.arrow(
            axes,
            [(origin[0] + 2.05 * scale, origin[1] + 0.2), (origin[0] + 0.75 * scale, origin[1] + 0.2)],
            FLOW,
            1.6,
            zorder=6,
        )
        d.arrow(axes, [(origin[0], 3.05), (origin[0], 3.6)], FLOW, 1.6)
        d.leader(axes, "Volute", (6.3, 0.35), (origin[0] + 0.08, origin[1] - 1.6 * scale), (6.05, 0.38))
        d.leader(axes, "Diffuser", (6.35, 2.95), (origin[0] + 0.04, origin[1] + 1.2 * scale), (6.08, 2.93))
        d.leader(axes, "Impeller", (4.25, 2.6), (origin[0] + 0.0, origin[1] + 0.8 * scale), (4.5, 2.55))
        d.leader(axes, "Impeller eye", (6.3, 2.55), (origin[0] + 0.42 * scale, origin[1] + 0.36 * scale), (6.0, 2.47))
        d.leader(axes, "Outlet", (6.1, 3.4), (origin[0] + 0.12, 3.3), (5.85, 3.4))
    return figure


def _blades(axes: Axes, centre: Point, scale: float, count: int) -> None:
    """Backward-curved blades of a typical impeller between eye and rim, radii in units of r_2."""
    typical = Impeller(r_1=0.5, r_2=0.97, h=0.1, beta=(0.5, 0.5), sigma_s=0.8, K_s=0.0, K_f=0.0, K_d=0.0, K_n=0.0)
    for k in range(count):
        r, theta = blade_line(typical, 2 * math.pi * k / count)
        line = np.column_stack((r * np.cos(theta), r * np.sin(theta)))
        d.wire(axes, np.array(centre) + scale * line, BLADE, 2.0, zorder=5)


def leakage_sketch() -> Figure:
    """Flows inside one stage: main flow, flow through the impeller, leakage, and the pressures that drive them.

    H_i is the rise over the impeller, a H_i the part of it that acts on the leakage; H_inlet and H_outlet are the
    losses of the casing. The leakage q flows from the pressure to the suction side, Q_i = Q_p + q.

    Returns
    -------
    Figure

    References
    ----------
    Thesis figure 3.9 (own drawing), equation (3.25).
    """
    with style():
        figure, axes = d.sheet(PAGE, 4.35)
        scale, origin = 0.94, (4.05, 1.85)

        def at(z: float, r: float) -> Array:
            return np.array(origin) + scale * np.array((-z, r))

        _meridional(axes, origin, scale, -1, 3.1, (0.38, 0.38), 4.05)
        axes.add_patch(Rectangle((origin[0] - 0.4, 4.0), 0.8, 0.25, fc="white", ec="none", zorder=1.25))
        # flows
        d.arrow(axes, [at(3.5, 0.0), at(2.6, 0.0)], FLOW, 2.2, head=0.14, zorder=7)
        d.label(axes, at(3.7, 0.0), "$Q_p$", d.SYMBOLS + 1)
        d.arrow(axes, [(origin[0], 3.5), (origin[0], 4.2)], FLOW, 2.2, head=0.14, zorder=7)
        d.label(axes, (origin[0] + 0.24, 4.2), "$Q_p$", d.SYMBOLS + 1)
        d.label(axes, at(2.7, 0.62), "Inlet")
        d.label(axes, (origin[0] + 0.5, 3.85), "Outlet")
        for sign in (1, -1):
            path = [(0.85, 0.2), (0.5, 0.22), (0.25, 0.31), (0.1, 0.47), (0.02, 0.72), (0.0, 1.2)]
            d.arrow(axes, d.smooth([at(z, sign * r) for z, r in path]), FLOW, 1.8, head=0.12, zorder=7)
            leak = [(0.1, 1.08), (0.17, 1.02), (0.19, 0.8), (0.25, 0.65), (0.34, 0.54), (0.48, 0.52), (0.7, 0.35)]
            d.arrow(axes, d.smooth([at(z, sign * r) for z, r in leak]), LEAK, 1.5, (0, (3, 1.2)), 0.1, zorder=7)
        d.leader(axes, "$Q_i$", at(-0.62, 0.78), at(0.01, 0.78), at(-0.5, 0.78), size=d.SYMBOLS + 1)
        d.leader(axes, "$q$", at(0.66, 0.84), at(0.19, 0.84), at(0.57, 0.84), size=d.SYMBOLS + 1)
        # pressures, each between two marked points
        d.voltage(axes, at(2.95, -0.26), at(1.05, -0.26), r"$H_{\mathrm{inlet}}$", at(2.0, -0.26))
        for left, right in ((2.83, 2.27), (1.73, 1.17)):
            d.wire(axes, [at(left, -0.26), at(right, -0.26)], COLOURS["grey"], 0.7)
        _pressure(axes, at(0.0, 1.3), at(0.9, 0.33), at(1.5, 1.3), at(1.5, 0.68), "$H_i$")
        _pressure(axes, at(0.19, -1.0), at(0.78, -0.33), at(1.25, -1.0), at(1.25, -0.6), "$a H_i$")
        high = (4.0 - origin[1]) / scale
        _pressure(
            axes,
            at(0.0, 1.56),
            at(0.1, high - 0.04),
            at(0.75, 1.56),
            at(0.75, high - 0.04),
            r"$H_{\mathrm{outlet}}$",
            0.12,
        )
        notes = (
            ("$Q_p$", "main flow"),
            ("$Q_i$", "flow through the impeller,\n$Q_i = Q_p + q$"),
            ("$q$", "leakage, from the pressure\nto the suction side"),
            ("$H_i$", "rise over the impeller"),
            ("$a H_i$", "its share that drives $q$"),
            (r"$H_{\mathrm{inlet}}$", "loss of the inlet"),
            (r"$H_{\mathrm{outlet}}$", "loss of the outlet"),
        )
        y = 3.1
        for symbol, text in notes:
            d.label(axes, (5.2, y), symbol, d.SYMBOLS, ha="left", va="top")
            d.label(axes, (5.72, y), text, d.NOTES, ha="left", va="top", linespacing=1.2)
            y -= 0.24 + 0.14 * text.count("\n")
    return figure


def _pressure(axes: Axes, high: Array, low: Array, plus: Array, minus: Array, text: str, shift: float = 0.0) -> None:
    """Pressure between the points `high` and `low`, written at the ends `plus` and `minus` of two lines."""
    for point, end in ((high, plus), (low, minus)):
        d.dot(axes, point, 0.028)
        d.wire(axes, [point, np.array((point[0], end[1])), end], d.INK, 0.6, zorder=6)
    aside = np.array([0.1, 0.0])
    d.voltage(axes, plus - aside, minus - aside, text, 0.5 * (plus + minus) - aside - (shift, 0.0))
