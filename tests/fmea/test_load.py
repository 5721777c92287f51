"""Thesis 4.1.1, A.1-A.9: every mistake in a table is refused with file, entry, value and remedy."""

import shutil
from pathlib import Path

import pytest

from pumplib.errors import ParameterError
from pumplib.fmea.load import FOLDER, load_system, shipped, shipped_names
from pumplib.fmea.save import save_system


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return Path(shutil.copytree(FOLDER / "pump", tmp_path / "pump"))


def refused(folder: Path, file: str, old: str, new: str) -> str:
    """Message after one change in one file; the text to change must be there."""
    path = folder / file
    text = path.read_text(encoding="utf-8")
    assert old in text
    path.write_text(text.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(ParameterError) as caught:
        load_system(folder)
    return str(caught.value)


FAULT = 'effects = [{ event = "Tw+", certain = true, provenance = "definition" }]'
MISTAKES = {
    "unknown event in a link": ("HY.toml", '"kh+ -> Hi+"', '"kh+ -> Hii+"', ["propagation 3", "'Hii+'", "'Hi+'"]),
    "unknown event of a fault": ("HY.toml", 'event = "ql+"', 'event = "qj+"', ["fault HY2", "'qj+'", "did you mean"]),
    "missing sign": ("OUT.toml", '"ko+ -> Q-"', '"ko+ -> Q"', ["'ko+ -> Q'", "sign is missing", "Q+ or Q-"]),
    "missing signs": ("HY.toml", 'ql = { signs = "+", meaning', "ql = { meaning", ["quantities.ql", "sign is missing"]),
    "wrong signs": ("HY.toml", 'ql = { signs = "+"', 'ql = { signs = "up"', ["quantities.ql", "'up'", "'+-'"]),
    "dangling link": ("DP.toml", '"hf+ -> dpn+"', '"hf+ -> "', ["'hf+ -> '", "unknown event ''"]),
    "no arrow": ("DP.toml", '"hf+ -> dpn+"', '"hf+->dpn+"', ["'hf+->dpn+'", "spaces around the arrow"]),
    "self": ("DP.toml", '"hf+ -> dpn+"', '"hf+ -> hf+"', ["cannot raise itself"]),
    "wrong from": ("DP.toml", 'from = "HY"', 'from = "EM"', ["'Hi+ -> dp+'", "Hi+ belongs to HY", "from = 'HY'"]),
    "wrong file": ("DP.toml", '"Hi+ -> dp+"', '"Hi+ -> pout+"', ["pout+ belongs to OUT", "move the link"]),
    "unknown component": ("DP.toml", 'from = "HY"', 'from = "HX"', ["from = 'HX'", "did you mean 'HY'"]),
    "unknown kind": ("DP.toml", 'kind = "effect"', 'kind = "efect"', ["kind = 'efect'", "'effect'", "progression"]),
    "link twice": ("DP.toml", '"dpb+ -> dp-"', '"dpb+ -> dp+"', ["'dpb+ -> dp+'", "twice"]),
    "link in two blocks": (
        "DP.toml", 'must = ["hf+ -> dpn+"]', 'may = ["Hi+ -> dp+"]', ["propagation 2", "'Hi+ -> dp+'", "propagation 1"],
    ),
    "no links": ("DP.toml", 'must = ["hf+ -> dpn+"]', "", ["propagation 2", "neither must nor may"]),
    "fault id twice": ("IN.toml", 'id = "IN2"', 'id = "IN1"', ["fault IN1", "there already", "rename"]),
    "fault id in two files": ("IN.toml", 'id = "IN2"', 'id = "HY1"', ["HY1", "there already", "rename"]),
    "event twice": ("OUT.toml", "pout = {", "dp = {", ["event 'dp+'", "there already"]),
    "id is not the file": ("DP.toml", 'id = "DP"', 'id = "DQ"', ["id = 'DQ'", "'DP'"]),
    "missing provenance of a fault": (
        "DP.toml", 'provenance = "literature"\neffects', "effects",
        ["fault DP1", "provenance is missing", "assumption"],
    ),
    "missing provenance of an effect": (
        "DP.toml", ', provenance = "definition" }', " }", ["fault DP1: effects", "provenance is missing"],
    ),
    "missing provenance of a link": (
        "DP.toml", 'provenance = "text 2.3.1"\n', "", ["propagation 2", "provenance is missing"],
    ),
    "unknown provenance": ("DP.toml", '"text 2.3.1"', '"book 2.3.1"', ["'book 2.3.1'", "unknown kind 'book'"]),
    "text without place": ("DP.toml", '"text 2.3.1"', '"text somewhere"', ["'text somewhere'", "needs the place"]),
    "certain is no truth value": ("DP.toml", "certain = true", "certain = 1", ["certain = 1", "true"]),
    "missing certain": ("DP.toml", "certain = true, ", "", ["certain is missing"]),
    "no effects": ("EM.toml", FAULT, "effects = []", ["fault EM5", "effects is missing or empty"]),
    "effect twice": ("EM.toml", '{ event = "I+"', '{ event = "Zn+"', ["fault EM2", "'Zn+'", "twice"]),
    "effect is a signal": ("EM.toml", '{ event = "I+"', '{ event = "yI+"', ["fault EM2", "'yI+'", "signal event"]),
    "cause unknown": ("EM.toml", 'started_by = ["MP3"]', 'started_by = ["MP9"]', ["EM.toml", "fault EM3", "'MP9'"]),
    "unknown field": ("EM.toml", "causes = [{ text", "cause = [{ text", ["fault EM2", "'cause'", "'causes'"]),
    "missing name": ("EM.toml", 'name = "broken rotor bar"\n', "", ["fault EM4", "name is missing"]),
    "unused event": ("EM.toml", "km = {", 'kz = { signs = "+", meaning = "x" }\nkm = {', ["'kz+'", "neither raised"]),
    "bad quantity": ("EM.toml", "km = {", '"k-m" = {', ["quantities.k-m", "letters and digits"]),
    "unknown sensor": ("signals.toml", '[["pin"]]', '[["pim"]]', ["signal ypin", "'pim'", "did you mean 'pin'"]),
    "empty alternative": ("signals.toml", '[["pin"]]', "[[]]", ["signal ypin", "not empty"]),
    "no alternative": ("signals.toml", '[["pin"]]', "[]", ["signal ypin", "at least one set"]),
    "bad cost": ("signals.toml", "cost = 5.0", "cost = -5.0", ["sensor Q", "-5.0", "> 0"]),
    "signal twice": ("signals.toml", 'id = "yP"', 'id = "yI"', ["signal 'yI'", "there already"]),
    "unknown signal kind": ("signals.toml", 'kind = "slope"', 'kind = "slop"', ["signal ykin", "did you mean 'slope'"]),
    "unknown fault in a group": ("groups.toml", '["HY3"]', '["HY33"]', ["group G5", "'HY33'", "did you mean 'HY3'"]),
    "fault in two groups": ("groups.toml", '["HY3"]', '["HY4"]', ["group G6", "'HY4'", "G5"]),
    "variant takes a fault": ("groups.toml", '["MD1", "MP5"]', '["HY1"]', ["variant blocked_rotor", "'HY1'", "G3"]),
    "variant of no group": ("groups.toml", 'group = "G7"', 'group = "G9"', ["variant inlet", "'G9'", "G7"]),
    "unknown disturbance": (
        "groups.toml", '"d_unb"]', '"d_unbal"]', ["scenario D_A", "'d_unbal'", "did you mean 'd_unb'"],
    ),
    "disturbance twice": ("groups.toml", '"d_V+", "d_V-"', '"d_V+", "d_V+"', ["scenario D_A", "'d_V+'", "twice"]),
    "empty group": ("groups.toml", '["HY3"]', "[]", ["group G5", "not be empty"]),
    "component without file": ("system.toml", '"DP"]', '"DP", "XX"]', ["XX.toml", "no such file"]),
    "file without component": ("system.toml", ', "DP"]', "]", ["DP.toml", "add 'DP'"]),
    "component twice": ("system.toml", '"DP"]', '"DP", "DP"]', ["components", "'DP'", "twice"]),
    "bad component name": ("system.toml", '"DP"]', '"DP", "OBS"]', ["'OBS' cannot be the id"]),
    "no TOML": ("HY.toml", "[quantities]", "[quantities", ["HY.toml", "not readable as TOML"]),
    "list expected": ("EM.toml", "[[disturbance]]", "[disturbance]", ["EM.toml"]),
    "names expected": ("DP.toml", 'must = ["hf+ -> dpn+"]', 'must = "hf+ -> dpn+"', ["must", "list of texts"]),
}  # fmt: skip


@pytest.mark.parametrize("name", MISTAKES)
def test_mistakes_are_named(name: str, folder: Path) -> None:
    file, old, new, words = MISTAKES[name]
    message = refused(folder, file, old, new)
    assert file in message or name in ("file without component", "component without file")
    assert all(word in message for word in words), message


def test_missing_files(folder: Path) -> None:
    (folder / "signals.toml").unlink()
    with pytest.raises(ParameterError, match=r"signals\.toml: no such file"):
        load_system(folder)
    with pytest.raises(ParameterError, match="no such folder; shipped systems are pump, ship"):
        load_system(folder / "nowhere")


def test_groups_are_optional(folder: Path) -> None:
    (folder / "groups.toml").unlink()
    system = load_system(folder)
    assert system.groups == system.variants == system.scenarios == ()
    assert len(system.edges) == 174


def test_shipped() -> None:
    assert shipped_names() == ("pump", "ship")
    with pytest.raises(ParameterError, match="system 'pmp': is not shipped; allowed are pump, ship"):
        shipped("pmp")


@pytest.mark.parametrize("name", ["pump", "ship"])
def test_saved_tables_read_back_equal(name: str, tmp_path: Path) -> None:
    system = shipped(name)
    save_system(system, tmp_path / "copy")
    again = load_system(tmp_path / "copy")
    # links come back sorted by matrix; everything else keeps its order
    assert sorted(again.edges, key=lambda e: e.id) == sorted(system.edges, key=lambda e: e.id)
    for part in ("name", "description", "source", "components", "events", "faults", "disturbances", "signals",
                 "sensors", "groups", "variants", "scenarios"):  # fmt: skip
        assert getattr(again, part) == getattr(system, part), part
    first = {path.name: path.read_bytes() for path in (tmp_path / "copy").iterdir()}
    save_system(again, tmp_path / "twice")
    assert {path.name: path.read_bytes() for path in (tmp_path / "twice").iterdir()} == first


def test_saving_does_not_mix_with_other_tables(tmp_path: Path) -> None:
    save_system(shipped("ship"), tmp_path)
    with pytest.raises(ParameterError, match="not empty"):
        save_system(shipped("ship"), tmp_path)
