"""Thesis 2.1.4, B.1: correlated residuals break the design, the guard says so, both remedies restore it."""

import math
import warnings
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import settings as effort
from hypothesis import strategies as st
from scipy.signal import lfilter

from pumplib.decide import (
    ArModel,
    CorrelatedResidualWarning,
    Cusum,
    CusumSettings,
    Thinner,
    Whitener,
    arl,
    assess,
    correlation_time,
    fit_ar,
    ljung_box,
    simulate_run_lengths,
)
from pumplib.decide.whitening import autocovariance
from pumplib.errors import DataError, ParameterError

FIVE = CusumSettings(sigma=1.0, nu=0.5, h=5.0)
DESIGNED = arl(0.5, 5.0).value


def coloured(rho, n, rng):
    """AR(1) of standard deviation 1."""
    start = rng.standard_normal()
    x = math.sqrt(1 - rho * rho) * rng.standard_normal(n)
    return lfilter([1.0], [1.0, -rho], x, zi=[rho * start])[0]


def first_order(rho, sigma=1.0):
    return ArModel(coefficients=(rho,), sigma=sigma * math.sqrt(1 - rho * rho))


@pytest.mark.parametrize(("rho", "known"), [(0.5, 52.0), (0.9, 29.0)])
def test_correlation_ruins_the_design(rho, known):
    """Known values of the project's specification, section 7: 52 and 29 where independent samples give 465."""
    runs = simulate_run_lengths(0.5, 5.0, model=first_order(rho), runs=40_000, rng=np.random.default_rng(1))
    assert runs.mean == pytest.approx(known, rel=0.02)
    low, high = runs.interval(0.95)
    assert high < 0.12 * DESIGNED
    assert high - low < 0.03 * known


def test_a_restart_in_the_middle_of_an_excursion_alarms_sooner():
    model, rng = first_order(0.9), np.random.default_rng(2)
    fresh = simulate_run_lengths(0.5, 5.0, model=model, runs=20_000, rng=rng)
    going = simulate_run_lengths(0.5, 5.0, model=model, runs=20_000, rng=rng, start="continue")
    assert going.mean < 0.75 * fresh.mean
    # the real detector does the same
    x = coloured(0.9, 200_000, rng)
    assert len(x) / len(Cusum(FIVE).run(x).alarms) == pytest.approx(going.mean, rel=0.05)


@pytest.mark.parametrize("rho", [0.5, 0.9])
def test_both_remedies_restore_the_design(rho):
    rng = np.random.default_rng(3)
    model = fit_ar(coloured(rho, 400_000, rng))
    x = coloured(rho, 2_000_000, rng)
    raw = len(x) / len(Cusum(FIVE).run(x).alarms)
    assert raw < 0.12 * DESIGNED
    rule = CusumSettings(sigma=model.sigma, nu=0.5, h=5.0)
    white = len(x) / len(Cusum(rule).run(Whitener(model).run(x)).alarms)
    assert white == pytest.approx(DESIGNED, rel=0.08)
    step = model.thinning()
    _, kept = Thinner(step).run(x)
    count = len(Cusum(FIVE).run(kept).alarms)
    # correlation of at most 0.01 is left, which costs 7 %
    assert len(kept) / count == pytest.approx(0.95 * DESIGNED, rel=0.06 + 3 / math.sqrt(count))


def test_three_time_constants_are_not_enough():
    """Correlation exp(-3) = 0.05 between kept samples still costs more than a quarter of the run length."""
    left = first_order(0.9).autocorrelation(29)[29]
    assert first_order(0.9).thinning(0.05) == 29
    runs = simulate_run_lengths(0.5, 5.0, model=first_order(left), runs=10_000, rng=np.random.default_rng(4))
    assert runs.interval(0.99)[1] < 0.8 * DESIGNED


@pytest.mark.parametrize("rho", [0.3, 0.9])
def test_guard_warns_with_numbers_and_remedies(rho):
    x = 3.0 * coloured(rho, 40_000, np.random.default_rng(5))
    rule = CusumSettings(sigma=3.0, nu=0.5, h=5.0)
    with pytest.warns(CorrelatedResidualWarning, match=r"channel torque: correlation .* instead of every 4\.65 s"):
        (found,) = assess(x, rule, dt=0.01, rng=np.random.default_rng(6), names=("torque",))
    assert not found.independent
    assert found.lag_one == pytest.approx(rho, abs=0.02)
    assert found.p_value < 1e-6
    assert found.designed.value == pytest.approx(DESIGNED)
    truth = simulate_run_lengths(0.5, 5.0, model=first_order(rho), runs=10_000, rng=np.random.default_rng(7)).mean
    assert found.actual == pytest.approx(truth, rel=0.1)
    assert found.restarted <= 1.05 * found.actual
    assert found.correlation_time == pytest.approx(0.01 * (1 + rho) / (1 - rho), rel=0.15)
    assert rho**found.thinning == pytest.approx(0.01, abs=0.006)


def test_guard_is_quiet_on_independent_residuals():
    x = np.random.default_rng(8).standard_normal((20_000, 2))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = assess(x, [FIVE, FIVE], dt=0.01, rng=np.random.default_rng(9))
    assert [one.independent for one in found] == [True, True]
    assert [one.correlation_time for one in found] == pytest.approx([0.01, 0.01], rel=0.1)
    assert found[0].message == "channel r1: independent enough, the designed run length holds."
    assert found[0].actual == found[0].designed.value


def test_guard_accepts_a_significant_but_harmless_correlation():
    x = coloured(0.02, 400_000, np.random.default_rng(10))
    (found,) = assess(x, FIVE, dt=0.01, rng=np.random.default_rng(11), tolerance=0.3)
    assert found.p_value < 0.01
    assert found.independent
    assert found.actual < found.designed.value


def test_whitened_record_is_white_from_its_first_sample():
    """Covariance of the first whitened samples over many short records: sigma^2 times the identity."""
    model = ArModel(coefficients=(1.2, -0.5, 0.1), sigma=2.0, mean=7.0)
    rng = np.random.default_rng(12)
    many = 40_000
    assert model.ladder is not None
    table, spread = model.ladder
    x = np.zeros((6, many))
    for k in range(6):
        m = min(k, 3)
        x[k] = 2.0 * spread[m] * rng.standard_normal(many) + table[m, :m] @ x[k - m : k][::-1]
    # the start is stationary: variance and neighbours as the model says
    assert x.std(axis=1) == pytest.approx(np.full(6, model.residual_sigma), rel=0.02)
    assert np.corrcoef(x[0], x[5])[0, 1] == pytest.approx(model.autocorrelation(5)[5], abs=0.015)
    white = Whitener([model] * many).run(x + 7.0)
    assert np.cov(white) == pytest.approx(4.0 * np.eye(6), abs=0.1)


@effort(max_examples=30, deadline=None)
@given(st.integers(0, 2**32), st.integers(0, 4), st.integers(1, 3), st.lists(st.integers(0, 41), max_size=4))
def test_whitener_stream_is_batch(seed, order, channels, cuts):
    rng = np.random.default_rng(seed)
    models = [
        fit_ar(lfilter([1.0], [1.0, -0.5], rng.standard_normal(200)), order=order if c else max(order - 1, 0))
        for c in range(channels)
    ]
    x = rng.standard_normal((41, channels))
    whole = Whitener(models).run(x)
    stream, pieces = Whitener(models), Whitener(models)
    assert np.array_equal(whole, np.array([stream.update(row) for row in x]))
    cuts = [0, *sorted(cuts), 41]
    assert np.array_equal(whole, np.concatenate([pieces.run(x[a:b]) for a, b in pairwise(cuts)]))
    stream.reset()
    assert np.array_equal(whole, stream.run(x))


def test_fit_finds_order_and_coefficients():
    x = 5.0 + lfilter([1.0], [1.0, -1.2, 0.5, -0.1], 2.0 * np.random.default_rng(13).standard_normal(200_000))
    model = fit_ar(x)
    assert model.order == 3
    assert model.coefficients == pytest.approx((1.2, -0.5, 0.1), abs=0.01)
    assert model.sigma == pytest.approx(2.0, rel=0.01)
    assert model.mean == pytest.approx(5.0, abs=0.1)
    assert model.residual_sigma == pytest.approx(x.std(), rel=0.01)
    assert model.steady_gain == pytest.approx(0.2, abs=0.01)
    c = autocovariance(x, 8)
    assert model.autocorrelation(8) == pytest.approx(c / c[0], abs=0.02)
    assert fit_ar(np.random.default_rng(14).standard_normal(5000)).order == 0


def test_steady_gain_is_what_whitening_leaves_of_a_change():
    model = first_order(0.9)
    assert model.steady_gain == pytest.approx(0.1)
    out = Whitener(model).run(np.full(50, 3.0))
    assert out[-1, 0] == pytest.approx(0.3)


def test_thinner_keeps_its_place():
    x = np.arange(23.0)
    index, kept = Thinner(5).run(x)
    assert index.tolist() == [0, 5, 10, 15, 20]
    assert kept[:, 0].tolist() == index.tolist()
    thinner = Thinner(5)
    parts = [thinner.run(x[a:b])[0] for a, b in ((0, 1), (1, 2), (2, 11), (11, 11), (11, 23))]
    assert np.concatenate(parts).tolist() == index.tolist()


def test_wrong_records():
    rng = np.random.default_rng(15)
    with pytest.raises(DataError, match="channel head: 50 healthy samples are too few for order 10"):
        fit_ar(np.ones(50), name="head")
    with pytest.raises(DataError, match="is constant"):
        fit_ar(np.ones(500))
    with pytest.raises(DataError, match="is constant"):
        correlation_time(np.ones(500), 0.1)
    with pytest.raises(DataError, match="is constant"):
        ljung_box(np.ones(500))
    with pytest.raises(DataError, match="too few for 20 lags"):
        ljung_box(np.arange(30.0))
    with pytest.raises(DataError, match="too few for a correlation time"):
        correlation_time(np.arange(30.0), 0.1)
    with pytest.raises(DataError, match="not short against the record of 50 s"):
        correlation_time(np.cumsum(rng.standard_normal(500)), 0.1)
    with pytest.raises(DataError, match="sample 3: nan"):
        fit_ar([1.0, 2.0, 3.0, math.nan] * 100)
    with pytest.raises(DataError, match="sample 0: nan"):
        Whitener(first_order(0.5)).update(math.nan)


def test_wrong_models():
    with pytest.raises(ParameterError, match="not a stable model"):
        ArModel(coefficients=(1.0,), sigma=1.0)
    with pytest.raises(ParameterError, match="not a stable model"):
        ArModel(coefficients=(0.5, 0.6), sigma=1.0)
    with pytest.raises(ParameterError, match=r"ArModel\.sigma = 0"):
        ArModel(coefficients=(), sigma=0.0)
    with pytest.raises(ParameterError, match="one ArModel a channel"):
        Whitener([])
    with pytest.raises(ParameterError, match="every = 0 samples"):
        Thinner(0)
    with pytest.raises(ParameterError, match="beyond 1000 samples; remove drift"):
        first_order(0.999).thinning(longest=1000)
    with pytest.raises(ParameterError, match="one CusumSettings a channel"):
        assess(np.ones(100), [], dt=0.1, rng=np.random.default_rng(1))
    with pytest.raises(ParameterError, match="Generator"):
        assess(np.ones(100), FIVE, dt=0.1, rng=None)  # type: ignore[arg-type]
