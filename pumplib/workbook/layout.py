"""Thesis, all chapters: the folders of one workbook, and writing files so that none is ever half written."""

import hashlib
import json
import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pumplib import paths
from pumplib.errors import NotebookError


@dataclass(frozen=True)
class Layout:
    """Folders of a workbook; everything follows from its root, so tests can build one anywhere.

    Attributes
    ----------
    root : Path
        Folder that holds `notebooks`, `data`, `figures` and `build`.
    package : Path
        Folder of the package's sources (part of every notebook's inputs).
    """

    root: Path = paths.ROOT
    package: Path = paths.ROOT / "pumplib"

    @property
    def notebooks(self) -> Path:
        """Folder of the notebooks."""
        return self.root / "notebooks"

    @property
    def data(self) -> Path:
        """Folder of parameter sets, tables and the ledger."""
        return self.root / "data"

    @property
    def ledger(self) -> Path:
        """File of the claims."""
        return self.data / "claims.toml"

    @property
    def measured(self) -> Path:
        """Folder of the dated results of benchmarks and campaigns."""
        return self.data / "measured"

    @property
    def figures(self) -> Path:
        """Folder of the committed figures."""
        return self.root / "figures"

    @property
    def index(self) -> Path:
        """File that lists the figures."""
        return self.figures / "index.toml"

    @property
    def made_with(self) -> Path:
        """Versions and machine that drew the figures of each notebook."""
        return self.figures / "made_with.json"

    @property
    def build(self) -> Path:
        """Folder of everything that can be made again."""
        return self.root / "build"

    @property
    def runs(self) -> Path:
        """Folder of the state of each notebook's last run."""
        return self.build / "runs"

    @property
    def executed(self) -> Path:
        """Folder of the executed notebooks."""
        return self.build / "notebooks"

    @property
    def report(self) -> Path:
        """Folder of the HTML report."""
        return self.build / "report"

    @property
    def scratch(self) -> Path:
        """Folder of runs that do not count: by hand, or with other parameters."""
        return self.build / "scratch"

    @property
    def claims(self) -> Path:
        """File of the judged claims."""
        return self.build / "claims.json"

    def notebook(self, name: str) -> Path:
        """Return the file of a notebook.

        Parameters
        ----------
        name : str
            Name without the ending.

        Returns
        -------
        Path
            The file, whether it exists or not.
        """
        return self.notebooks / f"{name}.ipynb"


def write_text(path: Path, text: str) -> None:
    """Write a text file in one step: a reader sees the old or the new text, never a part.

    Parameters
    ----------
    path : Path
        File to write; its folder is made if absent.
    text : str
        Content, written as UTF-8.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
    try:
        with os.fdopen(handle, "w", encoding="utf-8", newline="\n") as stream:
            stream.write(text)
        # mkstemp makes private files; what the workbook writes is as public as any other file.
        umask = os.umask(0)
        os.umask(umask)
        os.chmod(name, 0o666 & ~umask)
        os.replace(name, path)
    except BaseException:
        Path(name).unlink(missing_ok=True)
        raise


def write_json(path: Path, content: Any) -> None:
    """Write JSON in one step, indented, with a final newline.

    Parameters
    ----------
    path : Path
        File to write.
    content : object
        Anything that `json` can write; NaN is refused because other readers refuse it.

    Raises
    ------
    ValueError
        If the content holds a NaN or an infinity.
    """
    write_text(path, json.dumps(content, indent=1, ensure_ascii=False, allow_nan=False) + "\n")


def digest_files(files: list[Path], root: Path) -> str:
    """Return a hash of names and contents of files (hex).

    Parameters
    ----------
    files : list of Path
        Files to read.
    root : Path
        Folder that the names are taken relative to.

    Returns
    -------
    str
        SHA-256 over the sorted names and contents.
    """
    digest = hashlib.sha256()
    for path in sorted(files):
        content = path.read_bytes()
        # The length keeps "name + content" unambiguous.
        digest.update(f"{path.relative_to(root).as_posix()}\0{len(content)}\0".encode())
        digest.update(content)
    return digest.hexdigest()


@contextmanager
def exclusive(layout: Layout) -> Iterator[None]:
    """Keep a second run of the workbook out of the same folders while this one writes to them.

    Parameters
    ----------
    layout : Layout
        Folders.

    Yields
    ------
    None

    Raises
    ------
    NotebookError
        If another run is at work; a run that was killed leaves no hindrance.
    """
    import psutil

    layout.build.mkdir(parents=True, exist_ok=True)
    mark = layout.build / "running"
    try:
        owner = int(mark.read_text())
    except (FileNotFoundError, ValueError):
        owner = 0
    if owner and owner != os.getpid() and psutil.pid_exists(owner):
        raise NotebookError(
            f"another run of the workbook (process {owner}) writes to {layout.build}; wait for it to end, or end it"
        )
    mark.write_text(str(os.getpid()))
    try:
        yield
    finally:
        mark.unlink(missing_ok=True)
