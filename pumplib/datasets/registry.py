"""Thesis 1.3, 3.2, 3.3: the list of measured data sets (beyond the thesis), its licences and checksums."""

import tomllib
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, Literal

from pumplib.errors import DataError
from pumplib.paths import DATA

REGISTRY = DATA / "datasets" / "registry.toml"
Verdict = Literal["ok", "differs", "missing", "not in the registry"]


@dataclass(frozen=True, kw_only=True, slots=True)
class KnownFile:
    """One file of a set as it was seen when the registry was made.

    Parameters
    ----------
    sha256 : str
        Checksum, hex.
    bytes : int
        Size.
    commit, path : str
        Where the set's public home has it; empty for shipped files.
    """

    sha256: str
    bytes: int
    commit: str = ""
    path: str = ""


@dataclass(frozen=True, kw_only=True, slots=True)
class Dataset:
    """One set of measurements.

    Parameters
    ----------
    name, title, home, licence, note : str
        What it is and where it comes from.
    files : dict of str to KnownFile
        Known files by their path in the set's folder.
    layout : str
        Where the files lie below ``PUMPLIB_DATA``; empty for shipped sets.
    url : str
        Address with ``{commit}`` and ``{path}``; empty if the set has to be fetched by hand.
    shipped : str
        Folder below ``data/``; empty for sets outside the repository.
    """

    name: str
    title: str
    home: str
    licence: str
    note: str
    files: dict[str, KnownFile]
    layout: str = ""
    url: str = ""
    shipped: str = ""


@dataclass(frozen=True, kw_only=True, slots=True)
class DatasetStatus:
    """Whether a set can be used here.

    Parameters
    ----------
    name : str
        Name of the set.
    where : str
        Its folder, or empty.
    available : bool
        Whether it can be used.
    licence, source : str
        Licence and public home.
    note : str
        Number of files, or how to get the set.
    """

    name: str
    where: str
    available: bool
    licence: str
    source: str
    note: str

    @property
    def ok(self) -> bool:
        """Same as `available`."""
        return self.available


@dataclass(frozen=True, kw_only=True, slots=True)
class FileCheck:
    """Result of comparing one file with the registry.

    Parameters
    ----------
    path : str
        Path in the set's folder.
    verdict : str
        ``"ok"``, ``"differs"``, ``"missing"`` or ``"not in the registry"``.
    """

    path: str
    verdict: Verdict


@cache
def load_registry(path: Path = REGISTRY) -> dict[str, Dataset]:
    """Read the registry.

    Parameters
    ----------
    path : Path
        TOML file, one table a set.

    Returns
    -------
    dict of str to Dataset

    Raises
    ------
    DataError
        If the file is absent, is no TOML or has a wrong field.
    """
    try:
        raw: dict[str, Any] = tomllib.loads(path.read_text(encoding="utf-8"))
        return {
            name: Dataset(
                name=name, **{**entry, "files": {file: KnownFile(**known) for file, known in entry["files"].items()}}
            )
            for name, entry in raw.items()
        }
    except FileNotFoundError:
        raise DataError(f"{path}: the registry of data sets is absent; restore it from the repository.") from None
    except (tomllib.TOMLDecodeError, TypeError, KeyError, AttributeError) as error:
        raise DataError(f"{path.name}: not a registry of data sets: {error}") from None


def names() -> tuple[str, ...]:
    """Return the names of all sets.

    Returns
    -------
    tuple of str
    """
    return tuple(load_registry())


def dataset(name: str) -> Dataset:
    """Return one set of the registry.

    Parameters
    ----------
    name : str
        One of `names`.

    Returns
    -------
    Dataset

    Raises
    ------
    DataError
        If there is no set of this name.
    """
    known = load_registry()
    if name not in known:
        raise DataError(f"data set {name!r} is unknown; there are {', '.join(known)}.")
    return known[name]
