"""Thesis 5.2.3, 5.3: the benchmark of the stator observer compares like with like; nothing here looks at a time."""

import numpy as np
import pytest

from benchmarks import stator
from benchmarks.peer_c import compiler


@pytest.mark.skipif(compiler() is None, reason="no C compiler")
def test_c_and_numba_give_the_same_rows():
    calls, rows, n = stator.contenders()
    for call in calls.values():
        call()
    assert n == 30_000
    assert stator.difference(rows) < 1e-11
    assert np.isfinite(rows["C"][-1]).all()


def test_measurement_has_all_contenders():
    found = stator.measure(rounds=2)
    assert found["us_per_sample"]["pumplib with alarm"]["min"] > 0
    assert ("C" in found["us_per_sample"]) == (compiler() is not None)
