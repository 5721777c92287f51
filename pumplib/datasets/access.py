"""Thesis 1.3, 3.2, 3.3: find, check and download measured data sets (beyond the thesis)."""

import hashlib
import os
from pathlib import Path

from pumplib.datasets.registry import Dataset, DatasetStatus, FileCheck, Verdict, dataset, load_registry
from pumplib.errors import DataError
from pumplib.paths import DATA

FOLDER_VARIABLE = "PUMPLIB_DATA"
_CACHE_VARIABLE = "PUMPLIB_CACHE"


def _by_hand(item: Dataset) -> str:
    return (
        f"get the files from {item.home} ({item.licence}), lay them out as {item.layout} in a folder of yours and "
        f"set {FOLDER_VARIABLE} to that folder"
    )


def _cache(item: Dataset) -> Path:
    own = os.environ.get(_CACHE_VARIABLE)
    if own:
        return Path(own).expanduser() / "datasets" / item.name
    import platformdirs

    return Path(platformdirs.user_cache_dir("pumplib")) / "datasets" / item.name


def _local(item: Dataset) -> Path | None:
    """Folder of the set below ``PUMPLIB_DATA``, or None if the variable is not set."""
    root = os.environ.get(FOLDER_VARIABLE)
    return Path(root).expanduser() / item.name if root else None


def _csv(where: Path) -> list[str]:
    return sorted(path.relative_to(where).as_posix() for path in where.rglob("*.csv") if path.is_file())


def _missing(item: Dataset, where: Path) -> list[str]:
    return [name for name in item.files if not (where / name).is_file()]


def folder(name: str) -> Path:
    """Return the folder of a data set.

    Parameters
    ----------
    name : str
        Name of the set, see `names`.

    Returns
    -------
    Path
        With at least one CSV file in it (all known ones in the cache).

    Raises
    ------
    DataError
        If the name is unknown or the set is not on this machine; the message says how to get it. A notebook
        that can do without turns it into `NotebookSkipped`.
    """
    item = dataset(name)
    if item.shipped:
        where = DATA / item.shipped
        if not _csv(where):
            raise DataError(f"data set {name!r}: data/{item.shipped} is part of the repository but absent; restore it.")
        return where
    local = _local(item)
    if local is not None and local.is_dir() and _csv(local):
        return local
    cached = _cache(item)
    if cached.is_dir() and not _missing(item, cached):
        return cached
    looked = f"{FOLDER_VARIABLE} is not set" if local is None else f"{local} has no CSV file"
    remedy = f"run `python -m pumplib datasets --fetch {name}`, or " if item.url else ""
    raise DataError(f"data set {name!r} is not here ({looked}): {remedy}{_by_hand(item)}.")


def files(name: str) -> list[Path]:
    """Return the CSV files of a data set, also those that are not in the registry.

    Parameters
    ----------
    name : str
        Name of the set.

    Returns
    -------
    list of Path
        Sorted by path.

    Raises
    ------
    DataError
        See `folder`.
    """
    where = folder(name)
    return [where / path for path in _csv(where)]


def check(name: str) -> list[FileCheck]:
    """Compare the files of a data set with the checksums of the registry.

    Parameters
    ----------
    name : str
        Name of the set.

    Returns
    -------
    list of FileCheck
        Known files first, then files that are not in the registry.

    Raises
    ------
    DataError
        See `folder`.
    """
    item, where = dataset(name), folder(name)
    found = [FileCheck(path=path, verdict=_verdict(where / path, known.sha256)) for path, known in item.files.items()]
    extra = [path for path in _csv(where) if path not in item.files]
    return found + [FileCheck(path=path, verdict="not in the registry") for path in extra]


def _verdict(path: Path, sha256: str) -> Verdict:
    if not path.is_file():
        return "missing"
    return "ok" if hashlib.sha256(path.read_bytes()).hexdigest() == sha256 else "differs"


def status() -> list[DatasetStatus]:
    """List all data sets and whether they can be used here; never fails and never downloads.

    Returns
    -------
    list of DatasetStatus
    """
    result = []
    for item in load_registry().values():
        try:
            where = folder(item.name)
        except DataError as error:
            path, note = "", str(error)
        else:
            present = _csv(where)
            unknown = sum(1 for name in present if name not in item.files)
            path = str(where)
            note = f"{item.title}: {len(present)} files"
            note += f", {unknown} of them not in the registry" if unknown else ""
            lacking = len(_missing(item, where))
            note += f", {lacking} of {len(item.files)} registered files are missing" if lacking else ""
        result.append(
            DatasetStatus(
                name=item.name,
                where=path,
                available=bool(path),
                licence=item.licence,
                source=item.home,
                note=note,
            )
        )
    return result


def fetch(name: str) -> Path:
    """Make a data set available, by download into the cache if it is not here yet.

    Only the files of the registry are downloaded, each compared with its checksum; a file that is already in
    the cache is not loaded again.

    Parameters
    ----------
    name : str
        Name of the set.

    Returns
    -------
    Path
        Its folder.

    Raises
    ------
    DataError
        If the name is unknown, there is no network, a file is not at its address or has another checksum; the
        message says how to get the set by hand.
    """
    item = dataset(name)
    try:
        return folder(name)
    except DataError:
        if item.shipped:
            raise
    if not item.url:
        raise DataError(f"data set {name!r} cannot be downloaded from here: {_by_hand(item)}.")
    import pooch

    pooch.get_logger().setLevel("ERROR")
    target = _cache(item)
    for local, known in item.files.items():
        path = target / local
        try:
            pooch.retrieve(
                item.url.format(commit=known.commit, path=known.path),
                known_hash=f"sha256:{known.sha256}",
                fname=path.name,
                path=path.parent,
            )
        except (OSError, ValueError) as error:
            # pooch reports a wrong checksum as ValueError, requests every network trouble as OSError
            raise DataError(
                f"data set {name!r}: {local} could not be downloaded ({error}); {_by_hand(item)}."
            ) from error
    return folder(name)
