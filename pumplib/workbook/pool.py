"""Thesis, all chapters: worker processes that run notebooks side by side."""

import contextlib
import multiprocessing
import multiprocessing.connection
import sys
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from pumplib.workbook.progress import Progress
from pumplib.workbook.worker import Job, Outcome, child


@dataclass
class Running:
    """A notebook that is running.

    Attributes
    ----------
    name, inputs : str
        Name and hash of the inputs.
    process, pipe : object
        Worker process, and the pipe that it reports through.
    outcome : Outcome or None
        How it ended; None while it runs.
    """

    name: str
    process: Any
    pipe: Any
    inputs: str
    outcome: Outcome | None = None


@dataclass
class Pool:
    """Worker processes; the caller sees to it that at most `jobs` run.

    Attributes
    ----------
    jobs : int
        Notebooks at a time.
    progress : Progress
        Where to show progress.
    running : dict of str to Running
        Notebooks that are running.
    peak : int
        Peak memory of this process and all below it (bytes).
    """

    jobs: int
    progress: Progress
    running: dict[str, Running] = field(default_factory=dict)
    peak: int = 0
    _sampled: float = 0.0

    def start(self, name: str, job: Job, log: Path, inputs: str) -> None:
        """Start a worker.

        Parameters
        ----------
        name : str
            Name of the notebook.
        job : Job
            What to run.
        log : Path
            Receives the output of worker and kernel.
        inputs : str
            Hash of the notebook's inputs.
        """
        # A fork server has no threads, so forking it is safe, and papermill is imported only once.
        context: Any = multiprocessing.get_context("forkserver" if sys.platform != "win32" else "spawn")
        if sys.platform != "win32":
            context.set_forkserver_preload(["papermill", "papermill.engines", "nbclient", "nbformat"])
        ours, theirs = context.Pipe(duplex=False)
        process = context.Process(target=child, args=(job, log, theirs), name=f"pumplib {name}")
        process.start()
        theirs.close()
        self.running[name] = Running(name, process, ours, inputs)
        self.progress.begin(name)

    def wait(self) -> list[Running]:
        """Take in messages for a moment.

        Returns
        -------
        list of Running
            Notebooks that ended.
        """
        pipes: dict[Any, Running] = {run.pipe: run for run in self.running.values()}
        for pipe in multiprocessing.connection.wait(list(pipes), timeout=0.2):
            run = pipes[pipe]
            try:
                kind, *content = run.pipe.recv()
            except (EOFError, OSError):
                run.process.join()
                code = run.process.exitcode
                run.outcome = Outcome(status="error", message=f"notebook {run.name}: worker ended with code {code}")
                continue
            if kind == "progress":
                self.progress.update(run.name, *content)
            else:
                run.outcome = content[0]
        self.progress.draw()
        self._sample()
        ended = [run for run in self.running.values() if run.outcome is not None]
        for run in ended:
            run.process.join()
            run.pipe.close()
            del self.running[run.name]
        return ended

    def _sample(self) -> None:
        now = time.monotonic()
        if now - self._sampled < 0.5:
            return
        self._sampled = now
        self.peak = max(self.peak, _memory())

    def kill(self) -> None:
        """End all workers and their kernels."""
        import psutil

        for run in self.running.values():
            with contextlib.suppress(psutil.Error):
                worker = psutil.Process(run.process.pid)
                # The worker last: while it lives its children are found.
                for process in [*worker.children(recursive=True), worker]:
                    with contextlib.suppress(psutil.Error):
                        process.kill()
            run.process.join()
        self.running.clear()


def _memory() -> int:
    """Memory of this process and all below it, shared pages counted once (bytes)."""
    try:
        import psutil
    except ImportError:
        return 0
    total = 0
    me = psutil.Process()
    for process in [me, *me.children(recursive=True)]:
        with contextlib.suppress(psutil.Error, AttributeError):
            total += process.memory_full_info().pss
    return total
