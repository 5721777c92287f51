"""The benchmark of the enclosures measures what it says, on a small record."""

import numpy as np
import pytest

from benchmarks import steady
from pumplib.steady.relations import stack


def test_all_contenders_enclose_the_same_residuals() -> None:
    pytest.importorskip("flint")
    model, signals = steady.case(12)
    x = stack(model.relations, signals)
    affine = model.enclose(signals)
    for low, high in (steady.numpy_intervals(model, x), steady.flint_intervals(model, x)):
        # intervals that forget what is shared are wider, and all of them hold the residual at the centre
        assert np.all(high - low > affine.width)
        assert np.all((low < 0) & (high > 0))
    plain = model.enclose(signals, "interval")
    low, high = steady.numpy_intervals(model, x)
    np.testing.assert_allclose(low, plain.lo, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(high, plain.hi, rtol=1e-9, atol=1e-9)


def test_numbers_are_there() -> None:
    pytest.importorskip("flint")
    found = steady.measure(rounds=1, samples=500, few=5)
    assert set(found["samples_per_second"]) == {"affine", "numpy intervals", "flint", "taylor"}
    assert min(found["samples_per_second"].values()) > 0
    assert min(found["median_width_over_affine"]["flint"]) > 1
