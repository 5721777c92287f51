"""The three approaches: residuals that are zero when healthy and have the sign of the fault, alarms that fit."""

import dataclasses

import numpy as np
import pytest

from pumplib.errors import DataError, ParameterError
from pumplib.primer import (
    METHODS,
    Example,
    Machine,
    commission,
    critical_factor,
    directions,
    estimate,
    example_run,
    load_survey,
    train,
    with_offset,
)
from pumplib.primer.model import regressors

NOMINAL_HEAD = 4.9e5


def test_least_squares_finds_the_coefficients_of_a_perfect_pump(healthy: list[Example]) -> None:
    w = healthy[0].w
    head, torque, B = np.array([7.0, 9e4, 8e10]), np.array([1.7e-5, 6.0, 2e5]), 3e-4
    perfect = dataclasses.replace(w, H=regressors(w) @ head, torque=regressors(w) @ torque + B * w.omega)
    model = commission(perfect, B)
    assert np.allclose(model.head, head, rtol=1e-8)
    assert np.allclose(model.torque, torque, rtol=1e-8)


def test_residual_is_zero_in_the_mean_when_healthy(machine: Machine, healthy: list[Example]) -> None:
    for one in healthy:
        r = machine.monitor.model.residual(one.w)
        assert abs(r[one.w.rest].mean()) < 1.5e-3 * NOMINAL_HEAD
        assert np.abs(r[one.w.rest]).max() < 5e-3 * NOMINAL_HEAD


def test_residual_does_not_follow_the_operating_point(machine: Machine, healthy: list[Example]) -> None:
    """Valve and speed move the pressure by hundreds of kilopascals and the residual by one."""
    for one in healthy:
        rest = one.w.rest
        assert np.ptp(one.w.H[rest]) > 1e5
        assert np.ptp(machine.monitor.model.residual(one.w)[rest]) < 0.02 * np.ptp(one.w.H[rest])


def test_a_clogging_lowers_the_pressure_by_its_own_law(machine: Machine, clogged: Example) -> None:
    w, onset = clogged.w, clogged.onset
    assert onset is not None
    kept = w.rest & (w.t > onset + 1.0)
    r = machine.monitor.model.residual(w)[kept]
    assert (r < 0).all()
    slope = (r @ -(w.Q[kept] ** 2)) / (w.Q[kept] ** 4).sum()
    assert slope == pytest.approx(1e10, rel=0.1)


def test_faults_move_the_two_residuals_in_their_directions(machine: Machine) -> None:
    mean = {fault: points.mean(axis=0) for fault, points in directions(machine, 5).items()}
    assert np.abs(mean["none"]).max() < 3
    assert mean["clogging"][0] < -10
    assert abs(mean["clogging"][1]) < 0.1 * abs(mean["clogging"][0])
    assert abs(mean["friction"][0]) < 3 < mean["friction"][1]
    assert mean["leakage"][0] < -10
    assert mean["leakage"][1] > 1.5
    assert (mean["cavitation"] < (-10, -1.5)).all()


def test_all_three_approaches_on_one_run(machine: Machine, clogged: Example) -> None:
    outcomes = machine.monitor.all(clogged.w)
    assert [one.approach for one in outcomes] == ["signal-based", "model-based", "parameter estimation"]
    for one in outcomes:
        assert one.t.shape == one.statistic.shape == one.threshold.shape
        assert np.isfinite(one.statistic).all()
    onset = clogged.onset
    assert onset is not None
    for one in outcomes[1:]:
        assert one.alarm is not None
        assert 0 <= one.alarm - onset < 5


@pytest.mark.parametrize("method", METHODS)
def test_every_threshold_method_finds_a_large_fault(machine: Machine, clogged: Example, method: str) -> None:
    found = machine.monitor.model_based(clogged.w, method)  # type: ignore[arg-type]
    assert clogged.onset is not None
    assert any(0 <= time - clogged.onset < 5 for time in found.alarms)


def test_the_size_of_a_clogging_is_estimated(machine: Machine, clogged: Example) -> None:
    found = estimate(machine.monitor.model, clogged.w)
    before = clogged.w.part(0.0, clogged.onset or 0.0)
    assert np.abs(found.clogging[before]).max() < 1e9
    assert found.clogging[-1] == pytest.approx(1e10, rel=0.3)
    assert np.allclose(found.theta + found.residual, machine.monitor.model.head, rtol=1e-12)


def test_the_estimate_without_a_fault_in_a_perfect_pump_stays(machine: Machine, healthy: list[Example]) -> None:
    w = healthy[0].w
    perfect = dataclasses.replace(w, H=regressors(w) @ machine.monitor.model.head)
    assert estimate(machine.monitor.model, perfect).distance.max() < 1e-6


def test_an_offset_is_additive(machine: Machine, healthy: list[Example]) -> None:
    w, model = healthy[0].w, machine.monitor.model
    moved = model.residual(with_offset(w, -5e3, 10.0)) - model.residual(w)
    assert np.allclose(moved, np.where(w.t >= 10.0, -5e3, 0.0), atol=1e-6)


def test_the_critical_factor_parts_alarm_from_silence(machine: Machine, clogged: Example) -> None:
    monitor, w = machine.monitor, clogged.w
    found = critical_factor(monitor.threshold, monitor.model.residual(w), w.activity)
    assert monitor.model_based(w, "adaptive", 0.999 * found).alarms
    assert not monitor.model_based(w, "adaptive", 1.001 * found).alarms


def test_learned_bands_hold_the_runs_they_come_from(machine: Machine) -> None:
    low, high = machine.monitor.bands.T
    w = machine.commissioning
    inside = (0.9 * low[0] < w.H) & (1.1 * high[0] > w.H)
    assert (low < high).all()
    assert inside.all()


def test_survey_is_what_the_thesis_says() -> None:
    shares = {one.group: (one.low, one.high) for one in load_survey()}
    assert shares["bearing faults"] == (0.4, 0.5)
    assert shares["stator faults"] == (0.3, 0.4)
    assert shares["rotor faults"] == (0.05, 0.1)
    assert all("thesis 2.2" in one.source for one in load_survey())


def test_bad_input(machine: Machine, healthy: list[Example], tmp_path) -> None:
    w = healthy[0].w
    with pytest.raises(DataError, match="at least 10"):
        train(machine.commissioning, [w], 3e-4)
    with pytest.raises(DataError, match="at rest"):
        commission(dataclasses.replace(w, activity=np.ones(len(w.t))), 3e-4)
    with pytest.raises(DataError, match="too much alike"):
        commission(dataclasses.replace(w, Q=1e-3 + 0 * w.Q, omega=300 + 0 * w.omega), 3e-4)
    with pytest.raises(ParameterError, match="adaptive, constant, cusum"):
        machine.monitor.model_based(w, "fuzzy")  # type: ignore[arg-type]
    with pytest.raises(ParameterError, match="drive"):
        example_run(machine, "none", 0.0, "random", np.random.default_rng(1))  # type: ignore[arg-type]
    with pytest.raises(ParameterError, match="cavitation"):
        example_run(machine, "cavitation", 0.5, "changes", np.random.default_rng(1))
    with pytest.raises(DataError, match="nothing is left"):
        critical_factor(machine.monitor.threshold, np.ones(3), np.zeros(3), 3)
    (tmp_path / "s.toml").write_text('[[share]]\ngroup = "x"\nlow = 0.5\nhigh = 0.4\nsource = "y"\n')
    with pytest.raises(DataError, match="must rise"):
        load_survey(tmp_path / "s.toml")
