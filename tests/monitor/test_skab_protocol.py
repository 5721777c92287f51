"""Scores of the benchmark on cases that can be counted by hand."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pumplib.errors import DataError, ParameterError
from pumplib.monitor.skab_protocol import (
    PROFILES,
    Counts,
    confront,
    count,
    pool_changes,
    pool_counts,
    reported_changes,
)

T = np.arange(300.0)


def at(*rows: int, n: int = 300) -> np.ndarray:
    flags = np.zeros(n, dtype=bool)
    flags[list(rows)] = True
    return flags


def test_rows_are_counted() -> None:
    truth = np.array([0, 0, 0, 1, 1, 1, 1, 0], dtype=bool)
    alarm = np.array([0, 1, 0, 0, 1, 1, 1, 1], dtype=bool)
    counts = count(truth, alarm)
    assert counts == Counts(tp=3, fp=2, fn=1, tn=2)
    assert counts.f1 == 3 / (3 + 1.5)
    assert counts.far == 0.5
    assert counts.mar == 0.25
    assert (counts.rows, counts.anomalous) == (8, 4)


def test_pooling_adds_counts_and_does_not_average_rates() -> None:
    a, b = Counts(tp=9, fp=0, fn=1, tn=10), Counts(tp=0, fp=0, fn=1, tn=1)
    both = pool_counts([a, b])
    assert both == Counts(tp=9, fp=0, fn=2, tn=11)
    assert both.f1 == 9 / 10
    assert both.f1 != (a.f1 + b.f1) / 2


def test_rates_that_do_not_exist_are_nan() -> None:
    healthy = count(np.zeros(5, dtype=bool), np.zeros(5, dtype=bool))
    assert math.isnan(healthy.f1)
    assert math.isnan(healthy.mar)
    assert healthy.far == 0.0
    assert math.isnan(confront(T, at(), at(5)).nab())


def test_reported_changes_are_the_edges_of_the_alarm() -> None:
    alarm = np.array([1, 1, 0, 0, 1, 0], dtype=bool)
    np.testing.assert_array_equal(np.flatnonzero(reported_changes(alarm)), [0, 2, 4, 5])
    np.testing.assert_array_equal(np.flatnonzero(reported_changes(~alarm)), [2, 4, 5])
    assert not reported_changes(np.zeros(0, dtype=bool)).any()


@pytest.mark.parametrize(
    ("profile", "false", "missed"), [("standard", 0.11, 1), ("low_fp", 0.22, 1), ("low_fn", 0.11, 2)]
)
def test_hand_made_scores(profile: str, false: float, missed: float) -> None:
    span = 1 + missed  # from no report to a perfect one

    def nab(*reports: int) -> float:
        return confront(T, at(100), at(*reports)).nab(profile)

    assert nab(100) == pytest.approx(100.0)  # at once
    assert nab() == pytest.approx(0.0)  # never
    assert nab(160) == pytest.approx(100 * (missed - false) / span)  # at the right end, which belongs to the window
    assert nab(161) == pytest.approx(-100 * false / span)  # a miss and a false report
    assert nab(99) == pytest.approx(-100 * false / span)  # before it: no credit
    assert nab(100, 200) == pytest.approx(100 - 100 * false / span)
    assert nab(100, 110, 120, 160) == nab(100)  # only the first one in a window counts
    # the middle of 1000 positions is half a step from the middle of the curve
    slope = math.tanh(math.pi / 1998) / math.tanh(math.pi / 2)
    middle = (1 - false) / 2 - (1 + false) / 2 * slope
    assert nab(130) == pytest.approx(100 * (middle + missed) / span)


def test_sooner_is_better_and_the_curve_spans_reward_and_price() -> None:
    scores = [confront(T, at(100), at(row)).nab() for row in range(100, 161)]
    assert np.all(np.diff(scores) < 0)
    assert scores[0] == pytest.approx(100)
    assert scores[-1] == pytest.approx(44.5)


def test_overlapping_windows_are_cut_on_the_left_of_the_later_one() -> None:
    points = at(100, 130)
    only_first = confront(T, points, at(140))  # 130..190 starts at 160
    assert (only_first.delays, only_first.missed, only_first.false) == ((40.0,), 1, 0)
    both = confront(T, points, at(160))  # the common end belongs to both
    assert (both.delays, both.missed, both.false) == ((60.0, 0.0), 0, 0)
    second = confront(T, points, at(175))
    assert second.positions == (0.5,)
    assert second.delays == (15.0,)


def test_delay_misses_and_false_reports() -> None:
    changes = confront(T, at(50, 200), at(10, 62, 70, 130, 290))
    assert (changes.delays, changes.missed, changes.false, changes.points) == ((12.0,), 1, 3, 2)
    assert changes.mean_delay == 12.0
    assert math.isnan(confront(T, at(50), at()).mean_delay)


def test_windows_are_in_seconds_not_in_rows() -> None:
    times = T.copy()
    times[60:] += 100  # a gap after row 59
    found = confront(times, at(50), at(60))
    assert (found.missed, found.false) == (1, 1)
    assert confront(T, at(50), at(60)).missed == 0


def test_runs_are_pooled_before_the_score_is_scaled() -> None:
    one, two = confront(T, at(100), at(100)), confront(T, at(20, 200), at(20, 200, 290))
    both = pool_changes([one, two])
    assert (both.points, both.false) == (3, 1)
    assert both.nab() == pytest.approx(100 - 100 * 0.11 / 6)


@given(
    points=st.lists(st.integers(0, 299), max_size=6, unique=True),
    reports=st.lists(st.integers(0, 299), max_size=20, unique=True),
    window=st.floats(1.0, 200.0),
)
def test_every_report_and_every_point_is_accounted_for(points: list[int], reports: list[int], window: float) -> None:
    changes = confront(T, at(*points), at(*reports), window)
    assert changes.points == len(points)
    assert 0 <= changes.false <= len(reports)
    assert all(0 <= p <= 1 for p in changes.positions)
    assert all(0 <= d <= window for d in changes.delays)
    if points:
        for profile in PROFILES:
            assert changes.nab(profile) <= 100 + 1e-9
        fewer = confront(T, at(*points), at(), window)
        assert fewer.nab() == 0.0


def test_wrong_arguments_are_refused() -> None:
    with pytest.raises(DataError, match="3 labels and 2 decisions"):
        count(np.zeros(3, dtype=bool), np.zeros(2, dtype=bool))
    with pytest.raises(DataError, match=r"alarm: float64.*one truth value a row"):
        count(np.zeros(3, dtype=bool), np.zeros(3))
    with pytest.raises(DataError, match="shapes"):
        confront(T, at(1), at(1, n=5))
    with pytest.raises(DataError, match="increase"):
        confront(T[::-1], at(1), at(1))
    with pytest.raises(DataError, match="finite"):
        confront(np.where(T == 3, np.nan, T), at(1), at(1))
    for window in (0.0, -1.0, math.nan, math.inf):
        with pytest.raises(ParameterError, match="window"):
            confront(T, at(1), at(1), window)
    with pytest.raises(ParameterError, match="choose one of standard, low_fp, low_fn"):
        confront(T, at(1), at(1)).nab("best")
