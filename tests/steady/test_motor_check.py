"""Sets of speed and shaft power beside the measured load points of the 18.5 kW motor."""

import numpy as np
import pytest

from pumplib.machines import load_losses, load_motor
from pumplib.motor.load_points import read_load_points
from pumplib.paths import DATA
from pumplib.steady.motor_check import MotorCheck, motor_check


def check(**other) -> MotorCheck:  # type: ignore[no-untyped-def]
    points = read_load_points(DATA / "load_points" / "im_18k5.csv")
    return motor_check(
        load_motor("im_18k5"), load_losses("im_18k5"), points, voltage_line_rms=400.0, frequency_hz=50.0, **other
    )


def test_all_loaded_points_are_inside_and_the_sets_are_narrow() -> None:
    found = check()
    assert found.contained.sum() == len(found.contained) == 13
    assert np.median(found.power_width) <= 0.06
    assert np.median(found.power_width) > 0.005


def test_without_the_motors_losses_the_points_are_outside() -> None:
    points = read_load_points(DATA / "load_points" / "im_18k5.csv")
    bare = motor_check(load_motor("im_18k5"), None, points, voltage_line_rms=400.0, frequency_hz=50.0)
    assert bare.contained.sum() < 5


@pytest.mark.parametrize("relative", [0.0, 0.01])
def test_a_smaller_box_gives_smaller_sets(relative: float) -> None:
    assert np.all(check(relative=relative).power_width < check().power_width)
