"""Residual observers on a machine of the bench: commissioning, thresholds, self calibration, warm winding, start."""

from dataclasses import replace

import numpy as np
import pytest

from pumplib.errors import DataError, ParameterError
from pumplib.observers import residual_bench, residual_study
from pumplib.observers.residual import ResidualObserver
from pumplib.observers.residual_calibration import CalibrationSettings, apply_calibration, calibrate
from pumplib.observers.residual_model import commission
from pumplib.observers.residual_monitor import (
    MonitorSettings,
    activity_of,
    commission_monitor,
    pump_record,
    spans,
    teach,
)
from pumplib.observers.residual_winding import commission_winding, electrical, steady, winding_change
from pumplib.observers.stator import observe

NOMINAL = (265.0, 1.1e-3)


@pytest.fixture(scope="module")
def machine() -> residual_bench.Prepared:
    return residual_bench.prepare("pump", np.random.default_rng([6, 1]))


@pytest.fixture(scope="module")
def hot() -> residual_bench.Prepared:
    return residual_bench.prepare("pump_hot", np.random.default_rng([6, 2]))


@pytest.mark.parametrize("fault", ["clogging", "friction", "leakage", "cavitation", "dry_running"])
def test_faults_of_the_classification_claim_are_found_and_named(machine, fault) -> None:
    monitor = machine.monitor()
    shown = residual_bench.show(machine, np.random.default_rng([6, 3]), fault, residual_study.CLASSIFIED[fault])
    said = monitor.judge(shown.record)
    assert said.first is not None
    assert shown.onset < said.first < shown.onset + 4.0
    assert said.classified.fault == fault
    row = residual_bench.summary(said, shown.onset)
    assert row["false alarms"] == 0
    assert row["says"] == fault
    assert row["delay / s"] == pytest.approx(said.first - shown.onset, abs=1e-3)
    if fault == "dry_running":  # the level rule does not wait for the classification
        assert shown.onset < said.dry < said.classified_at
        assert said.dry - shown.onset < 1.0
    else:
        assert said.dry is None
        assert float(row["size"]) == pytest.approx(residual_study.CLASSIFIED[fault], rel=0.35)


def test_a_healthy_run_is_quiet_and_its_thresholds_rise_with_the_activity(machine) -> None:
    said = machine.monitor().judge(residual_bench.show(machine, np.random.default_rng([6, 4])).record)
    assert said.first is None
    assert said.classified is None
    assert residual_bench.summary(said, None)["says"] == "no alarm"
    judged = np.isfinite(said.kappa[:, 0])
    moving = judged & (said.activity > 1.0)
    at_rest = judged & (said.activity < 0.1)
    assert moving.any()
    assert (said.kappa[moving].min(axis=0) > said.kappa[at_rest].max(axis=0)).all()


def test_speed_and_torque_of_the_motor_part(machine) -> None:
    shown = residual_bench.show(machine, np.random.default_rng([6, 5]))
    errors = residual_bench.motor_errors(shown)
    assert errors.trusted > 0.97
    assert abs(errors.speed_mean) < 0.5  # rad/s
    assert errors.speed_rms < 1.0
    assert abs(errors.torque_mean) < 0.1  # N m
    assert errors.torque_rms < 0.15


def test_a_motor_that_is_switched_on_is_waited_for(machine) -> None:
    # a second without voltage, then a running machine: the observer waits, settles, and the pump part judges late
    shown = residual_bench.show(machine, np.random.default_rng([6, 6]), test="steady")
    fast, pause = shown.run.fast, 1.0
    motor, _, gain = residual_bench.knowledge("pump")
    off = np.zeros((round(pause * fast.rate), 3))
    idle = round(pause * fast.hydraulic_rate)
    found = observe(
        np.concatenate((off, fast.voltage)), np.concatenate((off, fast.current)), motor, fast.rate, gain,
        every=round(fast.rate / fast.hydraulic_rate),
    )  # fmt: skip
    assert "waits for voltage" in found.reasons()
    assert any("settling" in one for one in found.reasons())
    record = pump_record(
        found, np.concatenate((np.zeros(idle), fast.H)), np.concatenate((np.zeros(idle), fast.Q)), fast.hydraulic_rate
    )
    said = machine.monitor().judge(record)
    assert not record.side.trusted[:idle].any()
    first = int(np.argmax(record.side.trusted))
    assert idle < first < idle + 1000
    judged = np.isfinite(said.r[:, 0])
    assert int(np.argmax(judged)) >= first + 1500
    assert judged[first + 1600 :].all()
    assert said.first is None
    assert record.omega[-1] == pytest.approx(shown.record.omega[-1], abs=1e-3)


def test_a_commissioning_with_points_too_much_alike_is_refused(machine) -> None:
    motor, prior, _ = residual_bench.knowledge("pump")
    same = residual_bench.show(machine, np.random.default_rng([6, 7]), test="steady")
    with pytest.raises(DataError, match=r"too much alike.*change speed and valve"):
        commission_monitor(same.record, prior, motor)


def test_a_commissioning_without_rest_or_with_gaps_is_refused() -> None:
    _, prior, _ = residual_bench.knowledge("pump")
    n = 3000
    values = [np.full(n, x) for x in (300.0, 4.0, 4.9e5, 1.5e-3)]
    with pytest.raises(DataError, match=r"samples at rest.*record longer"):
        commission(prior, *values, np.ones(n))
    values[2][7] = np.nan
    with pytest.raises(DataError, match=r"H has 3000 samples, 1 not finite"):
        commission(prior, *values, np.zeros(n))


def test_thresholds_need_ten_runs_and_a_monitor_needs_thresholds(machine) -> None:
    motor, prior, _ = residual_bench.knowledge("pump")
    commissioned = commission_monitor(machine.commissioning, prior, motor)
    with pytest.raises(DataError, match="9 healthy runs, at least 10"):
        teach(commissioned, machine.commissioning, machine.healthy[:9])
    with pytest.raises(DataError, match="call teach"):
        commissioned.judge(machine.commissioning)


def test_the_commissioned_maps_fit_and_are_the_machines_own(machine) -> None:
    _, prior, _ = residual_bench.knowledge("pump")
    belief = machine.monitor().belief
    assert belief != prior
    for record in machine.healthy[:3]:
        found = ResidualObserver(belief, record.dt).run(
            record.omega, record.T_e, record.H, record.Q, record.side.trusted
        )
        rest = found.judged & (activity_of(found) < 0.15)
        assert np.sqrt(np.mean(found["r1"][rest] ** 2)) < 0.01 * found["H"][rest].mean()
        assert np.sqrt(np.mean(found["r2"][rest] ** 2)) < 0.02 * found["T_e"][rest].mean()


def _regressors(omega: np.ndarray, Q: np.ndarray, copper: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    w, q = omega / NOMINAL[0], Q / NOMINAL[1]
    one = np.ones_like(w)
    return np.column_stack((one, w**2, q**2, w * q)), np.column_stack((one, w, copper, q))


def test_self_calibration_takes_off_what_it_models_and_nothing_that_comes_later() -> None:
    rng = np.random.default_rng(7)
    n, dt = 15_000, 1e-3
    omega = np.repeat(rng.uniform(190, 310, 15), 1000)
    Q = np.repeat(rng.uniform(0.6e-3, 1.6e-3, 15), 1000)
    copper = np.repeat(rng.uniform(0.7, 1.3, 15), 1000)
    head, torque = _regressors(omega, Q, copper)
    r = np.column_stack((head @ [500, 800, -600, 300], torque @ [0.01, -0.015, 0.02, 0.01], torque @ [0, 0, 0.03, 0]))
    rest = np.ones(n, dtype=bool)
    # noise priors small against the traces: shrinkage is negligible and the correction must be complete
    precise = CalibrationSettings(head_noise=1.0, torque_noise=1e-5)
    learned = calibrate(r, omega, Q, copper, rest, dt=dt, nominal=NOMINAL, settings=precise)
    left = apply_calibration(r, omega, Q, copper, learned, NOMINAL, precise)
    assert np.abs(left[:, 0]).max() < 1e-3 * np.abs(r[:, 0]).max()
    assert (np.abs(left[:, 1:]).max(axis=0) < 1e-3 * np.abs(r[:, 1:]).max(axis=0)).all()
    # a fault after the healthy beginning passes unchanged
    fault = np.array([-5e3, 0.0, 0.04])
    later = apply_calibration(r + fault, omega, Q, copper, learned, NOMINAL, precise)
    assert np.abs(later - left - fault).max() < 1e-9
    # with the default priors noise alone is hardly corrected
    noise = np.column_stack((400 * rng.standard_normal(n), *(0.012 * rng.standard_normal((2, n)))))
    found = calibrate(noise, omega, Q, copper, rest, dt=dt, nominal=NOMINAL)
    assert np.abs(found.head).max() < 0.5
    assert np.abs(found.torque).max() < 0.5
    with pytest.raises(DataError, match="lengthen it"):
        calibrate(r, omega, Q, copper, np.arange(n) < 500, dt=dt, nominal=NOMINAL)


def test_self_calibration_lowers_the_thresholds_and_judges_after_the_beginning_only(machine) -> None:
    plain, calibrated = machine.monitor(), machine.monitor(MonitorSettings(self_calibration=15.0))
    assert calibrated.threshold.k0[1] < plain.threshold.k0[1]
    assert calibrated.threshold.k0[2] < plain.threshold.k0[2]
    shown = residual_bench.show(machine, np.random.default_rng([6, 8]), "friction", 2.5e-4)
    said = calibrated.judge(shown.record)
    assert np.isnan(said.r[said.residuals.t < 15.0]).all()
    assert said.first > shown.onset


def test_a_fault_within_the_healthy_beginning_is_refused(machine) -> None:
    shown = residual_bench.show(machine, np.random.default_rng([6, 9]), "clogging", 1e10, onset=5.0)
    assert shown.onset == 5.0
    with pytest.raises(ParameterError, match=r"begins at 5 s, within the 15 s"):
        residual_bench.check_beginning(shown, MonitorSettings(self_calibration=15.0))
    residual_bench.check_beginning(shown, MonitorSettings())


def test_the_winding_is_estimated_and_narrows_the_torque_threshold(hot) -> None:
    ignoring, estimating = hot.monitor(), hot.monitor(MonitorSettings(winding="estimated"))
    assert 0.0 <= estimating.rotor_share <= 1.5
    assert estimating.threshold.k0[1] < 0.9 * ignoring.threshold.k0[1]
    gaps = []
    for k in range(3):
        shown = residual_bench.show(hot, np.random.default_rng([6, 10, k]))
        true = residual_bench.true_winding(hot, shown)
        said = estimating.judge(shown.record)
        assert true[-1] == pytest.approx(0.2, abs=0.02)
        gaps.append(said.winding[-1] - true[-1])
        assert np.abs(said.winding - true).max() < 0.15  # never as far off as the belief is at the end
        assert said.first is None
    # the warm-up takes half a minute and rest is short: the estimate trails by a few per cent of r_s
    assert np.abs(gaps).max() < 0.08


def test_a_cold_winding_is_not_called_warm(machine) -> None:
    estimating = machine.monitor(MonitorSettings(winding="estimated"))
    shown = residual_bench.show(machine, np.random.default_rng([6, 11]))
    assert np.abs(estimating.judge(shown.record).winding - residual_bench.true_winding(machine, shown)).max() < 0.06


def test_without_a_map_of_the_same_motor_the_estimate_is_worthless_and_too_little_rest_is_refused(hot) -> None:
    motor, _, _ = residual_bench.knowledge("pump_hot")
    shown = residual_bench.show(hot, np.random.default_rng([6, 12]))
    true = residual_bench.true_winding(hot, shown)
    reference = commission_winding(hot.commissioning.side, motor, hot.commissioning.dt)
    good = np.abs(winding_change(shown.record.side, reference, shown.record.dt) - true)[20_000:].mean()
    # the main inductance of the sheet in place of the map: constant, 2 % off as any sheet is
    sheet = np.array([np.log(0.98 * motor.L_m_prime), 0.0, 0.0, 0.0, 0.0])
    guessed = replace(reference, coefficients=sheet)
    bad = np.abs(winding_change(shown.record.side, guessed, shown.record.dt) - true)[20_000:].mean()
    assert bad > 3 * good
    assert bad > 0.2
    short = residual_bench.show(hot, np.random.default_rng([6, 13]))
    rows = replace(short.motor, rows=short.motor.rows[:2500])
    with pytest.raises(DataError, match=r"at rest.*hold the operating points longer"):
        commission_winding(electrical(rows), motor, short.record.dt)


def test_rest_is_found_only_where_supply_and_load_stay(machine) -> None:
    shown = residual_bench.show(machine, np.random.default_rng([6, 14]))
    rest = steady(shown.record.side, shown.record.dt)
    t = shown.record.dt * np.arange(len(rest))
    assert rest.mean() > 0.15
    for change in shown.run.course.changes:
        assert not rest[(t > change + 0.1) & (t < change + 0.5)].any()
    frequency = shown.record.side.omega_s[rest]
    assert np.isfinite(frequency).all()


def test_records_that_do_not_belong_together_are_refused(machine) -> None:
    shown = residual_bench.show(machine, np.random.default_rng([6, 15]), test="steady")
    H, Q = shown.run.fast.H, shown.run.fast.Q
    with pytest.raises(DataError, match="run it with `every`"):
        pump_record(shown.motor, H, Q, 500.0)
    with pytest.raises(DataError, match="of the same time"):
        pump_record(shown.motor, H[:-5], Q, 1000.0)
    with pytest.raises(ParameterError, match="must be one of pump, pump_hot"):
        residual_bench.prepare("stator", np.random.default_rng(1))
    with pytest.raises(ParameterError, match="changes, steady"):
        residual_bench.show(machine, np.random.default_rng(1), test="ramp")
    with pytest.raises(ParameterError, match="not within the run"):
        residual_bench.show(machine, np.random.default_rng(1), "clogging", 1e10, onset=40.0)


def test_rest_after_an_instant(machine) -> None:
    said = machine.monitor().judge(residual_bench.show(machine, np.random.default_rng([6, 16])).record)
    omega, Q, r = residual_bench.rest_after(said, 5.0)
    assert r.shape == (600, 3)
    assert 150 < omega < 320
    assert 1e-4 < Q < 3e-3
    assert residual_bench.rest_after(said, 32.8) is None


def test_spans() -> None:
    assert spans(np.array([True, True, False, True])) == [(0, 2), (3, 4)]
    assert spans(np.zeros(3, dtype=bool)) == []
