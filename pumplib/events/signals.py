"""Thesis 4.3.5, 4.4: the quantities behind the signal events, from terminal voltages, currents, pressure and flow.

Speed, torque and the negative-sequence residual come from the motor's observer; nothing here sees a state of the
plant. Signals that the bench cannot act out (temperature, broad-band vibration) are left out.
"""

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from pumplib.errors import DataError
from pumplib.events.physics import SteadyState
from pumplib.machines.parameters import Motor
from pumplib.motor.frames import zero_sequence
from pumplib.observers.certificate import Gain
from pumplib.observers.stator import observe
from pumplib.observers.stator_sequences import admittance
from pumplib.testbench.simulate import STEP

Array = NDArray[Any]
Speed = Literal["observer", "circuit"]
RAW = ("yI", "yP", "yw", "yQ", "ydp", "ypin", "yIn", "yI0")
COMPENSATED = ("yZn", "ymc", "yLT", "yrT", "yrH", "yrTH", "yrpin")
SIGNALS = RAW + COMPENSATED


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Maps:
    """Healthy pump as the monitor knows it, fitted to healthy steady states.

    Parameters
    ----------
    motor : Motor
        Believed motor.
    head : ndarray, shape (3,)
        Of w^2, w Q, -Q^2, Pa.
    torque : ndarray, shape (4,)
        Of w, w^2, w Q, -Q^2, N m.
    """

    motor: Motor
    head: Array
    torque: Array


def _vector(x: Array) -> Array:
    """Space vector of phase quantities, written out: a matrix product wakes all threads of the library for it."""
    return np.asarray((2 * x[:, 0] - x[:, 1] - x[:, 2]) / 3 + 1j * (x[:, 1] - x[:, 2]) / np.sqrt(3))


def phasors(state: SteadyState) -> tuple[complex, complex, complex, complex, float]:
    """Sequence components of voltage and current over the window, and the amplitude of the sum of the currents.

    Parameters
    ----------
    state : SteadyState
        End of a run.

    Returns
    -------
    v_1, i_1, v_2, i_2 : complex
        Positive and negative sequence, V and A.
    i_0 : float
        Zero sequence of the line currents, A.
    """
    fast = state.truth.fast
    v, i = _vector(fast[:, :3]), _vector(fast[:, 3:6])
    t = STEP * np.arange(len(v))
    window = np.hanning(len(v))
    window /= window.sum()
    forward = window * np.exp(-2j * np.pi * state.hertz * t)
    i_0 = 2 * abs(np.sum(zero_sequence(fast[:, 3:6]) * forward))
    positive, negative = (
        (np.sum(v * forward), np.sum(i * forward)),
        (np.sum(v * forward.conj()), np.sum(i * forward.conj())),
    )
    return complex(positive[0]), complex(positive[1]), complex(negative[0]), complex(negative[1]), float(i_0)


def speed_and_torque(state: SteadyState, motor: Motor, gain: Gain) -> tuple[float, float, float]:
    """Speed, torque and fault coefficient by the motor's observer of chapter 5.

    The observer takes the current of a shorted loop out of the measured one, so that speed and torque stay right
    where the plain equivalent circuit would be fooled by the fault.

    Parameters
    ----------
    state : SteadyState
        End of a run.
    motor : Motor
        Believed motor.
    gain : Gain
        Of the observer.

    Returns
    -------
    omega, T_e, g : float
        rad/s, N m, and 3 times the modulus of the fault coefficient.
    """
    fast = state.truth.fast
    found = observe(fast[:, :3], fast[:, 3:6], motor, 1 / STEP, gain, every=10)
    last = slice(-round(0.3 / (10 * STEP)), None)
    return float(found.omega[last].mean()), float(found.T_e[last].mean()), 3 * float(abs(found.g_c[last].mean()))


def circuit_speed_and_torque(v_1: complex, i_1: complex, hertz: float, motor: Motor) -> tuple[float, float]:
    """Speed and torque as the plain equivalent circuit sees them: what chapter 5's observer is compared with.

    The power that the motor takes belongs to one slip; the current of a shorted loop is taken for load.

    Parameters
    ----------
    v_1, i_1 : complex
        Positive sequence, V and A.
    hertz : float
        Supply frequency, Hz.
    motor : Motor
        Believed motor.

    Returns
    -------
    omega, T_e : float
        rad/s, N m.

    Raises
    ------
    DataError
        If no speed between 80 % of synchronism and synchronism takes that power.
    """
    from scipy.optimize import brentq

    omega_s = 2 * np.pi * hertz
    taken = float((v_1 * np.conj(i_1)).real)

    def more(omega: float) -> float:
        Y = admittance(motor, np.array(omega_s), np.array(omega))
        return float(abs(v_1) ** 2 * Y.real) - taken

    if more(0.8 * omega_s) * more(omega_s) > 0:
        raise DataError(
            f"circuit_speed_and_torque: {1.5 * taken:.4g} W at {abs(v_1):.4g} V, {hertz:.3g} Hz belongs to no slip "
            "between 0 and 0.2; check scaling and believed motor."
        )
    omega = float(brentq(more, 0.8 * omega_s, omega_s))
    gap = 1.5 * (taken - motor.r_s * abs(i_1) ** 2)
    return omega / motor.z_p, float(gap * motor.z_p / omega_s)


def sideband(state: SteadyState, i_1: complex, omega: float) -> float:
    """Amplitude of the current at the supply plus the shaft frequency, relative to the fundamental.

    Parameters
    ----------
    state : SteadyState
        End of a run.
    i_1 : complex
        Fundamental, A.
    omega : float
        Estimated speed, rad/s.

    Returns
    -------
    float
    """
    i = _vector(state.truth.fast[:, 3:6])
    t = STEP * np.arange(len(i))
    rest = i - i_1 * np.exp(2j * np.pi * state.hertz * t)
    window = np.hanning(len(i))
    window /= window.sum()
    return float(abs(np.sum(window * rest * np.exp(-1j * (2 * np.pi * state.hertz + omega) * t))) / abs(i_1))


def regressors(omega: Array, Q: Array) -> Array:
    """Regressors of the two maps: w, w^2, w Q, -Q^2; head takes the last three.

    Parameters
    ----------
    omega, Q : ndarray, shape (n,)
        Speed (rad/s), flow (m3/s).

    Returns
    -------
    ndarray, shape (n, 4)
    """
    return np.column_stack((omega, omega**2, omega * Q, -(Q**2)))


def measure(state: SteadyState, motor: Motor, gain: Gain, speed: Speed = "observer") -> dict[str, float]:
    """Measured quantities of a steady state.

    Parameters
    ----------
    state : SteadyState
        End of a run.
    motor : Motor
        Believed motor.
    gain : Gain
        Of the motor's observer.
    speed : {"observer", "circuit"}
        Where speed and torque come from.

    Returns
    -------
    dict
        V, I phasors' values and H, Q, omega, T_e, source pressure and inlet pressure; SI.
    """
    v_1, i_1, _, i_2, i_0 = phasors(state)
    omega, T_e, g = speed_and_torque(state, motor, gain)
    if speed == "circuit":
        omega, T_e = circuit_speed_and_torque(v_1, i_1, state.hertz, motor)
    tick = state.truth
    H, Q = float(tick["H_p"].mean()), float(tick["Q"].mean())
    flow = float(tick["Q_p"].mean())
    return {
        "yI": abs(i_1) / np.sqrt(2), "yP": 1.5 * float((v_1 * np.conj(i_1)).real), "yw": omega, "yQ": Q, "ydp": H,
        "ypin": state.source - state.inlet_loss * flow * abs(flow), "yIn": abs(i_2), "yI0": i_0,
        "yZn": g, "ymc": sideband(state, i_1, omega), "T_e": T_e,
    }  # fmt: skip


def residuals(found: dict[str, float], maps: Maps) -> dict[str, float]:
    """Compensated signals: what is left when the healthy maps are taken off.

    Parameters
    ----------
    found : dict
        Result of `measure`.
    maps : Maps
        Healthy pump.

    Returns
    -------
    dict
        yrT, yrTH, yLT in N m, yrH in Pa, yrpin in Pa; yLT is the lack of torque below closed valve.
    """
    w, Q, H, T = found["yw"], found["yQ"], found["ydp"], found["T_e"]
    a_h, a_t = maps.head, maps.torque
    D = (a_h[1] * w) ** 2 + 4 * a_h[2] * (a_h[0] * w**2 - H)
    of_head = (a_h[1] * w + np.sqrt(max(D, 0.0))) / (2 * a_h[2])

    def torque(q: float) -> float:
        return float((regressors(np.array([w]), np.array([q])) @ a_t)[0])

    head = float((regressors(np.array([w]), np.array([Q]))[:, 1:] @ a_h)[0])
    return {
        "yLT": 0.8 * torque(0.0) - T,
        "yrT": T - torque(Q),
        "yrH": H - head,
        "yrTH": T - torque(float(of_head)),
        "yrpin": found["ypin"],
    }


def fit_maps(points: list[dict[str, float]], motor: Motor) -> Maps:
    """Fit both maps to healthy steady states.

    Parameters
    ----------
    points : list of dict
        Results of `measure`.
    motor : Motor
        Believed motor.

    Returns
    -------
    Maps
    """
    w, Q, H, T = (np.array([one[name] for one in points]) for name in ("yw", "yQ", "ydp", "T_e"))
    X = regressors(w, Q)
    scale = np.abs(X).max(axis=0)
    head = np.linalg.lstsq(X[:, 1:] / scale[1:], H, rcond=None)[0] / scale[1:]
    torque = np.linalg.lstsq(X / scale, T, rcond=None)[0] / scale
    return Maps(motor=motor, head=head, torque=torque)
