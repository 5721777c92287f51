"""Thesis, all chapters: run the notebooks, two at a time, and keep what finished.

A notebook whose inputs have not changed since it completed is not run again. One that fails
does not stop the others. The overview runs last because it reads the results of the others.
"""

import hashlib
import json
import os
import shutil
import time
from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from pumplib.errors import ClaimError, NotebookError
from pumplib.workbook import collect as collection
from pumplib.workbook import state as states
from pumplib.workbook.claims import load_claims
from pumplib.workbook.collect import Row
from pumplib.workbook.figures import load_index
from pumplib.workbook.layout import Layout, exclusive, write_json
from pumplib.workbook.machine import drawing_platform
from pumplib.workbook.notebook import RUN_VARIABLE
from pumplib.workbook.pool import Pool, Running
from pumplib.workbook.progress import Progress
from pumplib.workbook.state import State
from pumplib.workbook.worker import Job, Outcome

LAST = "00_overview"


@dataclass(frozen=True, kw_only=True)
class Result:
    """Result of a workbook run.

    Attributes
    ----------
    states : dict of str to State
        Last state of each notebook; `unchanged` names those that were not run again.
    unchanged : set of str
        Notebooks that were current already.
    rows : list of dict
        Judged claims.
    problems : list of str
        What is wrong with the ledger or the measured files, if anything.
    seconds, peak_memory : float
        Time (s) and peak memory of all processes (bytes; 0 where it cannot be read).
    """

    states: dict[str, State]
    unchanged: set[str]
    rows: list[Row]
    problems: list[str]
    seconds: float
    peak_memory: int

    @property
    def failed(self) -> list[State]:
        """Notebooks that ended in error."""
        return [state for state in self.states.values() if state.status == "error"]


def names(layout: Layout, only: Iterable[str] = ()) -> list[str]:
    """Return the notebooks of a workbook, the overview last.

    Parameters
    ----------
    layout : Layout
        Folders.
    only : iterable of str
        Names, or their beginnings, to choose from them; all by default.

    Returns
    -------
    list of str
        Names without the ending.

    Raises
    ------
    NotebookError
        If a given name fits no notebook, or more than one.
    """
    found = sorted(path.stem for path in layout.notebooks.glob("[0-9][0-9]_*.ipynb"))
    found.sort(key=lambda name: name == LAST)
    chosen = []
    for given in only:
        wanted = Path(given).name.removesuffix(".ipynb")
        fits = [name for name in found if name == wanted] or [n for n in found if n.startswith(wanted)]
        if len(fits) != 1:
            raise NotebookError(
                f"notebook {given!r} fits {'none' if not fits else ', '.join(fits)}; "
                f"there are {', '.join(found) or 'none'}"
            )
        chosen += fits
    return [name for name in found if name in chosen] if chosen else found


def _prepare(layout: Layout, name: str, folder: Path, counts: bool) -> dict[str, str]:
    """Empty the folder a run writes to, tell the run about it, and return the kernel's variables."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    run = {"notebook": name, "root": str(layout.root), "package": str(layout.package), "counts": counts}
    write_json(folder / "run.json", run)
    return {RUN_VARIABLE: str(folder)}


def _finish(layout: Layout, run: Running, seconds: float) -> State:
    """Check what a notebook left behind, move its figures into place and return its state."""
    folder = layout.runs / run.name
    outcome = run.outcome or Outcome(status="error", message="no outcome")
    state = State(
        notebook=run.name,
        status=outcome.status,
        message=outcome.message,
        inputs=run.inputs,
        seconds=round(seconds, 2),
    )
    if outcome.status != "completed":
        return state
    values = states.read_measurements(folder / "claims.json")
    listed = [item for item in load_index(layout.index).values() if item.notebook == run.name]
    saved_file = folder / "figures.json"
    saved = json.loads(saved_file.read_text(encoding="utf-8")) if saved_file.exists() else []
    wrong = collection.problems(load_claims(layout.ledger), run.name, values)
    wrong += [f"figure {item.id}: listed in index.toml but not saved" for item in listed if item.id not in saved]
    if wrong:
        message = f"notebook {run.name} ran, but:\n    " + "\n    ".join(wrong)
        return replace(state, status="error", message=message)
    written = []
    for name in saved:
        for ending in (".svg", ".png"):
            file = folder / "figures" / f"{name}{ending}"
            layout.figures.mkdir(parents=True, exist_ok=True)
            shutil.move(file, layout.figures / file.name)
            written.append(file.name)
    if written:
        _note_platform(layout, run.name)
    return replace(state, claims=values, figures=states.figure_hashes(layout.figures, written))


def _note_platform(layout: Layout, name: str) -> None:
    """Write down what drew the figures: the same platform has to draw the same bytes again."""
    made = json.loads(layout.made_with.read_text(encoding="utf-8")) if layout.made_with.exists() else {}
    write_json(layout.made_with, dict(sorted({**made, name: drawing_platform()}.items())))


def judge_all(layout: Layout, known: dict[str, State], current: set[str]) -> tuple[list[Row], list[str]]:
    """Judge all claims from the last runs and the measured files.

    Parameters
    ----------
    layout : Layout
        Folders.
    known : dict of str to State
        Last state of each notebook.
    current : set of str
        Notebooks whose last run has the inputs of today.

    Returns
    -------
    rows : list of dict
        Judged claims; empty if the ledger cannot be read.
    problems : list of str
        Errors of the ledger or the measured files.
    """
    problems: list[str] = []
    try:
        ledger = load_claims(layout.ledger)
    except ClaimError as error:
        return [], [str(error)]
    try:
        measured = collection.load_measured(layout.measured, ledger)
    except ClaimError as error:
        measured, problems = {}, [str(error)]
    reasons = {}
    for name in {claim.notebook for claim in ledger.values() if claim.notebook}:
        last = known.get(name)
        if not layout.notebook(name).exists():
            reasons[name] = f"notebook {name} does not exist yet"
        elif last is not None and last.status == "skipped":
            reasons[name] = f"notebook {name} was skipped: {last.message}"
        elif last is not None and last.status == "error":
            reasons[name] = f"notebook {name} ended in error"
        elif last is not None and name not in current:
            reasons[name] = f"inputs of notebook {name} have changed since it ran"
    completed = {n: s.claims for n, s in known.items() if s.status == "completed" and n in current}
    try:
        rows = collection.collect(ledger, completed, measured, reasons)
    except ClaimError as error:
        return [], [*problems, str(error)]
    return rows, problems


def _overview_extra(known: dict[str, State]) -> str:
    claims = {name: [repr(c) for c in s.claims] for name, s in sorted(known.items()) if name != LAST}
    return hashlib.sha256(json.dumps(claims, sort_keys=True).encode()).hexdigest()


def _inputs(layout: Layout, name: str, common: str, known: dict[str, State]) -> str:
    extra = _overview_extra(known) if name == LAST else ""
    if b"datasets" in layout.notebook(name).read_bytes():
        extra += _measured_data()  # more files in the reader's folder are another input
    return states.notebook_inputs(layout, name, common, extra)


def _measured_data() -> str:
    root = Path(os.environ.get("PUMPLIB_DATA") or "")
    if not os.environ.get("PUMPLIB_DATA") or not root.is_dir():
        return ""
    files = sorted((p.relative_to(root).as_posix(), p.stat().st_size) for p in root.rglob("*") if p.is_file())
    return hashlib.sha256(repr(files).encode()).hexdigest()


def survey(layout: Layout) -> tuple[dict[str, State], set[str]]:
    """Return what is known of all notebooks without running any.

    Parameters
    ----------
    layout : Layout
        Folders.

    Returns
    -------
    known : dict of str to State
        Last state by name.
    current : set of str
        Those whose inputs have not changed since.
    """
    loaded = {name: states.load_state(layout, name) for name in names(layout)}
    known = {name: state for name, state in loaded.items() if state is not None}
    common = states.common_inputs(layout)
    current = {
        name
        for name, state in known.items()
        if state.inputs == _inputs(layout, name, common, known)
        and (state.status != "completed" or states.is_current(layout, state, state.inputs))
    }
    return known, current


def run_workbook(
    layout: Layout | None = None,
    *,
    jobs: int = 2,
    force: bool = False,
    only: Iterable[str] = (),
    progress: Progress | None = None,
) -> Result:
    """Run the notebooks with their default parameters and judge all claims.

    Parameters
    ----------
    layout : Layout, optional
        Folders; the repository's by default.
    jobs : int
        Notebooks at a time.
    force : bool
        Whether to run notebooks whose inputs have not changed as well.
    only : iterable of str
        Names of notebooks; all by default.
    progress : Progress, optional
        Where to show progress; standard output by default.

    Returns
    -------
    Result
        States and claims; `build/claims.json` is written as well.

    Raises
    ------
    NotebookError
        If a name in `only` fits no notebook, jobs is not positive, or another run is at work.
    KeyboardInterrupt
        If the user interrupts; workers are ended and what finished is kept.
    """
    if jobs < 1:
        raise NotebookError(f"jobs = {jobs}; run at least one notebook at a time")
    layout = layout or Layout()
    with exclusive(layout):
        return _run_workbook(layout, jobs, force, list(only), progress or Progress())


def _run_workbook(layout: Layout, jobs: int, force: bool, only: list[str], progress: Progress) -> Result:
    began = time.monotonic()
    waiting = names(layout, only)
    common = states.common_inputs(layout)
    known, current = survey(layout)
    unchanged: set[str] = set()
    pool = Pool(jobs, progress)
    try:
        while waiting or pool.running:
            while waiting and len(pool.running) < jobs and (waiting[0] != LAST or not pool.running):
                name = waiting.pop(0)
                if name == LAST:
                    # The overview reads the claims of the others.
                    _write_claims(layout, known, current)
                inputs = _inputs(layout, name, common, known)
                if not force and states.is_current(layout, known.get(name), inputs):
                    unchanged.add(name)
                    progress.line(f"{name}: unchanged, {known[name].seconds:.1f} s at its last run")
                    continue
                folder = layout.runs / name
                job = Job(
                    notebook=layout.notebook(name),
                    output=layout.executed / f"{name}.ipynb",
                    parameters={},
                    environment=_prepare(layout, name, folder, counts=True),
                )
                pool.start(name, job, folder / "worker.log", inputs)
            for run in pool.wait() if pool.running else []:
                state = _finish(layout, run, progress.seconds(run.name))
                states.save_state(layout, state)
                known[run.name] = state
                current.add(run.name)
                # The first line names the cell; the whole error comes at the end of the run.
                where = f" ({state.message.splitlines()[0].rstrip(':')})" if state.message else ""
                progress.end(run.name, state.status + where)
    finally:
        pool.kill()
    rows, problems = _write_claims(layout, known, current)
    return Result(
        states={name: known[name] for name in names(layout, only) if name in known},
        unchanged=unchanged,
        rows=rows,
        problems=problems,
        seconds=time.monotonic() - began,
        peak_memory=pool.peak,
    )


def _write_claims(layout: Layout, known: dict[str, State], current: set[str]) -> tuple[list[Row], list[str]]:
    rows, problems = judge_all(layout, known, current)
    if rows:
        collection.write_rows(rows, layout.claims)
    return rows, problems


def run_one(
    layout: Layout,
    name: str,
    parameters: dict[str, Any],
    output: Path | None = None,
    progress: Progress | None = None,
) -> tuple[Outcome, Path]:
    """Run one notebook with other parameters; nothing of it counts.

    Parameters
    ----------
    layout : Layout
        Folders.
    name : str
        Name of the notebook.
    parameters : dict of str to object
        Values that replace defaults.
    output : Path, optional
        Executed notebook; `build/scratch/NAME.ipynb` by default.
    progress : Progress, optional
        Where to show progress; standard output by default.

    Returns
    -------
    outcome : Outcome
        How it ended.
    output : Path
        Where the executed notebook is.
    """
    output = (output or layout.scratch / f"{name}.ipynb").resolve()
    folder = layout.scratch / name
    job = Job(
        notebook=layout.notebook(name),
        output=output,
        parameters=parameters,
        environment=_prepare(layout, name, folder, counts=False),
    )
    pool = Pool(1, progress or Progress())
    try:
        pool.start(name, job, folder / "worker.log", "")
        ended: list[Running] = []
        while not ended:
            ended = pool.wait()
    finally:
        pool.kill()
    outcome = ended[0].outcome or Outcome(status="error")
    pool.progress.end(name, outcome.status)
    return outcome, output


def default_jobs() -> int:
    """Return how many notebooks run at a time if nobody says otherwise.

    Returns
    -------
    int
        The variable JOBS, or 2.

    Raises
    ------
    NotebookError
        If JOBS is not a whole number.
    """
    text = os.environ.get("JOBS") or "2"
    if not text.isdigit():
        raise NotebookError(f"JOBS = {text!r}; write a whole number such as 2")
    return int(text)
