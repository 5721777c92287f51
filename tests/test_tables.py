"""Strict reading of small tables."""

from pathlib import Path

import pytest

from pumplib.errors import DataError
from pumplib.tables import read_table


def test_reads_numbers_texts_and_lines(tmp_path: Path) -> None:
    path = tmp_path / "t.csv"
    path.write_bytes('\ufeffb_W,name\r\n\r\n 1.5e3 , a b \r\n2,"c,d"\r\n'.encode())
    table = read_table(path, numbers=["b_W"], texts=["name"])
    assert table.numbers == {"b_W": (1500.0, 2.0)}
    assert table.texts == {"name": ("a b", "c,d")}
    assert table.lines == (3, 4)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", ["empty", "name,b_W"]),
        ("name,b_W\n", ["no rows"]),
        ("name,b_kW\na,1\n", ["column b_W is missing", "b_kW"]),
        ("name;b_W\na;1\n", ["missing", "semicolons"]),
        ("name,b_W,c\na,1,2\n", ["'c' is unknown"]),
        ("name,b_W,b_W\na,1,2\n", ["'b_W' is there twice"]),
        ("name,b_W\na,1,5\n", ["line 2", "3 cells", "decimal comma"]),
        ("name,b_W\na,1\nb,\n", ["line 3", "b_W is empty"]),
        ("name,b_W\n,1\n", ["line 2", "name is empty"]),
        ("name,b_W\na,one\n", ["line 2", "b_W = 'one'", "not a number"]),
        ("name,b_W\na,nan\n", ["line 2", "b_W = nan", "finite"]),
        ("name,b_W\na,inf\n", ["b_W = inf", "finite"]),
    ],
)
def test_refuses(tmp_path: Path, text: str, words: list[str]) -> None:
    path = tmp_path / "t.csv"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(DataError) as error:
        read_table(path, numbers=["b_W"], texts=["name"])
    for word in words:
        assert word in str(error.value)


def test_absent_and_unreadable_files(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="no such file"):
        read_table(tmp_path / "none.csv", numbers=["a"])
    with pytest.raises(DataError, match="no such file"):
        read_table(tmp_path, numbers=["a"])
    path = tmp_path / "latin.csv"
    path.write_bytes(b"a\n\xff\n")
    with pytest.raises(DataError, match="UTF-8"):
        read_table(path, numbers=["a"])
