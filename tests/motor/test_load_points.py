"""Reading measured load points: order, refusals, and the fit of speed and supply."""

import math
from pathlib import Path

import numpy as np
import pytest

from pumplib.errors import DataError
from pumplib.machines import load_losses, load_motor
from pumplib.motor.load_points import compare_load_points, read_load_points

HEADER = "shaft_power_W,current_A,speed_rpm,power_factor\n"


def write(folder: Path, text: str) -> Path:
    path = folder / "points.csv"
    path.write_text(text, encoding="utf-8")
    return path


def test_rows_are_sorted_and_columns_may_be_in_any_order(tmp_path: Path) -> None:
    points = read_load_points(
        write(tmp_path, "speed_rpm,power_factor,current_A,shaft_power_W\n1462,0.896,32.85,18500\n1500,0.085,11,0\n")
    )
    np.testing.assert_array_equal(points.power_shaft, [0, 18500])
    np.testing.assert_allclose(points.omega, np.array([1500, 1462]) * 2 * math.pi / 60)
    np.testing.assert_array_equal(points.loaded, [False, True])


@pytest.mark.parametrize(
    ("rows", "words"),
    [
        ("18500,32.85,1462,89.6\n", ["line 2", "power_factor = 89.6", "not percent"]),
        ("0,11,1500,0.085\n-5,32.85,1462,0.9\n", ["line 3", "shaft_power_W = -5"]),
        ("18500,0,1462,0.9\n", ["current_A = 0"]),
        ("18500,32,-1462,0.9\n", ["speed_rpm = -1462"]),
        ("18500,32,1462,0.9\n18500,32,1461,0.9\n", ["line 3", "18500", "twice"]),
    ],
)
def test_bad_rows_are_refused(tmp_path: Path, rows: str, words: list[str]) -> None:
    with pytest.raises(DataError) as error:
        read_load_points(write(tmp_path, HEADER + rows))
    for word in ["points.csv", *words]:
        assert word in str(error.value)


@pytest.mark.parametrize("speed", [153.1, 2925.0])
def test_speed_must_fit_the_synchronous_speed(tmp_path: Path, speed: float) -> None:
    points = read_load_points(write(tmp_path, HEADER + f"18500,32.85,{speed},0.896\n"))
    with pytest.raises(DataError, match="synchronous speed"):
        compare_load_points(
            load_motor("im_18k5"), load_losses("im_18k5"), points, voltage_line_rms=400, frequency_hz=50
        )
