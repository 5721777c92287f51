"""Thesis 3.2.3: supplies at the motor's terminals: grid, unbalance, harmonics, V/f ramps."""

import cmath
import math
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray

from pumplib.errors import ParameterError
from pumplib.machines.profile import Profile
from pumplib.machines.quantity import Parameters, Quantity

Array = NDArray[Any]
_BLOCK = 64  # samples rotated from one exact angle


@dataclass(frozen=True, kw_only=True, slots=True)
class Component(Parameters):
    """One component of a supply beside the fundamental of positive sequence.

    Parameters
    ----------
    ratio : float
        Amplitude relative to the fundamental.
    order : int
        Multiple of the fundamental frequency.
    sequence : int
        1 positive, -1 negative, 0 zero sequence.
    phase : float
        Angle of the component when the fundamental's is zero, rad.
    """

    ratio: Annotated[float, Quantity("-", "amplitude relative to the fundamental", 0.0, 1.0)]
    order: Annotated[int, Quantity("-", "multiple of the fundamental frequency", 1, 1000)] = 1
    sequence: Annotated[int, Quantity("-", "1 positive, -1 negative, 0 zero sequence", -1, 1)] = 1
    phase: Annotated[float, Quantity("rad", "angle", -100.0, 100.0)] = 0.0


def harmonic(order: int, ratio: float, phase: float = 0.0) -> Component:
    """Harmonic of a balanced supply; its sequence follows from the order (5th negative, 7th positive).

    Parameters
    ----------
    order : int
        Multiple of the fundamental.
    ratio : float
        Amplitude relative to the fundamental.
    phase : float
        Angle, rad.

    Returns
    -------
    Component

    Raises
    ------
    ParameterError
        If the order is below 2 or the ratio outside 0..1.
    """
    if not isinstance(order, int) or order < 2:
        raise ParameterError(f"harmonic order = {order!r}: must be a whole number >= 2.")
    return Component(ratio=ratio, order=order, sequence=(0, 1, -1)[order % 3], phase=phase)


def negative_sequence(ratio: float, phase: float = 0.0) -> Component:
    """Unbalance of the supply as a fundamental of negative sequence.

    Parameters
    ----------
    ratio : float
        Amplitude relative to the fundamental.
    phase : float
        Angle, rad.

    Returns
    -------
    Component

    Raises
    ------
    ParameterError
        If the ratio is outside 0..1.
    """
    return Component(ratio=ratio, sequence=-1, phase=phase)


@dataclass(frozen=True, kw_only=True, slots=True)
class Supply(Parameters):
    """Three-phase voltage at the motor's terminals.

    The amplitude follows the frequency, ``boost + (amplitude - boost) f / rated_frequency``, and stays at
    `amplitude` above the rated frequency. The angle is the integral of the frequency.

    Parameters
    ----------
    amplitude : float
        Amplitude of the phase voltage (line to neutral) at the rated frequency, V.
    rated_frequency : float
        Hz.
    boost : float
        Amplitude at standstill, V.
    frequency : Profile or None
        Frequency over time, Hz; None means the rated frequency, direct on line.
    components : tuple of Component
        Unbalance and harmonics.
    phase : float
        Angle of the fundamental at t = 0, rad.
    """

    amplitude: Annotated[float, Quantity("V", "phase-voltage amplitude at the rated frequency", 0.0, 2e4)]
    rated_frequency: Annotated[float, Quantity("Hz", "rated frequency", 0.0, 1000.0, True)] = 50.0
    boost: Annotated[float, Quantity("V", "phase-voltage amplitude at standstill", 0.0, 2e4)] = 0.0
    frequency: Profile | None = None
    components: tuple[Component, ...] = ()
    phase: Annotated[float, Quantity("rad", "angle at t = 0", -100.0, 100.0)] = 0.0

    def _check_together(self) -> None:
        if self.frequency is not None:
            if self.frequency.kind != "lines" and len(self.frequency.points) > 1:
                raise ParameterError('Supply.frequency has steps: a drive ramps; use Profile(points, "lines").')
            if self.frequency.values.min() < 0 or self.frequency.values.max() > 1000:
                raise ParameterError(
                    f"Supply.frequency reaches {self.frequency.values.min():g}..{self.frequency.values.max():g} Hz: "
                    "must stay within 0..1000 Hz; check Hz against rad/s."
                )

    def breaks(self) -> Array:
        """Times at which the voltage is not smooth.

        Returns
        -------
        ndarray
            s.
        """
        if self.frequency is None:
            return np.empty(0)
        breaks = self.frequency.breaks()
        # the amplitude has a corner where the ramp passes the rated frequency
        t, f = self.frequency.times, self.frequency.values
        for k in range(len(t) - 1):
            low, high = sorted((f[k], f[k + 1]))
            if low < self.rated_frequency < high:
                corner = t[k] + (self.rated_frequency - f[k]) / (f[k + 1] - f[k]) * (t[k + 1] - t[k])
                breaks = np.append(breaks, corner)
        return np.sort(breaks)


def grid(line_voltage_rms: float, frequency_hz: float = 50.0, *components: Component) -> Supply:
    """Stiff grid, for direct-on-line start.

    Parameters
    ----------
    line_voltage_rms : float
        Line-to-line voltage, V rms.
    frequency_hz : float
        Hz.
    *components : Component
        Unbalance and harmonics.

    Returns
    -------
    Supply

    Raises
    ------
    ParameterError
        If a value is outside its limits.
    """
    return Supply(amplitude=line_voltage_rms * math.sqrt(2 / 3), rated_frequency=frequency_hz, components=components)


def frequency_at(supply: Supply, t: Array) -> Array:
    """Frequency of the supply.

    Parameters
    ----------
    supply : Supply
        The supply.
    t : ndarray, shape (n,)
        Times, s.

    Returns
    -------
    ndarray, shape (n,)
        Hz.
    """
    if supply.frequency is None:
        return np.full(np.shape(t), supply.rated_frequency)
    return np.interp(t, supply.frequency.times, supply.frequency.values)


def angle_at(supply: Supply, t: Array) -> Array:
    """Angle of the fundamental, the exact integral of the frequency.

    Parameters
    ----------
    supply : Supply
        The supply.
    t : ndarray, shape (n,)
        Times, s, not negative.

    Returns
    -------
    ndarray, shape (n,)
        rad.
    """
    t = np.asarray(t, dtype=float)
    if supply.frequency is None:
        return supply.phase + 2 * math.pi * supply.rated_frequency * t
    knots = np.unique(np.concatenate(([0.0], supply.frequency.times[supply.frequency.times > 0])))
    f = frequency_at(supply, knots)
    turns = np.concatenate(([0.0], np.cumsum(0.5 * (f[1:] + f[:-1]) * np.diff(knots))))
    k = np.searchsorted(knots, t, side="right") - 1
    return supply.phase + 2 * math.pi * (turns[k] + 0.5 * (f[k] + frequency_at(supply, t)) * (t - knots[k]))


def _phasor(angle: float, step: float, n: int, order: int, amplitude: complex) -> Array:
    """Samples amplitude exp(j order (angle + k step)) for k < n: exact angles every block, rotations within."""
    within = np.exp(1j * order * step * np.arange(_BLOCK))
    starts = amplitude * np.exp(1j * order * (angle + step * _BLOCK * np.arange(-(-n // _BLOCK))))
    return np.multiply.outer(starts, within).reshape(-1)[:n]


def terminal_voltage(supply: Supply, start: float, step: float, n: int) -> tuple[Array, Array]:
    """Terminal voltage at `n` equally spaced times of a segment without breaks inside.

    Parameters
    ----------
    supply : Supply
        The supply.
    start : float
        First time, s.
    step : float
        Distance of the times, s.
    n : int
        Number of samples.

    Returns
    -------
    vector : complex ndarray, shape (n,)
        Space vector, V.
    zero : ndarray, shape (n,)
        Zero sequence, V.
    """
    first, last = np.array([start]), np.array([start + step * (n - 1)])
    constant = bool(frequency_at(supply, first)[0] == frequency_at(supply, last)[0])
    t = first if constant else start + step * np.arange(n)
    f, angle = frequency_at(supply, t), angle_at(supply, t)
    amplitude = supply.boost + (supply.amplitude - supply.boost) * f / supply.rated_frequency
    amplitude = np.minimum(amplitude, supply.amplitude)

    def rotor(order: int, factor: complex) -> Array:
        if constant:
            return _phasor(angle[0], 2 * math.pi * f[0] * step, n, order, factor * amplitude[0])
        return factor * amplitude * np.exp(1j * order * angle)

    vector, zero = rotor(1, 1.0), np.zeros(n)
    for part in supply.components:
        phasor = rotor(part.order, cmath.rect(part.ratio, part.phase))
        if part.sequence == 0:
            zero += phasor.real
        else:
            vector += phasor if part.sequence > 0 else phasor.conj()
    return vector, zero
