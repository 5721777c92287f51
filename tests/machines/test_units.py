import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pumplib.errors import ParameterError
from pumplib.machines.units import RPM, from_si, known_units, si_unit, to_si

values = st.floats(-1e6, 1e6, allow_nan=False)


@given(values, st.sampled_from(known_units()))
def test_round_trip(value: float, unit: str) -> None:
    assert from_si(to_si(value, unit), unit) == pytest.approx(value, rel=1e-12, abs=1e-9)


@pytest.mark.parametrize(
    ("value", "unit", "si"),
    [
        (2900, "rpm", 2900 * 2 * math.pi / 60),
        (3.6, "m3/h", 1e-3),
        (60, "l/min", 1e-3),
        (1, "bar", 1e5),
        (20, "degC", 293.15),
        (180, "deg", math.pi),
        (66.4, "ohm at 50 Hz", 66.4 / (2 * math.pi * 50)),
        (100, "%", 1.0),
    ],
)
def test_known_conversions(value: float, unit: str, si: float) -> None:
    assert to_si(value, unit) == pytest.approx(si, rel=1e-14)


def test_rpm_is_a_sixtieth_of_a_turn() -> None:
    assert pytest.approx(2 * math.pi * 1.0, rel=1e-15) == 60 * RPM


def test_unknown_unit_lists_the_known() -> None:
    with pytest.raises(ParameterError, match=r"unknown unit 'psi'.*bar"):
        to_si(1.0, "psi")


def test_wrong_kind_of_unit_lists_the_fitting() -> None:
    with pytest.raises(ParameterError, match=r"'rpm' does not measure Pa; write one of: Pa, kPa, MPa, bar"):
        to_si(1.0, "rpm", "Pa")


@pytest.mark.parametrize("unit", known_units())
def test_si_unit_of_an_si_unit_is_itself(unit: str) -> None:
    assert si_unit(si_unit(unit)) == si_unit(unit)
