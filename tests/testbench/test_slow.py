"""Thesis 4.4.2, 7.4: slow signals of synthetic wave forms whose values are known."""

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import settings as effort
from hypothesis import strategies as st

from pumplib.errors import DataError, ParameterError
from pumplib.machines.profiles import load_profile
from pumplib.motor.frames import to_phases
from pumplib.testbench.data_sheets import sensor_set
from pumplib.testbench.measurement import measure_set
from pumplib.testbench.sensors import FastSignals
from pumplib.testbench.slow import SlowSignals, slow_signals

RATE = 1e4


def fast(frequency, V=200.0, I=4.0, phi=0.6, seconds=2.0, rate=RATE, spoil=0.0, angle=0.3, **more):
    """Wave forms with rms values V and I; `spoil` scales unbalance 3 %, harmonics 2 % and 1.5 %, offsets 1 %."""
    t = np.arange(round(seconds * rate)) / rate
    f = frequency if callable(frequency) else lambda s: frequency + 0 * s
    turns = np.cumsum(f(t - 0.5 / rate)) / rate  # exact where f is a straight line
    e = np.exp(1j * (2 * np.pi * turns + angle))
    V, I, phi = (np.broadcast_to(x(t) if callable(x) else x, t.shape) for x in (V, I, phi))
    rest = spoil * (0.03 * e.conj() * np.exp(0.4j) + 0.02 * e.conj() ** 5 + 0.015 * e**7 * np.exp(1j))
    v = to_phases(math.sqrt(2) * V * (e + rest)) + 0.01 * spoil * 300 * np.array([1.0, -1.0, 1.0])
    i = to_phases(math.sqrt(2) * I * (e * np.exp(-1j * phi) + rest)) + 0.01 * spoil * 5 * np.array([-1.0, 1.0, 1.0])
    return FastSignals(rate=rate, voltage=v, current=i, **more)


def tapered(values, rate=RATE, window=1.0):
    """Hann-weighted mean of each window of a record."""
    n = round(window * rate)
    w = np.sin(np.pi * (np.arange(n) + 0.5) / n) ** 2
    return np.array([w @ values[k : k + n] / w.sum() for k in range(0, len(values) - n + 1, n)])


@effort(max_examples=40)
@given(
    f=st.floats(20.0, 80.0),
    V=st.floats(5.0, 400.0),
    I=st.floats(0.01, 50.0),
    phi=st.floats(-3.0, 3.0),
    rate=st.sampled_from([2000.0, 1e4]),
    angle=st.floats(-3.0, 3.0),
)
def test_exact_for_sinusoids(f, V, I, phi, rate, angle):
    s = slow_signals(fast(f, V, I, phi, rate=rate, angle=angle))
    np.testing.assert_allclose(s.V_rms, V, rtol=1e-9)
    np.testing.assert_allclose(s.I_rms, I, rtol=1e-9)
    np.testing.assert_allclose(s.omega_e, 2 * np.pi * f, rtol=1e-9)
    np.testing.assert_allclose(s.phi, phi, rtol=0, atol=1e-9)
    np.testing.assert_allclose(s.t, np.arange(2) + 0.5 - 0.5 / rate, atol=1e-12)
    assert s.rejected == {"electrical": 0}
    assert s.H is s.Q is None


def test_positive_phi_means_that_the_current_lags():
    """An inductance: i = 1/L integral of v, written for phase a without space vectors."""
    t = np.arange(20_000) / RATE
    w, thirds = 100 * np.pi, np.array([0.0, 2.0, 4.0]) * np.pi / 3
    v, i = 100 * np.cos(w * t[:, None] - thirds), 3 * np.sin(w * t[:, None] - thirds)
    s = slow_signals(FastSignals(rate=RATE, voltage=v, current=i))
    np.testing.assert_allclose(s.phi, np.pi / 2, atol=1e-9)
    np.testing.assert_allclose(s.V_rms, 100 / math.sqrt(2), rtol=1e-9)
    # two phases swapped on both: the frequency changes its sign, the load does not
    swapped = slow_signals(FastSignals(rate=RATE, voltage=v[:, [0, 2, 1]], current=i[:, [0, 2, 1]]))
    np.testing.assert_allclose(swapped.phi, np.pi / 2, atol=1e-9)
    np.testing.assert_allclose(swapped.omega_e, -w, rtol=1e-9)


@pytest.mark.parametrize("phi", [-1.2, 0.0, 0.6, 2.5])
def test_power_is_that_of_the_wave_forms(phi):
    signals = fast(40.0, phi=phi)
    instantaneous = np.sum(signals.voltage * signals.current, axis=1)
    np.testing.assert_allclose(slow_signals(signals).power, tapered(instantaneous), rtol=1e-9, atol=1e-6)


@pytest.mark.parametrize("f", [30.0, 33.33, 37.3, 41.7, 46.1, 50.0])
@pytest.mark.parametrize("rate", [2000.0, 1e4])
def test_unbalance_harmonics_and_offset_are_not_seen(f, rate):
    s = slow_signals(fast(f, spoil=1.0, rate=rate, seconds=3.0))
    np.testing.assert_allclose(s.V_rms, 200.0, rtol=2e-5)
    np.testing.assert_allclose(s.I_rms, 4.0, rtol=2e-5)
    np.testing.assert_allclose(s.omega_e, 2 * np.pi * f, rtol=0, atol=2e-3)
    np.testing.assert_allclose(s.phi, 0.6, rtol=0, atol=2e-6)


RAMPS = {
    "10 Hz/s": lambda t: 30 + 10 * t,
    "20 Hz/s down": lambda t: 50 - 10 * t,
    "20 Hz/s from 0.4 s on": lambda t: np.clip(30 + 20 * (t - 0.4), 30, 50),
}


@pytest.mark.parametrize("name", RAMPS)
def test_ramps_give_the_values_of_the_window(name):
    frequency = RAMPS[name]
    t = np.arange(20_000) / RATE
    s = slow_signals(fast(frequency, V=lambda t: 4.6 * frequency(t)))
    np.testing.assert_allclose(s.V_rms, tapered(4.6 * frequency(t)), rtol=2e-5)
    np.testing.assert_allclose(s.I_rms, 4.0, rtol=2e-5)
    np.testing.assert_allclose(s.omega_e, tapered(2 * np.pi * frequency(t)), rtol=0, atol=3e-3)
    np.testing.assert_allclose(s.phi, 0.6, rtol=0, atol=5e-5)


def test_a_moving_angle_costs_half_its_variance():
    """The bias that the module states."""
    swing = 0.2
    t = np.arange(20_000) / RATE
    s = slow_signals(fast(45.0, phi=lambda t: 0.6 + swing * (t % 1.0 - 0.5)))
    variance = tapered((swing * (t % 1.0 - 0.5)) ** 2)
    np.testing.assert_allclose(1 - s.I_rms / 4.0, variance / 2, rtol=0.02)
    np.testing.assert_allclose(s.phi, 0.6, atol=1e-4)


def test_pressure_and_flow_are_means_with_the_same_weight():
    t = np.arange(3000) / 1000.0
    H, Q = 4e5 + 1e5 * t, 1e-3 + 1e-4 * t**2
    s = slow_signals(fast(50.0, seconds=3.0, H=H, Q=Q, hydraulic_rate=1000.0))
    np.testing.assert_allclose(s.H, tapered(H, 1000.0), rtol=1e-12)
    np.testing.assert_allclose(s.Q, tapered(Q, 1000.0), rtol=1e-12)
    np.testing.assert_allclose(s.H, np.interp([0.4995, 1.4995, 2.4995], t, H), rtol=1e-12)


def test_windows_may_be_shorter_and_overlap():
    t = np.arange(3000) / 1000.0
    s = slow_signals(fast(lambda t: 35 + 2 * t, seconds=3.0, H=t, start=7.0, hydraulic_start=7.0), window=0.8, step=0.5)
    assert len(s.t) == 5
    np.testing.assert_allclose(s.t, 7.4 + 0.5 * np.arange(5), atol=1e-4)
    np.testing.assert_allclose(s.omega_e, 2 * np.pi * (35 + 2 * (s.t - 7.0)), atol=2e-3)
    np.testing.assert_allclose(s.H, s.t - 7.0, atol=6e-4)


def test_scattered_missing_samples_do_not_hurt():
    rng = np.random.default_rng(0)
    signals = fast(41.7, spoil=1.0, seconds=3.0, H=np.full(3000, 4e5), Q=np.full(3000, 1e-3))
    for x in (signals.voltage, signals.current, signals.H):
        x[rng.random(x.shape) < 0.01] = np.nan
    s = slow_signals(signals)
    np.testing.assert_allclose(s.V_rms, 200.0, rtol=2e-4)
    np.testing.assert_allclose(s.omega_e, 2 * np.pi * 41.7, atol=5e-3)
    np.testing.assert_allclose(s.phi, 0.6, atol=5e-4)
    np.testing.assert_allclose(s.H, 4e5, rtol=1e-12)
    np.testing.assert_allclose(s.missing_electrical, 1 - 0.99**6, atol=0.02)
    assert s.rejected == {"electrical": 0, "H": 0, "Q": 0}
    assert np.all(s.missing_Q == 0)


def test_a_window_with_too_many_missing_samples_is_nan_and_counted():
    signals = fast(41.7, seconds=4.0, H=np.full(4000, 4e5), Q=np.full(4000, 1e-3))
    signals.current[12_000:18_000, 1] = np.nan
    signals.H[2300:2700] = np.nan
    s = slow_signals(signals)
    for name in ("V_rms", "I_rms", "omega_e", "phi"):
        np.testing.assert_array_equal(np.isnan(getattr(s, name)), [False, True, False, False])
    np.testing.assert_array_equal(np.isnan(s.H), [False, False, True, False])
    assert not np.isnan(s.Q).any()
    assert s.rejected == {"electrical": 1, "H": 1, "Q": 0}
    np.testing.assert_allclose(s.phi[[0, 2, 3]], 0.6, atol=1e-9)
    # a lost voltage of 150 ms is bridged
    signals = fast(41.7, seconds=4.0)
    signals.voltage[12_000:13_500] = np.nan
    s = slow_signals(signals, max_missing=0.25)
    np.testing.assert_allclose(s.omega_e, 2 * np.pi * 41.7, rtol=1e-7)
    np.testing.assert_allclose(s.V_rms, 200.0, rtol=1e-7)
    assert 0.05 < s.missing_electrical[1] < 0.25
    # all lost
    signals.voltage[:] = np.nan
    s = slow_signals(signals)
    assert np.isnan(s.V_rms).all()
    assert s.rejected == {"electrical": 4}


def test_without_supply_there_is_no_frequency():
    signals = fast(50.0, V=lambda t: np.where(t < 1, 200.0, 0.0), I=lambda t: np.where(t < 1, 4.0, 0.0), seconds=3.0)
    s = slow_signals(signals)
    np.testing.assert_allclose(s.omega_e[0], 100 * np.pi, rtol=1e-4)
    assert np.isnan(s.omega_e[2])
    assert np.isnan(s.phi[2])
    assert s.V_rms[2] == pytest.approx(0, abs=1e-9)
    assert s.rejected == {"electrical": 0}


@pytest.mark.parametrize("name", ["pump", "stator"])
def test_with_the_sensors_of_a_profile(name):
    """Errors are those of gain and offset of the machine, the noise averages out."""
    ideal = fast(43.0, seconds=2.0)
    machine = sensor_set(load_profile(name), np.random.default_rng(3))
    n = len(ideal.voltage)
    truth = {"voltage": ideal.voltage, "current": ideal.current, "H": np.full(n, 4e5), "Q": np.full(n, 1e-3)}
    found, _ = measure_set(machine, truth, 1 / RATE, np.random.default_rng(4))
    s = slow_signals(found)
    V = 200 * (1 + np.mean([sensor.gain_error for sensor in machine.voltage]))
    I = 4 * (1 + np.mean([sensor.gain_error for sensor in machine.current]))
    np.testing.assert_allclose(s.V_rms, V, rtol=5e-5)
    np.testing.assert_allclose(s.I_rms, I, rtol=2e-4)
    np.testing.assert_allclose(s.phi, 0.6, atol=2e-3)
    np.testing.assert_allclose(s.omega_e, 86 * np.pi, atol=3e-3)
    if name == "pump":
        np.testing.assert_allclose(s.H, 4e5 + machine.pressure.offset, atol=5 * 800 * math.sqrt(1.5 / 1000))
        np.testing.assert_allclose(s.Q, 1e-3 + machine.flow.offset, atol=5 * 4e-6 * math.sqrt(1.5 / 1000))


GOOD = fast(50.0, seconds=1.0, H=np.zeros(1000), Q=np.zeros(1000))


@pytest.mark.parametrize(
    ("change", "settings", "error", "match"),
    [
        ({"voltage": np.zeros((3, 10_000))}, {}, DataError, r"FastSignals.voltage has shape \(3, 10000\)"),
        ({"current": np.zeros((9_999, 3))}, {}, DataError, "9999 of current"),
        ({"current": np.full((10_000, 3), np.inf)}, {}, DataError, "NaN"),
        ({"H": np.zeros((1000, 1))}, {}, DataError, "FastSignals.H"),
        ({"Q": np.zeros(900)}, {}, DataError, "FastSignals.Q.*same time"),
        ({"hydraulic_start": 0.5}, {}, DataError, "FastSignals.H.*same time"),
        ({"rate": 100.0}, {}, ParameterError, "FastSignals.rate = 100 Hz"),
        ({}, {"window": 1.5}, DataError, "record of 1 s"),
        ({}, {"window": 0.01}, ParameterError, "window = 0.01 s"),
        ({}, {"step": 0.0}, ParameterError, "step = 0 s"),
        ({}, {"max_missing": 1.0}, ParameterError, "max_missing = 1"),
        ({}, {"min_voltage": -1.0}, ParameterError, "min_voltage = -1 V"),
    ],
)
def test_bad_input_is_refused(change, settings, error, match):
    assert isinstance(slow_signals(GOOD), SlowSignals)
    with pytest.raises(error, match=match):
        slow_signals(dataclasses.replace(GOOD, **change), **settings)
