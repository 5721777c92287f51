"""The study of thresholds: equal detection means equal, scored runs are not training runs, numbers are committed."""

import json

import numpy as np
import pytest

from pumplib.errors import DataError, ParameterError
from pumplib.primer import (
    APPROACHES,
    Machine,
    Scored,
    alarm_counts,
    compare,
    false_alarm_rows,
    load_study,
    rates,
    score_run,
    smallest_detected,
    threshold_study,
)
from pumplib.primer.study import RESULT, stored


def one(size: float, adaptive: float, constant: float) -> Scored:
    return Scored(size=size, adaptive=adaptive, constant=constant, alarms=(False,) * len(APPROACHES))


def test_comparison_by_hand() -> None:
    healthy = [one(0.0, a, c) for a, c in ((0.5, 0.9), (0.6, 1.3), (1.1, 2.0), (0.2, 1.5))]
    faulty = [one(1.0, a, c) for a, c in ((2.0, 3.0), (1.5, 1.4), (0.9, 1.2))]
    found = compare(healthy + faulty, 1.0)
    # the adaptive threshold finds two of three; the constant one may rise to 1.4, where two healthy runs are above
    assert (found.detected, found.adaptive, found.constant) == (2, 1, 2)
    assert found.factor == pytest.approx(1.4)
    assert found.ratio == 2.0


def test_no_false_alarm_counts_as_one_in_the_ratio() -> None:
    found = compare([one(0.0, 0.1, 5.0), one(1.0, 2.0, 3.0)], 1.0)
    assert (found.adaptive, found.constant, found.ratio) == (0, 1, 1.0)


def test_nothing_detected_needs_no_false_alarm() -> None:
    found = compare([one(0.0, 0.1, 5.0), one(1.0, 0.5, 3.0)], 1.0)
    assert (found.detected, found.constant) == (0, 0)


def test_smallest_detected() -> None:
    runs = [one(1.0, 0.9, 1.0), one(1.0, 1.1, 1.0), one(2.0, 1.2, 1.0), one(2.0, 1.2, 1.0)]
    assert smallest_detected(runs) == 2.0
    assert smallest_detected(runs, 0.5) == 1.0
    with pytest.raises(ParameterError, match="larger"):
        smallest_detected(runs[:2])


def test_a_scored_run_agrees_with_the_outcomes(machine: Machine) -> None:
    found = score_run(machine, 1e10, np.random.default_rng(9))
    named = dict(zip(APPROACHES, found.alarms, strict=True))
    assert named["adaptive"] == (found.adaptive > 1)
    assert named["constant"] == (found.constant > 1)
    assert named["adaptive"]
    assert found == score_run(machine, 1e10, np.random.default_rng(9))


def test_committed_study() -> None:
    study = load_study()
    claim = json.loads(RESULT.read_text(encoding="utf-8"))["claims"]["ch2.constant_threshold_fails"]
    found = compare(study.scored, study.size)
    assert claim["value"] == pytest.approx(found.ratio, rel=1e-3)
    assert claim["n"] == found.healthy == 200
    counts = {size: (n, hits) for size, n, hits in alarm_counts(study.scored)}
    assert counts[0.0][1][APPROACHES.index("adaptive")] == found.adaptive
    assert len(rates(alarm_counts(study.scored))) == len(study.sizes) + 1
    assert false_alarm_rows([found])[0]["false alarms, constant"].startswith(f"{found.constant} of 200  (")


def test_bad_input(machine: Machine, tmp_path) -> None:
    with pytest.raises(ParameterError, match="machines"):
        threshold_study(seed=1, machines=0, healthy=1, faulty=1, sizes=(1e10,))
    with pytest.raises(ParameterError, match="size"):
        score_run(machine, -1.0, np.random.default_rng(1))
    with pytest.raises(ParameterError, match="needs both"):
        compare([one(0.0, 1.0, 1.0)], 1.0)
    with pytest.raises(DataError, match="primer_study"):
        load_study(tmp_path / "absent.json")
    (tmp_path / "x.json").write_text("{}")
    with pytest.raises(DataError, match="not a result"):
        load_study(tmp_path / "x.json")
    with pytest.raises(ParameterError, match="machines 0 to"):
        load_study().again(number=999)
    assert stored([one(1.0, 2.0, 3.0)]) == [[1.0, 2.0, 3.0, "00000"]]
