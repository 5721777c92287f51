"""Thesis 2.1.4, 6.6: isolation by signs and by direction, on the signs of the pump's residuals."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import settings as effort
from hypothesis import strategies as st

from pumplib.decide import NONE_FITS, SignatureTable, isolate_direction, window_mean
from pumplib.errors import DataError, ParameterError

# signs of r1, r2, r3 for small faults where head falls and torque rises with flow
PUMP = SignatureTable(
    residuals=("r1", "r2", "r3"),
    faults={"rub": "0 - -", "clogging": "- 0 +", "leakage": "- - 0", "cavitation": "- + +"},
)
K0 = (6000.0, 0.03, 0.03)


def signed(signs, size=3.0):
    return [size * (s or 0) * k for s, k in zip(signs, K0, strict=True)]


@pytest.mark.parametrize("fault", PUMP.faults)
def test_every_pump_fault_is_isolated_by_its_signs(fault):
    found = PUMP.isolate(signed(PUMP.signs(fault)), K0)
    assert found.best == fault
    assert found.unique
    # signs are three thresholds out, two beyond their border; zeros are one away from theirs
    assert found.ranking[0].score == pytest.approx(1.0 if 0 in PUMP.signs(fault) else 2.0)
    assert found.margin > 0
    assert not any(one.fits for one in found.ranking[1:])


def test_margin_names_what_contradicts():
    found = PUMP.isolate([-18e3, 0.033, 0.09], K0)
    assert found.best == "cavitation"
    assert found.ranking[0].score == pytest.approx(0.1)
    assert found.ranking[1].fault == "clogging"
    assert found.ranking[1].against == ("r2",)
    assert found.ranking[1].score == pytest.approx(-0.1)
    assert found.margin == pytest.approx(0.2)


@pytest.mark.parametrize("pattern", [(0, 0, 0), (1, 1, 1), (1, 0, 0), (0, 0, -1)])
def test_unknown_pattern_fits_none(pattern):
    found = PUMP.isolate(signed(pattern), K0)
    assert found.best == NONE_FITS
    assert found.ambiguous == ()
    assert math.isnan(found.margin)
    assert not found.unique


def test_table_knows_what_it_cannot_tell_apart():
    assert PUMP.indistinguishable() == ()
    wild = SignatureTable(residuals=("r1", "r2"), faults={"a": "+*", "b": "*-", "c": "-+"})
    assert wild.indistinguishable() == (("a", "b"),)
    assert set(wild.isolate([2.0, -2.0], [1.0, 1.0]).ambiguous) == {"a", "b"}
    assert wild.isolate([2.0, 0.0], [1.0, 1.0]).best == "a"


def test_residual_that_is_not_available_is_not_looked_at():
    r = [-18e3, 0.0, math.nan]
    found = PUMP.isolate(r, K0, available=(True, True, False))
    assert found.best == "clogging"
    # without r2 and r3 three faults look alike, and the rub is invisible
    found = PUMP.isolate(r, K0, available=(True, False, False))
    assert set(found.ambiguous) == {"clogging", "leakage", "cavitation"}
    assert found.ranking[-1].fault == "rub"
    with pytest.raises(DataError, match="residual r3: nan is not finite; mark it as not available"):
        PUMP.isolate(r, K0)


DIRECTIONS = {
    "rub": (0.0, -0.03, -0.03),
    "clogging": (-6000.0, 0.0, 0.03),
    "leakage": (-6000.0, -0.03, 0.0),
    "cavitation": (-6000.0, 0.03, 0.06),
}


@effort(max_examples=40, deadline=None)
@given(st.sampled_from(sorted(DIRECTIONS)), st.floats(1e-3, 1e3), st.integers(0, 2**32))
def test_direction_does_not_depend_on_the_size_of_the_fault_nor_on_units(fault, size, seed):
    rng = np.random.default_rng(seed)
    noise = 0.05 * rng.standard_normal(3)
    r = size * (np.array(DIRECTIONS[fault]) + noise * K0)
    found = isolate_direction(r, K0, DIRECTIONS)
    assert found.best == fault
    units = 10.0 ** rng.integers(-3, 4, 3)
    other = isolate_direction(r * units, K0 * units, {k: np.array(v) * units for k, v in DIRECTIONS.items()})
    assert [one.fault for one in other.ranking] == [one.fault for one in found.ranking]
    assert [one.score for one in other.ranking] == pytest.approx([one.score for one in found.ranking])


def test_direction_reports_ambiguity_and_margin_in_degrees():
    def at(degrees):
        return (math.cos(math.radians(degrees)), math.sin(math.radians(degrees)))

    table = {"a": at(0), "b": at(6), "c": at(27)}
    found = isolate_direction(at(1), (1.0, 1.0), table)
    assert found.best == "a"
    assert found.ambiguous == ("a", "b")
    assert found.margin == pytest.approx(25.0)
    assert found.ranking[0].score == pytest.approx(math.cos(math.radians(1)))
    only = isolate_direction(at(1), (1.0, 1.0), table, ambiguity_deg=3.0)
    assert only.unique
    assert only.margin == pytest.approx(4.0)
    assert isolate_direction(at(1), (1.0, 1.0), {"a": at(0)}).margin == math.inf


def test_direction_none_fits_and_opposite_sign():
    table = {"gain": (1.0, 0.0)}
    assert isolate_direction((-2.0, 0.1), (1.0, 1.0), table).best == NONE_FITS
    assert isolate_direction((-2.0, 0.1), (1.0, 1.0), table, both_signs=True).best == "gain"
    assert isolate_direction((0.0, 3.0), (1.0, 1.0), table).best == NONE_FITS
    assert isolate_direction((0.0, 0.0), (1.0, 1.0), table, both_signs=True).best == NONE_FITS
    hidden = isolate_direction((0.0, 3.0), (1.0, 1.0), table, available=(False, True), both_signs=True)
    assert hidden.best == NONE_FITS


def test_mean_after_the_alarm():
    r = np.zeros((400, 2))
    r[170:230] = [1.0, -2.0]
    assert window_mean(r, 100, 0.01).tolist() == [1.0, -2.0]
    with pytest.raises(DataError, match=r"the window ends at 4\.3 s, the record at 4 s"):
        window_mean(r, 300, 0.01)
    with pytest.raises(ParameterError, match="no sample between"):
        window_mean(r, 100, 10.0)
    with pytest.raises(ParameterError, match=r"stop = 0\.5 s: must be > 0\.7 s"):
        window_mean(r, 100, 0.01, stop=0.5)


@pytest.mark.parametrize(
    ("faults", "text"),
    [
        ({"a": "+-x"}, "give 3 of the symbols"),
        ({"a": "+-"}, "give 3 of the symbols"),
        ({"a": "0*0"}, "looks like no fault"),
        ({}, "at least one residual and one fault"),
    ],
)
def test_wrong_tables(faults, text):
    with pytest.raises(ParameterError, match=text):
        SignatureTable(residuals=("r1", "r2", "r3"), faults=faults)


def test_wrong_input():
    with pytest.raises(ParameterError, match="no fault 'x'"):
        PUMP.signs("x")
    with pytest.raises(DataError, match=r"shape \(2,\) and thresholds \(3,\)"):
        PUMP.isolate([1.0, 2.0], K0)
    with pytest.raises(DataError, match=r"threshold of r2: 0\.0 must be finite and above zero"):
        PUMP.isolate([1.0, 2.0, 3.0], (1.0, 0.0, 1.0))
    with pytest.raises(DataError, match="at least one of them True"):
        PUMP.isolate([1.0, 2.0, 3.0], K0, available=(False, False, False))
    with pytest.raises(DataError, match="direction of rub: residual r2: nan"):
        isolate_direction([1.0, 2.0], (1.0, 1.0), {"rub": (1.0, math.nan)})
    with pytest.raises(ParameterError, match="directions is empty"):
        isolate_direction([1.0], [1.0], {})
    with pytest.raises(ParameterError, match="widest_deg = 120 deg"):
        isolate_direction([1.0], [1.0], {"a": [1.0]}, widest_deg=120.0)
