"""Thesis 6.1, 6.3: the figures show what the analysis says, are legible and byte-stable."""

from itertools import combinations

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.patches import Rectangle
from matplotlib.text import Text

from pumplib.errors import ParameterError
from pumplib.plots import ch06_structure as ch06
from pumplib.plots.style import COLOURS, PAGE, save_figure
from pumplib.structure import examples, pump
from pumplib.structure.cascade import cascade
from pumplib.structure.dm import decompose
from pumplib.structure.graph import Structure
from pumplib.structure.mso import mso_sets

PART = pump.pump_part().structure()
SYSTEM = pump.pump_with_motor()
SPLIT = cascade(SYSTEM.structure())
RESIDUALS = {f"r{k + 1}": subset for k, subset in enumerate(mso_sets(PART))}
MIXED = Structure.from_sets(
    "all parts",
    {"e1": ["a", "b", "c"], "e2": ["b", "c"], "e3": ["b", "c"], "e4": ["a", "d"], "e5": ["d", "q", "w"], "e6": ["c"]},
)
FIGURES = {
    "ch06_structure_pump": lambda: ch06.incidence(decompose(PART)),
    "ch06_structure_system": lambda: ch06.incidence(decompose(SYSTEM.structure()), split=SPLIT),
    "ch06_structure_parts": lambda: ch06.incidence(decompose(MIXED)),
    "ch06_isolability": lambda: ch06.isolation(PART, RESIDUALS),
    "ch06_cascade": lambda: ch06.cascade(SYSTEM, SPLIT),
}


@pytest.mark.parametrize("name", FIGURES)
def test_figures_are_legible(name):
    figure = FIGURES[name]()
    FigureCanvasAgg(figure).draw()
    assert figure.get_size_inches()[0] <= PAGE
    shown = [text for text in figure.findobj(Text) if text.get_text() and text.get_visible()]
    assert all(text.get_fontsize() >= 7 for text in shown)
    boxes = [text.get_window_extent() for text in shown]
    inside = figure.bbox
    assert all(b.x0 >= 0 and b.y0 >= 0 and b.x1 <= inside.x1 and b.y1 <= inside.y1 for b in boxes)
    lower = [b.shrunk(1.0, 0.8) for b in boxes]  # the dot of a rate has free space above the letters beside it
    assert not any(a.overlaps(b) for a, b in combinations(lower, 2))


@pytest.mark.parametrize("name", FIGURES)
def test_figures_have_the_same_bytes_every_time(tmp_path, name):
    first, second = (save_figure(FIGURES[name](), tmp_path / k, name) for k in "ab")
    assert [p.read_bytes() for p in first] == [p.read_bytes() for p in second]


@pytest.mark.parametrize("name", ["ch06_structure_pump", "ch06_structure_system", "ch06_structure_parts"])
def test_incidence_has_one_mark_for_each_entry(name):
    s = {"ch06_structure_pump": PART, "ch06_structure_system": SYSTEM.structure(), "ch06_structure_parts": MIXED}[name]
    axes = FIGURES[name]().axes[0]
    rows = [text.get_text() for text in axes.get_yticklabels()]
    columns = {round(x, 6): t.get_text() for x, t in zip(axes.get_xticks(), axes.get_xticklabels(), strict=True)}
    marks = {
        (rows[round(y)], columns[round(x, 6)])
        for line in axes.lines
        if line.get_marker() not in ("None", "none", "")
        for x, y in np.column_stack(line.get_data())
    }
    expected = {
        (ch06._constraint(c), ch06.symbol(x)) for c in s.constraints for x in (*s.unknowns_of([c]), *s.faults_of([c]))
    }
    assert marks == expected


def test_blocks_are_upper_triangular():
    axes = FIGURES["ch06_structure_parts"]().axes[0]
    for line in axes.lines:
        for x, y in np.column_stack(line.get_data()):
            frames = [p for p in axes.patches if p.get_y() < y < p.get_y() + p.get_height()]
            assert frames
            assert min(p.get_x() for p in frames) < x  # nothing stands left of the block of its row


def test_isolation_shows_what_is_confused():
    figure = FIGURES["ch06_isolability"]()
    left, right = figure.axes
    n = len(PART.faults)
    crossed = lambda axes: sum(line.get_marker() == "x" for line in axes.lines)  # noqa: E731
    assert crossed(left) == sum(len(PART.faults_of(subset)) for subset in RESIDUALS.values())
    assert crossed(right) == 8
    assert len([p for p in right.patches if isinstance(p, Rectangle)]) == n * n


def test_undetectable_fault_is_black():
    s = Structure.from_sets("s", {"e1": ["a"], "e2": ["a"], "e3": ["a", "b"]}, faults={"e1": ["f"], "e3": ["g"]})
    right = ch06.isolation(s, {"r1": ("e1", "e2")}).axes[1]
    black = [p for p in right.patches if p.get_facecolor() == (0.0, 0.0, 0.0, 1.0)]
    assert len(black) == 2
    assert COLOURS["black"] == "#000000"


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("omega_dot", r"$\dot{\omega}$"), ("K_f", r"$K_{\mathrm{f}}$"), ("dB", r"$\Delta B$"),
        ("p1", r"$p_{\mathrm{1}}$"), ("i_md_dot", r"$\dot{i}_{\mathrm{md}}$"), ("Q_i", r"$Q_{\mathrm{i}}$"),
        ("T", "$T$"),
    ],
)  # fmt: skip
def test_symbols_as_mathematics(name, text):
    assert ch06.symbol(name) == text


def test_split_of_another_model_is_refused():
    with pytest.raises(ParameterError, match="split"):
        ch06.incidence(decompose(PART), split=SPLIT)
    with pytest.raises(ParameterError, match="split"):
        ch06.cascade(examples.dc_motor(), SPLIT)
    with pytest.raises(ParameterError, match="no fault"):
        ch06.isolation(MIXED, {"r1": ("e2", "e3", "e6")})
