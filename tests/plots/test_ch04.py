"""Thesis 4.3.4-4.4.2: the figures are legible and byte-stable, and show what they are given."""

from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from matplotlib.text import Text

from pumplib.errors import DataError, ParameterError
from pumplib.events.confront import Confrontation
from pumplib.fmea import OBSERVATION
from pumplib.fmea.load import shipped
from pumplib.plots import ch04, ch04_graphs, ch04_layout
from pumplib.plots.style import COLOURS, PAGE, save_figure
from pumplib.propagation.symbols import MINUS, PLUS, ZERO

PUMP, SHIP = shipped("pump"), shipped("ship")
CUT = [("HY", "OUT"), ("MD", "EM"), ("MD", "SM"), ("OUT", "IN")]
SHIP_CUT = [("DE", "SH"), ("PR", "HU"), ("PR", "SH"), ("PC", "PA")]
RNG = np.random.default_rng(4)
ROWS, FAULTS = list(PUMP.ends), [name for group in PUMP.groups for name in group.faults]
GROUPS = [group.id for group in PUMP.groups for _ in group.faults]
LOAD = [item.id for item in PUMP.disturbances]
MAY = RNG.random((len(ROWS), len(FAULTS))) < 0.4
MUST = MAY & (RNG.random(MAY.shape) < 0.5)
TOUCH = RNG.random((len(ROWS), len(LOAD))) < 0.1
SENSORS = [sensor.id for sensor in PUMP.sensors]
HYPOTHESES = ["no fault", *(f"{group.id} {group.name}" for group in PUMP.groups)]
PREDICTED = RNG.random((6, 18, 3)) < 0.5
PREDICTED[..., 1] = True
SHARE = np.where(PREDICTED, RNG.random(PREDICTED.shape), 0.0)
SHARE /= SHARE.sum(axis=2, keepdims=True)
COUNTS = np.diag(np.arange(100, 108))


def matrices(**change: object) -> Figure:
    given = {
        "rows": ROWS, "faults": FAULTS, "groups": GROUPS, "fault_may": MAY, "fault_must": MUST, "disturbances": LOAD,
        "disturbance_may": TOUCH,
    }  # fmt: skip
    return ch04.propagation_matrices(**(given | change))  # type: ignore[arg-type]


def physics(**change: object) -> Figure:
    given = {
        "signals": [signal.id for signal in PUMP.signals[:6]], "roots": [*FAULTS, *LOAD][:18], "predicted": PREDICTED,
        "share": SHARE, "first_disturbance": len(FAULTS),
    }  # fmt: skip
    return ch04.physics_confrontation(**(given | change))  # type: ignore[arg-type]


def confronted(spoiled: bool = False) -> Figure:
    """Two faults, two disturbing events, three operating points; a head that may only fall."""
    sign = np.zeros((3, 3, 3, 2), np.int8)
    sign[1, 0, :2, 0] = -1
    sign[0, 2, 0, 1] = 1
    sign[2, 2, :, 0] = 1  # a fault with a disturbing event is not drawn
    if spoiled:
        sign[1, 0, 2, 0] = 1
    allowed = np.full((3, 3, 2), ZERO, np.uint8)
    allowed[1, :, 0] |= MINUS
    allowed[:, 2, 1] |= PLUS
    found = Confrontation(
        faults=("none", "HY1", "HY2"), disturbances=("none", "d_load+", "d_V-"), signals=("yrH", "yI"), sign=sign,
        deviation=2.0 * sign,
        allowed=allowed, thresholds={}, contradictions=(),
    )  # fmt: skip
    return ch04.physics_signs(found)


CASES = {
    "detect, no disturbance": [["I", "Q"], ["I", "dp"]],
    "isolate, D_B": [["I", "V", "Q", "dp"]],
    "isolate, D_D": [],
}
FIGURES = {
    "ch04_component_graph": lambda: ch04_graphs.component_graph(PUMP, CUT),
    "ch04_component_graph_ship": lambda: ch04_graphs.component_graph(SHIP, SHIP_CUT, height=4.4),
    "ch04_loop_graph": lambda: ch04_graphs.loop_graph(PUMP, CUT),
    "ch04_loop_graph_ship": lambda: ch04_graphs.loop_graph(SHIP, SHIP_CUT),
    "ch04_event_graph": lambda: ch04_graphs.event_graph(PUMP, CUT),
    "ch04_event_graph_fault": lambda: ch04_graphs.event_graph(PUMP, CUT, highlight="HY1"),
    "ch04_event_graph_ship": lambda: ch04_graphs.event_graph(SHIP, SHIP_CUT, height=6.0),
    "ch04_matrices": matrices,
    "ch04_matrices_must": lambda: matrices(disturbance_must=TOUCH & (np.arange(len(LOAD)) % 2 == 0)),
    "ch04_matrices_undisturbed": lambda: matrices(disturbances=[], disturbance_may=np.zeros((len(ROWS), 0), bool)),
    "ch04_sensor_sets": lambda: ch04.sensor_sets(sensors=SENSORS, cases=CASES, costs=[1, 1, 5, 2, 2, 1, 3]),
    "ch04_decision_table": lambda: ch04.decision_table(
        hypotheses=HYPOTHESES[:3], signals=["yZn", "yrT"], symbols=["00", "+*", ["0", "+0"]]
    ),
    "ch04_physics": physics,
    "ch04_physics_signs": confronted,
    "ch04_confusion": lambda: ch04.confusion(truths=HYPOTHESES, verdicts=HYPOTHESES, counts=COUNTS),
}  # fmt: skip


# their smaller relatives are drawn by the same code
LARGE = ("ch04_event_graph", "ch04_event_graph_fault", "ch04_loop_graph", "ch04_matrices_must", "ch04_component_graph")


def words(figure: Figure) -> list[Text]:
    return [text for text in figure.findobj(Text) if text.get_text() and text.get_visible()]


def texts(figure: Figure) -> list[str]:
    return [text.get_text() for text in words(figure)]


@pytest.mark.parametrize("name", FIGURES)
def test_legible(name: str) -> None:
    figure = FIGURES[name]()
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    assert figure.get_size_inches()[0] == PAGE
    shown = words(figure)
    assert all(text.get_fontsize() >= 7 for text in shown)
    boxes = [(text.get_text(), text.get_window_extent(canvas.get_renderer())) for text in shown]
    page = figure.bbox
    for text, box in boxes:
        assert box.x0 >= page.x0 - 0.5, text
        assert box.y0 >= page.y0 - 0.5, text
        assert box.x1 <= page.x1 + 0.5, text
        assert box.y1 <= page.y1 + 0.5, text
    for (text, a), (other, b) in combinations(boxes, 2):
        overlap = min(a.x1, b.x1) - max(a.x0, b.x0) > 0.5 and min(a.y1, b.y1) - max(a.y0, b.y0) > 0.5
        assert not overlap, f"{text!r} overlaps {other!r}"


@pytest.mark.parametrize("name", [name for name in FIGURES if name not in LARGE])
def test_saving_is_byte_stable(name: str, tmp_path: Path) -> None:
    first = [path.read_bytes() for path in save_figure(FIGURES[name](), tmp_path / "a", name)]
    assert first == [path.read_bytes() for path in save_figure(FIGURES[name](), tmp_path / "b", name)]


@pytest.mark.parametrize("system", [PUMP, SHIP], ids=["pump", "ship"])
def test_no_edge_of_the_component_graph_passes_a_box_or_a_name(system) -> None:  # type: ignore[no-untyped-def]
    figure = ch04_graphs.component_graph(system, [], height=5.2 if system is PUMP else 4.4)
    FigureCanvasAgg(figure).draw()
    _edges_pass_no_text(figure)


@pytest.mark.parametrize("system", [PUMP, SHIP], ids=["pump", "ship"])
def test_no_edge_of_the_loop_graph_passes_a_name(system) -> None:  # type: ignore[no-untyped-def]
    figure = ch04_graphs.loop_graph(system, [])
    FigureCanvasAgg(figure).draw()
    _edges_pass_no_text(figure)


def _edges_pass_no_text(figure: Figure) -> None:
    axes = figure.axes[0]
    lines = [line for line in axes.lines if line.get_linewidth() < 3]
    assert lines
    for line in lines:
        points = line.get_transform().transform(line.get_xydata())
        share = np.linspace(0, 1, 20)[:, None, None]
        x, y = np.moveaxis((1 - share) * points[:-1] + share * points[1:], -1, 0)
        for text in [*axes.texts, *axes.get_legend().get_texts()]:
            box = text.get_window_extent()
            crossed = (x > box.x0 + 1) & (x < box.x1 - 1) & (y > box.y0 + 1) & (y < box.y1 - 1)
            assert not np.any(crossed), text.get_text()


def test_graphs_show_every_component_event_and_root() -> None:
    assert {component.id for component in PUMP.components} <= set(texts(FIGURES["ch04_component_graph"]()))
    shown = set(texts(FIGURES["ch04_event_graph"]()))
    names = [item.id for item in (*PUMP.events, *PUMP.faults, *PUMP.disturbances)]
    assert {name.replace("-", "−") for name in names} <= shown
    figure = FIGURES["ch04_event_graph"]()
    drawn = [line for line in figure.axes[0].lines if len(line.get_xdata()) > 2]
    effects = sum(len(item.effects) for item in (*PUMP.faults, *PUMP.disturbances))
    assert len(drawn) == len(PUMP.edges) + effects


def test_cut_edges_are_marked() -> None:
    red = COLOURS["red"].lower()
    figure = FIGURES["ch04_component_graph"]()
    # each cut edge is a curve and two strokes
    assert sum(to_hex(line.get_color()) == red for line in figure.axes[0].lines) == 3 * len(CUT)
    home = {event.id: event.component for event in PUMP.events}
    cut = [e for e in PUMP.edges if e.kind == "effect" and (home[e.cause], e.component) in CUT]
    figure = FIGURES["ch04_event_graph"]()
    assert sum(to_hex(line.get_color()) == red for line in figure.axes[0].lines) == len(cut)
    assert "cut" in texts(figure)
    assert "cut" not in texts(ch04_graphs.component_graph(PUMP))


def test_columns_of_the_event_graph() -> None:
    roots, before, loop, after, ends = ch04_graphs.event_columns(PUMP)
    assert sorted(roots) == sorted(item.id for item in (*PUMP.faults, *PUMP.disturbances))
    assert {name[:-1] for name in loop} == {"Te", "w", "wi", "Hi", "Tp", "Q", "pin", "pout"}
    assert {"I+", "P-", "dp+", "npsh-", "hf+"} <= set(after)
    owned = [event.id for event in PUMP.events if event.component != OBSERVATION]
    assert sorted([*before, *loop, *after]) == sorted(owned)
    assert tuple(ends) == PUMP.ends


def test_loops_of_the_component_graph() -> None:
    names = [component.id for component in PUMP.components]
    effects = ch04_layout.strong_parts(names, ch04_layout.component_pairs(PUMP, ("effect",)))
    assert effects == [["EM", "MD", "SM", "HY", "IN", "OUT"]]
    wider = ch04_layout.strong_parts(names, ch04_layout.component_pairs(PUMP))
    assert wider == [["EM", "MD", "MM", "SM", "HY", "MP", "IN", "OUT"]]


def test_order_on_the_circle_has_no_more_crossings() -> None:
    names = list("abcdef")
    # a hexagon with its edges given in a scrambled order
    ring = [("a", "d"), ("d", "b"), ("b", "e"), ("e", "c"), ("c", "f"), ("f", "a")]
    order = ch04_layout.circle_order(names, ring)
    place = {name: k for k, name in enumerate(order)}
    assert order[0] == "a"
    assert all((place[a] - place[b]) % 6 in (1, 5) for a, b in ring)


def test_matrices_show_every_entry_and_disturbed_row() -> None:
    figure = matrices()
    fault_axes, load_axes = figure.axes
    cells = [patch for patch in fault_axes.patches if isinstance(patch, Rectangle) and patch.get_width() == 0.8]
    assert len(cells) == MAY.sum()
    assert sum(to_hex(patch.get_facecolor()) == COLOURS["blue"].lower() for patch in cells) == MUST.sum()
    bands = [patch for patch in fault_axes.patches if patch.get_width() == len(FAULTS)]
    assert sorted(int(patch.get_y()) for patch in bands) == np.nonzero(TOUCH.any(axis=1))[0].tolist()
    assert len([patch for patch in load_axes.patches if patch.get_width() == 0.8]) == TOUCH.sum()
    assert {"G1", "G7", "must", "may (?)"} <= set(texts(figure))


def test_physics_counts_contradictions() -> None:
    assert "0 contradicted cells of 108 simulated" in texts(physics())
    wrong, dark = SHARE.copy(), PREDICTED.copy()
    wrong[2, 3] = [0.9, 0.1, 0.0]
    dark[2, 3] = [False, True, False]
    wrong[4, 5] = np.nan
    figure = physics(predicted=dark, share=wrong)
    assert "1 contradicted cells of 107 simulated" in texts(figure)
    red = [patch for patch in figure.axes[0].patches if to_hex(patch.get_facecolor()) == COLOURS["red"].lower()]
    assert len(red) == 1
    assert (int(red[0].get_y()), int(red[0].get_x())) == (2, 3)


def test_sensor_sets_and_confusion_show_numbers() -> None:
    shown = texts(FIGURES["ch04_sensor_sets"]())
    assert {"6", "3", "9", "no set is enough"} <= set(shown)
    assert {str(k) for k in range(100, 108)} <= set(texts(FIGURES["ch04_confusion"]()))


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: ch04_graphs.component_graph(PUMP, [("HY", "EM")]), "cut edge HY -> EM: is no edge"),
        (lambda: ch04_graphs.event_graph(PUMP, highlight="HY11"), "did you mean 'HY1'"),
        (lambda: ch04_graphs.loop_graph(PUMP, kinds=("drift",)), "no loop of events"),
        (lambda: matrices(groups=GROUPS[::-1][1:]), "give one a fault"),
        (lambda: matrices(groups=["G1", "G2"] * 6 + ["G1"]), "next to each other"),
        (lambda: matrices(fault_must=~MAY), "must lie in the may closure"),
        (lambda: matrices(fault_may=MAY.T), "fault_may: shape"),
        (lambda: matrices(rows=[]), "at least one"),
        (lambda: ch04.sensor_sets(sensors=SENSORS, cases={}), "no question"),
        (lambda: ch04.sensor_sets(sensors=SENSORS, cases={"q": [["X"]]}), "unknown sensor 'X'"),
        (lambda: ch04.sensor_sets(sensors=SENSORS, cases=CASES, costs=[1.0]), "costs: 1 values"),
        (lambda: ch04.decision_table(hypotheses=["a"], signals=["y"], symbols=["x"]), "= 'x'"),
        (lambda: ch04.decision_table(hypotheses=["a"], signals=["y"], symbols=[["*0"]]), r"= '\*0'"),
        (lambda: ch04.decision_table(hypotheses=["a"], signals=["y"], symbols=["00"]), "1 rows of 1 cells"),
        (lambda: physics(share=SHARE[:5]), "share: shape"),
        (lambda: physics(share=-SHARE), "share: each cell"),
        (lambda: physics(share=np.where(np.arange(3) == 0, np.nan, SHARE)), "share: each cell"),
        (lambda: physics(predicted=PREDICTED & False), "at least one true"),
        (lambda: ch04.confusion(truths=["a"], verdicts=["a"], counts=[[0]]), "no run of 'a'"),
        (lambda: ch04.confusion(truths=["a"], verdicts=["a"], counts=[[1.5]]), "whole numbers"),
        (lambda: ch04.confusion(truths=["a"], verdicts=["a"], counts=[[1, 2]]), "counts: shape"),
    ],
)
def test_bad_input(call, message) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises((DataError, ParameterError), match=message):
        call()


def test_single_faults_and_single_disturbing_events_are_confronted() -> None:
    shown = texts(confronted())
    assert "0 contradicted cells of 8 simulated" in shown
    assert {"HY1", "HY2", "d_load+", "d_V−", "yrH", "yI"} <= set(shown)
    assert "none" not in shown
    assert "1 contradicted cells of 8 simulated" in texts(confronted(spoiled=True))
