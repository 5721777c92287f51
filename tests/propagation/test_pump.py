"""Thesis 4.3.4, 4.3.5: the pump's tables: loops, undisturbed end-effects, sensors, what the choice hangs on."""

from dataclasses import replace

import numpy as np
import pytest

from pumplib.errors import ParameterError
from pumplib.fmea.load import shipped
from pumplib.propagation import (
    cheapest,
    compile_table,
    component_cut,
    cost,
    cut_closure,
    decodable,
    demands,
    event_matrices,
    minimal_sets,
    minimal_sets_milp,
    minimum_cut,
    pack,
    plain_closure,
    propagate,
    reached,
    scc_closure,
    sensor_table,
    strong_components,
    suffices,
    tolerated,
    unpack,
)
from pumplib.propagation.assumptions import outsiders, sensitivity, weaken_effect
from pumplib.propagation.sensors import Demands

SIX = tuple(f"G{k}" for k in range(1, 7))
SEVEN = (*SIX, "G7")
GOALS = {
    "detect 6": ("detect", SIX),
    "isolate 6": ("isolate", SIX),
    "detect 7": ("detect", SEVEN),
    "isolate 7": ("isolate", SEVEN),
}
FOUR, FIVE = ["I,V,Q,dp"], ["I,V,Q,dp,pin"]


@pytest.fixture(scope="module")
def pump():
    return shipped("pump")


@pytest.fixture(scope="module")
def effects(pump):
    return propagate(pump)


def under(effects, scenario):
    return effects.narrow(disturbances=effects.system.scenario(scenario).disturbances)


def written(system, sets):
    return [",".join(sensor.id for sensor in system.sensors if sensor.id in one) for one in sets]


def answers(effects, scenario):
    problem = under(effects, scenario)
    return [written(effects.system, minimal_sets(demands(problem, *goal))) for goal in GOALS.values()]


def roots(net):
    m, p = len(net.faults), len(net.disturbances)
    event = np.concatenate((net.fault_event, net.disturbance_event))
    return m + p, pack(event, np.concatenate((net.fault, net.disturbance + m)), len(net.events), m + p)


def test_matrices_are_those_of_the_definition(pump, effects):
    m = event_matrices(pump.select(kinds=("effect",)))
    n = len(m.events)
    star = np.eye(n, dtype=int)
    for _ in range(n):
        star = np.minimum(star + m.A.astype(int) @ star, 1)
    np.testing.assert_array_equal(effects.A_f, (m.S @ star @ m.B_f) > 0)
    np.testing.assert_array_equal(effects.A_d, (m.S @ star @ m.B_d) > 0)
    assert (effects.A_f_must <= effects.A_f).all()
    assert m.S.sum(axis=1).tolist() == [1] * len(m.ends)
    at = {name: k for k, name in enumerate(m.components)}
    assert m.D_f[at["MP"], at["MD"]]  # a blocked impeller acts on the shaft
    assert m.D_f[at["EM"], at["MM"]]  # a broken bar shows as torque ripple
    assert not m.D_e.diagonal().any()


def test_loops_of_the_pump(pump):
    effect = event_matrices(pump.select(kinds=("effect",)))
    whole = event_matrices(pump)
    for m, largest in ((effect, 6), (whole, 8)):
        count, label = strong_components(len(m.components), *np.nonzero(m.D_e))
        assert np.bincount(label).max() == largest
        assert count == len(m.components) - largest + 1
    assert len(minimum_cut(whole.D_e)) == 4
    net = pump.incidence()
    sizes = np.bincount(strong_components(len(net.events), net.cause, net.effect)[1])
    assert sorted(sizes[sizes > 1].tolist()) == [2, 19]


def test_any_search_order_gives_the_same_effects_of_the_pump(pump):
    net = pump.incidence()
    n, (r, seeds) = len(net.events), roots(net)
    true = plain_closure(n, net.cause, net.effect, seeds)
    np.testing.assert_array_equal(scc_closure(n, net.cause, net.effect, seeds), true.bits)
    rng = np.random.default_rng(7)
    cuts, passes = set(), set()
    for _ in range(300):
        order = rng.permutation(len(net.blocks))
        cut = component_cut(n, net.cause, net.effect, net.block, order)
        found = cut_closure(n, net.cause, net.effect, seeds, cut=cut, component=net.block)
        np.testing.assert_array_equal(found.bits, true.bits)
        cuts.add(frozenset(zip(net.block[net.cause[cut]].tolist(), net.block[net.effect[cut]].tolist(), strict=True)))
        passes.add(found.passes)
        open_cut = cut_closure(n, net.cause, net.effect, seeds, cut=cut, component=net.block, inject=False)
        lost = unpack(true.bits, r).sum() - unpack(open_cut.bits, r).sum()
        assert lost > 1000  # more than half of the entries come through loops
    assert len(cuts) == 8
    assert passes == {4, 5}
    assert true.passes == 13


def test_undisturbed_end_effects(effects):
    # "1" must, "?" may; order of the faults as in the groups
    expected = {
        "yI0+": "0010000000000", "ymc+": "0001111000000", "yZn+": "1110000000000", "yst+": "0000000000000",
        "yLT+": "0000000000010", "yrT+": "???1111011000", "yrT-": "???0000000110", "yrH+": "0000000000000",
        "yrH-": "0000000111110", "yrTH+": "???1111000000", "yrTH-": "???0000100110", "ykin+": "0000000000001",
    }  # fmt: skip
    faults = [name for group in effects.system.groups for name in group.faults]
    b = under(effects, "D_B").narrow(faults=faults)
    clean = ~b.A_d.any(axis=1)
    found = {
        b.ends[k]: "".join(
            "1" if sure else "?" if may else "0" for may, sure in zip(b.A_f[k], b.A_f_must[k], strict=True)
        )
        for k in np.flatnonzero(clean)
    }
    assert found == expected


def test_ambiguous_cells_stay_few(pump):
    faults = ["MP2", "HY1", "HY2", "MP3", "HY3", "HY4", "IN1", "OUT1"]
    signals = ["yI", "yP", "yw", "yQ", "ydp", "ypin", "yrT", "yrH", "yrTH", "yLT", "yrpin"]
    count = {s: int(propagate(pump, signs=s).narrow(faults=faults, signals=signals).ambiguous.sum()) for s in
             ("closure", "simple")}  # fmt: skip
    assert count["simple"] <= 18
    assert count["closure"] > count["simple"]


@pytest.mark.parametrize("scenario", ["D_A", "D_B", "D_C"])
def test_four_sensors_for_six_groups(effects, scenario):
    assert answers(effects, scenario) == [FOUR, FOUR, FIVE, FIVE]


def test_liquid_properties_break_it(effects):
    assert answers(effects, "D_D") == [[], [], [], []]


def test_without_spectral_events(pump, effects):
    kept = effects.narrow(signals=[s.id for s in pump.signals if s.id not in ("ymc", "yhf", "ykin")])
    assert answers(kept, "D_A") == [FOUR, FOUR, FIVE, FIVE]
    for scenario in ("D_B", "D_C"):
        assert answers(kept, scenario) == [FOUR, FOUR, [], []]


@pytest.mark.parametrize(("kinds", "signals"), [(("raw",), 8), (("raw", "phasor"), 10)])
def test_raw_events_detect_nothing(pump, effects, kinds, signals):
    raw = under(effects, "D_B").narrow(signals=[signal.id for signal in pump.signals if signal.kind in kinds])
    assert len(raw.signals) == signals
    assert reached(raw, "detect", SEVEN) == ()


@pytest.mark.parametrize(
    ("options", "expected"),
    [
        ({"disturbance_kinds": ("effect", "drift")}, [FOUR, [], FIVE, []]),
        ({"disturbance_kinds": ("effect", "progression")}, [[], [], [], []]),
        ({"fault_kinds": ("effect", "progression")}, [FOUR, [], FIVE, []]),
        ({"fault_kinds": ("effect", "progression"), "signs": "simple"}, [FOUR, FOUR, FIVE, FIVE]),
        ({"guarded": True}, [FOUR, FOUR, FIVE, FIVE]),
    ],
)
def test_assumptions_on_edges(pump, options, expected):
    assert answers(propagate(pump, **options), "D_B") == expected


def test_without_disturbances_less_seems_enough(pump):
    found = answers(propagate(pump, signs="simple"), "none")
    assert found[:2] == [["I,Q", "I,dp", "I,pin"], ["I,V,Q"]]
    # that holds only if a must-effect never vanishes where the fault itself pulls the other way, too
    assert answers(propagate(pump, signs="simple", guarded=True), "none")[:2] == [FOUR, FOUR]


@pytest.mark.parametrize(
    ("group", "detect", "isolate"),
    [
        ("G1", ["I,V"], ["I,V"]),
        ("G2", ["I"], ["I"]),
        ("G3", ["I,V,dp"], FOUR),
        ("G4", ["I,V,Q"], ["I,V,Q"]),
        ("G5", ["I,V,Q", "I,V,dp"], ["I,V,Q"]),
        ("G6", ["I,V"], ["I,V"]),
        ("G7", ["Q,pin"], ["Q,pin"]),
    ],
)
def test_groups_one_by_one(effects, group, detect, isolate):
    b = under(effects, "D_B")
    assert written(effects.system, minimal_sets(demands(b, "detect", [group]))) == detect
    assert written(effects.system, minimal_sets(demands(b, "isolate", [group], SEVEN))) == isolate


def test_enumeration_and_integer_programming_agree(pump, effects):
    compared = 0
    for scenario in pump.scenarios:
        for tables in (effects, propagate(pump, signs="simple")):
            for goal in (*GOALS.values(), *(("isolate", (group,)) for group in SEVEN)):
                problem = demands(under(tables, scenario.id), *goal, among=SEVEN)
                found = minimal_sets(problem)
                assert minimal_sets_milp(problem) == found
                best = cheapest(problem)
                assert (best is None) == (not found)
                if best is not None:
                    assert best[1] == pytest.approx(min(cost(problem, one) for one in found))
                    assert best[0] in found
                compared += 1
    assert compared == 2 * 11 * len(pump.scenarios)


@pytest.mark.parametrize("seed", range(25))
def test_enumeration_and_integer_programming_agree_on_random_goals(seed):
    rng = np.random.default_rng(seed)
    sensors, signals, p = int(rng.integers(1, 7)), int(rng.integers(1, 9)), int(rng.integers(0, 4))
    problem = Demands(
        signals=tuple(f"y{k}" for k in range(signals)),
        sensors=tuple(f"s{k}" for k in range(sensors)),
        disturbances=tuple(f"d{k}" for k in range(p)),
        needs=rng.random((int(rng.integers(0, 5)), signals)) < 0.5,
        pulled=rng.random((signals, p)) < 0.15,
        alternatives=tuple(
            tuple(int(a) for a in rng.integers(1, 1 << sensors, rng.integers(1, 4))) for _ in range(signals)
        ),
        costs=rng.uniform(0.5, 3.0, sensors),
    )
    found = minimal_sets(problem)
    assert minimal_sets_milp(problem) == found
    best = cheapest(problem)
    if found:
        assert best is not None
        assert best[1] == pytest.approx(min(cost(problem, one) for one in found))
    else:
        assert best is None
    # definition: enough as it is, not enough without any one of them
    for one in found:
        assert suffices(problem, one)
        assert not any(suffices(problem, one - {s}) for s in one)
    # dual question by looking at every set of disturbing events
    for some in (problem.sensors, problem.sensors[:1]):
        sets = tolerated(problem, some)
        for number in range(1 << p):
            chosen = np.array([bool(number >> k & 1) for k in range(p)], bool)
            narrow = replace(problem, pulled=problem.pulled[:, chosen])
            names = {f"d{k}" for k in np.flatnonzero(chosen)}
            assert suffices(narrow, some) == any(names <= one for one in sets)


def test_tolerated_disturbances(pump, effects):
    (most,) = tolerated(demands(effects, "isolate", SIX), ["I", "V", "Q", "dp"])
    assert {d.id for d in pump.disturbances} - most == {"d_liq+", "d_liq-"}
    assert tolerated(demands(effects, "detect", SIX), ["I"]) == ()


def test_partial_sets(effects):
    b = under(effects, "D_B")
    assert reached(b, "detect", SIX, ["I", "V"]) == ("G1", "G2", "G6")
    assert reached(b, "detect", SIX, ["I", "V", "dp"]) == ("G1", "G2", "G3", "G5", "G6")
    assert reached(b, "isolate", SIX, ["I", "V", "dp"]) == ("G1", "G2", "G6")
    assert reached(b, "isolate", SIX, ["I", "V", "Q"]) == ("G1", "G2", "G4", "G5", "G6")
    assert reached(b, "isolate", SEVEN) == SEVEN


def test_several_faults_at_once(effects):
    member = {fault: group.id for group in effects.system.groups for fault in group.faults}
    b = under(effects, "D_B").narrow(faults=list(member))
    names, found = decodable(b.A_f, b.A_d, [member[fault] for fault in b.faults])
    assert dict(zip(names, found.tolist(), strict=True)) == {
        "G1": True, "G2": True, "G3": False, "G4": False, "G5": False, "G6": True, "G7": True
    }  # fmt: skip


@pytest.mark.parametrize(
    ("variant", "detect", "isolate"),
    [
        ("inlet_obstruction", ["Q,pin"], ["Q,pin"]),
        ("blocked_rotor", ["I,V"], ["I,V"]),
        ("defect_impeller", ["I,V,dp"], []),
        ("broken_shaft", ["I,V"], []),
        *((name, [], []) for name in ("outlet_obstruction", "pipe_leakage", "misalignment", "broken_rotor_bar")),
    ],
)
def test_other_choices_of_the_seventh_group(pump, variant, detect, isolate):
    b = under(propagate(pump.choose(variant)), "D_B")
    assert written(pump, minimal_sets(demands(b, "detect", ["G7"]))) == detect
    assert written(pump, minimal_sets(demands(b, "isolate", ["G7"], SEVEN))) == isolate


def test_faults_outside_the_groups(effects):
    found = {one.fault: one for one in outsiders(under(effects, "D_B"), ["I", "V", "Q", "dp"], SIX)}
    taken = {name: one.taken_for for name, one in found.items() if one.taken_for}
    assert taken == {"HY5": ("G3", "G5"), "HY6": ("G5",), "IN2": ("G5",), "SM3": ("G6",), "DP1": ("G3",)}
    assert not found["DP1"].shows
    assert found["MD1"].shows


def test_entries_that_the_choice_hangs_on(pump):
    found = sensitivity(pump, "D_B", GOALS)
    assert {one.entry for one in found} == {
        "Zn+ -> yZn+", "empty+ -> yLT+", "kt- -> yrT-", "ki+ -> ykin+",
        "EM1: Zn+", "EM2: Zn+", "HY1: kh-", "HY2: ql+", "MP3: qe+", "HY3: kt-", "HY4: empty+", "IN1: ki+",
    }  # fmt: skip
    assert {one.how for one in found} == {"weakened"}  # no assumption matters when dropped
    assert all(sets == () for one in found for sets in one.sets.values())


def test_cavitation_alone_without_the_assumption_on_flow_noise(pump):
    b = under(propagate(pump.drop(["Q+ -> hf+", "Q- -> hf+"])), "D_B")
    assert written(pump, minimal_sets(demands(b, "isolate", SIX))) == FOUR
    assert written(pump, minimal_sets(demands(b, "detect", ["G5"]))) == ["dp", "pin", "I,V,Q"]
    quiet = b.narrow(disturbances=[d for d in b.disturbances if d != "d_unb"])
    assert "vib" in written(pump, minimal_sets(demands(quiet, "detect", ["G2"])))
    assert "vib" in written(pump, minimal_sets(demands(quiet, "detect", ["G5"])))


def test_sensor_table(effects):
    found = sensor_table({"D_B": under(effects, "D_B")}, GOALS)
    assert written(effects.system, found["D_B"]["isolate 6"]) == FOUR


def test_another_system_goes_through_the_same_functions():
    from pumplib.fmea.load import shipped_names

    others = [name for name in shipped_names() if name != "pump"]
    assert others
    for name in others:
        system = shipped(name)
        effects = propagate(system)
        assert effects.A_f.shape == (len(system.ends), len(system.faults))
        for scenario in system.scenarios:
            problem = demands(under(effects, scenario.id), "isolate", [group.id for group in system.groups])
            assert minimal_sets(problem) == minimal_sets_milp(problem)


@pytest.mark.parametrize(
    ("call", "text"),
    [
        (lambda e: propagate(e.system, signs="both"), "signs = 'both'"),
        (lambda e: propagate(e.system, fault_kinds=("effects",)), "kind 'effects'"),
        (lambda e: e.narrow(faults=["HY9"]), "fault 'HY9'"),
        (lambda e: e.narrow(signals=["yX"]), "signal 'yX'"),
        (lambda e: demands(e, "find", SIX), "goal = 'find'"),
        (lambda e: demands(e, "detect", ["G9"]), "G9"),
        (lambda e: suffices(demands(e, "detect", SIX), ["U"]), "sensor 'U'"),
        (lambda e: compile_table(e, ["U"], SIX), "sensor 'U'"),
        (lambda e: compile_table(e, [], SIX), "give no signal"),
        (lambda e: weaken_effect(e.system, "HY1", "kt-"), "not 'kt-'"),
    ],
)
def test_wrong_input_is_refused(effects, call, text):
    with pytest.raises(ParameterError, match=text):
        call(effects)
