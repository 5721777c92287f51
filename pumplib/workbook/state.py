"""Thesis, all chapters: what is known of each notebook's last run, and whether it is still true."""

import hashlib
import json
import sys
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from importlib import metadata
from pathlib import Path
from typing import Any

from pumplib.workbook.claims import Measurement
from pumplib.workbook.layout import Layout, digest_files, write_json

# A new version of these can change a number or a picture.
_PACKAGES = (
    *("numpy", "scipy", "numba", "llvmlite", "matplotlib", "cvxpy", "clarabel", "sympy", "networkx"),
    *("pandas", "papermill", "nbclient", "ipykernel", "ipython"),
)


@dataclass(frozen=True, kw_only=True)
class State:
    """Result of a notebook's last run.

    Attributes
    ----------
    notebook, status, message : str
        Name; `completed`, `skipped` or `error`; reason or error summary.
    inputs : str
        Hash of everything that the result depends on.
    seconds : float
        Time of the run.
    claims : list of Measurement
        Recorded values.
    figures : dict of str to str
        File name and hash of each figure.
    """

    notebook: str
    status: str
    inputs: str
    seconds: float
    message: str = ""
    claims: list[Measurement] = field(default_factory=list)
    figures: dict[str, str] = field(default_factory=dict)


def read_measurements(path: Path) -> list[Measurement]:
    """Read the values that a notebook recorded.

    Parameters
    ----------
    path : Path
        JSON file that `Notebook.record` wrote; absent if nothing was recorded.

    Returns
    -------
    list of Measurement
        In the order of recording.
    """
    if not path.exists():
        return []
    return [_measurement(entry) for entry in json.loads(path.read_text(encoding="utf-8"))]


def _measurement(entry: Mapping[str, Any]) -> Measurement:
    value = entry["value"]
    return Measurement(**{**entry, "value": tuple(value) if isinstance(value, list) else value})


def load_state(layout: Layout, name: str) -> State | None:
    """Read the state of a notebook.

    Parameters
    ----------
    layout : Layout
        Folders.
    name : str
        Name of the notebook.

    Returns
    -------
    State or None
        None if it never ran or the file is not readable (then the notebook simply runs again).
    """
    try:
        content = json.loads((layout.runs / f"{name}.json").read_text(encoding="utf-8"))
        claims = [_measurement(entry) for entry in content.pop("claims")]
        return State(claims=claims, **content)
    except (OSError, ValueError, TypeError, KeyError):
        return None


def save_state(layout: Layout, state: State) -> None:
    """Write the state of a notebook in one step.

    Parameters
    ----------
    layout : Layout
        Folders.
    state : State
        What to write.
    """
    write_json(layout.runs / f"{state.notebook}.json", asdict(state))


def environment_text() -> str:
    """Return the versions of Python and of the packages that results depend on.

    Returns
    -------
    str
        One `name version` a line.
    """
    found = {dist.metadata["Name"].lower(): dist.version for dist in metadata.distributions()}
    lines = [f"python {sys.version_info.major}.{sys.version_info.minor}.{sys.version_info.micro}"]
    return "\n".join(lines + [f"{name} {found[name]}" for name in _PACKAGES if name in found])


def common_inputs(layout: Layout) -> str:
    """Return a hash of what every notebook depends on: sources, data, figure list and versions.

    Parameters
    ----------
    layout : Layout
        Folders.

    Returns
    -------
    str
        Hash (hex).
    """
    digest = hashlib.sha256(environment_text().encode())
    digest.update(digest_files(sorted(layout.package.rglob("*.py")), layout.package).encode())
    data = [path for path in layout.data.rglob("*") if path.is_file() and not path.name.startswith(".")]
    digest.update(digest_files(data, layout.data).encode())
    if layout.index.exists():
        digest.update(layout.index.read_bytes())
    return digest.hexdigest()


def notebook_inputs(layout: Layout, name: str, common: str, extra: str = "") -> str:
    """Return the hash of everything that one notebook's result depends on.

    Parameters
    ----------
    layout : Layout
        Folders.
    name : str
        Name of the notebook.
    common : str
        Result of `common_inputs`.
    extra : str
        Anything else it reads (the overview reads the other notebooks' claims).

    Returns
    -------
    str
        Hash (hex).
    """
    digest = hashlib.sha256(common.encode())
    digest.update(layout.notebook(name).read_bytes())
    digest.update(extra.encode())
    return digest.hexdigest()


def figure_hashes(folder: Path, names: list[str]) -> dict[str, str]:
    """Return the hash of each figure file.

    Parameters
    ----------
    folder : Path
        Folder of the figures.
    names : list of str
        File names; one that is absent is left out.

    Returns
    -------
    dict of str to str
        Hash by file name.
    """
    return {
        name: hashlib.sha256((folder / name).read_bytes()).hexdigest()
        for name in sorted(names)
        if (folder / name).exists()
    }


def is_current(layout: Layout, state: State | None, inputs: str) -> bool:
    """Return whether a notebook need not run again.

    Parameters
    ----------
    layout : Layout
        Folders.
    state : State or None
        Its last run.
    inputs : str
        Hash of what it depends on now.

    Returns
    -------
    bool
        True if it completed with the same inputs and all that it wrote is still there, unchanged.
    """
    if state is None or state.status != "completed" or state.inputs != inputs:
        return False
    if not (layout.executed / f"{state.notebook}.ipynb").exists():
        return False
    return figure_hashes(layout.figures, list(state.figures)) == state.figures
