"""Thesis 5.2.3, 5.3: the stator observer on a plant that is its own model, its streaming form, starts and flags."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import expm

from pumplib.errors import DataError, ParameterError
from pumplib.machines import PumpSet, load_application, load_motor, load_pump
from pumplib.machines.profile import Profile
from pumplib.motor.frames import to_phases
from pumplib.motor.short_identify import g_of_gamma
from pumplib.motor.supply import Supply, grid, terminal_voltage
from pumplib.observers import InfeasibleError
from pumplib.observers.stator import FLAGS, StatorObserver, observe
from pumplib.observers.stator_design import (
    ObserverSettings,
    design_gain,
    kernel_design,
    speed_range,
    step_polynomials,
    system,
)
from pumplib.plant import simulate
from pumplib.testbench.data_sheets import ideal_sensors
from pumplib.testbench.faults import Fault
from pumplib.testbench.machine import source
from pumplib.testbench.run import draw_bench, play, read
from pumplib.testbench.scenario import Course

MOTOR = load_motor("reference_1k5")
GAIN = {rate: design_gain(MOTOR, rate)[0] for rate in (10_000.0, 2_000.0)}
ONSET = 1.0


def nominal_run(rate, duration=3.0, connection="Y", negative=0.0, phase="b", gamma=0.02, seed=0, z_p=1):
    """The bench with everything off that the observer does not model."""
    drawn = draw_bench("stator", np.random.default_rng(seed), connection=connection).machine
    motor = replace(MOTOR, connection=connection, z_p=z_p)
    machine = replace(
        drawn, base=replace(drawn.base, motor=motor), saturation="none", sat_0=1.0, sat_6=0.0,
        asymmetry=(0.0, 0.0, 0.0), kappa_c=1.0,
    )  # fmt: skip
    fault = Fault(kind="inter_turn", size=gamma, onset=ONSET, phase=phase) if gamma else None
    supply = Supply(amplitude=325.0, frequency=Profile(((0.0, 50.0),), "lines"))
    course = Course(
        duration=duration, supply=supply, negative=negative, wave=source(), slow={"density": 0.4}, fault=fault
    )
    truth = play(machine, course)
    return read(ideal_sensors(rate=rate, pump=False), truth, np.random.default_rng(1)), truth, motor


@pytest.fixture(scope="module")
def record():
    return nominal_run(10_000.0, negative=0.02)


@pytest.mark.parametrize("rate", [1e3, 2e3, 1e4, 5e4])
def test_step_polynomials_are_the_matrix_exponential(rate):
    h, scale = 1 / rate, speed_range(MOTOR)[1]
    p = step_polynomials(MOTOR, h, scale)
    for omega in np.linspace(0.0, scale, 23):
        whole = np.zeros((4, 4), dtype=complex)
        whole[:2, :2] = system(MOTOR, omega) * h
        whole[0, 2], whole[2, 3] = h / MOTOR.L_s_prime, 1.0
        exact = expm(whole)
        expected = np.concatenate([exact[:2, :2].ravel(), exact[:2, 2] - exact[:2, 3], exact[:2, 3]])
        powers = (omega / scale) ** np.arange(10)
        found = p[:, ::2] @ powers[::2] + 1j * p[:, 1::2] @ powers[1::2]
        np.testing.assert_allclose(found, expected, rtol=2e-11)


@pytest.mark.parametrize(("rate", "g_error", "speed_error"), [(10_000.0, 1e-5, 0.01), (2_000.0, 1e-4, 0.05)])
def test_nominal_accuracy_without_drift(rate, g_error, speed_error):
    signals, truth, motor = nominal_run(rate, duration=10.0)
    found = observe(signals.voltage, signals.current, motor, rate, GAIN[rate], every=round(rate / 1000))
    a_k2 = np.exp(2j * np.pi / 3 * 2)  # phase b
    g_c = g_of_gamma(0.02, "Y") / 3 * a_k2
    late = found.t > ONSET + 1.0
    assert late.sum() > 7900
    assert 3 * np.abs(found.g_c[late] - g_c).max() <= g_error
    assert np.abs(found.omega[late] - truth["omega"][late]).max() <= speed_error
    assert np.abs(found.T_e[late] - truth["T_e"][late]).max() <= 0.02
    ends = [np.abs(found.omega[a:b] - truth["omega"][a:b]).mean() for a, b in ((2500, 3500), (9000, 10_000))]
    assert abs(ends[1] - ends[0]) < 1e-4
    assert found.trusted[late].all()


def test_nominal_delta_and_two_pole_pairs():
    for connection, z_p in (("delta", 1), ("Y", 2)):
        signals, truth, motor = nominal_run(10_000.0, connection=connection, z_p=z_p, phase="c")
        found = observe(signals.voltage, signals.current, motor, 1e4, every=10)
        g_c = g_of_gamma(0.02, connection) / 3 * np.exp(2j * np.pi / 3 * 4)
        assert 3 * abs(found.g_c[-1] - g_c) < 1e-5
        assert abs(found.omega[-1] - truth["omega"][-1]) < 0.01
        assert abs(found.T_e[-1] - truth["T_e"][-1]) < 0.02


def test_time_constants_are_the_settings():
    """After a step of the fault the coefficient closes in with the time constant asked for, the speed with its own."""
    signals, _, motor = nominal_run(10_000.0)
    for tau in (0.05, 0.12):
        found = observe(signals.voltage, signals.current, motor, 1e4, GAIN[1e4], every=10,
                        settings=ObserverSettings(tau_fault=tau))  # fmt: skip
        final = found.g_c[-1]
        reached = np.real(found.g_c / final)
        later = found.t[np.flatnonzero((found.t > ONSET) & (reached > 1 - math.exp(-1)))[0]] - ONSET
        assert later == pytest.approx(tau, rel=0.25)


def test_streaming_chunks_and_batch_give_the_same_bits(record):
    signals, _, motor = record
    v, i = signals.voltage[:6000], signals.current[:6000]
    whole = observe(v, i, motor, 1e4, GAIN[1e4], every=7)
    piecewise, single = (StatorObserver(motor, 1e4, GAIN[1e4], every=7) for _ in range(2))
    cuts = [0, 1, 2, 8, 1003, 1003, 4444, 6000]
    rows = np.concatenate([piecewise.run(v[a:b], i[a:b]).rows for a, b in itertools.pairwise(cuts)])
    np.testing.assert_array_equal(rows, whole.rows)
    estimates = [one for k in range(len(v)) if (one := single.update(v[k], i[k])) is not None]
    assert len(estimates) == len(whole.rows) == 6000 // 7
    np.testing.assert_array_equal([one.omega for one in estimates], whole.omega)
    np.testing.assert_array_equal([one.g_c for one in estimates], whole.g_c)
    np.testing.assert_array_equal([one.T_e for one in estimates], whole.T_e)
    np.testing.assert_array_equal([one.flag for one in estimates], whole.flag)
    np.testing.assert_allclose([one.t for one in estimates], whole.t, rtol=1e-12)
    assert single.samples == 6000


def test_rows_are_means_of_samples(record):
    signals, _, motor = record
    full = observe(signals.voltage, signals.current, motor, 1e4, GAIN[1e4])
    rows = observe(signals.voltage, signals.current, motor, 1e4, GAIN[1e4], every=20)
    assert rows.rate == 500.0
    np.testing.assert_allclose(rows.t, full.t[19::20])
    for name in ("omega", "g_re", "T_e", "e2", "v2", "iv_im"):
        np.testing.assert_allclose(
            rows.column(name)[50:], full.column(name).reshape(-1, 20).mean(axis=1)[50:], rtol=1e-9, atol=1e-12
        )


def test_copy_and_reset(record):
    signals, _, motor = record
    v, i = signals.voltage[:3000], signals.current[:3000]
    one = StatorObserver(motor, 1e4, GAIN[1e4])
    first = one.run(v, i)
    twin = one.copy()
    np.testing.assert_array_equal(twin.run(v, i).rows, one.run(v, i).rows)
    one.reset()
    np.testing.assert_array_equal(one.run(v, i).rows, first.rows)


def start_record(supply, duration):
    machine = PumpSet(motor=MOTOR, pump=load_pump("multistage_1k5"), application=load_application("multistage_1k5"))
    done = simulate(machine, supply, duration=duration, step=1e-4)
    v, _ = terminal_voltage(supply, 0.0, 1e-4, len(done.omega))
    return to_phases(v), to_phases(done.i_s), done.omega


RUN_UP = Supply(amplitude=325.0, boost=20.0, frequency=Profile(((0.0, 1.0), (2.45, 50.0)), "lines"))


@pytest.mark.parametrize(("supply", "duration", "lag"), [(grid(400), 1.5, 1.0), (RUN_UP, 3.2, 9.0)])
@pytest.mark.parametrize("begin", [0.0, 0.03, 0.1, 0.2])
def test_no_false_lock_when_started_during_the_run_up(supply, duration, lag, begin):
    v, i, omega = start_record(supply, duration)
    k = round(begin * 1e4)
    observer = StatorObserver(MOTOR, 1e4, GAIN[1e4], every=10)
    found = observer.run(v[k:], i[k:])
    truth = omega[k:][9::10][: len(found.rows)]
    assert found.trusted[-1]
    assert abs(found.omega[-1] - truth[-1]) < 0.01
    assert abs(found.g_c[-1]) < 1e-6
    # what is trusted is right, up to the lag behind a ramp
    assert np.abs(found.omega - truth)[found.trusted].max() < lag
    assert found.trusted.mean() > 0.4
    assert observer.restarts > 0 or begin > 0.05 or duration > 2  # synchronism is far from the true speed


def test_speed_follows_the_slope_of_the_supply():
    """With it the lag behind a ramp of 20 Hz/s is gone, and nothing changes where the frequency rests."""
    v, i, omega = start_record(RUN_UP, 3.2)
    truth = omega[9::10]
    lag = {}
    for tau in (0.0, 0.05):
        found = observe(v, i, MOTOR, 1e4, GAIN[1e4], every=10, settings=ObserverSettings(tau_slope=tau))
        lag[tau] = np.abs(found.omega - truth[: len(found.omega)])
    assert lag[0.0][1500:2400].max() > 1.5
    assert lag[0.05][1500:2400].max() < 0.3
    assert max(one[-100:].max() for one in lag.values()) < 0.01


def test_waits_for_voltage_and_starts_again(record):
    signals, truth, motor = record
    v, i = signals.voltage.copy(), signals.current.copy()
    v[:5000] *= 0.1
    v[15_000:17_000] *= 0.05
    found = observe(v, i, motor, 1e4, GAIN[1e4], every=10)
    assert np.isnan(found.omega[:500]).all()
    assert not found.trusted[:800].any()
    assert "waits for voltage" in found.reasons()
    assert np.isnan(found.omega[1600:1690]).all()
    assert found.trusted[-300:].all()
    assert abs(found.omega[-1] - truth["omega"][-1]) < 0.3


def test_starts_far_outside_the_band(record):
    signals, truth, motor = record
    observer = StatorObserver(motor, 1e4, GAIN[1e4], every=10, settings=ObserverSettings(start_speed=90.0))
    found = observer.run(signals.voltage, signals.current)
    assert abs(found.omega[-1] - truth["omega"][-1]) < 0.3


def test_gain_is_certified_and_an_impossible_rate_is_refused():
    for rate in (2e3, 1e4):
        _, certificate = design_gain(MOTOR, rate)
        assert certificate.decay >= 60.0
        assert certificate.points == 201
    with pytest.raises((InfeasibleError, ParameterError), match=r"decay"):
        design_gain(MOTOR, 2e3, decay_rate=1990.0)


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"every": 0}, "every = 0"),
        ({"every": 1.5}, "every = 1.5"),
        ({"reference": complex(np.nan, 0)}, "reference"),
        ({"rate": 200.0}, "rate = 200 Hz"),
        ({"settings": ObserverSettings(tau_speed=2e-4)}, "tau_speed"),
    ],
)
def test_wrong_arguments_are_refused(change, text):
    arguments = {"rate": 1e4, **change}
    with pytest.raises(ParameterError, match=text):
        StatorObserver(MOTOR, arguments.pop("rate"), GAIN[1e4], **arguments)


def test_foreign_gain_is_refused():
    wrong = replace(GAIN[1e4], K=(np.zeros((3, 1)),))
    with pytest.raises(ParameterError, match="design_gain"):
        kernel_design(MOTOR, 1e4, wrong, ObserverSettings())


def test_wrong_samples_are_refused_and_leave_the_state():
    rng = np.random.default_rng(0)
    v, i = rng.standard_normal((50, 3)), rng.standard_normal((50, 3))
    observer = StatorObserver(MOTOR, 1e4, GAIN[1e4])
    observer.run(v, i)
    before = observer._state.copy()
    bad = v.copy()
    bad[7, 1] = np.nan
    with pytest.raises(DataError, match=r"v_b at sample 57 is nan V"):
        observer.run(bad, i)
    with pytest.raises(DataError, match=r"\(50, 2\).*phase missing"):
        observer.run(v[:, :2], i)
    with pytest.raises(DataError, match="49"):
        observer.run(v, i[:-1])
    with pytest.raises(DataError, match="numbers"):
        observer.run([["x", "y", "z"]], i[:1])
    np.testing.assert_array_equal(observer._state, before)
    assert len(FLAGS) == 8
    with pytest.raises(ParameterError, match="column 'speed'"):
        observer.run(v, i).column("speed")
