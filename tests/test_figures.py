"""Every committed figure is what its notebook draws: the same bytes on the same platform, or the same picture."""

import json
import os
import shutil
from pathlib import Path

import numpy as np
import pytest
from matplotlib.image import imread

from pumplib.paths import ROOT
from pumplib.workbook.figures import load_index
from pumplib.workbook.layout import Layout
from pumplib.workbook.machine import drawing_platform
from pumplib.workbook.runner import run_workbook

HERE = Layout()
INDEX = load_index(HERE.index)
LISTED = sorted({entry.notebook for entry in INDEX.values()} & {p.stem for p in HERE.notebooks.glob("*.ipynb")})

SHOWN_FILES = {"itsc": 26, "skab": 13}
REAL_DATA = {"40_real_motor_currents", "41_real_skab"}
"""Notebooks that need data which is not in the repository; more files there change their figures."""


def as_committed(notebook: str) -> bool:
    """Whether the reader's folder holds just the files that the committed figures show."""
    name = {"40_real_motor_currents": "itsc", "41_real_skab": "skab"}[notebook]
    folder = Path(os.environ.get("PUMPLIB_DATA", "")) / name
    return sum(1 for _ in folder.rglob("*.csv")) == SHOWN_FILES[name]


@pytest.fixture(scope="module")
def fresh(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[str]]:
    """Figures of a fresh run, and the notebooks that drew them: those without their data are skipped."""
    layout = Layout(tmp_path_factory.mktemp("workbook"), HERE.package)
    for folder in ("notebooks", "data"):
        shutil.copytree(ROOT / folder, layout.root / folder)
    layout.figures.mkdir()
    shutil.copy(HERE.index, layout.index)
    result = run_workbook(layout, only=LISTED)
    assert not result.failed, result.failed
    ran = [name for name in LISTED if result.states[name].status == "completed"]
    assert set(LISTED) - set(ran) <= REAL_DATA
    return layout.figures, ran


@pytest.fixture(scope="module")
def drawn(fresh: tuple[Path, list[str]]) -> Path:
    return fresh[0]


def test_every_figure_is_shown_in_its_notebook(fresh: tuple[Path, list[str]]) -> None:
    drawn, ran = fresh
    for notebook in ran:
        executed = json.loads((drawn.parent / "build" / "notebooks" / f"{notebook}.ipynb").read_text(encoding="utf-8"))
        outputs = [out for cell in executed["cells"] for out in cell.get("outputs", [])]
        shown = sum("image/png" in out.get("data", {}) for out in outputs)
        assert shown == sum(entry.notebook == notebook for entry in INDEX.values()), notebook


def difference(a: Path, b: Path) -> float:
    """Root mean square difference of two pictures, 0..1."""
    first, second = imread(a), imread(b)
    assert first.shape == second.shape, f"{a.name}: the picture has another size than the committed one"
    return float(np.sqrt(np.mean((first - second) ** 2)))


def test_figures_are_reproduced(fresh: tuple[Path, list[str]]) -> None:
    drawn, ran = fresh
    made = json.loads(HERE.made_with.read_text(encoding="utf-8"))
    changed = []
    for entry in INDEX.values():
        if entry.notebook not in ran or (entry.notebook in REAL_DATA and not as_committed(entry.notebook)):
            continue
        same_platform = made[entry.notebook] == drawing_platform()
        for name in entry.files:
            ours, committed = drawn / name, HERE.figures / name
            if ours.read_bytes() == committed.read_bytes():
                continue
            # another matplotlib or processor may round differently; the picture has to stay the same
            if same_platform or (name.endswith(".png") and difference(ours, committed) > 0.05):
                changed.append(name)
    assert not changed, f"run make workbook and commit the figures: {changed}"


def test_figures_of_measured_data_were_compared(fresh: tuple[Path, list[str]]) -> None:
    left_out = [name for name in sorted(REAL_DATA & set(LISTED)) if name not in fresh[1] or not as_committed(name)]
    if left_out:
        pytest.skip(f"figures of {', '.join(left_out)} were not compared: PUMPLIB_DATA holds other data or none")


def test_the_comparison_notices_another_picture(drawn: Path) -> None:
    names = sorted(path.name for path in drawn.glob("*.png"))
    assert difference(drawn / names[0], drawn / names[0]) == 0.0
    broken = imread(drawn / names[0]).copy()
    broken[: len(broken) // 4] = 0.5
    assert float(np.sqrt(np.mean((broken - imread(drawn / names[0])) ** 2))) > 0.05
