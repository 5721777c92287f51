"""The steady-state detector: its two error rates by simulation, and what it refuses."""

import math

import numpy as np
import pytest

from pumplib.errors import DataError, ParameterError
from pumplib.steady.detector import SteadySettings, steady_windows

WINDOW = 8


@pytest.mark.parametrize("noise", [0.05, 0.2])
def test_a_change_as_large_as_the_tolerance_passes_with_the_stated_probability_at_most(noise: float) -> None:
    rng = np.random.default_rng(1)
    line = (np.arange(WINDOW) - 3.5) / WINDOW
    # windows side by side in one record; each is judged at its last sample
    record = np.tile(line, 4000) + noise * rng.standard_normal(4000 * WINDOW)
    settings = SteadySettings(window=WINDOW, wrong_steady=0.05)
    passed = steady_windows({"H": record}, {"H": 1.0}, settings).steady[WINDOW - 1 :: WINDOW].mean()
    # three standard deviations of the count above the 5 % stated
    assert passed <= 0.05 + 3 * math.sqrt(0.05 * 0.95 / 4000)
    assert passed > 0.03


def test_the_stated_rate_of_missed_points_is_the_simulated_one() -> None:
    rng = np.random.default_rng(2)
    settings = SteadySettings(window=WINDOW, wrong_steady=0.05)
    found = steady_windows({"H": 0.45 * rng.standard_normal(60_000)}, {"H": 2.0}, settings)
    share = 1 - found.steady[WINDOW - 1 :: WINDOW].mean()
    # windows called steady show a little less scatter than all of them
    assert 0.02 < share < 0.5
    assert found.missed == pytest.approx(share, rel=0.5)


def test_steps_and_ramps_are_not_steady_and_rest_is() -> None:
    rng = np.random.default_rng(3)
    x = np.concatenate((np.zeros(30), np.full(30, 50.0))) + 0.1 * rng.standard_normal(60)
    found = steady_windows({"H": x, "Q": np.zeros(60)}, {"H": 2.0, "Q": 1e-6}, SteadySettings(window=WINDOW))
    assert not found.steady[: WINDOW - 1].any()
    assert not found.steady[30 : 30 + WINDOW - 1].any()
    assert found.steady[WINDOW:29].mean() > 0.9
    assert found.steady[30 + WINDOW :].mean() > 0.9
    assert not steady_windows({"H": np.arange(30.0)}, {"H": 2.0}).steady.any()


def test_missing_samples_are_not_steady() -> None:
    x = np.zeros(20)
    x[10] = np.nan
    found = steady_windows({"H": x}, {"H": 1.0}, SteadySettings(window=4))
    np.testing.assert_array_equal(np.flatnonzero(~found.steady), [0, 1, 2, 10, 11, 12, 13])
    assert np.isnan(found.bound["H"][10])


def test_wrong_inputs_are_refused() -> None:
    with pytest.raises(ParameterError, match="tolerance"):
        steady_windows({"H": np.zeros(9)}, {})
    with pytest.raises(ParameterError, match="no channel"):
        steady_windows({"H": np.zeros(9)}, {"T": 1.0})
    with pytest.raises(ParameterError, match="> 0"):
        steady_windows({"H": np.zeros(9)}, {"H": 0.0})
    with pytest.raises(DataError, match="not there"):
        steady_windows({"H": np.zeros(9)}, {"Q": 1.0})
    with pytest.raises(DataError, match="one length"):
        steady_windows({"H": np.zeros(9), "Q": np.zeros(8)}, {"H": 1.0, "Q": 1.0})
    assert not steady_windows({"H": np.zeros(3)}, {"H": 1.0}).steady.any()
    with pytest.raises(ParameterError, match="window"):
        SteadySettings(window=2)
