"""Thesis 5.3: figures of the Monte Carlo campaigns of the stator observer: detection against baselines, size error."""

from collections.abc import Mapping, Sequence
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pumplib.campaign.stator_runs import CONDITIONS, MAIN
from pumplib.campaign.stator_tables import condition_name
from pumplib.errors import ParameterError
from pumplib.plots.style import COLOURS, PAGE, style

Row = Mapping[str, Any]
_DETECTORS = {
    "decision": ("blue", "o", "-"),
    "decision on the observer's own g_c": ("sky", "D", "-"),
    "static compensated I2": ("green", "s", "--"),
    "star-point voltage": ("purple", "^", "-."),
    "raw I2": ("red", "v", ":"),
}


def _plain(row: Row) -> bool:
    return row["r_f"] == 0 and row["loop"] == "phase" and row["test"] == "drawn"


def _rates(ax: Axes, rows: Sequence[Row], colour: str, marker: str, line: str, label: str, shift: float) -> None:
    rows = sorted(rows, key=lambda one: float(one["gamma"]))
    x = 100 * np.array([one["gamma"] for one in rows]) * shift
    y = 100 * np.array([[one["share"], one["low"], one["high"]] for one in rows])
    ax.errorbar(
        x, y[:, 0], yerr=[np.maximum(y[:, 0] - y[:, 1], 0), np.maximum(y[:, 2] - y[:, 0], 0)], fmt=marker + line, ms=4,
        color=COLOURS[colour], lw=1.0, capsize=2, label=label,
    )  # fmt: skip


def detection(rows: Sequence[Row]) -> Figure:
    """Detection over the size: the decision against its baselines, and the decision under all conditions.

    Parameters
    ----------
    rows : sequence of mapping
        Of `pumplib.campaign.stator_tables.detections`.

    Returns
    -------
    Figure

    Raises
    ------
    ParameterError
        If there is no bolted single-phase short among them.
    """
    plain = [one for one in rows if _plain(one)]
    if not plain:
        raise ParameterError("detection: no bolted short of one phase in the rows; run the campaign with such cells.")
    with style():
        figure, (left, right) = plt.subplots(1, 2, figsize=(PAGE, 3.9), sharey=True)
        for k, (name, look) in enumerate(_DETECTORS.items()):
            mine = [
                one for one in plain if one["detector"] == name and all(one[c] == MAIN[c] for c in CONDITIONS)
            ]  # fmt: skip
            if mine:
                _rates(left, mine, *look, name, 1.03 ** (k - 2))
        looks = (
            ("blue", "o", "-"), ("orange", "D", "-"), ("green", "s", "--"), ("red", "v", "-."), ("purple", "^", ":"),
            ("sky", "P", "-"), ("black", "x", "--"),
        )  # fmt: skip
        names = list(dict.fromkeys(condition_name(one) for one in plain))
        for k, name in enumerate(names):
            mine = [one for one in plain if one["detector"] == "decision" and condition_name(one) == name]
            _rates(right, mine, *looks[k % len(looks)], name, 1.03 ** (k - 2))
        left.set_title("One healthy record, against baselines")
        right.set_title("Decision, other conditions")
        left.set_ylabel("detected / %")
        ticks = sorted({100 * float(one["gamma"]) for one in plain})
        for ax in (left, right):
            ax.set_xscale("log")
            ax.set_xticks(ticks, [f"{one:g}" for one in ticks])
            ax.set_xticks([], minor=True)
            ax.set_xlabel(r"shorted turns $\gamma$ / %")
            ax.set_ylim(-3, 103)
            ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.18), fontsize=7, ncols=1 if ax is left else 2)
    return figure


def size_error(rows: Sequence[Row]) -> Figure:
    """Relative error of the size, median and 90 % of the runs, over the size.

    Parameters
    ----------
    rows : sequence of mapping
        Of `pumplib.campaign.stator_tables.sizes`.

    Returns
    -------
    Figure

    Raises
    ------
    ParameterError
        If there is no bolted single-phase short under the main conditions among them.
    """
    main = [one for one in rows if all(one[c] == MAIN[c] for c in CONDITIONS)]
    plain = [one for one in main if _plain(one)]
    resistive = [one for one in main if one["r_f"] > 0 and one["loop"] == "phase"]
    if not plain:
        raise ParameterError("size_error: no bolted short of one phase in the rows; run the campaign with such cells.")
    kinds = (("not known", "blue", "o"), ("from the healthy part", "green", "s"), ("known", "red", "x"))
    with style():
        figure, ax = plt.subplots(figsize=(PAGE, 3.2))
        ax.axhspan(-10, 10, color=COLOURS["green"], alpha=0.12, lw=0, label=r"$\pm$10 %")
        ax.axhline(0, color=COLOURS["black"], lw=0.7)
        for k, (kind, colour, marker) in enumerate(kinds):
            for some, label, fill in ((plain, f"$r_s$ {kind}", True), (resistive, "", False)):
                mine = [one for one in some if one["resistance"] == kind]
                if not mine or (not fill and kind != "not known"):
                    continue
                x = 100 * np.array([one["gamma"] for one in mine]) * 1.04 ** (k - 1 if fill else 2)
                y = 100 * np.array([[one["median"], one["low"], one["high"]] for one in mine])
                ax.errorbar(
                    x, y[:, 0], yerr=[y[:, 0] - y[:, 1], y[:, 2] - y[:, 0]], fmt=marker if fill else "^", ms=4,
                    color=COLOURS[colour if fill else "purple"], mfc=None if fill else "none", capsize=2, lw=1.0,
                    label=label or r"with contact resistance, $r_f$ = 5 ohm $\times\,\gamma$",
                )  # fmt: skip
        ticks = sorted({100 * float(one["gamma"]) for one in plain})
        ax.set_xscale("log")
        ax.set_xticks(ticks, [f"{one:g}" for one in ticks])
        ax.set_xticks([], minor=True)
        ax.set_xlabel(r"shorted turns $\gamma$ / %")
        ax.set_ylabel(r"error of $\hat\gamma_R$ / %, median and 90 %")
        ax.legend(loc="upper right", ncols=2)
    return figure
