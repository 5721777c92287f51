"""Thesis 4.4.2, 5.3: every sensor defect alone, all together in pieces, the frozen profiles, bad input."""

import dataclasses
import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import settings as effort
from hypothesis import strategies as st
from scipy import signal, stats

from pumplib.errors import DataError, ParameterError
from pumplib.machines.profiles import load_profile
from pumplib.testbench import sensors as module
from pumplib.testbench.data_sheets import (
    current_probe,
    flow_meter,
    ideal_sensors,
    pressure_transmitter,
    pump_current_sensor,
    sensor_set,
    sensor_spreads,
    voltage_probe,
)
from pumplib.testbench.filters import BLOCK, filter_coefficients
from pumplib.testbench.measurement import measure, measure_set
from pumplib.testbench.sensors import Sensor, SensorFault, SensorSet, SensorSpread, draw, saturated

DT = 1e-4
LSB = 20 / 2048
ALL_ON = Sensor.converter(
    unit="A", full_scale=20.0, bits=12, noise_lsb=1.0, gain_error=0.004, offset=0.1, lag=1e-3, anti_alias=3e3,
    rate=1e4, jitter=2e-6, dropout=0.05, on_dropout="hold",
)  # fmt: skip


def rng(seed=0):
    return np.random.default_rng(seed)


def wave(n=5000, channels=1, amplitude=10.0):
    t = np.arange(n) * DT
    return amplitude * np.sin(2 * np.pi * 43.0 * t[:, None] + np.arange(channels))


def read(sensor, truth, dt=DT, seed=0, **more):
    """Readings of one channel and the final state."""
    values, state = measure([sensor], truth, dt, rng(seed), **more)
    return values[:, 0], state


# --- each defect alone ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("rate", [None, 1e4])
def test_without_defects_a_sensor_is_the_identity(rate):
    x = wave(2 * BLOCK + 17, 3)
    values, state = measure([Sensor(unit="A", rate=rate)] * 3, x, DT, rng())
    np.testing.assert_allclose(values, x, rtol=0, atol=1e-12)
    assert state.saturated.sum() == state.missing.sum() == 0


@pytest.mark.parametrize("rate", [5000.0, 2000.0, 1000.0, 10.0])
def test_decimation_takes_every_so_many_points(rate):
    x = wave(5001)[:, 0]
    values, _ = read(Sensor(unit="A", rate=rate), x)
    np.testing.assert_array_equal(values, x[:: round(1e4 / rate)])


def test_a_rate_beside_the_grid_is_interpolated():
    t = np.arange(5001) * DT
    values, _ = read(Sensor(unit="A", rate=3000.0), 3.0 * t * t - 2 * t + 1)
    s = np.arange(len(values)) / 3000.0
    assert len(values) == 1501
    # the parabola is exact for a parabola, once it has three points
    np.testing.assert_allclose(values[2:], (3.0 * s * s - 2 * s + 1)[2:], rtol=0, atol=1e-12)


@effort(max_examples=30)
@given(st.floats(-0.5, 0.5), st.floats(-5, 5))
def test_gain_and_offset_are_affine(gain, offset):
    x = wave(300)[:, 0]
    values, _ = read(Sensor(unit="A", gain_error=gain, offset=offset), x)
    np.testing.assert_allclose(values, (1 + gain) * x + offset, rtol=0, atol=1e-12)


@pytest.mark.parametrize("lag", [2e-5, 1e-4, 0.05, 0.15, 500.0])
def test_lag_answers_a_ramp_and_a_step_as_the_differential_equation(lag):
    t = np.arange(4000) * DT
    ramp, _ = read(Sensor(unit="Pa", lag=lag), t)
    np.testing.assert_allclose(ramp, t - lag * -np.expm1(-t / lag), rtol=0, atol=1e-12 + 1e-13 * lag)
    # a step is a line between two points; from its end on the answer decays with the time constant
    step, _ = read(Sensor(unit="Pa", lag=lag), np.where(t > 0.1, 1.0, 0.0))
    k = int(np.flatnonzero(t > 0.1)[0])
    first = 1 - lag / DT * -math.expm1(-DT / lag)
    np.testing.assert_allclose(step[k:], 1 - (1 - first) * np.exp(-(t[k:] - t[k]) / lag), rtol=0, atol=1e-9)
    assert np.all(step[:k] == 0)


def test_lag_has_its_group_delay_and_attenuation():
    lag, f = 0.05, 5.0
    t = np.arange(30_000) * DT
    values, _ = read(Sensor(unit="Pa", lag=lag), np.sin(2 * np.pi * f * t))
    tail = slice(20_000, 30_000)  # whole periods, long after the start
    phasor = 2j * np.mean(values[tail] * np.exp(-2j * np.pi * f * t[tail]))
    expected = 1 / (1 + 2j * np.pi * f * lag)
    assert phasor == pytest.approx(expected, abs=1e-5)
    slow, _ = read(Sensor(unit="Pa", lag=lag), t)
    assert t[-1] - slow[-1] == pytest.approx(lag, rel=1e-9)


@pytest.mark.parametrize("lag", [0.0, 2e-3])
def test_filters_agree_with_scipy_for_piecewise_linear_input(lag):
    w = 2 * np.pi * 800.0
    b, a = signal.butter(2, w, analog=True)
    b, a = (b, a) if lag == 0 else (np.polymul(b, [1.0]), np.polymul(a, [lag, 1.0]))
    t = np.arange(600) * DT
    u = rng(1).standard_normal(600)
    u[0] = 0.0
    _, expected, _ = signal.lsim((b, a), u, t)  # first-order hold
    values, _ = read(Sensor(unit="A", lag=lag, anti_alias=800.0), u)
    np.testing.assert_allclose(values, expected, rtol=0, atol=1e-10)


def gain_at(sensor, f, n=20_000):
    """Amplitude of the readings for a sinusoid of amplitude 1 at f, which may lie above half the rate."""
    values, _ = read(sensor, np.sin(2 * np.pi * f * np.arange(n) * DT + 0.7))
    rate = sensor.rate or 1 / DT
    tail = values[len(values) // 2 :]
    basis = 2 * np.pi * f * np.arange(len(tail)) / rate
    return np.hypot(*np.linalg.lstsq(np.column_stack((np.sin(basis), np.cos(basis))), tail, rcond=None)[0])


def test_anti_alias_filter_attenuates_as_a_butterworth_filter():
    sensor = Sensor(unit="A", rate=1000.0, anti_alias=200.0)
    for f in (20.0, 200.0, 487.0, 870.0):
        held = np.sinc(f * DT) ** 2  # of the straight lines between the points
        assert gain_at(sensor, f) == pytest.approx(held / math.hypot(1, (f / 200.0) ** 2), rel=2e-3)
    nyquist = 1 / math.hypot(1, (500.0 / 200.0) ** 2)
    assert gain_at(sensor, 499.0) == pytest.approx(nyquist, rel=0.02)
    assert gain_at(Sensor(unit="A", rate=1000.0), 870.0) == pytest.approx(1.0, abs=1e-6)  # without it, aliased


def test_filters_start_settled():
    values, _ = read(Sensor(unit="Pa", lag=0.1, anti_alias=100.0), np.full(3000, 4e5))
    np.testing.assert_allclose(values, 4e5, rtol=1e-12)


def test_noise_is_white_gaussian_and_only_added():
    x = wave(100_000)[:, 0]
    values, _ = read(Sensor(unit="A", noise=0.3), x)
    e = (values - x) / 0.3
    assert stats.kstest(e, "norm").pvalue > 1e-3
    assert abs(np.mean(e[1:] * e[:-1])) < 5 / math.sqrt(len(e))


@effort(max_examples=25)
@given(st.sampled_from([1e-6, 0.01, 1.0, 200.0]), st.integers(0, 2**32))
def test_quantisation_rounds_to_the_nearest_step(step, seed):
    x = rng(seed).uniform(-1000, 1000, 400) * step
    values, _ = read(Sensor(unit="Pa", resolution=step), x)
    assert np.max(np.abs(values - x)) <= 0.5 * step * (1 + 1e-9)
    np.testing.assert_allclose(values / step, np.round(values / step), rtol=0, atol=1e-9)


def test_quantisation_error_is_uniform():
    x = rng(3).uniform(-100, 100, 50_000)
    values, _ = read(Sensor(unit="Pa", resolution=0.7), x)
    assert stats.kstest((values - x) / 0.7 + 0.5, "uniform").pvalue > 1e-3


def test_saturation_cuts_flags_and_counts():
    x = np.array([-25.0, -20.0, -19.99, 0.0, 19.99, 20.0, 25.0])
    both = Sensor(unit="A", full_scale=20.0)
    values, state = read(both, x)
    np.testing.assert_array_equal(values, np.clip(x, -20, 20))
    np.testing.assert_array_equal(saturated(both, values), [1, 1, 0, 0, 0, 1, 1])
    assert state.saturated[0] == 2
    values, state = read(Sensor(unit="A", full_scale=20.0, sides="positive"), x)
    np.testing.assert_array_equal(values, np.clip(x, 0, 20))
    assert state.saturated[0] == 4


def test_converter_has_the_codes_of_its_bits():
    x = np.linspace(-21, 21, 100_001)
    two = Sensor.converter(unit="A", full_scale=20.0, bits=12)
    values, _ = read(two, x)
    codes = np.unique(np.round(values / LSB))
    np.testing.assert_array_equal(codes, np.arange(-2048, 2048))
    assert two.resolution == LSB
    one = Sensor.converter(unit="A", full_scale=20.0, bits=8, sides="positive")
    values, _ = read(one, x)
    np.testing.assert_array_equal(np.unique(np.round(values / one.resolution)), np.arange(256))
    assert one.resolution == 20 / 256


def test_saturation_comes_before_quantisation_and_after_noise():
    sensor = dataclasses.replace(ALL_ON, dropout=0.0, noise=3.0)
    values, state = read(sensor, np.full(3000, 19.0))
    assert values.max() == 20.0 - LSB
    assert 0.3 < state.saturated[0] / 3000 < 0.7


@pytest.mark.parametrize("policy", ["nan", "hold"])
def test_dropouts_come_at_their_rate(policy):
    n, p = 40_000, 0.02
    x = wave(n)[:, 0]
    values, state = read(Sensor(unit="A", dropout=p, on_dropout=policy), x)
    lost = np.isnan(values) if policy == "nan" else values != x
    low, high = stats.binom.interval(0.999, n, p)
    assert low <= lost.sum() <= high
    assert state.missing[0] == lost.sum()
    np.testing.assert_array_equal(values[~lost], x[~lost])
    if policy == "hold":
        last = np.maximum.accumulate(np.where(lost, 0, np.arange(n)))
        np.testing.assert_array_equal(values, x[last])


def test_a_sample_lost_before_the_first_reading_is_nan():
    values, _ = read(Sensor(unit="A", dropout=1.0, on_dropout="hold"), np.ones(4))
    assert np.isnan(values).all()


def test_jitter_moves_the_instants_and_nothing_else():
    n, std, slope = 50_000, 3e-6, 7.0
    t = np.arange(n) * DT
    values, _ = read(Sensor(unit="A", jitter=std), slope * t)
    moved = (values - slope * t)[2:] / slope
    assert moved.mean() == pytest.approx(0, abs=4 * std / math.sqrt(n))
    assert moved.std() == pytest.approx(std, rel=0.02)
    assert np.abs(moved).max() <= 4 * std * (1 + 1e-6)
    constant, _ = read(Sensor(unit="A", jitter=std), np.full(100, 3.0))
    np.testing.assert_allclose(constant, 3.0, rtol=1e-14)
    # the same instants on a sinusoid, within the error of a parabola through three points
    f, s = 2 * np.pi * 50.0, 4 * std / DT
    values, _ = read(Sensor(unit="A", jitter=std), np.sin(f * t))
    worst = s * (1 + s) * (2 + s) / 6 * (f * DT) ** 3
    assert np.abs(values[2:] - np.sin(f * (t[2:] + moved))).max() < worst < 0.01 * f * 4 * std


def test_defects_do_not_disturb_each_other():
    """Switching a defect on leaves the random numbers of the others as they were."""
    x = wave(3000)[:, 0]
    noisy, _ = read(Sensor(unit="A", noise=0.1), x)
    for more in ({"jitter": 1e-9}, {"dropout": 0.3}, {"gain_error": 0.0}):
        values, _ = read(Sensor(unit="A", noise=0.1, **more), x)
        there = np.isfinite(values)
        assert there.sum() > 1500
        np.testing.assert_allclose(values[there], noisy[there], rtol=0, atol=1e-4 if "jitter" in more else 0)
    # nor does a further channel disturb the first
    two, _ = measure([Sensor(unit="A", noise=0.1)] * 2, np.column_stack((x, x)), DT, rng())
    np.testing.assert_array_equal(two[:, 0], noisy)
    assert np.corrcoef((two - x[:, None]).T)[0, 1] == pytest.approx(0, abs=0.1)


def test_same_seed_same_readings_other_seed_other_noise():
    x = wave(500)[:, 0]
    one, again, other = (read(ALL_ON, x, seed=seed)[0] for seed in (1, 1, 2))
    assert np.array_equal(one, again, equal_nan=True)
    assert not np.array_equal(one, other, equal_nan=True)


@pytest.mark.parametrize("kind", ["drift", "gain", "spike", "stuck"])
def test_order_of_the_defects_and_of_the_random_numbers(kind):
    """The whole chain as the docstring writes it, sample by sample, with the documented streams."""
    n, rate, step = 4000, 5000.0, 0.01
    x = wave(n, amplitude=7.5)[:, 0]
    analog = Sensor(unit="A", lag=1e-3, anti_alias=3e3)
    y = np.concatenate(([0.0, 0.0], read(analog, x)[0]))  # at rest before
    full = dataclasses.replace(
        analog, rate=rate, jitter=1e-5, gain_error=0.2, offset=-0.3, noise=0.5, full_scale=8.0, resolution=step,
        dropout=0.1, on_dropout="hold",
    )  # fmt: skip
    fault = SensorFault(kind=kind, onset=0.1, size=None if kind == "stuck" else 2.0, end=0.3)
    values, state = read(full, x, seed=9, faults={0: fault})
    seeds = rng(9).integers(2**63, size=(1, 3))[0]
    noise, jitter, drop = (np.random.Generator(np.random.SFC64(int(seed))) for seed in seeds)
    z, moved, lost = noise.standard_normal(n // 2), jitter.standard_normal(n // 2), drop.random(n // 2)
    expected, healthy, given, cut = [], math.nan, math.nan, 0
    for j in range(n // 2):
        three = y[2 * j : 2 * j + 3]
        r = np.polyval(np.polyfit([-2.0, -1.0, 0.0], three, 2), np.clip(moved[j], -4, 4) * 1e-5 / DT)
        r = r * 1.2 - 0.3
        active = 500 <= j < 1500
        if active and kind == "drift":
            r += 2.0 * (j / rate - 0.1)
        elif active and kind == "gain":
            r *= 3.0
        elif kind == "spike" and j == 500:
            r += 2.0
        r += 0.5 * z[j]
        cut += not -8.0 <= r <= 8.0 - step
        r = round(min(max(r, -8.0), 8.0 - step) / step) * step
        if active and kind == "stuck":
            r = healthy
        elif j < 500:
            healthy = r
        if lost[j] >= 0.1:
            given = r
        expected.append(given)
    assert cut > 20
    assert state.saturated[0] == cut
    assert state.missing[0] == np.sum(lost < 0.1)
    np.testing.assert_allclose(values, expected, rtol=0, atol=1e-9)


# --- sensor faults --------------------------------------------------------------------------------------------


def test_stuck_repeats_the_last_healthy_reading():
    x = np.arange(100.0)
    values, _ = read(Sensor(unit="A"), x, faults={0: SensorFault(kind="stuck", onset=30 * DT, end=60 * DT)})
    np.testing.assert_array_equal(values, np.r_[x[:30], np.full(30, 29.0), x[60:]])
    values, _ = read(Sensor(unit="A"), x, faults={0: SensorFault(kind="stuck", onset=0.0)})
    assert np.all(values == 0.0)
    values, _ = read(Sensor(unit="A"), x, faults={0: SensorFault(kind="stuck", onset=50 * DT, size=-1.5)})
    np.testing.assert_array_equal(values, np.r_[x[:50], np.full(50, -1.5)])


def test_drift_gain_and_spikes():
    x = np.full(100, 2.0)
    after = np.arange(100) >= 30
    drift, _ = read(Sensor(unit="A"), x, faults={0: SensorFault(kind="drift", onset=30 * DT, size=50.0)})
    np.testing.assert_allclose(drift, x + after * 50.0 * (np.arange(100) - 30) * DT, atol=1e-12)
    gain, _ = read(Sensor(unit="A"), x, faults={0: SensorFault(kind="gain", onset=30 * DT, size=-0.1)})
    np.testing.assert_allclose(gain, np.where(after, 1.8, 2.0), atol=1e-12)
    spike, _ = read(Sensor(unit="A"), x, faults={0: SensorFault(kind="spike", onset=30 * DT, size=5.0)})
    np.testing.assert_array_equal(np.flatnonzero(spike != 2.0), [30])
    many, _ = read(
        Sensor(unit="A", full_scale=6.0), x,
        faults={0: SensorFault(kind="spike", onset=30 * DT, size=5.0, period=20 * DT, end=80 * DT)},
    )  # fmt: skip
    np.testing.assert_array_equal(np.flatnonzero(many != 2.0), [30, 50, 70])
    assert many[30] == 6.0  # a spike saturates


def test_a_fault_hits_its_channel_only():
    x = wave(200, 3)
    healthy, _ = measure([ALL_ON] * 3, x, DT, rng())
    faulty, _ = measure([ALL_ON] * 3, x, DT, rng(), faults={1: SensorFault(kind="gain", onset=0.0, size=0.5)})
    same = [np.array_equal(healthy[:, c], faulty[:, c], equal_nan=True) for c in range(3)]
    assert same == [True, False, True]


# --- pieces ---------------------------------------------------------------------------------------------------


@st.composite
def runs(draw_):
    n = draw_(st.sampled_from([1, 5, 200, BLOCK, BLOCK + 1, 2 * BLOCK + 333]))
    rate = draw_(st.sampled_from([None, 1e4, 2000.0, 1000.0, 3000.0, 7.0]))
    common = {"unit": "A", "rate": rate}
    sensor = st.sampled_from(
        [
            dataclasses.replace(ALL_ON, rate=rate),
            Sensor(**common, lag=0.05, noise=0.1, resolution=0.05),
            Sensor(**common, anti_alias=400.0, dropout=0.3),
            Sensor(**common, jitter=1e-5, dropout=0.2, on_dropout="hold", noise=1.0),
            Sensor(**common),
        ]
    )
    fault = st.sampled_from(
        [
            SensorFault(kind="stuck", onset=0.01),
            SensorFault(kind="stuck", onset=0.0),
            SensorFault(kind="drift", onset=0.01, size=3.0),
            SensorFault(kind="spike", onset=0.01, size=3.0, period=0.003),
        ]
    )
    sensors = draw_(st.lists(sensor, min_size=1, max_size=3))
    faults = {0: draw_(fault)} if draw_(st.booleans()) else {}
    cuts = sorted(draw_(st.lists(st.integers(0, n), max_size=5)))
    return n, sensors, faults, [0, *cuts, n], draw_(st.integers(0, 2**32))


@effort(max_examples=60)
@given(runs())
def test_pieces_equal_the_whole_bit_for_bit(run):
    n, sensors, faults, cuts, seed = run
    x = wave(n, len(sensors), 12.0)
    whole, end = measure(sensors, x, DT, rng(seed), faults=faults)
    state, parts = None, []
    for k, (a, b) in enumerate(pairwise(cuts)):
        # the generator counts at the start only
        values, state = measure(sensors, x[a:b], DT, rng(seed + k), state, faults=faults if k == 0 else None)
        parts.append(values)
    assert np.concatenate(parts).tobytes() == whole.tobytes()
    assert state.memory.tobytes() == end.memory.tobytes()
    assert (state.points, state.samples) == (end.points, end.samples) == (n, len(whole))
    assert state.saturated.tolist() == end.saturated.tolist()
    assert state.missing.tolist() == end.missing.tolist()


def test_a_state_can_be_continued_twice():
    x = wave(600)
    _, state = measure([ALL_ON], x[:300], DT, rng())
    one, _ = measure([ALL_ON], x[300:], DT, rng(1), state)
    two, _ = measure([ALL_ON], x[300:], DT, rng(2), state)
    assert one.tobytes() == two.tobytes()


# --- machines and profiles ------------------------------------------------------------------------------------


def test_draw_stays_in_its_ranges_and_fills_them():
    spread = SensorSpread(sensor=Sensor(unit="Pa", noise=1.0), gain_error=(-0.01, 0.03), offset=(-5.0, 20.0))
    generator = rng(5)
    drawn = [draw(spread, generator) for _ in range(3000)]
    gains, offsets = np.array([s.gain_error for s in drawn]), np.array([s.offset for s in drawn])
    assert stats.kstest((gains + 0.01) / 0.04, "uniform").pvalue > 1e-3
    assert stats.kstest((offsets + 5) / 25, "uniform").pvalue > 1e-3
    assert abs(np.corrcoef(gains, offsets)[0, 1]) < 0.08
    assert {dataclasses.replace(s, gain_error=0.0, offset=0.0) for s in drawn} == {spread.sensor}


def test_offset_at_the_ends_has_both_signs():
    generator = rng(6)
    offsets = [draw(current_probe(), generator).offset for _ in range(1000)]
    assert set(offsets) == {-0.1, 0.1}
    low, high = stats.binom.interval(0.999, 1000, 0.5)
    assert low <= sum(x > 0 for x in offsets) <= high


def test_stator_profile_has_the_frozen_numbers():
    found = sensor_spreads(load_profile("stator"))
    assert set(found) == {"voltage", "current"}
    for name, unit, full_scale in (("voltage", "V", 600.0), ("current", "A", 20.0)):
        spread = found[name]
        assert spread.gain_error == (-0.005, 0.005)
        assert spread.offset == (-0.005 * full_scale, 0.005 * full_scale)
        assert spread.offset_draw == "ends"
        step = 2 * full_scale / 4096
        assert spread.sensor == Sensor(unit=unit, full_scale=full_scale, resolution=step, noise=step, rate=1e4)
    assert found["voltage"] == voltage_probe("A")
    assert found["current"] == current_probe("A")
    other = sensor_spreads(load_profile("stator"), accuracy="B", rate=2000.0)
    assert other["voltage"] == voltage_probe("B", rate=2000.0)
    assert other["current"].gain_error == (-0.01, 0.01)
    assert other["current"].sensor.rate == 2000.0


@pytest.mark.parametrize("name", ["pump", "pump_hot"])
def test_pump_profiles_have_the_frozen_numbers(name):
    found = sensor_spreads(load_profile(name))
    pressure = Sensor(unit="Pa", lag=0.05, noise=800.0, resolution=200.0, rate=1000.0)
    flow = Sensor(unit="m3/s", lag=0.15, noise=4e-6, resolution=2e-6, rate=1000.0)
    current = Sensor(unit="A", noise=0.005, rate=1e4)
    assert found == {
        "voltage": SensorSpread(sensor=Sensor(unit="V", rate=1e4)),
        "current": SensorSpread(sensor=current, gain_error=(-0.003, 0.003)),
        "pressure": SensorSpread(sensor=pressure, offset=(-1500.0, 1500.0)),
        "flow": SensorSpread(sensor=flow, offset=(-8e-6, 8e-6)),
    }
    assert found["current"] == pump_current_sensor()
    assert found["pressure"] == pressure_transmitter()
    assert found["flow"] == flow_meter()


def test_gains_belong_to_the_machine_and_noise_to_the_run():
    machine = sensor_set(load_profile("pump"), rng(1))
    assert machine == sensor_set(load_profile("pump"), rng(1))
    assert machine != sensor_set(load_profile("pump"), rng(2))
    gains = {sensor.gain_error for sensor in machine.current}
    assert len(gains) == 3
    assert 0.0 not in gains
    n = 20_000
    truth = {
        "voltage": np.full((n, 3), 100.0), "current": np.full((n, 3), 5.0), "H": np.full(n, 4e5), "Q": np.full(n, 1e-3),
    }  # fmt: skip
    (one, _), (two, _) = (measure_set(machine, truth, DT, rng(seed)) for seed in (3, 4))
    assert not np.array_equal(one.current, two.current)
    expected = [5 * (1 + sensor.gain_error) for sensor in machine.current]
    for run in (one, two):
        np.testing.assert_allclose(run.current.mean(axis=0), expected, atol=5 * 0.005 / math.sqrt(n))
        np.testing.assert_array_equal(run.voltage, truth["voltage"])
        assert run.H.mean() == pytest.approx(4e5 + machine.pressure.offset, abs=5 * 800 / math.sqrt(n / 10))
        assert run.Q.mean() == pytest.approx(1e-3 + machine.flow.offset, abs=5 * 4e-6 / math.sqrt(n / 10))


def test_set_measures_each_signal_with_its_sensor_in_pieces_too():
    n = 4001
    machine = sensor_set(load_profile("pump"), rng(1))
    x = wave(n, 6)
    truth = {"voltage": 30 * x[:, :3], "current": x[:, 3:], "H": 4e5 + 1e4 * x[:, 0], "Q": 1e-3 + 1e-5 * x[:, 1]}
    faults = {"i_b": SensorFault(kind="stuck", onset=0.2), "Q": SensorFault(kind="drift", onset=0.1, size=1e-4)}
    whole, _ = measure_set(machine, truth, DT, rng(7), faults=faults)
    assert len(set(whole.current[2001:, 1])) == 1
    assert len(set(whole.current[2001:, 2])) > 1000
    np.testing.assert_allclose(whole.t, np.arange(n) * DT, atol=1e-12)
    np.testing.assert_allclose(whole.t_hydraulic, np.arange(401) * 1e-3, atol=1e-12)
    state, parts, generator = None, [], rng(7)
    for a, b in pairwise([0, 1234, 1234, 1239, n]):
        piece = {name: value[a:b] for name, value in truth.items()}
        part, state = measure_set(machine, piece, DT, generator, state, faults=faults if state is None else None)
        parts.append(part)
    for name in ("voltage", "current", "H", "Q", "t", "t_hydraulic"):
        joined = np.concatenate([getattr(part, name) for part in parts])
        np.testing.assert_allclose(joined, getattr(whole, name), rtol=0, atol=1e-9 if name[0] == "t" else 0)


def test_ideal_set_gives_the_truth_and_needs_no_pump():
    x = wave(300, 6)
    truth = {"voltage": x[:, :3], "current": x[:, 3:], "H": x[:, 0], "Q": x[:, 1]}
    fast, _ = measure_set(ideal_sensors(), truth, DT, rng())
    assert all(np.array_equal(getattr(fast, name), value) for name, value in truth.items())
    bare, state = measure_set(ideal_sensors(pump=False, rate=2000.0), truth, DT, rng())
    assert bare.H is bare.Q is state.hydraulic is None
    np.testing.assert_array_equal(bare.voltage, x[::5, :3])
    assert len(bare.t_hydraulic) == 0


def test_a_profile_may_say_more_than_the_frozen_ones():
    profile = {
        "sensors": {
            "rate_Hz": 5000,
            "voltage": {"full_scale_V": 400, "bits": 10, "noise_lsb": 0.5, "offset": "1 % of full scale"},
            "current": {"gain": 0.002, "noise_A": "N(0.01)", "jitter_s": 1e-6, "anti_alias_Hz": 2000},
            "pressure": {"bias_Pa": 100, "dropout": 0.1, "on_dropout": "hold", "full_scale_Pa": 1e6,
                         "sides": "positive"},
        }
    }  # fmt: skip
    found = sensor_spreads(profile)
    assert found["voltage"].sensor == Sensor.converter(unit="V", full_scale=400.0, bits=10, noise_lsb=0.5, rate=5000.0)
    assert found["voltage"].offset == (-4.0, 4.0)
    assert found["current"].sensor == Sensor(unit="A", noise=0.01, jitter=1e-6, anti_alias=2000.0, rate=5000.0)
    assert draw(found["current"], rng()).gain_error == 0.002
    assert draw(found["pressure"], rng()) == Sensor(
        unit="Pa", offset=100.0, dropout=0.1, on_dropout="hold", full_scale=1e6, sides="positive", rate=1000.0
    )
    assert "flow" not in found


# --- bad input ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("fields", "parts"),
    [
        ({"unit": "kPa"}, ["Sensor.unit", "SI unit"]),
        ({"unit": "furlong"}, ["furlong"]),
        ({"noise": -1.0}, ["Sensor.noise = -1 A", ">= 0 A"]),
        ({"noise": math.nan}, ["Sensor.noise", "finite"]),
        ({"offset": "big"}, ["Sensor.offset", "number in A"]),
        ({"full_scale": 0.0}, ["Sensor.full_scale = 0 A", "> 0 A"]),
        ({"full_scale": 1.0, "resolution": 1.0}, ["Sensor.resolution = 1 A", "full_scale = 1 A", "one step"]),
        ({"gain_error": 50.0}, ["Sensor.gain_error = 50", "0.005 for 0.5 %"]),
        ({"dropout": 2.0}, ["Sensor.dropout = 2", "0.01 for 1 %"]),
        ({"lag": -0.1}, ["Sensor.lag = -0.1 s"]),
        ({"anti_alias": 0.0}, ["Sensor.anti_alias = 0 Hz", "None"]),
        ({"rate": -5.0}, ["Sensor.rate = -5 Hz", "None"]),
        ({"rate": 1e4, "jitter": 2e-5}, ["Sensor.jitter = 2e-05 s", "tenth", "1e-05 s"]),
        ({"on_dropout": "zero"}, ["Sensor.on_dropout", "nan, hold"]),
        ({"sides": "left"}, ["Sensor.sides", "both, positive"]),
    ],
)
def test_a_wrong_data_sheet_is_refused(fields, parts):
    with pytest.raises(ParameterError) as error:
        Sensor(**{"unit": "A", **fields})
    assert [part for part in parts if part not in str(error.value)] == []


@pytest.mark.parametrize(
    ("make", "match"),
    [
        (lambda: Sensor.converter(unit="A", full_scale=20.0, bits=0), "Sensor.bits"),
        (lambda: Sensor.converter(unit="A", full_scale=20.0, bits=12.5), "whole number"),
        (lambda: SensorSpread(sensor=Sensor(unit="A"), offset=(1.0, -1.0)), r"SensorSpread.offset .* A: .*swap"),
        (lambda: SensorSpread(sensor=3), "must be a Sensor"),
        (lambda: draw(voltage_probe(), 3), "rng"),
        (lambda: voltage_probe("C"), "A, B"),
        (lambda: SensorFault(kind="drift", onset=1.0), "SensorFault.size is missing"),
        (lambda: SensorFault(kind="stuck", onset=1.0, end=0.5), "end = 0.5 s"),
        (lambda: SensorFault(kind="gain", onset=1.0, size=1.0, period=1.0), "period = 1 s"),
        (lambda: SensorFault(kind="burst", onset=1.0), "stuck, drift, gain, spike"),
        (lambda: dataclasses.replace(ideal_sensors(), pressure=Sensor(unit="A")), "SensorSet.pressure"),
        (lambda: dataclasses.replace(ideal_sensors(), flow=Sensor(unit="m3/s", rate=10.0)), "same rate"),
        (lambda: SensorSet(voltage=(Sensor(unit="V"),) * 2, current=(Sensor(unit="A"),) * 3), "three Sensors"),
        (lambda: SensorSet(voltage=(Sensor(unit="A"),) * 3, current=(Sensor(unit="A"),) * 3), "'V'"),
        (lambda: SensorSet(voltage=(Sensor(unit="V", rate=1.0),) * 3, current=(Sensor(unit="A"),) * 3), "same rate"),
    ],
)
def test_wrong_parameters_are_refused(make, match):
    with pytest.raises(ParameterError, match=match):
        make()


@pytest.mark.parametrize(
    ("change", "error", "match"),
    [
        ({"sensors": []}, ParameterError, "at least one"),
        ({"sensors": [Sensor(unit="A", rate=1e3), Sensor(unit="A", rate=2e3)]}, ParameterError, "call of their own"),
        ({"sensors": [Sensor(unit="A", rate=2e4)] * 2}, ParameterError, "above the simulation's 10000 Hz"),
        ({"sensors": [Sensor(unit="A", rate=1e4 / math.pi)] * 2}, ParameterError, "simple fraction"),
        ({"sensors": [Sensor(unit="A", jitter=5e-5)] * 2}, ParameterError, "2.5e-05 s"),
        ({"dt": 0.0}, ParameterError, "measure.dt = 0 s"),
        ({"rng": 5}, ParameterError, "default_rng"),
        ({"truth": np.zeros((5, 3))}, DataError, r"\(5, 3\).*\(points, 2\)"),
        ({"truth": "zero"}, DataError, "numbers"),
        ({"truth": np.array([[0.0, 1.0], [0.0, np.nan]])}, DataError, "channel 1 at point 1 is nan A"),
        ({"faults": {2: SensorFault(kind="stuck", onset=0.0)}}, ParameterError, "channel 2.*0 ... 1"),
        ({"faults": {0: "stuck"}}, ParameterError, "must be a SensorFault"),
    ],
)
def test_measure_refuses(change, error, match):
    arguments = {"sensors": [Sensor(unit="A")] * 2, "truth": np.zeros((5, 2)), "dt": DT, "rng": rng(), **change}
    with pytest.raises(error, match=match):
        measure(**arguments)


def test_a_state_of_another_run_is_refused():
    _, state = measure([ALL_ON], wave(50), DT, rng())
    with pytest.raises(ParameterError, match="other sensors"):
        measure([Sensor(unit="A")], wave(50), DT, rng(), state)
    with pytest.raises(ParameterError, match="another step"):
        measure([ALL_ON], wave(50), 0.5 * DT, rng(), state)
    with pytest.raises(ParameterError, match="first piece"):
        measure([ALL_ON], wave(50), DT, rng(), state, faults={0: SensorFault(kind="stuck", onset=1.0)})


@pytest.mark.parametrize(
    ("change", "error", "match"),
    [
        ({"H": None}, DataError, "'H'.*missing"),
        ({"voltage": np.zeros((3, 50))}, DataError, r"'voltage'.*\(3, 50\)"),
        ({"Q": np.zeros(49)}, DataError, "49 points"),
    ],
)
def test_measure_set_refuses(change, error, match):
    truth = {"voltage": np.zeros((50, 3)), "current": np.zeros((50, 3)), "H": np.zeros(50), "Q": np.zeros(50)}
    truth = {name: value for name, value in {**truth, **change}.items() if value is not None}
    with pytest.raises(error, match=match):
        measure_set(ideal_sensors(), truth, DT, rng())
    with pytest.raises(ParameterError, match=r"'torque'.*v_a"):
        measure_set(ideal_sensors(), truth, DT, rng(), faults={"torque": SensorFault(kind="stuck", onset=0.0)})


@pytest.mark.parametrize(
    ("sensors", "match"),
    [
        (None, "no table"),
        ({"colour": 1}, r"\[sensors\].colour"),
        ({"pressure": 5}, "must be a table"),
        ({"pressure": {"bias_Pa": "U(1)"}}, r"pressure.offset = 'U\(1\)'"),
        ({"pressure": {"bias_Pa": 1, "offset": 2}}, "same thing"),
        ({"pressure": {"noise_Pa": True}}, "must be a number"),
        ({"pressure": {"step_Pa": 1, "step": 2}}, "twice"),
        ({"current": {"noise_lsb": 1}}, "needs bits"),
        ({"current": {"bits": 12}}, "needs full_scale"),
        ({"current": {"offset": "1 % of full scale"}}, "needs a full_scale"),
        ({"full_scale": {"weight": 5}}, "voltage, current, pressure, flow"),
        ({"current": {"noise_A": -1}}, "Sensor.noise = -1 A"),
    ],
)
def test_a_wrong_profile_is_refused(sensors, match):
    with pytest.raises(ParameterError, match=match):
        sensor_spreads({"sensors": sensors})


def test_coefficients_of_a_lag_do_not_lose_digits():
    """The series for long time constants meets the formula."""
    for lag in (DT / 9.99e-4, DT / 1.001e-3):
        _, c = filter_coefficients(lag, None, DT)
        assert c[0] + c[7] + c[10] == pytest.approx(1.0, abs=1e-15)
        assert c[10] / (DT / lag) == pytest.approx(0.5, abs=2e-4)
    z = DT / (DT / 9.99e-4)
    assert filter_coefficients(DT / z, None, DT)[1][10] == pytest.approx(z / 2 - z**2 / 6 + z**3 / 24, rel=1e-12)


def test_names_of_the_channels():
    assert ideal_sensors().channels == module.CHANNELS
    assert ideal_sensors(pump=False).channels == module.CHANNELS[:6]
