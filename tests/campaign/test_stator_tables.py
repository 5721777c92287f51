"""Thesis 5.3: thresholds come from their own runs, rates from others, and a table that is absent is not a rate."""

import gzip
import hashlib
import json
from dataclasses import asdict
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from pumplib.campaign import stator_tables
from pumplib.campaign.stator_runs import DETECTORS, StatorRuns, load_runs
from pumplib.errors import DataError, ParameterError
from pumplib.observers.stator_score import ScoreSettings

SCORES = (
    *DETECTORS, "phase_right", "kind", "gamma_R", "gamma_R_watching", "gamma_R_known", "delay_window", "delay_instant",
)  # fmt: skip


def cell(role: str, statistic: list[float], **words: object) -> pd.DataFrame:
    settings = asdict(ScoreSettings(**words))  # type: ignore[arg-type]
    n, gamma = len(statistic), settings["gamma"]
    scores: dict[str, object] = dict.fromkeys(DETECTORS, statistic)
    scores |= {"raw_I2": [0.5] * n, "phase_right": [1.0] * n, "kind": [0.0] * n}
    scores |= dict.fromkeys(("gamma_R", "gamma_R_watching", "gamma_R_known"), gamma * np.linspace(0.9, 1.1, n))
    scores |= {"delay_window": np.linspace(0.1, 0.2, n), "delay_instant": [0.05] * (n - 1) + [np.nan]}
    return pd.DataFrame({"campaign": "stator", "cell": role, "role": role, "run": range(n), **scores, **settings})


@pytest.fixture
def runs() -> StatorRuns:
    short = cell("fault", [1.0, 3.0, 5.0, 5.0], gamma=0.02)
    short["phase_right"] = [0.0, 1.0, 0.0, 1.0]
    delta = {"connection": "delta"}
    table = pd.concat(
        [
            cell("threshold", [0.5, 2.0, 1.0]), cell("healthy", [2.3, 2.5, 1.0, 0.0, 0.1]), short,
            cell("fault", [9.0, 9.0], gamma=0.05, loop="pair"), cell("fault", [1.0, 2.5], gamma=0.02, r_f=0.1),
            cell("threshold", [4.0], **delta), cell("fault", [4.5, 5.0], gamma=0.02, **delta),
            cell("fault", [9.0], gamma=0.02, rate=2000.0),
        ],
        ignore_index=True,
    )  # fmt: skip
    table.loc[table["connection"] == "delta", "star_point"] = np.nan
    return StatorRuns(table=table, names=("stator",), provenance=({},))


def test_threshold_is_the_margin_over_the_largest_run_of_its_own_conditions(runs: StatorRuns) -> None:
    assert runs.threshold("statistic") == pytest.approx(1.2 * 2.0)
    assert runs.threshold("statistic", connection="delta") == pytest.approx(1.2 * 4.0)
    assert np.isnan(runs.threshold("star_point", connection="delta"))
    with pytest.raises(DataError, match=r"rate = 2000\.0"):
        runs.threshold("statistic", rate=2000.0)
    with pytest.raises(ParameterError, match="colour"):
        runs.where("fault", colour="red")


def test_false_alarms_are_counted_in_other_runs(runs: StatorRuns) -> None:
    rows = stator_tables.false_alarms(runs)
    main = stator_tables.find_row(rows, detector="decision")
    assert main is not None
    assert (main["hits"], main["runs"], main["set by"]) == (1, 5, 3)
    assert main["low"] < 0.2 < main["high"]
    assert stator_tables.find_row(rows, detector="decision", connection="delta") is None  # no healthy runs there


def test_detections_by_hand(runs: StatorRuns) -> None:
    rows = stator_tables.detections(runs)
    plain = stator_tables.find_row(rows, gamma=0.02, detector="decision")
    assert plain is not None
    assert (plain["hits"], plain["runs"], plain["share"]) == (3, 4, 0.75)
    resistive = stator_tables.find_row(rows, gamma=0.02, r_f=0.1, detector="decision")
    assert resistive is not None
    assert (resistive["hits"], resistive["runs"]) == (1, 2)
    delta = stator_tables.find_row(rows, gamma=0.02, connection="delta", detector="decision")
    assert delta is not None
    assert (delta["hits"], delta["runs"]) == (1, 2)
    assert stator_tables.find_row(rows, gamma=0.02, connection="delta", detector="star-point voltage") is None
    assert stator_tables.find_row(rows, gamma=0.5, detector="decision") is None
    assert stator_tables.unscored(runs) == ["fault"]
    with pytest.raises(DataError, match="rows fit"):
        stator_tables.find_row(rows, gamma=0.02)


def test_ratio_to_raw_takes_the_upper_limit_where_raw_found_nothing(runs: StatorRuns) -> None:
    found = stator_tables.baseline_ratio(stator_tables.detections(runs), 0.02)
    assert found is not None
    upper = 1 - 0.025 ** (1 / 4)  # exact limit of 0 of 4
    assert found == (pytest.approx(0.75 / upper), 4)
    assert stator_tables.baseline_ratio(stator_tables.detections(runs), 0.3) is None


def test_phases_and_wrong_alarms(runs: StatorRuns) -> None:
    rows = stator_tables.phases(runs)
    one = stator_tables.find_row(rows, gamma=0.02)
    assert one is not None
    assert (one["hits"], one["runs"], one["wrong alarms"]) == (2, 4, 0.25)
    pair = stator_tables.find_row(rows, gamma=0.05, loop="pair")
    assert pair is not None
    assert "share" not in pair
    assert pair["one phase"] == 1.0


def test_sizes_and_delays(runs: StatorRuns) -> None:
    one = stator_tables.find_row(stator_tables.sizes(runs), gamma=0.02, resistance="known")
    assert one is not None
    assert one["low"] == pytest.approx(-one["high"])
    assert one["half"] == pytest.approx(np.quantile(np.linspace(-0.1, 0.1, 4), 0.95))
    late = stator_tables.find_row(stator_tables.delays(runs), gamma=0.02)
    assert late is not None
    assert late["instant"] == pytest.approx(0.05)
    assert late["instant 95 %"] == np.inf  # one of four never crosses


def test_words(runs: StatorRuns) -> None:
    lines = stator_tables.overview(stator_tables.detections(runs))
    assert lines[0]["conditions"] == "1 record, A, Y, 10 kHz, grid"
    assert [one["fault"] for one in lines[:3]] == ["2 %", "2 %, r_f 0.1 ohm", "5 %, between two phases"]
    assert lines[0]["decision"] == "75.0 (19.4-99.4)"
    assert lines[3]["conditions"] == "delta"
    assert lines[3]["star-point voltage"] == "-"


def write(folder: Path, table: pd.DataFrame, cells: list[dict[str, object]]) -> None:
    text = table.to_csv(index=False).encode()
    with gzip.open(folder / "stator.csv.gz", "wb") as file:
        file.write(text)
    kinds = {str(name): "str" if name in ("cell", "role") else "float" for name in table}
    known = {
        "form": 1, "definition": {"cells": cells},
        "table": {"sha256": hashlib.sha256(text).hexdigest(), "columns": kinds},
    }  # fmt: skip
    (folder / "stator.json").write_text(json.dumps(known))


def test_reading_a_table_fills_in_the_settings(tmp_path: Path) -> None:
    table = pd.DataFrame({"cell": ["t", "f"], "role": ["threshold", "fault"], **{name: [1.0, 2.0] for name in SCORES}})
    cells = [{"name": "t", "settings": {}}, {"name": "f", "settings": {"gamma": 0.02, "connection": "delta"}}]
    write(tmp_path, table, cells)
    found = load_runs(folder=tmp_path)
    assert found is not None
    assert found.names == ("stator",)
    assert found.table["gamma"].tolist() == [0.0, 0.02]
    assert found.table["connection"].tolist() == ["Y", "delta"]
    assert found.threshold("raw_I2") == pytest.approx(1.2)
    write(tmp_path, table.drop(columns="raw_I2"), cells)
    with pytest.raises(DataError, match="raw_I2"):
        load_runs(folder=tmp_path)


def test_absent_table_is_none_and_not_zero(tmp_path: Path) -> None:
    assert load_runs(folder=tmp_path) is None
