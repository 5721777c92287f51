import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pumplib.errors import ParameterError
from pumplib.machines import Profile
from pumplib.motor.frames import to_phases, to_space_vector, zero_sequence
from pumplib.motor.supply import Component, Supply, angle_at, grid, harmonic, negative_sequence, terminal_voltage


def test_grid_voltage_is_line_to_line_rms() -> None:
    v, zero = terminal_voltage(grid(400.0), 0.0, 1e-4, 201)
    abc = to_phases(v, zero)
    line = abc[:200, 0] - abc[:200, 1]
    assert np.sqrt(np.mean(line**2)) == pytest.approx(400.0, rel=1e-12)


@given(st.integers(2, 40), st.floats(0.001, 0.2), st.floats(-3, 3), st.floats(0, 5))
def test_harmonics_are_the_shifted_cosines_of_a_symmetric_source(order, ratio, phase, start) -> None:
    """A source whose phases have the same wave form a third of a period apart fixes the sequence of each order."""
    supply = Supply(amplitude=100.0, components=(harmonic(order, ratio, phase),))
    v, zero = terminal_voltage(supply, start, 1e-4, 50)
    theta = 100 * np.pi * (start + 1e-4 * np.arange(50))[:, None] - np.array([0, 2, 4]) * np.pi / 3
    wave = 100 * (np.cos(theta) + ratio * np.cos(order * theta + phase))
    assert np.allclose(to_space_vector(wave), v, atol=1e-9)
    assert np.allclose(zero_sequence(wave), zero, atol=1e-9)


def test_negative_sequence_turns_backwards() -> None:
    v, _ = terminal_voltage(Supply(amplitude=1.0, components=(negative_sequence(0.1, 0.5),)), 0.0, 1e-4, 200)
    forward = np.exp(2j * np.pi * 50 * 1e-4 * np.arange(200))
    assert np.mean(v * forward) == pytest.approx(0.1 * np.exp(-0.5j), abs=1e-12)


@given(st.floats(0, 5), st.floats(0, 50), st.floats(0.1, 3))
def test_angle_is_the_integral_of_the_frequency(first, last, length) -> None:
    supply = Supply(amplitude=1.0, frequency=Profile(((0.5, first), (0.5 + length, last)), "lines"))
    t = np.linspace(0, 5, 20001)
    f = np.interp(t, supply.frequency.times, supply.frequency.values)
    integral = np.concatenate(([0.0], np.cumsum(0.5 * (f[1:] + f[:-1]) * np.diff(t))))
    assert np.abs(angle_at(supply, t) - 2 * np.pi * integral).max() < 1e-4


def test_amplitude_follows_the_frequency_with_boost_and_stays_above_rated() -> None:
    profile = Profile(((0.0, 0.0), (2.0, 60.0), (3.0, 60.0)), "lines")
    supply = Supply(amplitude=325.0, boost=3.0, frequency=profile)
    for t, amplitude in ((0.0, 3.0), (1.0, 3 + 322 * 0.6), (1.9, 325.0), (2.5, 325.0)):
        v, _ = terminal_voltage(supply, t, 1e-6, 2)
        assert abs(v[0]) == pytest.approx(amplitude, rel=1e-12)
    assert np.any(np.isclose(supply.breaks(), 2.0 * 50 / 60))


def test_long_records_keep_their_phase() -> None:
    supply = grid(400.0)
    v, _ = terminal_voltage(supply, 3600.0, 5e-5, 20001)
    exact = supply.amplitude * np.exp(2j * np.pi * 50 * (3600.0 + 5e-5 * np.arange(20001)))
    assert np.abs(v - exact).max() < 1e-6


def test_ramps_and_constants_meet() -> None:
    supply = Supply(amplitude=325.0, frequency=Profile(((0.0, 30.0), (1.0, 50.0)), "lines"))
    before, _ = terminal_voltage(supply, 0.9, 0.05, 3)
    after, _ = terminal_voltage(supply, 1.0, 0.05, 3)
    assert before[-1] == pytest.approx(after[0], abs=1e-9)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: grid(-400.0), r"Supply\.amplitude = -326\.\d+ V: must be >= 0"),
        (lambda: grid(400.0, math.nan), r"rated_frequency = nan Hz: must be finite"),
        (lambda: grid(400.0, 314.0 * 10), r"rated_frequency = 3140 Hz"),
        (lambda: harmonic(1, 0.1), "harmonic order = 1"),
        (lambda: negative_sequence(3.0), r"Component\.ratio = 3: must be"),
        (lambda: Component(ratio=0.1, sequence=2), r"Component\.sequence = 2"),
        (
            lambda: Supply(amplitude=1.0, frequency=Profile(((0.0, 0.0), (1.0, 50.0)))),
            "a drive ramps",
        ),
        (
            lambda: Supply(amplitude=1.0, frequency=Profile(((0.0, 0.0), (1.0, 1100.0)), "lines")),
            "check Hz against rad/s",
        ),
    ],
)
def test_impossible_supplies(make, message) -> None:
    with pytest.raises(ParameterError, match=message):
        make()
