"""Summaries of stored rows: confusion, correct groups, false alarms, detection sizes."""

import numpy as np
import pandas as pd
import pytest

from pumplib.campaign import load_campaign
from pumplib.campaign.events import DISTURBANCES, GROUP, parse_fault
from pumplib.campaign.events_summary import by_disturbance, confusion, correct_group, detection_sizes, false_alarms
from pumplib.campaign.rates import clopper_pearson
from pumplib.errors import DataError


def row(cell, run, fault, size, acted, disturbance="none", detected=1, false=0):
    group = GROUP.get(fault, "none")
    return {
        "cell": cell, "run": run, "fault": fault, "size": size, "group": group, "acted": acted, "detected": detected,
        "correct": int(acted == group and not false), "false_alarm": false, "disturbance": disturbance,
    }  # fmt: skip


@pytest.fixture
def table():
    rows = [
        row("claim", k % 4, "none", 0.0, "none", detected=0, disturbance=list(DISTURBANCES)[k % 4]) for k in range(8)
    ]
    rows += [row("claim", k % 4, "clogging", 2e10, "G3" if k else "ambiguous") for k in range(10)]
    rows += [row("claim", k % 4, "rub", 5e-4, "G2", "supply step") for k in range(5)]
    rows += [row("ladder", k, "clogging", 5e9, "none", detected=int(k < 2)) for k in range(20)]
    rows += [row("ladder", k, "clogging", 1e10, "G3") for k in range(20)]
    return pd.DataFrame(rows)


def test_confusion(table):
    c = confusion(table)
    assert c.truths == ("none", "G2", "G3")
    assert c.verdicts == ("none", "G2", "G3", "ambiguous")
    assert c.counts.tolist() == [[8, 0, 0, 0], [0, 5, 0, 0], [0, 0, 9, 1]]
    assert confusion(table, disturbance="supply step").counts.sum() == 7
    assert confusion(table, cell=None).counts.sum() == len(table)
    with pytest.raises(DataError, match="storm"):
        confusion(table, disturbance="storm")
    with pytest.raises(DataError, match="acted"):
        confusion(table.drop(columns="acted"))
    with pytest.raises(DataError, match="G9"):
        confusion(table.assign(acted="G9"))


def test_rates(table):
    rows = correct_group(table)
    assert [(one["group"], one["fault"], one["n"], one["runs"]) for one in rows] == [
        ("G3", "clogging", 10, 9), ("G2", "rub", 5, 5), ("all", "all", 15, 14),
    ]  # fmt: skip
    assert rows[0]["low"] < 0.9 < rows[0]["high"]
    # all runs of four machines right: as safe as four independent runs
    assert rows[1]["low"] == pytest.approx(clopper_pearson(4, 4).low)
    false = false_alarms(table)
    assert false[-1]["disturbance"] == "all"
    assert false[-1]["n"] == 8
    assert false[-1]["runs"] == 0
    assert {one["disturbance"] for one in false} == {*DISTURBANCES, "all"}
    assert [(one["group"], one["disturbance"]) for one in by_disturbance(table)] == [
        ("G3", "none"), ("G2", "supply step"), ("all", "all"),
    ]  # fmt: skip


def test_detection_sizes(table):
    found = detection_sizes(table)["clogging"]
    # from 0.1 at 5e9 to 1 at 1e10, straight over the logarithm
    assert found.size == pytest.approx(5e9 * 2 ** (0.8 / 0.9))
    assert found.low <= found.size <= found.high


def test_stored_campaign_is_planned_for_the_claims():
    campaign = load_campaign("events_logic")
    of = {cell.name: cell for cell in campaign.cells}
    claim, ladder = of["claim"], of["ladder"]
    assert claim.runs * claim.settings.healthy >= 200
    groups = [GROUP[parse_fault(text)[0]] for text in claim.settings.faults]
    runs = {group: claim.runs * claim.settings.faulty * groups.count(group) for group in groups}
    assert set(runs) == {f"G{k}" for k in range(1, 7)}
    assert min(runs.values()) >= 100
    assert sum(runs.values()) >= 600
    # the ladder goes up in factors of two, and every fault of the claim is on it
    sizes = {}
    for text in ladder.settings.faults:
        kind, fault = parse_fault(text)
        sizes.setdefault(kind, []).append(fault.size)
    for text in claim.settings.faults:
        kind, fault = parse_fault(text)
        steps = np.array(sizes[kind])
        assert (np.diff(steps) > 0).all()
        assert fault.size <= 2.0 * steps[-1]
        if kind != "dry_running":
            assert np.allclose(steps[1:] / steps[:-1], 2.0)
