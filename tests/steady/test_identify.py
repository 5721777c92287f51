"""Commissioning: estimates, guaranteed sets, what the data cannot see, and what to measure next."""

import numpy as np
import pytest

from pumplib.errors import DataError, ParameterError
from pumplib.steady.enclose import set_model
from pumplib.steady.identify import HEAD, identify, regress, regressors, suggest_points
from pumplib.steady.operating import steady_points, v_f_voltage
from pumplib.steady.sets import MeasurementErrors
from tests.steady.cases import ERRORS, MOTOR, RELATIONS, RELATIVE, VALUES, grid, machine, measured

MOTOR_BOX = {name: RELATIVE[name] for name in ("r_s", "L_s_prime", "R_r_prime")}


def test_exact_data_give_the_parameters_back() -> None:
    A_h, H, A_t, T = regressors(MOTOR, VALUES, grid().signals)
    found = regress(HEAD, A_h, H)
    np.testing.assert_allclose(found.estimate, [VALUES[k] for k in HEAD], rtol=1e-9)
    np.testing.assert_allclose(found.residual, 0, atol=1e-6)
    torque = regress(("B", "a_t0", "a_t1", "a_t2"), A_t, T)
    np.testing.assert_allclose(torque.estimate, [VALUES[k] for k in torque.names], rtol=1e-7)
    assert found.singular[0] <= np.sqrt(3)


def test_deviation_is_that_of_repeated_experiments() -> None:
    rng = np.random.default_rng(1)
    matrix = rng.normal(size=(30, 3)) @ np.diag([1, 1e5, 1e-4])
    truth = np.array([1.0, -2e-5, 3e4])
    fits = [regress(HEAD, matrix, matrix @ truth + 0.1 * rng.normal(size=30)) for _ in range(600)]
    scatter = np.std([f.estimate for f in fits], axis=0)
    np.testing.assert_allclose(np.mean([f.deviation for f in fits], axis=0), scatter, rtol=0.1)


def test_the_guaranteed_set_contains_the_truth_and_evaluates_without_alarm() -> None:
    rng = np.random.default_rng(2)
    for _ in range(4):
        truth, bias = machine(rng)
        found = identify(MOTOR, VALUES, measured(rng, 20, truth, bias), ERRORS, motor_box=MOTOR_BOX)
        assert found.factor <= 1.0
        assert found.margin == (0.0, 0.0)
        _, size = found.guaranteed.coordinates(truth)
        assert size <= 1.0
        model = set_model(RELATIONS, found.guaranteed, ERRORS)
        assert not model.enclose(measured(rng, 50, truth, bias)).alarm.any()


def test_better_sensors_and_more_points_shrink_the_set() -> None:
    better = MeasurementErrors(
        relative={k: v / 10 for k, v in ERRORS.relative.items()},
        absolute={k: v / 10 for k, v in ERRORS.absolute.items()},
        bias_share=ERRORS.bias_share,
    )
    signals = grid(5).signals
    wide, narrow = (identify(MOTOR, VALUES, signals, e) for e in (ERRORS, better))
    assert np.all([a[4] > 2 * b[4] for a, b in zip(wide.report()[:3], narrow.report()[:3], strict=True)])
    part = identify(MOTOR, VALUES, {k: v[::3] for k, v in signals.items()}, ERRORS)
    assert all(a[4] <= b[4] * (1 + 1e-6) for a, b in zip(wide.report(), part.report(), strict=True))


def test_errors_stated_too_small_are_noticed_and_larger_ones_suggested() -> None:
    rng = np.random.default_rng(3)
    truth, bias = machine(rng)
    signals = measured(rng, 24, truth, bias)
    tiny = MeasurementErrors(
        relative={k: v / 100 for k, v in ERRORS.relative.items()},
        absolute={k: v / 100 for k, v in ERRORS.absolute.items()}, bias_share=ERRORS.bias_share,
    )  # fmt: skip
    found = identify(MOTOR, VALUES, signals, tiny, motor_box=MOTOR_BOX)
    assert found.factor > 1
    assert max(found.margin) > 0
    assert found.suggested.absolute["H"] == pytest.approx(found.factor * tiny.absolute["H"])
    again = identify(MOTOR, VALUES, signals, found.suggested, motor_box=MOTOR_BOX)
    assert again.factor <= 1 + 1e-6


def test_points_of_one_affinity_parabola_are_an_explained_error() -> None:
    hertz = np.linspace(30, 50, 12)
    points = steady_points(MOTOR, VALUES, V_rms=v_f_voltage(hertz), frequency_hz=hertz, valve=2e11)
    with pytest.raises(DataError, match=r"affinity parabola.*change the valve") as error:
        identify(MOTOR, VALUES, points.signals, ERRORS)
    assert "a_h" in str(error.value)


def test_weak_directions_are_reported_with_their_parameters() -> None:
    hertz = np.array([40, 45, 50] * 4)
    valve = np.repeat([1.5e11, 2e11, 2.7e11, 3.6e11], 3)
    points = steady_points(MOTOR, VALUES, V_rms=v_f_voltage(hertz), frequency_hz=hertz, valve=valve)
    A_h, H, _, _ = regressors(MOTOR, VALUES, points.signals)
    value, names = regress(HEAD, A_h, H).together()[0]
    assert value < 0.05
    assert set(names) == set(HEAD)


def test_suggested_points_beat_random_ones() -> None:
    A_h, H, _, _ = regressors(MOTOR, VALUES, grid(5).signals)
    fit = regress(HEAD, A_h, H)
    start = A_h[[6, 7, 8]]
    chosen = suggest_points(fit, start, A_h, 3)

    def information(rows: np.ndarray) -> float:
        return float(2 * np.log(np.linalg.svd(np.vstack((start, rows)) / fit.scale, compute_uv=False)).sum())

    rng = np.random.default_rng(4)
    others = [information(A_h[rng.choice(25, 3, replace=False)]) for _ in range(50)]
    assert information(A_h[chosen]) > np.max(others) - 0.3
    # extreme flows and speeds carry the information
    assert {0, 4, 20, 24} & set(chosen)


def test_wrong_inputs_are_refused() -> None:
    A_h, H, _, _ = regressors(MOTOR, VALUES, grid(5).signals)
    with pytest.raises(DataError, match="2 points for the 3"):
        regress(HEAD, A_h[:2], H[:2])
    with pytest.raises(ParameterError, match="r_s"):
        identify(MOTOR, {}, grid(3).signals, ERRORS)
    with pytest.raises(ParameterError, match="count 0"):
        suggest_points(regress(HEAD, A_h, H), A_h, A_h, 0)
    faulty = {k: np.concatenate((a, b)) for (k, a), b in zip(
        grid(4).signals.items(), grid(4, f_d=0.8).signals.values(), strict=True)}  # fmt: skip
    with pytest.raises(DataError, match="no fault was there"):
        identify(MOTOR, VALUES, faulty, ERRORS, prior=0.1, margin=(0.0, 0.0))
