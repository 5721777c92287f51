"""Thesis, all chapters: the schemes that campaigns score, by name, and the state of the code behind them.

A scheme is a module-level object, or a module, with ``name``, ``settings`` (a frozen `Parameters` class) and
``score(settings, rng)``. It is imported when it is used, so that a long list costs nothing.
"""

import difflib
import hashlib
import importlib
import json
import platform
from collections.abc import Iterable, Mapping, Sequence
from functools import cache
from importlib import metadata
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from pumplib import paths
from pumplib.errors import ParameterError
from pumplib.kernels import imported_files
from pumplib.machines.quantity import Parameters

Value = float | int | str | bool | None
Row = Mapping[str, Value]

SCHEMES: dict[str, str] = {
    "events": "pumplib.campaign.events",
    "limits": "pumplib.campaign.limits",
    "residual": "pumplib.campaign.residual",
    "run_length": "pumplib.campaign.run_length",
    "stator": "pumplib.campaign.stator",
    "steady": "pumplib.campaign.steady",
}
"""Name of a scheme to the module, or ``module:object``, that holds it."""

DATA_FOLDERS = ("bench", "motors", "primer", "pumps", "scenarios")
"""Folders of data that runs on the bench depend on; a scheme with others has an attribute ``data``."""
_PACKAGES = ("numpy", "scipy", "numba", "llvmlite")


class Scheme(Protocol):
    """What a campaign needs of a scheme.

    Beside these it may have ``groups`` (columns that split a cell in the summary), ``data`` (folders of data it
    reads, `DATA_FOLDERS` by default) and ``summarise(table, campaign)``, which returns summary tables: a mapping
    of names to lists of rows.
    """

    @property
    def name(self) -> str:
        """Name in the registry."""

    @property
    def settings(self) -> type[Parameters]:
        """Class of the settings; a field ``profile`` takes the campaign's bench profile."""

    def score(self, settings: Any, rng: np.random.Generator) -> Row | Sequence[Row]:
        """Score one unit of work: one run, or one machine with several runs.

        Parameters
        ----------
        settings : Parameters
            Of the cell.
        rng : numpy.random.Generator
            The only source of randomness.

        Returns
        -------
        mapping or sequence of mapping
            One row, or several; the same columns in the same order each time. None is "no value" (not detected);
            NaN is refused.
        """


def closest(name: str, allowed: Iterable[str]) -> str:
    """Say what is allowed, and which of it is most like a wrong name.

    Parameters
    ----------
    name : str
        What was written.
    allowed : iterable of str
        What may be written.

    Returns
    -------
    str
        The end of an error message.
    """
    known = sorted(allowed)
    like = difflib.get_close_matches(str(name), known, n=1, cutoff=0.5)
    return f"must be one of {', '.join(known) or 'none'}" + (f"; did you mean {like[0]!r}?" if like else ".")


def scheme_path(name: str) -> str:
    """Where a scheme is.

    Parameters
    ----------
    name : str
        Name in the registry.

    Returns
    -------
    str
        Module, or ``module:object``.

    Raises
    ------
    ParameterError
        If there is no such scheme.
    """
    if name not in SCHEMES:
        raise ParameterError(f"scheme {name!r}: {closest(name, SCHEMES)}")
    return SCHEMES[name]


def load_scheme(path: str) -> Scheme:
    """Import a scheme.

    Parameters
    ----------
    path : str
        Module, or ``module:object``.

    Returns
    -------
    Scheme

    Raises
    ------
    ParameterError
        If it cannot be imported or is no scheme.
    """
    module, _, name = path.partition(":")
    try:
        found: Any = importlib.import_module(module)
        found = getattr(found, name) if name else found
    except (ImportError, AttributeError) as error:
        raise ParameterError(f"scheme {path!r}: cannot be imported ({error}); check the registry.") from None
    lacks = [part for part in ("name", "settings", "score") if not hasattr(found, part)]
    if lacks:
        raise ParameterError(f"scheme {path!r}: has no {', '.join(lacks)}; a scheme has name, settings and score.")
    if not (isinstance(found.settings, type) and issubclass(found.settings, Parameters)):
        raise ParameterError(f"scheme {path!r}: settings must be a subclass of Parameters, is {found.settings!r}.")
    result: Scheme = found
    return result


def _short(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()[:16]


def _relative(path: Path, root: Path) -> str:
    return path.relative_to(root).as_posix() if path.is_relative_to(root) else path.name


def code_state(path: str) -> dict[str, dict[str, str]]:
    """State of everything but the campaign file that a scheme's results depend on.

    Parameters
    ----------
    path : str
        Module, or ``module:object``, of a scheme.

    Returns
    -------
    dict
        ``sources``: hash of each file of the package that the scheme imports, directly or not; ``data``: hash of
        each data file; ``versions``: of Python and of the numerical libraries.
    """
    scheme = load_scheme(path)
    waiting = [Path(str(importlib.import_module(path.partition(":")[0]).__file__)).resolve()]
    waiting.append(Path(__file__).with_name("work.py").resolve())  # how generators are made and numbers written
    reached: set[Path] = set()
    while waiting:
        one = waiting.pop()
        if one not in reached:
            reached.add(one)
            waiting.extend(imported_files(one))
    files = [
        file
        for folder in getattr(scheme, "data", DATA_FOLDERS)
        for file in (paths.DATA / folder).rglob("*")
        if file.is_file() and not file.name.startswith(".")
    ]
    found = {name: metadata.version(name) for name in _PACKAGES}
    return {
        "sources": {_relative(file, paths.ROOT): _short(file.read_bytes()) for file in sorted(reached)},
        "data": {_relative(file, paths.DATA): _short(file.read_bytes()) for file in sorted(files)},
        "versions": {"python": platform.python_version(), **found},
    }


def code_digest(state: Mapping[str, Mapping[str, str]]) -> str:
    """Hash of a state of the code.

    Parameters
    ----------
    state : mapping
        Result of `code_state`.

    Returns
    -------
    str
        16 hex digits.
    """
    return _short(json.dumps(state, sort_keys=True).encode())


@cache
def loaded_digest(path: str) -> str:
    """Hash of the code as this process has loaded it: taken once, when a scheme is first used.

    Parameters
    ----------
    path : str
        Module, or ``module:object``, of a scheme.

    Returns
    -------
    str
        16 hex digits.
    """
    return code_digest(code_state(path))
