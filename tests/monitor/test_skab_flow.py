"""The set-valued residual on flow: averaging, learning, alarms, and the trivial baselines."""

import math

import numpy as np
import pytest

from pumplib.errors import DataError, ParameterError
from pumplib.monitor.skab import FLOW, SENSORS, TRAIN_ROWS, SkabRun
from pumplib.monitor.skab_flow import (
    AVERAGING,
    BandSettings,
    FlowBand,
    allan_deviation,
    always_alarm,
    clock_alarm,
    flow_alarms,
    learn_band,
    residual,
    residual_set,
    windowed_mean,
)


def made(flow: np.ndarray, seconds: np.ndarray | None = None, anomaly: np.ndarray | None = None) -> SkabRun:
    n = len(flow)
    none = np.zeros(n, dtype=bool)
    return SkabRun(
        name="made/1",
        group="made",
        seconds=np.arange(float(n)) if seconds is None else seconds,
        sensors={name: flow if name == FLOW else np.ones(n) for name in SENSORS},
        anomaly=none if anomaly is None else anomaly,
        changepoint=none,
        labelled=True,
    )


def noisy(n: int, spread: float, level: float = 100.0, seed: int = 3) -> np.ndarray:
    return level * (1 + spread * np.random.default_rng(seed).standard_normal(n))


def test_the_mean_covers_the_last_seconds_only() -> None:
    seconds = np.array([0.0, 1, 2, 3, 13, 14])
    values = np.array([1.0, 2, 3, 4, 10, 20])
    np.testing.assert_allclose(windowed_mean(seconds, values, 2.0), [1, 1.5, 2.5, 3.5, 10, 15])
    np.testing.assert_array_equal(windowed_mean(seconds, values / 3, 0.5), values / 3)
    np.testing.assert_allclose(windowed_mean(seconds, values, 1e3)[-1], values.mean())


def test_the_mean_is_causal() -> None:
    flow = noisy(500, 0.01)
    changed = flow.copy()
    changed[300:] *= 2
    seconds = np.arange(500.0)
    np.testing.assert_array_equal(windowed_mean(seconds, flow, 10)[:300], windowed_mean(seconds, changed, 10)[:300])


def test_allan_deviation_of_white_noise_falls_with_the_root_and_of_a_drift_rises() -> None:
    seconds = np.arange(40_000.0)
    white = np.random.default_rng(1).standard_normal(len(seconds))
    for length in (1.0, 10.0, 40.0):
        assert allan_deviation(seconds, white, length) == pytest.approx(1 / math.sqrt(length), rel=0.08)
        # neighbouring means of a ramp of slope s differ by s*length
        assert allan_deviation(seconds, 3e-3 * seconds, length) == pytest.approx(3e-3 * length / math.sqrt(2))
    assert math.isnan(allan_deviation(seconds[:30], white[:30], 10.0))


def test_allan_deviation_does_not_bridge_gaps() -> None:
    seconds = np.arange(2000.0)
    seconds[1000:] += 500
    level = np.where(np.arange(2000) < 1000, 0.0, 50.0)
    assert allan_deviation(seconds, level, 10.0) == 0.0


def test_white_noise_gives_the_quantile_of_the_normal_distribution() -> None:
    learned = learn_band(made(noisy(20_000, 0.01)), BandSettings(coverage=0.95), averaging=1.0)
    # 1.96 sigma, a little more for the scatter of the mean of 400 rows
    assert learned.band.half_width == pytest.approx(1.96 * 0.01 * math.sqrt(1 + 1 / TRAIN_ROWS), rel=0.03)
    assert learn_band(made(noisy(20_000, 0.01))).band.averaging == AVERAGING[-1]  # nothing drifts: as long as allowed


def test_the_set_holds_the_share_that_was_asked_for_and_grows_with_it() -> None:
    run = made(noisy(3000, 0.01) * (1 + 0.02 * np.sin(np.arange(3000) / 300)))
    widths = []
    for coverage in (0.6, 0.9, 0.99, 1.0):
        learned = learn_band(run, BandSettings(coverage=coverage))
        held = np.mean(learned.deviations <= learned.band.half_width)
        assert coverage <= held <= coverage + 1e-3
        widths.append(learned.band.half_width)
    assert np.all(np.diff(widths) > 0)
    assert widths[-1] == learned.deviations[-1]


def test_margin_given_width_and_given_length_are_used() -> None:
    run = made(noisy(3000, 0.01))
    plain = learn_band(run, averaging=5.0)
    assert learn_band(run, BandSettings(margin=2.0), averaging=5.0).band.half_width == 2 * plain.band.half_width
    given = learn_band(run, averaging=7.0, half_width=0.03)
    assert given.band == FlowBand(half_width=0.03, averaging=7.0)


def test_learning_does_not_depend_on_the_level_of_the_flow() -> None:
    small, large = (learn_band(made(noisy(3000, 0.01, level))) for level in (1.0, 512.0))
    assert small.band.half_width == pytest.approx(large.band.half_width, rel=1e-9)
    assert small.band.averaging == large.band.averaging


def test_an_alarm_is_raised_when_zero_leaves_the_residual() -> None:
    flow = np.full(800, 50.0)
    flow[500:600] = 50.0 * 0.97
    flow[700:] = 50.0 * 1.03
    run, band = made(flow), FlowBand(half_width=0.02, averaging=10.0)
    low, high = residual_set(run, band)
    np.testing.assert_allclose(high - low, 0.04)
    np.testing.assert_allclose(residual(run, band), (low + high) / 2)
    alarm = flow_alarms(run, band)
    assert len(alarm) == 400
    expected = (low[400:] > 0) | (high[400:] < 0)
    np.testing.assert_array_equal(alarm, expected)
    # a step of 3 % is beyond 2 % once more than two thirds of the ten rows have seen it
    assert np.flatnonzero(alarm)[0] == 100 + 6
    assert alarm[106:200].all()
    assert not alarm[210:300].any()
    assert not flow_alarms(run, FlowBand(half_width=0.031, averaging=10.0)).any()


def test_the_same_relative_run_gives_the_same_alarms_at_any_flow() -> None:
    flow = noisy(900, 0.02)
    band = FlowBand(half_width=0.01, averaging=5.0)
    np.testing.assert_array_equal(flow_alarms(made(flow), band), flow_alarms(made(4 * flow), band))


def test_trivial_baselines() -> None:
    run = made(np.full(1150, 30.0))
    assert always_alarm(run).all()
    assert len(always_alarm(run)) == 750
    np.testing.assert_array_equal(np.flatnonzero(clock_alarm(run)) + TRAIN_ROWS, np.arange(570, 970))
    assert np.flatnonzero(clock_alarm(made(np.ones(600)))).tolist() == list(range(170, 200))
    for rows in ((399, 500), (500, 500), (600, 500)):
        with pytest.raises(ParameterError, match="400 <= first < last"):
            clock_alarm(run, rows)


def test_what_cannot_be_learned_from_is_refused() -> None:
    with pytest.raises(DataError, match=r"1000 rows, but a pretended run takes run_rows = 1150"):
        learn_band(made(noisy(1000, 0.01)))
    sick = np.zeros(2000, dtype=bool)
    sick[7] = True
    with pytest.raises(DataError, match="anomaly-free"):
        learn_band(made(noisy(2000, 0.01), anomaly=sick))
    with pytest.raises(DataError, match="stands still"):
        learn_band(made(np.full(2000, 30.0)), averaging=5.0)
    with pytest.raises(DataError, match="training rows is 0 l/min"):
        learn_band(made(np.zeros(2000)))
    dry = made(np.concatenate([np.zeros(400), np.ones(300)]))
    with pytest.raises(DataError, match=r"made/1.*relative residual does not exist"):
        flow_alarms(dry, FlowBand(half_width=0.02, averaging=5.0))


@pytest.mark.parametrize(
    ("make", "field"),
    [
        (lambda: FlowBand(half_width=0.0, averaging=5.0), "half_width"),
        (lambda: FlowBand(half_width=math.nan, averaging=5.0), "half_width"),
        (lambda: FlowBand(half_width=0.02, averaging=-1.0), "averaging"),
        (lambda: BandSettings(coverage=1.5), "coverage"),
        (lambda: BandSettings(run_rows=TRAIN_ROWS), "run_rows"),
        (lambda: BandSettings(run_rows=1150.5), "run_rows"),
        (lambda: BandSettings(margin=0.0), "margin"),
        (lambda: learn_band(made(noisy(2000, 0.01)), averaging=0.0), "averaging"),
        (lambda: learn_band(made(noisy(2000, 0.01)), half_width=2.0), "half_width"),
    ],
)
def test_wrong_settings_are_refused(make, field: str) -> None:
    with pytest.raises(ParameterError, match=field):
        make()
