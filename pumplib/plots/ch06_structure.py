"""Thesis 6.1, 6.3, 6.4: figures of a model's structure: sorted incidence, what can be isolated, split in cascade."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, Rectangle

from pumplib.errors import ParameterError
from pumplib.plots import drawing as d
from pumplib.plots.style import COLOURS, PAGE, style
from pumplib.structure.cascade import Split, split_model
from pumplib.structure.dm import Decomposition
from pumplib.structure.graph import Structure
from pumplib.structure.isolability import Isolability, isolability, signature
from pumplib.structure.model import StructuralModel
from pumplib.structure.mso import mso_matrix

CELL = 0.2  # in, side of a cell of an incidence
_FAULT_COLOURS = [COLOURS[c] for c in ("red", "blue", "green", "purple", "orange", "sky")]
_FAULT_MARKERS = ("o", "s", "^", "D", "v", "P")
_GREEK = ("omega", "rho", "theta", "phi", "lambda", "kappa")
_LIGHT, _TINT = "#DCEEF8", "#F6DDA6"


def symbol(name: str) -> str:
    """Name of a variable as mathematics: omega_dot, K_f, dB, i_md, p1.

    Parameters
    ----------
    name : str
        Name in the model.

    Returns
    -------
    str
        Text for matplotlib, between dollar signs.
    """
    rate = name.endswith("_dot")
    stem, _, index = (name.removesuffix("_dot")).partition("_")
    digits = re.fullmatch(r"([A-Za-z]+)(\d+)", stem)
    if digits and not index:
        stem, index = digits[1], digits[2]
    delta = re.fullmatch(r"d([A-Z])", stem)
    stem = rf"\Delta {delta[1]}" if delta else rf"\{stem}" if stem in _GREEK else stem
    stem = rf"\dot{{{stem}}}" if rate else stem
    index = rf"\{index}" if index in _GREEK else rf"\mathrm{{{index.replace('_', ',')}}}"
    return f"${stem}_{{{index}}}$" if index != r"\mathrm{}" else f"${stem}$"


def _constraint(name: str) -> str:
    stem, _, index = name.partition("_")
    digits = re.fullmatch(r"([A-Za-z]+)(\d+)", stem)
    if digits and not index:
        stem, index = digits[1], digits[2]
    return rf"$\mathrm{{{stem}}}_{{\mathrm{{{index}}}}}$" if index else rf"$\mathrm{{{stem}}}$"


def _order(found: Decomposition) -> tuple[list[str], list[str], list[tuple[str, list[str], list[str], str]]]:
    """Rows and columns, sorted to an upper triangle of blocks, and the blocks with their kinds."""
    rows: list[str] = []
    columns: list[str] = []
    blocks = []
    parts = [(found.under, "under")] + [(b, "square") for b in reversed(found.square)]
    for block, kind in parts:
        if block.constraints or block.unknowns:
            blocks.append((kind, list(block.constraints), list(block.unknowns), kind))
            rows += block.constraints
            columns += block.unknowns
    over_rows: list[str] = []
    over_columns: list[str] = []
    classes = sorted(found.classes, key=lambda b: -len(b.constraints))
    for block in classes:
        over_rows += block.constraints
        over_columns += block.unknowns
        if len(block.constraints) > 1:
            blocks.append(("class", list(block.constraints), list(block.unknowns), "class"))
    over_columns += [x for x in found.over.unknowns if x not in over_columns]
    if over_rows:
        blocks.insert(0, ("over", over_rows, over_columns, "over"))
    return rows + over_rows, columns + over_columns, blocks


def incidence(found: Decomposition, *, split: Split | None = None) -> Figure:
    """Incidence of constraints and unknowns, sorted after Dulmage and Mendelsohn, with the faults beside it.

    Parameters
    ----------
    found : Decomposition
        Decomposition of the model.
    split : Split, optional
        Sorts the rows by the two parts of a cascade instead and marks the shared unknowns.

    Returns
    -------
    Figure

    Raises
    ------
    ParameterError
        If the split belongs to another model.
    """
    s = found.structure
    rows, columns, blocks = _order(found)
    if split is not None:
        if sorted((*split.upstream, *split.downstream)) != sorted(s.constraints):
            raise ParameterError(f"incidence: the split does not have the constraints of {s.name}.")
        rows = [*split.upstream, *split.downstream]
        up = [x for x in s.unknowns_of(split.upstream) if x not in split.shared]
        columns = [*up, *split.shared, *(x for x in s.unknowns if x not in up and x not in split.shared)]
        blocks = [
            ("up", list(split.upstream), [*up, *split.shared], "up"),
            ("down", list(split.downstream), [x for x in columns if x not in up], "down"),
        ]
    gap = 0.6
    width, height = len(columns) + (gap + len(s.faults) if s.faults else 0), len(rows)
    with style():
        wide = max(CELL * width + 1.0, 4.8)
        figure, axes = plt.subplots(figsize=(min(PAGE, wide), CELL * height + 1.25))
        axes.set_xlim(-0.5, width - 0.5)
        axes.set_ylim(height - 0.5, -0.5)
        axes.grid(False)
        for kind, in_rows, in_columns, _ in blocks:
            _frame(axes, kind, [rows.index(c) for c in in_rows], [columns.index(x) for x in in_columns])
        if split is not None:
            for x in split.shared:
                axes.axvspan(columns.index(x) - 0.5, columns.index(x) + 0.5, fc=_TINT, ec="none", zorder=0)
        drawn = _marks(axes, s, rows, columns, gap)
        ticks = [*range(len(columns)), *(len(columns) + gap + k for k in range(len(s.faults)))]
        axes.set_xticks(ticks, [symbol(x) for x in (*columns, *s.faults)])
        axes.set_yticks(range(height), [_constraint(c) for c in rows])
        axes.xaxis.tick_top()
        axes.tick_params(length=0, pad=2)
        for spine in axes.spines.values():
            spine.set_visible(False)
        axes.text((len(columns) - 1) / 2, -1.6, "unknown variables", ha="center", va="bottom")
        if s.faults:
            axes.text(len(columns) + gap + (len(s.faults) - 1) / 2, -1.6, "faults", ha="center", va="bottom")
            axes.axvline(len(columns) - 0.5 + gap / 2, color=COLOURS["grey"], lw=0.6)
        axes.set_ylabel("constraints")
        axes.set_aspect("equal")
        handles = drawn + _frame_handles({kind for kind, *_ in blocks}, split is not None)
        figure.legend(handles=handles, loc="outside lower center", ncols=2, frameon=False)
    return figure


def _frame(axes: Axes, kind: str, rows: Sequence[int], columns: Sequence[int]) -> None:
    if not rows or not columns:
        return
    corner = (min(columns) - 0.5, min(rows) - 0.5)
    size = (max(columns) - min(columns) + 1, max(rows) - min(rows) + 1)
    face = {"class": _LIGHT, "square": _TINT, "under": "#EEEEEE"}.get(kind, "none")
    edge = {"over": COLOURS["black"], "up": COLOURS["blue"], "down": COLOURS["red"]}.get(kind, COLOURS["grey"])
    line = "--" if kind in ("down",) else "-"
    inner = kind in ("class", "square", "under")
    axes.add_patch(
        Rectangle(
            corner, *size, fc=face, ec=edge, lw=0.7 if inner else 1.3, ls=line, zorder=1 if inner else 2, clip_on=False
        )
    )


def _frame_handles(kinds: set[str], split: bool) -> list[Any]:
    names = {
        "over": ("none", COLOURS["black"], "-", "over-determined part"),
        "class": (_LIGHT, COLOURS["grey"], "-", "constraints that leave together"),
        "square": (_TINT, COLOURS["grey"], "-", "exactly determined block"),
        "under": ("#EEEEEE", COLOURS["grey"], "-", "under-determined part"),
        "up": ("none", COLOURS["blue"], "-", "upstream part"),
        "down": ("none", COLOURS["red"], "--", "downstream part"),
    }
    found = [Patch(fc=f, ec=e, ls=ls, label=t) for kind, (f, e, ls, t) in names.items() if kind in kinds]
    return found + ([Patch(fc=_TINT, ec="none", label="shared unknown")] if split else [])


def _marks(axes: Axes, s: Structure, rows: Sequence[str], columns: Sequence[str], gap: float) -> list[Any]:
    """Draw all marks; returns the entries of the legend."""
    rates = {(c, rate) for c, rate, _ in s.differential}
    states = {(c, state) for c, _, state in s.differential}
    kinds: dict[str, tuple[list[tuple[float, float]], dict[str, Any], str]] = {
        "plain": ([], {"marker": "s", "mfc": COLOURS["black"]}, "unknown in an algebraic relation"),
        "rate": ([], {"marker": "^", "mfc": COLOURS["black"]}, "rate in its differential constraint"),
        "state": ([], {"marker": "s", "mfc": "white"}, "state in its differential constraint"),
    }
    for i, c in enumerate(rows):
        for x in s.unknowns_of([c]):
            kind = "rate" if (c, x) in rates else "state" if (c, x) in states else "plain"
            kinds[kind][0].append((columns.index(x), i))
        for f in s.faults_of([c]):
            k = s.faults.index(f)
            axes.plot(
                len(columns) + gap + k, i, ls="none", ms=6.5, zorder=4, mec=COLOURS["black"], mew=0.5,
                marker=_FAULT_MARKERS[k % 6], color=_FAULT_COLOURS[k % 6],
            )  # fmt: skip
    handles = []
    for points, look, text in kinds.values():
        if points:
            at = np.array(points)
            options: dict[str, Any] = {"ls": "none", "ms": 5, "mec": COLOURS["black"], "mew": 0.9, "zorder": 4} | look
            axes.plot(at[:, 0], at[:, 1], **options)
            handles.append(Line2D([], [], label=text, **options))
    if s.faults:
        handles.append(
            Line2D([], [], ls="none", marker="o", ms=6, color=_FAULT_COLOURS[0], mec=COLOURS["black"], mew=0.5,
                   label="fault enters the constraint")
        )  # fmt: skip
    return handles


def isolation(structure: Structure, residuals: dict[str, Sequence[str]]) -> Figure:
    """Which residual reacts to which fault, and which fault can be taken for which other.

    Parameters
    ----------
    structure : Structure
        The model with its faults.
    residuals : dict of str to sequence of str
        Name of each residual and the constraints that it uses.

    Returns
    -------
    Figure
        On the left the signatures; on the right what any set of residuals of the model can tell apart at best.
    """
    reacts = signature(structure, residuals.values())
    best = isolability(structure)
    n = len(structure.faults)
    with style():
        figure, (left, right) = plt.subplots(
            1, 2, figsize=(PAGE, 0.3 * max(n, len(residuals)) + 1.35), gridspec_kw={"wspace": 0.08}
        )
        faults = [symbol(f) for f in structure.faults]
        _cells(left, np.where(reacts, COLOURS["blue"], "white"), reacts, "reacts", COLOURS["blue"], "blind")
        left.set_xticks(range(n), faults)
        left.set_yticks(range(len(residuals)), [f"${name[0]}_{{{name[1:]}}}$" for name in residuals])
        left.set_title("Residuals and faults")
        left.set_xlabel("fault")
        left.set_ylabel("residual")
        _confusion(right, best, faults)
    return figure


def _confusion(axes: Axes, best: Isolability, faults: Sequence[str]) -> None:
    confused = ~best.isolable
    np.fill_diagonal(confused, False)
    faces = np.where(confused, COLOURS["orange"], "white").astype(object)
    np.fill_diagonal(faces, "#DDDDDD")
    faces[~best.detectable] = COLOURS["black"]
    _cells(axes, faces, confused, "can be taken for it", COLOURS["orange"], "told apart")
    axes.set_xticks(range(len(faults)), faults)
    axes.set_yticks(range(len(faults)), faults)
    axes.set_title("Faults by presence and absence of reactions")
    axes.set_xlabel("explanation")
    axes.set_ylabel("fault present")


def _cells(axes: Axes, faces: Any, marked: Any, yes: str, colour: str, no: str) -> None:
    rows, columns = np.shape(faces)
    axes.set_xlim(-0.5, columns - 0.5)
    axes.set_ylim(rows - 0.5, -0.5)
    axes.grid(False)
    for i in range(rows):
        for j in range(columns):
            axes.add_patch(
                Rectangle((j - 0.5, i - 0.5), 1, 1, fc=faces[i][j], ec=COLOURS["grey"], lw=0.5, clip_on=False)
            )
            if marked[i, j]:  # colour is never the only difference
                axes.plot(
                    j, i, marker="x", color="white" if colour == COLOURS["blue"] else COLOURS["black"], ms=5, mew=1.4
                )
    axes.tick_params(length=0)
    for spine in axes.spines.values():
        spine.set_visible(False)
    handles = [
        Patch(fc=colour, ec=COLOURS["grey"], lw=0.5, label=f"{yes} (×)"),
        Patch(fc="white", ec=COLOURS["grey"], lw=0.5, label=no),
    ]
    axes.legend(handles=handles, loc="upper center", bbox_to_anchor=(0.5, -0.2), ncols=2, frameon=False)


def cascade(model: StructuralModel, split: Split) -> Figure:
    """The two parts of a system, what they share, what each measures, and where the faults enter.

    Parameters
    ----------
    model : StructuralModel
        The whole system.
    split : Split
        Its split.

    Returns
    -------
    Figure

    Raises
    ------
    ParameterError
        If the split does not belong to the model.
    """
    if sorted((*split.upstream, *split.downstream)) != sorted(model.names):
        raise ParameterError(f"cascade: the split does not have the constraints of {model.name}.")
    upstream, downstream = split_model(model, split)
    known = model.submodel(split.downstream).known  # without the shared variables, which have an arrow of their own
    with style():
        figure, axes = d.sheet(PAGE, 2.35)
        y, size = 1.25, (2.3, 1.05)
        for x, part, names, face in (
            (1.85, upstream, split.upstream, d.ROTATING),
            (5.05, downstream, split.downstream, d.LIQUID),
        ):
            subsets = len(mso_matrix(part.structure()))
            kind = "Upstream part" if part is upstream else "Downstream part"
            residuals = f"{subsets} subset{'s' if subsets != 1 else ''} to test"
            d.block(axes, (x, y), size, f"{kind}\n{len(names)} constraints\n{residuals}", face)
            here = upstream.faults if part is upstream else downstream.faults
            for k, fault in enumerate(here):
                at = x + (k - (len(here) - 1) / 2) * 0.42
                d.arrow(axes, [(at, 2.1), (at, y + size[1] / 2)], COLOURS["red"])
                d.label(axes, (at, 2.2), symbol(fault.name), d.SYMBOLS, color=COLOURS["red"])
            signals = upstream.known if part is upstream else known
            d.arrow(axes, [(x, 0.4), (x, y - size[1] / 2)], COLOURS["blue"])
            d.label(axes, (x, 0.25), "known: " + ", ".join(symbol(s.name) for s in signals))
        d.arrow(axes, [(3.0, y), (3.9, y)], COLOURS["blue"])
        d.label(axes, (3.45, y + 0.16), ", ".join(symbol(s) for s in split.shared), d.SYMBOLS)
        d.arrow(axes, [(6.2, y), (6.95, y)], COLOURS["blue"])
        d.label(axes, (6.58, y + 0.16), "$r$", d.SYMBOLS)
    return figure
