"""A folder in, scores out: made-up folders, and the measured runs where they are present."""

import math
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
import pytest

from pumplib import datasets
from pumplib.errors import DataError, ParameterError
from pumplib.monitor.skab import FLOW, LABELS, SENSORS, TIME, TRAIN_ROWS, find_healthy, read_folder, read_healthy
from pumplib.monitor.skab_flow import BandSettings, FlowBand, always_alarm, clock_alarm, flow_alarms, learn_band
from pumplib.monitor.skab_leaderboard import read_leaderboard
from pumplib.monitor.skab_score import (
    ALL,
    ALWAYS,
    CLOCK,
    RESIDUAL,
    best_and_worst,
    score_folder,
    score_runs,
    sensor_information,
    sweep_band,
)

START = datetime(2020, 3, 9, 10, 14, 33)
ROWS, BAD = 1100, slice(600, 900)


def write_run(path: Path, factor: float, level: float = 40.0, *, seed: int = 1, labels: bool = True, n: int = ROWS):
    """Noisy flow, times a factor in the rows that are labelled as anomaly; a healthy record drifts as well."""
    rng = np.random.default_rng(seed)
    sensors = {name: 5 + 0.01 * rng.standard_normal(n) for name in SENSORS}
    sensors[FLOW] = level * (1 + 0.004 * rng.standard_normal(n))
    sensors[FLOW][BAD] *= factor
    if not labels:
        sensors[FLOW] *= 1 + 4e-4 * np.cumsum(rng.standard_normal(n))
    anomaly, change = np.zeros(n), np.zeros(n)
    anomaly[BAD], change[[BAD.start, BAD.stop]] = 1, 1
    lines = [";".join([TIME, *SENSORS, *(LABELS if labels else ())])]
    for k in range(n):
        cells = [str(START + timedelta(seconds=k)), *(f"{sensors[name][k]:.6g}" for name in SENSORS)]
        lines.append(";".join(cells + ([str(anomaly[k]), str(change[k])] if labels else [])))
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    where = tmp_path_factory.mktemp("skab")
    write_run(where / "anomaly-free.csv", 1.0, 125.0, seed=9, labels=False, n=4000)
    write_run(where / "seen" / "1.csv", 0.9, seed=2)
    write_run(where / "seen" / "2.csv", 1.1, 80.0, seed=3)
    write_run(where / "hidden" / "1.csv", 1.0, seed=4)  # the anomaly does not reach the flow
    return where


def test_a_folder_gives_scores_of_each_group_with_the_baselines_beside(folder: Path) -> None:
    score = score_folder(folder)
    assert list(score.scores) == [RESIDUAL, ALWAYS, CLOCK]
    assert list(score.groups) == ["hidden", "seen", ALL]
    assert [score.groups[g].files for g in score.groups] == [1, 2, 3]
    assert score.groups["seen"].f1 > 0.97
    assert score.groups["seen"].mar < 0.02
    assert score.groups["seen"].far < score.band.averaging / 400  # the mean leaves a step late
    assert score.groups["seen"].changes.missed == 0
    assert score.groups["seen"].delay < score.band.averaging
    assert score.groups["hidden"].mar > 0.8
    assert score.overall.counts.rows == 3 * (ROWS - TRAIN_ROWS)
    share = 300 / (ROWS - TRAIN_ROWS)
    assert score.scores[ALWAYS][ALL].f1 == pytest.approx(2 * share / (1 + share))
    assert (score.scores[ALWAYS][ALL].far, score.scores[ALWAYS][ALL].mar) == (1.0, 0.0)
    assert score.learned is not None
    assert score.learned.source.endswith("anomaly-free")


def test_the_table_has_a_line_for_each_detector_and_group(folder: Path) -> None:
    score = score_folder(folder)
    lines = score.table()
    assert [(line["detector"], line["group"]) for line in lines] == [
        (name, group) for name in (RESIDUAL, ALWAYS, CLOCK) for group in ("hidden", "seen", ALL)
    ]
    assert lines[2]["F1"] == round(score.overall.f1, 3)
    assert lines[2]["FAR %"] == round(100 * score.overall.far, 2)


def test_a_further_file_changes_only_what_it_should(folder: Path, tmp_path: Path) -> None:
    before = score_folder(folder)
    write_run(tmp_path / "extra" / "7.csv", 0.9, seed=7)
    after = score_folder(tmp_path, healthy=folder / "anomaly-free.csv")
    assert after.band == before.band
    assert list(after.groups) == ["extra", ALL]
    assert score_folder(tmp_path, band=before.band).scores == after.scores
    assert score_folder(tmp_path, band=before.band).learned is None
    flat = score_folder(tmp_path / "extra", band=before.band)
    assert flat.groups["extra"].counts == after.groups["extra"].counts


def test_the_band_knows_nothing_of_the_runs_or_their_labels(folder: Path) -> None:
    alone = learn_band(read_healthy(find_healthy(folder)))
    assert score_folder(folder).band == alone.band


def test_settings_reach_the_band(folder: Path) -> None:
    assert score_folder(folder, half_width=0.05, averaging=4.0).band == FlowBand(half_width=0.05, averaging=4.0)
    wide = score_folder(folder, settings=BandSettings(margin=2.0))
    assert wide.band.half_width == 2 * score_folder(folder).band.half_width
    assert score_folder(folder, window=1.0).groups["seen"].changes.missed > 0


def test_training_rows_with_anomalies_are_reported(tmp_path: Path) -> None:
    path = write_run(tmp_path / "g" / "1.csv", 0.9)
    lines = path.read_text().splitlines()
    for k in range(101, 111):
        cells = lines[k].split(";")
        cells[-2] = "1.0"
        lines[k] = ";".join(cells)
    path.write_text("\n".join(lines) + "\n")
    score = score_folder(tmp_path, band=FlowBand(half_width=0.02, averaging=5.0))
    assert score.overall.tainted == 10
    assert score.overall.counts.rows == ROWS - TRAIN_ROWS


def test_a_wider_set_has_fewer_alarms_and_the_sweep_agrees_with_the_score(folder: Path) -> None:
    score = score_folder(folder)
    widths = np.array([0.3, 0.6, 1.0, 2.0, 0.5 / score.band.half_width]) * score.band.half_width
    sweep = sweep_band(score.runs, widths, score.band.averaging)
    assert list(sweep) == ["hidden", "seen", ALL]
    assert sweep[ALL][2] == score.overall.counts
    assert np.all(np.diff([c.fp + c.tp for c in sweep[ALL]]) <= 0)
    assert sweep[ALL][-1].tp == 0


def test_sensors_are_ranked_by_what_they_tell(folder: Path) -> None:
    runs = [run for run in read_folder(folder) if run.group == "seen"]
    found = sensor_information(runs, 5.0)
    assert next(iter(found)) == FLOW
    assert found[FLOW] > 0.97
    assert all(0.4 < found[name] < 0.6 for name in SENSORS if name != FLOW)
    with pytest.raises(DataError, match="both are needed"):
        sensor_information([], 5.0)


def test_best_and_worst_runs(folder: Path) -> None:
    runs = read_folder(folder)
    chosen = best_and_worst(runs, lambda run: flow_alarms(run, FlowBand(half_width=0.01, averaging=10.0)))
    assert [run.group for run in chosen] == ["hidden", "seen", "seen"]
    scores = [score_runs([run], lambda run: flow_alarms(run, FlowBand(half_width=0.01, averaging=10.0)))[ALL].f1
              for run in chosen]  # fmt: skip
    assert scores[1] >= scores[2]


def test_wrong_calls_are_refused(folder: Path, tmp_path: Path) -> None:
    band = FlowBand(half_width=0.02, averaging=5.0)
    with pytest.raises(ParameterError, match="give only one"):
        score_folder(folder, band=band, averaging=3.0)
    with pytest.raises(DataError, match="no runs"):
        score_runs([], always_alarm)
    runs = read_folder(folder)
    with pytest.raises(DataError, match=r"hidden/1: 700 labels and 699 decisions"):
        score_runs(runs, lambda run: always_alarm(run)[1:])
    with pytest.raises(DataError, match=r"hidden/1: alarm: float64"):
        score_runs(runs, lambda run: always_alarm(run).astype(float))
    with pytest.raises(DataError, match="has no labels"):
        score_runs([read_healthy(find_healthy(folder))], always_alarm)
    with pytest.raises(ParameterError, match="window"):
        score_folder(folder, window=0.0)
    write_run(tmp_path / "g" / "1.csv", 0.9)
    with pytest.raises(DataError, match=r"one file named anomaly-free\.csv is needed"):
        score_folder(tmp_path)
    write_run(tmp_path / ALL / "1.csv", 0.9)
    with pytest.raises(ParameterError, match="rename the folder"):
        score_folder(tmp_path, band=band)


def test_leaderboard() -> None:
    published = read_leaderboard()
    assert len(published) == 10
    assert [item.name for item in published if item.remark] == ["LSTM-VAE", "MSCRED"]
    assert [item.f1 for item in published] == sorted((item.f1 for item in published), reverse=True)
    # F1, FAR and MAR of a line belong together: all 34 files have 12 771 anomalous of 23 801 test rows
    for item in published:
        tp, fn, fp = 12771 * (1 - item.mar), 12771 * item.mar, 11030 * item.far
        consistent = tp / (tp + (fn + fp) / 2) == pytest.approx(item.f1, abs=0.007)
        assert consistent == (item.remark == ""), item.name


@pytest.mark.parametrize(
    "text", ["[[entry]]\nname='x'\n", "entry=1", "not toml", "[[entry]]\nname='x'\nf1=2\nfar_percent=1\nmar_percent=1"]
)
def test_a_broken_leaderboard_is_refused(tmp_path: Path, text: str) -> None:
    path = tmp_path / "board.toml"
    path.write_text(text)
    with pytest.raises(DataError, match="not a leaderboard"):
        read_leaderboard(path)
    with pytest.raises(DataError, match="absent"):
        read_leaderboard(tmp_path / "none.toml")


@pytest.fixture(scope="module")
def measured() -> Path:
    try:
        return datasets.folder("skab")
    except DataError as absent:
        pytest.skip(str(absent))


def test_measured_runs(measured: Path) -> None:
    """The measured runs: what is said of them in the notebook holds for the files that are here."""
    score = score_folder(measured)
    assert score.learned is not None
    assert 0.012 < score.band.half_width < 0.019
    assert score.overall.f1 >= 0.7
    assert score.overall.f1 > score.scores[ALWAYS][ALL].f1
    assert score.scores[CLOCK][ALL].f1 > score.overall.f1  # the labels tell the time
    information = sensor_information(score.runs, score.band.averaging)
    assert next(iter(information)) == FLOW
    assert information[FLOW] > 0.75
    assert all(abs(information[name] - 0.5) < 0.1 for name in ("Current", "Voltage", "Pressure"))
    for run in score.runs:
        assert math.isclose(clock_alarm(run).sum(), max(0, min(970, run.rows) - 570))


def test_the_area_under_the_roc_curve_is_the_share_of_pairs_in_the_right_order(folder: Path) -> None:
    runs = [run for run in read_folder(folder) if run.group == "seen"][:1]
    found = sensor_information(runs, 1.0)["Current"]
    (run,) = runs
    current = run.sensors["Current"]
    distance = np.abs(current[TRAIN_ROWS:] - current[:TRAIN_ROWS].mean())
    bad, good = distance[run.anomaly[TRAIN_ROWS:]], distance[~run.anomaly[TRAIN_ROWS:]]
    pairs = (bad[:, None] > good).mean() + 0.5 * (bad[:, None] == good).mean()
    assert found == pytest.approx(pairs, rel=1e-9)
