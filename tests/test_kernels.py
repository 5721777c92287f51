"""numba settings: the cache is keyed by the sources, and loading numba lightly takes nothing from its users."""

import subprocess
import sys

import numpy as np

from pumplib import kernels

LATER = """
import sys
import pumplib.kernels
assert "scipy.linalg" not in sys.modules, "the light start is what saves the time"
import numba, numpy as np
x = np.random.default_rng(0).normal(size=(3, 50))
f = numba.njit(lambda a: (np.cov(a), np.dot(a, a.T), np.linalg.inv(np.cov(a))))
cov, dot, inverse = f(x)
assert np.allclose(cov, np.cov(x)) and np.allclose(dot, x @ x.T) and np.allclose(inverse @ cov, np.eye(3))
"""


def test_numba_keeps_its_linear_algebra() -> None:
    done = subprocess.run([sys.executable, "-c", LATER], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_cache_folder_is_named_by_the_sources(monkeypatch, tmp_path) -> None:
    (tmp_path / "a.py").write_text("x = 1")
    monkeypatch.setattr(kernels, "_PACKAGE", tmp_path)
    kernels.sources_hash.cache_clear()
    first = kernels.sources_hash()
    (tmp_path / "a.py").write_text("x = 2")
    kernels.sources_hash.cache_clear()
    assert kernels.sources_hash() != first
    monkeypatch.undo()
    kernels.sources_hash.cache_clear()


def test_only_the_latest_caches_are_kept(monkeypatch, tmp_path) -> None:
    monkeypatch.setenv("PUMPLIB_CACHE", str(tmp_path))
    for k in range(5):
        (tmp_path / "numba" / f"old{k}").mkdir(parents=True)
    folder = kernels._cache_folder()
    assert folder.parent == tmp_path / "numba"
    assert folder.is_dir()
    assert len(list(folder.parent.iterdir())) == kernels._KEPT


def test_inlined_functions_do_not_reorder_sums() -> None:
    """Only contraction is allowed: a sum that cancels keeps its order."""

    @kernels.kernel
    def total(a: float, b: float, c: float) -> float:
        return (a + b) + c

    assert total(1e16, -1e16, 1.0) == 1.0
    assert np.isnan(total(np.inf, -np.inf, 1.0))
