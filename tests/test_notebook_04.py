"""Notebook of chapter 4: what its parameters accept, and what a wrong one is told."""

import json
from typing import Any

import pytest

from pumplib.errors import ParameterError
from pumplib.fmea import shipped
from pumplib.paths import NOTEBOOKS

CELLS = {
    cell["id"]: "".join(cell["source"])
    for cell in json.loads((NOTEBOOKS / "04_fmea_fpa.ipynb").read_text(encoding="utf-8"))["cells"]
}


def start(**changed: Any) -> dict[str, Any]:
    """Run the first two code cells with other parameters, as papermill does."""
    names: dict[str, Any] = {}
    exec(CELLS["parameters"], names)
    names.update(changed)
    exec(CELLS["start"], names)
    return names


def test_defaults():
    names = start()
    assert names["p"].sensors == ("I", "V", "Q", "dp")
    assert names["p"].drop == ()
    assert names["pump"] == shipped("pump")


@pytest.mark.parametrize(
    ("changed", "name", "value"),
    [
        ({"sensors": "I,V"}, "sensors", ("I", "V")),
        ({"sensors": "['vib']"}, "sensors", ("vib",)),
        ({"drop": "envelope, Q+ -> hf+"}, "drop", ("envelope", "Q+ -> hf+")),
        ({"scenario": "none"}, "scenario", "none"),
        ({"highlight": "d_load+"}, "highlight", "d_load+"),
        ({"fast": "true"}, "fast", True),
    ],
)
def test_accepted(changed, name, value):
    assert start(**changed)["p"][name] == value


def test_the_seventh_group_is_chosen():
    assert start(group7="blocked_rotor")["pump"].group("G7").faults == ("MD1", "MP5")


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"scenario": "D_E"}, ["'D_E'", "'none', 'D_A', 'D_B', 'D_C', 'D_D'"]),
        ({"sensors": "I, U"}, ["'U' is not one of them", "I, V, Q, dp, pin, T, vib"]),
        ({"sensors": ""}, ["no name is given", "I, V, Q, dp, pin, T, vib"]),
        ({"group7": "G7"}, ["'inlet_obstruction', 'blocked_rotor'"]),
        ({"drop": "Q+ -> hf-"}, ["did you mean 'Q+ -> hf+'", "envelope, threshold, progression"]),
        ({"highlight": "HY9"}, ["'HY1'", "'d_load+'"]),
        ({"seed": -1}, ["too small"]),
    ],
)
def test_a_wrong_value_names_the_allowed_ones(changed, words):
    with pytest.raises(ParameterError) as error:
        start(**changed)
    for word in [*changed, *words]:
        assert word in str(error.value)
