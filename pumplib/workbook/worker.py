"""Thesis, all chapters: run one notebook through papermill in a process of its own.

A worker is isolated from the user's Jupyter and IPython settings: it writes its own kernelspec for
the Python that runs it, so that no `python3` kernel installed elsewhere can take its place.
"""

import copy
import json
import os
import re
import shutil
import sys
import tempfile
import traceback
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pumplib.workbook.layout import write_text

Progress = Callable[[int, int], None]

_INJECTED_ID = "injected-parameters"
_ANSI = re.compile(r"\x1b\[[0-9;]*[A-Za-z]")
_TRANSIENT = ("Address already in use", "Kernel died before replying", "Kernel didn't respond")
# One thread a worker: two workers with as many threads as cores each are slower than with one.
_ENVIRONMENT = {
    "OMP_NUM_THREADS": "1",
    "OPENBLAS_NUM_THREADS": "1",
    "MKL_NUM_THREADS": "1",
    "NUMBA_NUM_THREADS": "1",
    "PYTHONHASHSEED": "0",
    "MPLBACKEND": "module://matplotlib_inline.backend_inline",
    "JUPYTER_PLATFORM_DIRS": "1",
    "PYDEVD_DISABLE_FILE_VALIDATION": "1",
}


@dataclass(frozen=True, kw_only=True)
class Job:
    """What a worker is asked to run.

    Attributes
    ----------
    notebook : Path
        The file.
    output : Path
        Where the executed notebook goes.
    parameters : mapping of str to object
        Values that replace defaults.
    environment : mapping of str to str
        Variables for the kernel.
    """

    notebook: Path
    output: Path
    parameters: Mapping[str, Any]
    environment: Mapping[str, str]


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """How a run ended.

    Attributes
    ----------
    status : str
        `completed`, `skipped` or `error`.
    message : str
        Reason of a skip, or a summary of the error that fits on one screen.
    """

    status: str
    message: str = ""


def _isolated(folder: Path) -> dict[str, str]:
    kernel = folder / "kernels" / "python3"
    kernel.mkdir(parents=True)
    spec = {
        "argv": [sys.executable, "-m", "ipykernel_launcher", "-f", "{connection_file}"],
        "display_name": "Python 3",
        "language": "python",
    }
    (kernel / "kernel.json").write_text(json.dumps(spec), encoding="utf-8")
    places = {"JUPYTER_PATH": folder, "JUPYTER_RUNTIME_DIR": folder / "r", "JUPYTER_CONFIG_DIR": folder / "c"}
    return {**{key: str(value) for key, value in places.items()}, "IPYTHONDIR": str(folder / "i")}


def _execute(job: Job, output: Path, progress: Progress) -> Any:
    import papermill
    from papermill.engines import NBClientEngine, papermill_engines
    from traitlets.config import Config

    class Engine(NBClientEngine):
        """papermill's engine that also reports each completed cell."""

        @classmethod
        def execute_managed_notebook(cls, nb_man: Any, kernel_name: str, **kwargs: Any) -> Any:
            complete, total = nb_man.cell_complete, len(nb_man.nb.cells)

            def report(cell: Any, cell_index: int = 0, **more: Any) -> None:
                complete(cell, cell_index=cell_index, **more)
                progress(cell_index + 1, total)

            nb_man.cell_complete = report
            return super().execute_managed_notebook(nb_man, kernel_name, **kwargs)

    papermill_engines.register("pumplib", Engine)
    config = Config()
    if sys.platform != "win32":
        # Sockets in our own folder: no port can be taken by another process. Without `ip` they would
        # lie in the working directory, where two kernels take each other's.
        config.KernelManager.transport = "ipc"
        config.KernelManager.ip = str(output.parent / "kernel")
    return papermill.execute_notebook(
        job.notebook,
        output,
        # papermill's injection keeps a reference; the job is used again on a retry.
        parameters=copy.deepcopy(dict(job.parameters)),
        engine_name="pumplib",
        kernel_name="python3",
        progress_bar=False,
        request_save_on_cell_execute=False,
        record_timing=False,
        cwd=job.notebook.parent,
        start_timeout=120,
        config=config,
    )


def _incomplete(notebook: Any) -> int | None:
    """Index of the first code cell that did not run to its end, or None."""
    for index, cell in enumerate(notebook.cells):
        if cell.cell_type != "code" or not cell.source.strip():
            continue
        status = cell.metadata.get("papermill", {}).get("status")
        if status != "completed" or cell.execution_count is None:
            return index
    return None


def clean(notebook: Any) -> Any:
    """Remove what differs between two equal runs of a notebook.

    Parameters
    ----------
    notebook : NotebookNode
        Executed notebook, changed in place.

    Returns
    -------
    NotebookNode
        The same notebook without papermill's times and paths and with a fixed id of the cell
        that papermill adds.
    """
    notebook.metadata.pop("papermill", None)
    for cell in notebook.cells:
        cell.metadata.pop("papermill", None)
        cell.metadata.pop("execution", None)
        if "injected-parameters" in cell.metadata.get("tags", []):
            cell["id"] = _INJECTED_ID
    return notebook


def _save(notebook: Any, path: Path) -> None:
    import nbformat

    write_text(path, nbformat.writes(clean(notebook)).rstrip("\n") + "\n")


def summary(name: str, cell: int, source: str, error: str) -> str:
    """Return an error in a notebook as text that fits on one screen.

    Parameters
    ----------
    name : str
        Name of the notebook.
    cell : int
        Number of the cell, counted from 1 over all cells of the notebook.
    source : str
        Source of the cell.
    error : str
        Traceback or message; the last lines are kept.

    Returns
    -------
    str
        Notebook, cell, source and error.
    """
    lines = source.strip().splitlines()
    shown = lines[:12] + (["..."] if len(lines) > 12 else [])
    tail = [line for line in _ANSI.sub("", error).splitlines() if line.strip()][-12:]
    parts = [f"notebook {name}, cell {cell}:", *(f"    | {line}" for line in shown)]
    return "\n".join([*parts, *(f"    {line[:200]}" for line in tail)])


def _position(job: Job, index: int) -> int:
    """Number of a cell in the reader's notebook, which lacks the cell that papermill injects."""
    if not job.parameters:
        return index + 1
    cells = json.loads(job.notebook.read_text(encoding="utf-8"))["cells"]
    tagged = [k for k, cell in enumerate(cells) if "parameters" in cell["metadata"].get("tags", [])]
    injected = tagged[0] + 1 if tagged else 0
    return index if index > injected else index + 1


def _failed(job: Job, output: Path, error: BaseException, done: int) -> Outcome:
    from papermill.exceptions import PapermillExecutionError

    name = job.notebook.stem
    if not isinstance(error, PapermillExecutionError):
        text = "".join(traceback.format_exception_only(error))
        if done == 0:
            return Outcome(status="error", message=f"notebook {name}, before its first cell:\n    {text.strip()}")
        # No cell is to blame by its output (a dead kernel): the last one that began is named.
        position = _position(job, done - 1)
        cells = json.loads(job.notebook.read_text(encoding="utf-8"))["cells"]
        source = "".join(cells[position - 1]["source"]) if 0 < position <= len(cells) else ""
        return Outcome(status="error", message=summary(name, position, source, text))
    if error.ename == "NotebookSkipped":
        return Outcome(status="skipped", message=str(error.evalue))
    # papermill has written the notebook with the cells run so far; it helps to find the cause.
    if output.exists():
        import nbformat

        partial = job.output.with_suffix(".failed.ipynb")
        _save(nbformat.read(output, as_version=4), partial)
    position = _position(job, error.cell_index)
    trace = "\n".join(error.traceback) or f"{error.ename}: {error.evalue}"
    return Outcome(status="error", message=summary(name, position, error.source, trace))


def run(job: Job, progress: Progress = lambda done, total: None) -> Outcome:
    """Run a notebook and write it, executed, in one step.

    Parameters
    ----------
    job : Job
        What to run.
    progress : callable
        Called with the number of cells done and in all after each cell.

    Returns
    -------
    Outcome
        `completed` only if every code cell ran to its end.
    """
    began = 0

    def counted(done: int, total: int) -> None:
        nonlocal began
        began = done
        progress(done, total)

    folder = Path(tempfile.mkdtemp(prefix="pumplib-"))
    try:
        os.environ.update({**_ENVIRONMENT, **_isolated(folder), **job.environment})
        output = folder / "executed.ipynb"
        for attempt in (1, 2):
            try:
                notebook = _execute(job, output, counted)
                break
            except Exception as error:
                started = began > 0
                if attempt == 1 and not started and any(text in str(error) for text in _TRANSIENT):
                    continue
                return _failed(job, output, error, began)
        stopped = _incomplete(notebook)
        if stopped is not None:
            cell = notebook.cells[stopped]
            message = "the cell ended the notebook early (sys.exit or a dead kernel); later cells did not run"
            position = _position(job, stopped)
            return Outcome(status="error", message=summary(job.notebook.stem, position, cell.source, message))
        _save(notebook, job.output)
        job.output.with_suffix(".failed.ipynb").unlink(missing_ok=True)
        return Outcome(status="completed")
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def child(job: Job, log: Path, pipe: Any) -> None:
    """Run a job in a child process and send progress and outcome through a pipe.

    Parameters
    ----------
    job : Job
        What to run.
    log : Path
        Receives what worker and kernel write to their own output, which would disturb the terminal.
    pipe : multiprocessing.connection.Connection
        Receives `("progress", done, total)` and at the end `("outcome", Outcome)`.
    """
    if hasattr(os, "setsid"):
        # Ctrl-C reaches the parent only; it ends the workers in an orderly way.
        os.setsid()
    with log.open("w", encoding="utf-8") as stream:
        os.dup2(stream.fileno(), 1)
        os.dup2(stream.fileno(), 2)
    outcome = run(job, lambda done, total: pipe.send(("progress", done, total)))
    pipe.send(("outcome", outcome))
    pipe.close()
