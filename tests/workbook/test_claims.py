"""The ledger: the required claims are unchanged, a miss is a miss, and nothing wrong passes unseen."""

import hashlib
import json
import math
import tomllib
from pathlib import Path

import numpy as np
import pytest

from pumplib.errors import ClaimError
from pumplib.workbook.claims import (
    Claim,
    Measurement,
    judge,
    load_claims,
    measure,
)
from pumplib.workbook.collect import collect, load_measured
from pumplib.workbook.layout import Layout

# SHA-256 of the required claims as given to the project, fields and claims sorted by name.
REQUIRED = "3a4ab7a3c9a66041c4cb1744faef685d2771152cd36a00545dc328c445e2b01e"
REQUIRED_COUNT = 80
GIVEN_FIELDS = {
    *("id", "chapter", "class", "statement", "metric"),
    *("op", "bound", "unit", "profile", "n", "level"),
}


def make(op: str = "<=", bound: object = 1.0, **more: object) -> Claim:
    fields = {
        **dict(id="ch1.a", chapter=1, kind="beyond", statement="s", metric="m", unit="-"),
        **dict(level="required", section="1.1", thesis="t", why="w", source="notebook:01_one"),
    }
    return Claim(**{**fields, **more}, op=op, bound=bound)  # type: ignore[arg-type]


def required_hash(entries: list[dict]) -> str:
    content = [[[key, entry[key]] for key in sorted(entry)] for entry in sorted(entries, key=lambda e: e["id"])]
    return hashlib.sha256(json.dumps(content, ensure_ascii=False).encode()).hexdigest()


def given_entries() -> list[dict]:
    """The first claims of the file, reduced to the fields that were given."""
    entries = tomllib.loads(Layout().ledger.read_text(encoding="utf-8"))["claim"][:REQUIRED_COUNT]
    return [{key: value for key, value in entry.items() if key in GIVEN_FIELDS} for entry in entries]


def test_required_claims_are_unchanged():
    assert required_hash(given_entries()) == REQUIRED


def test_a_changed_bound_is_noticed():
    entries = given_entries()
    entries[0]["bound"] = [0.8, 1.2]
    assert required_hash(entries) != REQUIRED


def test_the_committed_ledger_is_valid():
    ledger = load_claims()
    assert len(ledger) > REQUIRED_COUNT
    assert {claim.level for claim in ledger.values()} == {"required", "stretch"}
    # What we add must not weaken the list: no own claim of a class that the text would have to state.
    for claim in list(ledger.values())[REQUIRED_COUNT:]:
        if claim.kind == "replicated":
            assert claim.thesis != "not in the surviving text", claim.id


@pytest.mark.parametrize(
    ("op", "bound", "value", "verdict"),
    [
        ("<=", 1.0, 1.0, "holds"),
        ("<=", 1.0, 1.0000001, "fails"),
        (">=", 5, 5, "holds"),
        (">=", 5, 4, "fails"),
        ("==", 0, 0, "holds"),
        ("==", 0, 1, "fails"),
        ("within", (0.9, 1.1), 1.1, "holds"),
        ("within", (0.9, 1.1), 0.8999, "fails"),
        ("==", (5, 4, 6), [5, 4, 6], "holds"),
        ("==", (5, 4, 6), [5, 6, 4], "fails"),
        ("<=", (1.05, 1.1), np.array([1.0, 1.1]), "holds"),
        ("<=", (1.05, 1.1), (1.06, 1.0), "fails"),
        ("<=", 1.0, np.float64(0.5), "holds"),
        ("==", 13, np.int64(13), "holds"),
    ],
)
def test_judge(op, bound, value, verdict):
    assert judge(make(op, bound), value) == verdict


@pytest.mark.parametrize(
    ("bound", "value"),
    [
        (1.0, math.nan),
        (1.0, math.inf),
        (1.0, np.float64("nan")),
        (1.0, "0.5"),
        (1.0, None),
        (1.0, True),
        (1.0, np.bool_(True)),
        (1.0, [0.5]),
        (1.0, []),
        ((1.0, 2.0), 0.5),
        ((1.0, 2.0), [0.5]),
        ((1.0, 2.0), [0.5, math.nan]),
        ((1.0, 2.0), [0.5, 0.5, 0.5]),
        (1.0, 1 + 0j),
    ],
)
def test_judge_refuses_what_is_not_a_value(bound, value):
    with pytest.raises(ClaimError, match=r"ch1\.a"):
        judge(make("<=", bound), value)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({'class = "beyond"': 'class = "proven"'}, ["class", "proven", "beyond"]),
        ({'op = "<="': 'op = "<"'}, ["op", "'<'", "within"]),
        ({'level = "required"': 'level = "nice"'}, ["level", "nice", "stretch"]),
        ({'why = "w"': ""}, ["missing why"]),
        ({'why = "w"': 'why = " "'}, ["why", "not empty"]),
        ({'why = "w"': 'why = "w"\nreason = "x"'}, ["unknown field reason"]),
        ({"bound = 1.0": "bound = true"}, ["bound", "True"]),
        ({"bound = 1.0": "bound = nan"}, ["bound", "nan"]),
        ({"chapter = 1": 'chapter = "1"'}, ["chapter", "'1'"]),
        ({'op = "<="': 'op = "within"'}, ["bound", "lower"]),
        ({"notebook:01_one": "notebook"}, ["source", "measured"]),
        ({"chapter = 1": "chapter = 1\nn = 0"}, ["n = 0"]),
    ],
)
def test_a_wrong_ledger_names_claim_and_field(tmp_path, claim, change, words):
    text = claim()
    for old, new in change.items():
        assert old in text
        text = text.replace(old, new)
    path = tmp_path / "claims.toml"
    path.write_text(text)
    with pytest.raises(ClaimError) as error:
        load_claims(path)
    for word in ["ch1.a", *words]:
        assert word in str(error.value)


def test_a_repeated_id_is_refused(tmp_path, claim):
    path = tmp_path / "claims.toml"
    path.write_text(claim() + claim())
    with pytest.raises(ClaimError, match="twice"):
        load_claims(path)


def test_clopper_pearson_interval():
    # Exact limits for 0 of 100: 0 and 1 - 0.025^(1/100).
    low, high = Measurement(id="x", value=0, n=100, successes=0).interval
    assert low == 0
    assert high == pytest.approx(1 - 0.025**0.01, rel=1e-12)
    assert Measurement(id="x", value=0.5, n=100).interval is None


@pytest.mark.parametrize(
    ("value", "n", "successes", "words"),
    [
        (0.5, None, None, "at least 100"),
        (0.5, 0, None, "n = 0"),
        (0.5, 100, 101, "successes = 101"),
        (0.5, 100, 49, "neither"),
        (0.5, 100.5, None, "whole"),
        (0.5, True, None, "whole"),
    ],
)
def test_runs_must_fit_the_value(value, n, successes, words):
    with pytest.raises(ClaimError, match=words):
        measure(make(">=", 0.4, n=100), value, n, successes)


def test_a_failing_metric_gives_a_failing_claim():
    ledger = {"ch1.a": make("<=", 1.0)}
    for value, verdict in ((0.9, "holds"), (1.1, "fails")):
        (row,) = collect(ledger, {"01_one": [measure(ledger["ch1.a"], value)]})
        assert row["verdict"] == verdict
        assert row["value"] == value


def test_too_few_runs_are_not_a_result():
    ledger = {"ch1.a": make(">=", 0.9, n=1000)}
    (row,) = collect(ledger, {"01_one": [measure(ledger["ch1.a"], 1.0, 50, 50)]})
    assert row["verdict"] == "not run"
    assert "n = 50 of 1000" in row["note"]


def test_claims_of_absent_notebooks_are_not_run():
    (row,) = collect({"ch1.a": make()}, {}, reasons={"01_one": "was skipped: no data"})
    assert (row["verdict"], row["value"]) == ("not run", None)
    assert "no data" in row["note"]


def test_collect_names_everything_recorded_wrongly():
    ledger = {name: make(id=name) for name in ("ch1.a", "ch1.b", "ch1.c")}
    ledger["ch1.m"] = make(id="ch1.m", source="measured")
    values = [Measurement(id=name, value=1.0) for name in ("ch1.a", "ch1.a", "ch9.z", "ch1.m")]
    with pytest.raises(ClaimError) as error:
        collect(ledger, {"01_one": values})
    text = str(error.value)
    assert "ch1.a: recorded twice" in text
    assert "ch9.z: unknown" in text
    assert "ch1.m: recorded by notebook 01_one, but its source is measured" in text
    assert "ch1.b: not recorded" in text
    assert "ch1.c: not recorded" in text


def measured_file(folder: Path, name: str = "speed.json", **change: object) -> None:
    content = {
        **dict(date="2026-01-31", machine="m", versions={"numpy": "2"}, seed=0),
        "claims": {"ch1.m": {"value": 0.5, "n": 3, "note": "median of 3"}},
    }
    content = {key: value for key, value in {**content, **change}.items() if value is not None}
    (folder / name).write_text(json.dumps(content))


def test_measured_values_come_from_dated_files(tmp_path):
    ledger = {"ch1.m": make(id="ch1.m", source="measured")}
    measured_file(tmp_path)
    (row,) = collect(ledger, {}, load_measured(tmp_path, ledger))
    assert (row["verdict"], row["value"], row["note"]) == ("holds", 0.5, "median of 3")
    assert row["origin"] == "speed.json, 2026-01-31"
    (row,) = collect(ledger, {}, {})
    assert row["verdict"] == "not run"


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"machine": None}, "missing machine"),
        ({"seed": None, "date": None}, "missing date, seed"),
        ({"date": "yesterday"}, "YYYY-MM-DD"),
        ({"claims": {"ch1.x": {"value": 1}}}, "unknown claim id"),
        ({"claims": {"ch1.a": {"value": 1}}}, "recorded by notebook"),
        ({"claims": {"ch1.m": {"n": 1}}}, "needs value"),
        ({"claims": {"ch1.m": {"value": 1, "speed": 2}}}, "needs value"),
        ({"claims": {"ch1.m": {"value": "fast"}}}, "not|record a number"),
    ],
)
def test_a_wrong_measured_file_is_refused(tmp_path, change, words):
    ledger = {"ch1.a": make(), "ch1.m": make(id="ch1.m", source="measured")}
    measured_file(tmp_path, **change)
    with pytest.raises(ClaimError, match=words):
        load_measured(tmp_path, ledger)


def test_two_measured_files_with_one_claim_are_refused(tmp_path):
    ledger = {"ch1.m": make(id="ch1.m", source="measured")}
    measured_file(tmp_path)
    measured_file(tmp_path, "again.json")
    with pytest.raises(ClaimError, match="keep one"):
        load_measured(tmp_path, ledger)


def test_the_committed_measured_files_are_valid():
    load_measured(Layout().measured, load_claims())
