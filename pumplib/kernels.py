"""Thesis, all chapters: numba settings shared by every time-stepping kernel.

numba's on-disk cache does not notice an edit in a helper of another module and would return the
old machine code. Every kernel's cache folder is therefore named by a hash of its module and of all
modules of the package that this one imports, so an edit elsewhere costs no compilation.
"""

import ast
import hashlib
import importlib
import os
import shutil
import sys
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import platformdirs

_PACKAGE = Path(__file__).resolve().parent
_KEPT = 3  # caches of this many source states are kept for a module, older ones are removed


def _root() -> Path:
    return Path(os.environ.get("PUMPLIB_CACHE") or platformdirs.user_cache_dir("pumplib")) / "numba"


# A numba imported before us reads its configuration, one imported later the environment.
os.environ.setdefault("NUMBA_CACHE_DIR", str(_root()))

import numba  # noqa: E402


def _load_without_blas_check() -> None:
    """Load numba's array functions without importing scipy.linalg, which only checks that it is there.

    The check takes a fifth of a second in every process; scipy is among our requirements.
    """
    if "scipy.linalg" in sys.modules or "numba.np.arraymath" in sys.modules:
        return
    modules: dict[str, Any] = sys.modules  # None makes an import fail at once
    modules["scipy.linalg"] = None
    try:
        arraymath: Any = importlib.import_module("numba.np.arraymath")
    finally:
        del modules["scipy.linalg"]
    if hasattr(arraymath, "_HAVE_BLAS"):
        arraymath._HAVE_BLAS = True  # as the check would have found


_load_without_blas_check()


def _file_of(name: str) -> Path | None:
    """File of a module of the package, None for anything else."""
    parts = name.split(".")
    if parts[0] != _PACKAGE.name:
        return None
    place = _PACKAGE.joinpath(*parts[1:])
    candidates = (place.with_suffix(".py"), place / "__init__.py") if len(parts) > 1 else (place / "__init__.py",)
    return next((path for path in candidates if path.is_file()), None)


@cache
def imported_files(path: Path) -> tuple[Path, ...]:
    """Files of the package that a file imports, wherever the statement stands.

    Parameters
    ----------
    path : Path
        A Python file.

    Returns
    -------
    tuple of Path
    """
    names: set[str] = set()
    for node in ast.walk(ast.parse(path.read_bytes())):
        if isinstance(node, ast.Import):
            names.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            names.add(node.module)
            names.update(f"{node.module}.{alias.name}" for alias in node.names)  # a name may be a module
    return tuple(sorted(found for name in names if (found := _file_of(name)) is not None))


@cache
def sources_hash(path: Path) -> str:
    """Return a hash of a Python file and of every module of the package that it imports, directly or not.

    Parameters
    ----------
    path : Path
        The file.

    Returns
    -------
    str
        16 hex digits.
    """
    reached, waiting = set[Path](), [path]
    while waiting:
        one = waiting.pop()
        if one not in reached:
            reached.add(one)
            waiting.extend(imported_files(one))
    digest = hashlib.sha256()
    for one in sorted(reached):
        digest.update(str(one).encode())
        digest.update(one.read_bytes())
    return digest.hexdigest()[:16]


@cache
def _cache_folder(path: Path) -> Path:
    """Folder of the compiled kernels of a file, made; the oldest states of the same file are removed."""
    state = sources_hash(path)
    whose = _root() / f"{path.stem}-{hashlib.sha256(str(path).encode()).hexdigest()[:8]}"
    folder = whose / state
    if not folder.is_dir():
        folder.mkdir(parents=True, exist_ok=True)
        for stale in sorted(whose.iterdir(), key=lambda p: p.stat().st_mtime, reverse=True)[_KEPT:]:
            shutil.rmtree(stale, ignore_errors=True)
    return folder


def compiled(**flags: Any) -> Callable[..., Any]:
    """Make a decorator for kernels with an on-disk cache that notices edits in imported modules.

    Parameters
    ----------
    **flags
        Arguments of `numba.njit`.

    Returns
    -------
    callable
        Decorator.
    """

    def decorate(function: Callable[..., Any]) -> Callable[..., Any]:
        path = Path(function.__code__.co_filename).resolve()
        settings: dict[str, Any] = vars(numba.config)  # numba reads the folder when a function is decorated
        before = settings["CACHE_DIR"]
        settings["CACHE_DIR"] = str(_cache_folder(path) if path.is_file() else _root())
        try:
            return numba.njit(cache=True, **flags)(function)
        finally:
            settings["CACHE_DIR"] = before

    return decorate


# Fused multiply-add is what a C compiler does by default; reordering of sums is not allowed.
_FLAGS: dict[str, Any] = {"fastmath": {"contract"}, "error_model": "numpy"}

kernel: Callable[..., Any] = compiled(**_FLAGS, nogil=True)
"""Decorator of a compiled loop that Python calls."""

inline: Callable[..., Any] = compiled(**_FLAGS, inline="always")
"""Decorator of a small function of scalars that disappears into its kernel."""
