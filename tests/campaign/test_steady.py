"""The steady-state scheme of the campaigns: rows, repeatability, tables."""

from dataclasses import replace
from typing import ClassVar

import numpy as np
import pandas as pd
import pytest

from pumplib.campaign import steady, steady_summary
from pumplib.campaign.schemes import load_scheme, scheme_path
from pumplib.campaign.spec import load_campaign
from pumplib.errors import DataError, ParameterError
from pumplib.steady.bench_monitor import Points, SteadyMonitor
from pumplib.steady.windows import Verdict


@pytest.fixture(scope="module")
def rows():
    """Rows of one machine, taught on one further run to save time."""
    chosen = steady.SteadyCampaign(healthy=1, faults=("leakage:2.4e-7", "outlet_leak:0"), faulty=1)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(steady, "TAUGHT", 1)
        return steady.score(chosen, np.random.default_rng(77)), steady.score(chosen, np.random.default_rng(77))


def test_the_scheme_is_registered_and_the_campaigns_hold_the_sizes_of_the_claims():
    assert load_scheme(scheme_path("steady")) is steady
    campaign = load_campaign("steady_pump")
    runs = {}
    for cell in campaign.cells:
        for text in cell.settings.faults:
            kind, size = text.split(":")
            runs[kind, float(size)] = runs.get((kind, float(size)), 0) + cell.runs * cell.settings.faulty
    for sizes in (steady_summary.SINGLE, steady_summary.WINDOW):
        assert all(runs[one] >= 200 for one in sizes.items())
    assert sum(runs[one] for one in steady_summary.NAMED.items()) >= 500
    assert sum(runs[one] for one in steady_summary.UNIQUE.items()) >= 150
    assert runs["clogging", 2e10] >= 50
    assert sum(cell.runs * cell.settings.healthy for cell in campaign.cells) >= 200
    assert load_campaign("steady_pump_slow").cells[0].settings.ramp == 10.0


def test_settings_are_checked():
    with pytest.raises(ParameterError, match="kind:size"):
        steady.SteadyCampaign(faults=("leakage",))
    with pytest.raises(ParameterError, match="profile"):
        steady.SteadyCampaign(profile="pump_hot")


def test_rows_have_the_same_columns_and_come_out_the_same_again(rows):
    first, again = rows
    assert [list(row) for row in first] == [list(first[0])] * 3
    assert first == again
    values = [x for row in first for x in row.values()]
    # a campaign's table refuses these
    assert all(isinstance(x, int | float | str | None) and x != "" for x in values)
    assert all(np.isfinite(x) for x in values if isinstance(x, float))


def test_rows_tell_the_truth_from_what_was_said(rows):
    healthy, leak, nothing = rows[0]
    assert (healthy["fault"], healthy["onset"], healthy["truth_in"], healthy["possible"]) == ("none", None, None, None)
    assert healthy["single_false"] == healthy["window_false"] == healthy["strict_false"] == 0
    assert healthy["moving_false"] == 1
    assert leak["window_found"] == leak["strict_found"] == leak["truth_in"] == leak["size_in"] == 1
    assert (leak["signs_class"], leak["signs_right"]) == ("K_l", 1)
    assert 0 < leak["window_delay"] <= leak["unique_delay"]
    assert leak["size_low"] <= 2.4e-7 <= leak["size_high"]
    assert leak["points_after"] < leak["points"]
    assert 180 < leak["first_omega_e"] < 320
    assert 0 < leak["first_Q"] < 2.5e-3
    assert leak["first_single"] == leak["first_window"] == 1
    assert healthy["first_Q"] is None
    assert healthy["first_single"] is None
    # a leak of no size beyond the pump changes nothing
    assert nothing["window_found"] == nothing["window_false"] == 0
    assert nothing["signs_right"] == 0


def test_an_alarm_before_the_fault_makes_its_class_worthless(monkeypatch):
    """The answers after a false alarm count as none."""

    class Said:
        points = Points(
            start=np.array([0.0, 8.0]), t=np.array([1.0, 9.0]), signals={n: np.ones(2) for n in ("omega_e", "Q")}
        )
        signs, signs_at, tested, single_at, possible = "K_l", 9.0, 3, 9.0, ("K_l",)
        verdicts: ClassVar = {"K_l": Verdict(name="K_l", possible=True, margin=-0.5, proven=-0.5, size=(5e-8, 7e-8))}

        def alarms(self, method):
            return np.array([1.0, 9.0])

    class Monitor:
        margin = (0.0, 0.0)

        def judge(self, slow, sizes=True):
            return Said()

        def moving_alarm(self, slow, until):
            return False

    fault = steady.Fault(kind="leakage", size=6e-8, onset=5.0)
    row = steady.row_of(Monitor(), None, None, fault)
    before = steady.row_of(Monitor(), None, None, replace(fault, onset=0.5))
    assert (before["window_false"], before["signs_class"], before["signs_right"]) == (0, "K_l", 1)
    # tested, and nothing was left over
    monkeypatch.setattr(Said, "possible", ())
    outside = steady.row_of(Monitor(), None, None, replace(fault, onset=0.5))
    assert (outside["possible"], outside["truth_in"], outside["unique"], outside["tested"]) == ("outside", 0, 0, 3)
    assert row["window_false"] == row["window_found"] == 1
    assert row["window_delay"] == pytest.approx(4.0)
    assert (row["signs_class"], row["signs_right"], row["tested"], row["possible"]) == (None, 0, 0, None)
    assert (row["truth_in"], row["unique"]) == (None, 0)
    # a healthy commissioning run that has no explanation without a margin is a false alarm of the strict method
    assert (row["strict_false"], row["strict_found"]) == (1, 0)


def test_strict_monitor_is_the_taught_one_where_no_margin_is_needed(monkeypatch):
    made = SteadyMonitor.__new__(SteadyMonitor)
    made.margin = (0.0, 0.0)
    monkeypatch.setattr(steady, "commission", lambda slow, stated: made)
    monkeypatch.setattr(steady, "teach", lambda first, slow: first)
    assert steady.monitors([None]) == (made, made)
    made.margin = (0.0, 1e-3)
    assert steady.monitors([None]) == (made, None)


def table_of(*rows):
    base = {
        "run": 0, "onset": 15.0, "signs_class": None, "signs_right": 0, "signs_delay": None, "tested": 4,
        "possible": "K_f", "cell": "a", "truth_in": 1.0, "unique": 0, "unique_delay": None,
        "size_low": 0.5e10, "size_high": 1.5e10, "size_in": 1.0,
        **{f"{m}_{k}": v for m in ("plain", "single", "window", "strict") for k, v in
           (("false", 0), ("found", 1), ("delay", 2.0))},
    }  # fmt: skip
    return pd.DataFrame([base | {"fault": "clogging", "size": 1e10} | row for row in rows])


TABLE = table_of(
    {"unique": 1, "unique_delay": 5.0, "signs_class": "K_f", "signs_right": 1},
    {"run": 1, "single_found": 0, "single_delay": None, "possible": "K_f|K_l"},
    {"run": 1, "tested": 0, "truth_in": None, "size_in": None, "size_low": None, "size_high": None, "possible": None},
    {"fault": "leakage", "size": 6e-8, "signs_class": "K_f", "single_delay": 4.0, "size_low": 3e-8, "size_high": 9e-8},
    {"fault": "none", "size": 0.0, "window_false": 1, "window_found": 0, "truth_in": None},
    {"fault": "none", "size": 0.0, "run": 1, "window_found": 0, "truth_in": None},
)


def test_shares_leave_out_runs_without_a_value_and_take_the_worst_fault():
    sizes = {"clogging": 1e10, "leakage": 6e-8}
    assert steady_summary.share(TABLE, "truth_in", sizes) == (1.0, 3, 3)
    assert steady_summary.smallest_rate(TABLE, "single", sizes) == (pytest.approx(2 / 3), 4)
    assert steady_summary.smallest_share(TABLE, "signs_right", sizes) == (0.0, 4)
    with pytest.raises(DataError, match="clogging 2e\\+10"):
        steady_summary.share(TABLE, "unique", {"clogging": 2e10})
    with pytest.raises(DataError, match="no value"):
        steady_summary.share(TABLE, "truth_in", {"none": 0.0})


def test_table_of_hypotheses():
    clog, leak = steady_summary.hypotheses(TABLE)
    assert (clog["fault"], clog["runs"], clog["tested"]) == ("clogging", 3, 2)
    assert clog["unique"] == pytest.approx(1 / 3)
    assert clog["answers"] == 1.5
    assert clog["width"] == pytest.approx(1.0)
    assert steady_summary.hypotheses(table_of({"possible": "outside"}))[0]["answers"] == 0.0
    assert (clog["delay"], leak["delay"]) == (5.0, None)
    with pytest.raises(DataError, match="no run with a fault"):
        steady_summary.hypotheses(TABLE[TABLE["fault"] == "none"])


def test_confusion_of_the_signs_counts_every_run_once():
    faults, statements, counts = steady_summary.confusion(TABLE, {"clogging": 1e10, "leakage": 6e-8})
    assert faults == ("clogging", "leakage")
    assert counts.sum(axis=1).tolist() == [3, 1]
    at = dict(zip(statements, counts.T.tolist(), strict=True))
    assert at["K_f"] == [1, 1]
    assert at["no alarm"] == [1, 0]
    assert at["not said"] == [1, 0]


def test_first_points_by_operating_point():
    table = table_of(
        {"first_omega_e": 200.0, "first_Q": 1e-3, "first_single": 0},
        {"first_omega_e": 200.0, "first_Q": 1e-3, "first_single": 1},
        {"first_omega_e": 300.0, "first_Q": 2e-3, "first_single": 1},
        {"first_omega_e": None, "first_Q": None, "first_single": None},
    )
    found = steady_summary.by_operating_point(table, "single", {"clogging": 1e10})
    assert [(one["speed"], one["flow"], one["runs"], one["rate"]) for one in found] == [
        ("low", "low", 2, 0.5), ("low", "high", 0, None), ("high", "low", 0, None), ("high", "high", 1, 1.0),
    ]  # fmt: skip


def test_both_chapters_side_by_side_at_common_sizes():
    other = TABLE.rename(columns=lambda name: name.replace("window", "observers"))
    other = pd.concat([other[other["fault"] != "leakage"], other[other["fault"] == "leakage"].assign(size=3e-8)])
    lines = steady_summary.beside(TABLE, other, ("window",), ("observers",))
    assert [(line["fault"], line["size"]) for line in lines] == [("none", 0.0), ("clogging", 1e10)]
    assert lines[0]["window_rate"] == lines[0]["observers_rate"] == 0.5
    assert lines[1]["window_rate"] == 1.0
    assert lines[1]["observers_delay"] == 2.0
