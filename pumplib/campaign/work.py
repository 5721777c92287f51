"""Thesis, all chapters: what a worker does: score some runs of one cell and write their rows as text.

The generator of a run follows from the campaign's seed and the run's place alone, and the rows are written
here, so neither the number of workers nor the order of the work can change a byte of the table.
"""

import csv
import io
import math
import time
import traceback
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from pumplib.campaign.schemes import Value, load_scheme, loaded_digest
from pumplib.errors import DataError
from pumplib.machines.quantity import Parameters

KINDS = ("", "int", "float", "str")
"""Kinds of columns; the first is one without any value. A column of several numbers takes the later kind."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Chunk:
    """Some runs of one cell, in a row.

    Parameters
    ----------
    campaign, path, code : str
        Name of the campaign, where its scheme is, and the hash of the code that must be used.
    seed : int
        Of the campaign.
    cell : int
        Number of the cell.
    name, role : str
        Of the cell.
    settings : Parameters
        Of the cell.
    swept : tuple of str
        Settings that are columns.
    first, count : int
        First run and number of runs.
    """

    campaign: str
    path: str
    code: str
    seed: int
    cell: int
    name: str
    role: str
    settings: Parameters
    swept: tuple[str, ...]
    first: int
    count: int

    def where(self, run: int) -> str:
        """Name a run so that it can be repeated alone.

        Parameters
        ----------
        run : int
            Number of the run in its cell.

        Returns
        -------
        str
        """
        return (
            f"campaign {self.campaign}, cell {self.name!r}, run {run} (default_rng([{self.seed}, {self.cell}, {run}]))"
        )


@dataclass(frozen=True, kw_only=True, slots=True)
class Scored:
    """Rows of a chunk.

    Parameters
    ----------
    cell, first, count : int
        Cell, first run and number of runs that were scored; fewer than asked for after an error.
    columns, kinds : tuple of str
        Of the rows.
    text : bytes
        The rows as CSV.
    rows : int
        Their number.
    seconds, cpu : float
        Time and processor time of the scoring, s.
    error : str
        What went wrong with the run after the last one scored; empty if nothing did.
    """

    cell: int
    first: int
    count: int
    columns: tuple[str, ...]
    kinds: tuple[str, ...]
    text: bytes
    rows: int
    seconds: float
    cpu: float
    error: str = ""


def cell_text(value: Value) -> tuple[int, str]:
    """Write one value so that the same number always gives the same text, and the text the same number.

    Parameters
    ----------
    value : float, int, str, bool or None
        Also NumPy scalars. None is no value.

    Returns
    -------
    tuple of (int, str)
        Index in `KINDS` and text.

    Raises
    ------
    DataError
        If it is NaN, an empty text, or something else.
    """
    if isinstance(value, np.generic):
        value = value.item()
    if value is None:
        return 0, ""
    if isinstance(value, int):
        return 1, str(int(value))
    if isinstance(value, float):
        if math.isnan(value):
            raise DataError("is NaN; return None where there is no value, and find out why a number is not one")
        return 2, repr(value)
    if isinstance(value, str):
        if not value:
            raise DataError("is an empty text, which cannot be told from no value; return None or a word")
        return 3, value
    raise DataError(f"is {type(value).__name__}; a row holds numbers, texts and None")


def merge_kinds(name: str, one: int, other: int) -> int:
    """Kind of a column that holds two kinds.

    Parameters
    ----------
    name : str
        Of the column.
    one, other : int
        Indices in `KINDS`.

    Returns
    -------
    int

    Raises
    ------
    DataError
        If numbers and texts are mixed.
    """
    if {one, other} in ({1, 3}, {2, 3}):
        raise DataError(f"column {name!r} holds numbers and texts; a column holds one of them")
    return max(one, other)


def unit_rows(chunk: Chunk, run: int) -> list[dict[str, Value]]:
    """Score one run and give its complete rows.

    Parameters
    ----------
    chunk : Chunk
        Cell and scheme.
    run : int
        Number of the run in its cell.

    Returns
    -------
    list of dict
        Place, swept settings and what the scheme returned.

    Raises
    ------
    DataError
        If the scheme returns no row or a column that contradicts.
    """
    rng = np.random.default_rng([chunk.seed, chunk.cell, run])
    found = load_scheme(chunk.path).score(chunk.settings, rng)
    many = [found] if isinstance(found, Mapping) else list(found)
    if not many:
        raise DataError("the scheme returned no row; return at least one for each run")
    place: dict[str, Value] = {"cell": chunk.name, "role": chunk.role, "run": run}
    settings = {name: _plain(getattr(chunk.settings, name)) for name in chunk.swept}
    rows = []
    for number, scored in enumerate(many):
        for name in scored:
            if name in place or name == "row":
                raise DataError(f"the scheme returned a column {name!r}, which every table has; rename it")
            if name in settings and scored[name] != settings[name]:
                raise DataError(f"column {name!r} = {scored[name]!r}, but the setting is {settings[name]!r}; rename it")
        extra = {name: value for name, value in settings.items() if name not in scored}
        rows.append({**place, "row": number, **extra, **scored})
    return rows


def _plain(value: Any) -> Value:
    return " ".join(map(str, value)) if isinstance(value, tuple) else value


def score_chunk(chunk: Chunk) -> Scored:
    """Score the runs of a chunk.

    Parameters
    ----------
    chunk : Chunk
        Which ones.

    Returns
    -------
    Scored
        After an error the runs before it, and the error.
    """
    begun, cpu = time.perf_counter(), time.thread_time()
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    columns: tuple[str, ...] = ()
    kinds: list[int] = []
    rows, done, error = 0, 0, ""
    try:
        _check_code(chunk)
        for run in range(chunk.first, chunk.first + chunk.count):
            lines: list[list[str]] = []
            merged = list(kinds)
            for row in unit_rows(chunk, run):
                if not columns:
                    columns, merged = tuple(row), [0] * len(row)
                lines.append(_line(row, columns, merged))
            # a run is written as a whole or not at all
            writer.writerows(lines)
            kinds, rows, done = merged, rows + len(lines), done + 1
    except Exception as problem:
        last = traceback.extract_tb(problem.__traceback__)[-1]
        error = f"{type(problem).__name__} in {last.name}, line {last.lineno}: {problem}"
    return Scored(
        cell=chunk.cell, first=chunk.first, count=done, columns=columns, kinds=tuple(KINDS[k] for k in kinds),
        text=out.getvalue().encode(), rows=rows, seconds=time.perf_counter() - begun, cpu=time.thread_time() - cpu,
        error=error,
    )  # fmt: skip


def _check_code(chunk: Chunk) -> None:
    if loaded_digest(chunk.path) != chunk.code:
        raise DataError("this worker has other sources, data or library versions; update and restart the workers")


def _line(row: Mapping[str, Value], columns: tuple[str, ...], kinds: list[int]) -> list[str]:
    if tuple(row) != columns:
        raise DataError(f"the scheme returned columns {', '.join(row)}; before {', '.join(columns)}")
    cells = []
    for k, (name, value) in enumerate(row.items()):
        # the usual cases first: a campaign may have millions of rows
        if type(value) is float and value == value:
            kind, text = 2, repr(value)
        elif type(value) is int:
            kind, text = 1, str(value)
        elif type(value) is str and value:
            kind, text = 3, value
        else:
            try:
                kind, text = cell_text(value)
            except DataError as problem:
                raise DataError(f"column {name!r} {problem}") from None
        if kind != kinds[k]:
            kinds[k] = merge_kinds(name, kinds[k], kind)
        cells.append(text)
    return cells
