"""The command line: help, exit codes, and the report at the end."""

import re
import subprocess
import sys

import pytest

from pumplib.workbook.cli import CLAIMS, FAILED, OK, USAGE, main


def test_help_names_every_command_and_exit_code():
    command = [sys.executable, "-m", "pumplib", "--help"]
    text = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    for word in ("workbook", "run", "claims", "datasets", "map", "lab", "exit codes", "130", "--strict-claims"):
        assert word in text


@pytest.mark.parametrize("command", ["workbook", "run", "claims", "datasets", "map", "lab"])
def test_each_command_has_help(command, capsys):
    with pytest.raises(SystemExit) as stop:
        main([command, "--help"])
    assert stop.value.code == 0
    assert len(capsys.readouterr().out.splitlines()) >= 5


@pytest.mark.parametrize("words", [[], ["no-such-command"], ["workbook", "--jobs", "many"], ["run"]])
def test_wrong_words_are_usage_errors(words, capsys):
    with pytest.raises(SystemExit) as stop:
        main(words)
    assert stop.value.code == USAGE


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["workbook", "--jobs", "0"], "--jobs 0"),
        (["workbook", "--only", "09_no"], "there are 01_one"),
        (["run", "09_no"], "there are 01_one"),
        (["run", "01_one", "-p", "torqe", "3"], "unknown parameter torqe of notebook 01_one; allowed are torque"),
    ],
)
def test_what_does_not_exist_is_a_usage_error(book, words, told, capsys):
    book.add("01_one", parameters="torque = 1.0", specs="torque=workbook.number(0, 20, 'N m')")
    assert main(words, book.layout) == USAGE
    assert told in capsys.readouterr().err


def test_workbook_ends_with_table_and_report(book, claim, capsys):
    book.ledger(
        claim("ch1.good"),
        claim("ch1.bad"),
        claim("ch1.wish", level="stretch"),
        claim("ch1.later", source="notebook:09_later"),
    )
    book.add(
        "01_one",
        "nb.record('ch1.good', 0.5)",
        "nb.record('ch1.bad', 2.0)\nnb.record('ch1.wish', 3.0)",
        "from IPython.display import Markdown\nMarkdown(r'$\\\\omega$')",
    )
    assert main(["workbook", "--strict-claims"], book.layout) == CLAIMS
    out = capsys.readouterr().out
    assert "required: 1 hold, 1 fail, 1 not run; stretch: 0 hold, 1 fail, 0 not run" in out
    assert "FAILS: ch1.bad: m: 2, bound <= 1" in out
    assert "missed (stretch): ch1.wish" in out
    assert "notebook 09_later does not exist yet" in out
    assert re.search(r"1 notebooks run, 0 unchanged, \d+\.\d s", out)
    assert str(book.layout.report / "index.html") in out
    # The same results without the flag are a success: a failed claim is a result.
    assert main(["workbook"], book.layout) == OK
    assert "0 notebooks run, 1 unchanged" in capsys.readouterr().out
    assert main(["claims", "--strict-claims"], book.layout) == CLAIMS
    page = (book.layout.report / "index.html").read_text()
    for word in ("ch1.good", "ch1.later", 'class="fails">fails', 'class="holds">holds', "3.2 Model of the Electrical"):
        assert word in page
    assert "prefers-color-scheme: dark" in page
    assert (book.layout.report / "notebooks/01_one.html").exists()
    for html in book.layout.report.rglob("*.html"):
        loads = re.findall(r"""(?:src|href)\s*=\s*["']([^"']+)|url\(([^)]+)\)|@import""", html.read_text())
        assert not [link for pair in loads for link in pair if "//" in link], html.name


def test_an_error_in_a_notebook_is_told_at_the_end(book, capsys):
    book.add("01_one", "1 / 0")
    book.add("02_two", "print('fine')")
    assert main(["workbook", "--jobs", "1"], book.layout) == FAILED
    out = capsys.readouterr().out
    assert "02_two: completed" in out
    tail = out[out.index("ERROR in") :]
    assert "ERROR in notebook 01_one, cell 4" in tail
    assert "ZeroDivisionError" in tail


def test_a_broken_ledger_is_told(book, claim, capsys):
    book.ledger(claim("ch1.a", op="<"))
    assert main(["claims"], book.layout) == FAILED
    assert "op = '<'" in capsys.readouterr().out


def test_run_with_defaults_counts_and_others_do_not(book, claim, capsys, tmp_path):
    book.ledger(claim("ch1.a"))
    specs = "torque=workbook.number(0, 20, 'N m')"
    book.add("01_one", "nb.record('ch1.a', nb.parameters.torque)", parameters="torque = 0.5", specs=specs)
    assert main(["run", "01_one", "--list"], book.layout) == OK
    assert capsys.readouterr().out == "torque = 0.5\n"
    output = tmp_path / "out" / "run.ipynb"
    assert main(["run", "01_one", "-p", "torque", "1e0", "-o", str(output)], book.layout) == OK
    assert "do not count" in output.read_text()
    assert not book.layout.claims.exists()
    assert main(["run", "01_one", "-p", "torque", "0.5", "-o", str(output)], book.layout) == OK
    assert "do not count" not in output.read_text()
    assert book.layout.claims.exists()
