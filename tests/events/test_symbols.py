"""Symbols from deviations: alarm by integral, second look with a lower threshold, change since before the alarm."""

import numpy as np
import pytest

from pumplib.errors import DataError, ParameterError
from pumplib.events.symbols import EventSymbols, SymbolSettings
from pumplib.propagation import UNKNOWN

DT = 0.02
SIGNED = (False, True, True)


def course(n=1500, onset=20.0, before=(0.0, 0.0, 0.0), after=(0.0, 0.0, 0.0), noise=0.02, seed=0):
    rng = np.random.default_rng(seed)
    t = DT * np.arange(n)
    z = np.where((t >= onset)[:, None], after, before) + noise * rng.standard_normal((n, 3))
    return t, z, np.ones((n, 3), bool), np.ones((n, 3), bool)


def test_silent_below_the_thresholds():
    t, z, usable, rest = course(before=(0.9, -0.9, 0.9))
    assert not EventSymbols(SIGNED, DT).run(t, z, usable, rest).any()


def test_alarm_comes_when_the_integral_is_full():
    t, z, usable, rest = course(after=(0.0, -2.0, 0.0), noise=0.0)
    seen = EventSymbols(SIGNED, DT).run(t, z, usable, rest)
    first = t[np.argmax(seen[:, 1] == -1)]
    # excess of 1 for 0.1 s
    assert first == pytest.approx(20.0 + 0.1, abs=1.5 * DT)
    # the others are not yet known, then they show nothing
    early, late = seen[t > first + 0.1][0], seen[-1]
    assert early.tolist() == [UNKNOWN, -1, UNKNOWN]
    assert late.tolist() == [0, -1, 0]


def test_second_look_has_a_lower_threshold_and_a_doubtful_zone():
    t, z, usable, rest = course(after=(0.42, -2.0, 0.7))
    seen = EventSymbols(SIGNED, DT).run(t, z, usable, rest)
    assert seen[-1].tolist() == [UNKNOWN, -1, 1]
    assert not seen[t < 20.0].any()


def test_what_was_there_before_does_not_count():
    # a warm winding holds the third signal at 0.8 all along; only the second one changes
    t, z, usable, rest = course(before=(0.0, 0.0, 0.8), after=(0.0, -2.0, 0.8))
    assert EventSymbols(SIGNED, DT).run(t, z, usable, rest)[-1].tolist() == [0, -1, 0]
    # one-sided signals are sizes and have no zero to shift
    t, z, usable, rest = course(before=(0.8, 0.0, 0.0), after=(0.8, -2.0, 0.0))
    assert EventSymbols(SIGNED, DT).run(t, z, usable, rest)[-1].tolist() == [1, -1, 0]


def test_without_rest_before_the_level_is_zero():
    t, z, usable, rest = course(onset=0.0, after=(0.0, -2.0, 0.8))
    assert EventSymbols(SIGNED, DT).run(t, z, usable, rest)[-1].tolist() == [0, -1, 1]


def test_symbols_go_back_when_the_reading_does():
    t, z, usable, rest = course(n=3000, after=(0.0, -2.0, 0.0))
    z[t > 30.0, 1] = 0.0
    seen = EventSymbols(SIGNED, DT).run(t, z, usable, rest)
    assert (seen[(t > 25) & (t < 30), 1] == -1).all()
    assert not seen[-1].any()


def test_unusable_signals_are_unknown_and_never_alarm():
    t, z, usable, rest = course(after=(0.0, 0.0, 9.0))
    usable[:, 2] = rest[:, 2] = False
    z[:, 2] = np.nan
    seen = EventSymbols(SIGNED, DT).run(t, z, usable, rest)
    assert (seen[:, 2] == UNKNOWN).all()
    assert not seen[:, :2].any()


def test_one_sided_signals_do_not_fall():
    t, z, usable, rest = course(after=(-9.0, 0.0, 0.0))
    assert not EventSymbols(SIGNED, DT).run(t, z, usable, rest).any()


def test_stream_and_block_agree():
    t, z, usable, rest = course(after=(1.6, -0.7, 0.4), noise=0.4, seed=3)
    rng = np.random.default_rng(1)
    usable = rng.uniform(size=z.shape) < 0.9
    rest = usable & (rng.uniform(size=z.shape) < 0.8)
    whole = EventSymbols(SIGNED, DT).run(t, z, usable, rest)
    one = EventSymbols(SIGNED, DT)
    single = np.vstack([one.run(t[k : k + 1], z[k : k + 1], usable[k : k + 1], rest[k : k + 1]) for k in range(len(t))])
    assert np.array_equal(whole, single)
    assert len(np.unique(whole)) > 2
    one.reset()
    assert np.array_equal(whole, one.run(t, z, usable, rest))


def test_refusals():
    t, z, usable, rest = course()
    with pytest.raises(DataError, match="rest has shape"):
        EventSymbols(SIGNED, DT).run(t, z, usable, rest[:5])
    bad = z.copy()
    bad[7, 1] = np.nan
    with pytest.raises(DataError, match="not finite"):
        EventSymbols(SIGNED, DT).run(t, bad, usable, rest)
    with pytest.raises(DataError, match="not usable"):
        EventSymbols(SIGNED, DT).run(t, z, ~usable, rest)
    with pytest.raises(ParameterError, match="dt"):
        EventSymbols(SIGNED, 1.0)
    with pytest.raises(ParameterError, match="nothing"):
        SymbolSettings(shows=0.3, nothing=0.5)
