"""Thesis 4.2.1: the benchmark of the closure compares equal results; the closure scales."""

import numpy as np
import pytest

from benchmarks import propagation as benchmark


@pytest.mark.parametrize("name", ["random", "layered", "chain"])
def test_contenders_agree_with_each_other_and_networkx(name):
    found = benchmark.compare(benchmark.case(name, 200), rounds=1)  # raises where results differ
    assert found["roots"] == 20
    assert set(found["over_condensed"]) == {"cut", "plain", "in place", "worklist"}
    assert found["largest_loop"] >= 4


def test_a_different_result_is_an_error(monkeypatch):
    monkeypatch.setattr(benchmark, "worklist", lambda c: c.seeds)
    with pytest.raises(RuntimeError, match="worklist gives another result"):
        benchmark.compare(benchmark.case("layered", 200), rounds=1)


def test_ten_thousand_events_and_a_thousand_roots():
    assert benchmark.speed(rounds=5).low <= 0.01


def test_layers_are_deep_and_looped():
    c = benchmark.case("layered", 10_000)
    assert len(c.cause) == 30_000
    assert 100 < c.largest < 10_000
    assert np.bincount(c.cause, minlength=c.n).tolist() == [benchmark.DEGREE] * c.n


def test_unknown_graph():
    with pytest.raises(ValueError, match="graph 'tree'"):
        benchmark.case("tree", 10)
