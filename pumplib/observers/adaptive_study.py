"""Thesis 5.2, 5.3: the adaptive observers on records of their own class: Lyapunov functions, excitation.

The observer knows the model here ("nominal"). Results on a machine that it does not know are a matter of the bench.
"""

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.random import Generator
from numpy.typing import ArrayLike, NDArray

from pumplib.errors import ParameterError
from pumplib.machines.parameters import Motor
from pumplib.motor.short_identify import g_of_gamma, stator_impedance
from pumplib.observers.adaptive import (
    BilinearSystem,
    DirectObserver,
    Estimate,
    simulate_system,
)
from pumplib.observers.adaptive_design import DirectDesign
from pumplib.observers.adaptive_examples import motor_speed_and_short

Array = NDArray[Any]


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class LyapunovRun:
    """Direct observer on its own model with the Lyapunov function along the run.

    Parameters
    ----------
    estimate : Estimate
        What the observer gave.
    V : ndarray, shape (N,)
        e^H P e + sum (theta_i error)^2 / rate_i.
    e_x : ndarray, shape (N, n)
        Error of the state.
    e_theta : ndarray, shape (N, m)
        Error of the parameters.
    """

    estimate: Estimate
    V: Array
    e_x: Array
    e_theta: Array

    @property
    def largest_rise(self) -> float:
        """Largest rise of V over any stretch of the run, relative to its initial value."""
        return float((self.V - np.minimum.accumulate(self.V)).max() / self.V[0])


def lyapunov_run(
    system: BilinearSystem, design: DirectDesign, *, theta: ArrayLike, rates: ArrayLike, u: ArrayLike, h: float,
    x0: ArrayLike, x_guess: ArrayLike, theta_guess: ArrayLike,
) -> LyapunovRun:  # fmt: skip
    """Run the direct observer on data of its own model and evaluate its Lyapunov function.

    Parameters
    ----------
    system : BilinearSystem
        Model and truth.
    design : DirectDesign
        Gain and law.
    theta, rates : array_like, shape (m,)
        True parameters; rates of adaptation, all positive.
    u : array_like, shape (N, r)
        Inputs.
    h : float
        Step, s; short against the observer's time constants, as the function falls in continuous time.
    x0, x_guess : array_like, shape (n,)
        True and estimated initial state.
    theta_guess : array_like, shape (m,)
        Initial parameters.

    Returns
    -------
    LyapunovRun

    Raises
    ------
    ParameterError
        If a rate is not positive.
    SimulationError
        If the observer diverges.
    """
    speed = np.asarray(rates, dtype=float)
    if not (speed > 0).all():
        raise ParameterError(f"lyapunov_run: rates = {rates!r}; all must be positive.")
    x, y = simulate_system(system, theta, u, h, x0)
    observer = DirectObserver(system=system, K=design.K, F=design.F, G=design.G, rates=speed)
    found = observer.run(u, y, h, x0=x_guess, theta0=theta_guess)
    e_x, e_theta = x - found.x, np.asarray(theta, dtype=float) - found.theta
    V = np.einsum("Ni,ij,Nj->N", e_x.conj(), design.P, e_x).real + (e_theta**2 / speed).sum(axis=1)
    return LyapunovRun(estimate=found, V=V, e_x=e_x, e_theta=e_theta)


def regressor(system: BilinearSystem, K: ArrayLike, theta: ArrayLike, u: ArrayLike, h: float, x0: ArrayLike) -> Array:
    """Filtered regressor phi = C Upsilon + D u along the true state, for the test of excitation.

    Parameters
    ----------
    system : BilinearSystem
        The system.
    K : array_like, shape (n, p) or (1 + m, n, p)
        Gain, 1/s.
    theta : array_like, shape (m,)
        True parameters.
    u : array_like, shape (N, r)
        Inputs.
    h : float
        Step, s.
    x0 : array_like, shape (n,)
        Initial state.

    Returns
    -------
    complex ndarray, shape (N, p, m)
    """
    inputs = np.asarray(u, dtype=complex)
    values = np.asarray(theta, dtype=float)
    x, _ = simulate_system(system, values, inputs, h, x0)
    gain = np.asarray(K, dtype=complex)
    if gain.ndim == 3:
        gain = gain[0] + np.einsum("i,inp->np", values, gain[1:])
    n, m, p = len(system.A0), len(system.names), len(system.C)
    closed = system.system_matrix(values) - gain @ system.C
    phi = np.empty((len(inputs), p, m), complex)
    for i in range(m):
        fed = inputs @ system.D[i].T
        drive = x @ system.A[i].T + inputs @ system.B[i].T - fed @ gain.T
        linear = BilinearSystem(
            A0=closed, A=np.zeros((1, n, n)), B0=np.eye(n), B=np.eye(n)[None], C=system.C, D=np.zeros((1, p, n)),
            names=("none",), name=system.name,
        )  # fmt: skip
        phi[:, :, i] = simulate_system(linear, [0.0], drive, h, np.zeros(n))[1] + fed
    return phi


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class MotorRecord:
    """Record of a motor of the class: constant speed, a short from some time on; time first.

    Parameters
    ----------
    t : ndarray, shape (N,)
        s.
    u : complex ndarray, shape (N, 2)
        v_s and conj(w), V and A.
    y : complex ndarray, shape (N, 1)
        Stator current, A.
    omega : float
        Electrical speed, rad/s.
    g_c : complex
        Fault term after `t_fault`.
    t_fault : float
        s.
    noise : float
        Standard deviation of each real part of the current, A.
    """

    t: Array
    u: Array
    y: Array
    omega: float
    g_c: complex
    t_fault: float
    noise: float

    def every(self, n: int) -> "MotorRecord":
        """Every n-th sample.

        Parameters
        ----------
        n : int
            Ratio of the sampling intervals.

        Returns
        -------
        MotorRecord
        """
        return replace(self, t=self.t[::n], u=self.u[::n], y=self.y[::n])


def motor_record(
    motor: Motor, *, gamma: float = 0.02, phase: int = 0, omega: float = 300.0, t_fault: float = 1.5,
    duration: float = 3.0, step: float = 2e-5, amplitude: float = 325.0, frequency: float = 50.0,
    unbalance: float = 0.02, noise: float = 0.0, rng: Generator | None = None,
) -> MotorRecord:  # fmt: skip
    """Simulate the motor with its fault term, without the common-mode part that the class leaves out.

    Parameters
    ----------
    motor : Motor
        The machine.
    gamma : float
        Shorted share of the turns, bolted, uncoupled leakage.
    phase : int
        Faulty phase, 0, 1, 2.
    omega : float
        Electrical speed, rad/s.
    t_fault, duration, step : float
        s.
    amplitude, frequency : float
        Supply, V and Hz.
    unbalance : float
        Negative sequence of the supply, relative.
    noise : float
        Standard deviation of each real part of the current, A.
    rng : numpy.random.Generator, optional
        Needed with noise.

    Returns
    -------
    MotorRecord

    Raises
    ------
    ParameterError
        If noise is wanted without generator, or a value is outside its range.
    """
    if noise < 0 or (noise > 0 and rng is None):
        raise ParameterError(f"motor_record: noise = {noise!r} A; must be >= 0 and comes with a generator.")
    if not 0 < step < duration or not 0 <= t_fault <= duration:
        raise ParameterError(f"motor_record: step {step!r}, t_fault {t_fault!r}, duration {duration!r} s do not fit.")
    system = motor_speed_and_short(motor)
    n = round(duration / step) + 1
    t = step * np.arange(n)
    w_s = 2 * math.pi * frequency
    forward = amplitude * np.exp(1j * w_s * t)
    backward = unbalance * forward.conj()
    v = forward + backward
    w = forward / stator_impedance(motor.r_s, motor.L_ls, w_s) + backward / stator_impedance(
        motor.r_s, motor.L_ls, -w_s
    )
    u = np.stack([v, w.conj()], axis=1)
    g_c = complex(np.exp(-2j * np.pi / 3 * phase) * float(g_of_gamma(gamma, "Y")) / 3)
    theta = np.zeros((n, 3))
    theta[:, 0] = omega
    theta[t >= t_fault, 1:] = g_c.real, g_c.imag
    A = system.system_matrix([omega, 0, 0])
    settled = [
        np.linalg.solve(sign * 1j * w_s * np.eye(2) - A, system.B0[:, 0] * one)
        for sign, one in ((1, forward[0]), (-1, backward[0]))
    ]
    _, y = simulate_system(system, theta, u, step, settled[0] + settled[1])
    if noise > 0:
        assert rng is not None
        y = y + noise * (rng.standard_normal(y.shape) + 1j * rng.standard_normal(y.shape))
    return MotorRecord(t=t, u=u, y=y, omega=omega, g_c=g_c, t_fault=t_fault, noise=noise)
