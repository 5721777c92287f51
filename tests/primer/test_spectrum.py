"""Spectrum of the stator current: known lines come out where and as large as they are."""

import numpy as np
import pytest

from pumplib.errors import DataError
from pumplib.primer import current_spectrum
from pumplib.testbench.sensors import FastSignals


def signals(sideband: float, hz: float, seconds: float = 4.0, end_hz: float = 40.0) -> FastSignals:
    t = np.arange(round(seconds * 10000)) / 10000
    angle = 2 * np.pi * (40.0 * t + 0.5 * (end_hz - 40.0) / seconds * t**2)
    vector = 3.0 * np.exp(1j * (angle - 0.6)) * (1 + sideband * np.exp(2j * np.pi * hz * t))
    turns = np.exp(2j * np.pi / 3 * np.arange(3))
    return FastSignals(
        rate=10000.0,
        voltage=np.real(300.0 * np.exp(1j * angle)[:, None] / turns),
        current=np.real(vector[:, None] / turns),
    )


@pytest.mark.parametrize("hz", [-38.5, 21.3, 38.5])
def test_a_line_has_its_place_and_size(hz: float) -> None:
    spectrum = current_spectrum(signals(0.01, hz), 0.0, 4.0)
    assert spectrum.supply == pytest.approx(40.0, rel=1e-6)
    assert spectrum.offset[spectrum.amplitude.argmax()] == pytest.approx(hz, abs=0.25)
    assert spectrum.at(hz) == pytest.approx(0.01, rel=0.15)  # the window's scalloping
    assert spectrum.at(-hz) < 1e-4


def test_without_a_sideband_there_is_none() -> None:
    assert current_spectrum(signals(0.0, 10.0), 0.5, 3.5).at(38.0, 5.0) < 1e-6


@pytest.mark.parametrize(
    ("start", "stop", "end_hz", "message"),
    [
        (0.0, 0.5, 40.0, "at least 1 s within the run"),
        (-1.0, 3.0, 40.0, "within the run"),
        (1.0, 9.0, 40.0, "within the run"),
        (0.0, 4.0, 45.0, "frequency changes between 0 and 4 s"),
    ],
)
def test_unsuitable_parts_are_refused(start: float, stop: float, end_hz: float, message: str) -> None:
    with pytest.raises(DataError, match=message):
        current_spectrum(signals(0.01, 20.0, end_hz=end_hz), start, stop)
