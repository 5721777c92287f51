"""Thesis 7.1-7.3: figures of the steady state: phasors, widths of enclosures, measured motor, flux, feasible set."""

from collections.abc import Mapping, Sequence
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Polygon
from numpy.typing import NDArray

from pumplib.errors import ParameterError
from pumplib.machines import Motor
from pumplib.plots.ch06_structure import symbol
from pumplib.plots.ch07_study import FluxMonitor
from pumplib.plots.style import COLOURS, PAGE, style
from pumplib.steady.identify import Identification
from pumplib.steady.motor_check import MotorCheck
from pumplib.steady.phasors import ResistanceCondition, electrical_parameters, steady_state
from pumplib.steady.relations import CHANNELS

Array = NDArray[Any]
_METHODS = {
    "interval": ("plain intervals", "orange", "v"),
    "mean": ("mean value form", "purple", "^"),
    "taylor": ("Taylor with remainder", "green", "s"),
    "affine": ("affine", "blue", "o"),
    "linear": ("first-order Taylor: no enclosure", "red", "x"),
}
_RESIDUALS = ("$R_1$", "$R_2$", "$R_3$")
TOP = 3000.0
"""Per cent of width beyond the true range that are drawn; sets without an end are arrows there."""


def _arrow(ax: Axes, start: complex, end: complex, words: str, colour: str, *, off: tuple[float, float]) -> None:
    ax.annotate(
        "", (end.real, end.imag), (start.real, start.imag),
        arrowprops={"arrowstyle": "-|>", "color": COLOURS[colour], "lw": 1.6, "shrinkA": 0, "shrinkB": 0},
    )  # fmt: skip
    middle = 0.5 * (start + end)
    ax.annotate(
        words, (middle.real, middle.imag), xytext=off, textcoords="offset points", color=COLOURS[colour], ha="center",
        va="center", fontsize=9,
    )  # fmt: skip


def phasors(motor: Motor, signals: Mapping[str, float]) -> Figure:
    """Voltages and currents of a winding at one steady point, the d axis along the stator current.

    Parameters
    ----------
    motor : Motor
        The motor.
    signals : mapping of str to float
        V_rms, I_rms, omega_e, phi.

    Returns
    -------
    Figure
    """
    e = electrical_parameters(motor)
    V, I, w, phi = (float(signals[name]) for name in CHANNELS[:4])
    found = steady_state(e, V, I, w, phi)
    v = np.sqrt(2) * e.voltage * V * np.exp(1j * phi)
    i = np.sqrt(2) * e.current * I
    E = complex(float(found.E_d), float(found.E_q))
    i_m = E / (1j * w * e.L_m_prime)
    with style():
        figure, (left, right) = plt.subplots(1, 2, figsize=(PAGE, 3.2), width_ratios=(1.25, 1.0))
        _arrow(left, 0j, complex(v), "$V$", "black", off=(-10, 8))
        _arrow(left, 0j, E, "$E$", "blue", off=(12, -8))
        _arrow(left, complex(v), complex(v) - e.r_s * i, r"$r_\mathrm{s} I$", "orange", off=(0, 9))
        _arrow(left, complex(v) - e.r_s * i, E, r"$\mathrm{j}\omega_\mathrm{e}L_\mathrm{s}'I$", "green", off=(-24, 4))
        left.plot([0, E.real], [0, 0], color=COLOURS["blue"], lw=1.0, ls=":")
        left.plot([E.real, E.real], [0, E.imag], color=COLOURS["blue"], lw=1.0, ls=":")
        left.text(0.5 * E.real, -0.055 * abs(v), "$E_d$: torque", ha="center", va="top", color=COLOURS["blue"])
        left.text(1.03 * E.real, 0.35 * E.imag, "$E_q$", ha="left", va="center", color=COLOURS["blue"])
        left.set_xlim(-0.08 * abs(v), 1.2 * abs(v))
        left.set_ylim(-0.2 * abs(v), 1.12 * max(v.imag, E.imag))
        _arrow(right, 0j, complex(i), "$I$", "black", off=(20, 8))
        _arrow(right, 0j, i_m, r"$I_\mathrm{m}$", "purple", off=(-14, -4))
        _arrow(right, i_m, complex(i), r"$I-I_\mathrm{m}$", "red", off=(24, -8))
        right.set_xlim(-0.15 * i, 1.15 * i)
        right.set_ylim(1.25 * i_m.imag, 0.25 * i)
        left.set_title("voltages of a winding, amplitudes")
        right.set_title("currents, amplitudes")
        for ax, unit in ((left, "V"), (right, "A")):
            ax.set_aspect("equal")
            ax.set_xlabel(f"along the stator current / {unit}")
            ax.set_ylabel(f"across / {unit}")
            ax.axhline(0, color=COLOURS["grey"], lw=0.7, zorder=1)
            ax.axvline(0, color=COLOURS["grey"], lw=0.7, zorder=1)
    return figure


def widths(ratios: Mapping[str, Mapping[str, Array]]) -> Figure:
    """Width of the sets over the true range, by method; one panel a parameter set, arrows where a set is infinite.

    Parameters
    ----------
    ratios : mapping of str to mapping of str to ndarray, shape (n, 3)
        Name of the parameter set to method to ratios at operating points.

    Returns
    -------
    Figure

    Raises
    ------
    ParameterError
        If a method is unknown.
    """
    unknown = {method for one in ratios.values() for method in one} - set(_METHODS)
    if unknown:
        raise ParameterError(f"widths: method {', '.join(sorted(unknown))} unknown; known are {', '.join(_METHODS)}.")
    with style():
        figure, axes = plt.subplots(1, len(ratios), figsize=(PAGE, 3.4), sharey=True, squeeze=False)
        for ax, (name, methods) in zip(axes[0], ratios.items(), strict=True):
            for k, method in enumerate(methods):
                words, colour, marker = _METHODS[method]
                excess = 100 * (np.asarray(methods[method], dtype=float) - 1.0)
                lost = ~np.isfinite(excess)  # no finite set somewhere: an arrow to the upper edge
                low, high = (
                    np.minimum(end, TOP) for end in (excess.min(axis=0), np.where(lost, TOP, excess).max(axis=0))
                )
                middle = np.minimum(np.median(excess, axis=0), TOP)
                x = np.arange(3) + 0.14 * (k - (len(methods) - 1) / 2)
                ax.errorbar(
                    x, middle, yerr=np.stack((middle - low, high - middle)), fmt=marker, color=COLOURS[colour], ms=4.5,
                    mfc="white", capsize=2, lw=1.0, label=words,
                )  # fmt: skip
                gone = lost.any(axis=0)
                ax.plot(x[gone], np.full(gone.sum(), TOP), ls="none", marker=6, ms=6, color=COLOURS[colour])
            ax.axhline(0, color=COLOURS["black"], lw=0.9)
            ax.set_yscale("symlog", linthresh=1.0)
            ax.set_xticks(range(3), _RESIDUALS)
            ax.set_xlim(-0.5, 2.5)
            ax.set_title(name)
        axes[0][0].set_yticks((-1, 0, 1, 10, 100, 1000), ("-1", "0", "1", "10", "100", "1000"))
        axes[0][0].set_ylim(-1.0, 1.5 * TOP)
        axes[0][0].set_ylabel("width beyond the true range / %\nmedian, smallest, largest of the points")
        figure.legend(*axes[0][0].get_legend_handles_labels(), loc="outside upper center", ncols=3)
    return figure


def no_enclosure(
    ways: Mapping[str, tuple[Array, Array]], ends: Mapping[str, Mapping[str, tuple[float, float]]]
) -> Figure:
    """How residuals leave their first-order Taylor set, and the room that rigorous methods add at both its ends.

    Parameters
    ----------
    ways : mapping of str to (ndarray, ndarray)
        Residual to position between two opposite corners of the errors, and residual minus linear approximation over
        the set's radius.
    ends : mapping of str to mapping of str to (float, float)
        Residual to method to the ends of its set, beside those of the linear one, over the radius; the lower one
        first.

    Returns
    -------
    Figure
    """
    with style():
        figure, axes = plt.subplots(1, len(ways), figsize=(PAGE, 2.9), squeeze=False)
        for ax, (name, (way, excess)) in zip(axes[0], ways.items(), strict=True):
            ax.plot(way, 100 * excess, color=COLOURS["black"], label="residual minus its linear approximation")
            ax.axhline(0, color=COLOURS["red"], ls="--", lw=1.0, label="ends of the first-order set")
            for method, pair in ends[name].items():
                words, colour, marker = _METHODS[method]
                shift = 0.06 if method == "affine" else -0.06
                ax.plot(
                    [-1 + shift, 1 + shift], [100 * value for value in pair], ls="none", marker=marker, ms=5.5,
                    mfc="white", color=COLOURS[colour], label=f"ends of the set, {words}",
                )  # fmt: skip
            for place, at, words in ((1.12, "bottom", "outside\nabove"), (-1.12, "top", "outside\nbelow")):
                ax.annotate(
                    words, (place, 0), xytext=(0, 3 if at == "bottom" else -3), textcoords="offset points", va=at,
                    ha="left" if place > 0 else "right", fontsize=7, color=COLOURS["red"],
                )  # fmt: skip
            ax.set_xlim(-2.0, 2.0)
            ax.margins(y=0.15)
            ax.set_xticks((-1, 0, 1))
            ax.set_title(f"${name[0]}_{name[1:]}$")
            ax.set_xlabel("position, corner to corner / -")
        axes[0][0].set_ylabel("share of the set's radius / %")
        figure.legend(*axes[0][0].get_legend_handles_labels(), loc="outside upper center", ncols=2)
    return figure


def motor_sets(found: MotorCheck) -> Figure:
    """Sets of shaft power and slip beside the measured load points.

    Parameters
    ----------
    found : MotorCheck
        Sets and measurement.

    Returns
    -------
    Figure
    """
    e, power = found.enclosure, found.power_shaft
    with style():
        figure, (top, below) = plt.subplots(2, 1, figsize=(PAGE, 4.0), sharex=True)
        pairs = (
            (top, e.lo[:, 2], e.hi[:, 2], power, "shaft power beside\nthe measured one / %"),
            (below, e.lo[:, 0], e.hi[:, 0], found.omega, "speed beside\nthe measured one / %"),
        )
        for ax, lo, hi, measured, label in pairs:
            low, high = 100 * (lo / measured - 1), 100 * (hi / measured - 1)
            ax.vlines(power / 1e3, low, high, color=COLOURS["blue"], lw=5, alpha=0.55, label="set")
            ax.plot(power / 1e3, 0 * power, "o", color=COLOURS["black"], ms=3.5, label="measured")
            out = (lo > measured) | (hi < measured)
            ax.plot(power[out] / 1e3, 0 * power[out], "x", color=COLOURS["red"], ms=9, mew=2, label="outside its set")
            ax.set_ylabel(label)
        below.set_xlabel("measured shaft power / kW")
        figure.align_ylabels((top, below))
        figure.legend(*top.get_legend_handles_labels(), loc="outside upper center", ncols=3)
    return figure


def flux_monitor(found: FluxMonitor, condition: ResistanceCondition, true_r_s: float | None = None) -> Figure:
    """The relation that is left over: good for the main inductance, bad for the stator resistance.

    Parameters
    ----------
    found : FluxMonitor
        At steady points.
    condition : ResistanceCondition
        Sensitivities of the resistance at one point.
    true_r_s : float, optional
        True change of r_s, -, for comparison.

    Returns
    -------
    Figure
    """
    L, r = found.believed
    with style():
        figure, (left, middle, right) = plt.subplots(1, 3, figsize=(PAGE, 2.9), width_ratios=(1, 1, 1.15))
        left.plot(found.flux, 100 * (found.L_m_prime / L - 1), "o", color=COLOURS["blue"])
        left.set_title(r"solved for $L_\mathrm{m}'$")
        left.set_ylabel("beside the data sheet / %")
        change = 100 * (found.r_s / r - 1)
        there = np.isfinite(change)
        middle.plot(found.flux[there], change[there], "s", color=COLOURS["red"])
        if true_r_s is not None:
            middle.axhline(100 * true_r_s, color=COLOURS["black"], ls="--", lw=1.0)
            middle.annotate("true", (1, 100 * true_r_s), xycoords=("axes fraction", "data"), xytext=(-2, 3),
                            textcoords="offset points", ha="right", fontsize=7.5)  # fmt: skip
        middle.set_title(r"solved for $r_\mathrm{s}$")
        for ax in (left, middle):
            ax.axhline(0, color=COLOURS["grey"], lw=0.8)
            ax.set_xlabel("air-gap flux / (V s)")
        bars = {
            r"$L_\mathrm{m}'$ +1 %": condition.per_L_m,
            r"$L_\mathrm{s}'$ +1 %": condition.per_L_s,
            "$V$ +0.5 %": 0.5 * condition.per_V,
            "$I$ +0.5 %": 0.5 * condition.per_I,
            r"$\varphi$ +0.5°": 100 * np.deg2rad(0.5) * condition.per_phi,
        }
        right.barh(range(len(bars)), list(bars.values()), color=COLOURS["sky"], ec=COLOURS["blue"])
        right.set_yticks(range(len(bars)), list(bars))
        right.invert_yaxis()
        right.axvline(0, color=COLOURS["black"], lw=0.8)
        right.set_xlabel(r"moves $r_\mathrm{s}$ by / %")
        right.set_title("error")
    return figure


def feasible(found: Identification, truth: Mapping[str, float] | None = None) -> Figure:
    """Slices of the guaranteed parallelotope of the head parameters through its centre, its shadow and its box.

    Parameters
    ----------
    found : Identification
        Outcome of a commissioning.
    truth : mapping of str to float, optional
        True parameters, where they are known.

    Returns
    -------
    Figure
    """
    names = found.head.names
    part = found.guaranteed
    rows = [part.names.index(name) for name in names]
    used = part.generators[rows].any(axis=0)
    G, c = part.generators[rows][:, used], part.center[rows]
    with style():
        figure, axes = plt.subplots(1, 3, figsize=(PAGE, 3.0))
        for ax, (i, j) in zip(axes, ((0, 1), (1, 2), (0, 2)), strict=True):
            scale = np.array([100 / c[i], 100 / c[j]])
            r = np.abs(G).sum(axis=1)[[i, j]] * scale
            box = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) * r
            shadow, cut = zonotope(G[[i, j]]) * scale, section(G, i, j) * scale
            for points, colour, words, alpha in (
                (box, "grey", "box around it", 0.12), (shadow, "sky", "shadow of the guaranteed set", 0.35),
                (cut, "blue", "slice through its centre", 0.75),
            ):  # fmt: skip
                ax.add_patch(Polygon(points, fc=COLOURS[colour], ec=COLOURS[colour], alpha=alpha, lw=1.0, label=words))
            estimate = (found.head.estimate[[i, j]] - c[[i, j]]) * scale
            ax.plot(*estimate, "x", color=COLOURS["red"], ms=6, mew=1.6, label="least squares")
            if truth is not None:
                true = (np.array([truth[names[i]], truth[names[j]]]) - c[[i, j]]) * scale
                ax.plot(*true, "*", color=COLOURS["black"], ms=8, label="true")
            ax.set_xlim(-1.1 * r[0], 1.1 * r[0])
            ax.set_ylim(-1.1 * r[1], 1.1 * r[1])
            ax.set_xlabel(f"{symbol(names[i])} beside the centre / %")
            ax.set_ylabel(f"{symbol(names[j])} / %", labelpad=1)
        figure.legend(*axes[0].get_legend_handles_labels(), loc="outside upper center", ncols=5)
    return figure


def zonotope(G: Array) -> Array:
    """Corners of the image of the unit box under a 2 x n matrix, in order around it.

    Parameters
    ----------
    G : ndarray, shape (2, n)
        Generators.

    Returns
    -------
    ndarray, shape (2 n, 2)
    """
    up = G * np.where((G[1] < 0) | ((G[1] == 0) & (G[0] < 0)), -1.0, 1.0)
    up = up[:, np.argsort(np.arctan2(up[1], up[0]))]
    first = -up.sum(axis=1)
    half = first[:, None] + 2 * np.cumsum(up, axis=1)
    return np.hstack((half, -half)).T


def section(G: Array, i: int, j: int) -> Array:
    """Corners of the cut of a parallelotope with the plane of two coordinates through its centre.

    Parameters
    ----------
    G : ndarray, shape (n, n)
        Generators, regular.
    i, j : int
        The coordinates that vary.

    Returns
    -------
    ndarray, shape (m, 2)
        In order around it.
    """
    # unit coordinates zeta = A (x, y) with |zeta_k| <= 1: clip a large square by every pair of lines
    scale = np.abs(G).sum(axis=1)
    A = np.linalg.inv(G / scale[:, None])[:, [i, j]]
    corners: list[Array] = [np.array(p, dtype=float) for p in ((-2, -2), (2, -2), (2, 2), (-2, 2))]
    for row in np.vstack((A, -A)):
        kept = []
        for p, q in zip(corners, corners[1:] + corners[:1], strict=True):
            a, b = float(row @ p) - 1, float(row @ q) - 1
            if a <= 0:
                kept.append(p)
            if (a < 0 < b) or (b < 0 < a):
                kept.append(p + (q - p) * (a / (a - b)))
        corners = kept
    return np.array(corners) * scale[[i, j]]


def smallest(found: Mapping[str, Mapping[str, float]], units: Sequence[str], faults: Sequence[str]) -> Figure:
    """Smallest detectable size of each fault by several ways to look at the data.

    Parameters
    ----------
    found : mapping of str to mapping of str to float
        Way to fault to size; infinite is left out.
    units : sequence of str
        Of the faults.
    faults : sequence of str
        Symbols of the faults, in the order of the panels.

    Returns
    -------
    Figure
    """
    looks = (("blue", "o"), ("green", "s"), ("purple", "^"), ("red", "D"), ("orange", "v"))
    with style():
        figure, axes = plt.subplots(1, len(faults), figsize=(PAGE, 2.6), sharey=True)
        for ax, fault, unit in zip(axes, faults, units, strict=True):
            for k, (colour, marker) in zip(range(len(found)), looks, strict=False):
                size = list(found.values())[k][fault]
                if np.isfinite(size):
                    ax.plot([size], [k], ls="none", marker=marker, color=COLOURS[colour], ms=6)
                    ax.hlines(k, 1e-30, size, color=COLOURS[colour], lw=1.2)
            sizes = [one[fault] for one in found.values() if np.isfinite(one[fault])]
            ax.set_xscale("log")
            if sizes:  # from a full decade, so that at least one tick has a label
                ax.set_xlim(10.0 ** np.floor(np.log10(0.8 * min(sizes))), 2.5 * max(sizes))
            ax.xaxis.set_minor_formatter("")
            ax.set_title(symbol(fault))
            ax.set_xlabel(f"size / {unit}")
        axes[0].set_yticks(range(len(found)), list(found))
        axes[0].invert_yaxis()
        axes[0].set_ylim(len(found) - 0.5, -0.5)
    return figure
