"""Residual observers on the pump they believe in: convergence, blindness, signs, ambiguity, generated code."""

from dataclasses import replace

import numpy as np
import pytest

from pumplib.errors import DataError, ParameterError, SimulationError
from pumplib.machines.profiles import profile_machine
from pumplib.observers import residual_forms, residual_study
from pumplib.observers.residual import RESIDUALS, ResidualObserver, ResidualSettings
from pumplib.observers.residual_model import believed
from pumplib.observers.residual_nominal import (
    NominalRecord,
    ideal,
    moving_record,
    nominal_signals,
    steady_record,
)
from pumplib.observers.residual_signature import FAULTS, classify, directions, mimic
from pumplib.structure.realization_report import Outcome

BELIEF = believed(profile_machine("pump"), flow_lag=0.15, pressure_lag=0.05)
IDEAL = ideal(BELIEF)
SCALE = np.array([2000.0, 0.03, 0.03])


def test_the_nominal_pump_satisfies_its_constraints_and_its_rates_are_the_derivatives() -> None:
    for fault in FAULTS:
        size = residual_study.SIZES[fault]
        T_e, H, Q_i = nominal_signals(IDEAL, 300.0, 1.4e-3, fault, size)
        K_f, K_l, dB = (size if fault == name else 0.0 for name in ("clogging", "leakage", "friction"))
        lost = size if fault in ("cavitation", "dry_running") else 0.0
        share = {"cavitation": 0.45, "dry_running": 0.93}.get(fault, 0.0)
        assert Q_i == pytest.approx(1.4e-3 + K_l * np.sqrt(H), rel=1e-13)
        assert pytest.approx(IDEAL.head(Q_i, 300.0) * (1 - lost) - K_f * Q_i**2, rel=1e-13) == H
        assert T_e == pytest.approx((IDEAL.B + dB) * 300.0 + IDEAL.torque(Q_i, 300.0) * (1 - share * lost), rel=1e-13)
        # torque in motion: the acceleration of the liquid against central differences of Q_i
        record = moving_record(IDEAL, fault, size, 2e-4, 3.0)
        t, w, Q = record.t, record.omega, record.Q_i
        dw, dQ = np.gradient(w, t, edge_order=2), np.gradient(Q, t, edge_order=2)
        x = np.clip((t - 1.0) / 0.5, 0, 1)
        s = size * x**3 * (10 - 15 * x + 6 * x**2)
        friction = IDEAL.B + (s if fault == "friction" else 0.0)
        loss = share * s if lost else 0.0
        balance = IDEAL.J * dw + friction * w + IDEAL.torque(Q, w) * (1 - loss) - IDEAL.K_Q * dQ
        assert np.abs(balance - record.T_e)[1:-1].max() < 2e-6


@pytest.mark.parametrize("k", [1.0, 5.0, 20.0])
def test_errors_of_r2_and_r3_decay_exactly_with_k_and_r4_at_least_with_its_bound(k: float) -> None:
    t, errors = residual_study.wrong_start(BELIEF, k, duration=3.0)
    for name in ("$r_2$", "$r_3$"):
        e, rate = errors[name]
        assert abs(e[0]) > 0.05
        kept = np.abs(e) > 1e-7 * abs(e[0])  # below it the rounding of J w, a few 1e-16 k, shows
        ratio = np.log(np.abs(e[kept]) / np.abs(e[0]))
        assert np.abs(ratio + rate * (t[kept] - t[0])).max() < 1e-6
    e, rate = errors[r"$\hat\omega$ of $r_4$"]
    assert e[0] == pytest.approx(20.0, rel=0.05)
    kept = np.abs(e) > 1e-6
    assert (np.diff(np.log(np.abs(e[kept]))) <= -rate * 1e-3 * (1 - 1e-4)).all()
    assert (e[kept] > 0).all()  # no overshoot: a contraction of first order


def test_decay_rate_of_r4_is_the_derivative_of_its_error_and_stays_above_its_bound_on_the_map() -> None:
    J, B = BELIEF.J, BELIEF.B
    rng = np.random.default_rng(1)
    w, v, Q = rng.uniform(180, 320, 500), rng.uniform(180, 320, 500), rng.uniform(0, 2e-3, 500)
    for k in (1.0, 5.0):
        gain = k * J / (BELIEF.a_h1 * Q + 2 * BELIEF.a_h0 * v)
        slope = -B * (w - v) - (BELIEF.torque(Q, w) - BELIEF.torque(Q, v))
        slope -= gain * (BELIEF.head(Q, w) - BELIEF.head(Q, v))
        assert residual_study.decay_rate(BELIEF, k, w, v, Q) == pytest.approx(-slope / (J * (w - v)), rel=1e-9)
    assert residual_study.least_decay(BELIEF, 5.0) >= 5.3
    assert residual_study.least_decay(BELIEF, 1.0) >= 2.05


def test_structural_zeros_are_zero_on_the_nominal_model() -> None:
    found = residual_study.insensitivity(BELIEF)
    assert len(found) == 3 * len(residual_study.POINTS)
    assert max(s.relative for s in found) <= 1e-9
    assert all(s.reaction == 0.0 for s in found if s.residual in ("r1", "r2"))
    assert all(s.scale > 0 for s in found)


def test_in_motion_only_the_integration_is_left_of_second_order() -> None:
    coarse, fine = (residual_study.moving_insensitivity(BELIEF, dt) for dt in (2e-3, 1e-3))
    assert [s.reaction for s in fine if s.residual != "r3"] == [0.0, 0.0]
    before, after = (next(s for s in one if s.residual == "r3") for one in (coarse, fine))
    assert after.relative < 1e-6
    assert before.reaction / after.reaction == pytest.approx(4.0, rel=0.02)


@pytest.mark.parametrize("point", residual_study.POINTS)
def test_signs_and_sizes_of_the_signature_table(point: tuple[float, float]) -> None:
    small = {name: 1e-3 * size for name, size in residual_study.SIZES.items()}
    moved, table = residual_study.reactions(BELIEF, *point, sizes=small), directions(BELIEF, *point)
    signs = {"friction": (0, -1, -1), "clogging": (-1, 0, 1), "leakage": (-1, -1, 0), "cavitation": (-1, 1, 1),
             "dry_running": (-1, 1, 1)}  # fmt: skip
    for fault in FAULTS:
        assert tuple(np.sign(table[fault])) == signs[fault]
        expected = small[fault] * table[fault]
        assert moved[fault][:3] == pytest.approx(expected, rel=2e-2 if fault != "dry_running" else 5e-2, abs=1e-9)


def test_a_leakage_looks_like_clogging_with_friction_and_the_valve_decides_not_the_speed() -> None:
    K_l, point = 6e-8, (306.0, 1.6e-3)
    K_f, dB = mimic(BELIEF, *point, K_l)
    assert K_f > 0
    assert dB > 0
    effects = directions(BELIEF, *point)
    pair = K_f * effects["clogging"] + dB * effects["friction"]
    assert pair == pytest.approx(K_l * effects["leakage"], rel=1e-9, abs=1e-9)  # all three residuals agree
    slow = 190.0 / 306.0
    points = {"here": point, "valve": (306.0, 0.9e-3), "speed": (190.0, 1.6e-3 * slow)}
    here, valve, speed = residual_study.mimicry(BELIEF, K_l, SCALE[:2], points)
    assert here.apart == pytest.approx(0.0, abs=1e-9)
    assert speed.K_f == pytest.approx(here.K_f, rel=1e-9)  # along the affinity law
    assert speed.dB == pytest.approx(slow * here.dB, rel=1e-9)
    assert speed.angle_deg == pytest.approx(here.angle_deg, abs=1e-9)
    assert valve.K_f / here.K_f == pytest.approx(1.8, abs=0.05)
    assert valve.dB / here.dB == pytest.approx(1.4, abs=0.05)
    assert valve.angle_deg - here.angle_deg > 15
    assert valve.apart > 2 * speed.apart
    with pytest.raises(DataError, match="two positive"):
        residual_study.mimicry(BELIEF, K_l, (1.0, 0.0), points)


@pytest.mark.parametrize("point", [(306.0, 1.6e-3), (250.0, 1.3e-3)])
def test_classifier_names_every_fault_of_the_nominal_pump_and_lists_the_others(point: tuple[float, float]) -> None:
    moved = residual_study.reactions(BELIEF, *point, sizes=residual_study.CLASSIFIED)
    for fault, r in moved.items():
        found = classify(r[:3], SCALE, BELIEF, *point)
        assert found.fault == fault
        if fault != "dry_running":
            assert found.size == pytest.approx(residual_study.CLASSIFIED[fault], rel=0.15)
            assert found.alternatives
    leak = classify(moved["leakage"][:3], SCALE, BELIEF, *point)
    assert any("change the valve" in words for words in leak.alternatives)
    assert classify(np.array([5e3, 0.0, 0.0]), SCALE, BELIEF, *point).fault == "none"


def test_dry_running_is_a_matter_of_level() -> None:
    omega, Q = 306.0, 1.5e-3
    one = directions(BELIEF, omega, Q)["cavitation"]
    for share, named in ((0.25, "cavitation"), (0.33, "cavitation"), (0.36, "dry_running"), (0.95, "dry_running")):
        r = share * one
        assert classify(r, SCALE, BELIEF, omega, Q).fault == named


def test_directions_are_refused_where_the_map_does_not_fall() -> None:
    with pytest.raises(DataError, match="open the valve"):
        directions(BELIEF, 300.0, 1e-4)
    with pytest.raises(DataError, match="not finite"):
        classify(np.array([np.nan, 0.0, 0.0]), SCALE, BELIEF, 306.0, 1.6e-3)


def test_the_hand_written_loop_equals_the_realized_residuals() -> None:
    generated = residual_forms.pump_generators(residual_forms.pump_reports(IDEAL), 5.0)
    gaps = {}
    for dt in (2e-3, 1e-3):
        record = moving_record(IDEAL, "clogging", 1e10, dt)
        hand = residual_study.observed(IDEAL, record, ResidualSettings(smooth=0.0))
        for column, name in enumerate(RESIDUALS):
            made = generated[name]
            start = made.start(IDEAL, record)
            signals, values = residual_forms.signals(record), residual_forms.parameters(IDEAL)
            found = made.generator.run(record.t, signals, values, start).residual[:, 0]
            late = record.t > 3.0  # the two begin differently
            gaps[name, dt] = float(np.abs(found - hand[:, column])[late].max())
    assert gaps["r1", 1e-3] < 1e-8  # Pa
    for name in ("r2", "r3"):  # exact against Heun's rule: second order
        assert gaps[name, 1e-3] < 5e-6
        assert gaps[name, 2e-3] / gaps[name, 1e-3] == pytest.approx(4.0, rel=0.05)
    assert gaps["r4", 1e-3] < 1e-6  # Pa; the same rule


def test_all_four_pump_residuals_are_realized_and_c_code_equals_python() -> None:
    reports = residual_forms.pump_reports(IDEAL)
    assert {report.outcome for report in reports.values()} == {Outcome.OK}
    compiler = residual_forms.c_compiler()
    if compiler is None:
        pytest.skip("no C compiler (gcc or cc) on this machine: the C code was not compared")
    record = moving_record(IDEAL, "clogging", 1e10, duration=2.0)
    for made in residual_forms.pump_generators(reports, 5.0).values():
        found = residual_forms.compare_with_c(made, IDEAL, record, compiler)
        assert found.worst <= 1e-12
        assert found.flags_equal
        assert found.lines > 20


def test_a_compiler_that_fails_is_reported(tmp_path) -> None:  # type: ignore[no-untyped-def]
    made = residual_forms.pump_generators(residual_forms.pump_reports(IDEAL), 5.0)["r1"]
    record = moving_record(IDEAL, "clogging", 1e10, duration=2.0)
    broken = tmp_path / "cc"
    broken.write_text("#!/bin/sh\necho out of order >&2\nexit 1\n")
    broken.chmod(0o755)
    with pytest.raises(SimulationError, match="out of order"):
        residual_forms.compare_with_c(made, IDEAL, record, str(broken))


def test_angular_momentum_of_the_liquid_matters_when_the_valve_moves() -> None:
    record = moving_record(IDEAL)
    without = replace(IDEAL, K_Q=0.0)
    late = record.t > 2.0
    with_term, left_out = (np.abs(residual_study.observed(b, record)[late, 1]).max() for b in (IDEAL, without))
    assert with_term < 1e-4
    assert left_out > 20 * with_term
    assert left_out == pytest.approx(IDEAL.K_Q * 1.5e-4 * 2 * np.pi * 0.7 * 5 / np.hypot(5, 2 * np.pi * 0.7), rel=0.1)


def test_lags_of_the_sensors_are_aligned() -> None:
    # every signal through the lag of its sensor, on a ramp of speed and flow along the affinity law
    dt, n = 1e-3, 6000
    t = dt * np.arange(n)
    w = 220.0 + 40.0 * np.clip(t - 2.0, 0.0, 1.0)
    Q = 5e-6 * w
    dw = np.where((t > 2.0) & (t < 3.0), 40.0, 0.0)
    T_e, H, Q_i = nominal_signals(IDEAL, w, Q, omega_rate=dw, Q_rate=5e-6 * dw)

    def lagged(x: np.ndarray, lag: float) -> np.ndarray:
        out, gain = np.empty_like(x), -np.expm1(-dt / lag)
        value = x[0]
        for k, one in enumerate(x):
            value += gain * (one - value)
            out[k] = value
        return out

    record = NominalRecord(dt=dt, omega=w, T_e=T_e, H=lagged(H, 0.05), Q=lagged(Q, 0.15), Q_i=Q_i)
    moved = (t > 2.1) & (t < 3.0)
    aligned, raw = (np.abs(residual_study.observed(b, record)[moved, 0]).max() for b in (BELIEF, IDEAL))
    assert raw > 10_000.0
    assert aligned < raw / 20


def test_batch_pieces_and_single_samples_agree_bit_for_bit() -> None:
    record = moving_record(BELIEF, "leakage", 6e-8, duration=3.0)
    rng = np.random.default_rng(4)
    n = len(record.t)
    signals = [record.omega + rng.normal(0, 0.2, n), record.T_e, record.H + rng.normal(0, 800, n), record.Q]
    trusted = np.ones(len(record.t), dtype=bool)
    trusted[:40] = trusted[1200:1300] = False
    whole = ResidualObserver(BELIEF, record.dt).run(*signals, trusted)
    pieces = ResidualObserver(BELIEF, record.dt)
    cuts = np.split(np.arange(len(record.t)), [1, 7, 1250, 2000])
    joined = np.concatenate([pieces.run(*(s[c] for s in signals), trusted[c]).rows for c in cuts])
    assert np.array_equal(whole.rows, joined, equal_nan=True)
    single = ResidualObserver(BELIEF, record.dt)
    rows = np.stack([single.update(*(s[k] for s in signals), trusted[k]) for k in range(1500)])
    assert np.array_equal(whole.rows[:1500], rows, equal_nan=True)


def test_untrusted_samples_are_not_judged_and_start_the_generators_anew() -> None:
    record = steady_record(BELIEF, 300.0, 1.4e-3, duration=8.0)
    trusted = np.ones(len(record.t), dtype=bool)
    trusted[:500] = trusted[4000:4200] = False
    omega = np.where(trusted, record.omega, np.nan)
    found = ResidualObserver(BELIEF, record.dt).run(omega, record.T_e, record.H, record.Q, trusted)
    assert np.isnan(found.r[~trusted]).all()
    assert np.isfinite(found.r[trusted]).all()
    assert (found.flag[~trusted] & 1).all()
    settling = (found.flag & 2) > 0
    assert settling[500:2000].all()
    assert settling[4200:5700].all()
    assert not settling[2000:4000].any()
    assert not found.judged[~trusted | settling].any()
    assert found.judged[2000:4000].all()
    assert np.abs(found.r[found.judged]).max() < 1e-6


def test_head_above_the_map_and_shut_off_are_flagged() -> None:
    high = steady_record(BELIEF, 300.0, 1.4e-3, duration=3.0)
    found = ResidualObserver(BELIEF, 1e-3).run(high.omega, high.T_e, 1.6 * high.H, high.Q)
    assert (found.flag & 4).all()
    assert (found.flag & 8).all()
    assert np.isfinite(found.r).all()
    shut = steady_record(BELIEF, 300.0, BELIEF.a_h1 * 300.0 / (2 * BELIEF.a_h2) * 1.05, duration=3.0)
    found = ResidualObserver(BELIEF, 1e-3).run(shut.omega, shut.T_e, shut.H, shut.Q)
    assert (found.flag & 8).all()
    assert not (found.flag & 4).any()


def test_values_that_are_not_finite_are_refused_with_place_and_remedy_and_the_state_stays() -> None:
    record = steady_record(BELIEF, 300.0, 1.4e-3, duration=2.0)
    observer = ResidualObserver(BELIEF, record.dt)
    observer.run(record.omega, record.T_e, record.H, record.Q)
    H = record.H.copy()
    H[25] = np.nan
    with pytest.raises(DataError, match=r"H at t = 2\.025 s is not finite.*mark it as not trusted"):
        observer.run(record.omega, record.T_e, H, record.Q)
    after = observer.run(record.omega[:5], record.T_e[:5], record.H[:5], record.Q[:5])
    assert after.start == pytest.approx(2.0)
    with pytest.raises(DataError, match="differ in length"):
        observer.run(record.omega, record.T_e, record.H[:-1], record.Q)
    with pytest.raises(DataError, match="trusted has"):
        observer.run(record.omega, record.T_e, record.H, record.Q, np.ones(3, dtype=bool))
    with pytest.raises(DataError, match="five samples"):
        ResidualObserver(BELIEF, 0.1)
    with pytest.raises(DataError, match="must be one of"):
        after["nonsense"]


def test_nominal_signals_refuse_what_is_impossible() -> None:
    with pytest.raises(ParameterError, match="must be one of none"):
        nominal_signals(IDEAL, 300.0, 1e-3, "rust", 1.0)
    with pytest.raises(ParameterError, match="finite, sizes >= 0"):
        nominal_signals(IDEAL, 300.0, 1e-3, "leakage", -1.0)
    with pytest.raises(ParameterError, match="delivers no pressure"):
        nominal_signals(IDEAL, 100.0, 3e-3)
