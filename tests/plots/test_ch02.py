"""Thesis 2.1-2.1.4: the figures are legible and byte-stable, and show what they are given."""

from itertools import combinations

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.text import Text

from pumplib.errors import ParameterError
from pumplib.plots import ch02, ch02_schematics
from pumplib.plots.style import COLUMN, PAGE, save_figure
from pumplib.primer import APPROACHES, Scored

SCHEMATICS = {
    "ch02_system": ch02_schematics.system_with_fault,
    "ch02_signal_based": ch02_schematics.signal_based,
    "ch02_model_based": ch02_schematics.model_based,
}


def texts(figure: Figure) -> list[str]:
    return [text.get_text() for text in figure.findobj(Text)]


@pytest.mark.parametrize("name", SCHEMATICS)
def test_schematics_are_legible(name: str) -> None:
    figure = SCHEMATICS[name]()
    FigureCanvasAgg(figure).draw()
    assert figure.get_size_inches()[0] in (COLUMN, PAGE)
    shown = [text for text in figure.findobj(Text) if text.get_text() and text.axes.axison is False]
    assert all(text.get_fontsize() >= 7 for text in shown)
    boxes = [text.get_window_extent() for text in shown]
    assert all(box.x0 >= 0 and box.y0 >= 0 and box.x1 <= figure.bbox.x1 and box.y1 <= figure.bbox.y1 for box in boxes)
    assert not any(a.overlaps(b) for a, b in combinations(boxes, 2))


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("ch02_system", ["$u$", "$y$", "$f$", "System"]),
        ("ch02_signal_based", ["$r$", "$v$", "processing", "database", "evaluation"]),
        ("ch02_model_based", ["$u$", "$y$", "$f$", "$r$", "$v$", "residual filter", "evaluation"]),
    ],
)
def test_schematics_carry_the_labels_of_the_thesis(name: str, words: list[str]) -> None:
    assert set(words) <= set(texts(SCHEMATICS[name]()))


@pytest.mark.parametrize("name", SCHEMATICS)
def test_saving_is_byte_stable(name: str, tmp_path) -> None:
    first = [path.read_bytes() for path in save_figure(SCHEMATICS[name](), tmp_path / "a", name)]
    assert first == [path.read_bytes() for path in save_figure(SCHEMATICS[name](), tmp_path / "b", name)]


def test_roc_by_hand() -> None:
    none = (False,) * len(APPROACHES)
    runs = [Scored(size=s, adaptive=a, constant=a, alarms=none) for s, a in ((0.0, 1.0), (0.0, 3.0), (1.0, 2.0))]
    false, hits = ch02.roc(runs, 1.0, "adaptive")
    assert np.allclose(false, [0, 0.5, 0.5, 1.0])
    assert np.allclose(hits, [0, 0, 1.0, 1.0])


def test_isolation_marks_every_fault() -> None:
    points = {name: np.array([[k, -20.0]]) for k, name in enumerate(("none", "clogging", "friction", "leakage"))}
    figure = ch02.isolation(points)
    assert {"clogging", "friction", "leakage", "healthy"} <= set(texts(figure))
    with pytest.raises(ParameterError, match="rust"):
        ch02.isolation({"rust": np.zeros((1, 2))})


def test_bad_input() -> None:
    with pytest.raises(ParameterError, match="no outcome"):
        ch02.three_approaches(None, ())  # type: ignore[arg-type]
    with pytest.raises(ParameterError, match="one to four"):
        ch02.thresholds(None, None, None, (), ())  # type: ignore[arg-type]


def test_every_figure_has_a_unit_on_its_axes() -> None:
    points = {"none": np.zeros((2, 2)), "clogging": np.full((2, 2), -20.0)}
    for ax in ch02.isolation(points).axes:
        assert "/" in ax.get_xlabel()
        assert "/" in ax.get_ylabel()
