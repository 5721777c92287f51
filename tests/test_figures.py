"""Every committed figure is what its notebook draws: the same bytes on the same platform, or the same picture."""

import json
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
NOTEBOOKS = sorted({entry.notebook for entry in INDEX.values()} & {p.stem for p in HERE.notebooks.glob("*.ipynb")})


@pytest.fixture(scope="module")
def drawn(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Figures of a fresh run of all notebooks that have figures."""
    layout = Layout(tmp_path_factory.mktemp("workbook"), HERE.package)
    for folder in ("notebooks", "data"):
        shutil.copytree(ROOT / folder, layout.root / folder)
    layout.figures.mkdir()
    shutil.copy(HERE.index, layout.index)
    result = run_workbook(layout, only=NOTEBOOKS)
    assert not result.failed, result.failed
    return layout.figures


def test_every_figure_is_shown_in_its_notebook(drawn: Path) -> None:
    for notebook in NOTEBOOKS:
        executed = json.loads((drawn.parent / "build" / "notebooks" / f"{notebook}.ipynb").read_text(encoding="utf-8"))
        outputs = [out for cell in executed["cells"] for out in cell.get("outputs", [])]
        shown = sum("image/png" in out.get("data", {}) for out in outputs)
        assert shown == sum(entry.notebook == notebook for entry in INDEX.values()), notebook


def difference(a: Path, b: Path) -> float:
    """Root mean square difference of two pictures, 0..1."""
    first, second = imread(a), imread(b)
    assert first.shape == second.shape, f"{a.name}: the picture has another size than the committed one"
    return float(np.sqrt(np.mean((first - second) ** 2)))


def test_figures_are_reproduced(drawn: Path) -> None:
    made = json.loads(HERE.made_with.read_text(encoding="utf-8"))
    changed = []
    for entry in INDEX.values():
        if entry.notebook not in NOTEBOOKS:
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


def test_the_comparison_notices_another_picture(drawn: Path) -> None:
    names = sorted(path.name for path in drawn.glob("*.png"))
    assert difference(drawn / names[0], drawn / names[0]) == 0.0
    broken = imread(drawn / names[0]).copy()
    broken[: len(broken) // 4] = 0.5
    assert float(np.sqrt(np.mean((broken - imread(drawn / names[0])) ** 2))) > 0.05
