"""Thesis 6.7: tables of the campaigns of the residual observers: false alarms beside detections, delays, confusion."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pumplib.campaign.rates import rate
from pumplib.errors import DataError
from pumplib.observers.residual_signature import FAULTS

Array = NDArray[Any]
NO_ALARM, NO_REST = "no alarm", "not said"


def _runs(table: Any, fault: str, size: float | None = None) -> Any:
    rows = table[table["fault"] == fault]
    if size is not None:
        rows = rows[np.isclose(rows["size"].astype(float), size, rtol=1e-9, atol=0.0)]
    if rows.empty:
        known = sorted({f"{a} {b:g}" for a, b in zip(table["fault"], table["size"], strict=True)})
        wanted = fault if size is None else f"{fault} {size:g}"
        raise DataError(f"campaign table: no run with {wanted}; there are {', '.join(known)}.")
    return rows


def _row(rows: Any, column: str, **place: Any) -> dict[str, Any]:
    one = rate(rows[column].to_numpy())
    machine = rows["cell"].astype(str) + " " + rows["run"].astype(str)  # run 0 of two cells are two machines
    few = rate(rows[column].to_numpy(), clusters=machine.to_numpy()) if machine.nunique() > 1 else one
    return {
        **place, "runs": one.n, "hits": int(rows[column].sum()), "rate": one.value, "low": one.low, "high": one.high,
        "low, machines": few.low, "high, machines": few.high,
    }  # fmt: skip


def false_alarms(table: Any, monitors: Iterable[str]) -> list[dict[str, Any]]:
    """Share of the healthy runs with a false alarm.

    Parameters
    ----------
    table : pandas.DataFrame
        Of a campaign with the scheme `pumplib.campaign.residual`.
    monitors : iterable of str
        Which.

    Returns
    -------
    list of dict
        ``monitor``, ``runs``, ``hits``, ``rate``, exact 95 % limits ``low`` and ``high``, and the same limits with
        runs of one machine taken as alike.

    Raises
    ------
    DataError
        If there is no healthy run.
    """
    rows = _runs(table, "none")
    return [_row(rows, f"{one}_false", monitor=one) for one in monitors]


def detections(table: Any, monitors: Iterable[str]) -> list[dict[str, Any]]:
    """Share of the runs with an alarm after the fault, and its median delay, for every fault and size.

    Parameters
    ----------
    table : pandas.DataFrame
        Of a campaign with the scheme `pumplib.campaign.residual`.
    monitors : iterable of str
        Which.

    Returns
    -------
    list of dict
        As `false_alarms`, with ``fault``, ``size`` and ``delay`` (s, median of the detected runs, None without one).

    Raises
    ------
    DataError
        If there is no faulty run.
    """
    chosen = list(monitors)
    faulty = table[table["fault"] != "none"]
    if faulty.empty:
        raise DataError("campaign table: no run with a fault; take the whole table.")
    found = []
    for (fault, size), rows in faulty.groupby(["fault", "size"], sort=False):
        for one in chosen:
            delays = rows[f"{one}_delay"].dropna().astype(float)
            delay = float(delays.median()) if len(delays) else None
            found.append(_row(rows, f"{one}_found", fault=fault, size=float(size), monitor=one) | {"delay": delay})
    return found


def confusion(table: Any, monitor: str, sizes: Mapping[str, float]) -> tuple[tuple[str, ...], tuple[str, ...], Array]:
    """What a monitor said about the runs with each fault.

    Parameters
    ----------
    table : pandas.DataFrame
        Of a campaign with the scheme `pumplib.campaign.residual`.
    monitor : str
        One that classifies.
    sizes : mapping of str to float
        Size of each fault.

    Returns
    -------
    faults : tuple of str
        True faults, as in `sizes`.
    statements : tuple of str
        All faults, "none" (no fault fits), "not said" (alarm, but too little rest to say; or a false alarm before) and
        "no alarm".
    counts : ndarray of int, shape (faults, statements)

    Raises
    ------
    DataError
        If there is no run of a fault and size.
    """
    faults = tuple(sizes)
    statements = (*FAULTS, "none", NO_REST, NO_ALARM)
    counts = np.zeros((len(faults), len(statements)), dtype=int)
    for i, (fault, size) in enumerate(sizes.items()):
        rows = _runs(table, fault, size)
        for said, hit in zip(rows[f"{monitor}_class"], rows[f"{monitor}_found"], strict=True):
            word = said if isinstance(said, str) and said else NO_REST if hit else NO_ALARM
            counts[i, statements.index(word)] += 1
    return faults, statements, counts


def hits(table: Any, column: str, sizes: Mapping[str, float]) -> dict[str, tuple[int, int]]:
    """Hits and runs of each fault.

    Parameters
    ----------
    table : pandas.DataFrame
        Of a campaign with the scheme `pumplib.campaign.residual`.
    column : str
        Of zeros and ones, such as ``observers_found``.
    sizes : mapping of str to float
        Faults and sizes; {"none": 0.0} for the healthy runs.

    Returns
    -------
    dict of str to tuple of int
        Hits, runs.

    Raises
    ------
    DataError
        If there is no run of a fault and size.
    """
    found = {}
    for fault, size in sizes.items():
        rows = _runs(table, fault, size)
        found[fault] = (int(rows[column].sum()), len(rows))
    return found


def smallest(found: Mapping[str, tuple[int, int]]) -> tuple[str, int, int]:
    """Fault with the smallest rate.

    Parameters
    ----------
    found : mapping of str to tuple of int
        Hits and runs by fault, of `hits`.

    Returns
    -------
    fault : str
    hits, runs : int

    Raises
    ------
    DataError
        If there is none.
    """
    if not found:
        raise DataError("smallest: no fault is given; take the result of hits.")
    fault = min(found, key=lambda one: found[one][0] / found[one][1])
    return fault, *found[fault]


def same_rows(table: Any, run: int, repeated: Sequence[Mapping[str, Any]], tolerance: float = 1e-9) -> str:
    """Compare repeated rows of a machine with the committed ones.

    Parameters
    ----------
    table : pandas.DataFrame
        Committed; of one cell.
    run : int
        Number of the machine in the table.
    repeated : sequence of mapping
        Its first rows, scored again.
    tolerance : float
        Relative difference that a number may show.

    Returns
    -------
    str
        What was compared.

    Raises
    ------
    DataError
        If a value differs, or the table has several cells.
    """
    if table["cell"].nunique() != 1:
        raise DataError("same_rows: the table has several cells; take one by Result.cell.")
    before = table[table["run"] == run].sort_values("row").head(len(repeated)).to_dict("records")
    if len(before) < len(repeated):
        raise DataError(f"machine {run}: {len(before)} rows in the table, {len(repeated)} were repeated.")
    values = 0
    for number, (old, new) in enumerate(zip(before, repeated, strict=True)):
        for column, value in new.items():
            was = old[column]
            empty = was is None or was == "" or (isinstance(was, float) and np.isnan(was))
            if isinstance(value, int | float) and not empty:
                good = abs(float(was) - value) <= tolerance * max(abs(float(was)), abs(value))
            else:
                good = (empty and value in (None, "")) or was == value
            if not good:
                raise DataError(
                    f"machine {run}, row {number}: {column} = {value}, in the table {was}; run `make campaigns` if the "
                    "new number is right."
                )
            values += 1
    return f"machine {run}: {len(repeated)} runs repeated, {values} values equal to {tolerance:g}"
