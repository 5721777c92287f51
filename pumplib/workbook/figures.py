"""Thesis, all chapters: the list of figures, from figure id to the thesis's own number."""

import re
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from pumplib.errors import ParameterError
from pumplib.workbook.claims import CLASSES

_FIELDS = {"title", "class", "notebook", "thesis"}


@dataclass(frozen=True, kw_only=True)
class FigureEntry:
    """One figure of the workbook.

    Attributes
    ----------
    id : str
        File name without ending, such as `ch03_start_up`.
    title : str
        What it shows, in one line.
    kind : str
        `replicated`, `reconstructed` or `beyond` (the field `class` of the file).
    notebook : str
        Notebook that draws it.
    thesis : str
        Number of the figure in the thesis such as "3.4", or "" if it has none.
    """

    id: str
    title: str
    kind: str
    notebook: str
    thesis: str = ""

    @property
    def files(self) -> tuple[str, str]:
        """Names of the files of this figure."""
        return f"{self.id}.svg", f"{self.id}.png"


def load_index(path: Path) -> dict[str, FigureEntry]:
    """Read and check the list of figures.

    Parameters
    ----------
    path : Path
        `figures/index.toml`: one table a figure with title, class, notebook and, if it has one,
        its number in the thesis.

    Returns
    -------
    dict of str to FigureEntry
        In the order of the file; empty if the file does not exist.

    Raises
    ------
    ParameterError
        If the file cannot be read or a field is missing, unknown or wrong.
    """
    if not path.exists():
        return {}
    try:
        content = tomllib.loads(path.read_text(encoding="utf-8"))
    except tomllib.TOMLDecodeError as error:
        raise ParameterError(f"{path.name}: cannot be read: {error}") from error
    index: dict[str, FigureEntry] = {}
    for name, fields in content.items():
        where = f"{path.name}: figure {name!r}"
        if not re.fullmatch(r"[a-z][a-z0-9_]*", name):
            raise ParameterError(f"{where}: use small letters, digits and underscores, as in ch03_start_up")
        if not isinstance(fields, Mapping):
            raise ParameterError(f"{where}: write a table [{name}] with title, class and notebook")
        missing = sorted(_FIELDS - {"thesis"} - set(fields))
        unknown = sorted(set(fields) - _FIELDS)
        if missing or unknown:
            raise ParameterError(f"{where}: missing {missing or 'nothing'}, unknown {unknown or 'nothing'}")
        if any(not isinstance(value, str) for value in fields.values()):
            raise ParameterError(f"{where}: every field is a text")
        if fields["class"] not in CLASSES:
            raise ParameterError(f"{where}: class = {fields['class']!r}; use one of {', '.join(CLASSES)}")
        if not re.fullmatch(r"(\d\.\d+)?", fields.get("thesis", "")):
            raise ParameterError(f'{where}: thesis = {fields["thesis"]!r}; write a number such as "3.4"')
        rest = {key: value for key, value in fields.items() if key != "class"}
        index[name] = FigureEntry(id=name, kind=fields["class"], **rest)
    return index


def index_problems(index: Mapping[str, FigureEntry], folder: Path, notebooks: set[str]) -> list[str]:
    """Compare the list of figures with the files.

    Parameters
    ----------
    index : mapping of str to FigureEntry
        Result of `load_index`.
    folder : Path
        Folder of the figures.
    notebooks : set of str
        Names of the notebooks that exist; figures of others are not expected yet.

    Returns
    -------
    list of str
        One line for each figure without files and each file without a figure.
    """
    expected = {name for entry in index.values() for name in entry.files}
    present = {path.name for path in folder.glob("*") if path.suffix in (".svg", ".png")}
    due = {name for entry in index.values() if entry.notebook in notebooks for name in entry.files}
    lines = [f"{name}: listed in index.toml but not in the folder" for name in sorted(due - present)]
    return lines + [f"{name}: in the folder but not listed in index.toml" for name in sorted(present - expected)]
