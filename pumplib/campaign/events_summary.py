"""Thesis 4.4.2: what the stored runs of the signal-based scheme say: confusion, correct groups, false alarms, sizes."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pumplib.campaign.rates import DetectionSize, detection_size, rate
from pumplib.errors import DataError

Array = NDArray[Any]
TRUTHS = ("none", "G1", "G2", "G3", "G4", "G5", "G6")
VERDICTS = (*TRUTHS, "G7", "ambiguous", "multiple", "inconsistent")
CLAIM, LADDER = "claim", "ladder"
"""Cells of the campaign: sizes one step above the 90 % detection size, and the sizes that this size comes from."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Confusion:
    """Runs by truth and verdict.

    Parameters
    ----------
    truths, verdicts : tuple of str
        Rows and columns; only those that occur, verdicts beside the truths.
    counts : ndarray of int, shape (truths, verdicts)
        Runs.
    """

    truths: tuple[str, ...]
    verdicts: tuple[str, ...]
    counts: Array


def _part(table: Any, cell: str | None, disturbance: str | None = None) -> Any:
    for column in ("cell", "run", "group", "disturbance", "acted", "correct", "detected", "false_alarm"):
        if column not in table:
            raise DataError(f"events: column {column!r} is absent; give the table of a campaign of scheme events.")
    part = table if cell is None else table[table["cell"] == cell]
    if disturbance is not None:
        part = part[part["disturbance"] == disturbance]
    if not len(part):
        raise DataError(
            f"events: no run with cell {cell!r}, disturbance {disturbance!r}; cells are "
            f"{', '.join(map(str, table['cell'].unique()))}, disturbances "
            f"{', '.join(map(str, table['disturbance'].unique()))}."
        )
    return part


def confusion(table: Any, cell: str | None = CLAIM, disturbance: str | None = None) -> Confusion:
    """Confusion matrix of groups and verdicts.

    Parameters
    ----------
    table : pandas.DataFrame
        `pumplib.campaign.results.Result.table` of the campaign.
    cell : str, optional
        Cell; None for all.
    disturbance : str, optional
        Only runs with this disturbing event.

    Returns
    -------
    Confusion

    Raises
    ------
    DataError
        If no run is left, or a verdict is not known.
    """
    part = _part(table, cell, disturbance)
    # a healthy run's verdict is its false alarm, if there was one; a faulty run's is the one acted on
    pairs = list(zip(part["group"].astype(str), part["acted"].astype(str), strict=True))
    strange = {said for _, said in pairs} - set(VERDICTS)
    if strange:
        raise DataError(f"events: verdict {sorted(strange)[0]!r} is not one of {', '.join(VERDICTS)}.")
    truths = tuple(one for one in TRUTHS if any(group == one for group, _ in pairs))
    verdicts = tuple(one for one in VERDICTS if one in truths or any(said == one for _, said in pairs))
    counts = np.zeros((len(truths), len(verdicts)), np.int64)
    for group, said in pairs:
        counts[truths.index(group), verdicts.index(said)] += 1
    return Confusion(truths=truths, verdicts=verdicts, counts=counts)


def _rated(part: Any, column: str, **place: Any) -> dict[str, Any]:
    one = rate(part[column].to_numpy(), clusters=(part["cell"].astype(str) + part["run"].astype(str)).to_numpy())
    return {**place, "n": one.n, "runs": int(part[column].sum()), "rate": one.value, "low": one.low, "high": one.high}


def _by(part: Any, column: str, keys: Iterable[str]) -> list[dict[str, Any]]:
    by = list(keys)
    rows = [
        _rated(some, column, **dict(zip(by, map(_plain, key), strict=True)))
        for key, some in part.groupby(by, sort=False)
    ]
    return [*rows, _rated(part, column, **dict.fromkeys(by, "all"))]


def _plain(value: Any) -> Any:
    return value.item() if hasattr(value, "item") else value


def correct_group(table: Any, cell: str | None = CLAIM) -> list[dict[str, Any]]:
    """Share of faulty runs in which the scheme acted on the right group, without a false alarm before.

    Parameters
    ----------
    table : pandas.DataFrame
        Of the campaign.
    cell : str, optional
        Cell; None for all.

    Returns
    -------
    list of dict
        ``group``, ``fault``, ``size``, ``n``, ``runs`` (correct), ``rate``, ``low``, ``high`` (Clopper and Pearson,
        95 %, machines as clusters); the last row is all runs together.
    """
    part = _part(table, cell)
    return _by(part[part["group"] != "none"], "correct", ("group", "fault", "size"))


def by_disturbance(table: Any, cell: str | None = CLAIM) -> list[dict[str, Any]]:
    """Share of right groups, for each group and disturbing event.

    Parameters
    ----------
    table : pandas.DataFrame
        Of the campaign.
    cell : str, optional
        Cell; None for all.

    Returns
    -------
    list of dict
        ``group``, ``disturbance`` and the rest as in `correct_group`.
    """
    part = _part(table, cell)
    return _by(part[part["group"] != "none"], "correct", ("group", "disturbance"))


def false_alarms(table: Any, cell: str | None = None) -> list[dict[str, Any]]:
    """Healthy runs with an alarm.

    Parameters
    ----------
    table : pandas.DataFrame
        Of the campaign.
    cell : str, optional
        Cell; None for all.

    Returns
    -------
    list of dict
        ``disturbance``, ``n``, ``runs`` (with a false alarm), ``rate``, ``low``, ``high``; the last row is all runs.
    """
    part = _part(table, cell)
    return _by(part[part["group"] == "none"], "false_alarm", ("disturbance",))


def detection_sizes(table: Any, share: float = 0.9, cell: str | None = LADDER) -> dict[str, DetectionSize]:
    """Size of each fault that is detected in a share of the runs: any verdict that is an alarm.

    Parameters
    ----------
    table : pandas.DataFrame
        Of the campaign.
    share : float
        Share of the runs.
    cell : str, optional
        Cell; None for all.

    Returns
    -------
    dict of str to DetectionSize
        By fault.
    """
    part = _part(table, cell)
    found = {}
    for fault, some in part[part["group"] != "none"].groupby("fault", sort=False):
        sizes = sorted(some["size"].unique())
        hits = [int(some[some["size"] == size]["detected"].sum()) for size in sizes]
        runs = [int((some["size"] == size).sum()) for size in sizes]
        found[str(fault)] = detection_size(sizes, hits, runs, share)
    return found
