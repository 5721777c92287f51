"""Thesis, all chapters: the table of a campaign with its provenance: written, read again, and checked by new runs."""

import csv
import datetime
import gzip
import hashlib
import io
import json
import math
import subprocess
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pumplib import paths
from pumplib.campaign.schemes import code_digest, code_state
from pumplib.campaign.spec import Campaign, load_campaign
from pumplib.campaign.store import Store, joined_kinds, replacing, write_bytes
from pumplib.campaign.work import Chunk, cell_text, unit_rows
from pumplib.errors import DataError, ParameterError
from pumplib.machines.quantity import Quantity, check_value

RESULTS = paths.DATA / "campaigns" / "results"
TOLERANCE = 1e-9
"""Relative difference that a repeated run may show. On the platform of the table the numbers are equal to the last
bit; elsewhere other processors fuse other multiplications and additions, and libraries sum in another order."""
_FORM = 1


def write_results(
    campaign: Campaign,
    store: Store,
    runs: tuple[int, ...],
    folder: Path,
    *,
    code: Mapping[str, Mapping[str, str]],
    spent: Mapping[str, Any],
    facts: Mapping[str, Any],
) -> tuple[Path, int]:
    """Join the parts of a campaign into one compressed table and write its provenance beside it.

    The table is streamed; equal rows give equal bytes.

    Parameters
    ----------
    campaign : Campaign
        What was run.
    store : Store
        Its parts.
    runs : tuple of int
        Runs of each cell.
    folder : Path
        Where table and provenance go.
    code : mapping
        State of the code.
    spent : mapping
        Times of the last call.
    facts : mapping
        Machine and whatever else belongs to the provenance.

    Returns
    -------
    tuple of (Path, int)
        The table, and its rows.
    """
    table = folder / f"{campaign.name}.csv.gz"
    digest = hashlib.sha256()
    columns: list[str] = []
    kinds: list[str] = []
    rows = 0
    with replacing(table) as file, gzip.GzipFile(filename="", mode="wb", fileobj=file, mtime=0) as packed:
        for head, text, count in store.pieces(runs):
            if not columns:
                columns = head["columns"]
                first = (",".join(columns) + "\n").encode()
                packed.write(first)
                digest.update(first)
            kinds = joined_kinds(columns, kinds, head["kinds"])
            packed.write(text)
            digest.update(text)
            rows += count
    provenance = {
        "form": _FORM,
        "campaign": campaign.name,
        "title": campaign.title,
        "section": campaign.section,
        "class": campaign.kind,
        "profile": campaign.profile,
        "seed": campaign.seed,
        "date": datetime.datetime.now(datetime.UTC).date().isoformat(),
        "commit": _commit(),
        **facts,
        "table": {
            "file": table.name,
            "sha256": digest.hexdigest(),
            "rows": rows,
            "columns": dict(zip(columns, kinds, strict=True)),
        },
        "runs": list(runs),
        "definition": campaign.definition(),
        "last_call": dict(spent),
        "code": {"digest": code_digest(code), **code},
    }
    write_bytes(folder / f"{campaign.name}.json", (json.dumps(provenance, indent=1) + "\n").encode())
    return table, rows


def _commit() -> str | None:
    """Commit of the repository, with a plus if the package or its data were changed since; None outside of git."""
    try:
        found = [
            subprocess.run(
                ["git", "-C", str(paths.ROOT), *words], capture_output=True, text=True, check=True, timeout=20
            ).stdout.strip()
            for words in (("rev-parse", "HEAD"), ("status", "--porcelain", "--", "pumplib", "data"))
        ]
    except (OSError, subprocess.SubprocessError):
        return None
    return found[0] + ("+" if found[1] else "")


@dataclass(frozen=True, kw_only=True, eq=False, slots=True)
class Result:
    """Table and provenance of a campaign.

    Parameters
    ----------
    name : str
        Of the campaign.
    table : pandas.DataFrame
        One row for each that the scheme returned; ``cell``, ``role``, ``run``, ``row``, settings, scores.
        No value is NaN, in a column of texts None.
    provenance : dict
        Seed, date, commit, versions, machine, definition and hashes.
    """

    name: str
    table: Any
    provenance: dict[str, Any]

    def cell(self, name: str) -> Any:
        """Rows of one cell.

        Parameters
        ----------
        name : str
            Of the cell.

        Returns
        -------
        pandas.DataFrame

        Raises
        ------
        DataError
            If there is no such cell.
        """
        rows = self.table[self.table["cell"] == name]
        if rows.empty:
            known = ", ".join(map(str, self.table["cell"].unique()))
            raise DataError(f"results of {self.name}: no cell {name!r}; there are {known}.")
        return rows


def provenance(name: str, folder: Path | None = None) -> dict[str, Any]:
    """Read the provenance of a campaign's table.

    Parameters
    ----------
    name : str
        Of the campaign.
    folder : Path, optional
        ``data/campaigns/results`` by default.

    Returns
    -------
    dict

    Raises
    ------
    DataError
        If it is absent or has another form.
    """
    path = (folder or RESULTS) / f"{name}.json"
    try:
        found: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
        good = found["form"] == _FORM and isinstance(found["table"]["columns"], dict)
    except FileNotFoundError:
        raise DataError(f"{path.name} is absent; make it by `python -m pumplib campaign {name}`.") from None
    except (ValueError, KeyError, TypeError, UnicodeDecodeError):
        good = False
    if not good:
        raise DataError(f"{path.name}: is not the provenance of a campaign; make it anew by `pumplib campaign {name}`.")
    return found


def _verified(name: str, folder: Path | None) -> tuple[dict[str, Any], Path]:
    """Provenance and table of a campaign that belong together."""
    known = provenance(name, folder)
    path = (folder or RESULTS) / f"{name}.csv.gz"
    digest = hashlib.sha256()
    try:
        with gzip.open(path, "rb") as file:
            while block := file.read(1 << 20):
                digest.update(block)
    except FileNotFoundError:
        raise DataError(f"{path.name} is absent; make it by `python -m pumplib campaign {name}`.") from None
    except (OSError, EOFError) as error:
        raise DataError(f"{path.name}: cannot be unpacked ({error}); make it anew.") from None
    if digest.hexdigest() != known["table"]["sha256"]:
        raise DataError(f"{path.name}: differs from what {name}.json says of it; make both anew.")
    return known, path


def read(name: str, folder: Path | None = None, columns: Sequence[str] | None = None) -> Result:
    """Read the committed results of a campaign.

    Parameters
    ----------
    name : str
        Of the campaign.
    folder : Path, optional
        ``data/campaigns/results`` by default.
    columns : sequence of str, optional
        Those that are read; all by default.

    Returns
    -------
    Result

    Raises
    ------
    DataError
        If table or provenance is absent, or they do not belong together.
    """
    import pandas as pd

    known, path = _verified(name, folder)
    kinds: dict[str, str] = known["table"]["columns"]
    for column in columns or ():
        if column not in kinds:
            raise DataError(f"{path.name}: column {column!r} is unknown; there are {', '.join(kinds)}.")
    # Only an empty cell is "no value": "NA" may be the name of something. Numbers with a fraction are read by
    # Python's own conversion, which gives back what was written to the last bit.
    table = pd.read_csv(
        path,
        usecols=None if columns is None else list(columns),
        dtype={key: object for key, kind in kinds.items() if kind in ("str", "float")},
        keep_default_na=False,
        na_values=[""],
    )
    for column in table.columns:
        kind = kinds[column]
        if kind == "str":
            table[column] = table[column].where(table[column].notna(), None)
        elif kind in ("float", ""):
            table[column] = table[column].astype(float)
    return Result(name=name, table=table, provenance=known)


@dataclass(frozen=True, kw_only=True, slots=True)
class Rechecked:
    """Outcome of a recheck that found no difference.

    Parameters
    ----------
    runs : tuple of (str, int)
        Cell and number of each repeated run.
    rows : int
        Rows that were compared.
    equal : bool
        Whether all numbers are equal to the last bit.
    worst : float
        Largest relative difference.
    """

    runs: tuple[tuple[str, int], ...]
    rows: int
    equal: bool
    worst: float

    def __str__(self) -> str:
        how = "equal to the last bit" if self.equal else f"equal to {self.worst:.1g}"
        return f"{len(self.runs)} runs repeated, {self.rows} rows: {how}"


def recheck(
    campaign: Campaign | str,
    rng: np.random.Generator,
    n: int = 3,
    *,
    cells: Sequence[str] | None = None,
    tolerance: float = TOLERANCE,
    folder: Path | None = None,
) -> Rechecked:
    """Repeat some runs of a campaign in this process and compare them with the committed table.

    Parameters
    ----------
    campaign : Campaign or str
        The campaign or its name.
    rng : numpy.random.Generator
        Chooses the runs; theirs follow from the campaign's seed.
    n : int
        How many; at most as many as there are.
    cells : sequence of str, optional
        Cells they are taken from; all by default.
    tolerance : float
        Relative difference that a number may show; see `TOLERANCE`.
    folder : Path, optional
        ``data/campaigns/results`` by default.

    Returns
    -------
    Rechecked

    Raises
    ------
    ParameterError
        If an argument is wrong.
    DataError
        If the table belongs to another state of the campaign file, or a repeated row differs.
    """
    campaign = load_campaign(campaign) if isinstance(campaign, str) else campaign
    check_value("recheck", "n", n, Quantity("-", "number of runs", 1, 1e6), whole=True)
    check_value("recheck", "tolerance", tolerance, Quantity("-", "relative difference", 0.0, 1.0))
    names = [cell.name for cell in campaign.cells]
    for one in cells or ():
        if one not in names:
            raise ParameterError(f"recheck: cell {one!r}: must be one of {', '.join(names)}.")
    known = provenance(campaign.name, folder)
    if known["definition"] != json.loads(json.dumps(campaign.definition())):
        raise DataError(
            f"campaign {campaign.name}: its file has been changed since the table was made; run `make campaigns`, or "
            "undo the change."
        )
    taken = [k for k, name in enumerate(names) if cells is None or name in cells]
    size = np.array([known["runs"][k] for k in taken])
    chosen = np.sort(rng.choice(int(size.sum()), min(int(n), int(size.sum())), replace=False))
    edges = np.concatenate(([0], np.cumsum(size)))
    places = [
        (taken[c], int(u - edges[c]))
        for u, c in zip(chosen, np.searchsorted(edges, chosen, side="right") - 1, strict=True)
    ]  # fmt: skip
    stored = _stored_rows(campaign, places, folder)
    rows, worst, equal = 0, 0.0, True
    for cell, run in places:
        found = unit_rows(_unit(campaign, cell, run), run)
        where = _unit(campaign, cell, run).where(run)
        before = stored[cell, run]
        if len(before) != len(found):
            raise DataError(f"{where}: has {len(found)} rows, in the table {len(before)}.{_hint(known, campaign)}")
        for number, (old, new) in enumerate(zip(before, found, strict=True)):
            for column, value in new.items():
                text = cell_text(value)[1]
                if text == old.get(column):
                    continue
                apart = _apart(old.get(column), text)
                if not apart <= tolerance:
                    raise DataError(
                        f"{where}, row {number}: {column} = {text or 'no value'}, in the table "
                        f"{old.get(column) or 'no value'}.{_hint(known, campaign)}"
                    )
                worst = max(worst, apart)
                equal = equal and apart == 0.0
            rows += 1
    return Rechecked(runs=tuple((names[c], run) for c, run in places), rows=rows, equal=equal, worst=worst)


def _unit(campaign: Campaign, number: int, run: int) -> Chunk:
    cell = campaign.cells[number]
    return Chunk(
        campaign=campaign.name, path=campaign.path, code="", seed=campaign.seed, cell=number, name=cell.name,
        role=cell.role, settings=cell.settings, swept=campaign.swept, first=run, count=1,
    )  # fmt: skip


def _stored_rows(
    campaign: Campaign, places: Sequence[tuple[int, int]], folder: Path | None
) -> dict[tuple[int, int], list[dict[str, str]]]:
    """Rows of some runs as texts, read in one pass."""
    _, path = _verified(campaign.name, folder)
    number = {cell.name: k for k, cell in enumerate(campaign.cells)}
    found: dict[tuple[int, int], list[dict[str, str]]] = {place: [] for place in places}
    with gzip.open(path, "rb") as file:
        for row in csv.DictReader(io.TextIOWrapper(file, encoding="utf-8", newline="")):
            place = (number[row["cell"]], int(row["run"]))
            if place in found:
                found[place].append(row)
    return found


def _apart(old: str | None, new: str) -> float:
    """Relative difference of two numbers given as text; infinite if one is not a number."""
    try:
        one, other = float(old or "x"), float(new)
    except ValueError:
        return math.inf
    if one == other:
        return 0.0
    scale = max(abs(one), abs(other))
    return abs(one - other) / scale if math.isfinite(scale) else math.inf


def _hint(known: Mapping[str, Any], campaign: Campaign) -> str:
    """Why a repeated run may differ."""
    now = code_state(campaign.path)
    parts = []
    for what in ("sources", "data", "versions"):
        before = known["code"][what]
        changed = [key for key in {**before, **now[what]} if before.get(key) != now[what].get(key)]
        if changed:
            parts.append(f"{what} changed: {', '.join(sorted(changed)[:5])}")
    cause = "; ".join(parts) or "the code is the same, so look at the platform or at a source of randomness of its own"
    return f" Since the table was made: {cause}. Run `make campaigns` if the new numbers are right."
