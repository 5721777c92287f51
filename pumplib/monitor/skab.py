"""Thesis 7.3: runs of the SKAB water-pump test bed read strictly (beyond the thesis).

A run is one CSV file with semicolons: time stamps once a second (some seconds are lost), eight sensors and two
columns of labels. Whatever would change a score in silence is refused, with file, column, line and remedy.
"""

import csv
import math
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pumplib.errors import DataError

Array = NDArray[Any]

TRAIN_ROWS = 400  # of every file, fixed by the benchmark
TIME = "datetime"
FLOW = "Volume Flow RateRMS"
SENSORS = {
    "Accelerometer1RMS": "g",
    "Accelerometer2RMS": "g",
    "Current": "A",
    "Pressure": "bar",
    "Temperature": "degC",
    "Thermocouple": "degC",
    "Voltage": "V",
    FLOW: "l/min",
}
LABELS = ("anomaly", "changepoint")
HEALTHY_NAME = "anomaly-free"
_STAMP = re.compile(r"\d{4}-\d\d-\d\d[ T]\d\d:\d\d:\d\d(\.\d{1,6})?")
_ZONE = re.compile(r"(Z|[+-]\d\d:?\d\d)$")


@dataclass(frozen=True, kw_only=True, slots=True)
class SkabRun:
    """One file of the benchmark.

    Parameters
    ----------
    name : str
        Group and file, such as ``"valve1/0"``.
    group : str
        Name of the folder: the experiment.
    seconds : ndarray of float, shape (rows,)
        Time since the first row.
    sensors : dict of str to ndarray of float, shape (rows,)
        As measured, in the units of `SENSORS`.
    anomaly, changepoint : ndarray of bool, shape (rows,)
        Labels; all False in a run without labels.
    labelled : bool
        Whether the file has labels.
    """

    name: str
    group: str
    seconds: Array
    sensors: dict[str, Array]
    anomaly: Array
    changepoint: Array
    labelled: bool

    @property
    def flow(self) -> Array:
        """Flow, l/min."""
        return self.sensors[FLOW]

    @property
    def rows(self) -> int:
        """Number of rows."""
        return len(self.seconds)


def read_run(path: str | Path, *, group: str | None = None, labelled: bool = True) -> SkabRun:
    """Read one file.

    Parameters
    ----------
    path : str or Path
        CSV file with semicolons: `TIME`, the columns of `SENSORS`, those of `LABELS`, in any order.
    group : str, optional
        Name of the experiment; the name of the folder by default.
    labelled : bool
        Whether labels are needed. A healthy log needs none, but if it has them they are read.

    Returns
    -------
    SkabRun

    Raises
    ------
    DataError
        If the file is absent, empty or not separated by semicolons, a column is missing, unknown or twice, a
        row has another number of cells, a cell is empty or no finite number, a label is neither 0 nor 1, time
        stamps are unreadable, equal or out of order, or there is no row beyond the training rows.
    """
    path = Path(path)
    group = path.parent.name if group is None else group
    name = f"{group}/{path.stem}" if group else path.stem
    header, lines, rows = _cells(path)
    with_labels = _check_header(path, header, labelled)
    columns = dict(zip(header, zip(*rows, strict=True), strict=True)) if rows else {}
    if len(rows) <= TRAIN_ROWS:
        raise DataError(
            f"{path}: {len(rows)} rows, but the first {TRAIN_ROWS} are for training and at least one must be left "
            "to judge; give a longer record."
        )
    seconds = _seconds(path, lines, columns[TIME])
    sensors = {name: _numbers(path, lines, name, columns[name]) for name in SENSORS}
    flow = sensors[FLOW]
    if (flow < 0).any():
        k = int(np.argmax(flow < 0))
        raise DataError(f"{path}, line {lines[k]}, column {FLOW!r}: {flow[k]:g} l/min is negative; correct the sensor.")
    labels = [np.zeros(len(rows), dtype=bool)] * len(LABELS)
    if with_labels:
        labels = [_label(path, lines, name, columns[name]) for name in LABELS]
    return SkabRun(
        name=name,
        group=group,
        seconds=seconds,
        sensors=sensors,
        anomaly=labels[0],
        changepoint=labels[1],
        labelled=with_labels,
    )


def read_healthy(path: str | Path) -> SkabRun:
    """Read the anomaly-free record.

    Parameters
    ----------
    path : str or Path
        CSV file as in `read_run`; the labels may be left out.

    Returns
    -------
    SkabRun

    Raises
    ------
    DataError
        See `read_run`; or if a row is labelled as an anomaly.
    """
    run = read_run(path, labelled=False)
    if run.anomaly.any():
        raise DataError(
            f"{path}: {int(run.anomaly.sum())} rows are labelled as anomalies (first in row "
            f"{int(np.argmax(run.anomaly))}), so nothing healthy can be learned from it; give an anomaly-free file."
        )
    return run


def read_folder(folder: str | Path) -> tuple[SkabRun, ...]:
    """Read all labelled runs below a folder; anomaly-free files are left to `find_healthy`.

    Parameters
    ----------
    folder : str or Path
        With CSV files in it or below it; the path of the folder that holds a file names its group.

    Returns
    -------
    tuple of SkabRun
        Sorted by group, and by number inside a group.

    Raises
    ------
    DataError
        If the folder is absent or has no labelled run, or a file is wrong (see `read_run`).
    """
    where = _folder(folder)
    found = [path for path in where.rglob("*.csv") if path.is_file() and not _is_healthy(where, path)]
    if not found:
        raise DataError(
            f"{where}: no CSV file with labelled runs in it or below it; lay them out as GROUP/NAME.csv, such as "
            "valve1/0.csv."
        )
    runs = [read_run(path, group=_group(where, path)) for path in found]
    return tuple(sorted(runs, key=lambda run: (run.group, _natural(run.name))))


def find_healthy(folder: str | Path) -> Path:
    """Find the anomaly-free file of a folder.

    Parameters
    ----------
    folder : str or Path
        The folder.

    Returns
    -------
    Path
        The only CSV file in or below it whose own name, or whose folder's, starts with ``anomaly-free``.

    Raises
    ------
    DataError
        If there is none or more than one.
    """
    where = _folder(folder)
    found = sorted(path for path in where.rglob("*.csv") if path.is_file() and _is_healthy(where, path))
    if len(found) != 1:
        what = f"has {len(found)} anomaly-free files ({', '.join(p.name for p in found)})" if found else "has none"
        raise DataError(
            f"{where}: one file named {HEALTHY_NAME}.csv is needed to learn the band from, the folder {what}; name "
            "the file that is to be used."
        )
    return found[0]


def _folder(folder: str | Path) -> Path:
    where = Path(folder).expanduser()
    if not where.is_dir():
        raise DataError(f"{where}: no such folder; give the folder that holds the runs.")
    return where


def _is_healthy(where: Path, path: Path) -> bool:
    return any(part.startswith(HEALTHY_NAME) for part in path.relative_to(where).parts)


def _group(where: Path, path: Path) -> str:
    inside = path.relative_to(where).parent.as_posix()
    return where.resolve().name if inside == "." else inside


def _natural(name: str) -> list[tuple[int, int, str]]:
    return [(0, int(part), "") if part.isdigit() else (1, 0, part) for part in re.split(r"(\d+)", name) if part]


def _cells(path: Path) -> tuple[list[str], list[int], list[list[str]]]:
    """Header, line number of each row, and rows of one length."""
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            reader = csv.reader(file, delimiter=";")
            table = [(reader.line_num, [cell.strip() for cell in row]) for row in reader]
    except (FileNotFoundError, IsADirectoryError):
        raise DataError(f"{path}: no such file; give a CSV file of the SKAB form.") from None
    except (UnicodeDecodeError, csv.Error) as error:
        raise DataError(f"{path}: not readable as CSV in UTF-8 ({error}); save it again as UTF-8.") from None
    table = [(line, row) for line, row in table if any(row)]
    if not table:
        raise DataError(f"{path}: is empty; the first line must name the columns {';'.join([TIME, *SENSORS])}.")
    header = table[0][1]
    if len(header) == 1:
        other = max(",\t|", key=header[0].count)
        seen = f"the separator seems to be {other!r}" if header[0].count(other) else f"it reads {header[0][:60]!r}"
        raise DataError(f"{path}: the first line has no semicolon ({seen}); write the file with ';' between columns.")
    for line, row in table[1:]:
        if len(row) != len(header):
            raise DataError(
                f"{path}, line {line}: {len(row)} cells, but the first line names {len(header)} columns; complete or "
                "remove the row."
            )
    return header, [line for line, _ in table[1:]], [row for _, row in table[1:]]


def _check_header(path: Path, header: list[str], labelled: bool) -> bool:
    """Whether the file has labels."""
    for column in header:
        if header.count(column) > 1:
            raise DataError(f"{path}: column {column!r} is there {header.count(column)} times; keep one of them.")
    for column in (TIME, *SENSORS):
        if column not in header:
            raise DataError(f"{path}: column {column!r} is missing; the file has {', '.join(header)}.")
    there = [column in header for column in LABELS]
    if not all(there) and (labelled or any(there)):
        lacking = LABELS[there.index(False)]
        raise DataError(
            f"{path}: column {lacking!r} is missing; a run can be scored only with the labels {' and '.join(LABELS)} "
            "(0 or 1 in each row). A healthy record to learn from has no label column at all."
        )
    unknown = [column for column in header if column not in (TIME, *SENSORS, *LABELS)]
    if unknown:
        raise DataError(
            f"{path}: unknown column {unknown[0]!r}; a SKAB file has {', '.join([TIME, *SENSORS, *LABELS])}."
        )
    return all(there)


def _numbers(path: Path, lines: list[int], column: str, cells: tuple[str, ...]) -> Array:
    try:
        values = np.array(cells, dtype=float)
    except ValueError:
        for line, cell in zip(lines, cells, strict=True):
            try:
                float(cell)
            except ValueError:
                seen = f"{cell!r} is no number" if cell else "the cell is empty"
                raise DataError(
                    f"{path}, line {line}, column {column!r}: {seen}; write a number with a decimal point, or remove "
                    "the row."
                ) from None
        raise
    if not np.isfinite(values).all():
        k = int(np.argmin(np.isfinite(values)))
        raise DataError(
            f"{path}, line {lines[k]}, column {column!r}: {cells[k]} is not finite; remove the row (a lost second is "
            "allowed) or repair the value."
        )
    return values


def _label(path: Path, lines: list[int], column: str, cells: tuple[str, ...]) -> Array:
    values = _numbers(path, lines, column, cells)
    wrong = (values != 0.0) & (values != 1.0)
    if wrong.any():
        k = int(np.argmax(wrong))
        raise DataError(f"{path}, line {lines[k]}, column {column!r}: {cells[k]} is no label; write 0 or 1.")
    return values == 1.0


def _seconds(path: Path, lines: list[int], cells: tuple[str, ...]) -> Array:
    for line, cell in zip(lines, cells, strict=True):
        if not _STAMP.fullmatch(cell):
            zone = " (with a time zone)" if _ZONE.search(cell) else ""
            raise DataError(
                f"{path}, line {line}, column {TIME!r}: {cell!r}{zone} is no time stamp of the benchmark; write local "
                "time as 2020-03-09 10:14:33."
            )
    try:
        stamps = np.array(cells, dtype="datetime64[us]")
    except ValueError as error:
        raise DataError(f"{path}, column {TIME!r}: {error}; write 2020-03-09 10:14:33.") from None
    seconds: Array = (stamps - stamps[0]) / np.timedelta64(1, "s")
    steps = np.diff(seconds)
    if (steps <= 0).any():
        k = int(np.argmax(steps <= 0))
        what = "is there twice" if steps[k] == 0 else f"is {-steps[k]:g} s before the row above it"
        remedy = "remove one of the rows" if steps[k] == 0 else "sort the rows by time"
        raise DataError(f"{path}, line {lines[k + 1]}, column {TIME!r}: {cells[k + 1]} {what}; {remedy}.")
    if not math.isfinite(seconds[-1]):
        raise DataError(f"{path}, column {TIME!r}: the time stamps span no finite time; correct them.")
    return seconds
