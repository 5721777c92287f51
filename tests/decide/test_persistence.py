"""Thesis 2.1.4, 8.1: debounce: rules by hand, batch against stream, operator reset."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import settings as effort
from hypothesis import strategies as st

from pumplib.decide import Persistence, PersistenceSettings
from pumplib.errors import DataError, ParameterError


def run(text, dt=1.0, **rule):
    """Raw decisions and alarms as strings of 0 and 1."""
    out = Persistence(PersistenceSettings(**rule), dt).run(np.array([one == "1" for one in text]))
    return "".join("1" if one else "0" for one in out[:, 0])


@pytest.mark.parametrize(
    ("rule", "raw", "alarm"),
    [
        ({}, "0110100", "0110100"),
        ({"m": 2, "n": 3}, "1010011100000", "0010001110000"),
        ({"m": 3, "n": 3}, "1101111000", "0000011000"),
        # integral of the on-time: grows to at most twice the need, falls at the same rate
        ({"on_time": 3.0}, "1101011111110000", "0000001111110000"),
        ({"m": 1, "n": 4, "on_time": 2.0}, "1111000000", "0111110000"),
        ({"hold": 2.0}, "0100010000", "0111011100"),
        ({"hold": 2.0}, "0101010000", "0111111100"),
        ({"latch": True}, "0010000", "0011111"),
        ({"m": 2, "n": 2, "hold": 1.0}, "0110010110", "0011000011"),
    ],
)
def test_rules_by_hand(rule, raw, alarm):
    assert run(raw, **rule) == alarm


def test_times_are_in_seconds():
    assert run("1111", dt=0.1, on_time=0.3) == "0011"
    assert run("10000", dt=0.1, hold=0.3) == "11110"


def test_operator_reset():
    one = Persistence(PersistenceSettings(m=2, n=3, latch=True), 1.0, names=("a", "b"))
    assert one.run(np.array([[True, True]] * 2))[-1].tolist() == [True, True]
    assert one.update([False, False]).tolist() == [True, True]
    one.acknowledge("a")
    assert one.update([False, False]).tolist() == [False, True]
    # the fault is still there: back as soon as the rule is met again
    assert one.update([True, False]).tolist() == [False, True]
    assert one.update([True, False]).tolist() == [True, True]
    one.acknowledge()
    assert one.update([False, False]).tolist() == [False, False]


@effort(max_examples=50, deadline=None)
@given(
    st.integers(0, 2**32),
    st.integers(1, 6),
    st.integers(1, 6),
    st.floats(0, 5),
    st.floats(0, 5),
    st.booleans(),
    st.lists(st.integers(0, 57), max_size=4),
)
def test_stream_is_batch(seed, m, extra, on_time, hold, latch, cuts):
    rule = PersistenceSettings(m=m, n=m + extra - 1, on_time=on_time, hold=hold, latch=latch)
    x = np.random.default_rng(seed).random((57, 2)) < 0.6
    whole, stream, pieces = (Persistence(rule, 0.5, names=("a", "b")) for _ in range(3))
    out = whole.run(x)
    assert np.array_equal(out, [stream.update(row) for row in x])
    cuts = [0, *sorted(cuts), 57]
    assert np.array_equal(out, np.concatenate([pieces.run(x[i:j]) for i, j in pairwise(cuts)]))
    # an alarm can only begin where the window holds enough samples that are on
    first = np.flatnonzero(out[:, 0])
    if len(first):
        k = first[0]
        assert x[max(k - rule.n + 1, 0) : k + 1, 0].sum() >= m


def test_wrong_input():
    with pytest.raises(ParameterError, match="m = 3 of n = 2"):
        PersistenceSettings(m=3, n=2)
    with pytest.raises(ParameterError, match=r"hold = -1 s"):
        PersistenceSettings(hold=-1.0)
    with pytest.raises(ParameterError, match="latch = 1"):
        PersistenceSettings(latch=1)  # type: ignore[arg-type]
    with pytest.raises(ParameterError, match="dt = 0 s"):
        Persistence(PersistenceSettings(), 0.0)
    with pytest.raises(ParameterError, match="must be PersistenceSettings"):
        Persistence(3, 1.0)  # type: ignore[arg-type]
    with pytest.raises(ParameterError, match="one name a channel"):
        Persistence(PersistenceSettings(), 1.0, names=())
    one = Persistence(PersistenceSettings(), 1.0)
    with pytest.raises(ParameterError, match="name = 'x'"):
        one.acknowledge("x")
    with pytest.raises(DataError, match="type float64: must be bool"):
        one.run([0.0, 1.0])
    with pytest.raises(DataError, match=r"shape \(1, 2\)"):
        one.update([True, False])
