"""Intervals against published numbers, against scipy by another route, and by their exact coverage."""

import math

import numpy as np
import pandas as pd
import pytest
from scipy.stats import binom, binomtest

from pumplib.campaign import clopper_pearson, detection_size, quantile, rate, rate_table, wilson
from pumplib.errors import DataError, ParameterError


@pytest.mark.parametrize(("k", "n"), [(0, 10), (1, 10), (5, 10), (10, 10), (81, 263), (15, 148), (0, 20), (1, 29)])
@pytest.mark.parametrize("level", [0.9, 0.95, 0.99])
def test_intervals_agree_with_scipy(k, n, level) -> None:
    for ours, method in ((wilson, "wilson"), (clopper_pearson, "exact")):
        theirs = binomtest(k, n).proportion_ci(level, method)
        found = ours(k, n, level)
        assert (found.low, found.high) == pytest.approx((theirs.low, theirs.high), abs=1e-12)
        assert found.value == k / n


def test_published_numbers() -> None:
    # R. G. Newcombe, Statistics in Medicine 17 (1998) 857, table I
    for k, n, score, exact in [
        (81, 263, (0.2553, 0.3662), (0.2527, 0.3676)),
        (15, 148, (0.0624, 0.1605), (0.0578, 0.1617)),
        (0, 20, (0.0, 0.1611), (0.0, 0.1684)),
        (1, 29, (0.0061, 0.1718), (0.0009, 0.1776)),
    ]:
        one, other = wilson(k, n), clopper_pearson(k, n)
        assert (round(one.low, 4), round(one.high, 4)) == score
        assert (round(other.low, 4), round(other.high, 4)) == exact


def coverage(interval, n, p, level=0.95):
    k = np.arange(n + 1)
    limits = [interval(int(one), n, level) for one in k]
    inside = np.array([one.low <= p <= one.high for one in limits])
    return float(binom.pmf(k[inside], n, p).sum())


def test_exact_coverage() -> None:
    rates = np.linspace(0.01, 0.99, 99)
    exact = [coverage(clopper_pearson, 30, p) for p in rates]
    assert min(exact) >= 0.95
    score = [coverage(wilson, 30, p) for p in rates]
    assert min(score) < 0.95  # it promises the mean only
    assert 0.94 < np.mean(score) < 0.965


@pytest.mark.parametrize(
    ("k", "n", "level"), [(3, 2, 0.95), (-1, 2, 0.95), (1, 0, 0.95), (0.5, 2, 0.95), (1, 2, 1.0), (1, 2, math.nan)]
)
@pytest.mark.parametrize("interval", [wilson, clopper_pearson])
def test_impossible_counts(interval, k, n, level) -> None:
    with pytest.raises(ParameterError):
        interval(k, n, level)


def test_rate_takes_only_zeros_and_ones() -> None:
    assert rate([True, False, False, True]).value == 0.5
    assert rate([1, 0], method="wilson") == wilson(1, 2)
    for wrong in ([], [0.5], [np.nan, 1], [[0, 1]]):
        with pytest.raises(DataError, match="zeros and ones"):
            rate(wrong)
    with pytest.raises(ParameterError, match="clopper-pearson, wilson"):
        rate([1], method="wald")  # type: ignore[arg-type]


def test_clusters_widen_the_interval() -> None:
    hits = [1] * 10 + [0] * 90
    alone = rate(hits)
    # ten machines of ten runs, one always in alarm: ten independent observations, not a hundred
    together = rate(hits, clusters=np.repeat(np.arange(10), 10))
    assert together.value == alone.value
    assert together.low < alone.low
    assert together.high > 2 * alone.high
    # each run a machine of its own: nothing changes but the t quantiles, which only widen
    assert rate(hits, clusters=np.arange(100)).high == pytest.approx(alone.high, abs=0.005)
    with pytest.raises(DataError, match="clusters"):
        rate(hits, clusters=[1, 2])


def test_clustered_interval_covers() -> None:
    rng = np.random.default_rng(3)
    machines, runs, trials, p = 20, 8, 400, 0.2
    clusters = np.repeat(np.arange(machines), runs)
    naive = covered = 0
    for _ in range(trials):
        chance = rng.beta(p * 2, (1 - p) * 2, machines)  # machines differ
        hits = (rng.random((machines, runs)) < chance[:, None]).astype(int).ravel()
        one, other = rate(hits), rate(hits, clusters=clusters)
        naive += one.low <= p <= one.high
        covered += other.low <= p <= other.high
    assert naive / trials < 0.88
    assert covered / trials > 0.93


def test_rate_table() -> None:
    table = pd.DataFrame({"cell": ["a", "a", "b"], "size": [0.0, 0.0, 1.0], "x": [0, 1, 1], "y": [1, 1, 0.5]})
    found = rate_table(table, ["x"], ("cell", "size"))
    assert [(row["cell"], row["size"], row["hits"], row["n"], row["rate"]) for row in found] == [
        ("a", 0.0, 1, 2, 0.5), ("b", 1.0, 1, 1, 1.0),
    ]  # fmt: skip
    assert found[0]["high"] == clopper_pearson(1, 2).high
    with pytest.raises(DataError, match="'z' is absent"):
        rate_table(table, ["z"])
    with pytest.raises(DataError, match=r"'y'.*zeros and ones"):
        rate_table(table, ["y"])


def test_quantile_interval_covers_exactly() -> None:
    # the interval is between two order statistics, so its coverage is binomial whatever the distribution
    for n, q in [(50, 0.5), (100, 0.9), (200, 0.05)]:
        found = quantile(np.arange(1, n + 1), q)
        r, s = int(found.low), int(found.high)
        covered = binom.cdf(s - 1, n, q) - binom.cdf(r - 1, n, q)
        assert 0.95 <= covered < 0.985
        # neither limit could be one closer
        assert binom.cdf(r, n, q) > 0.025
        assert 1 - binom.cdf(s - 2, n, q) > 0.025


def test_quantile_values() -> None:
    assert quantile([3.0, 1.0, 2.0], 0.5).value == 2.0
    assert quantile(range(1, 11), 0.9).value == 9
    few = quantile([1.0, 2.0, 3.0], 0.5)
    assert (few.low, few.high) == (-math.inf, math.inf)
    never = quantile([1.0, math.inf, math.inf], 0.5)
    assert never.value == math.inf
    for wrong in ([], [math.nan], [[1.0]]):
        with pytest.raises(DataError):
            quantile(wrong, 0.5)
    with pytest.raises(ParameterError):
        quantile([1.0], 1.0)


def test_detection_size_by_hand() -> None:
    found = detection_size([1.0, 10.0], [80, 100], [100, 100])
    assert found.size == pytest.approx(10**0.5)  # half way from 80 to 100 % on the logarithmic axis
    assert 1.0 <= found.low < found.size < found.high <= 10.0
    falling = detection_size([1.0, 2.0, 4.0], [60, 40, 100], [100, 100, 100])
    assert falling.size == pytest.approx(2.0 * 2.0**0.8)  # 50, 50, 100 %


def test_detection_size_outside_of_what_was_tried() -> None:
    easy = detection_size([1.0, 2.0], [1000, 1000], [1000, 1000])
    assert (easy.size, easy.low, easy.high, str(easy)) == (None, 0.0, 1.0, "< 1")
    hard = detection_size([1.0, 2.0], [0, 10], [1000, 1000])
    assert (hard.size, hard.low, hard.high, str(hard)) == (None, math.inf, math.inf, "> 2")
    unsure = detection_size([1.0, 2.0], [5, 10], [10, 10])
    assert unsure.size is not None
    assert unsure.high == math.inf


def test_detection_size_covers() -> None:
    rng = np.random.default_rng(11)
    sizes = np.array([1.0, 1.5, 2.0, 3.0, 4.0, 6.0])
    # rates that rise in straight lines over the logarithm, so that only the sampling is tested
    rates = np.interp(np.log(sizes), np.log([1.0, 6.0]), [0.3, 1.0])
    truth = math.exp(np.interp(0.9, [0.3, 1.0], np.log([1.0, 6.0])))
    found = [detection_size(sizes, rng.binomial(60, rates), [60] * 6) for _ in range(300)]
    assert np.mean([one.low <= truth <= one.high for one in found]) >= 0.95
    assert np.median([one.size for one in found if one.size]) == pytest.approx(truth, rel=0.05)


@pytest.mark.parametrize(
    ("sizes", "hits", "runs"),
    [([1.0], [1], [2]), ([1.0, 1.0], [1, 1], [2, 2]), ([0.0, 1.0], [1, 1], [2, 2]), ([1.0, 2.0], [1], [2, 2])],
)
def test_detection_size_refuses(sizes, hits, runs) -> None:
    with pytest.raises(DataError):
        detection_size(sizes, hits, runs)
