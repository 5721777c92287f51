"""Thesis 3.3.1, 3.3.2: velocity triangles and the control volume of the impeller.

Drawn here after the captions and labels of figures 3.7 and 3.8; no drawing of the thesis survives. The impeller is
seen along the inlet flow and turns counter-clockwise; its blades are curved backward.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Annulus, Rectangle

from pumplib.errors import ParameterError
from pumplib.hydraulics.impeller import blade_angle, tangential_speed
from pumplib.machines.parameters import Impeller
from pumplib.plots import drawing as d
from pumplib.plots.drawing import Array, Point
from pumplib.plots.style import COLOURS, PAGE, style

BLADE = "#8A3C00"
COUNT = 6  # blades drawn
# the vectors of a velocity triangle: colour, line style and width, so that colour is not the only difference
VECTORS: dict[str, tuple[str, d.Line, float]] = {
    "U": (COLOURS["red"], "-", 1.5),
    "W": (COLOURS["green"], (0, (4, 1.6)), 1.5),
    "C": (COLOURS["blue"], "-", 2.2),
}


@dataclass(frozen=True, kw_only=True, slots=True)
class VelocityTriangle:
    """Speeds of the liquid at one radius, as vectors (tangential, radial) in m/s.

    Attributes
    ----------
    r : float
        Radius, m.
    beta : float
        Blade angle, rad.
    U : ndarray, shape (2,)
        Speed of the impeller.
    W : ndarray, shape (2,)
        Speed of the liquid relative to the impeller, along the blade.
    C : ndarray, shape (2,)
        Speed of the liquid, (c_x, c_r).
    """

    r: float
    beta: float
    U: Array
    W: Array
    C: Array


def triangle_at(impeller: Impeller, r: float, omega: float, Q: float) -> VelocityTriangle:
    """Velocity triangle at a radius.

    C comes from the model's tangential speed and from continuity, W from the direction of the blade; that
    C = U + W holds is a property, not a definition.

    Parameters
    ----------
    impeller : Impeller
        Geometry.
    r : float
        Radius, m.
    omega : float
        Shaft speed, rad/s.
    Q : float
        Flow through the impeller Q_i, m3/s.

    Returns
    -------
    VelocityTriangle

    Raises
    ------
    ParameterError
        If the radius lies outside the blades.

    References
    ----------
    Thesis (3.17), figure 3.7.
    """
    if not impeller.r_1 <= r <= impeller.r_2:
        raise ParameterError(f"r = {r:g} m: must lie between r_1 = {impeller.r_1:g} m and r_2 = {impeller.r_2:g} m.")
    radius = np.array(r)
    beta = float(blade_angle(impeller, radius))
    c_x = float(tangential_speed(impeller, radius, np.array(omega), np.array(Q)))
    c_r = Q / (2 * math.pi * r * impeller.h)
    along = c_r / math.sin(beta)  # |W|: its radial part is c_r
    return VelocityTriangle(
        r=r,
        beta=beta,
        U=np.array([r * omega, 0.0]),
        W=along * np.array([-math.cos(beta), math.sin(beta)]),
        C=np.array([c_x, c_r]),
    )


def blade_line(impeller: Impeller, start: float = 0.0, points: int = 201) -> tuple[Array, Array]:
    """Centre line of a blade, d theta/dr = -cot(beta)/r for counter-clockwise rotation.

    Parameters
    ----------
    impeller : Impeller
        Geometry.
    start : float
        Polar angle of the inlet edge, rad.
    points : int
        Number of points.

    Returns
    -------
    tuple of ndarray, each shape (points,)
        Radius in m and polar angle in rad; the angle falls with the radius: the blade leans against the rotation.
    """
    r = np.linspace(impeller.r_1, impeller.r_2, points)
    slope = -1 / (np.tan(blade_angle(impeller, r)) * r)
    steps = 0.5 * (slope[1:] + slope[:-1]) * np.diff(r)
    return r, start + np.concatenate(([0.0], np.cumsum(steps)))


def velocity_triangle(impeller: Impeller, omega: float, Q: float) -> Figure:
    """Velocity triangles at inlet and outlet of the blades, each with its own scale.

    Parameters
    ----------
    impeller : Impeller
        Geometry.
    omega : float
        Shaft speed, rad/s.
    Q : float
        Flow through the impeller Q_i, m3/s.

    Returns
    -------
    Figure

    Raises
    ------
    ParameterError
        If speed or flow is not positive.

    References
    ----------
    Thesis figure 3.7, equation (3.17).
    """
    if not (omega > 0 and Q > 0):
        raise ParameterError(f"omega = {omega:g} rad/s, Q = {Q:g} m3/s: both must be > 0 for a velocity triangle.")
    triangles = [triangle_at(impeller, r, omega, Q) for r in (impeller.r_1, impeller.r_2)]
    with style():
        figure, axes = d.sheet(PAGE, 4.2)
        d.label(axes, (0.08, 4.05), "Impeller seen from the inlet", ha="left", weight="bold")
        _impeller_front(axes, impeller, (1.5, 2.1), 1.3, triangles)
        for t, y, part, name in zip(triangles, (2.7, 0.8), "ab", ("inlet", "outlet"), strict=True):
            k = 1 if part == "a" else 2
            high, low = max(t.U[0], t.C[0]), min(t.C[0], 0.0)
            per_speed = min(3.35 / (high - low), 1.0 / t.C[1])  # in per m/s
            _one_triangle(axes, t, (5.2 + 0.5 * per_speed * (high + low), y), per_speed, k)
            top = y + 1.35 if k == 1 else y + min(1.3, per_speed * t.C[1] + 0.35)
            heading = f"({part}) Blade {name}, $r_{k}$ = {1e3 * t.r:.3g} mm"
            d.label(axes, (3.3, top), heading, ha="left", weight="bold")
            steps = [step * 10.0**power for power in range(-5, 4) for step in (1, 2, 5)]
            unit = max(step for step in steps if step * per_speed < 1.2)
            left = 6.6 - unit * per_speed
            d.dimension(axes, (left, top), (6.6, top), f"{unit:g} m/s", (6.65, top), size=d.NOTES, ha="left")
    return figure


def _one_triangle(axes: Axes, t: VelocityTriangle, origin: Point, scale: float, k: int) -> None:
    """Triangle with the tangential direction to the left and the radial direction upward."""

    def at(v: Any) -> Array:
        return np.array((origin[0] - scale * v[0], origin[1] + scale * v[1]))

    zero, U, C = at((0, 0)), at(t.U), at(t.C)
    foot = at((t.C[0], 0))
    centroid = (zero + U + C) / 3
    _vector(axes, "U", zero, U)
    _vector(axes, "W", U, C)
    _vector(axes, "C", zero, C)
    for name, start, stop in (("W", U, C), ("C", zero, C)):
        normal = np.array([start[1] - stop[1], stop[0] - start[0]]) / np.linalg.norm(stop - start)
        middle = 0.5 * (start + stop)
        normal *= np.sign(normal @ (middle - centroid)) or 1.0
        if name == "C" and -0.5 < scale * t.C[0] <= 0:  # inside: there is no room beside the drop line
            normal *= -1
        d.label(axes, middle + 0.14 * normal, f"${name}_{k}$", d.SYMBOLS, color=VECTORS[name][0])
    middle = 0.5 * (zero + U)
    if abs(middle[0] - C[0]) < 0.2:  # the drop line of C would cross the label
        middle = 0.25 * zero + 0.75 * U
    d.label(axes, middle - (0, 0.13), f"$U_{k}$", d.SYMBOLS, color=VECTORS["U"][0])
    # components of C
    low = origin[1] - 0.3
    wide = abs(C[0] - zero[0]) > 0.25
    for x, top in ((zero[0], origin[1]), (C[0], C[1])):
        d.wire(axes, [(x, top), (x, low - 0.05)], COLOURS["grey"], 0.7, ":", zorder=3)
    if wide:
        d.arrow(axes, [(zero[0], low), (C[0], low)], d.INK, 0.9, head=0.08)
    d.label(axes, (0.5 * (zero[0] + C[0]), low - 0.13), rf"$C_{{x{k}}}$", d.SYMBOLS)
    # C_r on the drop line; outside the triangle if C points against U
    outside = 0.14 if t.C[0] <= 0 else 0.0
    if outside:
        for y in (zero[1], C[1]):
            d.wire(axes, [(C[0], y), (C[0] + outside + 0.05, y)], COLOURS["grey"], 0.7, ":", zorder=3)
    aside = np.array((outside, 0.0))
    d.arrow(axes, [foot + aside, C + aside], d.INK, 0.9, head=0.08)
    place = 0.5 * (foot + C) + aside + ((0.19, 0) if t.C[0] <= 0 or scale * t.C[0] > 0.5 else (-0.19, 0))
    if C[1] - foot[1] < 0.25:  # too flat for a label inside
        place = foot + np.array((0.19, -0.14))
    d.label(axes, place, rf"$C_{{r{k}}}$", d.SYMBOLS)
    # blade angle between W and the direction against U
    radius = min(0.42, 0.5 * scale * abs(t.W[0]))
    if radius * math.sin(t.beta) > 0.1:
        d.wire(axes, d.arc((U[0], U[1]), radius, 0, t.beta), d.INK, 0.8)
        d.label(axes, U + _polar(radius + 0.12, t.beta / 2), rf"$\beta_{k}$", d.WORDS)
    values = {"U": t.U[0], "W": float(np.hypot(*t.W)), "C": float(np.hypot(*t.C)), "C_x": t.C[0], "C_r": t.C[1]}
    numbers = ",  ".join(f"${name} = {value:.3g}$" for name, value in values.items())
    d.label(
        axes,
        (3.3, origin[1] - 0.6),
        numbers + rf" m/s,  $\beta_{k}$ = {math.degrees(t.beta):.3g}°",
        d.NOTES,
        ha="left",
    )


def _vector(axes: Axes, name: str, start: Any, stop: Any, part: float = 1.0) -> None:
    colour, line, width = VECTORS[name]
    head = min(0.12 * part, 0.6 * float(np.linalg.norm(np.subtract(stop, start))))
    d.arrow(axes, [start, stop], colour, part * width, line, head, zorder=5 + (name == "C"))


def _polar(r: Any, theta: Any) -> Array:
    return np.stack((r * np.cos(theta), r * np.sin(theta)), axis=-1)


def _wheel(axes: Axes, impeller: Impeller, centre: Point, scale: float, start: float, count: int) -> None:
    """Rim, eye and blades, the first with its inlet edge at the angle `start`; `scale` in inches per metre."""
    for edge in (impeller.r_1, impeller.r_2):
        d.wire(axes, d.arc(centre, scale * edge, 0, 2 * math.pi), d.INK, 1.0, zorder=3)
    for k in range(count):
        r, theta = blade_line(impeller, start + 2 * math.pi * k / count)
        d.wire(axes, np.array(centre) + scale * _polar(r, theta), BLADE, 2.2, zorder=4)


def _impeller_front(axes: Axes, impeller: Impeller, centre: Point, radius: float, both: list[VelocityTriangle]) -> None:
    """Impeller to scale with the two triangles in place on one blade."""
    scale = radius / impeller.r_2
    wrap = blade_line(impeller)[1][-1]
    stop = math.radians(-30)
    start = stop - wrap
    axes.add_patch(Annulus(centre, radius, radius - scale * impeller.r_1, fc=d.LIQUID, ec="none", zorder=1))
    _wheel(axes, impeller, centre, scale, start, COUNT)
    longest = max(float(np.hypot(*v)) for t in both for v in (t.U, t.W, t.C))
    for t, angle, name in zip(both, (start, stop), ("1", "2"), strict=True):
        origin = np.array(centre) + scale * _polar(t.r, angle)
        frame = np.array([[-math.sin(angle), math.cos(angle)], [math.cos(angle), math.sin(angle)]])
        unit = 0.95 / longest
        U, C = origin + unit * t.U @ frame, origin + unit * t.C @ frame
        _vector(axes, "U", origin, U, 0.75)
        _vector(axes, "W", U, C, 0.75)
        _vector(axes, "C", origin, C, 0.75)
        d.dot(axes, origin, 0.03)
        aside = _polar(0.13, angle + math.pi) if name == "1" else _polar(0.16, angle - 0.6)
        d.label(axes, origin + aside, name, d.WORDS, weight="bold")
    d.arrow(axes, d.arc(centre, 0.5 * scale * impeller.r_1, math.radians(150), math.radians(400)), d.INK, 1.2)
    d.label(axes, centre, r"$\omega_r$", d.SYMBOLS)


def control_volume(impeller: Impeller) -> Figure:
    """Control volume of the impeller, with blades from its blade angles, and the speeds at one point of a blade.

    Parameters
    ----------
    impeller : Impeller
        Geometry; the views are to scale. The speeds only show directions, for a flow with c_r = u/4.

    Returns
    -------
    Figure

    References
    ----------
    Thesis figure 3.8, equations (3.14)-(3.17).
    """
    with style():
        figure, axes = d.sheet(PAGE, 3.75)
        radius, centre = 1.22, (1.5, 1.62)
        scale = radius / impeller.r_2
        eye = scale * impeller.r_1
        wrap = blade_line(impeller)[1][-1]
        out = math.radians(62)
        start = out - wrap
        d.label(axes, (0.08, 3.58), "(a) Control volume", ha="left", weight="bold")
        d.label(axes, (4.1, 3.58), "(b) Speeds at a point of the blade", ha="left", weight="bold")
        shade: dict[str, Any] = {"fc": d.LIQUID, "ec": "#9CC3DA", "hatch": "////", "lw": 0.0, "zorder": 1}
        axes.add_patch(Annulus(centre, radius, radius - eye, **shade))
        _wheel(axes, impeller, centre, scale, start + math.pi / COUNT, COUNT)
        # a small mass enters at the inlet and leaves at the outlet of the channel
        for low, angle, width in ((eye - 0.09, start, 0.26), (radius, out, 0.09)):
            inner, outer = (d.arc(centre, edge, angle - width, angle + width) for edge in (low, low + 0.09))
            d.area(axes, np.vstack((inner, outer[::-1])), COLOURS["sky"], width=0.7, zorder=5)
        r, theta = blade_line(impeller, start)
        d.wire(axes, np.array(centre) + scale * _polar(r, theta), COLOURS["blue"], 1.0, "--", zorder=5)
        speeds = _illustration(float(blade_angle(impeller, np.array(impeller.r_2))))
        frame = np.array([[-math.sin(out), math.cos(out)], [math.cos(out), math.sin(out)]])
        tip = centre + _polar(radius + 0.09, out)
        d.arrow(axes, [tip, tip + 1.35 * speeds["C"] @ frame], VECTORS["C"][0], 1.8, zorder=6)
        d.arrow(axes, [centre + _polar(0.06, start), centre + _polar(eye - 0.1, start)], VECTORS["C"][0], 1.8, zorder=6)
        # side view of the control volume on the same scale
        x, width = 3.25, max(scale * impeller.h, 0.06)
        for low in (eye, -radius):
            axes.add_patch(
                Rectangle((x, centre[1] + low), width, radius - eye, **(shade | {"lw": 0.9, "ec": "#5E8BA5"}))
            )
        d.wire(axes, [(x - 0.15, centre[1]), (x + 0.75, centre[1])], COLOURS["grey"], 0.7, "-.")
        for length, at, name in ((eye, x + 0.3, "$r_1$"), (radius, x + 0.6, "$r_2$")):
            level = centre[1] + length
            d.wire(axes, [(x + width + 0.02, level), (at + 0.05, level)], COLOURS["grey"], 0.7)
            d.dimension(axes, (at, centre[1]), (at, level), name, (at + 0.13, centre[1] + 0.5 * length))
        top = centre[1] + radius + 0.1
        for edge, side in ((x, -1), (x + width, 1)):
            d.wire(axes, [(edge, top - 0.06), (edge, top + 0.06)], d.INK, 0.6)
            d.arrow(axes, [(edge + 0.22 * side, top), (edge, top)], d.INK, 0.7, head=0.075)
        d.label(axes, (x + 0.5 * width, top + 0.16), "$h$", d.SYMBOLS)
        middle = 0.5 * (radius + eye)
        hub = np.array(centre)
        d.label(axes, tip + 1.35 * speeds["C"] @ frame - (0.16, 0.0), "$C_2$", d.SYMBOLS)
        d.label(axes, hub + _polar(radius + 0.27, out - 0.02), "$dm$", d.SYMBOLS, ha="left")
        aside = start - math.pi / 2
        d.label(axes, hub + _polar(0.1, start) + _polar(0.15, aside), "$C_1$", d.SYMBOLS)
        d.label(axes, hub + _polar(0.17, start) - _polar(0.15, aside), "$dm$", d.SYMBOLS)
        d.label(axes, hub + _polar(middle, -1.05), "$V$", d.SYMBOLS + 1, bbox={"fc": "white", "ec": "none", "pad": 1.2})
        d.leader(axes, "outlet $A_2$", (2.5, 0.45), hub + _polar(radius, -0.75), (2.48, 0.53), ha="left")
        d.leader(axes, "inlet $A_1$", (0.2, 3.1), hub + _polar(eye, 2.3), (0.45, 3.0), ha="left")
        d.arrow(axes, d.arc(centre, radius + 0.13, 3.6, 4.3), d.INK, 1.2)
        d.label(axes, hub + _polar(radius + 0.31, 3.95), r"$\omega_r$", d.SYMBOLS)
        _speeds_at_blade(axes, impeller)
    return figure


def _illustration(beta: float) -> dict[str, Array]:
    """Speeds for c_r = u/4 relative to u, (tangential, radial)."""
    W = 0.25 * np.array((-1 / math.tan(beta), 1.0))
    return {"U": np.array((1.0, 0.0)), "W": W, "C": np.array((1.0, 0.0)) + W}


def _speeds_at_blade(axes: Axes, impeller: Impeller) -> None:
    """Panel (b): blade, U, W and C from one point as a parallelogram, tangential to the left."""
    middle = 0.5 * (impeller.r_1 + impeller.r_2)
    beta = float(blade_angle(impeller, np.array(middle)))
    speeds = _illustration(beta)
    unit = 2.7 / (1.0 - speeds["W"][0])
    point = np.array((4.25 + unit, 1.95))
    radial = np.array((0.0, 1.0))

    def near(x: float, y: float) -> Array:
        return point + np.array((x, y))

    def at(tangential: float, up: float) -> Array:
        return point + unit * np.array((-tangential, up))

    # the blade, enlarged; its middle is the point
    r = np.linspace(-0.24, 0.11, 60) * (impeller.r_2 - impeller.r_1) + middle
    line, angle = blade_line(impeller)
    angle = np.interp(r, line, angle) - np.interp(middle, line, angle) + math.pi / 2
    enlarged = 1.9 / (impeller.r_2 - impeller.r_1)
    d.wire(axes, point + enlarged * (_polar(r, angle) - middle * radial), BLADE, 3.0, zorder=3)
    U, W, C = (at(*speeds[name]) for name in ("U", "W", "C"))
    for name, end in (("U", U), ("W", W), ("C", C)):
        _vector(axes, name, point, end)
    for start, end in ((U, C), (W, C), (point, near(0.95, 0))):
        d.wire(axes, [start, end], COLOURS["grey"], 0.8, "--", zorder=3)
    d.dot(axes, point, 0.03)
    d.label(axes, 0.8 * U + 0.2 * point - (0, 0.14), "$U$", d.SYMBOLS, color=VECTORS["U"][0])
    d.label(axes, W + np.array((0.02, 0.14)), "$W$", d.SYMBOLS, color=VECTORS["W"][0])
    d.label(axes, 0.5 * (point + C) + np.array((0.15, 0.06)), "$C$", d.SYMBOLS, color=VECTORS["C"][0])
    foot, high = np.array((C[0], point[1])), C[1] + 0.25
    d.arrow(axes, [foot, C], d.INK, 0.9, head=0.08)
    d.label(axes, 0.5 * (foot + C) - (0.16, 0.02), "$C_r$", d.SYMBOLS)
    for x, low in ((point[0], point[1]), (C[0], C[1])):
        d.wire(axes, [(x, low), (x, high + 0.05)], COLOURS["grey"], 0.7, ":", zorder=3)
    d.arrow(axes, [(point[0], high), (C[0], high)], d.INK, 0.9, head=0.08)
    d.label(axes, (0.5 * (point[0] + C[0]), high + 0.14), "$C_x$", d.SYMBOLS)
    d.wire(axes, d.arc((point[0], point[1]), 0.62, 0.0, beta), d.INK, 0.8)
    d.label(axes, point + _polar(0.74, beta / 2), r"$\beta$", d.SYMBOLS)
    d.arrow(axes, [near(0, -1.2), near(0, -0.04)], COLOURS["grey"], 0.8, head=0.08, zorder=2)
    d.label(axes, near(0.12, -0.85), "$r$", d.SYMBOLS)
    inner = point + enlarged * (_polar(r[12], angle[12]) - middle * radial)
    d.leader(axes, "blade", inner - np.array((0.45, 0.3)), inner, inner - np.array((0.3, 0.21)))
    d.label(axes, (4.15, 0.85), r"$C_x = U - C_r\,\cot\beta$", d.SYMBOLS, ha="left")
    d.label(axes, (4.15, 0.52), r"$C_r = Q_i / A_r,\quad A_r = 2\pi r h$", d.SYMBOLS, ha="left")
