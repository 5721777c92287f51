"""Thesis 4.3.4, 4.3.5, 4.4.1, 4.4.2: propagation matrices, sensor sets, decision table, physics and test results."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap, to_rgb
from matplotlib.figure import Figure
from matplotlib.patches import Patch, Rectangle
from numpy.typing import ArrayLike, NDArray

from pumplib.errors import DataError
from pumplib.events.confront import Confrontation
from pumplib.fmea.tables import checked_matrix
from pumplib.plots.style import COLOURS, PAGE, style
from pumplib.propagation.symbols import MINUS, PLUS, ZERO

Array = NDArray[Any]
SYMBOLS = ("-", "0", "+")
"""Order of the last axis of `predicted` and `share`."""
MUST, MAY, MASKED = COLOURS["blue"], COLOURS["sky"], "#D5D9DC"
_INK, _SOFT, _TOUCH = "#222222", "#8A949C", "#5A6570"
_TURQUOISE = LinearSegmentedColormap.from_list("share", ["white", COLOURS["blue"]])


def _sign(text: str) -> str:
    """Name with a true minus sign at its end."""
    return text[:-1] + "−" if text.endswith("-") else text


def _grid(axes: Axes, rows: Sequence[str], columns: Sequence[str], *, turned: bool = True) -> None:
    """Cells of unit size, first row on top, names outside, no ticks."""
    axes.set_xlim(0, len(columns))
    axes.set_ylim(len(rows), 0)
    axes.grid(False)
    axes.set_xticks(np.arange(len(columns)) + 0.5, [_sign(name) for name in columns], rotation=90 if turned else 0)
    axes.set_yticks(np.arange(len(rows)) + 0.5, [_sign(name) for name in rows])
    axes.xaxis.tick_top()
    axes.tick_params(length=0, labelsize=7.5, pad=2)
    axes.spines[:].set_visible(True)
    axes.spines[:].set_linewidth(0.6)
    axes.hlines(np.arange(1, len(rows)), 0, len(columns), color="#E3E6E8", lw=0.5, zorder=0.5)
    axes.vlines(np.arange(1, len(columns)), 0, len(rows), color="#E3E6E8", lw=0.5, zorder=0.5)


def _spans(groups: Sequence[str]) -> list[tuple[str, int, int]]:
    """Runs of equal names with first position and the one behind the last."""
    found: list[tuple[str, int, int]] = []
    for k, name in enumerate(groups):
        if found and found[-1][0] == name:
            found[-1] = (name, found[-1][1], k + 1)
        else:
            found.append((name, k, k + 1))
    if len({name for name, _, _ in found}) != len(found):
        raise DataError(
            f"groups: {', '.join(groups)}: the members of a group must stand next to each other; sort them."
        )
    return found


def propagation_matrices(
    *,
    rows: Sequence[str],
    faults: Sequence[str],
    groups: Sequence[str],
    fault_may: ArrayLike,
    fault_must: ArrayLike,
    disturbances: Sequence[str],
    disturbance_may: ArrayLike,
    disturbance_must: ArrayLike | None = None,
) -> Figure:
    """A_f and A_d next to each other: must, may or never; rows that a disturbing event touches are grey.

    Parameters
    ----------
    rows : sequence of str, length r
        Signal events.
    faults : sequence of str, length m
        Columns of A_f.
    groups : sequence of str, length m
        Group of each fault; equal names stand next to each other.
    fault_may, fault_must : array_like of bool, shape (r, m)
        A_f from all and from the must entries.
    disturbances : sequence of str, length p
        Columns of A_d; none leaves A_d out.
    disturbance_may : array_like of bool, shape (r, p)
        A_d from all entries; what counts for robustness.
    disturbance_must : array_like of bool, shape (r, p), optional
        A_d from the must entries; without it A_d is drawn without the distinction.

    Returns
    -------
    Figure

    Raises
    ------
    DataError
        If a shape does not fit the names, a must entry is no may entry, or a group is scattered.
    """
    if len(groups) != len(faults):
        raise DataError(f"groups: {len(groups)} names, but there are {len(faults)} faults; give one a fault.")
    if not rows or not faults:
        raise DataError("propagation matrices: give at least one row and one fault.")
    spans = _spans(groups)
    panels = [
        ("A_f", faults, checked_matrix("fault_may", fault_may, rows, faults),
         checked_matrix("fault_must", fault_must, rows, faults)),
    ]  # fmt: skip
    touching = checked_matrix("disturbance_may", disturbance_may, rows, disturbances)
    sure_touch = touching if disturbance_must is None else disturbance_must
    sure_touch = checked_matrix("disturbance_must", sure_touch, rows, disturbances)
    if disturbances:
        panels.append(("A_d", disturbances, touching, sure_touch))
    touched: Array = np.any(touching, axis=1)
    with style():
        figure = Figure(figsize=(PAGE, 1.35 + 0.165 * len(rows)))
        widths = [len(columns) for _, columns, _, _ in panels]
        axes = figure.subplots(1, len(panels), width_ratios=widths, sharey=True, squeeze=False)[0]
        for ax, (name, columns, may, must) in zip(axes, panels, strict=True):
            if np.any(must & ~may):
                raise DataError(f"{name}: a must entry is no may entry; the must closure must lie in the may closure.")
            _grid(ax, rows, columns)
            for y in np.nonzero(touched)[0].tolist():
                ax.add_patch(Rectangle((0, y), len(columns), 1, fc=MASKED, ec="none", zorder=0.3))
            for y, x in np.argwhere(may).tolist():
                sure = bool(must[y, x])
                face = "white" if not sure else _TOUCH if name == "A_d" and disturbance_must is None else MUST
                ax.add_patch(
                    Rectangle(
                        (x + 0.1, y + 0.12), 0.8, 0.76, fc=face, ec=_TOUCH if face == _TOUCH else MUST, lw=0.9, zorder=2
                    )
                )
                if not sure:
                    ax.text(x + 0.5, y + 0.53, "?", ha="center", va="center", fontsize=7, color=MUST)
            ax.set_xlabel("$A_f$: faults" if name == "A_f" else "$A_d$: disturbing events")
        for name, first, behind in spans:
            axes[0].axvline(first, color=_INK, lw=0.9)
            axes[0].annotate(
                name, ((first + behind) / 2, 1.0), xycoords=("data", "axes fraction"), xytext=(0, 27),
                textcoords="offset points", ha="center", va="bottom", fontsize=7.5, weight="bold",
            )  # fmt: skip
        axes[0].set_ylabel("signal events")
        for label, masked in zip(axes[0].get_yticklabels(), touched.tolist(), strict=True):
            label.set_color(_SOFT if masked else _INK)
        handles = [
            Patch(fc=MUST, ec=MUST, label="must"),
            Patch(fc="white", ec=MUST, label="may (?)"),
        ]
        if disturbances:
            handles += [Patch(fc=_TOUCH, label="must or may")] * (disturbance_must is None)
            handles.append(Patch(fc=MASKED, label="row touched by a disturbing event"))
        figure.legend(handles=handles, loc="outside lower center", ncols=len(handles), frameon=False)
    return figure


def sensor_sets(
    *, sensors: Sequence[str], cases: Mapping[str, Sequence[Sequence[str]]], costs: Sequence[float] | None = None
) -> Figure:
    """All minimal sensor sets of several questions: one line a set, a dot for every sensor in it.

    Parameters
    ----------
    sensors : sequence of str
        Sensors.
    cases : mapping of str to sequence of sequence of str
        Question to its minimal sets; none means that no set of these sensors is enough.
    costs : sequence of float, optional
        Relative cost of each sensor; the cost of each set is then written beside it.

    Returns
    -------
    Figure

    Raises
    ------
    DataError
        If there is no question, a set names an unknown sensor, or the costs do not fit.
    """
    if not cases:
        raise DataError("sensor sets: no question given; give at least one.")
    if costs is not None and len(costs) != len(sensors):
        raise DataError(f"costs: {len(costs)} values, but there are {len(sensors)} sensors; give one a sensor.")
    lines: list[tuple[str, tuple[str, ...] | None]] = []
    for case, sets in cases.items():
        for n, chosen in enumerate(sets):
            for name in chosen:
                if name not in sensors:
                    raise DataError(f"{case}: unknown sensor {name!r}; there are {', '.join(sensors)}.")
            lines.append((case if n == 0 else "", tuple(chosen)))
        if not sets:
            lines.append((case, None))
    with style():
        figure = Figure(figsize=(PAGE, 0.75 + 0.2 * len(lines)))
        ax = figure.subplots()
        _grid(ax, [case for case, _ in lines], sensors, turned=False)
        ax.hlines(np.arange(1, len(lines)), 0, len(sensors), color="white", lw=0.8, zorder=0.6)
        for y, (case, members) in enumerate(lines):
            if case and y:
                ax.axhline(y, color=_INK, lw=0.6)
            if members is None:
                ax.add_patch(Rectangle((0, y), len(sensors), 1, fc=MASKED, ec="none", zorder=0.3))
                ax.text(len(sensors) / 2, y + 0.54, "no set is enough", ha="center", va="center", fontsize=7.5)
                continue
            inside = [k for k, name in enumerate(sensors) if name in members]
            ax.plot(np.array(inside) + 0.5, np.full(len(inside), y + 0.5), "o", color=MUST, ms=6.5)
            outside = [k for k in range(len(sensors)) if k not in inside]
            ax.plot(np.array(outside) + 0.5, np.full(len(outside), y + 0.5), "o", color="#D5D9DC", ms=3)
            if costs is not None:
                total = sum(costs[k] for k in inside)
                ax.text(len(sensors) + 0.1, y + 0.54, f"{total:g}", va="center", fontsize=7.5)
        if costs is not None:
            ax.text(len(sensors) + 0.1, -0.35, "cost", va="center", fontsize=7.5)
            ax.set_xlim(0, len(sensors) + 0.6)
        ax.set_title("minimal sensor sets", pad=6)
    return figure


def decision_table(*, hypotheses: Sequence[str], signals: Sequence[str], symbols: Sequence[Sequence[str]]) -> Figure:
    """Decision table: which symbol each signal shows under each hypothesis.

    Parameters
    ----------
    hypotheses : sequence of str, length h
        No fault, then the groups.
    signals : sequence of str, length s
        Signals.
    symbols : sequence of sequence of str, shape (h, s)
        Observable symbols of each cell, some of ``+ - 0``; ``*`` where the signal is not used.

    Returns
    -------
    Figure

    Raises
    ------
    DataError
        If the shape does not fit the names or a symbol is none of ``+ - 0 *``.
    """
    if len(symbols) != len(hypotheses) or any(len(row) != len(signals) for row in symbols):
        raise DataError(
            f"symbols: must have {len(hypotheses)} rows of {len(signals)} cells, one a hypothesis and signal."
        )
    colours = {"+": COLOURS["red"], "-": COLOURS["blue"], "0": "white", "*": MASKED}
    with style():
        figure = Figure(figsize=(PAGE, 0.75 + 0.24 * len(hypotheses)))
        ax = figure.subplots()
        _grid(ax, hypotheses, signals, turned=False)
        for y, row in enumerate(symbols):
            for x, cell in enumerate(row):
                if not cell or set(cell) - set("+-0*") or ("*" in cell and cell != "*"):
                    raise DataError(
                        f"symbols[{hypotheses[y]}, {signals[x]}] = {cell!r}: give some of + - 0, or * for not used."
                    )
                colour = colours[cell] if len(cell) == 1 else "#F3F4F5"
                ax.add_patch(Rectangle((x, y), 1, 1, fc=colour, ec="white", lw=0.8, zorder=0.4))
                shade = "white" if cell in ("+", "-") else _SOFT if cell == "0" else _INK
                ax.text(
                    x + 0.5, y + 0.54, " ".join(_sign(c) for c in cell), ha="center", va="center",
                    fontsize=9 if len(cell) == 1 else 8, weight="bold" if cell in ("+", "-") else "normal", color=shade,
                )  # fmt: skip
        ax.set_title("decision table (* not used)", pad=6)
    return figure


def physics_confrontation(
    *,
    signals: Sequence[str],
    roots: Sequence[str],
    predicted: ArrayLike,
    share: ArrayLike,
    first_disturbance: int | None = None,
) -> Figure:
    """Predicted symbols against simulated signs, for every signal and every fault or disturbing event.

    Every cell has three places: -, 0, +. A pale place is predicted; the bar in it is the share of operating points
    at which the simulation showed it. A bar outside the pale places is a contradiction.

    Parameters
    ----------
    signals : sequence of str, length s
        Rows.
    roots : sequence of str, length c
        Columns.
    predicted : array_like of bool, shape (s, c, 3)
        Whether the symbols -, 0, + are predicted.
    share : array_like, shape (s, c, 3)
        Share of the operating points with -, 0, +; sums to 1, or NaN where nothing was simulated.
    first_disturbance : int, optional
        Column at which the disturbing events begin.

    Returns
    -------
    Figure

    Raises
    ------
    DataError
        If shapes do not fit, a cell predicts nothing, or shares are negative or do not sum to 1.
    """
    shape = (len(signals), len(roots), 3)
    symbols, shares = np.asarray(predicted), np.asarray(share, dtype=float)
    for name, array in (("predicted", symbols), ("share", shares)):
        if array.shape != shape:
            raise DataError(f"{name}: shape {array.shape}, but must be {shape}: signals, roots, symbols - 0 +.")
    if symbols.dtype != bool or not symbols.any(axis=2).all():
        raise DataError("predicted: must hold truth values, at least one true a cell.")
    known = ~np.isnan(shares).all(axis=2)
    inside = shares[known]
    if np.isnan(inside).any() or np.any(inside < 0) or np.any(np.abs(inside.sum(axis=1) - 1) > 1e-9):
        raise DataError("share: each cell must be three shares >= 0 that sum to 1, or three NaN.")
    wrong = known[..., None] & ~symbols & (np.nan_to_num(shares) > 0)
    with style():
        figure = Figure(figsize=(PAGE, 1.6 + 0.3 * len(signals)))
        ax = figure.subplots()
        _grid(ax, signals, roots)
        ax.vlines(np.arange(1, len(roots)), 0, len(signals), color=_SOFT, lw=0.6)
        ax.hlines(np.arange(1, len(signals)), 0, len(roots), color=_SOFT, lw=0.6)
        for y, x in np.ndindex(shape[:2]):
            for k in range(3):
                left = x + 0.05 + 0.3 * k
                if symbols[y, x, k]:
                    ax.add_patch(Rectangle((left, y + 0.06), 0.28, 0.88, fc="#CFE3F1", ec="none", zorder=1))
                if known[y, x] and shares[y, x, k] > 0:
                    high = max(0.88 * shares[y, x, k], 0.06)
                    bad = bool(wrong[y, x, k])
                    ax.add_patch(
                        Rectangle(
                            (left + 0.04, y + 0.94 - high), 0.2, high, fc=COLOURS["red"] if bad else MUST,
                            ec=_INK if bad else "none", lw=0.6, zorder=2,
                        )
                    )  # fmt: skip
        if first_disturbance is not None:
            ax.axvline(first_disturbance, color=_INK, lw=1.4)
        ax.set_xlabel("faults | disturbing events" if first_disturbance is not None else "faults and disturbing events")
        ax.set_ylabel("signals; in each cell − 0 +")
        cells = int(wrong.any(axis=2).sum())
        ax.set_title(f"{cells} contradicted cells of {int(known.sum())} simulated", pad=6)
        handles = [
            Patch(fc="#CFE3F1", label="predicted"),
            Patch(fc=MUST, label="share of simulated points"),
            Patch(fc=COLOURS["red"], ec=_INK, label="contradiction"),
        ]
        figure.legend(handles=handles, loc="outside lower center", ncols=3, frameon=False)
    return figure


def confusion(*, truths: Sequence[str], verdicts: Sequence[str], counts: ArrayLike) -> Figure:
    """Confusion matrix: number of runs for each truth and verdict, shaded by the share of the row.

    Parameters
    ----------
    truths : sequence of str, length t
        No fault and groups.
    verdicts : sequence of str, length v
        What the decision said.
    counts : array_like of int, shape (t, v)
        Runs; not negative, no row empty.

    Returns
    -------
    Figure

    Raises
    ------
    DataError
        If the shape does not fit the names, a count is negative or no whole number, or a row is empty.
    """
    runs = np.asarray(counts)
    if runs.shape != (len(truths), len(verdicts)):
        raise DataError(f"counts: shape {runs.shape}, but must be {(len(truths), len(verdicts))}: truths, verdicts.")
    if not np.issubdtype(runs.dtype, np.integer) or np.any(runs < 0):
        raise DataError("counts: must be whole numbers >= 0 (runs).")
    total = runs.sum(axis=1, keepdims=True)
    if np.any(total == 0):
        raise DataError(f"counts: no run of {truths[int(np.argmin(total))]!r}; leave the row out or run it.")
    part = runs / total
    with style():
        figure = Figure(figsize=(PAGE, 1.6 + 0.27 * len(truths)))
        ax = figure.subplots()
        _grid(ax, truths, verdicts)
        for y, x in np.ndindex(*runs.shape):
            colour = _TURQUOISE(float(part[y, x]))
            ax.add_patch(Rectangle((x, y), 1, 1, fc=colour, ec="white", lw=0.8, zorder=0.4))
            if runs[y, x]:
                dark = sum(w * c for w, c in zip((0.3, 0.59, 0.11), to_rgb(colour), strict=True)) < 0.55
                ax.text(
                    x + 0.5, y + 0.53, str(runs[y, x]), ha="center", va="center", fontsize=8,
                    color="white" if dark else _INK, weight="bold" if truths[y] == verdicts[x] else "normal",
                )  # fmt: skip
        ax.set_ylabel("truth")
        ax.set_title("verdict (runs; bold: correct)", pad=6)
    return figure


def physics_signs(found: Confrontation) -> Figure:
    """Confrontation of tables and physics: every fault without and every disturbing event without a fault.

    Faults together with disturbing events are compared as well; they are counted, not drawn.

    Parameters
    ----------
    found : Confrontation
        Outcome; its first fault and its first disturbing event are "none".

    Returns
    -------
    Figure
    """
    codes = np.array([MINUS, ZERO, PLUS], np.uint8)
    allowed = np.concatenate((found.allowed[1:, 0], found.allowed[0, 1:]))
    sign = np.concatenate((found.sign[1:, 0], found.sign[0, 1:]))
    share = np.stack([np.mean(sign == one, axis=1) for one in (-1, 0, 1)], axis=-1)
    return physics_confrontation(
        signals=found.signals,
        roots=(*found.faults[1:], *found.disturbances[1:]),
        predicted=np.swapaxes((allowed[..., None] & codes) != 0, 0, 1),
        share=np.swapaxes(share, 0, 1),
        first_disturbance=len(found.faults) - 1,
    )
