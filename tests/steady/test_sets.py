"""Parameter and error sets: geometry, order, refusals."""

import numpy as np
import pytest

from pumplib.errors import ParameterError
from pumplib.steady.sets import MeasurementErrors, ParameterSet, box, join, unit_points
from tests.steady.cases import correlated


def test_a_box_has_one_direction_for_each_uncertain_parameter() -> None:
    found = box({"B": 2.0, "r_s": -4.0, "a_h0": 1.0}, relative={"r_s": 0.1}, absolute={"r_s": 0.1, "B": 0.5})
    np.testing.assert_allclose(found.radius, [0.5, 0.5, 0.0])
    assert found.generators.shape == (3, 2)
    np.testing.assert_array_equal(found.values(np.zeros(2)), found.center)


def test_coordinates_find_points_and_tell_outside_from_inside() -> None:
    one = correlated()
    rng = np.random.default_rng(1)
    for zeta in unit_points(rng, 5, one.generators.shape[1], 0.0):
        values = dict(zip(one.names, one.values(zeta).tolist(), strict=True))
        found, size = one.coordinates(values)
        assert size == pytest.approx(np.abs(zeta).max(), rel=1e-5)
        np.testing.assert_allclose(one.values(found) / np.maximum(one.radius, 1e-9), one.values(zeta) /
                                   np.maximum(one.radius, 1e-9), rtol=1e-6)  # fmt: skip
    far = dict(zip(one.names, one.values(2 * np.ones(one.generators.shape[1])).tolist(), strict=True))
    assert one.coordinates(far)[1] == pytest.approx(2.0, rel=1e-6)
    assert one.coordinates(far | {"G_core": 1.0})[1] == np.inf


def test_the_hull_holds_the_set_and_joining_keeps_both() -> None:
    one = correlated()
    hull = one.hull()
    points = one.values(one.sample(np.random.default_rng(2), 500))
    assert np.all(np.abs(points - hull.center) <= hull.radius * (1 + 1e-12))
    both = join(box({"x": 1.0}, relative=0.1), box({"y": 2.0}, relative=0.1))
    np.testing.assert_allclose(both.generators, [[0.1, 0], [0, 0.2]])


def test_unit_points_have_the_share_of_vertices_asked_for() -> None:
    points = unit_points(np.random.default_rng(3), 4000, 5, 0.3)
    assert np.abs(points).max() <= 1
    assert np.mean(np.all(np.abs(points) == 1, axis=1)) == pytest.approx(0.3, abs=0.03)


def test_wrong_sets_are_refused() -> None:
    with pytest.raises(ParameterError, match="twice"):
        ParameterSet(names=("a", "a"), center=np.zeros(2), generators=np.eye(2))
    with pytest.raises(ParameterError, match="generators"):
        ParameterSet(names=("a",), center=np.zeros(1), generators=np.zeros((2, 1)))
    with pytest.raises(ParameterError, match=r"a_h0 .Pa s2.*finite"):
        ParameterSet(names=("a_h0",), center=np.array([np.nan]), generators=np.zeros((1, 1)))
    with pytest.raises(ParameterError, match="2 %"):
        box({"r_s": 4.0}, relative={"r_s": -0.02})
    with pytest.raises(ParameterError, match="r_x"):
        box({"r_s": 4.0}, relative={"r_x": 0.02})
    with pytest.raises(ParameterError, match="twice"):
        join(box({"r_s": 4.0}), box({"r_s": 4.0}))
    with pytest.raises(ParameterError, match=r"2 % is 0\.02"):
        MeasurementErrors(relative={"V_rms": 2.0})
    with pytest.raises(ParameterError, match="no channel"):
        MeasurementErrors(absolute={"T": 1.0})
    with pytest.raises(ParameterError, match="0 to 1"):
        MeasurementErrors(bias_share={"H": 1.2})
    with pytest.raises(ParameterError, match="factor"):
        correlated().scaled(-1.0)
    with pytest.raises(ParameterError, match="missing"):
        correlated().coordinates({})
