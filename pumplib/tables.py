"""Thesis, all chapters: small tables of measurements (CSV) read strictly, every error with file, line and remedy."""

import csv
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from pumplib.errors import DataError


@dataclass(frozen=True, slots=True)
class Table:
    """Columns of a CSV file.

    Parameters
    ----------
    name : str
        File name, for messages.
    lines : tuple of int
        Line of the file for each row.
    texts : mapping of str to tuple of str
        Columns of text.
    numbers : mapping of str to tuple of float
        Columns of finite numbers.
    """

    name: str
    lines: tuple[int, ...]
    texts: dict[str, tuple[str, ...]]
    numbers: dict[str, tuple[float, ...]]


def read_table(path: str | Path, *, numbers: Sequence[str], texts: Sequence[str] = ()) -> Table:
    """Read a comma-separated file with a header line and exactly the given columns, in any order.

    Parameters
    ----------
    path : str or Path
        The file, UTF-8; empty lines are skipped.
    numbers : sequence of str
        Columns that hold finite numbers; the name carries the unit.
    texts : sequence of str
        Columns that hold non-empty text.

    Returns
    -------
    Table

    Raises
    ------
    DataError
        If the file is absent or not UTF-8, a column is missing, unknown or twice, a row has another number of
        cells, a cell is empty, not a number or not finite, or there is no row.
    """
    path = Path(path)
    wanted = [*texts, *numbers]
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            reader = csv.reader(file)
            rows = [(reader.line_num, [cell.strip() for cell in row]) for row in reader]
    except (FileNotFoundError, IsADirectoryError):
        raise DataError(f"{path}: no such file; give a CSV file with the columns {','.join(wanted)}.") from None
    except (UnicodeDecodeError, csv.Error) as error:
        raise DataError(f"{path.name}: not readable as CSV in UTF-8: {error}") from None
    rows = [(line, row) for line, row in rows if any(row)]
    if not rows:
        raise DataError(f"{path.name}: is empty; the first line must be {','.join(wanted)}.")
    header = rows[0][1]
    for column in wanted:
        if column not in header:
            hint = " It seems to be separated by semicolons; use commas." if ";" in header[0] else ""
            raise DataError(f"{path.name}: column {column} is missing; the header is {','.join(header)}.{hint}")
    for column in header:
        if column not in wanted or header.count(column) > 1:
            what = "is there twice" if column in wanted else "is unknown"
            raise DataError(f"{path.name}: column {column!r} {what}; allowed are {', '.join(wanted)}.")
    if len(rows) == 1:
        raise DataError(f"{path.name}: has a header but no rows.")
    columns: dict[str, list[str]] = {column: [] for column in header}
    for line, row in rows[1:]:
        if len(row) != len(header):
            raise DataError(
                f"{path.name}, line {line}: {len(row)} cells, the header has {len(header)}; "
                "check for a decimal comma (write a point) or a missing value."
            )
        for column, cell in zip(header, row, strict=True):
            if not cell:
                raise DataError(f"{path.name}, line {line}: {column} is empty; give a value or leave the row out.")
            columns[column].append(cell)
    lines = tuple(line for line, _ in rows[1:])
    parsed = {
        column: tuple(_number(path.name, line, column, cell) for line, cell in zip(lines, columns[column], strict=True))
        for column in numbers
    }
    return Table(path.name, lines, {column: tuple(columns[column]) for column in texts}, parsed)


def _number(name: str, line: int, column: str, cell: str) -> float:
    try:
        value = float(cell)
    except ValueError:
        raise DataError(f"{name}, line {line}: {column} = {cell!r} is not a number.") from None
    if not math.isfinite(value):
        raise DataError(f"{name}, line {line}: {column} = {cell} must be finite; leave rows with gaps out.")
    return value
