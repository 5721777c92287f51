"""Thesis, all chapters: numba settings shared by every time-stepping kernel.

numba's on-disk cache does not notice an edit in a helper of another module and would return the
old machine code. The cache folder is therefore named by a hash of all sources of the package.
"""

import hashlib
import importlib
import os
import shutil
import sys
from collections.abc import Callable
from functools import cache, partial
from pathlib import Path
from typing import Any

import platformdirs

_PACKAGE = Path(__file__).resolve().parent
_KEPT = 3  # caches of this many source states are kept, older ones are removed


@cache
def sources_hash() -> str:
    """Return a hash of every Python source of the package.

    Returns
    -------
    str
        16 hex digits.
    """
    digest = hashlib.sha256()
    for path in sorted(_PACKAGE.rglob("*.py")):
        digest.update(path.relative_to(_PACKAGE).as_posix().encode())
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


def _cache_folder() -> Path:
    parent = Path(os.environ.get("PUMPLIB_CACHE") or platformdirs.user_cache_dir("pumplib")) / "numba"
    folder = parent / sources_hash()
    if not folder.is_dir():
        folder.mkdir(parents=True, exist_ok=True)
        older = sorted(parent.iterdir(), key=lambda p: p.stat().st_mtime, reverse=True)[_KEPT:]
        for stale in older:
            shutil.rmtree(stale, ignore_errors=True)
    return folder


os.environ["NUMBA_CACHE_DIR"] = str(_cache_folder())

import numba  # noqa: E402  (reads NUMBA_CACHE_DIR when imported)


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
vars(numba.config)["CACHE_DIR"] = os.environ["NUMBA_CACHE_DIR"]  # for a numba that was imported before us

# Fused multiply-add is what a C compiler does by default; reordering of sums is not allowed.
_FLAGS: dict[str, Any] = {"cache": True, "fastmath": {"contract"}, "error_model": "numpy"}

kernel: Callable[..., Any] = numba.njit(**_FLAGS, nogil=True)
"""Decorator of a compiled loop that Python calls."""

inline: Callable[..., Any] = partial(numba.njit, inline="always")(**_FLAGS)
"""Decorator of a small function of scalars that disappears into its kernel."""
