"""Thesis 3.1, 3.2.1, 3.2.3, 3.3, 3.3.4: signal-flow, circuit and hydraulic diagrams of the pump set.

Drawn here after the captions and labels of figures 3.2, 3.3, 3.4, 3.6 and 3.10; no drawing of the thesis survives.
"""

import math
from itertools import pairwise

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from pumplib.errors import ParameterError
from pumplib.plots import drawing as d
from pumplib.plots.style import COLOURS, COLUMN, PAGE, style

STATOR, ROTOR, WATER = COLOURS["blue"], COLOURS["red"], COLOURS["blue"]
PHASES = ("a", "b", "c")


def signal_flow() -> Figure:
    """Signals between motor, shaft, hydraulics and application.

    The load torque is written T_p as in the equations; the figure of the thesis prints T_l.

    Returns
    -------
    Figure

    References
    ----------
    Thesis figure 3.2.
    """
    with style():
        figure, axes = d.sheet(PAGE, 1.95)
        y, step, size = 0.85, 0.17, (1.12, 0.86)
        centres = (1.38, 3.0, 4.62, 6.5)
        axes.add_patch(Rectangle((0.68, 0.22), 4.64, 1.34, fc="none", ec=COLOURS["grey"], lw=0.9, ls="--", zorder=1))
        d.label(axes, (0.68, 1.7), "The centrifugal pump", ha="left", weight="bold")
        texts = (
            "Electrical part\nof the motor",
            "Mechanical part\nof the motor\nand the pump",
            "Hydraulic part\nof the pump",
            "Hydraulic\napplication",
        )
        faces = ("white", d.ROTATING, d.LIQUID, d.LIQUID)
        for x, text, face in zip(centres, texts, faces, strict=True):
            d.block(axes, (x, y), size, text, face, "--" if x == centres[-1] else "-")
        half = size[0] / 2
        upper, lower = y + step, y - step
        left = centres[0] - half
        d.arrow(axes, [(0.1, upper), (left, upper)], STATOR)
        d.label(axes, (0.36, upper + 0.13), r"$v_{abc}$", d.SYMBOLS)
        d.arrow(axes, [(left, lower), (0.1, lower)], STATOR)
        d.label(axes, (0.36, lower - 0.13), r"$i_{abc}$", d.SYMBOLS)
        pairs = ((r"$T_e$", r"$\omega_r$"), (r"$\omega_r$", r"$T_p$"), (r"$H$", r"$Q$"))
        for (a, b), (forward, back), colour in zip(pairwise(centres), pairs, (ROTOR, ROTOR, WATER), strict=True):
            begin, end = a + half, b - half
            middle = 0.5 * (begin + end) if b != centres[-1] else 5.62
            d.arrow(axes, [(begin, upper), (end, upper)], colour)
            d.label(axes, (middle, upper + 0.13), forward, d.SYMBOLS)
            d.arrow(axes, [(end, lower), (begin, lower)], colour)
            d.label(axes, (middle, lower - 0.13), back, d.SYMBOLS)
    return figure


def hydraulic_block() -> Figure:
    """Inputs and outputs of the hydraulic part of the pump.

    Returns
    -------
    Figure

    References
    ----------
    Thesis figure 3.6.
    """
    with style():
        figure, axes = d.sheet(COLUMN, 1.15)
        d.block(axes, (1.75, 0.575), (1.3, 0.86), "Hydraulic part\nof the pump", d.LIQUID)
        for y, text, colour, inside in (
            (0.78, r"$Q_p$", WATER, "flow"),
            (0.37, r"$\omega_r$", ROTOR, "speed"),
        ):
            d.arrow(axes, [(0.5, y), (1.1, y)], colour)
            d.label(axes, (0.45, y), text, d.SYMBOLS + 1, ha="right")
            d.label(axes, (0.8, y + 0.1), inside, d.NOTES)
        for y, text, colour, inside in (
            (0.78, r"$H_p$", WATER, "pressure"),
            (0.37, r"$T_p$", ROTOR, "torque"),
        ):
            d.arrow(axes, [(2.4, y), (3.0, y)], colour)
            d.label(axes, (3.05, y), text, d.SYMBOLS + 1, ha="left")
            d.label(axes, (2.68, y + 0.1), inside, d.NOTES)
    return figure


def motor_circuit(theta: float = math.radians(40)) -> Figure:
    """Stator and rotor circuits of the induction motor on their magnetic axes.

    The rotor circuits are short-circuited each on itself, as in (3.1). Angles count counter-clockwise.

    Parameters
    ----------
    theta : float
        Electrical angle z_p theta_r between stator and rotor phases, rad; from 0.5 to 1.2, so that the labels fit.

    Returns
    -------
    Figure

    Raises
    ------
    ParameterError
        If the angle is outside this range.

    References
    ----------
    Thesis figure 3.3, equations (3.1)-(3.3).
    """
    if not 0.5 <= theta <= 1.2:
        raise ParameterError(f"theta = {theta:g} rad: draw the motor at an angle from 0.5 to 1.2 rad.")
    with style():
        figure, axes = d.sheet(PAGE, 5.3)
        centre = (2.6, 2.65)
        for radius, face in ((2.5, "#F0F0F0"), (1.42, "white"), (1.22, d.ROTATING)):
            d.area(axes, d.arc(centre, radius, 0, 2 * math.pi), face, COLOURS["grey"], 0.9, zorder=1)
        d.dot(axes, centre, 0.035)
        for k, phase in enumerate(PHASES):
            _stator_circuit(axes, centre, k * 2 * math.pi / 3, phase)
            _rotor_circuit(axes, centre, theta + k * 2 * math.pi / 3, phase)
        # axes of the two phases a and the angle between them
        for angle, stop in ((0.0, 1.42), (theta, 1.75)):
            d.wire(axes, d.turned([(0, 0), (stop, 0)], centre, angle), COLOURS["grey"], 0.8, "-.", zorder=2)
        d.arrow(axes, d.arc(centre, 1.32, 0.0, theta), d.INK, 1.0)
        d.label(axes, d.turned((1.68, 0), centre, 0.56 * theta), r"$z_p\theta_r$", d.SYMBOLS + 1)
        d.arrow(axes, d.arc(centre, 1.32, math.radians(160), math.radians(198)), ROTOR, 1.6)
        d.label(axes, d.turned((1.66, 0), centre, math.pi), r"$z_p\omega_r$", d.SYMBOLS + 1)
        notes = (
            (4.62, "Stator, three circuits", "bold"),
            (4.3, r"$v_{sk} = r_s i_{sk} + \dfrac{d\psi_{sk}}{dt}$", "normal"),
            (1.62, "Rotor, three circuits,\neach short-circuited", "bold"),
            (1.2, r"$0 = r_r i_{rk} + \dfrac{d\psi_{rk}}{dt}$", "normal"),
            (0.68, "k = a, b, c. Axes of b and c\nat 120° and 240° from a,\ncounter-clockwise", "normal"),
        )
        for y, text, weight in notes:
            size = d.SYMBOLS + 0.5 if "$" in text else d.NOTES + 0.3
            d.label(axes, (5.5, y), text, size, ha="left", weight=weight, linespacing=1.3)
    return figure


def _stator_circuit(axes: Axes, centre: d.Point, angle: float, phase: str) -> None:
    """Terminals at the frame, winding on the axis at `angle`, return line beside it."""

    def at(x: float, y: float) -> np.ndarray:
        return d.turned((x, y), centre, angle)

    back, frame = -0.52, 2.5
    d.resistor(axes, at(2.24, 0), at(1.88, 0), STATOR, 0.25)
    d.coil(axes, at(1.5, 0), at(1.88, 0), STATOR, size=0.36)
    d.wire(axes, [at(1.5, 0), at(1.5, back), at(frame, back)], STATOR, 1.2)
    d.wire(axes, [at(frame, 0), at(2.24, 0)], STATOR, 1.2)
    d.arrow(axes, [at(2.42, 0), at(2.28, 0)], STATOR, 0.0)
    for y in (0.0, back):
        d.dot(axes, at(frame, y), 0.04, hollow=True)
    d.label(axes, at(2.36, 0.16), rf"$i_{{s{phase}}}$", d.SYMBOLS)
    d.label(axes, at(2.06, 0.17), "$r_s$", d.SYMBOLS)
    d.label(axes, at(1.78, back / 2 - 0.01), rf"$\dfrac{{d\psi_{{s{phase}}}}}{{dt}}$", d.SYMBOLS)
    d.voltage(axes, at(2.63, -0.01), at(2.63, back), rf"$v_{{s{phase}}}$", at(2.65, back / 2))


def _rotor_circuit(axes: Axes, centre: d.Point, angle: float, phase: str) -> None:
    """Closed loop of winding on the axis at `angle` and resistance."""

    def at(x: float, y: float) -> np.ndarray:
        return d.turned((x, y), centre, angle)

    inner, outer, back = 0.4, 1.08, -0.36
    d.coil(axes, at(inner, 0), at(outer, 0), ROTOR)
    d.resistor(axes, at(inner, back), at(outer, back), ROTOR, 0.28)
    d.wire(axes, [at(inner, 0), at(inner, back)], ROTOR, 1.2)
    d.wire(axes, [at(outer, 0), at(outer, back)], ROTOR, 1.2)
    d.arrow(axes, [at(outer, back), at(outer, back / 2 + 0.06)], ROTOR, 0.0)
    d.label(axes, at(0.91, back / 2 - 0.01), rf"$i_{{r{phase}}}$", d.SYMBOLS)
    d.label(axes, at(0.63, back / 2 - 0.02), "$r_r$", d.SYMBOLS)
    d.label(axes, at(0.74, 0.28), rf"$\dfrac{{d\psi_{{r{phase}}}}}{{dt}}$", d.SYMBOLS)


def connections() -> Figure:
    """Stator windings in Y and in delta connection.

    Terminal voltages count from the star point of the supply. Y: v_s = v_t - v_0 and i_t = i_s. Delta: winding a
    lies between terminals a and b, b between b and c, c between c and a, which is v_s = K v_t and i_t = K^T i_s.

    Returns
    -------
    Figure

    References
    ----------
    Thesis figure 3.4, equations (3.8)-(3.10).
    """
    with style():
        figure, axes = d.sheet(PAGE, 4.15)
        rows = (3.42, 2.4, 1.38)
        _terminals(axes, 0.0, rows)
        _terminals(axes, 3.75, rows)
        d.label(axes, (0.08, 3.98), "(a) Y connection", ha="left", weight="bold")
        d.label(axes, (3.83, 3.98), "(b) Delta connection", ha="left", weight="bold")
        # Y: windings in rows, star point on the right
        star = 3.12
        for y, phase in zip(rows, PHASES, strict=True):
            d.wire(axes, [(1.52, y), (1.72, y)], STATOR, 1.2)
            d.resistor(axes, (1.72, y), (2.16, y), STATOR, 0.26)
            d.coil(axes, (2.16, y), (2.66, y), STATOR)
            d.wire(axes, [(2.66, y), (star, y)], STATOR, 1.2)
            d.arrow(axes, [(2.75, y), (2.92, y)], STATOR, 0.0)
            d.label(axes, (2.88, y - 0.16), rf"$i_{{s{phase}}}$", d.SYMBOLS)
            d.label(axes, (1.93, y - 0.18), "$r_s$", d.SYMBOLS)
            d.label(axes, (2.4, y - 0.27), rf"$\dfrac{{d\psi_{{s{phase}}}}}{{dt}}$", d.SYMBOLS)
            d.voltage(axes, (1.76, y + 0.2), (2.64, y + 0.2), rf"$v_{{s{phase}}}$", (2.2, y + 0.22))
        d.wire(axes, [(star, rows[0]), (star, 1.0)], STATOR, 1.2)
        d.dot(axes, (star, rows[1]), 0.035)
        d.arrow(axes, [(star, 1.3), (star, 1.12)], STATOR, 0.0)
        d.dot(axes, (star, 0.98), 0.04, hollow=True)
        d.dot(axes, (star, 0.42), 0.04, hollow=True)
        d.voltage(axes, (star + 0.16, 0.98), (star + 0.16, 0.46), "$v_0$", (star + 0.18, 0.72))
        d.label(axes, (star + 0.1, 1.2), "$i_0 = 0$", d.SYMBOLS, ha="left")
        d.label(axes, (star + 0.14, rows[1] + 0.1), "star point of the stator", d.NOTES, rotation=90)
        d.wire(axes, [(0.3, 0.42), (star - 0.04, 0.42)], d.INK, 1.2)
        d.label(axes, (0.3, 0.1), r"$v_{sa} = v_{ta} - v_0,\ \ldots,\quad i_{ta} = i_{sa},\ \ldots$", 8.5, ha="left")
        # delta: a and b one above the other, c on the right
        x, right = 3.75 + 2.05, 3.75 + 3.0
        for upper, lower, phase in ((rows[0], rows[1], "a"), (rows[1], rows[2], "b")):
            d.wire(axes, [(x, upper), (x, upper - 0.2)], STATOR, 1.2)
            d.arrow(axes, [(x, upper), (x, upper - 0.2)], STATOR, 0.0)
            d.resistor(axes, (x, upper - 0.2), (x, upper - 0.54), STATOR, 0.24)
            d.coil(axes, (x, lower), (x, upper - 0.54), STATOR, size=0.4)
            d.label(axes, (x + 0.17, upper - 0.13), rf"$i_{{s{phase}}}$", d.SYMBOLS)
            d.label(axes, (x + 0.17, upper - 0.38), "$r_s$", d.SYMBOLS)
            d.label(axes, (x + 0.26, upper - 0.75), rf"$\dfrac{{d\psi_{{s{phase}}}}}{{dt}}$", d.SYMBOLS)
            d.voltage(
                axes, (x - 0.18, upper - 0.18), (x - 0.18, lower + 0.14), rf"$v_{{s{phase}}}$", (x - 0.26, upper - 0.52)
            )
        low, high = rows[2], rows[0]
        d.wire(axes, [(x, low), (right, low), (right, low + 0.38)], STATOR, 1.2)
        d.arrow(axes, [(right, low + 0.1), (right, low + 0.36)], STATOR, 0.0)
        d.resistor(axes, (right, low + 0.38), (right, low + 0.8), STATOR, 0.26)
        d.coil(axes, (right, low + 1.3), (right, low + 0.8), STATOR)
        d.wire(axes, [(right, low + 1.3), (right, high), (x, high)], STATOR, 1.2)
        d.label(axes, (right + 0.19, low + 0.26), "$i_{sc}$", d.SYMBOLS)
        d.label(axes, (right + 0.19, low + 0.59), "$r_s$", d.SYMBOLS)
        d.label(axes, (right + 0.27, low + 1.05), r"$\dfrac{d\psi_{sc}}{dt}$", d.SYMBOLS)
        d.voltage(axes, (right - 0.18, low + 0.3), (right - 0.18, low + 1.42), "$v_{sc}$", (right - 0.22, low + 0.86))
        for y in rows:
            d.wire(axes, [(3.75 + 1.52, y), (x, y)], STATOR, 1.2)
            d.dot(axes, (x, y), 0.035)
        d.wire(axes, [(3.75 + 0.3, 0.42), (3.75 + 1.7, 0.42)], d.INK, 1.2)
        d.label(
            axes,
            (4.05, 0.1),
            r"$v_{sa} = v_{ta} - v_{tb},\ \ldots,\quad i_{ta} = i_{sa} - i_{sc},\ \ldots$",
            8.5,
            ha="left",
        )
    return figure


def _terminals(axes: Axes, left: float, rows: tuple[float, ...]) -> None:
    """Terminals with voltages from the star point of the supply and currents into the motor."""
    ground = 0.42
    for k, (y, phase) in enumerate(zip(rows, PHASES, strict=True)):
        x = left + 0.38 + 0.36 * k
        d.dot(axes, (x, y), 0.04, hollow=True)
        d.dot(axes, (x, ground), 0.03)
        middle = 0.5 * (y + ground)
        for begin, end in ((y - 0.22, middle + 0.13), (middle - 0.13, ground + 0.22)):
            d.wire(axes, [(x, begin), (x, end)], COLOURS["grey"], 0.7, ":")
        d.voltage(axes, (x, y - 0.13), (x, ground + 0.13), rf"$v_{{t{phase}}}$", (x, middle))
        d.wire(axes, [(x + 0.04, y), (left + 1.52, y)], STATOR, 1.2)
        d.arrow(axes, [(left + 1.2, y), (left + 1.42, y)], STATOR, 0.0)
        d.label(axes, (left + 1.3, y + 0.15), rf"$i_{{t{phase}}}$", d.SYMBOLS)
        d.label(axes, (x, y + 0.15), phase, d.WORDS)
    d.label(axes, (left + 0.3, ground - 0.12), "star point of the supply", d.NOTES, ha="left")


def hydraulic_circuit() -> Figure:
    """Hydraulic circuit of the pump: an ideal pump and one valve for each loss.

    H_i and H_p are pressures. H_e and the losses with K_s and K_f are heads and carry rho g here; the losses with
    K_c and K_l are pressures, as in (3.25). The share a of H_i drives the leakage through its valve.

    Returns
    -------
    Figure

    References
    ----------
    Thesis figure 3.10, equations (3.23) and (3.25).
    """
    with style():
        figure, axes = d.sheet(PAGE, 3.05)
        y, top = 1.5, 2.45
        suction, pressure = 1.1, 5.25
        d.pump(axes, (suction, y), (2.65, y))
        d.valve(axes, (2.65, y), (3.9, y), d.INK, 0.34)
        d.valve(axes, (3.9, y), (pressure, y), d.INK, 0.34)
        d.valve(axes, (pressure, y), (6.7, y), d.INK, 0.34)
        d.wire(axes, [(6.7, y), (6.86, y)], d.INK, 1.2)
        d.wire(axes, [(0.3, y), (suction, y)], d.INK, 1.2)
        d.wire(axes, [(suction, y), (suction, top), (2.4, top)], d.INK, 1.2)
        d.wire(axes, [(pressure, y), (pressure, top), (3.8, top)], d.INK, 1.2)
        d.valve(axes, (3.8, top), (2.4, top), d.INK, 0.34)
        for x in (suction, pressure):
            d.dot(axes, (x, y), 0.035)
        for x in (0.3, 6.9):
            d.dot(axes, (x, y), 0.045, hollow=True)
        for start, end, level in ((0.55, 0.85, y), (1.25, 1.5, y), (6.3, 6.6, y), (4.65, 4.3, top)):
            d.arrow(axes, [(start, level), (end, level)], WATER, 1.8, head=0.12)
        d.label(axes, (0.68, y + 0.17), "$Q_p$", d.SYMBOLS)
        d.label(axes, (6.44, y + 0.17), "$Q_p$", d.SYMBOLS)
        d.label(axes, (1.4, y + 0.17), "$Q_i$", d.SYMBOLS)
        d.label(axes, (4.47, top + 0.16), "$q$", d.SYMBOLS)
        d.label(axes, (1.875, y - 0.4), r"$\sigma_s\,\rho g H_e$", d.SYMBOLS)
        d.label(axes, (3.275, y - 0.3), r"$\rho g K_s (Q_i - K_d\,\omega_r)^2$", d.SYMBOLS)
        d.label(axes, (4.575, y - 0.3), r"$\rho g K_f Q_i^2$", d.SYMBOLS)
        d.label(axes, (5.975, y - 0.3), r"$K_c Q_p^2$", d.SYMBOLS)
        d.label(axes, (3.1, top + 0.3), "$K_l\\,q^2$", d.SYMBOLS)
        for x, name in ((1.875, "ideal pump"), (3.275, "shock"), (4.575, "friction"), (5.975, "casing")):
            d.label(axes, (x, y + 0.36), name, d.NOTES)
        d.label(axes, (3.1, top - 0.26), "leakage, driven by $a H_i$", d.NOTES)
        d.label(axes, (0.3, y + 0.17), "inlet", d.NOTES, ha="center")
        d.label(axes, (6.92, y + 0.17), "outlet", d.NOTES, ha="center")
        for a, b, level, text in ((suction, pressure, 0.72, "$H_i$"), (0.3, 6.9, 0.28, "$H_p$")):
            for x in (a, b):
                d.wire(axes, [(x, y - 0.08), (x, level - 0.08)], COLOURS["grey"], 0.7, ":", zorder=2)
            middle = 0.5 * (a + b)
            d.wire(axes, [(a + 0.22, level), (middle - 0.2, level)], COLOURS["grey"], 0.7)
            d.wire(axes, [(middle + 0.2, level), (b - 0.22, level)], COLOURS["grey"], 0.7)
            d.voltage(axes, (b - 0.11, level), (a + 0.11, level), text, (middle, level))
    return figure
