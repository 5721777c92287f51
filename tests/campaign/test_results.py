"""What is read is what was written, and a table that no longer follows from the code is found."""

import gzip
import io
import json
import math
import subprocess
import sys

import numpy as np
import pytest

from pumplib.campaign import campaign_from, read, recheck, run_campaign, summarise, write_summary
from pumplib.campaign.cli_part import add_arguments, execute
from pumplib.campaign.work import cell_text
from pumplib.errors import DataError, ParameterError


@pytest.fixture
def made(campaign, threads, tmp_path):
    run_campaign(
        campaign, threads, build=tmp_path / "build", results=tmp_path, facts={"machine": {"cpu": "abacus"}}
    )  # fmt: skip
    return campaign


def test_numbers_come_back_to_the_last_bit(made, tmp_path) -> None:
    import shifted_scheme

    table = read("shifts", tmp_path).table
    assert len(table) == 190
    for c, cell in enumerate(made.cells):
        for k in (0, cell.runs - 1):
            found = shifted_scheme.score(cell.settings, np.random.default_rng([7, c, k]))
            rows = table[(table["cell"] == cell.name) & (table["run"] == k)]
            for one, (_, row) in zip([found] if isinstance(found, dict) else found, rows.iterrows(), strict=True):
                assert row["x"] == one["x"]
                assert row["hit"] == one["hit"]
                assert row["word"] == one["word"]
                assert math.isnan(row["delay"]) if one["delay"] is None else row["delay"] == one["delay"]
    assert [str(table[name].dtype) for name in ("run", "size", "hit", "x")] == ["int64", "float64", "int64", "float64"]


@pytest.mark.parametrize(
    "value", [0.1, -0.0, 1e-320, 1.7976931348623157e308, math.inf, -math.inf, 3, -(2**62), True, np.float64(1 / 3)]
)
def test_every_number_has_one_text(value) -> None:
    kind, text = cell_text(value)
    assert kind == (2 if isinstance(value, float) else 1)
    assert float(text) == float(value)
    assert math.copysign(1, float(text)) == math.copysign(1, value)


def test_single_precision_keeps_its_value() -> None:
    assert float(cell_text(np.float32(0.1))[1]) == float(np.float32(0.1))
    assert cell_text(np.bool_(True)) == (1, "1")
    assert cell_text(None) == (0, "")


def test_provenance(made, tmp_path) -> None:
    found = read("shifts", tmp_path).provenance
    assert found["seed"] == 7
    assert found["machine"] == {"cpu": "abacus"}
    assert found["runs"] == [40, 25, 25]
    assert found["table"]["columns"]["delay"] == "float"
    assert found["table"]["rows"] == 190
    assert "pumplib/campaign/work.py" in found["code"]["sources"]
    assert "motors/reference_1k5.toml" in found["code"]["data"]
    assert not any(name.startswith("pumps/") for name in found["code"]["data"])
    assert found["code"]["versions"]["numpy"] == np.__version__
    assert found["last_call"]["workers"] == "2 threads"
    assert str(tmp_path) not in json.dumps(found)


def test_table_has_no_time_in_it(made, tmp_path) -> None:
    head = (tmp_path / "shifts.csv.gz").read_bytes()[:10]
    assert head[4:8] == bytes(4)  # time of the packing
    assert not head[3] & 8  # name of a file


def test_some_columns(made, tmp_path) -> None:
    assert list(read("shifts", tmp_path, ["cell", "hit"]).table.columns) == ["cell", "hit"]
    with pytest.raises(DataError, match="'hits' is unknown"):
        read("shifts", tmp_path, ["hits"])
    assert len(read("shifts", tmp_path).cell("shift size=1")) == 75
    with pytest.raises(DataError, match="no cell 'shift'"):
        read("shifts", tmp_path).cell("shift")


def rewrite(folder, change) -> None:
    """Change the table and its checksum, as somebody with other code would."""
    import hashlib

    text = change(gzip.decompress((folder / "shifts.csv.gz").read_bytes()).decode())
    (folder / "shifts.csv.gz").write_bytes(gzip.compress(text.encode()))
    known = json.loads((folder / "shifts.json").read_text())
    known["table"]["sha256"] = hashlib.sha256(text.encode()).hexdigest()
    (folder / "shifts.json").write_text(json.dumps(known))


def test_recheck(made, tmp_path) -> None:
    found = recheck(made, np.random.default_rng(1), 5, folder=tmp_path)
    assert len(set(found.runs)) == 5
    assert found.equal
    assert found.worst == 0.0
    assert str(found).startswith("5 runs repeated, ")
    every = recheck(made, np.random.default_rng(1), 1000, folder=tmp_path)
    assert len(every.runs) == 90
    assert every.rows == 190
    only = recheck(made, np.random.default_rng(1), 4, cells=["healthy"], folder=tmp_path)
    assert {cell for cell, _ in only.runs} == {"healthy"}
    other = recheck(made, np.random.default_rng(2), 5, folder=tmp_path)
    assert other.runs != found.runs


@pytest.mark.parametrize(("factor", "fine"), [(1 + 1e-10, True), (1 + 1e-8, False)])
def test_recheck_tolerance(made, tmp_path, factor, fine) -> None:
    def change(text: str) -> str:
        lines = text.splitlines()
        cells = lines[1].split(",")
        cells[6] = repr(float(cells[6]) * factor)
        return "\n".join([lines[0], ",".join(cells), *lines[2:]]) + "\n"

    rewrite(tmp_path, change)
    if fine:
        found = recheck(made, np.random.default_rng(1), 90, folder=tmp_path)
        assert not found.equal
        assert found.worst == pytest.approx(1e-10, rel=1e-3)
        assert "equal to 1e-10" in str(found)
        with pytest.raises(DataError):
            recheck(made, np.random.default_rng(1), 90, tolerance=1e-11, folder=tmp_path)
    else:
        with pytest.raises(DataError, match=r"cell 'healthy', run 0 \(default_rng\(\[7, 0, 0\]\)\), row 0: x = "):
            recheck(made, np.random.default_rng(1), 90, folder=tmp_path)


def test_recheck_finds_another_word_and_a_missing_row(made, tmp_path) -> None:
    rewrite(tmp_path, lambda text: text.replace(",c\n", ",d\n"))
    with pytest.raises(DataError, match="word = c, in the table d"):
        recheck(made, np.random.default_rng(1), 90, folder=tmp_path)
    rewrite(tmp_path, lambda text: "\n".join(text.splitlines()[:-1]).replace(",d\n", ",c\n") + "\n")
    with pytest.raises(DataError, match=r"cell 'shift size=2.5', run 24 .* has 3 rows, in the table 2"):
        recheck(made, np.random.default_rng(1), 90, folder=tmp_path)


def test_recheck_says_what_has_changed(made, scheme, tmp_path) -> None:
    source = scheme / "shifted_scheme.py"
    source.write_text(source.read_text() + "# another\n")
    rewrite(tmp_path, lambda text: text.replace(",c\n", ",d\n"))
    with pytest.raises(DataError, match=r"sources changed: shifted_scheme\.py\. Run `make campaigns`"):
        recheck(made, np.random.default_rng(1), 90, folder=tmp_path)


def test_recheck_refuses(made, raw, tmp_path) -> None:
    rng = np.random.default_rng(1)
    with pytest.raises(DataError, match="its file has been changed"):
        recheck(campaign_from(raw(seed=8), "shifts"), rng, folder=tmp_path)
    for wrong in ({"n": 0}, {"n": 1.5}, {"tolerance": -1.0}, {"cells": ["sick"]}):
        with pytest.raises(ParameterError):
            recheck(made, rng, folder=tmp_path, **wrong)


def test_damaged_results(made, tmp_path) -> None:
    table, known = tmp_path / "shifts.csv.gz", tmp_path / "shifts.json"
    packed, facts = table.read_bytes(), known.read_text()
    table.write_bytes(gzip.compress(gzip.decompress(packed) + b"more\n"))
    with pytest.raises(DataError, match=r"differs from what shifts\.json says"):
        read("shifts", tmp_path)
    table.write_bytes(packed[:-20])
    with pytest.raises(DataError, match="cannot be unpacked"):
        read("shifts", tmp_path)
    table.unlink()
    with pytest.raises(DataError, match=r"shifts\.csv\.gz is absent"):
        read("shifts", tmp_path)
    known.write_text("{}")
    with pytest.raises(DataError, match="is not the provenance"):
        read("shifts", tmp_path)
    known.write_text(facts[:50])
    with pytest.raises(DataError, match="is not the provenance"):
        read("shifts", tmp_path)
    known.unlink()
    with pytest.raises(DataError, match="pumplib campaign shifts"):
        read("shifts", tmp_path)


def test_summary(made, tmp_path) -> None:
    from pumplib.campaign import clopper_pearson, rate

    found = summarise(made, tmp_path)
    table = read("shifts", tmp_path).table
    healthy = table[table["cell"] == "healthy"]
    first = found["rates"][0]
    assert (first["cell"], first["column"], first["n"]) == ("healthy", "hit", 40)
    assert first["high"] == clopper_pearson(int(healthy["hit"].sum()), 40).high
    shifted = table[table["cell"] == "shift size=1"]  # three rows a run: clustered
    assert found["rates"][1]["high"] == rate(shifted["hit"], clusters=shifted["run"]).high
    row = next(r for r in found["quantiles"] if r["cell"] == "healthy" and r["column"] == "delay")
    assert row["n"] + row["without"] == 40
    assert row["n"] == healthy["hit"].sum()
    assert {r["column"] for r in found["quantiles"]} == {"x", "delay"}
    before = [path.read_bytes() for path in write_summary(made, tmp_path)]
    assert before == [path.read_bytes() for path in write_summary(made, tmp_path)]
    assert [path.name for path in write_summary(made, tmp_path)] == ["shifts.rates.csv", "shifts.quantiles.csv"]


def command(*words: str):
    import argparse

    parser = argparse.ArgumentParser()
    add_arguments(parser)
    lines: list[str] = []
    code = execute(parser.parse_args(list(words)), say=lines.append)
    return code, "\n".join(lines)


def test_command(tmp_path, monkeypatch, capsys) -> None:
    from pumplib import paths
    from pumplib.campaign import results, run, summary

    for module in (results, run, summary):
        monkeypatch.setattr(module, "RESULTS", tmp_path / "results")
    monkeypatch.setattr("pumplib.campaign.cli_part.RESULTS", tmp_path / "results")
    monkeypatch.setattr(paths, "BUILD", tmp_path / "build")
    code, text = command("cusum_run_length", "--runs-scale", "0.01", "--threads", "--workers", "1")
    assert code == 0
    assert "12 runs (12 of them now" in text
    assert "build/campaigns/cusum_run_length/share/cusum_run_length.csv.gz" in text
    assert "change shift=2" in text
    assert "12/12 runs" in capsys.readouterr().err
    code, text = command("--list")
    assert code == 0
    assert "primer_limits: Limits" in text
    code, text = command("cusum_run_length", "--check")
    assert code == 1
    assert "cusum_run_length.json is absent" in text
    with pytest.raises(ParameterError, match="did you mean"):
        command("cusum_runlength")
    with pytest.raises(ParameterError, match="cluster has its own workers"):
        command("--scheduler", "tcp://127.0.0.1:1", "--workers", "2")
    with pytest.raises(ParameterError, match="runs_scale"):
        command("--runs-scale", "2")


def test_command_checks_a_table(tmp_path, monkeypatch, threads) -> None:
    from pumplib.campaign import load_campaign, results

    small = load_campaign("cusum_run_length")
    run_campaign(small, threads, runs_scale=0.01, build=tmp_path)
    monkeypatch.setattr(results, "RESULTS", tmp_path / "cusum_run_length" / "share")
    code, text = command("cusum_run_length", "--check", "--check-runs", "2", "--check-seed", "1")
    assert code == 0
    assert "2 runs repeated, 100 rows: equal to the last bit" in text


def test_importing_is_light() -> None:
    heavy = ["pandas", "matplotlib", "distributed", "dask", "scipy.stats", "cvxpy"]
    words = f"import sys, pumplib.campaign; print([m for m in {heavy!r} if m in sys.modules])"
    found = subprocess.run([sys.executable, "-c", words], capture_output=True, text=True, check=True)
    assert found.stdout.strip() == "[]"


def test_tables_for_people() -> None:
    from pumplib.campaign.summary import to_text

    out = io.StringIO(to_text([{"cell": "a", "rate": 0.123456}, {"cell": "longer", "rate": 1.0}]))
    assert [line.rstrip() for line in out] == ["cell    rate", "a       0.1235", "longer  1"]
