"""Thesis, all chapters: scored runs on the disk: written as they come, whole or not at all, found again later."""

import contextlib
import csv
import io
import json
import os
import shutil
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

from pumplib.campaign.work import KINDS, Scored, merge_kinds
from pumplib.errors import DataError, ParameterError

_SHOWN = 5  # differences that a refusal names


def write_bytes(path: Path, content: bytes) -> None:
    """Write a file so that it is there as a whole or not at all, whatever happens meanwhile.

    Parameters
    ----------
    path : Path
        File to write; its folder is made if absent.
    content : bytes
        What to write.
    """
    with replacing(path) as file:
        file.write(content)


@contextlib.contextmanager
def replacing(path: Path) -> Iterator[Any]:
    """Open a file for writing that takes its place when all has been written.

    Parameters
    ----------
    path : Path
        File to write; its folder is made if absent.

    Yields
    ------
    file
        Open for bytes.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    unfinished = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        with unfinished.open("wb") as file:
            yield file
            file.flush()
            os.fsync(file.fileno())
        os.replace(unfinished, path)
    except BaseException:
        unfinished.unlink(missing_ok=True)
        raise
    if os.name == "posix":
        folder = os.open(path.parent, os.O_RDONLY)
        try:
            os.fsync(folder)  # the new name is on the disk too
        finally:
            os.close(folder)


@dataclass(frozen=True, kw_only=True, slots=True)
class Part:
    """Some scored runs of one cell in a file.

    Parameters
    ----------
    path : Path
        The file: a line of JSON, then the rows as CSV.
    cell, first, count : int
        Cell, first run, number of runs.
    """

    path: Path
    cell: int
    first: int
    count: int

    def read(self) -> tuple[dict[str, Any], bytes]:
        """Read the part.

        Returns
        -------
        tuple of (dict, bytes)
            Head (columns, kinds, rows, seconds, cpu) and rows.

        Raises
        ------
        DataError
            If the file is damaged.
        """
        head, _, text = self.path.read_bytes().partition(b"\n")
        try:
            found: dict[str, Any] = json.loads(head)
            good = found["bytes"] == len(text) and found["columns"] and len(found["kinds"]) == len(found["columns"])
        except (ValueError, KeyError, TypeError):
            good = False
        if not good:
            raise DataError(f"{self.path.name}: is damaged; delete this file and run the campaign again.")
        return found, text

    def lines(self, runs: int) -> tuple[dict[str, Any], bytes, int]:
        """Rows of the runs below a limit.

        Parameters
        ----------
        runs : int
            Runs from this number on are left out.

        Returns
        -------
        tuple of (dict, bytes, int)
            Head, rows as CSV, number of rows.
        """
        head, text = self.read()
        if self.first + self.count <= runs:
            return head, text, int(head["rows"])
        place = head["columns"].index("run")
        kept = [row for row in csv.reader(io.StringIO(text.decode())) if int(row[place]) < runs]
        out = io.StringIO()
        csv.writer(out, lineterminator="\n").writerows(kept)
        return head, out.getvalue().encode(), len(kept)


def _differences(before: Any, now: Any, where: str = "") -> list[str]:
    if isinstance(before, Mapping) and isinstance(now, Mapping):
        keys = [*before, *(key for key in now if key not in before)]
        return [
            line
            for key in keys
            for line in _differences(before.get(key), now.get(key), f"{where}.{key}" if where else str(key))
        ]
    if isinstance(before, list) and isinstance(now, list) and len(before) == len(now):
        return [
            line
            for k, (one, other) in enumerate(zip(before, now, strict=True))
            for line in _differences(one, other, f"{where}[{k}]")
        ]
    if before == now:
        return []
    if where.startswith(("code.sources", "code.data")):
        return [f"{where.split('.', 2)[2]} has changed"]
    if isinstance(before, list) and isinstance(now, list):
        return [f"{where} had {len(before)} entries, has {len(now)}"]
    return [f"{where} was {before!r}, is {now!r}"]


class Store:
    """The parts of one campaign; one process at a time may use it.

    Parameters
    ----------
    folder : Path
        Where the parts are.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    @property
    def _parts(self) -> Path:
        return self.folder / "parts"

    @contextlib.contextmanager
    def opened(self, fingerprint: Mapping[str, Any], force: bool = False) -> Iterator["Store"]:
        """Use the folder for runs with this fingerprint, alone.

        Parameters
        ----------
        fingerprint : mapping
            All that a run depends on, as plain data.
        force : bool
            Whether parts with another fingerprint are thrown away.

        Yields
        ------
        Store

        Raises
        ------
        ParameterError
            If another process uses the folder, or it holds runs with another fingerprint.
        """
        self.folder.mkdir(parents=True, exist_ok=True)
        with (self.folder / "lock").open("w") as lock:
            _take(lock, self.folder)
            state = self.folder / "state.json"
            now = json.loads(json.dumps(fingerprint))  # tuples become lists, as in the file
            if self.parts():
                before = json.loads(state.read_text(encoding="utf-8")) if state.is_file() else None
                if before != now and force:
                    shutil.rmtree(self._parts)
                elif before != now:
                    changes = _differences(before, now) or ["state.json is missing"]
                    more = f", and {len(changes) - _SHOWN} more" if len(changes) > _SHOWN else ""
                    raise ParameterError(
                        f"{self.folder.name}: scored runs are there that were made otherwise: "
                        f"{'; '.join(changes[:_SHOWN])}{more}. Undo the change to go on with them, or use --force to "
                        "throw them away and begin again."
                    )
            write_bytes(state, json.dumps(now, indent=1).encode())
            for left in self._parts.glob(".*"):
                left.unlink()  # of a process that was killed while it wrote
            yield self

    def parts(self) -> list[Part]:
        """All parts in the order of cells and runs.

        Returns
        -------
        list of Part

        Raises
        ------
        DataError
            If two parts hold the same run.
        """
        found = []
        for path in sorted(self._parts.glob("[0-9]*.part")):
            cell, first, count = map(int, path.stem.split("-"))
            found.append(Part(path=path, cell=cell, first=first, count=count))
        found.sort(key=lambda part: (part.cell, part.first))
        for one, other in pairwise(found):
            if one.cell == other.cell and one.first + one.count > other.first:
                raise DataError(f"{one.path.name} and {other.path.name} hold the same run; delete one and run again.")
        return found

    def gaps(self, runs: tuple[int, ...]) -> list[list[tuple[int, int]]]:
        """Runs that are not there yet.

        Parameters
        ----------
        runs : tuple of int
            Number of runs of each cell.

        Returns
        -------
        list of list of (int, int)
            For each cell the first run of each gap and the run after its last.
        """
        found: list[list[tuple[int, int]]] = [[] for _ in runs]
        reached = [0] * len(runs)
        for part in self.parts():
            if part.cell < len(runs) and part.first < runs[part.cell]:
                if part.first > reached[part.cell]:
                    found[part.cell].append((reached[part.cell], part.first))
                reached[part.cell] = part.first + part.count
        for cell, (begin, end) in enumerate(zip(reached, runs, strict=True)):
            if begin < end:
                found[cell].append((begin, end))
        return found

    def add(self, scored: Scored) -> None:
        """Keep the runs of a chunk.

        Parameters
        ----------
        scored : Scored
            From a worker; nothing is written if it holds no run.
        """
        if scored.count:
            head = {
                "columns": scored.columns, "kinds": scored.kinds, "rows": scored.rows, "bytes": len(scored.text),
                "seconds": scored.seconds, "cpu": scored.cpu,
            }  # fmt: skip
            name = f"{scored.cell:04d}-{scored.first:010d}-{scored.count}.part"
            write_bytes(self._parts / name, json.dumps(head).encode() + b"\n" + scored.text)

    def pieces(self, runs: tuple[int, ...]) -> Iterator[tuple[dict[str, Any], bytes, int]]:
        """All rows, part by part, in the order of the table.

        Parameters
        ----------
        runs : tuple of int
            Number of runs of each cell.

        Yields
        ------
        tuple of (dict, bytes, int)
            Head of a part, its rows as CSV, their number.

        Raises
        ------
        DataError
            If runs are missing or parts do not fit together.
        """
        if missing := sum(end - begin for gaps in self.gaps(runs) for begin, end in gaps):
            raise DataError(f"{self.folder.name}: {missing} runs are missing; run the campaign to its end.")
        columns: list[str] | None = None
        for part in self.parts():
            if part.cell >= len(runs) or part.first >= runs[part.cell]:
                continue
            head, text, rows = part.lines(runs[part.cell])
            columns = columns or head["columns"]
            if head["columns"] != columns:
                raise DataError(
                    f"{part.path.name}: columns {', '.join(head['columns'])} differ from {', '.join(columns)}; a "
                    "scheme must return the same columns in the same order for every cell."
                )
            yield head, text, rows


def joined_kinds(columns: list[str], so_far: list[str], kinds: list[str]) -> list[str]:
    """Kinds of columns of several parts.

    Parameters
    ----------
    columns : list of str
        Names.
    so_far, kinds : list of str
        Kinds; the first may be empty.

    Returns
    -------
    list of str
    """
    if not so_far:
        return list(kinds)
    pairs = zip(columns, so_far, kinds, strict=True)
    return [KINDS[merge_kinds(name, KINDS.index(a), KINDS.index(b))] for name, a, b in pairs]


def _take(lock: Any, folder: Path) -> None:
    try:
        import fcntl
    except ImportError:  # Windows: without a lock, two processes would only do work twice
        return
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        raise ParameterError(f"{folder.name}: another process runs this campaign; wait until it has ended.") from None
