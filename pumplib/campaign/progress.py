"""Thesis, all chapters: how far a campaign is, at what rate, and how long it will take."""

import shutil
import sys
import time
from dataclasses import dataclass, field
from typing import TextIO


@dataclass(frozen=True, kw_only=True, slots=True)
class Status:
    """State of a running campaign.

    Parameters
    ----------
    campaign, cell : str
        Its name and the cell of the last scored runs.
    done, total : int
        Runs that are there, and in all.
    rate : float
        Runs a second since the start of this call; 0 before the first.
    left : float or None
        Time left, s; None before anything is known.
    workers : int
        Workers that there are now.
    """

    campaign: str
    cell: str
    done: int
    total: int
    rate: float
    left: float | None
    workers: int

    def __str__(self) -> str:
        share = f"{self.done}/{self.total} runs"
        rate = f", {self.rate:.3g} runs/s" if self.rate else ""
        left = "" if self.left is None else f", {_time(self.left)} left"
        crew = "" if self.workers else ", no worker is connected: waiting"
        return f"{self.campaign}: {share}{rate}{left}{crew}" + (f"  ({self.cell})" if self.cell else "")


def _time(seconds: float) -> str:
    if seconds < 90:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 5400 else f"{seconds / 3600:.1f} h"


@dataclass
class Console:
    """Shows the state on a terminal in one line, elsewhere in a line now and then.

    Parameters
    ----------
    stream : TextIO
        Where to write.
    interval : float
        Least time between two lines where there is no terminal, s.
    """

    stream: TextIO = field(default_factory=lambda: sys.stderr)
    interval: float = 10.0
    _told: float = field(default_factory=time.monotonic)

    def __call__(self, status: Status) -> None:
        """Take in a state.

        Parameters
        ----------
        status : Status
            State of the campaign.
        """
        now, last = time.monotonic(), status.done == status.total
        if self.stream.isatty():
            if last or now - self._told >= 0.2:
                self._told = now
                width = shutil.get_terminal_size().columns - 1
                self.stream.write("\r\x1b[K" + str(status)[:width] + ("\n" if last else ""))
                self.stream.flush()
        elif last or now - self._told >= self.interval:
            self._told = now
            self.stream.write(f"{status}\n")
            self.stream.flush()


@dataclass
class Clock:
    """Foresees the time left from what the runs of each cell have cost.

    Parameters
    ----------
    runs : list of int
        Runs of each cell that are still to do.
    """

    runs: list[int]
    begun: float = field(default_factory=time.monotonic)
    done: int = 0
    busy: float = 0.0
    cpu: float = 0.0
    _seconds: dict[int, float] = field(default_factory=dict)
    _counts: dict[int, int] = field(default_factory=dict)

    def add(self, cell: int, count: int, seconds: float, cpu: float) -> None:
        """Take in scored runs.

        Parameters
        ----------
        cell, count : int
            Cell and number of runs.
        seconds, cpu : float
            What they took a worker, s.
        """
        self.runs[cell] -= count
        self.done += count
        self.busy += seconds
        self.cpu += cpu
        self._seconds[cell] = self._seconds.get(cell, 0.0) + seconds
        self._counts[cell] = self._counts.get(cell, 0) + count

    @property
    def elapsed(self) -> float:
        """Time since the start, s."""
        return time.monotonic() - self.begun

    @property
    def rate(self) -> float:
        """Runs a second since the start."""
        return self.done / self.elapsed if self.done and self.elapsed > 0 else 0.0

    @property
    def left(self) -> float | None:
        """Time left, s: work left over the work done a second."""
        if not self.done or not self.busy:
            return None
        mean = self.busy / self.done
        work = sum(
            n * (self._seconds[c] / self._counts[c] if self._counts.get(c) else mean) for c, n in enumerate(self.runs)
        )
        return work * self.elapsed / self.busy
