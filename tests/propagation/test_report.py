"""Thesis 4.2.1, 4.3.4, 4.3.5: the analysis in rows says what the single functions say."""

from dataclasses import replace

import numpy as np
import pytest

from pumplib.errors import ParameterError
from pumplib.fmea import Edge, shipped
from pumplib.propagation import compile_table, propagate, report

SIX = tuple(f"G{k}" for k in range(1, 7))
SEVEN = (*SIX, "G7")
GOALS = {"isolate 6": ("isolate", SIX), "isolate 7": ("isolate", SEVEN)}


@pytest.fixture(scope="module")
def pump():
    return shipped("pump")


def same(a, b):
    return all(np.array_equal(getattr(a, name), getattr(b, name)) for name in ("A_f", "A_f_must", "A_d"))


@pytest.mark.parametrize(
    ("dropped", "options"),
    [
        ((), {}),
        (("envelope",), {"disturbance_kinds": ("effect", "progression")}),
        (("threshold",), {"disturbance_kinds": ("effect", "drift")}),
        (("envelope", "threshold"), {"disturbance_kinds": ("effect", "progression", "drift")}),
        (("progression",), {"fault_kinds": ("effect", "progression")}),
    ],
)
def test_dropped_assumptions(pump, dropped, options):
    assert same(report.propagate_without(pump, dropped), propagate(pump, **options))


def test_dropped_edges(pump):
    edges = ("Q+ -> hf+", "Q- -> hf+")
    assert set(edges) <= set(report.drop_names(pump))
    assert same(report.propagate_without(pump, edges, "simple"), propagate(pump.drop(edges), signs="simple"))
    assert not same(report.propagate_without(pump, edges), propagate(pump))


def test_names_that_cannot_be_dropped(pump):
    with pytest.raises(ParameterError, match="Q\\+ -> hf-"):
        report.propagate_without(pump, ["Q+ -> hf-"])


@pytest.mark.parametrize("name", ["pump", "ship"])
def test_loops(name):
    system = shipped(name)
    found = report.study_loops(system, np.random.default_rng(3), 30)
    assert found.wrong == 0
    assert found.condensed
    # forgetting the cut effects must show, or the comparison shows nothing
    assert 0 < found.lost[0] <= found.lost[1] < found.entries
    assert max(found.passes) < found.sweeps
    assert min(found.cuts) >= len(found.cut)
    assert len(found.rows()) == 4


def test_loops_without_a_cut_edge_of_effects_are_none():
    """A chain has no loop, needs no cut and loses nothing."""
    ship = shipped("ship")
    loops = report.study_loops(ship, np.random.default_rng(1), 2)
    cut = set(loops.cut)
    home = {event.id: event.component for event in ship.events}
    edges = tuple(edge for edge in ship.edges if (home[edge.cause], edge.component) not in cut)
    open_ship = replace(ship, edges=edges)
    found = report.study_loops(open_ship, np.random.default_rng(1), 2)
    assert found.cut == ()
    assert found.components == ()
    assert found.lost == (0, 0)
    assert found.entries < loops.entries


def test_loops_need_an_order(pump):
    with pytest.raises(ParameterError, match="orders = 0"):
        report.study_loops(pump, np.random.default_rng(1), 0)


def test_written_in_the_order_of_the_tables(pump):
    assert report.written(pump, [{"dp", "I"}, {"Q"}]) == "{I, dp} {Q}"
    assert report.written(pump, []) == "impossible"


def test_scenarios(pump):
    rows = report.sensor_rows(report.scenario_cases(pump), GOALS)
    assert [row["case"] for row in rows] == ["none", "D_A", "D_B", "D_C", "D_D"]
    assert rows[2]["isolate 6"] == "{I, V, Q, dp}"
    assert rows[2]["isolate 7"] == "{I, V, Q, dp, pin}"
    assert rows[4]["isolate 6"] == "impossible"


def test_the_value_of_disturbing_events(pump):
    first, guarded, _, simple, closure = report.sensor_rows(report.value_cases(pump, "D_B"), GOALS)
    assert first["isolate 6"] == "{I, V, Q}"
    assert guarded["isolate 6"] == simple["isolate 6"] == closure["isolate 6"] == "{I, V, Q, dp}"


def test_assumptions(pump):
    rows = report.sensor_rows(report.assumption_cases(pump, "D_B"), GOALS)
    assert len(rows) == len(report.AXIOMS) + 3
    assert [row["isolate 6"] for row in rows] == ["{I, V, Q, dp}", *["impossible"] * 3, *["{I, V, Q, dp}"] * 2]
    fewer = report.assumption_cases(pump, "D_B", ["envelope"])
    assert not any("envelope" in name for name in fewer)
    assert same(
        fewer["as assumed"],
        propagate(pump, disturbance_kinds=("effect", "progression")).narrow(
            disturbances=pump.scenario("D_B").disturbances
        ),
    )


def test_groups(pump):
    effects = report.scenario_cases(pump)["D_B"]
    rows = {row["group"]: row for row in report.group_rows(effects, SEVEN, ["I", "V", "dp"])}
    assert rows["G1 stator"]["sets that isolate"] == "{I, V}"
    assert rows["G1 stator"]["with the chosen sensors"] == "isolated"
    assert rows["G3 clogging"]["with the chosen sensors"] == "detected"
    assert rows["G4 leakage"]["with the chosen sensors"] == "not seen"
    assert [row["among other faults"] for row in rows.values()] == ["yes", "yes", "no", "no", "no", "yes", "yes"]


def test_variants(pump):
    rows = {row["choice"]: row for row in report.variant_rows(pump, "D_B")}
    assert len(rows) == len(pump.variants)
    assert rows["blocked_rotor"]["isolate"] == "{I, V}"
    assert rows["defect_impeller"]["isolate"] == "impossible"


def test_costs(pump):
    effects = report.scenario_cases(pump)["D_B"]
    (row,) = report.cost_rows(effects, {"detect G5": ("detect", ["G5"])}, {"dp": 30.0})
    assert row == {"goal": "detect G5", "costs of the tables": "{I, V, dp}: 4", "other costs": "{I, V, Q}: 7"}
    with pytest.raises(ParameterError, match="sensor 'U'"):
        report.cost_rows(effects, {}, {"U": 1.0})
    (none,) = report.cost_rows(report.scenario_cases(pump)["D_D"], {"six": ("isolate", SIX)}, {})
    assert none["other costs"] == "impossible"


def test_verdicts(pump):
    table = compile_table(report.scenario_cases(pump)["D_B"], ["I", "V", "Q", "dp"], SEVEN)
    rows = report.verdict_rows(
        table,
        {
            "quiet": {},
            "stator": {"yZn": "+"},
            "not fitted": {"ykin": "+"},
            "unknown": {"yrH": "-", "yrT": "?", "yrTH": "?"},
            "alone": {"yrH": "-"},
        },
    )
    said = {row["case"]: row["verdict"] for row in rows}
    assert said["quiet"] == said["not fitted"] == "fault free"
    assert said["stator"] == "isolated: G1"
    assert said["unknown"] == "ambiguous: G3 or G4"
    assert said["alone"] == "inconsistent"
    assert rows[3]["symbols"] == "yrH -, yrT ?, yrTH ?"


def test_the_rows_follow_the_tables(pump):
    """If the load touched the lower limit of the torque, dry running would look like cavitation."""
    spoiled = replace(pump, edges=(*pump.edges, Edge(cause="ko+", effect="yLT+", component="OBS", certain=False)))
    (row,) = report.sensor_rows({"D_B": report.scenario_cases(spoiled)["D_B"]}, {"six": ("isolate", SIX)})
    assert row["six"] == "impossible"
