"""Thesis 2.1.4: adaptive threshold: definition, learning, batch against stream, what it saves."""

import dataclasses
import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import settings as effort
from hypothesis import strategies as st
from scipy.signal import lfilter

from pumplib.decide import Activity, ActivitySettings, Evaluator, Threshold, learn
from pumplib.errors import DataError, ParameterError

DT = 1e-3
SIGNALS = ActivitySettings(signals=("Q", "omega"), scales=(1e-4, 3.0), time_constant=0.25)
RULE = Threshold(residuals=("r1", "r2"), k0=(2.0, 0.5), c=(1.0, 0.0))


def slow(x, tau):
    gain = -math.expm1(-DT / tau)
    return lfilter([gain], [1.0, gain - 1.0], x - x[0]) + x[0]


def healthy_run(rng, fault=0.0, n=12_000):
    """Residual with noise and an error while the flow moves; valve changes at random times; fault after 9 s."""
    flow = np.full(n, 1.6e-3)
    for k in rng.choice(np.arange(1500, 8000, 500), 3, replace=False):
        flow[k:] = rng.uniform(0.9e-3, 1.9e-3)
    flow = slow(flow, 0.4)
    signals = np.c_[flow + 1e-6 * rng.standard_normal(n), 300 + 0.02 * rng.standard_normal(n)]
    r = 3000 * (flow - slow(flow, 0.15)) + 0.01 * rng.standard_normal(n)
    r[9000:] += fault
    return r, signals


def test_activity_of_a_step_decays_with_the_time_constant():
    one = ActivitySettings(signals=("Q",), scales=(2.0,), time_constant=0.1)
    x = np.r_[np.full(10, 5.0), np.full(400, 9.0)]
    a = Activity(one, DT).run(x)
    assert (a[:10] == 0).all()
    t = DT * np.arange(1, 401)  # the sample of the step is already filtered once
    assert a[10:] == pytest.approx(2.0 * np.exp(-t / 0.1), rel=1e-9)


def test_activity_sums_over_signals_in_their_scales():
    x = np.zeros((5, 2))
    x[2:] = [1e-4, -3.0]
    both = Activity(SIGNALS, DT).run(x)
    assert both[2] == pytest.approx(2 * math.exp(-DT / 0.25))


@effort(max_examples=30, deadline=None)
@given(st.integers(0, 2**32), st.sampled_from(["drift", "never"]), st.lists(st.integers(0, 131), max_size=4))
def test_stream_is_batch(seed, recovery, cuts):
    rng = np.random.default_rng(seed)
    n = 131
    rule = dataclasses.replace(RULE, recovery=recovery, limit=rng.uniform(0, 0.05))
    signals = np.cumsum(rng.standard_normal((n, 2)) * (2e-5, 0.5), axis=0)
    r = rng.standard_normal((n, 2)) * (3.0, 1.0)
    whole, stream, pieces = (Activity(SIGNALS, DT) for _ in range(3))
    a = whole.run(signals)
    assert np.array_equal(a, [stream.update(row) for row in signals])
    cuts = [0, *sorted(cuts), n]
    assert np.array_equal(a, np.concatenate([pieces.run(signals[i:j]) for i, j in pairwise(cuts)]))
    one, two, three = (Evaluator(rule, DT) for _ in range(3))
    result = one.run(r, a)
    parts = [two.run(r[i:j], a[i:j]) for i, j in pairwise(cuts)]
    assert np.array_equal(result.integral, np.concatenate([p.integral for p in parts]))
    assert np.array_equal(result.kappa, rule.at(a))
    streamed = tuple(alarm for row, level in zip(r, a, strict=True) for alarm in three.update(row, level))
    assert result.alarms == streamed == tuple(alarm for p in parts for alarm in p.alarms)


def test_alarm_after_the_integral_of_the_relative_excess():
    """Excess of k0 itself over a threshold at rest: 0.1 s until the limit of 0.1 s."""
    rule = Threshold(residuals=("r1",), k0=(2.0,), c=(1.0,))
    r = np.r_[np.zeros(50), np.full(400, -4.0)]
    (alarm,) = Evaluator(rule, DT).run(r, np.zeros(450)).alarms
    assert (alarm.onset, alarm.sample) in {(50, 149), (50, 150)}  # 0.1 s is 100 samples, but for rounding
    # activity 1 raises kappa to 3: half of the excess, twice the time
    (alarm,) = Evaluator(rule, DT).run(r, np.ones(450)).alarms
    assert alarm.sample in (249, 250)
    # activity 2 puts kappa on the residual: no alarm
    assert Evaluator(rule, DT).run(r, np.full(450, 2.0)).first() is None


def test_recovery():
    """Ten pulses of 0.02 s with long pauses: forgiven by the drift, summed up without it."""
    pulse = np.r_[np.full(20, 4.0), np.zeros(100)]
    r = np.tile(pulse, 10)
    drift = Threshold(residuals=("r1",), k0=(2.0,), c=(0.0,))
    calm = Evaluator(drift, DT).run(r, np.zeros(len(r)))
    assert calm.alarms == ()
    assert calm.integral.max() == pytest.approx(0.02)
    literal = Evaluator(dataclasses.replace(drift, recovery="never"), DT).run(r, np.zeros(len(r)))
    assert literal.integral[-1, 0] == pytest.approx(0.2)
    (alarm,) = literal.alarms
    assert alarm.sample // 120 in (4, 5)
    assert alarm.onset == 0


def test_learned_thresholds_are_the_quantiles():
    rng = np.random.default_rng(1)
    runs = [rng.standard_normal((5000, 1)) for _ in range(10)]
    activity = [np.where(np.arange(5000) < 2500, 0.0, 2.0) for _ in range(10)]
    for run in runs:
        run[2500:] *= 4.0
    found = learn(runs, activity, residuals=("r1",), quantile=0.99, margin=1.2)
    from scipy.stats import norm

    k0 = 1.2 * norm.ppf(0.995)
    assert found.k0[0] == pytest.approx(k0, rel=0.03)
    assert found.c[0] == pytest.approx(1.2 * (4 * norm.ppf(0.995) - k0) / 2, rel=0.05)
    still = learn(runs, [np.zeros(5000)] * 10, residuals=("r1",), quantile=0.99)
    assert still.c == (0.0,)


def test_constant_threshold_alarms_at_valve_changes_the_adaptive_one_does_not_and_finds_the_same_fault():
    rng = np.random.default_rng(2)

    def evaluate(rule, fault):
        found = []
        for _ in range(15):
            r, signals = healthy_run(rng, fault)
            found.append(Evaluator(rule, DT).run(r, Activity(SIGNALS, DT).run(signals)).first())
        return found

    parts = [healthy_run(rng) for _ in range(10)]
    rule = learn([r for r, _ in parts], [Activity(SIGNALS, DT).run(s) for _, s in parts], residuals=("r2",))
    assert sum(a is not None for a in evaluate(rule.constant(), 0.0)) >= 12
    assert sum(a is not None for a in evaluate(rule, 0.0)) == 0
    hits = evaluate(rule, 2.0 * rule.k0[0])
    assert all(a is not None and a.onset >= 9000 - 5 and 9000 < a.sample < 9600 for a in hits)


def test_wrong_settings():
    with pytest.raises(ParameterError, match="2 signals and 1 scales"):
        ActivitySettings(signals=("Q", "w"), scales=(1.0,))
    with pytest.raises(ParameterError, match=r"scales = 0 unit of the signal: must be > 0"):
        ActivitySettings(signals=("Q",), scales=(0.0,))
    with pytest.raises(ParameterError, match="longer than the time constant"):
        Activity(SIGNALS, 1.0)
    with pytest.raises(ParameterError, match="1 residuals, 2 k0 and 1 c"):
        Threshold(residuals=("r1",), k0=(1.0, 2.0), c=(0.0,))
    with pytest.raises(ParameterError, match=r"Threshold\.k0 = -1 unit of r"):
        Threshold(residuals=("r1",), k0=(-1.0,), c=(0.0,))
    with pytest.raises(ParameterError, match="recovery = 'slow'"):
        dataclasses.replace(RULE, recovery="slow")
    with pytest.raises(ParameterError, match="must be a Threshold"):
        Evaluator(3.0, DT)  # type: ignore[arg-type]
    with pytest.raises(ParameterError, match="dt = 0 s"):
        Evaluator(RULE, 0.0)


def test_wrong_data():
    detector = Evaluator(RULE, DT)
    detector.run(np.ones((3, 2)), np.zeros(3))
    with pytest.raises(DataError, match="channel r2, sample 4: nan"):
        detector.run([[1.0, 1.0], [1.0, np.nan]], [0.0, 0.0])
    with pytest.raises(DataError, match="activity, sample 3: -1 is negative"):
        detector.update([1.0, 1.0], -1.0)
    with pytest.raises(DataError, match="2 residual samples and 1 activities"):
        detector.run(np.ones((2, 2)), [0.0])
    with pytest.raises(DataError, match="channel omega, sample 0: inf"):
        Activity(SIGNALS, DT).update([1.0, np.inf])


def test_wrong_learning():
    rng = np.random.default_rng(3)
    runs, rest = [rng.standard_normal(2000) for _ in range(10)], [np.zeros(2000)] * 10
    with pytest.raises(DataError, match="9 healthy runs, at least 10"):
        learn(runs[:9], rest[:9], residuals=("r1",))
    with pytest.raises(DataError, match="10 residual runs and 9"):
        learn(runs, rest[:9], residuals=("r1",))
    with pytest.raises(DataError, match="run 0 has 2000 residual samples and 3"):
        learn(runs, [np.zeros(3)] * 10, residuals=("r1",))
    with pytest.raises(DataError, match="0 samples at rest"):
        learn(runs, [np.ones(2000)] * 10, residuals=("r1",))
    with pytest.raises(DataError, match="residual r1 is zero at rest"):
        learn([np.zeros(2000)] * 10, rest, residuals=("r1",))
    with pytest.raises(ParameterError, match=r"quantile = 1\.5"):
        learn(runs, rest, residuals=("r1",), quantile=1.5)
