"""Sets of residuals: they enclose (verified library as judge), are narrow, and the linear one is no enclosure."""

import numpy as np
import pytest

from pumplib.errors import ParameterError
from pumplib.steady.enclose import METHODS, RIGOROUS, set_model
from pumplib.steady.intervals import Interval
from pumplib.steady.relations import CHANNELS, Relations, motor_relations, stack
from pumplib.steady.sets import MeasurementErrors, ParameterSet, box, unit_points
from pumplib.steady.verify import count_violations, true_range
from tests.steady.cases import BOX, ERRORS, MOTOR, RELATIONS, VALUES, correlated, grid

flint = pytest.importorskip("flint")
SETS = {"box": BOX, "correlated": correlated()}


@pytest.fixture(params=SETS)
def model(request: pytest.FixtureRequest):  # type: ignore[no-untyped-def]
    return set_model(RELATIONS, SETS[request.param], ERRORS)


def exact(model, x, zeta):  # type: ignore[no-untyped-def]
    """Residuals of one truth in 200-bit ball arithmetic: the set's own definition, nothing rounded to double."""
    flint.ctx.prec = 200
    n = model.parameters.generators.shape[1]
    radii = model.radii(x[None])[0]
    balls = [[flint.arb(float(v)) for v in row] for row in (x, radii, zeta[n:])]
    channels = [a + r * z for a, r, z in zip(*balls, strict=True)]
    parameters = []
    for c, row in zip(model.parameters.center, model.parameters.generators, strict=True):
        value = flint.arb(float(c))
        for g, z in zip(row, zeta[:n], strict=True):
            value += flint.arb(float(g)) * flint.arb(float(z))
        parameters.append(value)
    return model.relations(channels, parameters)


@pytest.mark.parametrize("size", [1.0, 1e-6, 1e-14, 0.0])
@pytest.mark.parametrize("method", RIGOROUS)
def test_verified_truths_lie_inside_down_to_sets_of_no_width(model, method: str, size: float) -> None:  # type: ignore[no-untyped-def]
    errors = MeasurementErrors(
        relative={k: size * v for k, v in ERRORS.relative.items()},
        absolute={k: size * v for k, v in ERRORS.absolute.items()},
    )
    small = set_model(RELATIONS, model.parameters.scaled(size), errors)
    signals = grid(2).signals
    x = stack(RELATIONS, signals)
    found = small.enclose(signals, method)
    rng = np.random.default_rng(3)
    for k in range(len(x)):
        for zeta in unit_points(rng, 6, small.size, 0.7):
            for o, ball in enumerate(exact(small, x[k], zeta)):
                assert flint.arb(float(found.lo[k, o])) <= ball <= flint.arb(float(found.hi[k, o])), (method, o)


def test_no_width_is_rounding_only() -> None:
    exact_set = set_model(RELATIONS, BOX.scaled(0.0), MeasurementErrors())
    found = exact_set.enclose(grid(3).signals)
    assert np.all(found.width > 0)
    assert np.all(found.width < [1e-7, 1e-11, 1e-11])
    assert not found.alarm.any()


@pytest.mark.parametrize("method", RIGOROUS)
def test_no_violation_in_many_truths(model, method: str) -> None:  # type: ignore[no-untyped-def]
    count = 200_000 if method == "affine" else 20_000
    found = count_violations(model, grid().signals, np.random.default_rng(4), count=count, method=method)
    assert found.truths == count
    assert found.outside == (0, 0, 0)


def test_double_truths_agree_with_verified_ones(model) -> None:  # type: ignore[no-untyped-def]
    x = stack(RELATIONS, grid(3).signals)
    zeta = unit_points(np.random.default_rng(5), len(x), model.size)
    double = model.point(x, zeta)
    verified = np.array([[float(b.mid()) for b in exact(model, row, z)] for row, z in zip(x, zeta, strict=True)])
    np.testing.assert_allclose(double / [1e5, 1, 1], verified / [1e5, 1, 1], rtol=0, atol=1e-12)


def test_first_order_taylor_is_no_enclosure(model) -> None:  # type: ignore[no-untyped-def]
    found = count_violations(model, grid().signals, np.random.default_rng(6), count=200_000, method="linear")
    assert min(found.outside) >= 1
    assert not model.enclose(grid(2).signals, "linear").guaranteed


def test_affine_sets_are_hardly_wider_than_needed(model) -> None:  # type: ignore[no-untyped-def]
    signals = grid().signals
    inner = true_range(model, signals, np.random.default_rng(7))
    found = model.enclose(signals)
    assert np.all((found.lo <= inner.lo) & (inner.hi <= found.hi))
    excess = (found.width / inner.width).max(axis=0)
    assert excess[0] <= 1.05
    assert excess[1] <= 1.05
    assert excess[2] <= 1.10


def test_methods_are_ordered_by_width_and_correlation_pays() -> None:
    signals = grid(3).signals
    width = {
        name: {m: np.median(set_model(RELATIONS, one, ERRORS).enclose(signals, m).width, axis=0) for m in METHODS}
        for name, one in (("set", SETS["correlated"]), ("hull", SETS["correlated"].hull()))
    }
    assert np.all(width["set"]["affine"] < width["set"]["mean"])
    assert np.all(width["set"]["mean"] < width["set"]["interval"])
    assert np.all(width["set"]["affine"] < 0.5 * width["hull"]["affine"])


def test_range_search_finds_the_exact_range_of_a_known_function() -> None:
    relations = Relations(
        name="known", function=lambda a, b, p, q: (p * q - a * b, a**2 - p),
        channels=CHANNELS[:2], parameters=("r_s", "B"), constants=(), outputs=("f", "g"),
    )  # fmt: skip
    model = set_model(
        relations, box({"r_s": 2.0, "B": 3.0}, relative=0.5), MeasurementErrors(absolute={"V_rms": 1.0, "I_rms": 2.0})
    )
    signals = {"V_rms": [0.25], "I_rms": [1.0]}
    found = true_range(model, signals, np.random.default_rng(1))
    # p q in [1.5, 13.5], a b in [-2.25, 3.75]; a^2 in [0, 1.5625], p in [1, 3]
    np.testing.assert_allclose(found.lo, [[1.5 - 3.75, -3.0]], atol=1e-9)
    np.testing.assert_allclose(found.hi, [[13.5 + 2.25, 0.5625]], atol=1e-9)
    for method in RIGOROUS:
        outer = model.enclose(signals, method)
        assert np.all((outer.lo <= found.lo) & (found.hi <= outer.hi)), method


def test_a_relation_that_is_not_defined_never_alarms() -> None:
    signals = {k: v[:2].copy() for k, v in grid(2).signals.items()}
    signals["H"] = signals["H"] * 3  # above the pump's largest head
    for method in RIGOROUS:
        found = set_model(RELATIONS, BOX, ERRORS).enclose(signals, method)
        assert np.all(np.isinf(found.width[:, 2]))
        assert not found.alarm[:, 2].any()
        assert found.alarm[:, 0].all()


def test_order_of_parameters_does_not_matter_and_missing_ones_are_named() -> None:
    signals = grid(2).signals
    order = np.random.default_rng(0).permutation(len(BOX.names))
    shuffled = ParameterSet(
        names=tuple(BOX.names[k] for k in order), center=BOX.center[order], generators=BOX.generators[order]
    )
    a = set_model(RELATIONS, BOX, ERRORS).enclose(signals)
    np.testing.assert_array_equal(set_model(RELATIONS, shuffled, ERRORS).enclose(signals).lo, a.lo)
    with pytest.raises(ParameterError, match="a_h0"):
        set_model(RELATIONS, box({k: v for k, v in VALUES.items() if k != "a_h0"}), ERRORS)
    with pytest.raises(ParameterError, match="one of"):
        set_model(RELATIONS, BOX, ERRORS).enclose(signals, "magic")  # type: ignore[arg-type]


def test_batch_and_single_samples_are_bit_identical() -> None:
    signals = grid(7).signals
    model = set_model(RELATIONS, SETS["correlated"], ERRORS)
    whole = model.enclose(signals)
    for k in (0, 31, 32, 48):
        one = model.enclose({name: x[k : k + 1] for name, x in signals.items()})
        np.testing.assert_array_equal(one.lo[0], whole.lo[k])
        np.testing.assert_array_equal(one.hi[0], whole.hi[k])


def test_affine_forms_give_the_same_bounds() -> None:
    model = set_model(RELATIONS, SETS["correlated"], ERRORS)
    forms = model.forms(grid(3).signals)
    radius = np.abs(forms.k).sum(axis=2) + forms.e
    np.testing.assert_allclose(forms.enclosure.hi - forms.enclosure.lo, 2 * radius, rtol=1e-12)
    assert model.enclose({name: np.empty(0) for name in CHANNELS}).lo.shape == (0, 3)


def test_intervals_against_the_verified_library() -> None:
    flint.ctx.prec = 200
    rng = np.random.default_rng(8)
    for _ in range(200):
        a, b = np.sort(rng.normal(size=2) * 10.0 ** rng.integers(-3, 4)), np.sort(rng.normal(size=2))
        x, y = Interval(a[:1], a[1:]), Interval(b[:1], b[1:])
        p, q = (flint.arb(float(rng.uniform(*ends))) for ends in (a, b))
        pairs = [(x + y, p + q), (x - y, p - q), (x * y, p * q), (x**2, p**2), (x.cos(), p.cos()), (x.sin(), p.sin())]
        if not (b[0] <= 0 <= b[1]):
            pairs.append((x / y, p / q))
        if a[0] > 0:
            pairs.append((x.sqrt(), p.sqrt()))
        for found, truth in pairs:
            assert flint.arb(float(found.lo[0])) <= truth <= flint.arb(float(found.hi[0]))


def test_cosine_of_wide_intervals_has_its_extremes() -> None:
    found = Interval(np.array([-0.1, 3.0, 0.5, 0.5]), np.array([0.2, 3.3, 7.0, 1.0])).cos()
    np.testing.assert_array_equal(found.hi[[0, 2]], 1.0)
    np.testing.assert_array_equal(found.lo[[1, 2]], -1.0)
    assert found.lo[3] == pytest.approx(np.cos(1.0), abs=1e-14)


def test_motor_relations_have_no_pump() -> None:
    assert motor_relations(MOTOR).channels == CHANNELS[:4]
