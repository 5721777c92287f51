"""Thesis 4.2.2, 6.1: structural analysis of the pump's steady state against its oracle and beside fault propagation.

What agrees: {I, V, Q, dp} is the only smallest set that isolates friction, leakage, clogging, cavitation and dry
running. What differs, and why:

* Structure detects all of them with any three of the four sensors, even without the current or the voltage: from
  the relations of the motor the speed can be had from any two of V, I and torque. The signals of the event model are
  given, and each of them needs both.
* Structure sees leakage in {I, V, dp} and clogging in {I, V, Q}, where the event model does not: any dependence
  counts in a structure, an event needs a deviation that must exceed its threshold.
* Structure tells cavitation from dry running without a signal for the level of torque, as two unknown amounts in
  the same two equations; the event model tells them apart by that level.
* Neither disturbing events nor signs exist in a structure; the hydraulic resistance is left out of it as unknown.
"""

import warnings

import numpy as np
import pytest

from pumplib.errors import ParameterError
from pumplib.fmea.load import shipped
from pumplib.propagation import demands, minimal_sets, propagate
from pumplib.propagation.structural import (
    PUMP,
    SENSORS,
    Relation,
    compare,
    faults,
    overdetermined,
    structural_sets,
    structurally_isolable,
    with_sensors,
)

SETS = [("I", "V", "dp"), ("I", "V", "Q"), ("I", "Q", "dp"), ("V", "Q", "dp"), ("I", "V"), ("I", "V", "Q", "dp")]


def known_supply(relations):
    """The same with current and voltage as known signals instead of measured unknowns: nine unknowns."""
    kept = [one for one in relations if one.name not in ("sensor I", "sensor V")]
    return [
        Relation(name=one.name, unknowns=tuple(u for u in one.unknowns if u not in ("i", "v")), fault=one.fault)
        for one in kept
    ]


def oracle(relations):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        import faultdiagnosistoolbox

        unknowns = list(dict.fromkeys(name for one in relations for name in one.unknowns))
        model = {
            "type": "VarStruc",
            "x": unknowns,
            "f": list(faults(relations)),
            "z": ["z"],
            "rels": [[*one.unknowns, *([one.fault] if one.fault else []), "z"] for one in relations],
        }
        return faultdiagnosistoolbox.DiagnosisModel(model, name="pump"), len(unknowns)


@pytest.mark.parametrize("sensors", SETS, ids=",".join)
def test_agrees_with_the_toolbox(sensors):
    relations = with_sensors(sensors)
    names, seen, apart = structurally_isolable(relations)
    model, _ = oracle(relations)
    found, _ = model.DetectabilityAnalysis()
    assert set(found) == {name for name, yes in zip(names, seen, strict=True) if yes}
    if seen.all():  # the toolbox analyses isolability among detectable faults
        np.testing.assert_array_equal(apart, model.IsolabilityAnalysis() == 0)


@pytest.mark.parametrize(
    ("sensors", "redundancy", "subsets"),
    [(("I", "V", "Q", "dp"), 2, 8), (("I", "V", "dp"), 1, 1), (("I", "V", "Q"), 1, 1)],
)
def test_nine_unknowns(sensors, redundancy, subsets):
    relations = known_supply(with_sensors(sensors))
    model, unknowns = oracle(relations)
    assert unknowns == 9
    assert model.Redundancy() == redundancy
    assert len(model.MSO()) == subsets
    names, seen, apart = structurally_isolable(relations)
    assert seen.all()
    assert apart.sum() == (len(names) * (len(names) - 1) if redundancy == 2 else 0)


def test_sensor_sets():
    four = frozenset(SENSORS)
    assert set(structural_sets("detect")) == {four - {name} for name in SENSORS}
    assert structural_sets("isolate") == (four,)


def test_overdetermined_part_by_definition():
    # smallest case: two relations for one unknown, one relation with an unknown of its own
    relations = [
        Relation(name="1", unknowns=("x",)),
        Relation(name="2", unknowns=("x",)),
        Relation(name="3", unknowns=("x", "y")),
    ]
    assert overdetermined(relations) == {0, 1}
    assert overdetermined(PUMP) == frozenset()


def test_comparison_with_fault_propagation():
    pump = shipped("pump")
    effects = propagate(pump).narrow(disturbances=pump.scenario("D_B").disturbances)
    groups = [f"G{k}" for k in range(2, 7)]  # the structure has no stator fault
    rows = compare(
        [(f"{goal} G2-G6", goal, minimal_sets(demands(effects, goal, groups))) for goal in ("detect", "isolate")]
    )
    assert rows[1]["fault propagation"] == rows[1]["structure"] == "{I, V, Q, dp}"
    assert rows[1]["why they differ"] == ""
    assert rows[0]["fault propagation"] == "{I, V, Q, dp}"
    assert rows[0]["structure"] == "{I, V, Q} {I, V, dp} {I, Q, dp} {V, Q, dp}"
    assert rows[0]["why they differ"]


def test_wrong_input_is_refused():
    with pytest.raises(ParameterError, match="sensor 'U'"):
        with_sensors(["U"])
    with pytest.raises(ParameterError, match="goal = 'find'"):
        structural_sets("find")
