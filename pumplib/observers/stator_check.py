"""Thesis 5.3: whether a record of voltages and currents can be what it is said to be, before anything is estimated.

A dead current channel looks like a short of a few per cent, a wrong sampling rate like another motor. Each check
looks at one way in which a record can be wrong and says what to do.
"""

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pumplib.errors import DataError
from pumplib.machines.parameters import Motor
from pumplib.motor.frames import B_V_DELTA, C_I_DELTA, to_space_vector
from pumplib.observers.stator import check_samples
from pumplib.observers.stator_design import check_rate, speed_range
from pumplib.observers.stator_sequences import admittance, solve_products

Array = NDArray[Any]
Problem = Literal[
    "too short", "dead channel", "clipped channel", "phase order", "pairing", "lost phase", "does not fit"
]
_SHORTEST = 0.1  # s
_DEAD = 0.05  # of the largest channel
_CLIPPED = 0.05  # share of the samples at one extreme value; a quantised sine has under 3 %
_UNBALANCED = 0.15  # V_2/V_1
_MISFIT = 0.3  # of the believed admittance
_FLUX = 1.5  # of the rated flux
_CHANNELS = ("v_a", "v_b", "v_c", "i_a", "i_b", "i_c")


@dataclass(frozen=True, kw_only=True, slots=True)
class Finding:
    """Something wrong with a record.

    Parameters
    ----------
    problem : str
        Kind of trouble.
    text : str
        What was found and what to do.
    """

    problem: Problem
    text: str


def check_record(v: ArrayLike, i: ArrayLike, rate: float, motor: Motor) -> tuple[Finding, ...]:
    """Look for what makes a record of a running motor unusable.

    Parameters
    ----------
    v, i : array_like, shape (n, 3)
        Terminal voltages, V, and line currents, A.
    rate : float
        Sampling rate, Hz.
    motor : Motor
        What is believed about the motor.

    Returns
    -------
    tuple of Finding
        Empty for a usable record.

    Raises
    ------
    ParameterError
        If the rate is impossible.
    DataError
        If a shape is wrong or a value not finite.
    """
    rate = check_rate(rate)
    v, i = check_samples(v, i)
    if len(v) < _SHORTEST * rate:
        text = f"{len(v)} samples are {len(v) / rate:g} s: give {_SHORTEST:g} s or more"
        return (Finding(problem="too short", text=text),)
    found = [*_channels(np.hstack([v, i]))]
    if any(one.problem == "dead channel" for one in found):
        return tuple(found)
    turn_v, turn_i = (B_V_DELTA, 1 / C_I_DELTA) if motor.connection == "delta" else (1.0, 1.0)
    x, y = turn_v * to_space_vector(v), turn_i * to_space_vector(i)
    taper = np.hanning(len(x) + 2)[1:-1]
    taper = taper / taper.sum()
    (f_v, unbalance), (f_i, _) = (_line(signal - taper @ signal, taper, rate) for signal in (x, y))
    if unbalance > _UNBALANCED:
        text = (
            f"negative sequence of the voltage is {100 * unbalance:.0f} % of the positive: a supply phase is lost or a "
            "channel is wrong; check fuses and wiring"
        )
        return (*found, Finding(problem="lost phase", text=text))
    if f_v * f_i < 0:
        text = "voltages and currents rotate in opposite directions: two channels of one of them are swapped"
        return (*found, Finding(problem="phase order", text=f"{text}; exchange them"))
    if f_v < 0:
        text = "voltages and currents rotate backwards: two phases are swapped; exchange two channels of both"
        return (*found, Finding(problem="phase order", text=text))
    means = (taper @ (x * x), taper @ np.abs(x) ** 2, taper @ (y * x.conj()), taper @ (y * x))
    _, V2, y_1, _ = (complex(one) for one in solve_products(*means))
    V_1 = float(np.sqrt(V2.real))
    angle = float(np.degrees(np.angle(y_1)))
    if not -100.0 < angle < 20.0:
        text = (
            f"currents lead the voltages by {angle:.0f} degrees: no motor does; the phases of the two are paired "
            "wrongly, or the current probes are reversed"
        )
        return (*found, Finding(problem="pairing", text=text))
    fitting = f"check the sampling rate ({rate:g} Hz), the scaling, the connection and the motor's data"
    omega_s, (_, highest) = 2 * np.pi * f_v, speed_range(motor)
    if omega_s > highest:
        text = f"the supply has {f_v:.1f} Hz, above {highest / 2 / np.pi:.1f} Hz that the motor is made for: {fitting}"
        return (*found, Finding(problem="does not fit", text=text))
    if motor.rated_voltage and motor.rated_frequency:
        winding = motor.rated_voltage * np.sqrt(2 / 3 if motor.connection == "Y" else 2)
        flux = V_1 / winding * motor.rated_frequency / f_v
        if flux > _FLUX:
            text = f"{V_1:.4g} V a winding at {f_v:.1f} Hz is {flux:.2g} times the rated flux: {fitting}"
            return (*found, Finding(problem="does not fit", text=text))
    circle = admittance(motor, np.array(omega_s), omega_s * (1 - np.linspace(-0.05, 0.3, 141)))
    misfit = float((np.abs(y_1 - circle) / np.abs(circle)).min())
    if misfit > _MISFIT:
        text = (
            f"at {f_v:.1f} Hz and {V_1:.4g} V the motor takes {abs(y_1) * V_1:.3g} A, {100 * misfit:.0f} % off what "
            f"the believed motor can take at any slip: {fitting}"
        )
        found.append(Finding(problem="does not fit", text=text))
    return tuple(found)


def require_usable(v: ArrayLike, i: ArrayLike, rate: float, motor: Motor) -> None:
    """Refuse a record in which `check_record` finds anything.

    Parameters
    ----------
    v, i : array_like, shape (n, 3)
        Terminal voltages, V, and line currents, A.
    rate : float
        Sampling rate, Hz.
    motor : Motor
        What is believed about the motor.

    Raises
    ------
    DataError
        With everything that was found.
    ParameterError
        If the rate is impossible.
    """
    found = check_record(v, i, rate, motor)
    if found:
        raise DataError("; ".join(f"{one.problem}: {one.text}" for one in found) + ".")


def _channels(signals: Array) -> list[Finding]:
    found = []
    rms = signals.std(axis=0)
    for first, unit in ((0, "V"), (3, "A")):
        largest = rms[first : first + 3].max()
        for c in range(first, first + 3):
            if rms[c] <= _DEAD * largest:
                text = (
                    f"{_CHANNELS[c]} has {rms[c]:.3g} {unit} rms, another phase {largest:.3g} {unit}: a phase is "
                    "missing or its channel is not connected"
                )
                found.append(Finding(problem="dead channel", text=text))
    for c, name in enumerate(_CHANNELS):
        x = signals[:, c]
        for end, word in ((x.max(), "largest"), (x.min(), "smallest")):
            share = float(np.mean(x == end))
            if rms[c] > 0 and share > _CLIPPED:
                text = (
                    f"{name} sits at its {word} value {end:.4g} in {100 * share:.0f} % of the samples: it is saturated "
                    "or stuck; take a larger range"
                )
                found.append(Finding(problem="clipped channel", text=text))
    return found


def _line(x: Array, taper: Array, rate: float) -> tuple[float, float]:
    """Frequency of the strongest line of a space vector, Hz, negative where it rotates backwards; its image's share."""
    spectrum = np.abs(np.fft.fft(x * taper))
    k = int(np.argmax(spectrum))
    coarse = float(np.fft.fftfreq(len(x), 1 / rate)[k])
    if coarse == 0.0:
        return 0.0, 0.0
    image = np.arange(-k - 2, -k + 3)
    share = float(spectrum[image % len(x)].max() / spectrum[k])
    # rotation over an eighth of a turn, averaged: not bound to the lines of the spectrum
    lag = max(1, round(rate / abs(coarse) / 8))
    return float(np.angle(np.sum(x[lag:] * x[:-lag].conj())) / (2 * np.pi * lag) * rate), share
