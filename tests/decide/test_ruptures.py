"""Thesis 2.1.4, B.1: CUSUM and an offline library find the same change in the same data."""

import numpy as np
import pytest

from benchmarks.decide import CHANGE_AT, SEEDS, SIZES, compare, measure, series, settings
from pumplib.decide import Cusum

ALLOWED = 15  # samples between an estimate and the true change, every series
TYPICAL = 2  # and in the median of a size


@pytest.fixture(scope="module")
def rows():
    return compare()


def test_every_method_finds_every_change(rows):
    assert len(rows) == len(SIZES) * len(SEEDS)
    for row in rows:
        assert row.alarm is not None
        assert row.alarm >= CHANGE_AT
        for estimate in (row.onset, row.pelt, row.binseg):
            assert estimate is not None
            assert abs(estimate - CHANGE_AT) <= ALLOWED, row


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("method", ["onset", "pelt", "binseg"])
def test_typical_error_is_small(rows, size, method):
    errors = [abs(getattr(row, method) - CHANGE_AT) for row in rows if row.size == size]
    assert np.median(errors) <= TYPICAL


def test_estimate_of_the_onset_is_as_good_as_in_hindsight(rows):
    ours = np.mean([abs(row.onset - CHANGE_AT) for row in rows])
    theirs = np.mean([abs(row.pelt - CHANGE_AT) for row in rows])
    assert ours <= theirs + 1.0


def test_alarm_comes_when_the_design_says(rows):
    delays = [row.alarm + 1 - CHANGE_AT for row in rows if row.size == 1.0]
    from pumplib.decide import steady_delay

    rule = settings()
    assert np.mean(delays) == pytest.approx(steady_delay(rule.nu, rule.h, 1.0).value, rel=0.3)


def test_no_change_no_alarm():
    for seed in SEEDS:
        assert Cusum(settings()).run(series(0.0, seed)).first() is None


def test_measured_numbers_are_complete(rows):
    found = measure(rounds=1, samples=20_000, rows=rows)
    assert set(found["accuracy"]) == {f"{size:g}" for size in SIZES}
    assert set(found["times"]) == {"cusum", "pelt", "binseg"}
    assert all(value > 0 for value in found["ratio"].values())
    assert all(value > 0 for value in found["kernel_ns_per_sample_and_channel"].values())
    assert found["stream_us_per_sample"] > 0
