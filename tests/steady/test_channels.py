"""Wrong units are named, right ones pass, and missing channels cost what they cost."""

import math
from itertools import combinations

import numpy as np
import pytest

from pumplib.errors import DataError, ParameterError
from pumplib.steady.channels import available_relations, check_units
from pumplib.steady.relations import CHANNELS
from tests.steady.cases import MOTOR, VALUES, grid, machine, measured

WRONG = {
    ("phi", "degrees"): np.degrees,
    ("V_rms", "line-to-line voltage"): lambda x: math.sqrt(3) * x,
    ("V_rms", "kV"): lambda x: x / 1e3,
    ("I_rms", "mA"): lambda x: 1e3 * x,
    ("omega_e", "Hz"): lambda x: x / (2 * math.pi),
    ("omega_e", "rpm"): lambda x: x * 30 / math.pi,
    ("H", "bar"): lambda x: x / 1e5,
    ("H", "kPa"): lambda x: x / 1e3,
    ("H", "m of water"): lambda x: x / 9789,
    ("Q", "m3/h"): lambda x: 3600 * x,
    ("Q", "l/min"): lambda x: 6e4 * x,
    ("Q", "l/s"): lambda x: 1e3 * x,
}


def test_right_units_pass_on_many_machines_and_with_small_faults() -> None:
    rng = np.random.default_rng(1)
    for _ in range(5):
        truth, bias = machine(rng)
        assert check_units(MOTOR, VALUES, measured(rng, 8, truth, bias)) == ()
    assert check_units(MOTOR, VALUES, grid(3, K_f=2e10, K_l=1e-7, dB=1e-3).signals) == ()


@pytest.mark.parametrize("wrong", WRONG)
def test_a_wrong_unit_is_named(wrong: tuple[str, str]) -> None:
    channel, unit = wrong
    signals = dict(grid(3).signals)
    signals[channel] = WRONG[wrong](signals[channel])
    (found,) = check_units(MOTOR, VALUES, signals)
    assert found.channel == channel
    assert found.likely[0] == unit
    assert unit in found.message


@pytest.mark.parametrize(
    "pair", [(("phi", "degrees"), ("H", "bar")), (("V_rms", "line-to-line voltage"), ("Q", "m3/h"))]
)
def test_two_wrong_units_at_once(pair: tuple[tuple[str, str], ...]) -> None:
    signals = dict(grid(3).signals)
    for channel, unit in pair:
        signals[channel] = WRONG[channel, unit](signals[channel])
    found = {one.channel: one.likely[0] for one in check_units(MOTOR, VALUES, signals)}
    assert found == dict(pair)


def test_nonsense_is_not_explained_away() -> None:
    (found,) = check_units(MOTOR, VALUES, dict(grid(2).signals) | {"H": np.full(4, -3e5)})
    assert found.channel == "all"
    assert found.likely == ()
    assert "head" in found.message


def test_subsets_of_channels_are_checked_too() -> None:
    signals = grid(3).signals
    for kept in combinations(CHANNELS, 3):
        assert check_units(MOTOR, VALUES, {name: signals[name] for name in kept}) == ()
    (found,) = check_units(MOTOR, VALUES, {"V_rms": signals["V_rms"], "omega_e": signals["omega_e"] / (2 * math.pi)})
    assert found.likely[0] in ("Hz", "kV")


def test_missing_channels_reduce_the_relations() -> None:
    whole = available_relations(CHANNELS)
    assert whole.relations == ("R1", "R2", "R3")
    assert whole.isolable == (("K_f",), ("dB",), ("K_l",), ("f_c", "f_d"))
    assert whole.lost == ()
    no_flow = available_relations(set(CHANNELS) - {"Q"})
    assert no_flow.relations == ("R3",)
    assert "leakage" in " ".join(no_flow.lost)
    no_head = available_relations(set(CHANNELS) - {"H"})
    assert no_head.relations == ("R2",)
    assert "K_f" not in no_head.detectable
    assert available_relations({"H", "Q"}).relations == ()
    with pytest.raises(ParameterError, match="T_e"):
        available_relations({"T_e"})


def test_wrong_inputs_are_refused() -> None:
    with pytest.raises(DataError, match="no channel"):
        check_units(MOTOR, VALUES, {"p": [1.0]})
    with pytest.raises(DataError, match="no finite"):
        check_units(MOTOR, VALUES, {"H": [np.nan]})
    with pytest.raises(DataError, match="shapes"):
        check_units(MOTOR, VALUES, {"H": [4e5], "Q": [1e-3, 1e-3]})
    with pytest.raises(DataError, match="no sample"):
        check_units(MOTOR, VALUES, {"H": [4e5, np.nan], "Q": [np.nan, 1e-3]})
