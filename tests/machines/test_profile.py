import numpy as np
import pytest

from pumplib.errors import ParameterError
from pumplib.machines import Profile, as_profile
from pumplib.machines.profiles import load_profile, profile_machine
from pumplib.machines.sheets import load_pump


def test_steps_hold_their_value_from_their_time_on() -> None:
    p = Profile(((0.0, 1.0), (1.0, 5.0)))
    assert p.sample(np.array([0.0, 0.5, 1.0]), 0.0).tolist() == [1.0, 1.0, 1.0]  # segment that ends at the step
    assert p.sample(np.array([1.0, 1.5]), 1.0).tolist() == [5.0, 5.0]
    assert p.breaks().tolist() == [1.0]


def test_lines_join_and_stay_constant_outside() -> None:
    p = Profile(((1.0, 0.0), (3.0, 4.0)), "lines")
    assert p.sample(np.array([0.0, 1.0, 2.0, 3.0, 9.0]), 0.0).tolist() == [0.0, 0.0, 2.0, 4.0, 4.0]


@pytest.mark.parametrize(
    ("points", "kind", "message"),
    [
        ((), "steps", "empty"),
        (((0.0, float("nan")),), "steps", "two finite numbers"),
        (((1.0, 0.0), (0.5, 1.0)), "steps", "must increase"),
        (((0.0, 0.0), (0.0, 1.0)), "lines", "must increase"),
        (((0.0, 0.0),), "curve", 'must be "steps" or "lines"'),
    ],
)
def test_bad_profiles(points, kind, message) -> None:
    with pytest.raises(ParameterError, match=message):
        Profile(points, kind)


def test_constants_become_profiles_and_text_does_not() -> None:
    assert as_profile(3, "x").sample(np.array([0.0, 9.0]), 0.0).tolist() == [3.0, 3.0]
    with pytest.raises(ParameterError, match=r"valve = '3'"):
        as_profile("3", "valve")  # type: ignore[arg-type]
    with pytest.raises(ParameterError, match="load = nan"):
        as_profile(float("nan"), "load")


def test_profile_machine_carries_the_frozen_numbers() -> None:
    profile = load_profile("pump")
    machine = profile_machine("pump")
    assert machine.inertia == profile["pump"]["J"]
    assert machine.friction == profile["pump"]["B"]
    assert machine.pump.a_h2 == profile["pump"]["a_h2"]
    q = profile["truth"]["healthy_leakage"] * 4.9e5**0.5
    assert machine.pump.K_l * q**2 == pytest.approx(4.9e5, rel=1e-12)
    assert machine.pump.K_J / (2 * machine.pump.K_l * q) == pytest.approx(0.02, rel=1e-12)


def test_shipped_pump_sums_to_the_profile() -> None:
    pump, frozen = load_pump("multistage_1k5"), load_profile("pump")["pump"]
    for name in ("a_h0", "a_h1", "a_h2", "a_t0", "a_t1", "a_t2", "K_Q"):
        assert pump.stages * getattr(pump, name) == pytest.approx(frozen[name], rel=1e-12), name


def test_unknown_profile_lists_the_known() -> None:
    with pytest.raises(ParameterError, match=r"must be one of pump, pump_hot, stator"):
        load_profile("fan")
    with pytest.raises(ParameterError, match="has no pump"):
        profile_machine("stator")
