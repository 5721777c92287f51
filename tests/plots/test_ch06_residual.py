"""Thesis 6.6, 6.7: figures of the residual observers are legible, byte-stable, and never without false alarms."""

from itertools import combinations

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.text import Text

from pumplib.errors import ParameterError
from pumplib.observers import residual_bench, residual_study
from pumplib.observers.residual_monitor import MonitorSettings
from pumplib.plots import ch06_residual as ch06
from pumplib.plots.style import PAGE, save_figure

MONITORS = ("observers", "calibrated", "limits")
HEALTHY = [
    {"monitor": name, "rate": rate, "low": max(rate - 0.1, 0.0), "high": rate + 0.1}
    for name, rate in zip(MONITORS, (0.0, 0.02, 0.4), strict=True)
]
FOUND = [
    {"fault": fault, "size": f * size, "monitor": name, "rate": 0.5 * f, "low": 0.3 * f, "high": 0.8 * f}
    for fault, size in residual_study.SIZES.items()
    for f in (0.5, 1.0)
    for name in MONITORS
]
TABLE = (
    tuple(residual_study.SIZES),
    (*residual_study.SIZES, "none", "not said", "no alarm"),
    np.hstack((np.diag([198, 190, 100, 200, 1]), np.array([[1, 0, 1], [0, 5, 5], [0, 100, 0], [0, 0, 0], [0, 0, 0]]))),
)


@pytest.fixture(scope="module")
def figures():  # type: ignore[no-untyped-def]
    machine = residual_bench.prepare("pump", np.random.default_rng([66, 1]))
    plain, calibrated = machine.monitor(), machine.monitor(MonitorSettings(self_calibration=15.0))
    shown = residual_bench.show(machine, np.random.default_rng([66, 2]), "clogging", 1e10)
    healthy = residual_bench.show(machine, np.random.default_rng([66, 3]))
    said, after = plain.judge(shown.record), calibrated.judge(shown.record)
    quiet = plain.judge(healthy.record)
    t, errors = residual_study.wrong_start(plain.belief, 5.0)
    k0 = plain.threshold.k0[:2]
    points = {"here": (300.0, 1.5e-3), "valve closed further": (300.0, 0.9e-3)}
    return {
        "ch06_residuals": lambda: ch06.residuals(shown, said),
        "ch06_residuals_calibrated": lambda: ch06.residuals(shown, after, calibrated_until=15.0),
        "ch06_residuals_healthy": lambda: ch06.residuals(healthy, quiet),
        "ch06_directions": lambda: ch06.directions_plane(
            plain.belief, k0, points, measured=[[-2e4, 0.001], [-2e4, -0.002]], said="measured after the fault"
        ),
        "ch06_convergence": lambda: ch06.convergence(t, errors),
        "ch06_calibration": lambda: ch06.calibration(shown, said, after, 15.0),
        "ch06_winding": lambda: ch06.winding(healthy, quiet, quiet, np.zeros(len(quiet.r))),
        "ch06_detection": lambda: ch06.detection(HEALTHY, FOUND, MONITORS),
        "ch06_confusion": lambda: ch06.confusion({"observers": TABLE, "calibrated": TABLE}, ALARMS),
    }


ALARMS = {"observers": "1 of 400", "calibrated": "4 of 400"}
NAMES = (
    "ch06_residuals", "ch06_residuals_calibrated", "ch06_residuals_healthy", "ch06_directions", "ch06_convergence",
    "ch06_calibration", "ch06_winding", "ch06_detection", "ch06_confusion",
)  # fmt: skip


def drawn(figure) -> list[Text]:  # type: ignore[no-untyped-def]
    """Texts that are seen: tick labels outside of the axes are made by matplotlib, but not drawn."""
    found = [text for legend in figure.legends for text in legend.get_texts()]
    for ax in figure.axes:
        found += [ax.title, ax._left_title, ax._right_title, ax.xaxis.label, ax.yaxis.label, *ax.texts]
        found += ax.get_legend().get_texts() if ax.get_legend() else []
        for axis, limits in ((ax.xaxis, ax.get_xlim()), (ax.yaxis, ax.get_ylim())):
            low, high = sorted(limits)
            ticks = [tick for tick in axis.get_major_ticks() if low <= tick.get_loc() <= high]
            found += [label for tick in ticks for label in (tick.label1, tick.label2)]
    return [text for text in found if text.get_text() and text.get_visible()]


@pytest.mark.parametrize("name", NAMES)
def test_figures_are_legible(figures, name) -> None:  # type: ignore[no-untyped-def]
    figure = figures[name]()
    FigureCanvasAgg(figure).draw()
    assert figure.get_size_inches()[0] <= PAGE
    shown = drawn(figure)
    assert len(shown) > 10
    assert all(text.get_fontsize() >= 7 for text in shown)
    boxes = [text.get_window_extent() for text in shown]
    inside = figure.bbox
    outside = [
        text.get_text()
        for text, b in zip(shown, boxes, strict=True)
        if b.x0 < -1 or b.y0 < -1 or b.x1 > inside.x1 + 1 or b.y1 > inside.y1 + 1
    ]
    assert not outside
    # the box of a slanted text is larger than the text
    straight = [
        (t.get_text(), b.shrunk(0.95, 0.8)) for t, b in zip(shown, boxes, strict=True) if t.get_rotation() != 40
    ]
    assert not [(a, b) for (a, x), (b, y) in combinations(straight, 2) if x.overlaps(y)]


@pytest.mark.parametrize("name", ["ch06_residuals", "ch06_directions", "ch06_detection", "ch06_confusion"])
def test_figures_have_the_same_bytes_every_time(figures, tmp_path, name) -> None:  # type: ignore[no-untyped-def]
    first, second = (save_figure(figures[name](), tmp_path / k, name) for k in "ab")
    assert [p.read_bytes() for p in first] == [p.read_bytes() for p in second]


def test_fault_and_alarm_are_marked(figures) -> None:  # type: ignore[no-untyped-def]
    words = [text.get_text() for text in figures["ch06_residuals"]().findobj(Text)]
    assert "fault" in words
    assert any(one.startswith("alarm after") for one in words)
    assert "fault" not in [text.get_text() for text in figures["ch06_residuals_healthy"]().findobj(Text)]


def test_detection_is_not_shown_without_false_alarms() -> None:
    with pytest.raises(ParameterError, match="each with its false alarms"):
        ch06.detection(HEALTHY[:2], FOUND, MONITORS)
    with pytest.raises(ParameterError, match="false alarms"):
        ch06.confusion({"observers": TABLE}, {})
    with pytest.raises(ParameterError, match="one or two"):
        ch06.directions_plane(None, (1.0, 1.0), {})  # type: ignore[arg-type]
