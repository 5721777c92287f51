"""Thesis, all chapters: what the cells of a notebook assign: defaults, and names nobody asked for."""

import ast
import json
import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from pumplib.errors import ParameterError


def assigned_names(source: str) -> list[str]:
    """Return the names that a cell assigns at its top level.

    Parameters
    ----------
    source : str
        Source of the cell; one that is not plain Python (magics) assigns nothing.

    Returns
    -------
    list of str
        In order of appearance.
    """
    try:
        body = ast.parse(source).body
    except SyntaxError:
        return []
    names: list[str] = []
    for statement in body:
        targets: list[ast.expr] = []
        if isinstance(statement, ast.Assign):
            targets = statement.targets
        elif isinstance(statement, ast.AnnAssign) and statement.value is not None:
            targets = [statement.target]
        names += [target.id for target in targets if isinstance(target, ast.Name)]
    return names


def read_defaults(notebook: Path) -> dict[str, Any]:
    """Return the values in the cell tagged `parameters` of a notebook.

    Parameters
    ----------
    notebook : Path
        The file.

    Returns
    -------
    dict of str to object
        Raw default by name; empty if there is no such cell.

    Raises
    ------
    ParameterError
        If a default is not a literal, or the file cannot be read.
    """
    try:
        cells = json.loads(notebook.read_text(encoding="utf-8"))["cells"]
    except (OSError, ValueError, KeyError) as error:
        raise ParameterError(f"{notebook.name}: cannot be read as a notebook: {error}") from error
    defaults: dict[str, Any] = {}
    for cell in cells:
        if cell.get("cell_type") != "code" or "parameters" not in cell.get("metadata", {}).get("tags", []):
            continue
        source = cell["source"] if isinstance(cell["source"], str) else "".join(cell["source"])
        for statement in ast.parse(source).body:
            if isinstance(statement, ast.AnnAssign) and statement.value is not None:
                target: ast.expr = statement.target
            elif isinstance(statement, ast.Assign) and len(statement.targets) == 1:
                target = statement.targets[0]
            else:
                continue
            if isinstance(target, ast.Name):
                try:
                    defaults[target.id] = ast.literal_eval(statement.value)  # type: ignore[arg-type]
                except ValueError:
                    raise ParameterError(
                        f"{notebook.name}: default of {target.id} must be a plain value, not an expression"
                    ) from None
    return defaults


def unknown_names(history: Iterable[str], known: Iterable[str]) -> list[str]:
    """Return names that a parameters cell assigns although the notebook has no such parameter.

    Parameters
    ----------
    history : iterable of str
        Sources of the cells run so far, in order (IPython's `In`).
    known : iterable of str
        Names of the notebook's parameters.

    Returns
    -------
    list of str
        Unknown names of the newest parameters cells. A cell counts as one if it begins with the
        line that papermill writes or assigns a known parameter. Running such a cell again after
        `start` takes back what the older ones assigned.
    """
    allowed = set(known)
    unknown: list[str] = []
    started = False
    for source in history:
        if re.search(r"""\bstart\(\s*["']""", source):
            started = True
            continue
        names = assigned_names(source)
        if source.lstrip().startswith("# Parameters") or allowed.intersection(names):
            if started or allowed.issubset(names):
                unknown = []
            started = False
            unknown += [name for name in names if name not in allowed and name not in unknown]
    return unknown
