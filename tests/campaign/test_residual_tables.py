"""Tables of the residual campaigns: counted by hand, empty cells, repeated rows."""

import numpy as np
import pandas as pd
import pytest

from pumplib.campaign import residual_tables as tables
from pumplib.campaign.rates import clopper_pearson
from pumplib.errors import DataError


def row(run: int, fault: str, size: float, **scores: object) -> dict[str, object]:
    empty = {"observers_false": 0, "observers_found": 0, "observers_delay": np.nan, "observers_class": None}
    return {"cell": "machines", "run": run, "row": 0, "fault": fault, "size": size, **empty, **scores}


TABLE = pd.DataFrame(
    [row(k // 5, "none", 0.0, observers_false=int(k == 3)) for k in range(10)]
    + [row(k // 2, "clogging", 1e10, observers_found=int(k > 0), observers_delay=np.nan if k == 0 else 0.1 * k,
           observers_class={0: None, 1: None, 2: "leakage"}.get(k, "clogging")) for k in range(6)]
    + [row(0, "friction", 2.5e-4, observers_found=1, observers_delay=1.0, observers_class="friction")]
)  # fmt: skip


def test_false_alarms_and_detections_are_counted_with_exact_limits() -> None:
    (false,) = tables.false_alarms(TABLE, ["observers"])
    exact = clopper_pearson(1, 10)
    assert (false["hits"], false["runs"], false["rate"]) == (1, 10, 0.1)
    assert (false["low"], false["high"]) == (exact.low, exact.high)
    assert false["high, machines"] >= false["high"]
    clogging, friction = tables.detections(TABLE, ["observers"])
    assert (clogging["fault"], clogging["size"], clogging["hits"], clogging["runs"]) == ("clogging", 1e10, 5, 6)
    assert clogging["delay"] == pytest.approx(0.3)  # median of 0.1 to 0.5
    assert friction["rate"] == 1.0
    assert tables.hits(TABLE, "observers_false", {"none": 0.0}) == {"none": (1, 10)}
    found = tables.hits(TABLE, "observers_found", {"friction": 2.5e-4, "clogging": 1e10})
    assert tables.smallest(found) == ("clogging", 5, 6)
    with pytest.raises(DataError, match="no fault"):
        tables.smallest({})


def test_confusion_counts_silence_and_missing_rest_apart() -> None:
    faults, said, counts = tables.confusion(TABLE, "observers", {"clogging": 1e10, "friction": 2.5e-4})
    assert faults == ("clogging", "friction")
    of_clogging = dict(zip(said, counts[0].tolist(), strict=True))
    assert of_clogging == {"clogging": 3, "friction": 0, "leakage": 1, "cavitation": 0, "dry_running": 0, "none": 0,
                           tables.NO_REST: 1, tables.NO_ALARM: 1}  # fmt: skip
    assert counts[1].tolist() == [0, 1, 0, 0, 0, 0, 0, 0]


def test_what_is_not_in_the_table_is_refused() -> None:
    with pytest.raises(DataError, match=r"no run with leakage 1e-08; there are clogging 1e\+10"):
        tables.confusion(TABLE, "observers", {"leakage": 1e-8})
    with pytest.raises(DataError, match="no run with a fault"):
        tables.detections(TABLE[TABLE["fault"] == "none"], ["observers"])
    with pytest.raises(DataError, match="no run with none"):
        tables.false_alarms(TABLE[TABLE["fault"] != "none"], ["observers"])


def test_repeated_rows_must_be_the_committed_ones() -> None:
    mine = [{"fault": "clogging", "size": 1e10, "observers_delay": 0.1, "observers_class": None}]
    part = TABLE[(TABLE["fault"] == "clogging") & (TABLE["observers_delay"] == 0.1)]
    assert "1 runs repeated, 4 values" in tables.same_rows(part, 0, mine)
    with pytest.raises(DataError, match=r"observers_delay = 0\.11, in the table 0\.1"):
        tables.same_rows(part, 0, [mine[0] | {"observers_delay": 0.11}])
    with pytest.raises(DataError, match="observers_class = leakage"):
        tables.same_rows(part, 0, [mine[0] | {"observers_class": "leakage"}])
    with pytest.raises(DataError, match="observers_delay = None"):
        tables.same_rows(part, 0, [mine[0] | {"observers_delay": None}])
    both = pd.concat([part, part.assign(cell="other")])
    with pytest.raises(DataError, match="several cells"):
        tables.same_rows(both, 0, mine)
    with pytest.raises(DataError, match="2 were repeated"):
        tables.same_rows(part, 0, mine * 2)
