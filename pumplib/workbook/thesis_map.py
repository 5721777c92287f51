"""Thesis, all chapters: the table that leads from a section of the thesis to module, notebook and claims.

Nothing is listed by hand: modules name their sections in the first line of their docstring,
notebooks in their first cell, claims in the ledger.
"""

import ast
import json
import re
import tomllib
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path

from pumplib.errors import DataError
from pumplib.workbook.claims import load_claims
from pumplib.workbook.layout import Layout, write_text

OPEN, CLOSE = "<!-- thesis-map -->", "<!-- /thesis-map -->"
EVERYWHERE = "all chapters"
_SECTION = r"(?:summary|[1-8AB](?:\.\d+)*)"
_LIST = rf"{_SECTION}(?:\s*(?:,|-|–|and)\s*{_SECTION})*"
_FIRST_LINE = re.compile(rf"Thesis(?:,? ({EVERYWHERE})| ({_LIST})): \S")
_IN_PROSE = re.compile(rf"[Tt]hesis (?:(?:sections?|chapters?) )?({_LIST})")


@dataclass
class Entry:
    """What belongs to one section of the thesis.

    Attributes
    ----------
    section, title : str
        Number and title.
    modules, notebooks, claims : list of str
        Dotted module names, notebook names and claim ids.
    """

    section: str
    title: str
    modules: list[str] = field(default_factory=list)
    notebooks: list[str] = field(default_factory=list)
    claims: list[str] = field(default_factory=list)


def contents(layout: Layout) -> dict[str, str]:
    """Return the sections of the thesis.

    Parameters
    ----------
    layout : Layout
        Folders.

    Returns
    -------
    dict of str to str
        Title by number, in the order of the thesis.
    """
    text = (layout.data / "thesis_contents.toml").read_text(encoding="utf-8")
    return {str(key): str(title) for key, title in tomllib.loads(text)["sections"].items()}


def expand(text: str, known: Iterable[str]) -> list[str]:
    """Return the sections that a list such as "3.2.1, 3.3.2-3.3.4" names.

    Parameters
    ----------
    text : str
        Sections, separated by commas; a hyphen joins the ends of a range.
    known : iterable of str
        All sections in the order of the thesis.

    Returns
    -------
    list of str
        Single sections. A range holds the sections of the same depth between its ends.

    Raises
    ------
    DataError
        If a section is not in the thesis.
    """
    order = list(known)
    found: list[str] = []
    for part in re.split(r"\s*(?:,|\band\b)\s*", text.strip()):
        ends = re.split(r"\s*[-–]\s*", part)
        for end in ends:
            if end not in order:
                raise DataError(f"thesis section {end!r} in {text!r} does not exist; see data/thesis_contents.toml")
        first, last = order.index(ends[0]), order.index(ends[-1])
        depth = ends[0].count(".")
        found += [item for item in order[first : last + 1] if item.count(".") == depth]
    return found


def module_sections(path: Path, known: Iterable[str]) -> list[str]:
    """Return the sections that a module covers.

    Parameters
    ----------
    path : Path
        Source file.
    known : iterable of str
        All sections.

    Returns
    -------
    list of str
        Empty for a module of all chapters.

    Raises
    ------
    DataError
        If the first line of its docstring does not have the form `Thesis 3.2.1, 3.2.2: summary`.
    """
    docstring = ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or ""
    match = _FIRST_LINE.match(docstring)
    if match is None:
        raise DataError(
            f"{path.name}: begin the docstring with 'Thesis 3.2.1, 3.2.2: ...' or 'Thesis, {EVERYWHERE}: ...'"
        )
    return [] if match[1] else expand(match[2], known)


def notebook_sections(path: Path, known: Iterable[str]) -> list[str]:
    """Return the sections that a notebook's first cell names.

    Parameters
    ----------
    path : Path
        The file.
    known : iterable of str
        All sections.

    Returns
    -------
    list of str
        Empty if it says "all chapters".

    Raises
    ------
    DataError
        If the first cell is not Markdown with words such as "Thesis 3.1-3.5" or "thesis chapter 3".
    """
    cells = json.loads(path.read_text(encoding="utf-8"))["cells"]
    source = "".join(cells[0]["source"]) if cells and cells[0]["cell_type"] == "markdown" else ""
    found = [item for match in _IN_PROSE.findall(source) for item in expand(match, known)]
    if not found and not re.search(rf"thesis,? {EVERYWHERE}", source, re.IGNORECASE):
        raise DataError(f"{path.name}: its first cell must name its sections, as in 'Thesis 3.1-3.5'")
    return list(dict.fromkeys(found))


def build(layout: Layout | None = None) -> list[Entry]:
    """Build the map from sources, notebooks and ledger.

    Parameters
    ----------
    layout : Layout, optional
        Folders; the repository's by default.

    Returns
    -------
    list of Entry
        Sections that have a module, a notebook or a claim, in the order of the thesis.

    Raises
    ------
    DataError
        If a module, notebook or claim names no section, or one that does not exist.
    """
    layout = layout or Layout()
    titles = contents(layout)
    entries = {number: Entry(number, title) for number, title in titles.items()}
    for path in sorted(layout.package.rglob("*.py")):
        if path.name in ("__init__.py", "__main__.py"):
            continue
        dotted = ".".join(path.relative_to(layout.package).with_suffix("").parts)
        for section in module_sections(path, titles):
            entries[section].modules.append(dotted)
    for path in sorted(layout.notebooks.glob("[0-9]*.ipynb")):
        for section in notebook_sections(path, titles):
            entries[section].notebooks.append(path.stem)
    for claim in load_claims(layout.ledger).values():
        (section,) = expand(claim.section, titles)
        entries[section].claims.append(claim.id)
    return [entry for entry in entries.values() if entry.modules or entry.notebooks or entry.claims]


def to_markdown(entries: list[Entry]) -> str:
    """Render the map as a Markdown table.

    Parameters
    ----------
    entries : list of Entry
        Result of `build`.

    Returns
    -------
    str
        The table, without a final newline.
    """
    lines = ["| Thesis | Modules of `pumplib` | Notebooks | Claims |", "|---|---|---|---|"]
    for entry in entries:
        cells = [
            f"{entry.section} {entry.title}" if entry.section != "summary" else entry.title,
            ", ".join(f"`{name}`" for name in entry.modules),
            ", ".join(f"[{name}](notebooks/{name}.ipynb)" for name in entry.notebooks),
            ", ".join(f"`{name}`" for name in entry.claims),
        ]
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines)


def embed(readme: str, table: str) -> str:
    """Put the table between its markers in a text.

    Parameters
    ----------
    readme : str
        Text with both markers.
    table : str
        Result of `to_markdown`.

    Returns
    -------
    str
        The text with the new table.

    Raises
    ------
    DataError
        If a marker is absent.
    """
    before, opening, rest = readme.partition(OPEN)
    _, closing, after = rest.partition(CLOSE)
    if not opening or not closing:
        raise DataError(f"README.md lacks the markers {OPEN} and {CLOSE} around the thesis map")
    return f"{before}{OPEN}\n{table}\n{CLOSE}{after}"


def update_readme(layout: Layout | None = None) -> bool:
    """Bring the table in the README up to date.

    Parameters
    ----------
    layout : Layout, optional
        Folders; the repository's by default.

    Returns
    -------
    bool
        Whether the file changed.
    """
    layout = layout or Layout()
    path = layout.root / "README.md"
    old = path.read_text(encoding="utf-8")
    new = embed(old, to_markdown(build(layout)))
    if new != old:
        write_text(path, new)
    return new != old
