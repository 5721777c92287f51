"""`workbook.start` as a notebook calls it, here with a namespace of our own."""

import json

import pytest

from pumplib import workbook
from pumplib.errors import ClaimError, NotebookSkipped, ParameterError
from pumplib.workbook.layout import write_json

SPECS = {"torque": workbook.number(0, 20, "N m"), "seed": workbook.integer(0)}
SOURCE = "torque: float = 3.0  # N m\nseed: int = 7"


@pytest.fixture
def run_folder(book, claim, monkeypatch, tmp_path):
    """A folder as the runner prepares it, announced by the environment variable."""
    book.ledger(claim("ch1.a"), claim("ch1.many", op=">=", bound="0.9", extra="n = 100\n"))
    book.add("01_one", parameters=SOURCE)
    folder = tmp_path / "run"
    folder.mkdir()
    layout = book.layout
    run = {"notebook": "01_one", "root": str(layout.root), "package": str(layout.package), "counts": True}
    write_json(folder / "run.json", run)
    monkeypatch.setenv("PUMPLIB_RUN", str(folder))
    return folder


def start(**values):
    return workbook.start("01_one", {"torque": 3.0, "seed": 7, **values}, **SPECS)


def test_default_run_counts(run_folder, capsys):
    notebook = start()
    assert (notebook.counts, notebook.is_default, notebook.folder) == (True, True, run_folder)
    assert capsys.readouterr().out == ""
    notebook.record("ch1.a", 0.25, note="first")
    notebook.record("ch1.many", 1.0, n=50, successes=50)
    told = capsys.readouterr().out.splitlines()
    assert told == ["ch1.a: 0.25 <= 1.0: holds", "ch1.many: 1 >= 0.9: not run (n = 50 of 100)"]
    first, second = json.loads((run_folder / "claims.json").read_text())
    assert (first["value"], first["note"], second["n"]) == (0.25, "first", 50)


def test_a_claim_may_be_impossible_to_measure_here(run_folder, capsys):
    notebook = start()
    notebook.not_run("ch1.a", "no compiler")
    assert capsys.readouterr().out == "ch1.a: NOT RUN: no compiler\n"
    (only,) = json.loads((run_folder / "claims.json").read_text())
    assert (only["value"], only["note"]) == (None, "no compiler")
    for name, reason, words in (
        ("ch1.many", " ", "say why"),
        ("ch1.a", "again", "recorded twice"),
        ("ch1.none", "absent", "unknown"),
    ):
        with pytest.raises(ClaimError, match=words):
            notebook.not_run(name, reason)


def test_equal_text_is_still_the_default(run_folder):
    assert start(torque="3.0", seed="7").counts


def test_other_values_do_not_count(run_folder, book, capsys):
    notebook = start(torque=4)
    assert not notebook.counts
    assert notebook.folder == book.layout.scratch / "01_one"
    assert "build/scratch/01_one" in capsys.readouterr().out
    notebook.record("ch1.a", 0.25)
    assert not (run_folder / "claims.json").exists()
    assert (notebook.folder / "claims.json").exists()


def test_the_same_seed_gives_the_same_numbers(run_folder):
    assert start().rng.random() == start().rng.random() != start(seed=8).rng.random()


def test_random_numbers_need_a_seed(book, run_folder):
    book.add("01_one", parameters="torque = 1.0")
    notebook = workbook.start("01_one", {"torque": 1.0}, torque=SPECS["torque"])
    with pytest.raises(ParameterError, match="no parameter seed"):
        _ = notebook.rng


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"torque": 99}, "torque = 99 N m is not accepted"),
        ({"In": ["", SOURCE, "# Parameters\ntorqe = 2\n"]}, "unknown parameter torqe .* allowed are torque, seed"),
    ],
)
def test_wrong_parameters(run_folder, values, words):
    with pytest.raises(ParameterError, match=words):
        start(**values)


def test_a_missing_value(run_folder):
    with pytest.raises(ParameterError, match="parameter seed has no value"):
        workbook.start("01_one", {"torque": 1.0}, **SPECS)


def test_cell_and_check_must_agree(book, run_folder):
    book.add("01_one", parameters="torque = 1.0\nload_n = 2")
    with pytest.raises(ParameterError, match="its parameters cell has load_n, torque, but it checks seed, torque"):
        start()


def test_a_notebook_must_know_its_name(run_folder):
    with pytest.raises(ParameterError, match="notebook 01_one calls itself '02_two'"):
        workbook.start("02_two", {})


def test_the_caller_is_the_default_namespace(monkeypatch, capsys):
    monkeypatch.delenv("PUMPLIB_RUN", raising=False)
    space = {"workbook": workbook, "SPECS": SPECS, "torque": "1e-1", "seed": 2}
    exec("notebook = workbook.start('99_absent', **SPECS)", space)
    assert space["notebook"].parameters.torque == 0.1
    assert not space["notebook"].counts


def test_skip_and_repeated_records(run_folder):
    notebook = start()
    with pytest.raises(NotebookSkipped, match="no data"):
        notebook.skip("no data")
    notebook.record("ch1.a", 1.0)
    with pytest.raises(ClaimError, match="twice"):
        notebook.record("ch1.a", 1.0)


def test_a_cell_may_run_again_by_hand(run_folder):
    notebook = start(torque=4)
    notebook.record("ch1.a", 1.0)
    notebook.record("ch1.a", 0.5)
    (value,) = json.loads((notebook.folder / "claims.json").read_text())
    assert value["value"] == 0.5
