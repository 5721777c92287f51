"""Thesis 4.3.2-4.3.5, A.1-A.9: the tables show every entry, and exports are escaped and deterministic."""

import csv
import html
import io
import re
from pathlib import Path

import numpy as np
import pytest

from pumplib.errors import DataError, ParameterError
from pumplib.fmea import OBSERVATION
from pumplib.fmea.load import shipped
from pumplib.fmea.tables import (
    Table,
    component_tables,
    export,
    fault_table,
    group_table,
    link_table,
    matrix_table,
    scenario_table,
    signal_table,
    system_tables,
)

PUMP = shipped("pump")
NASTY = Table(
    name="nasty", title="50 % & <b>", header=("a_b", 'say "x"'), rows=(("[1]", "x, y\nz"), ("{$#^~\\}", "→ <&>"))
)


def test_links_of_all_tables_are_all_links() -> None:
    shown = set()
    for block in [*(component.id for component in PUMP.components), OBSERVATION]:
        for matrix, kind, links, _, provenance in link_table(PUMP, block).rows:
            assert matrix.startswith(f"A_{{{block},")
            shown |= {(link.replace("→", "->"), kind, provenance) for link in links.split(", ")}
    assert shown == {(e.id + ("" if e.certain else "?"), e.kind, e.provenance) for e in PUMP.edges}


def test_faults_of_all_tables_are_all_faults() -> None:
    rows = [row for component in PUMP.components for row in fault_table(PUMP, component.id).rows]
    assert [row[0] for row in rows] == [fault.id for fault in PUMP.faults]
    assert {row[0]: row[3] for row in rows}["EM4"] == "Te-?, Tr+?, mcm+?"
    assert "(from EM1)" in next(row for row in rows if row[0] == "EM2")[2]


def test_every_table_of_the_pump() -> None:
    tables = system_tables(PUMP)
    names = [table.name for table in tables]
    assert len(names) == len(set(names))
    assert all(table.rows for table in tables)
    assert len(signal_table(PUMP).rows) == 20
    assert len(group_table(PUMP).rows) == 7
    assert len(scenario_table(PUMP).rows) == 5
    assert [table.name for table in component_tables(PUMP, "MD")] == ["fmea_MD_faults", "fmea_MD_links"]


def test_csv_reads_back() -> None:
    for table in (*system_tables(PUMP), NASTY):
        rows = [tuple(row) for row in csv.reader(io.StringIO(table.to_csv(), newline=""))]
        assert rows == [table.header, *table.rows]


def test_html_is_escaped_and_complete() -> None:
    text = NASTY.to_html()
    assert "<b>" not in text
    cells = [html.unescape(cell) for cell in re.findall(r"<t[hd] [^>]*>(.*?)</t[hd]>", text, re.DOTALL)]
    assert cells == [*NASTY.header, *NASTY.rows[0], *NASTY.rows[1]]
    assert NASTY._repr_html_() == text
    assert component_tables(PUMP, "HY")._repr_html_().count("<table>") == 3


def test_latex_is_escaped() -> None:
    text = NASTY.to_latex()
    assert r"50 \% \& \textless{}b\textgreater{}" in text
    assert r"a\_b" in text
    assert "\n{}[1] & " in text
    assert r"\{\$\#\textasciicircum{}\textasciitilde{}\textbackslash{}\}" in text
    # no special character is left bare in any table, and every row has its cells
    for table in system_tables(PUMP):
        lines = table.to_latex().splitlines()
        body = [line for line in lines if line.endswith(r" \\")]
        assert len(body) == len(table.rows) + 1
        for line in body:
            assert len(re.findall(r"(?<!\\)&", line)) == len(table.header) - 1
            assert not re.search(r"(?<!\\)[#%_^~]", line)
            assert line.count("{") == line.count("}")


def test_export_is_deterministic(tmp_path: Path) -> None:
    first = {path.name: path.read_bytes() for path in export(system_tables(PUMP), tmp_path / "a")}
    again = {path.name: path.read_bytes() for path in export(system_tables(shipped("pump")), tmp_path / "b")}
    assert first == again
    assert len(first) == 2 * len(system_tables(PUMP))
    assert all(b"\r" not in content for content in first.values())
    with pytest.raises(ParameterError, match="'nasty' is there twice"):
        export([NASTY, NASTY], tmp_path)


def test_matrices_show_must_may_and_never() -> None:
    table = matrix_table(
        "A_f", "A_f", rows=["y+", "y-"], columns=["f", "g"], possible=[[1, 1], [0, 0]], certain=[[1, 0], [0, 0]]
    )
    assert table.rows == (("y+", "1", "1?"), ("y-", "0", "0"))
    assert table.header == ("event", "f", "g")


@pytest.mark.parametrize(
    ("possible", "certain", "words"),
    [
        ([[1, 0]], [[1, 1]], r"certain\[y\+, g\]"),
        ([[1, 2]], [[1, 0]], "truth values"),
        ([[1, np.nan]], [[1, 0]], "truth values"),
        ([1, 0], [[1, 0]], r"possible: shape \(2,\)"),
        ([[1, 0]], [[1], [0]], r"certain: shape \(2, 1\)"),
    ],
)
def test_wrong_matrices(possible, certain, words) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(DataError, match=words):
        matrix_table("A", "A", rows=["y+"], columns=["f", "g"], possible=possible, certain=certain)


def test_wrong_tables() -> None:
    with pytest.raises(DataError, match="row 2 has 1 cells"):
        Table(name="t", title="t", header=("a", "b"), rows=(("1", "2"), ("3",)))
    with pytest.raises(DataError, match="no column"):
        Table(name="t", title="t", header=(), rows=())
    with pytest.raises(ParameterError, match=r"component 'HX'.*HY"):
        fault_table(PUMP, "HX")
