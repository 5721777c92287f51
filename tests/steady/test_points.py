"""Steady points of a record: one a stretch, means of its last window, on drawn signals and on the bench."""

import numpy as np
import pytest

from pumplib.errors import DataError
from pumplib.steady.detector import SteadySettings
from pumplib.steady.points import channels_of, steady_stretches
from pumplib.steady.relations import CHANNELS
from pumplib.testbench.run import draw_bench, run

SETTINGS = SteadySettings(window=5, wrong_steady=0.05)


def test_one_point_a_stretch_with_the_mean_of_its_end() -> None:
    H = np.concatenate((np.full(12, 1.0), np.linspace(1, 20, 8), np.full(12, 20.0)))
    t = 0.2 * np.arange(len(H))
    found = steady_stretches(t, {"H": H, "Q": H / 2}, {"H": 0.5}, SETTINGS)
    np.testing.assert_allclose(found.signals["H"], [1.0, 20.0], atol=1e-12)
    np.testing.assert_allclose(found.signals["Q"], found.signals["H"] / 2)
    assert found.t[1] == t[-1]
    Q = H.copy()
    Q[-3] = np.nan
    assert len(steady_stretches(t, {"H": H, "Q": Q}, {"H": 0.5}, SETTINGS).t) == 2
    assert steady_stretches(t, {"H": H, "Q": Q}, {"H": 0.5}, SETTINGS).t[1] < t[-3]
    with pytest.raises(DataError, match="Q"):
        steady_stretches(t, {"H": H, "Q": Q[:4]}, {"H": 0.5}, SETTINGS)


def test_points_of_a_bench_run_belong_to_its_segments() -> None:
    rng = np.random.default_rng([71, 0])
    one = run("pump_healthy", rng, draw_bench("pump", rng))
    slow = one.slow(0.2, 0.2)
    tolerance = {"H": 4000.0, "Q": 1.2e-5, "omega_e": 0.3, "I_rms": 0.02}
    found = steady_stretches(slow.t, channels_of(slow), tolerance, SETTINGS)
    assert set(found.signals) == set(CHANNELS)
    segments = np.searchsorted(one.course.changes, found.t)
    assert len(found.t) >= 5
    # the window before each point holds no change of the operating point
    starts = np.searchsorted(one.course.changes, found.t - 4 * 0.2)
    np.testing.assert_array_equal(starts, segments)
