"""Thesis 2.1.1, 2.2.1: the frequency content of the stator current, where bearing faults leave sidebands."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.signal import detrend

from pumplib.errors import DataError
from pumplib.motor.frames import to_space_vector
from pumplib.testbench.sensors import FastSignals

Array = NDArray[Any]
MINIMUM = 1.0
"""Shortest part of a run whose spectrum is taken, s."""


@dataclass(frozen=True, kw_only=True, eq=False, slots=True)
class Spectrum:
    """Amplitudes of the stator current's space vector beside its fundamental.

    Parameters
    ----------
    offset : ndarray, shape (n,)
        Frequency less the supply's, Hz.
    amplitude : ndarray, shape (n,)
        Relative to the fundamental.
    supply : float
        Frequency of the supply, Hz.
    """

    offset: Array
    amplitude: Array
    supply: float

    def at(self, offset: float, width: float = 0.5) -> float:
        """Largest amplitude near a frequency.

        Parameters
        ----------
        offset : float
            Hz from the supply's frequency.
        width : float
            To either side, Hz.

        Returns
        -------
        float
            Relative to the fundamental.
        """
        return float(self.amplitude[np.abs(self.offset - offset) <= width].max())


def current_spectrum(fast: FastSignals, start: float, stop: float) -> Spectrum:
    """Spectrum of the stator current at one operating point.

    The space vector is turned back by the angle of the voltage, so that the fundamental stands still and is taken
    out with its slow change; a Hann window keeps neighbours apart.

    Parameters
    ----------
    fast : FastSignals
        Measured voltages and currents.
    start, stop : float
        Part of the run, s; the frequency of the supply must not change within it.

    Returns
    -------
    Spectrum

    Raises
    ------
    DataError
        If the part is too short, outside the run, or the frequency changes.

    References
    ----------
    Thesis 2.1.1: decisions on features of a signal; 2.2.1: motor current analysis.
    """
    part = (fast.t >= start) & (fast.t < stop)
    if stop - start < MINIMUM or start < fast.t[0] or stop > fast.t[-1] + 1.5 / fast.rate:
        raise DataError(
            f"current_spectrum: {start:g} to {stop:g} s: must be at least {MINIMUM:g} s within the run, "
            f"{fast.t[0]:g} to {fast.t[-1]:g} s."
        )
    t = fast.t[part]
    angle = np.unwrap(np.angle(to_space_vector(fast.voltage[part])))
    rate, first = np.polyfit(t - t[0], angle, 1)
    if np.abs(angle - first - rate * (t - t[0])).max() > 1.0:
        raise DataError(
            f"current_spectrum: the supply's frequency changes between {start:g} and {stop:g} s; take a steady part."
        )
    turned = to_space_vector(fast.current[part]) * np.exp(-1j * (first + rate * (t - t[0])))
    fundamental = abs(turned.mean())
    window = np.hanning(len(t))
    rest = detrend(turned.real) + 1j * detrend(turned.imag)
    amplitude = np.abs(np.fft.fft(rest * window)) / window.sum() / fundamental
    offset = np.fft.fftfreq(len(t), 1 / fast.rate)
    order = np.argsort(offset)
    return Spectrum(offset=offset[order], amplitude=amplitude[order], supply=float(rate / (2 * np.pi)))
