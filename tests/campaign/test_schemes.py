"""The schemes of chapter 2 score what the chapter's own functions say."""

import math
from dataclasses import asdict

import numpy as np
import pytest

from pumplib.campaign import limits, load_campaign, run_campaign, run_length, summarise
from pumplib.decide import arl
from pumplib.errors import ParameterError
from pumplib.primer.study import APPROACHES, score_run, set_up


def test_limits_scores_one_machine() -> None:
    settings = limits.LimitSettings(healthy=1, faulty=1, sizes=(1e10,))
    rows = limits.score(settings, np.random.default_rng([5, 0, 0]))
    assert [row["size"] for row in rows] == [0.0, 1e10]
    rng = np.random.default_rng([5, 0, 0])
    machine = set_up(int(rng.integers(2**31)))
    for row in rows:
        one = asdict(score_run(machine, row["size"], rng))
        assert row["adaptive_factor"] == one["adaptive"]
        assert row["constant_factor"] == one["constant"]
        assert [bool(row[name]) for name in APPROACHES] == list(one["alarms"])
    assert rows[1]["adaptive"] == 1
    assert limits.groups == ("size",)


def test_limits_needs_something_to_score() -> None:
    with pytest.raises(ParameterError, match="nothing would be scored"):
        limits.LimitSettings(healthy=0)
    with pytest.raises(ParameterError, match="pump"):
        limits.LimitSettings(profile="stator")  # type: ignore[arg-type]
    with pytest.raises(ParameterError, match="K_f"):
        limits.LimitSettings(sizes=(1e9, -1.0))


def test_run_lengths_agree_with_the_integral_equation() -> None:
    settings = run_length.RunLengthSettings(false_alarm_samples=200.0, shift=0.0, batch=4000)
    lengths = np.array([row["length"] for row in run_length.score(settings, np.random.default_rng(2))])
    assert abs(lengths.mean() - 200.0) < 4 * lengths.std() / math.sqrt(len(lengths))
    shifted = run_length.RunLengthSettings(false_alarm_samples=200.0, shift=1.0, batch=4000)
    delays = np.array([row["length"] for row in run_length.score(shifted, np.random.default_rng(3))])
    nu, h = run_length._design(1.0, 200.0)
    assert abs(delays.mean() - arl(nu, h, 1.0).value) < 4 * delays.std() / math.sqrt(len(delays))


def test_shipped_campaign_summarises_itself(threads, tmp_path) -> None:
    one = load_campaign("cusum_run_length")
    done = run_campaign(one, threads, runs_scale=0.02, build=tmp_path)
    rows = summarise(one, done.table.parent)["means"]
    assert [row["cell"] for row in rows] == [cell.name for cell in one.cells]
    assert rows[0]["exact"] == pytest.approx(1e4, rel=1e-6)
    # within three widths of its interval, twelve standard errors: a gross fault only, the test above is the sharp one
    for row in rows:
        assert abs(row["mean"] - row["exact"]) < 3 * (row["high"] - row["low"])
