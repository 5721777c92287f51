"""Thesis, all chapters: a campaign's table in a few lines: rates and quantiles of every cell, with intervals."""

import csv
import io
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from pumplib.campaign.rates import quantile, rate
from pumplib.campaign.results import RESULTS, provenance, read
from pumplib.campaign.schemes import load_scheme
from pumplib.campaign.spec import Campaign
from pumplib.campaign.store import write_bytes

Table = list[dict[str, Any]]
QUANTILES = (0.05, 0.5, 0.95)
LEVEL = 0.95
_PLACE = ("cell", "role", "run", "row")


def summarise(campaign: Campaign, folder: Path | None = None) -> dict[str, Table]:
    """Summary tables of the results of a campaign.

    A scheme with a function ``summarise(table, campaign)`` makes its own. Otherwise every column of zeros and ones
    becomes a rate with its exact interval, widened where several rows come from one machine, and every other column
    of numbers its quantiles, for each cell and for each value of the scheme's ``groups``. Columns are read one after
    the other, so memory stays small.

    Parameters
    ----------
    campaign : Campaign
        The campaign.
    folder : Path, optional
        Of the results; ``data/campaigns/results`` by default.

    Returns
    -------
    dict of str to list of dict
        ``rates`` and ``quantiles``, or what the scheme made.
    """
    scheme: Any = load_scheme(campaign.path)
    if hasattr(scheme, "summarise"):
        found: dict[str, Table] = scheme.summarise(read(campaign.name, folder).table, campaign)
        return found
    by = ["cell", *getattr(scheme, "groups", ())]
    kinds: Mapping[str, str] = provenance(campaign.name, folder)["table"]["columns"]
    left_out = {*_PLACE, *by, *campaign.swept}
    rates: Table = []
    quantiles: Table = []
    for column in (name for name, kind in kinds.items() if kind in ("int", "float") and name not in left_out):
        table = read(campaign.name, folder, [*by, "run", column]).table
        binary = bool(table[column].isin((0, 1)).all())
        for key, part in table.groupby(by, sort=False, dropna=False):
            place = dict(zip(by, key, strict=True))
            values = part[column].to_numpy()
            if binary:
                # several rows of one run come from one machine
                clusters = part["run"].to_numpy() if part["run"].duplicated().any() else None
                one = rate(values, LEVEL, clusters=clusters)
                row = {"hits": int(values.sum()), "n": one.n, "rate": one.value, "low": one.low, "high": one.high}
                rates.append({**place, "column": column, **row})
                continue
            there = values[part[column].notna()]
            for q in QUANTILES if len(there) else ():
                one = quantile(there, q, LEVEL)
                row = {"quantile": q, "value": one.value, "low": one.low, "high": one.high}
                # runs without a value are counted beside, not taken for one
                counts = {"n": one.n, "without": len(values) - one.n}
                quantiles.append({**place, "column": column, **row, **counts})
    return {name: rows for name, rows in (("rates", rates), ("quantiles", quantiles)) if rows}


def write_summary(campaign: Campaign, folder: Path | None = None) -> list[Path]:
    """Write each summary table beside the results.

    Parameters
    ----------
    campaign : Campaign
        The campaign.
    folder : Path, optional
        Of the results; ``data/campaigns/results`` by default.

    Returns
    -------
    list of Path
        ``NAME.rates.csv`` and so on.
    """
    written = []
    for name, rows in summarise(campaign, folder).items():
        out = io.StringIO()
        writer = csv.writer(out, lineterminator="\n")
        writer.writerow(rows[0])
        writer.writerows([_shown(value) for value in row.values()] for row in rows)
        path = (folder or RESULTS) / f"{campaign.name}.{name}.csv"
        write_bytes(path, out.getvalue().encode())
        written.append(path)
    return written


def _shown(value: Any) -> Any:
    return f"{value:.6g}" if isinstance(value, float) else value


def to_text(rows: Sequence[Mapping[str, Any]]) -> str:
    """A table for the terminal.

    Parameters
    ----------
    rows : sequence of mapping
        With the same keys.

    Returns
    -------
    str
    """
    texts = [list(rows[0]), *([f"{v:.4g}" if isinstance(v, float) else str(v) for v in row.values()] for row in rows)]
    widths = [max(map(len, column)) for column in zip(*texts, strict=True)]
    return "\n".join(
        "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in texts
    )
