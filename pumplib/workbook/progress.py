"""Thesis, all chapters: progress of the running notebooks on a terminal or in a log."""

import shutil
import sys
import time
from dataclasses import dataclass, field
from typing import TextIO


@dataclass
class _Task:
    began: float
    done: int = 0
    total: int = 0
    told: float = 0.0


@dataclass
class Progress:
    """Shows for each notebook the cells done and the time.

    On a terminal one line is drawn again and again; elsewhere a line appears when a notebook
    starts and ends and now and then between.

    Attributes
    ----------
    stream : TextIO
        Where to write.
    interval : float
        Least time between two lines of one notebook where there is no terminal (s).
    """

    stream: TextIO = field(default_factory=lambda: sys.stdout)
    interval: float = 10.0
    _tasks: dict[str, _Task] = field(default_factory=dict)

    def line(self, text: str) -> None:
        """Write a line that stays.

        Parameters
        ----------
        text : str
            The line.
        """
        if self.stream.isatty():
            self.stream.write("\r\x1b[K")
        self.stream.write(text + "\n")
        self.stream.flush()

    def begin(self, name: str) -> None:
        """Show that a notebook starts.

        Parameters
        ----------
        name : str
            Name of the notebook.
        """
        now = time.monotonic()
        self._tasks[name] = _Task(began=now, told=now)
        if not self.stream.isatty():
            self.line(f"{name}: started")

    def update(self, name: str, done: int, total: int) -> None:
        """Take in how far a notebook is.

        Parameters
        ----------
        name : str
            Name of the notebook.
        done, total : int
            Cells done, and in all.
        """
        task = self._tasks[name]
        task.done, task.total = done, total
        now = time.monotonic()
        if not self.stream.isatty() and now - task.told >= self.interval and done < total:
            task.told = now
            self.line(f"{name}: {done}/{total} cells, {now - task.began:.0f} s")

    def draw(self) -> None:
        """Draw the refreshing line of a terminal."""
        if not self.stream.isatty():
            return
        now = time.monotonic()
        parts = [f"{name} {t.done}/{t.total or '?'} {now - t.began:.0f} s" for name, t in self._tasks.items()]
        width = shutil.get_terminal_size().columns - 1
        self.stream.write("\r\x1b[K" + "  |  ".join(parts)[:width])
        self.stream.flush()

    def seconds(self, name: str) -> float:
        """Return how long a notebook has run.

        Parameters
        ----------
        name : str
            Name of the notebook.

        Returns
        -------
        float
            Time (s).
        """
        return time.monotonic() - self._tasks[name].began

    def end(self, name: str, status: str) -> None:
        """Show how a notebook ended.

        Parameters
        ----------
        name : str
            Name of the notebook.
        status : str
            How it ended.
        """
        seconds = self.seconds(name)
        task = self._tasks.pop(name)
        cells = f"{task.done}/{task.total} cells, " if task.total else ""
        self.line(f"{name}: {status}, {cells}{seconds:.1f} s")
