"""Thesis 2.1.4, B.1: the CUSUM against a plain loop, batch against stream, policies and bad input."""

import dataclasses
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import settings as effort
from hypothesis import strategies as st

from pumplib.decide import Cusum, CusumSettings
from pumplib.decide.cusum import AFTER_ALARM, TILE
from pumplib.errors import DataError, ParameterError

ONE = CusumSettings(sigma=2.0, mean=1.0, nu=0.5, h=4.0)


def plain(x, s):
    """Restarting two-sided CUSUM as the textbook writes it: (sample, side, onset, statistic) and both statistics."""
    up = down = 0.0
    zero = [-1, -1]
    alarms, trace = [], []
    for k, r in enumerate(x):
        z = (r - s.mean) / s.sigma
        up, down = max(0.0, up + z - s.nu), max(0.0, down - z - s.nu)
        trace.append((up, down))
        for side, g in enumerate((up, down)):
            if g == 0.0:
                zero[side] = k
        hits = [(k, side, zero[side] + 1, g) for side, g in enumerate((up, down)) if g > s.h]
        alarms += hits
        if hits:
            up = down = 0.0
            zero = [k, k]
    return alarms, np.array(trace)


def test_equals_plain_loop():
    x = 1.0 + 2.0 * np.random.default_rng(2).standard_normal(20_000)
    found = Cusum(ONE).run(x, trace=True)
    alarms, trace = plain(x, ONE)
    assert len(alarms) > 50
    assert [(a.sample, a.side == "down", a.onset) for a in found.alarms] == [(k, bool(s), o) for k, s, o, _ in alarms]
    np.testing.assert_allclose([a.statistic for a in found.alarms], [g for *_, g in alarms], rtol=1e-12)
    np.testing.assert_allclose(np.c_[found.up, found.down], trace, rtol=0, atol=1e-11)


@st.composite
def cases(draw):
    channels = draw(st.integers(1, 4))
    n = draw(st.sampled_from([0, 1, 7, TILE - 1, TILE, TILE + 1, 2 * TILE + 13]))
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    x = draw(st.sampled_from([0.3, 1.0, 30.0])) * rng.standard_normal((n, channels)) + rng.uniform(-1, 1, channels)
    x[rng.random(x.shape) < draw(st.sampled_from([0.0, 0.1, 0.6]))] = np.nan
    rules = [
        CusumSettings(
            sigma=rng.uniform(0.2, 3),
            mean=rng.uniform(-0.5, 0.5),
            nu=rng.uniform(0, 1),
            h=rng.uniform(0.1, 6),
            sides=("up", "down", "both")[rng.integers(3)],
        )
        for _ in range(channels)
    ]
    cuts = sorted(draw(st.lists(st.integers(0, n), max_size=5)))
    return x, rules, draw(st.sampled_from(AFTER_ALARM)), [0, *cuts, n]


@effort(max_examples=60, deadline=None)
@given(cases())
def test_stream_blocks_and_batch_agree_bit_for_bit(case):
    x, rules, after, cuts = case
    whole, pieces, stream = (Cusum(rules, after_alarm=after, missing="hold") for _ in range(3))
    result = whole.run(x, trace=True)
    parts = [pieces.run(x[a:b], trace=True) for a, b in pairwise(cuts)]
    alarms, statistics = [], []
    for row in x:
        alarms += stream.update(row)
        statistics.append(stream.statistic)
    assert result.alarms == tuple(alarms) == tuple(a for part in parts for a in part.alarms)
    assert np.array_equal(result.up, np.concatenate([part.up for part in parts]))
    assert np.array_equal(result.down, np.concatenate([part.down for part in parts]))
    assert np.array_equal(whole.statistic, stream.statistic)
    assert whole.missing_samples == stream.missing_samples
    assert whole.missing_samples == dict(zip(whole.names, np.isnan(x).sum(axis=0).tolist(), strict=True))
    assert whole.stopped == stream.stopped
    if after != "restart" and len(x):
        assert np.array_equal(result.up, np.array(statistics)[:, 0])


@effort(max_examples=25, deadline=None)
@given(st.integers(-200, 200), st.integers(0, 2**32))
def test_scale_invariance(power, seed):
    """Residual, mean and sigma in another unit (a power of two, so that rounding is the same) change nothing."""
    x = 1.0 + 2.0 * np.random.default_rng(seed).standard_normal(700)
    scale = 2.0**power
    other = dataclasses.replace(ONE, sigma=ONE.sigma * scale, mean=ONE.mean * scale)
    one, two = Cusum(ONE).run(x, trace=True), Cusum(other).run(x * scale, trace=True)
    assert one.alarms == two.alarms
    assert np.array_equal(one.up, two.up)


def test_mirrored_residual_swaps_the_sides():
    x = np.random.default_rng(3).standard_normal(3000)
    rule = CusumSettings(sigma=1.0, nu=0.2, h=3.0)
    one, two = Cusum(rule).run(x, trace=True), Cusum(rule).run(-x, trace=True)
    assert np.array_equal(one.up, two.down)
    assert {a.side for a in one.alarms} == {"up", "down"}
    assert [(a.sample, a.side) for a in one.alarms] == [
        (a.sample, "up" if a.side == "down" else "down") for a in two.alarms
    ]


def test_step_without_noise_gives_delay_and_onset():
    x = np.full(60, -1.0)
    x[20:] = 2.0  # grows by 1.5 a sample: above 6 after the fifth
    alarm = Cusum(CusumSettings(sigma=1.0, nu=0.5, h=6.0), after_alarm="stop").run(x).first()
    assert alarm is not None
    # the healthy mean of -1 first raises the lower side
    assert (alarm.side, alarm.onset, alarm.sample) == ("down", 0, 12)
    alarm = Cusum(CusumSettings(sigma=1.0, nu=0.5, h=6.0, sides="up"), after_alarm="stop").run(x).first()
    assert alarm is not None
    assert (alarm.side, alarm.onset, alarm.sample, alarm.statistic) == ("up", 20, 24, 7.5)
    assert alarm.times(0.5) == (12.0, 10.0)


def test_after_alarm_policies():
    x = np.r_[np.full(10, 2.0), np.full(40, -1.0), np.full(10, 2.0)]
    rule = CusumSettings(sigma=1.0, nu=0.5, h=3.5, sides="up")  # 1.5 a sample: alarm at every third
    assert [a.sample for a in Cusum(rule).run(x).alarms] == [2, 5, 8, 52, 55, 58]
    # 15 after ten samples, back to 3 after eight samples of -1.5: one alarm a crossing
    going = Cusum(rule, after_alarm="continue")
    assert [(a.sample, a.onset) for a in going.run(x).alarms] == [(2, 0), (52, 50)]
    stop = Cusum(rule, after_alarm="stop")
    result = stop.run(x, trace=True)
    assert [a.sample for a in result.alarms] == [2]
    assert (result.up[2:, 0] == 4.5).all()
    assert stop.stopped == ("r1",)
    stop.clear("r1")
    assert stop.stopped == ()
    assert [a.sample - 60 for a in stop.run(x).alarms] == [2]
    stop.reset()
    assert stop.samples == 0
    assert [(a.sample, a.onset) for a in stop.run(x).alarms] == [(2, 0)]


def test_more_alarms_than_the_first_buffer():
    x = np.full((500, 3), 5.0)
    alarms = Cusum([CusumSettings(sigma=1.0, nu=0.5, h=1.0)] * 3, names=("a", "b", "c")).run(x).alarms
    assert [(a.sample, a.channel) for a in alarms] == [(k, c) for k in range(500) for c in "abc"]


def test_missing_sample_is_refused_with_channel_and_sample_and_leaves_the_state():
    detector = Cusum([ONE, ONE], names=("head", "torque"))
    detector.run(np.ones((5, 2)))
    before = detector.statistic
    bad = np.ones((4, 2))
    bad[2, 1] = np.nan
    with pytest.raises(DataError, match=r"channel torque, sample 7: nan .*missing=\"hold\""):
        detector.run(bad)
    with pytest.raises(DataError, match="channel head, sample 5"):
        detector.update([np.nan, 0.0])
    assert detector.samples == 5
    assert np.array_equal(detector.statistic, before)


def test_missing_sample_holds_and_counts():
    rule = CusumSettings(sigma=1.0, nu=0.5, h=4.0)
    held = Cusum(rule, missing="hold")
    result = held.run([2.0, np.nan, np.nan, 2.0, 2.0], trace=True)
    assert result.up[:, 0].tolist() == [1.5, 1.5, 1.5, 3.0, 4.5]
    assert [(a.sample, a.onset) for a in result.alarms] == [(4, 0)]
    assert held.missing_samples == {"r1": 2}
    with pytest.raises(DataError, match="sample 5: inf"):
        held.update(np.inf)


@pytest.mark.parametrize(
    ("values", "text"),
    [
        (np.ones((2, 5)), r"shape \(2, 5\): must be \(samples, 2\)"),
        (np.ones(4), r"shape \(4,\)"),
        ([["a", "b"]], "not numbers"),
    ],
)
def test_wrong_blocks(values, text):
    with pytest.raises(DataError, match=text):
        Cusum([ONE, ONE]).run(values)


def test_wrong_samples():
    with pytest.raises(DataError, match=r"sample 0 has shape \(3,\)"):
        Cusum([ONE, ONE]).update([1.0, 2.0, 3.0])
    with pytest.raises(DataError, match="not a number"):
        Cusum(ONE).update("x")


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"sigma": 0.0}, "CusumSettings.sigma = 0 unit of r: must be > 0"),
        ({"sigma": np.nan}, "CusumSettings.sigma = nan"),
        ({"nu": -0.1}, "CusumSettings.nu = -0.1 sigma"),
        ({"h": 0.0}, "CusumSettings.h = 0 sigma"),
        ({"sides": "left"}, "must be one of up, down, both"),
    ],
)
def test_wrong_settings(change, text):
    with pytest.raises(ParameterError, match=text):
        dataclasses.replace(ONE, **change)


def test_wrong_detectors():
    with pytest.raises(ParameterError, match="one CusumSettings a channel"):
        Cusum([])
    with pytest.raises(ParameterError, match=r"2 channel names .* for 1 channels"):
        Cusum(ONE, names=("a", "b"))
    with pytest.raises(ParameterError, match="every name may come once"):
        Cusum([ONE, ONE], names=("a", "a"))
    with pytest.raises(ParameterError, match="after_alarm = 'go'"):
        Cusum(ONE, after_alarm="go")  # type: ignore[arg-type]
    with pytest.raises(ParameterError, match="missing = 'skip'"):
        Cusum(ONE, missing="skip")  # type: ignore[arg-type]
    with pytest.raises(ParameterError, match="channel = 'x'"):
        Cusum(ONE).clear("x")
