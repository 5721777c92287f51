"""Thesis 5.3: sequences of a window, commissioning, verdict, baselines, alarm; records that cannot be used."""

from dataclasses import replace

import numpy as np
import pytest

from pumplib.errors import DataError, ParameterError
from pumplib.machines import load_motor
from pumplib.motor.frames import to_phases
from pumplib.motor.phasor import steady_currents
from pumplib.motor.short_identify import fault_coefficient as ideal_coefficient
from pumplib.observers.stator import COLUMNS, Estimates, observe
from pumplib.observers.stator_alarm import fault_signal, run_alarm, tune_alarm
from pumplib.observers.stator_baselines import compensated, observer_difference, raw_negative_sequence, regressed
from pumplib.observers.stator_check import check_record, require_usable
from pumplib.observers.stator_commission import UNKNOWNS, Tolerances, believed, commission
from pumplib.observers.stator_decision import TURNS, between_axes, decide, deviation
from pumplib.observers.stator_design import design_gain
from pumplib.observers.stator_diagnose import diagnose, learn_machine
from pumplib.observers.stator_score import ScoreSettings, belief, draw_test, score_run
from pumplib.observers.stator_sequences import (
    Sequences,
    admittance,
    fault_coefficient,
    sequences,
    sliding,
    solve_products,
)
from pumplib.testbench.run import play, read

MOTOR = load_motor("reference_1k5")
RATE = 10_000.0
GAIN = design_gain(MOTOR, RATE)[0]


RHO = 0.02 * np.exp(1j)


def window(motor=MOTOR, f=45.0, slip=0.03, rho=RHO, fault=0.0, eps_v=0.0, eps_i=0.0, zeta=0.0):
    """Exact sequences of a steady machine; `fault` is added to I_2 as the ideal coefficient of the true impedance."""
    w_s = np.array(2 * np.pi * f)
    w = w_s * (1 - slip)
    y_1, Y_2 = admittance(motor, w_s, w), admittance(motor, -w_s, w)
    conj_Z = motor.r_s - 1j * w_s * motor.L_ls
    y_2 = Y_2 * rho + fault / conj_Z + eps_i * np.conj(y_1) - Y_2 * motor.r_s * zeta * np.conj(y_1)
    # a gain difference of the voltage channels shows as a negative sequence that is not there
    return Sequences(
        t=np.array(1.0), omega_s=w_s, omega=w, V_1=np.array(300.0), rho=np.array(rho + eps_v), y_1=y_1, y_2=y_2,
        g_c=np.array(fault + 0.0j), flag=np.array(0),
    )  # fmt: skip


def three_phase(rate, seconds, f=50.0, V=325.0, rho=0.0, i_1=3.0, angle=-0.8, i_2=0.0):
    z = np.exp(2j * np.pi * f * np.arange(round(rate * seconds)) / rate)
    v = V * (z + rho * z.conj())
    i = i_1 * np.exp(1j * angle) * z + i_2 * z.conj()
    return to_phases(v), to_phases(i)


def healthy_record(rate=RATE, seconds=0.6, motor=MOTOR, f=50.0):
    w_s = 2 * np.pi * f
    i_s, _ = steady_currents(motor, np.array(325.0), np.array(w_s), np.array(0.97 * w_s))
    return three_phase(rate, seconds, f, i_1=abs(i_s), angle=float(np.angle(i_s)))


class TestSequences:
    def test_products_are_solved_exactly(self):
        rng = np.random.default_rng(0)
        for _ in range(20):
            V1, V2, I1, I2 = (complex(*rng.standard_normal(2)) * size for size in (300, 20, 5, 1))
            rho, square, y_1, y_2 = solve_products(
                np.array(2 * V1 * V2), np.array(abs(V1) ** 2 + abs(V2) ** 2),
                np.array(I1 * np.conj(V1) + I2 * np.conj(V2)), np.array(I1 * V2 + I2 * V1),
            )  # fmt: skip
            assert rho == pytest.approx(V2 / np.conj(V1), rel=1e-12)
            assert square == pytest.approx(abs(V1) ** 2, rel=1e-12)
            assert y_1 == pytest.approx(I1 / V1, rel=1e-12)
            assert y_2 == pytest.approx(I2 / np.conj(V1), rel=1e-12)

    def test_window_finds_the_phasors_it_was_made_of(self):
        rho, i_2 = 0.02 * np.exp(0.7j), 0.3 * np.exp(-2j)
        v, i = three_phase(RATE, 1.0, 43.0, rho=rho, i_2=i_2)
        found = sequences(observe(v, i, MOTOR, RATE, GAIN, every=10), 0.3, 0.9)
        assert abs(found.rho - rho) < 1e-6
        assert abs(found.y_1 - 3.0 * np.exp(-0.8j) / 325) < 1e-7
        assert abs(found.y_2 - i_2 / 325) < 1e-7
        assert float(found.V_1) == pytest.approx(325.0, rel=1e-6)
        assert found.omega_s == pytest.approx(2 * np.pi * 43, rel=1e-3)

    def test_admittance_is_the_steady_state(self):
        i_s, _ = steady_currents(MOTOR, np.array(1.0), np.array(-300.0), np.array(290.0))
        assert admittance(MOTOR, np.array(-300.0), np.array(290.0)) == pytest.approx(complex(i_s), rel=1e-12)

    def test_sliding_ends_as_the_single_window(self):
        v, i = three_phase(RATE, 1.0, rho=0.01)
        found = observe(v, i, MOTOR, RATE, GAIN, every=10)
        moving, one = sliding(found, 0.4, 0.1), sequences(found, 0.6, 1.0)
        assert moving.t[-1] == pytest.approx(1.0, abs=2e-3)
        assert moving.y_2[-1] == pytest.approx(complex(one.y_2), rel=1e-9)

    def test_refusals(self):
        v, i = three_phase(RATE, 0.5)
        found = observe(v, i, MOTOR, RATE, GAIN, every=10)
        with pytest.raises(DataError, match=r"0\.2 to 0\.7"):
            sequences(found, 0.2, 0.7)
        with pytest.raises(DataError, match=r"0\.1 s"):
            sequences(found, 0.2, 0.25)
        with pytest.raises(DataError, match="record of"):
            sliding(found, 0.9)
        coarse = Estimates(rate=100.0, start=0.0, rows=np.ones((100, len(COLUMNS))), pole_pairs=1)
        with pytest.raises(DataError, match="200 Hz"):
            sequences(coarse, 0.1, 0.9)
        dead = Estimates(rate=1000.0, start=0.0, rows=np.zeros((1000, len(COLUMNS))), pole_pairs=1)
        with pytest.raises(DataError, match="no voltage"):
            sequences(dead, 0.1, 0.9)


class TestCommissioning:
    def truth(self, rng):
        scale = rng.uniform(0.98, 1.02, 5)
        names = ("r_s", "r_r", "L_m", "L_ls", "L_lr")
        motor = replace(MOTOR, **{n: s * getattr(MOTOR, n) for n, s in zip(names, scale, strict=True)})
        gains = {n: 1e-3 * complex(*rng.standard_normal(2)) for n in ("eps_v", "eps_i")}
        return motor, gains

    def records(self, rng, count):
        motor, gains = self.truth(rng)
        return motor, gains, [
            window(motor, f=rng.uniform(30, 50), slip=rng.uniform(0.01, 0.05),
                   rho=rng.uniform(0.01, 0.03) * np.exp(2j * np.pi * rng.uniform()), **gains)
            for _ in range(count)
        ]  # fmt: skip

    def test_prediction_gets_better_with_records(self):
        """The part of the healthy coefficient that is not predicted shrinks, and the covariance says so."""
        left = {0: [], 1: [], 6: []}
        claimed = {0: [], 1: [], 6: []}
        for seed in range(20):
            rng = np.random.default_rng(seed)
            records = self.records(rng, 7)[2]
            for count in left:
                tight = Tolerances(warm=0.0, model=0.0, noise=1e-5)
                known = commission(records[:count], MOTOR, tight) if count else believed(MOTOR, tight)
                d, C, _ = deviation(known, records[6])
                left[count].append(abs(d))
                claimed[count].append(np.sqrt(np.trace(C)))
        for numbers in (left, claimed):
            assert np.median(numbers[1]) < 0.6 * np.median(numbers[0])
            assert np.median(numbers[6]) < 0.6 * np.median(numbers[1])
        assert np.median(left[6]) < 1e-4

    def test_directions_are_derivatives_of_the_exact_model(self):
        base, s = fault_coefficient(MOTOR, window()), window()
        known = believed(MOTOR)
        for k, name in enumerate(UNKNOWNS[:5]):
            size = 1e-4
            other = replace(MOTOR, **{name: (1 + size) * getattr(MOTOR, name)})
            change = fault_coefficient(MOTOR, window(other)) - base
            unit = replace(known, mean=np.eye(12)[k] * size)
            assert unit.predict(s)[0] == pytest.approx(change, rel=2e-2, abs=1e-12)
        for name, place in (("eps_v", 5), ("eps_i", 7), ("zeta", 9)):
            for turn, part in ((0, 1e-4), (1, 1e-4j)):
                seen = window(**{name: part})
                unit = replace(known, mean=np.eye(12)[place + turn] * 1e-4)
                assert unit.predict(seen)[0] == pytest.approx(fault_coefficient(MOTOR, seen), rel=2e-2, abs=1e-9)

    def test_order_of_records_does_not_matter(self):
        _, _, records = self.records(np.random.default_rng(3), 4)
        one, two = commission(records, MOTOR), commission(records[::-1], MOTOR)
        np.testing.assert_allclose(one.mean, two.mean, rtol=1e-6, atol=1e-10)
        np.testing.assert_allclose(one.covariance, two.covariance, rtol=1e-6, atol=1e-14)

    def test_warm_window_finds_the_resistance(self):
        """Healthy windows of the present run tell how warm the winding is."""
        rng = np.random.default_rng(5)
        motor, gains, records = self.records(rng, 12)
        known = commission(records, MOTOR)
        hot = replace(motor, r_s=1.18 * motor.r_s, r_r=1.18 * motor.r_r)
        before = abs(known.r_s[0] / hot.r_s - 1)
        for _ in range(6):
            known = known.update(window(hot, rho=0.03 * np.exp(2j * np.pi * rng.uniform()), **gains), cold=False)
        assert abs(known.r_s[0] / hot.r_s - 1) < 0.5 * before
        assert known.r_s[1] < 0.04 * hot.r_s

    def test_refusals(self):
        with pytest.raises(DataError, match="at least one"):
            commission([], MOTOR)
        bad = replace(window(), y_2=np.array(np.nan + 0j))
        with pytest.raises(DataError, match="finite"):
            commission([bad], MOTOR)
        with pytest.raises(ParameterError, match=r"Tolerances\.gain"):
            Tolerances(gain=-0.1)


class TestVerdict:
    healthy = commission([window(rho=0.02 * np.exp(1j * a)) for a in (0.0, 2.0, 4.0)], MOTOR, Tolerances(warm=0.0))

    def short(self, gammas, r_f=0.0, kappa=1.0):
        g = ideal_coefficient(gammas, MOTOR.r_s, MOTOR.L_ls, 2 * np.pi * 45, connection="Y", r_f=r_f, kappa_c=kappa)
        return window(fault=complex(g))

    @pytest.mark.parametrize("k", [0, 1, 2])
    @pytest.mark.parametrize(("r_f", "kappa"), [(0.0, 1.0), (0.0, 0.0), (0.25, 0.5), (5.0, 0.0)])
    def test_phase_whatever_contact_and_leakage(self, k, r_f, kappa):
        gammas = np.zeros(3)
        gammas[k] = 0.05
        found = decide(self.healthy, self.short(gammas, r_f, kappa), threshold=1e-3, r_s=MOTOR.r_s)
        assert found.phase == "abc"[k]
        assert abs(found.angle) < np.radians(25)
        assert found.kind in ("one phase", "undecided")

    def test_size_does_not_depend_on_the_leakage(self):
        for kappa in (0.0, 0.5, 1.0):
            found = decide(self.healthy, self.short([0.0, 0.05, 0.0], kappa=kappa), r_s=MOTOR.r_s)
            assert found.alarm
            assert found.gamma == pytest.approx(0.05, rel=0.01)
            assert found.interval[0] < 0.05 < found.interval[1]
            assert found.turns == pytest.approx(0.05 * TURNS, rel=0.01)
            assert "lower bound" in found.note

    def test_contact_resistance_hides_turns(self):
        found = decide(self.healthy, self.short([0.05, 0.0, 0.0], r_f=0.25), r_s=MOTOR.r_s)
        expected = 0.05 / (1 + 0.25 / (0.05 * MOTOR.r_s))
        assert found.gamma == pytest.approx(expected, rel=0.01)

    def test_resistance_error_comes_back(self):
        s = self.short([0.0, 0.0, 0.05])
        low, high = (decide(self.healthy, s, r_s=f * MOTOR.r_s).gamma for f in (0.9, 1.1))
        assert high / low == pytest.approx(1.1 / 0.9, rel=0.02)

    @pytest.mark.parametrize(("gammas", "phase"), [([1, -1, 0], "ab"), ([0, 1, -1], "bc"), ([-1, 0, 1], "ca")])
    def test_two_phase_loops(self, gammas, phase):
        for kappa, r_f in ((1.0, 0.0), (0.5, 0.1)):
            found = decide(self.healthy, self.short(0.05 * np.array(gammas), r_f, kappa))
            assert (found.kind, found.phase) == ("two phases", phase)
            assert np.isnan(found.gamma)

    def test_axes_of_two_phase_loops(self):
        g = [ideal_coefficient(x, MOTOR.r_s, MOTOR.L_ls, 1e-3, connection="Y")
             for x in ([0.1, -0.1, 0], [0, 0.1, -0.1], [-0.1, 0, 0.1])]  # fmt: skip
        np.testing.assert_allclose(np.array(g) / np.abs(g), between_axes(), atol=1e-3)

    def test_what_no_short_gives(self):
        """A negative sequence that leads every sector is not a short."""
        centre = np.exp(1j * (-np.radians(40) + np.radians(52)))
        found = decide(self.healthy, window(fault=0.05 * centre))
        assert found.alarm
        assert found.kind == "no short"
        assert np.isnan(found.gamma)

    def test_healthy_window(self):
        found = decide(self.healthy, window(rho=0.025 * np.exp(3j)))
        assert not found.alarm
        assert found.kind == "healthy"
        assert np.isnan(found.gamma)

    def test_refusals(self):
        with pytest.raises(DataError, match="swapped"):
            decide(self.healthy, replace(window(), flag=np.array(32)))
        with pytest.raises(DataError, match="balanced"):
            decide(self.healthy, replace(window(), flag=np.array(64)))
        with pytest.raises(DataError, match="sum to zero"):
            decide(self.healthy, replace(window(), flag=np.array(128)))
        with pytest.raises(DataError, match="standstill"):
            decide(self.healthy, replace(window(), flag=np.array(16)))
        with pytest.raises(DataError, match="finite"):
            decide(self.healthy, replace(window(), y_2=np.array(np.nan + 0j)))
        with pytest.raises(ParameterError, match="threshold"):
            decide(self.healthy, window(), threshold=0.0)
        with pytest.raises(ParameterError, match="r_s"):
            decide(self.healthy, window(), r_s=-1.0)
        with pytest.raises(ParameterError, match="turns"):
            decide(self.healthy, window(), turns=2.5)
        with pytest.raises(ParameterError, match="source"):
            deviation(self.healthy, window(), "both")


class TestBaselines:
    def test_unbalance_moves_raw_but_not_compensated(self):
        records = [window(rho=0.01)]
        for rho in (0.01, 0.03, 0.03j):
            s = window(rho=rho)
            assert abs(compensated(MOTOR, s, records)) < 1e-12
            assert abs(observer_difference(s, records)) < 1e-12
            assert abs(regressed(MOTOR, s, records)) < 1e-12
        raw = [float(raw_negative_sequence(window(rho=rho))) for rho in (0.01, 0.03)]
        assert raw[1] == pytest.approx(3 * raw[0])

    def test_regression_learns_a_wrong_impedance(self):
        other = replace(MOTOR, L_lr=1.1 * MOTOR.L_lr)
        shown = [window(other, rho=0.02 * np.exp(1j * a)) for a in (0, 2, 4)]
        shown = [replace(s, g_c=fault_coefficient(MOTOR, s)) for s in shown]
        new = window(other, rho=0.03 * np.exp(1j))
        new = replace(new, g_c=fault_coefficient(MOTOR, new))
        assert abs(regressed(MOTOR, new, shown, ridge=1e-9)) < 0.1 * abs(observer_difference(new, shown))
        with pytest.raises(DataError, match="at least one"):
            regressed(MOTOR, new, [])


class TestAlarm:
    def test_cusum_on_the_bench(self):
        known = ScoreSettings(gamma=0.05)
        test = draw_test(known, np.random.default_rng([77, 1]))
        healthy = draw_test(ScoreSettings(), np.random.default_rng([77, 1]))
        quiet = fault_signal(healthy.estimates, healthy.healthy.reference)
        rule = tune_alarm([quiet], smallest=0.02)
        assert run_alarm(quiet, rule).first() is None
        alarm = run_alarm(fault_signal(test.estimates, test.healthy.reference), rule).first()
        assert 0.5 < alarm.sample * 1e-3 < 0.6

    def test_refusals(self):
        with pytest.raises(DataError, match="trusted rows"):
            tune_alarm([np.full(5, np.nan)], 0.02)
        with pytest.raises(DataError, match="at least one"):
            tune_alarm([], 0.02)
        with pytest.raises(DataError, match="vary"):
            tune_alarm([np.ones(5)], 0.02)
        with pytest.raises(ParameterError, match="reference"):
            fault_signal(observe(*healthy_record(), MOTOR, RATE, GAIN), complex("nan"))


class TestBadRecords:
    """Clear error or flag, never a silent estimate."""

    v, i = healthy_record()

    def problems(self, v, i, rate=RATE):
        return [one.problem for one in check_record(v, i, rate, MOTOR)]

    def test_healthy_record_is_usable(self):
        assert self.problems(self.v, self.i) == []
        require_usable(self.v, self.i, RATE, MOTOR)

    @pytest.mark.parametrize("seed", range(4))
    def test_bench_records_are_usable(self, seed):
        for connection in ("Y", "delta"):
            test = draw_test(ScoreSettings(gamma=0.05, records=0, connection=connection), np.random.default_rng(seed))
            assert check_record(test.signals.voltage, test.signals.current, RATE, belief(connection)) == ()

    @pytest.mark.parametrize("channel", range(6))
    def test_missing_phase(self, channel):
        v, i = self.v.copy(), self.i.copy()
        (v if channel < 3 else i)[:, channel % 3] = 0.0
        assert "dead channel" in self.problems(v, i)
        with pytest.raises(DataError, match=f"{'v' if channel < 3 else 'i'}_{'abc'[channel % 3]} has"):
            require_usable(v, i, RATE, MOTOR)
        found = observe(v, i, MOTOR, RATE, GAIN, every=10)
        assert not found.trusted[-1]
        assert any(("channel is dead" in one) for one in found.reasons())

    def test_swapped_phases_of_both(self):
        order = [0, 2, 1]
        assert self.problems(self.v[:, order], self.i[:, order]) == ["phase order"]
        found = observe(self.v[:, order], self.i[:, order], MOTOR, RATE, GAIN)
        assert np.isnan(found.omega).all()
        assert any("swapped" in one for one in found.reasons())

    def test_swapped_phases_of_one(self):
        assert self.problems(self.v, self.i[:, [1, 0, 2]]) == ["phase order"]
        assert self.problems(self.v[:, [2, 1, 0]], self.i) == ["phase order"]

    @pytest.mark.parametrize("order", [[1, 2, 0], [2, 0, 1]])
    def test_shifted_phases(self, order):
        assert self.problems(self.v, self.i[:, order]) == ["pairing"]

    def test_reversed_probes(self):
        assert self.problems(self.v, -self.i) == ["pairing"]

    @pytest.mark.parametrize("factor", [0.5, 2.0])
    def test_wrong_sampling_rate(self, factor):
        assert self.problems(self.v, self.i, factor * RATE) == ["does not fit"]
        with pytest.raises(DataError, match="sampling rate"):
            require_usable(self.v, self.i, factor * RATE, MOTOR)

    def test_wrong_scaling(self):
        assert self.problems(self.v, 0.2 * self.i) == ["does not fit"]
        assert self.problems(3 * self.v, 3 * self.i) == ["does not fit"]

    def test_saturated_channel(self):
        i = self.i.copy()
        i[:, 1] = np.clip(i[:, 1], -0.8 * np.abs(i).max(), 0.8 * np.abs(i).max())
        assert self.problems(self.v, i) == ["clipped channel"] * 2
        with pytest.raises(DataError, match="i_b sits at its largest value"):
            require_usable(self.v, i, RATE, MOTOR)

    def test_single_phase_voltage_loss(self):
        """An open supply line: the terminal floats at half the voltage of the other two."""
        v = self.v.copy()
        v[:, 0] = 0.5 * (v[:, 1] + v[:, 2])
        assert self.problems(v, self.i) == ["lost phase"]
        v[:3000] = self.v[:3000]
        found = observe(v, self.i, MOTOR, RATE, GAIN, every=10)
        assert not found.trusted[-100:].any()
        assert any("a phase is lost" in one for one in found.reasons())

    def test_nan_and_short_records(self):
        v = self.v.copy()
        v[100, 2] = np.nan
        with pytest.raises(DataError, match="v_c at sample 100"):
            check_record(v, self.i, RATE, MOTOR)
        assert self.problems(self.v[:500], self.i[:500]) == ["too short"]
        with pytest.raises(ParameterError, match="rate"):
            check_record(self.v, self.i, -1.0, MOTOR)


class TestDiagnose:
    settings = ScoreSettings(gamma=0.05, records=0, test="steady")

    def test_records_in_verdict_out(self):
        rng = np.random.default_rng([9, 5])
        test = draw_test(self.settings, rng)
        motor, signals = belief(), test.signals
        # the same machine before the fault, cold
        cold = replace(test.course, fault=None, slow={**test.course.slow, "r_s": 1.0, "r_r": 1.0})
        before = read(test.bench.sensors, play(test.bench.machine, cold), rng)
        healthy = learn_machine([(before.voltage, before.current)], RATE, motor, GAIN)
        assert healthy.records == 1
        assert not diagnose(healthy, before.voltage, before.current, RATE, GAIN).alarm
        found = diagnose(healthy, signals.voltage, signals.current, RATE, GAIN, turns=250)
        assert (found.kind, found.phase) == ("one phase", "abc"[test.phase])
        assert found.interval[0] < 0.05 < found.interval[1]
        assert found.turns == pytest.approx(250 * found.gamma)

    def test_unusable_records_are_refused(self):
        signals = draw_test(self.settings, np.random.default_rng([9, 5])).signals
        healthy = believed(belief())
        i = signals.current.copy()
        i[:, 0] = 0.0
        with pytest.raises(DataError, match="i_a has"):
            diagnose(healthy, signals.voltage, i, RATE, GAIN)
        with pytest.raises(DataError, match="does not settle"):
            diagnose(healthy, signals.voltage[:6000], signals.current[:6000], RATE, GAIN)
        with pytest.raises(DataError, match="at least one"):
            learn_machine([], RATE, belief(), GAIN)


class TestScore:
    def test_run_is_reproducible_and_shares_its_draws(self):
        settings = ScoreSettings(gamma=0.02)
        one, two = (score_run(settings, np.random.default_rng([9, 1])) for _ in range(2))
        assert str(one) == str(two)
        healthy = score_run(replace(settings, gamma=0.0), np.random.default_rng([9, 1]))
        assert healthy["warm"] == one["warm"]
        assert healthy["statistic"] < 2.9 < one["statistic"]
        assert one["phase_right"] == 1.0
        assert one["gamma_R_known"] == pytest.approx(0.02, rel=0.25)
        assert all(isinstance(value, float) for value in one.values())

    @pytest.mark.parametrize(
        "change",
        [{"connection": "delta"}, {"rate": 2000.0}, {"supply": "pwm"}, {"accuracy": "B"}, {"test": "ramp"},
         {"loop": "pair"}],
    )  # fmt: skip
    def test_every_condition_sees_a_large_short(self, change):
        found = score_run(ScoreSettings(gamma=0.1, **change), np.random.default_rng([9, 2]))
        assert found["statistic"] > 4.0
        assert found["speed_rms"] < 6.0
        if "loop" in change:
            assert found["kind"] == 2.0
        else:
            assert found["phase_right"] == 1.0
            assert found["gamma_R_known"] == pytest.approx(0.1, rel=0.2)
