"""Thesis 7.4: tables of the campaigns of the steady-state scheme, and beside them those of the residual observers."""

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pumplib.campaign.residual_tables import NO_ALARM, NO_REST, detections, false_alarms
from pumplib.campaign.steady import METHODS, OUTSIDE, QUANTITIES
from pumplib.errors import DataError

__all__ = [
    "METHODS", "METHOD_NAMES", "NAMED", "QUANTITIES", "SINGLE", "UNIQUE", "UNIQUE_KF", "WINDOW", "beside",
    "by_operating_point", "confusion",
    "detections", "false_alarms", "hypotheses", "runs_of", "share", "smallest_rate", "smallest_share",
]  # fmt: skip

Array = NDArray[Any]
METHOD_NAMES: Mapping[str, str] = {
    "plain": "set of one point",
    "single": "one point and healthy block",
    "window": "window and healthy block",
    "strict": "window, no margin",
}
SINGLE = {"clogging": 1e10, "friction": 2.5e-4, "leakage": 6e-8, "cavitation": 0.025, "dry_running": 0.35}
WINDOW = {"clogging": 2.5e9, "friction": 2.5e-4, "leakage": 3e-8, "cavitation": 0.006}
NAMED = {"clogging": 2e10, "friction": 5e-4, "leakage": 2.4e-7, "cavitation": 0.1, "dry_running": 0.9}
UNIQUE = {"leakage": 6e-8, "cavitation": 0.025, "friction": 5e-4}
UNIQUE_KF = {"clogging": 2e10}
CLAIMS = tuple(
    f"ch7.{name}"
    for name in (
        "single", "false", "transient", "window", "strict_stretch", "identify_residuals", "hypotheses", "unique",
        "unique_Kf_stretch",
    )
)  # fmt: skip
"""Claims that are judged on the campaign's table."""


def runs_of(table: Any, fault: str, size: float) -> Any:
    """Runs with a fault of one size.

    Parameters
    ----------
    table : pandas.DataFrame
        Of a campaign with the scheme `pumplib.campaign.steady`.
    fault : str
        As in the column ``fault``.
    size : float
        Its size; 0 for "none".

    Returns
    -------
    pandas.DataFrame

    Raises
    ------
    DataError
        If there is no such run.
    """
    rows = table[(table["fault"] == fault) & np.isclose(table["size"].astype(float), size, rtol=1e-9, atol=0.0)]
    if rows.empty:
        known = sorted({f"{a} {b:g}" for a, b in zip(table["fault"], table["size"], strict=True)})
        raise DataError(f"campaign table: no run with {fault} {size:g}; there are {', '.join(known)}.")
    return rows


def share(table: Any, column: str, sizes: Mapping[str, float]) -> tuple[float, int, int]:
    """Share of the runs of some faults in which a column is one; runs without a value are left out.

    Parameters
    ----------
    table : pandas.DataFrame
        Of a campaign with the scheme `pumplib.campaign.steady`.
    column : str
        Of zeros and ones, such as ``truth_in``.
    sizes : mapping of str to float
        Faults and sizes.

    Returns
    -------
    value : float
    hits, runs : int

    Raises
    ------
    DataError
        If there is no run, or none with a value.
    """
    values = np.concatenate(
        [runs_of(table, fault, size)[column].dropna().to_numpy(dtype=float) for fault, size in sizes.items()]
    )
    if not len(values):
        raise DataError(f"campaign table: column {column} has no value in the runs asked for.")
    return float(values.mean()), int(values.sum()), len(values)


def smallest_share(table: Any, column: str, sizes: Mapping[str, float]) -> tuple[float, int]:
    """Smallest share over some faults in which a column is one.

    Parameters
    ----------
    table : pandas.DataFrame
        Of a campaign with the scheme `pumplib.campaign.steady`.
    column : str
        Of zeros and ones.
    sizes : mapping of str to float
        Faults and sizes.

    Returns
    -------
    value : float
    runs : int
        Of all the faults together.

    Raises
    ------
    DataError
        If there is no run of a fault and size.
    """
    each = [share(table, column, {fault: size}) for fault, size in sizes.items()]
    return min(one[0] for one in each), sum(one[2] for one in each)


def smallest_rate(table: Any, method: str, sizes: Mapping[str, float]) -> tuple[float, int]:
    """Smallest detection rate over some faults.

    Parameters
    ----------
    table : pandas.DataFrame
        Of a campaign with the scheme `pumplib.campaign.steady`.
    method : str
        Of `METHODS`, or "strict".
    sizes : mapping of str to float
        Faults and sizes.

    Returns
    -------
    value : float
    runs : int
        Of all the faults together.

    Raises
    ------
    DataError
        If there is no run of a fault and size.
    """
    return smallest_share(table, f"{method}_found", sizes)


def hypotheses(table: Any) -> list[dict[str, Any]]:
    """What the hypotheses came to, for every fault and size.

    Parameters
    ----------
    table : pandas.DataFrame
        Of a campaign with the scheme `pumplib.campaign.steady`.

    Returns
    -------
    list of dict
        ``fault``, ``size``, ``runs``; ``tested``: runs with points after the alarm; of these the shares with the truth
        left over, ``truth_in``, and with its size in the range, ``size_in``; of all runs the share in which the truth
        alone is left, ``unique``; ``answers``: mean number left over; ``width``: median width of the range over the
        size; ``delay``: median time from the onset to the truth alone, s. None where there is nothing to take it of.

    Raises
    ------
    DataError
        If there is no faulty run.
    """
    faulty = table[table["fault"] != "none"]
    if faulty.empty:
        raise DataError("campaign table: no run with a fault; take the whole table.")
    found = []
    for (fault, size), rows in faulty.groupby(["fault", "size"], sort=False):
        tested = rows[rows["tested"] > 0]
        width = (tested["size_high"].astype(float) - tested["size_low"].astype(float)) / float(size)
        left = tested["possible"].map(lambda text: 0 if text == OUTSIDE else len(text.split("|")))
        found.append({
            "fault": fault, "size": float(size), "runs": len(rows), "tested": len(tested),
            "truth_in": _mean(tested["truth_in"]), "unique": _mean(rows["unique"]), "answers": _mean(left),
            "size_in": _mean(tested["size_in"]), "width": _median(width), "delay": _median(rows["unique_delay"]),
        })  # fmt: skip
    return found


def _mean(values: Any) -> float | None:
    kept = values.dropna().astype(float)
    return float(kept.mean()) if len(kept) else None


def _median(values: Any) -> float | None:
    kept = values.dropna().astype(float)
    return float(kept.median()) if len(kept) else None


def by_operating_point(
    table: Any, method: str, sizes: Mapping[str, float], speed: float = 250.0, flow: float = 1.1e-3
) -> list[dict[str, Any]]:
    """Detection in the first point after the fault, by where the pump was running then.

    Parameters
    ----------
    table : pandas.DataFrame
        Of a campaign with the scheme `pumplib.campaign.steady`.
    method : str
        Of `METHODS`.
    sizes : mapping of str to float
        Faults and sizes.
    speed, flow : float
        Borders between low and high, of the supply frequency in rad/s and of the measured flow in m3/s.

    Returns
    -------
    list of dict
        ``fault``, ``size``, ``speed`` and ``flow`` ("low" or "high"), ``runs``, ``hits``, ``rate`` (None without runs);
        four a fault.

    Raises
    ------
    DataError
        If there is no run of a fault and size.
    """
    found = []
    for fault, size in sizes.items():
        rows = runs_of(table, fault, size)
        rows = rows[rows["first_omega_e"].notna()]
        fast, much = rows["first_omega_e"].astype(float) >= speed, rows["first_Q"].astype(float) >= flow
        for high_speed in (False, True):
            for high_flow in (False, True):
                hits = rows[(fast == high_speed) & (much == high_flow)][f"first_{method}"].astype(float)
                found.append({
                    "fault": fault, "size": size, "speed": "high" if high_speed else "low",
                    "flow": "high" if high_flow else "low", "runs": len(hits), "hits": int(hits.sum()),
                    "rate": float(hits.mean()) if len(hits) else None,
                })  # fmt: skip
    return found


def confusion(table: Any, sizes: Mapping[str, float]) -> tuple[tuple[str, ...], tuple[str, ...], Array]:
    """What the signs said about the runs with each fault.

    Parameters
    ----------
    table : pandas.DataFrame
        Of a campaign with the scheme `pumplib.campaign.steady`.
    sizes : mapping of str to float
        Size of each fault.

    Returns
    -------
    faults : tuple of str
        True faults, as in `sizes`.
    statements : tuple of str
        The hypotheses of `QUANTITIES`, "not said" and "no alarm".
    counts : ndarray of int, shape (faults, statements)

    Raises
    ------
    DataError
        If there is no run of a fault and size.
    """
    faults, statements = tuple(sizes), (*QUANTITIES.values(), NO_REST, NO_ALARM)
    counts = np.zeros((len(faults), len(statements)), dtype=int)
    for i, (fault, size) in enumerate(sizes.items()):
        rows = runs_of(table, fault, size)
        for said, hit in zip(rows["signs_class"].fillna(""), rows["single_found"], strict=True):
            counts[i, statements.index(said or (NO_REST if hit else NO_ALARM))] += 1
    return faults, statements, counts


def beside(
    table: Any, residual: Any, methods: Iterable[str] = METHODS, monitors: Iterable[str] = ("observers", "calibrated")
) -> list[dict[str, Any]]:
    """Methods of this chapter and monitors of the residual campaign at the same faults and sizes.

    Parameters
    ----------
    table : pandas.DataFrame
        Of a campaign with the scheme `pumplib.campaign.steady`.
    residual : pandas.DataFrame
        Of a campaign with the scheme `pumplib.campaign.residual`.
    methods, monitors : iterable of str
        Which of each.

    Returns
    -------
    list of dict
        One line a fault and size that both have, first the healthy runs with ``fault`` = "none", where the rates are
        those of false alarms: ``fault``, ``size``, and of each method ``<name>_runs``, ``<name>_rate``,
        ``<name>_delay`` (s, median; None for the healthy runs).

    Raises
    ------
    DataError
        If one of them has no healthy or no faulty run.
    """
    parts = [(table, list(methods)), (residual, list(monitors))]
    first: dict[str, Any] = {"fault": "none", "size": 0.0}
    lines: dict[tuple[str, str], dict[str, Any]] = {}
    seen: list[set[tuple[str, str]]] = []
    for one, names in parts:
        for row in false_alarms(one, names):
            first |= _columns(row, None)
        here = set()
        for row in detections(one, names):
            key = (row["fault"], f"{row['size']:.6g}")
            here.add(key)
            lines.setdefault(key, {"fault": row["fault"], "size": row["size"]}).update(_columns(row, row["delay"]))
        seen.append(here)
    order = list(QUANTITIES)
    both = sorted(seen[0] & seen[1], key=lambda key: (order.index(key[0]), float(key[1])))
    return [first, *(lines[key] for key in both)]


def _columns(row: Mapping[str, Any], delay: float | None) -> dict[str, Any]:
    name = row["monitor"]
    return {f"{name}_runs": row["runs"], f"{name}_rate": row["rate"], f"{name}_delay": delay}
