"""Thesis B.1: design of the CUSUM: the promise is solved exactly and kept in simulation."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import settings as effort
from hypothesis import strategies as st

from pumplib.decide import Cusum, arl, design, siegmund, solve_threshold
from pumplib.errors import ParameterError


@effort(max_examples=15, deadline=None)
@given(st.floats(0.2, 1.5), st.floats(30, 1e6), st.sampled_from(["up", "down", "both"]), st.integers(1, 5))
def test_threshold_solves_the_exact_run_length(nu, target, sides, channels):
    h = solve_threshold(nu, target, sides=sides, channels=channels)
    assert arl(nu, h, sides=sides, channels=channels).value == pytest.approx(target, rel=1e-8)
    formula = solve_threshold(nu, target, sides=sides, channels=channels, method="siegmund")
    assert siegmund(nu, formula) / (2 if sides == "both" else 1) / channels == pytest.approx(target, rel=1e-8)
    assert abs(formula - h) < 0.25


def test_published_thresholds():
    """(0.5, 4.77) is the textbook design for 370 samples, two-sided; so are (0.25, 8.01) and (1, 2.52)."""
    assert solve_threshold(0.5, 370) == pytest.approx(4.77, abs=0.01)
    assert solve_threshold(0.25, 370) == pytest.approx(8.01, abs=0.01)
    assert solve_threshold(1.0, 370) == pytest.approx(2.52, abs=0.01)


@pytest.mark.parametrize(("h", "loss"), [(5.0, 0.09), (12.0, 0.21)])
def test_cost_of_a_sigma_that_is_one_percent_too_small(h, loss):
    assert 1 - arl(0.5 * 0.99, h * 0.99).value / arl(0.5, h).value == pytest.approx(loss, abs=0.01)


def test_design_in_seconds_and_samples():
    one = design(sigma=0.02, change=0.02, mean=0.1, dt=0.01, false_alarm_interval=4.654435060320638)
    two = design(sigma=0.02, change=0.02, mean=0.1, dt=0.01, false_alarm_samples=465.4435060320638)
    assert one.h == pytest.approx(two.h, rel=1e-12)
    assert (one.nu, round(one.h, 7)) == (0.5, 5.0)
    assert one.false_alarm_interval == pytest.approx(4.654435060320638, rel=1e-9)
    assert one.arl_siegmund == pytest.approx(469.111, abs=0.001)
    assert one.delay.value == pytest.approx(10.376, abs=0.001)  # 10.4 in Lucas and Crosier (1982)
    assert one.delay_s == pytest.approx(0.10376, abs=1e-5)
    assert one.delay_late.value < one.delay.value
    s = one.settings()
    assert (s.sigma, s.mean, s.nu, s.h, s.sides) == (0.02, 0.1, one.nu, one.h, "both")
    assert design(sigma=0.02, change=0.02, dt=0.01, false_alarm_samples=465.0, method="siegmund").h < one.h


@pytest.mark.parametrize("sides", ["up", "down", "both"])
def test_designed_detector_keeps_its_promise(sides):
    """Restarting detector on 600 000 healthy samples, and on changes of the design size."""
    d = design(sigma=3.0, change=4.5, mean=-2.0, dt=0.1, false_alarm_interval=40.0, sides=sides)
    rng = np.random.default_rng(17)
    n = 600_000
    alarms = Cusum(d.settings()).run(-2.0 + 3.0 * rng.standard_normal(n)).alarms
    expected = n * d.dt / 40.0
    assert abs(len(alarms) - expected) < 3 * math.sqrt(expected)
    size = -4.5 if sides == "down" else 4.5
    x = -2.0 + size + 3.0 * rng.standard_normal((200, 3000))
    stopped = Cusum([d.settings()] * 3000, after_alarm="stop").run(x).alarms
    delays = np.array([a.sample + 1 for a in stopped])
    assert len(delays) == 3000
    assert d.delay.value == pytest.approx(delays.mean(), abs=3 * delays.std() / math.sqrt(3000))


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"sigma": 0.0}, "design.sigma = 0 unit of r: must be > 0"),
        ({"change": -1.0}, "design.change = -1 unit of r"),
        ({"dt": 0.0}, "design.dt = 0 s"),
        ({"false_alarm_interval": math.nan}, "design.false_alarm_interval = nan"),
        ({"false_alarm_interval": 1e-9}, "false_alarm_interval / dt"),
        ({"false_alarm_samples": 100.0}, "give the mean time between false alarms once"),
        ({"false_alarm_interval": None}, "give the mean time between false alarms once"),
        ({"change": 1e-4}, "change / sigma = 0.0001 -: must be|change / sigma = 0.0001: must be"),
        ({"channels": 1.5}, "channels = 1.5: must be a whole number"),
        ({"sides": "left"}, "sides = 'left'"),
        ({"false_alarm_interval": 0.015}, "shorter than the run length"),
        ({"false_alarm_interval": 1e300}, "must be"),
    ],
)
def test_wrong_designs(change, text):
    good = {"sigma": 1.0, "change": 1.0, "dt": 0.01, "false_alarm_interval": 10.0}
    with pytest.raises(ParameterError, match=text):
        design(**{**good, **change})


def test_targets_out_of_reach():
    with pytest.raises(ParameterError, match="out of reach, the formula gives"):
        solve_threshold(0.5, 1.01, method="siegmund")
    with pytest.raises(ParameterError, match="out of reach"):
        solve_threshold(0.005, 1e12)
    with pytest.raises(ParameterError, match="method = 'guess'"):
        solve_threshold(0.5, 100, method="guess")  # type: ignore[arg-type]
