"""Thesis 2.1.4, B.1: figures of residual evaluation show what they are given."""

import matplotlib.pyplot as plt
import numpy as np
import pytest

from pumplib.decide import (
    Cusum,
    CusumSettings,
    Evaluator,
    Threshold,
    arl,
    siegmund,
    simulate_run_lengths,
)
from pumplib.errors import DataError, ParameterError
from pumplib.plots.decide import cusum_trace, run_length, threshold_trace
from pumplib.plots.style import save_figure


@pytest.fixture(autouse=True)
def _close():
    yield
    plt.close("all")


def _texts(figure):
    return [text.get_text() for ax in figure.axes for text in ax.texts]


def _vertical(ax):
    return sorted({float(line.get_xdata()[0]) for line in ax.lines if len(set(line.get_xdata())) == 1})


def test_run_length(tmp_path):
    simulated = {(0.5, 4.0): simulate_run_lengths(0.5, 4.0, runs=500, rng=np.random.default_rng(1))}
    h = np.linspace(1, 6, 11)
    figure = run_length((0.5, 1.0), h, simulated)
    ax, below = figure.axes
    assert ax.get_yscale() == "log"
    exact, formula = ax.lines[0], ax.lines[1]
    assert exact.get_ydata()[6] == pytest.approx(arl(0.5, 4.0).value)
    assert formula.get_ydata()[6] == pytest.approx(siegmund(0.5, 4.0) / 2)
    low, high = simulated[(0.5, 4.0)].interval()
    ends = ax.collections[0].get_segments()[0][:, 1]
    assert sorted(ends) == pytest.approx([low, high])
    assert below.lines[0].get_ydata()[6] == pytest.approx(siegmund(0.5, 4.0) / 2 / arl(0.5, 4.0).value)
    one, two = (save_figure(figure, tmp_path / k, "ch02_run_length") for k in "ab")
    assert [p.read_bytes() for p in one] == [p.read_bytes() for p in two]
    with pytest.raises(ParameterError, match="one to four"):
        run_length((), h, {})
    with pytest.raises(ParameterError, match=r"nu = \[0.5\] sigma have no curve"):
        run_length((1.0,), h, simulated)


def test_cusum_trace():
    x = 0.1 * np.random.default_rng(2).standard_normal(400)
    x[250:] += 0.2
    t = 0.01 * np.arange(400)
    rule = CusumSettings(sigma=0.1, nu=0.5, h=8.0)
    result = Cusum(rule, after_alarm="continue").run(x, trace=True)
    alarm = result.first()
    assert alarm is not None
    figure = cusum_trace(t, x, result.up[:, 0], result.down[:, 0], rule.h, alarm=alarm, fault_time=2.5, unit="N m")
    ax, below = figure.axes
    assert _vertical(ax) == _vertical(below) == sorted({2.5, t[alarm.onset], t[alarm.sample]})
    assert set(_texts(figure)) == {"fault", "alarm", "estimated onset"}
    assert ax.get_ylabel() == "residual / N m"
    assert 8.0 < below.get_ylim()[1] <= 16.0
    assert np.array_equal(below.lines[0].get_ydata(), result.up[:, 0])
    with pytest.raises(DataError, match="t 399, residual 400"):
        cusum_trace(t[1:], x, result.up[:, 0], result.down[:, 0], rule.h)
    with pytest.raises(DataError, match="outside the 10 samples"):
        cusum_trace(t[:10], x[:10], result.up[:10, 0], result.down[:10, 0], rule.h, alarm=alarm)


@pytest.mark.parametrize("with_activity", [True, False])
def test_threshold_trace(with_activity):
    n, dt = 500, 0.01
    t = dt * np.arange(n)
    activity = np.where((t > 1) & (t < 2), 2.0, 0.0)
    r = np.where((t > 1) & (t < 2), 2.0, 0.0) + np.where(t > 3, 3.0, 0.0)
    rule = Threshold(residuals=("r1",), k0=(1.0,), c=(1.0,))
    result = Evaluator(rule, dt).run(r, activity)
    alarm = result.first()
    assert alarm is not None
    figure = threshold_trace(
        t, r, result.kappa[:, 0], 1.0,
        activity=activity if with_activity else None,
        changes={"valve": 1.0, "speed": 1.1}, fault_time=3.0, alarm=alarm, unit="kPa",
    )  # fmt: skip
    assert len(figure.axes) == 1 + with_activity
    ax = figure.axes[0]
    assert set(_texts(figure)) == {"valve", "speed", "fault", "alarm"}
    assert set(_vertical(ax)) >= {1.0, 1.1, 3.0, t[alarm.sample]}
    red = next(line for line in ax.lines if line.get_label() == "beyond the constant threshold")
    assert np.array_equal(~np.isnan(red.get_ydata()), np.abs(r) > 1.0)
    levels = [line.get_ydata() for line in ax.lines if len(line.get_xdata()) == n]
    assert any(np.array_equal(level, -result.kappa[:, 0]) for level in levels)
    heights = {text.get_text(): text.xy[1] for text in ax.texts}
    assert heights["speed"] < heights["valve"]  # close names do not cover each other
    with pytest.raises(DataError, match="kappa 1"):
        threshold_trace(t, r, [1.0], 1.0)
    with pytest.raises(DataError, match="outside the 5 samples"):
        threshold_trace(t[:5], r[:5], result.kappa[:5, 0], 1.0, alarm=alarm)
