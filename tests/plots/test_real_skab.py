"""The figures of the SKAB test bed show what they were given."""

import warnings
from collections.abc import Iterator

import matplotlib
import numpy as np
import pytest
from matplotlib import pyplot as plt
from matplotlib.figure import Figure

from pumplib.errors import ParameterError
from pumplib.monitor.skab import FLOW, SENSORS, TRAIN_ROWS, SkabRun
from pumplib.monitor.skab_flow import FlowBand, always_alarm, clock_alarm, flow_alarms, learn_band, residual
from pumplib.monitor.skab_leaderboard import read_leaderboard
from pumplib.monitor.skab_score import (
    ALL,
    ALWAYS,
    CLOCK,
    RESIDUAL,
    FolderScore,
    score_runs,
    sweep_band,
)
from pumplib.plots import real_skab, style

matplotlib.use("Agg")


@pytest.fixture(autouse=True)
def _styled() -> Iterator[None]:
    with style():
        yield
    plt.close("all")


def made(name: str, factor: float, n: int = 1150, seed: int = 1) -> SkabRun:
    flow = 100 * (1 + 0.01 * np.random.default_rng(seed).standard_normal(n))
    anomaly, change = np.zeros(n, dtype=bool), np.zeros(n, dtype=bool)
    anomaly[600:900] = factor != 1
    change[[600, 900]] = factor != 1
    flow[600:900] *= factor
    return SkabRun(
        name=name,
        group=name.split("/")[0],
        seconds=np.arange(float(n)),
        sensors=dict.fromkeys(SENSORS, flow) | {FLOW: flow},
        anomaly=anomaly,
        changepoint=change,
        labelled=True,
    )


HEALTHY = made("skab/anomaly-free", 1.0, 4000)
RUNS = (made("a/1", 0.7, seed=2), made("b/2", 1.02, seed=3))


def score() -> FolderScore:
    learned = learn_band(HEALTHY)
    judges = {RESIDUAL: lambda run: flow_alarms(run, learned.band), ALWAYS: always_alarm, CLOCK: clock_alarm}
    return FolderScore(
        runs=RUNS, band=learned.band, learned=learned, scores={k: score_runs(RUNS, j) for k, j in judges.items()}
    )


def drawn(figure: Figure) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        figure.canvas.draw()


def test_learning_shows_record_choice_and_share() -> None:
    learned = learn_band(HEALTHY)
    figure = real_skab.learning(HEALTHY, learned)
    drawn(figure)
    record, allan, share = figure.axes
    np.testing.assert_array_equal(record.lines[0].get_ydata(), HEALTHY.flow)
    np.testing.assert_allclose(allan.lines[0].get_ydata(), 100 * learned.allan)
    assert allan.lines[1].get_xdata()[0] == learned.band.averaging
    assert share.lines[1].get_xdata()[0] == pytest.approx(100 * learned.band.half_width)
    assert share.lines[2].get_ydata()[0] == pytest.approx(95, abs=0.1)


def test_runs_show_residual_labels_and_alarms() -> None:
    band = FlowBand(half_width=0.02, averaging=10.0)
    figure = real_skab.judged_runs(RUNS, band)
    drawn(figure)
    assert len(figure.axes) == 2
    for axes, run in zip(figure.axes, RUNS, strict=True):
        shown = axes.lines[0].get_ydata()
        edge = np.abs(shown).max()
        np.testing.assert_allclose(shown, np.clip(100 * residual(run, band), -8.4, 8.4))
        assert edge <= 8.4 + 1e-12
        assert ("drawn at it" in axes.get_title(loc="left")) == (run is RUNS[0])
        labels, alarms = axes.collections[0], axes.collections[-1]
        extents = labels.get_paths()[0].get_extents()
        assert (extents.x0, extents.x1) == (600, 900)
        widths = sum(path.get_extents().width for path in alarms.get_paths())
        assert widths == flow_alarms(run, band).sum()
        assert sorted(line.get_xdata()[0] for line in axes.lines[1:]) == [600, 900]
        assert min(path.get_extents().x0 for path in alarms.get_paths()) >= TRAIN_ROWS


def test_scores_are_sorted_with_baselines_among_them() -> None:
    mine = score()
    figure = real_skab.scores(mine, read_leaderboard())
    drawn(figure)
    left, right = figure.axes
    widths = [bar.get_width() for bar in left.patches]
    assert widths == sorted(widths)
    names = [label.get_text() for label in left.get_yticklabels()]
    assert {RESIDUAL, ALWAYS, CLOCK} <= set(names)
    assert len(names) == 13
    far = right.lines[0].get_xdata()
    assert far[names.index(ALWAYS)] == 100
    assert widths[names.index(RESIDUAL)] == mine.overall.f1
    assert "published, all 34 files" in [text.get_text() for text in figure.legends[0].get_texts()]


def test_sensitivity_marks_the_width_in_use() -> None:
    mine = score()
    widths = mine.band.half_width * np.array([0.5, 1.0, 2.0])
    sweep = sweep_band(RUNS, widths, mine.band.averaging)
    figure = real_skab.sensitivity(widths, sweep, mine)
    drawn(figure)
    left, right = figure.axes
    np.testing.assert_allclose(left.lines[2].get_ydata(), [c.f1 for c in sweep[ALL]])
    np.testing.assert_allclose(right.lines[0].get_ydata(), [100 * c.far for c in sweep[ALL]])
    assert right.lines[2].get_xdata()[0] == pytest.approx(100 * mine.band.half_width)
    texts = [text.get_text() for text in figure.legends[0].get_texts()]
    assert {"a", "b", "all files"} <= set(texts)


def test_no_runs_no_figure() -> None:
    with pytest.raises(ParameterError, match="at least one run"):
        real_skab.judged_runs((), FlowBand(half_width=0.02, averaging=10.0))
