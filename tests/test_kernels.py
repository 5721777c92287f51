"""numba settings: the cache is keyed by the sources, and loading numba lightly takes nothing from its users."""

import os
import subprocess
import sys

import numpy as np
import pytest

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


@pytest.fixture
def package(monkeypatch, tmp_path):
    """A package of three modules: `top` imports `middle`, `middle` imports `low`; `other` stands apart."""
    folder = tmp_path / "pack"
    folder.mkdir()
    (folder / "__init__.py").write_text("")
    (folder / "top.py").write_text("from pack.middle import twice\n")
    (folder / "middle.py").write_text("def later():\n    from pack import low\n    return low\n")
    (folder / "low.py").write_text("x = 1\n")
    (folder / "other.py").write_text("y = 1\n")
    monkeypatch.setattr(kernels, "_PACKAGE", folder)
    monkeypatch.setenv("PUMPLIB_CACHE", str(tmp_path / "cache"))
    forget()
    yield folder
    monkeypatch.undo()
    forget()


def forget() -> None:
    for cached in (kernels.imported_files, kernels.sources_hash, kernels._cache_folder):
        cached.cache_clear()


@pytest.mark.parametrize(("edited", "noticed"), [("top", True), ("middle", True), ("low", True), ("other", False)])
def test_cache_folder_follows_what_a_module_imports(package, edited: str, noticed: bool) -> None:
    before = kernels._cache_folder(package / "top.py")
    with (package / f"{edited}.py").open("a") as file:
        file.write("z = 2\n")
    forget()
    assert (kernels._cache_folder(package / "top.py") != before) is noticed


def test_only_the_latest_caches_of_a_module_are_kept(package) -> None:
    for k in range(6):
        (package / "low.py").write_text(f"x = {k}\n")
        forget()
        folder = kernels._cache_folder(package / "top.py")
    assert folder.is_dir()
    assert len(list(folder.parent.iterdir())) == kernels._KEPT


EDITED = """
import sys
sys.path.insert(0, sys.argv[1])
from outer import f
print(f(3.0))
"""


def test_an_edit_in_a_helper_of_another_module_is_noticed(tmp_path) -> None:
    """End to end, with real kernels: numba alone returns the old result here."""
    source = (
        "from pathlib import Path\nfrom pumplib import kernels\n"
        f"kernels._PACKAGE = Path({str(tmp_path / 'bits')!r})\nfrom bits.helper import g\n\n"
        "@kernels.kernel\ndef f(x):\n    return g(x)\n"
    )
    (tmp_path / "bits").mkdir()
    (tmp_path / "bits" / "__init__.py").write_text("")
    (tmp_path / "outer.py").write_text(source)
    answers = []
    for factor in (2, 5):
        (tmp_path / "bits" / "helper.py").write_text(
            f"from pumplib import kernels\n\n@kernels.inline\ndef g(x):\n    return {factor} * x\n"
        )
        done = subprocess.run(
            [sys.executable, "-c", EDITED, str(tmp_path)],
            capture_output=True,
            text=True,
            check=False,
            env={**os.environ, "PUMPLIB_CACHE": str(tmp_path / "cache")},
        )
        assert done.returncode == 0, done.stderr
        answers.append(float(done.stdout))
    assert answers == [6.0, 15.0]


def test_inlined_functions_do_not_reorder_sums() -> None:
    """Only contraction is allowed: a sum that cancels keeps its order."""

    @kernels.kernel
    def total(a: float, b: float, c: float) -> float:
        return (a + b) + c

    assert total(1e16, -1e16, 1.0) == 1.0
    assert np.isnan(total(np.inf, -np.inf, 1.0))
