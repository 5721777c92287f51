"""The runner: what counts, what is kept, what is run again, and how failures are told."""

import io
import json
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import psutil
import pytest

from pumplib.errors import NotebookError
from pumplib.workbook import runner
from pumplib.workbook.layout import exclusive
from pumplib.workbook.progress import Progress
from pumplib.workbook.runner import run_workbook

DRAW = """
from matplotlib.figure import Figure
figure = Figure(figsize=(2, 1))
figure.subplots().plot([0, 1])
nb.save(figure, "ch01_line")
"""
FIGURE = '[ch01_line]\ntitle = "A line"\nclass = "beyond"\nnotebook = "01_one"\n'


def quiet() -> Progress:
    return Progress(io.StringIO())


def run(book, **options):
    return run_workbook(book.layout, progress=quiet(), **options)


def statuses(result) -> dict[str, str]:
    return {name: state.status for name, state in result.states.items()}


def verdicts(result) -> dict[str, str]:
    return {row["id"]: row["verdict"] for row in result.rows}


def test_claims_figures_resume_and_force(book, claim):
    book.ledger(
        claim("ch1.a"),
        claim("ch1.b", source="notebook:02_two"),
        claim("ch1.c", source="notebook:03_three"),
        claim("ch1.d", source="measured"),
    )
    book.layout.index.write_text(FIGURE)
    one = book.add("01_one", "nb.record('ch1.a', 0.5)", DRAW)
    book.add("02_two", "nb.record('ch1.b', 1.5)")
    result = run(book)
    assert statuses(result) == {"01_one": "completed", "02_two": "completed"}
    assert verdicts(result) == {"ch1.a": "holds", "ch1.b": "fails", "ch1.c": "not run", "ch1.d": "not run"}
    assert json.loads(book.layout.claims.read_text()) == result.rows
    svg, png = (book.layout.figures / f"ch01_line{ending}" for ending in (".svg", ".png"))
    assert svg.stat().st_size > 0
    assert png.stat().st_size > 0
    executed = book.layout.executed / "01_one.ipynb"
    first = executed.read_bytes(), svg.read_bytes(), png.read_bytes()
    assert b"papermill" not in first[0]

    again = run(book)
    assert again.unchanged == {"01_one", "02_two"}
    assert verdicts(again) == verdicts(result)

    forced = run(book, force=True, only=["01"])
    assert forced.unchanged == set()
    assert (executed.read_bytes(), svg.read_bytes(), png.read_bytes()) == first
    assert verdicts(forced) == verdicts(result)

    # A damaged figure, a changed notebook and changed sources each lead to a new run.
    svg.write_text("damaged")
    assert run(book).unchanged == {"02_two"}
    assert svg.read_bytes() == first[1]
    one.write_text(one.read_text().replace("0.5", "1.5"))
    changed = run(book)
    assert changed.unchanged == {"02_two"}
    assert verdicts(changed)["ch1.a"] == "fails"
    (book.layout.package / "model.py").write_text('"""Thesis 3.2: another model."""\n')
    rows, _ = runner.judge_all(book.layout, *runner.survey(book.layout))
    assert {row["verdict"] for row in rows} == {"not run"}
    assert "changed since" in rows[0]["note"]


def test_failures_do_not_stop_the_others(book, claim):
    book.ledger(
        claim("ch1.a", source="notebook:01_error"),
        claim("ch1.skip", source="notebook:04_skip"),
        claim("ch1.left_out", source="notebook:05_left_out"),
        claim("ch1.fine", source="notebook:06_fine"),
    )
    book.add("01_error", "nb.record('ch1.a', 0.5)", "x = 1\nvery_special = x / 0", "print('later')")
    book.add("02_exit", "import sys\nsys.exit(0)", "print('later')")
    book.add("03_killed", "import os\nos._exit(1)", "print('later')")
    book.add("04_skip", "nb.record('ch1.skip', 0.5)", "nb.skip('no measured data here')")
    book.add("05_left_out", "print('records nothing')")
    book.add("06_fine", "nb.record('ch1.fine', 0.5)")
    result = run(book)
    assert statuses(result) == {
        **{"01_error": "error", "02_exit": "error", "03_killed": "error"},
        **{"04_skip": "skipped", "05_left_out": "error", "06_fine": "completed"},
    }
    messages = {name: state.message for name, state in result.states.items()}
    # Cells are counted as a reader counts them: title, parameters, first call, then these.
    assert "notebook 01_error, cell 5" in messages["01_error"]
    assert "very_special = x / 0" in messages["01_error"]
    assert "ZeroDivisionError: division by zero" in messages["01_error"]
    assert len(messages["01_error"].splitlines()) < 30
    assert "notebook 02_exit, cell 4" in messages["02_exit"]
    assert "sys.exit" in messages["02_exit"]
    assert "notebook 03_killed, cell 4" in messages["03_killed"]
    assert messages["04_skip"] == "no measured data here"
    assert "ch1.left_out: not recorded" in messages["05_left_out"]
    # What a notebook recorded before it failed or was skipped does not count.
    assert verdicts(result) == {
        **{"ch1.a": "not run", "ch1.skip": "not run", "ch1.left_out": "not run", "ch1.fine": "holds"}
    }
    assert {state.notebook for state in result.failed} == {"01_error", "02_exit", "03_killed", "05_left_out"}
    assert (book.layout.executed / "01_error.failed.ipynb").exists()
    assert not (book.layout.executed / "01_error.ipynb").exists()
    # A failed or skipped notebook is tried again, a completed one is not.
    assert run(book).unchanged == {"06_fine"}


WRONG = {
    "nb.record('ch1.aa', 0.5)": "unknown claim id 'ch1.aa'; did you mean ch1.a",
    "nb.record('ch1.a', float('nan'))": "ch1.a: value is nan",
    "nb.record('ch1.own', 0.5)\nnb.record('ch1.own', 0.5)": "ch1.own: recorded twice",
    "nb.record('ch1.m', 0.5)": "its source is measured",
    "nb.save(None, 'ch01_other')": "figure 'ch01_other' is not listed for notebook 05_x",
}


def test_wrong_records_end_in_error(book, claim):
    book.ledger(
        claim("ch1.a", source="notebook:02_x"),
        claim("ch1.own", source="notebook:03_x"),
        claim("ch1.m", source="measured"),
    )
    for number, code in enumerate(WRONG, start=1):
        book.add(f"{number:02}_x", code)
    result = run(book)
    for state, words in zip(result.states.values(), WRONG.values(), strict=True):
        assert state.status == "error"
        assert words in state.message


def test_a_listed_figure_must_be_saved(book):
    book.layout.index.write_text(FIGURE)
    book.add("01_one", "print('draws nothing')")
    result = run(book)
    assert statuses(result) == {"01_one": "error"}
    assert "figure ch01_line: listed in index.toml but not saved" in result.states["01_one"].message


def test_the_overview_sees_the_claims_of_the_others(book, claim):
    book.ledger(claim("ch1.a"))
    book.add("01_one", "import time\ntime.sleep(0.5)\nnb.record('ch1.a', 0.5)")
    read = "import json\nprint([row['verdict'] for row in json.load(open('../build/claims.json'))])"
    book.add("00_overview", read)
    assert runner.names(book.layout) == ["01_one", "00_overview"]
    result = run(book)
    assert statuses(result) == {"01_one": "completed", "00_overview": "completed"}
    assert "holds" in (book.layout.executed / "00_overview.ipynb").read_text()
    assert run(book).unchanged == {"01_one", "00_overview"}


def test_names(book):
    for name in ("03_model", "30_explore_bench", "31_explore_stator"):
        book.add(name)
    (book.layout.notebooks / "scrap.ipynb").write_text("{}")
    assert runner.names(book.layout) == ["03_model", "30_explore_bench", "31_explore_stator"]
    assert runner.names(book.layout, ["31", "notebooks/03_model.ipynb"]) == ["03_model", "31_explore_stator"]
    with pytest.raises(NotebookError, match="fits 30_explore_bench, 31_explore_stator"):
        runner.names(book.layout, ["3"])
    with pytest.raises(NotebookError, match="fits none; there are 03_model"):
        runner.names(book.layout, ["04_fmea"])


def test_other_parameters_go_to_scratch(book, claim):
    book.ledger(claim("ch1.a"))
    book.layout.index.write_text(FIGURE)
    book.add(
        "01_one",
        "nb.record('ch1.a', nb.parameters.torque)",
        DRAW,
        parameters="torque: float = 0.5  # N m",
        specs="torque=workbook.number(0, 20, 'N m')",
    )
    outcome, output = runner.run_one(book.layout, "01_one", {"torque": "1.5"}, progress=quiet())
    assert outcome.status == "completed", outcome.message
    text = output.read_text()
    assert "do not count" in text
    assert '"id": "injected-parameters"' in text
    assert not book.layout.claims.exists()
    assert list(book.layout.figures.glob("*.svg")) == []
    outcome, _ = runner.run_one(book.layout, "01_one", {"torque": 25}, progress=quiet())
    assert outcome.status == "error"
    assert "cell 3:" in outcome.message  # as the reader counts, without the cell that papermill adds
    assert "torque = 25 N m is not accepted" in outcome.message
    outcome, _ = runner.run_one(book.layout, "01_one", {"torqe": 1}, progress=quiet())
    assert "unknown parameter torqe of notebook 01_one; allowed are torque" in outcome.message


def test_kernel_of_this_python_whatever_the_user_has(book, tmp_path, monkeypatch):
    """A user-level kernelspec named python3 that points elsewhere must not be used."""
    home = tmp_path / "home"
    kernel = home / ".local/share/jupyter/kernels/python3"
    kernel.mkdir(parents=True)
    spec = {"argv": ["no-such-python", "{connection_file}"], "display_name": "x", "language": "python"}
    (kernel / "kernel.json").write_text(json.dumps(spec))
    monkeypatch.setenv("HOME", str(home))
    monkeypatch.setenv("JUPYTER_PATH", str(home / ".local/share/jupyter"))
    book.add("01_one", "import sys\nprint(sys.executable)")
    result = run(book)
    assert statuses(result) == {"01_one": "completed"}
    assert sys.executable in (book.layout.executed / "01_one.ipynb").read_text()


SCRIPT = """
import sys
from pathlib import Path
from pumplib.workbook.cli import main
from pumplib.workbook.layout import Layout
if __name__ == "__main__":
    root = Path(sys.argv[1])
    sys.exit(main(["workbook", "--jobs", "2"], Layout(root, root / "package")))
"""


@pytest.mark.skipif(sys.platform == "win32", reason="signals")
def test_interrupt_keeps_what_finished_and_leaves_no_process(book, tmp_path):
    book.add("01_quick", "print('done')")
    book.add("02_slow", "import time\ntime.sleep(120)")
    script = tmp_path / "main.py"
    script.write_text(SCRIPT)
    lines: list[str] = []
    command = [sys.executable, str(script), str(book.layout.root)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        reader = threading.Thread(target=lambda: lines.extend(line.decode() for line in process.stdout))
        reader.start()
        try:
            deadline = time.monotonic() + 120
            while not any("01_quick: completed" in line for line in lines):
                assert time.monotonic() < deadline, lines
                time.sleep(0.05)
            children = psutil.Process(process.pid).children(recursive=True)
            process.send_signal(signal.SIGINT)
            code = process.wait(timeout=60)
        finally:
            process.kill()
            reader.join()
        told = process.stderr.read()
    assert code == 130
    assert b"interrupted" in told
    assert children
    _, alive = psutil.wait_procs(children, timeout=20)
    assert alive == []
    known, current = runner.survey(book.layout)
    assert {name: state.status for name, state in known.items()} == {"01_quick": "completed"}
    assert current == {"01_quick"}


def test_jobs_come_from_the_environment(monkeypatch):
    monkeypatch.delenv("JOBS", raising=False)
    assert runner.default_jobs() == 2
    monkeypatch.setenv("JOBS", "3")
    assert runner.default_jobs() == 3
    monkeypatch.setenv("JOBS", "many")
    with pytest.raises(NotebookError, match="many"):
        runner.default_jobs()


def test_plain_papermill_runs_and_does_not_count(book, tmp_path):
    book.ledger("")
    path = book.add("01_one", "print('ran')", parameters="n: int = 1", specs="n=workbook.integer(0)")
    output = tmp_path / "out.ipynb"
    environment = {k: v for k, v in os.environ.items() if k != "PUMPLIB_RUN"}
    command = [sys.executable, "-m", "papermill", str(path), str(output), "-p", "n", "2", "--no-progress-bar"]
    subprocess.run(command, check=True, env=environment, capture_output=True, cwd=tmp_path)
    assert "do not count" in output.read_text()
    assert Path(tmp_path / "build").exists() is False


def test_a_second_run_in_the_same_folders_is_refused(book) -> None:
    layout = book.layout
    with exclusive(layout):
        # the mark of a process that is alive and is not this one
        (layout.build / "running").write_text(str(os.getppid()))
        with pytest.raises(NotebookError, match="another run of the workbook"):
            run_workbook(layout)
    (layout.build / "running").write_text("999999999")  # left by a run that was killed
    assert not run_workbook(layout).failed
    assert not (layout.build / "running").exists()
