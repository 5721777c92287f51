"""Thesis 4.1.1, 4.2.1, A.1-A.9: the tables of the pump are complete and frozen; a system keeps its names straight."""

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from pumplib.errors import ParameterError
from pumplib.fmea import EDGE_KINDS, OBSERVATION, Edge, Effect, Event, Sensor, System
from pumplib.fmea.entries import nearest
from pumplib.fmea.load import shipped

PUMP = shipped("pump")
HOME = {event.id: event.component for event in PUMP.events}


def test_counts_of_the_reconstruction() -> None:
    assert (len(PUMP.events), len(PUMP.edges), len(PUMP.faults), len(PUMP.disturbances)) == (97, 174, 28, 12)
    assert (len(PUMP.signals), len(PUMP.ends)) == (20, 30)
    assert [component.id for component in PUMP.components] == ["EM", "MD", "MM", "SM", "HY", "MP", "IN", "OUT", "DP"]
    assert [component.section for component in PUMP.components] == [f"A.{k}" for k in range(1, 10)]
    assert len(PUMP.groups) == 7


def test_no_entry_was_added_removed_or_weakened() -> None:
    text = (Path(__file__).parent / "frozen_pump.txt").read_text()
    frozen = {line for line in text.splitlines() if not line.startswith("#")}
    word = {True: "must", False: "may"}
    found = {f"{e.component} {HOME[e.cause]} {e.id} {word[e.certain]} {e.kind}" for e in PUMP.edges}
    found |= {f"{fault.id} {e.event} {word[e.certain]}" for fault in PUMP.faults for e in fault.effects}
    assert found == frozen


def test_every_entry_says_where_it_comes_from() -> None:
    entries = [*PUMP.faults, *PUMP.disturbances, *PUMP.edges, *PUMP.signals, *PUMP.groups, *PUMP.scenarios]
    entries += [item for fault in PUMP.faults for item in (*fault.effects, *fault.causes)]
    entries += [effect for item in PUMP.disturbances for effect in item.effects]
    assert all(entry.provenance for entry in entries)


def test_eleven_faults_in_seven_groups() -> None:
    # bearing fault and rub impact stand in two tables each: 13 entries are 11 faults
    members = [name for group in PUMP.groups for name in group.faults]
    assert len(members) == len(set(members)) == 13
    assert len({PUMP.fault(name).name.replace("motor ", "").replace("pump ", "") for name in members}) == 12


def test_scenarios_grow() -> None:
    sets = [set(PUMP.scenario(name).disturbances) for name in ("none", "D_A", "D_B", "D_C", "D_D")]
    assert [len(found) for found in sets] == [0, 7, 9, 10, 12]
    assert all(a < b for a, b in pairwise(sets))


@pytest.mark.parametrize("variant", [item.id for item in PUMP.variants])
def test_every_variant_of_the_seventh_group_can_be_chosen(variant: str) -> None:
    chosen = PUMP.choose(variant)
    assert [group.id for group in chosen.groups] == [f"G{k}" for k in range(1, 8)]
    assert chosen.groups[:6] == PUMP.groups[:6]
    assert chosen.group("G7") == next(item.group for item in PUMP.variants if item.id == variant)


def test_the_default_is_the_inlet_obstruction() -> None:
    assert PUMP.choose("inlet_obstruction") == PUMP
    assert len({item.group.faults for item in PUMP.variants}) == len(PUMP.variants) == 8


def test_incidence_is_the_tables() -> None:
    net = PUMP.incidence()
    rebuilt = {(net.events[c], net.events[e]) for c, e in zip(net.cause, net.effect, strict=True)}
    assert rebuilt == {(edge.cause, edge.effect) for edge in PUMP.edges}
    assert [EDGE_KINDS[k] for k in net.kind] == [edge.kind for edge in PUMP.edges]
    assert net.certain.tolist() == [edge.certain for edge in PUMP.edges]
    assert [net.blocks[k] for k in net.block] == [event.component for event in PUMP.events]
    assert net.blocks[-1] == OBSERVATION
    effects = {(net.faults[f], net.events[e], c) for f, e, c in zip(net.fault, net.fault_event, net.fault_certain)}  # noqa: B905
    assert effects == {(fault.id, e.event, e.certain) for fault in PUMP.faults for e in fault.effects}
    pairs = {(net.disturbances[k], net.events[e]) for k, e in zip(net.disturbance, net.disturbance_event, strict=True)}
    assert pairs == {(item.id, e.event) for item in PUMP.disturbances for e in item.effects}
    assert tuple(net.events[k] for k in net.ends) == PUMP.ends
    # only signal events are ends, and nothing follows them
    assert not np.isin(net.cause, net.ends).any()


def test_select_drop_and_weaken() -> None:
    effects = PUMP.select(kinds=("effect",))
    assert {edge.kind for edge in effects.edges} == {"effect"}
    assert len(effects.edges) == 174 - 10
    sure = PUMP.select(certain_only=True)
    assert all(edge.certain for edge in sure.edges)
    assert not any(not effect.certain for fault in sure.faults for effect in fault.effects)
    assert sure.fault("EM4").effects == ()
    noise = ["Q+ -> hf+", "Q- -> hf+"]
    assert {e.id for e in PUMP.edges} - {e.id for e in PUMP.drop(noise).edges} == set(noise)
    weak = PUMP.weaken(["Zn+ -> yZn+"])
    changed = [(a.id, a.certain, b.certain) for a, b in zip(PUMP.edges, weak.edges, strict=True) if a != b]
    assert changed == [("Zn+ -> yZn+", True, False)]


def test_progression_of_faults() -> None:
    assert {("EM1", "EM2"), ("EM1", "EM3"), ("npsh-", "HY3"), ("tsp+", "MP3")} <= set(PUMP.progressions)
    assert len(PUMP.progressions) == 13


def test_a_signal_needs_one_of_its_sets() -> None:
    assert PUMP.signal("yhf").revealed(["pin"])
    assert PUMP.signal("yhf").revealed(["dp", "I"])
    assert not PUMP.signal("yhf").revealed(["I", "V", "Q", "T", "vib"])
    assert not PUMP.signal("yrH").revealed(["I", "V", "Q"])


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: PUMP.choose("inlet"), ["variant 'inlet'", "inlet_obstruction", "blocked_rotor", "broken_shaft"]),
        (lambda: PUMP.scenario("D_E"), ["scenario 'D_E'", "D_A", "D_D"]),
        (lambda: PUMP.select(kinds=("drift", "wear")), ["'wear'", "progression"]),
        (lambda: PUMP.drop(["Q+ -> hf-"]), ["'Q+ -> hf-'", "did you mean 'Q+ -> hf+'"]),
        (lambda: PUMP.event("q+"), ["'q+'", "did you mean 'Q+'"]),
        (lambda: PUMP.fault("HY9"), ["fault 'HY9'", "HY6"]),
        (lambda: PUMP.disturbance("d_load"), ["disturbing event 'd_load'", "d_load+"]),
        (lambda: PUMP.signal("yrh"), ["signal 'yrh'", "yrH"]),
        (lambda: PUMP.group("G8"), ["group 'G8'", "G7"]),
    ],
)
def test_wrong_names_name_the_allowed_ones(call, words) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(ParameterError) as caught:
        call()
    assert all(word in str(caught.value) for word in words), caught.value


def test_events_need_their_sign() -> None:
    with pytest.raises(ParameterError, match="sign"):
        Event(id="Hi", quantity="Hi", sign="+", component="HY")
    with pytest.raises(ParameterError, match=r"Sensor 'I'.*cost"):
        Sensor(id="I", name="current", cost=float("nan"))


def test_a_system_built_in_code_is_checked() -> None:
    first = PUMP.edges[0]
    for change, word in (
        ({"edges": (*PUMP.edges, first)}, "twice"),
        ({"edges": (replace(first, effect="Te++"),)}, "Te++"),
        ({"edges": (replace(first, component="HY"),)}, "belongs to"),
        ({"edges": (replace(first, kind="wear"),)}, "wear"),
        ({"faults": (replace(PUMP.faults[0], effects=(Effect(event="Zz+", certain=True),)),)}, "Zz+"),
        ({"faults": (replace(PUMP.faults[0], component="XX"),)}, "XX"),
        ({"disturbances": (*PUMP.disturbances, PUMP.disturbances[0])}, "twice"),
        ({"sensors": PUMP.sensors[1:]}, "unknown sensor 'I'"),
        ({"groups": (*PUMP.groups, replace(PUMP.groups[0], id="G8"))}, "twice"),
    ):
        with pytest.raises(ParameterError, match=word.replace("+", r"\+")):
            replace(PUMP, **change)


def test_an_empty_system_has_empty_arrays() -> None:
    parts = ("components", "events", "faults", "disturbances", "edges", "signals", "sensors")
    net = System(name="nothing", **dict.fromkeys(parts, ())).incidence()  # type: ignore[arg-type]
    assert net.cause.shape == net.ends.shape == net.fault.shape == (0,)
    assert net.blocks == ()


def test_nearest() -> None:
    assert nearest("hi-", ["Hi-", "Hi+"]) == "did you mean 'Hi-'?"
    assert nearest("zzz", ["a", "b"]) == "there are a, b."
    assert nearest("x", []) == "there are none."
    assert Edge(cause="a+", effect="b-", component="B", certain=True).id == "a+ -> b-"
