"""Files of the SKAB form: read as they are, or refused with file, column, line and remedy."""

from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
import pytest

from pumplib.errors import DataError
from pumplib.monitor.skab import (
    FLOW,
    LABELS,
    SENSORS,
    TIME,
    TRAIN_ROWS,
    find_healthy,
    read_folder,
    read_healthy,
    read_run,
)

COLUMNS = [TIME, *SENSORS, *LABELS]
START = datetime(2020, 3, 9, 10, 14, 33)
ROWS = TRAIN_ROWS + 50


def table(rows: int = ROWS, labels: bool = True) -> list[list[str]]:
    """Header and rows of a correct file; two rows are labelled."""
    columns = COLUMNS if labels else COLUMNS[: -len(LABELS)]
    lines = [list(columns)]
    for k in range(rows):
        cells = [str(START + timedelta(seconds=k)), *(f"{10 * c + 0.001 * k}" for c in range(1, len(SENSORS) + 1))]
        flags = [f"{float(k in (TRAIN_ROWS + 5, TRAIN_ROWS + 6))}", f"{float(k == TRAIN_ROWS + 5)}"]
        lines.append(cells + (flags if labels else []))
    return lines


def write(path: Path, lines: list[list[str]], separator: str = ";") -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("\n".join(separator.join(line) for line in lines) + "\n", encoding="utf-8")
    return path


def test_a_correct_file_is_read_as_it_is(tmp_path: Path) -> None:
    run = read_run(write(tmp_path / "valve1" / "3.csv", table()))
    assert (run.name, run.group, run.rows, run.labelled) == ("valve1/3", "valve1", ROWS, True)
    np.testing.assert_array_equal(run.seconds, np.arange(ROWS))
    assert set(run.sensors) == set(SENSORS)
    np.testing.assert_allclose(run.flow, 10 * len(SENSORS) + 0.001 * np.arange(ROWS))
    assert run.anomaly.sum() == 2
    assert list(np.flatnonzero(run.changepoint)) == [TRAIN_ROWS + 5]


def test_the_order_of_columns_a_byte_order_mark_and_empty_lines_do_not_matter(tmp_path: Path) -> None:
    plain = read_run(write(tmp_path / "a.csv", table()))
    turned = [line[::-1] for line in table()]
    path = write(tmp_path / "b.csv", turned)
    path.write_text("\ufeff" + path.read_text(encoding="utf-8") + "\n\n", encoding="utf-8")
    other = read_run(path)
    np.testing.assert_array_equal(plain.flow, other.flow)
    np.testing.assert_array_equal(plain.anomaly, other.anomaly)


def test_lost_seconds_are_kept_as_gaps(tmp_path: Path) -> None:
    lines = table(ROWS + 10)
    del lines[101:111]
    run = read_run(write(tmp_path / "a.csv", lines))
    assert run.rows == ROWS
    assert np.diff(run.seconds).max() == 11.0


def _set(line: int, column: str, text: str):
    def change(lines: list[list[str]]) -> None:
        lines[line][lines[0].index(column)] = text

    return change


def _drop(column: str):
    def change(lines: list[list[str]]) -> None:
        k = lines[0].index(column)
        for line in lines:
            del line[k]

    return change


def _swap(lines: list[list[str]]) -> None:
    lines[20], lines[21] = lines[21], lines[20]


def _short(lines: list[list[str]]) -> None:
    del lines[TRAIN_ROWS + 1 :]


def _cut(lines: list[list[str]]) -> None:
    lines[7].pop()


def _twice(lines: list[list[str]]) -> None:
    lines[0][2] = lines[0][3]


def _unknown(lines: list[list[str]]) -> None:
    for line in lines:
        line.append("1")
    lines[0][-1] = "Speed"


@pytest.mark.parametrize(
    ("change", "parts"),
    [
        (_drop(FLOW), [f"column '{FLOW}' is missing", "the file has datetime"]),
        (_drop("Voltage"), ["column 'Voltage' is missing"]),
        (_drop(TIME), ["column 'datetime' is missing"]),
        (_drop("anomaly"), ["column 'anomaly' is missing", "scored only with the labels"]),
        (_drop("changepoint"), ["column 'changepoint' is missing"]),
        (_set(9, FLOW, "nan"), ["line 10", FLOW, "nan is not finite", "remove the row"]),
        (_set(9, "Current", "inf"), ["line 10", "'Current'", "not finite"]),
        (_set(9, "Current", ""), ["line 10", "'Current'", "the cell is empty"]),
        (_set(9, "Pressure", "0,05"), ["line 10", "'Pressure'", "'0,05' is no number", "decimal point"]),
        (_set(9, FLOW, "-3"), ["line 10", FLOW, "-3 l/min is negative"]),
        (_set(9, "anomaly", "2"), ["line 10", "'anomaly'", "2 is no label", "0 or 1"]),
        (_set(9, "changepoint", "0.5"), ["line 10", "'changepoint'", "write 0 or 1"]),
        (_set(9, TIME, "2020-03-09 10:14:40"), ["line 10", TIME, "is there twice", "remove one"]),
        (_swap, ["line 22", TIME, "1 s before the row above", "sort the rows"]),
        (_set(9, TIME, "09.03.2020 10:14:41"), ["line 10", "no time stamp", "2020-03-09 10:14:33"]),
        (_set(9, TIME, "2020-03-09 10:14:41+01:00"), ["line 10", "with a time zone"]),
        (_set(9, TIME, "2020-13-09 10:14:41"), [TIME, "2020-03-09 10:14:33"]),
        (_short, [f"{TRAIN_ROWS} rows", f"first {TRAIN_ROWS} are for training", "longer record"]),
        (_cut, ["line 8", "10 cells", "11 columns"]),
        (_twice, ["is there 2 times"]),
        (_unknown, ["unknown column 'Speed'"]),
    ],
)
def test_bad_files_are_refused_with_place_and_remedy(tmp_path: Path, change, parts: list[str]) -> None:
    lines = table()
    change(lines)
    with pytest.raises(DataError) as caught:
        read_run(write(tmp_path / "valve1" / "0.csv", lines))
    for part in ["0.csv", *parts]:
        assert part in str(caught.value)


@pytest.mark.parametrize("separator", [",", "\t"])
def test_a_wrong_separator_is_named(tmp_path: Path, separator: str) -> None:
    with pytest.raises(DataError, match=r"no semicolon \(the separator seems to be") as caught:
        read_run(write(tmp_path / "a.csv", table(), separator))
    assert repr(separator) in str(caught.value)


def test_files_that_are_none(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="no such file"):
        read_run(tmp_path / "none.csv")
    (tmp_path / "empty.csv").write_text("")
    with pytest.raises(DataError, match="is empty"):
        read_run(tmp_path / "empty.csv")
    (tmp_path / "binary.csv").write_bytes(b"\xff\xfe\x00a;b")
    with pytest.raises(DataError, match="UTF-8"):
        read_run(tmp_path / "binary.csv")
    with pytest.raises(DataError, match="0 rows"):
        read_run(write(tmp_path / "header.csv", table(0)))


def test_a_healthy_record_needs_no_labels_but_must_be_healthy(tmp_path: Path) -> None:
    run = read_healthy(write(tmp_path / "a.csv", table(labels=False)))
    assert not run.labelled
    assert not run.anomaly.any()
    with pytest.raises(DataError, match="2 rows are labelled as anomalies"):
        read_healthy(write(tmp_path / "b.csv", table()))
    half = table()
    _drop("changepoint")(half)
    with pytest.raises(DataError, match="'changepoint' is missing"):
        read_healthy(write(tmp_path / "c.csv", half))


def test_a_folder_is_read_group_by_group_in_the_order_of_numbers(tmp_path: Path) -> None:
    for name in ("valve1/10", "valve1/2", "other/1", "deep/er/7"):
        write(tmp_path / f"{name}.csv", table())
    write(tmp_path / "anomaly-free" / "x.csv", table(labels=False))
    assert [run.name for run in read_folder(tmp_path)] == ["deep/er/7", "other/1", "valve1/2", "valve1/10"]
    assert find_healthy(tmp_path) == tmp_path / "anomaly-free" / "x.csv"
    flat = read_folder(tmp_path / "valve1")
    assert {run.group for run in flat} == {"valve1"}


def test_folders_that_do_not_serve(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="no such folder"):
        read_folder(tmp_path / "none")
    with pytest.raises(DataError, match=r"no CSV file.*GROUP/NAME\.csv"):
        read_folder(tmp_path)
    with pytest.raises(DataError, match="has none"):
        find_healthy(tmp_path)
    for name in ("anomaly-free.csv", "anomaly-free-2.csv"):
        write(tmp_path / name, table(labels=False))
    with pytest.raises(DataError, match="has 2 anomaly-free files"):
        find_healthy(tmp_path)
