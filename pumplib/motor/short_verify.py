"""Thesis 5.1: the model with an inter-turn short circuit against the coils it stands for, point by point and in time.

Two checks: all derivatives and outputs at random machines, faults and states; and whole runs on a supply with
unbalance, harmonics and zero sequence, from standstill, with a pump as load.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from pumplib.errors import ParameterError, SimulationError
from pumplib.machines.parameters import Motor
from pumplib.motor.frames import K_DELTA, PHASE_AXES, to_phases, to_space_vector, zero_sequence
from pumplib.motor.short import (
    Short,
    ShortConstants,
    instant_current,
    short_constants,
    short_derivatives,
    terminals,
)
from pumplib.motor.short_abc import CoilModel, coil_model, coil_rates, coil_torque, coil_voltages
from pumplib.motor.supply import Supply

Array = NDArray[Any]
_LEAST = 1e-3  # smallest inductance of a drawn loop in units of L_ls sigma


def stacked(constants: Sequence[ShortConstants]) -> ShortConstants:
    """Constants of several machines as arrays.

    Parameters
    ----------
    constants : sequence of ShortConstants
        One for each machine.

    Returns
    -------
    ShortConstants
        Every field an array of shape (n,).
    """
    return ShortConstants(*(np.array(column) for column in zip(*constants, strict=True)))


def draw_short(rng: Generator, kappa_c: float | None = None) -> Short:
    """Random fault: one, two or three phases, any direction, any leakage, with and without contact resistance.

    Loops through several phases whose inductance nearly, but not exactly, cancels are drawn again: the coils'
    inductance matrix has lost the digits there that a comparison would need.

    Parameters
    ----------
    rng : numpy.random.Generator
        Source of randomness.
    kappa_c : float, optional
        Leakage; drawn by default, in a fifth of the cases exactly 0 or 1.

    Returns
    -------
    Short
    """
    drawn = rng.choice([0.0, 1.0]) if rng.random() < 0.2 else rng.uniform(0.02, 1.0)
    kappa = float(drawn) if kappa_c is None else kappa_c
    r_f = 0.0 if rng.random() < 0.4 else float(10 ** rng.uniform(-3, 2))
    while True:
        phases = int(rng.integers(1, 4))
        gamma = np.zeros(3)
        gamma[rng.permutation(3)[:phases]] = rng.uniform(0.002, 0.6, phases) * rng.choice([-1, 1], phases)
        if phases == 2 and rng.random() < 0.3:
            gamma[gamma != 0] = rng.permutation([1.0, -1.0]) * np.abs(gamma).max()
        short = Short(gamma=(float(gamma[0]), float(gamma[1]), float(gamma[2])), r_f=r_f, kappa_c=kappa)
        share = kappa * short.sigma + short.turned**2 / 3
        if short.turned == 0 or share > _LEAST * short.sigma:
            return short


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class PointwiseCheck:
    """Worst relative differences of the model to the coils; each relative to the largest term of its equation.

    Parameters
    ----------
    current, magnetising, loop, zero : ndarray, shape (n,)
        Of the derivatives of i', i_m, i_f and the zero sequence of i'. Where the loop has no inductance, `loop` is
        of its current.
    terminal, star_point, torque : ndarray, shape (n,)
        Of terminal current, star-point voltage and torque.
    instant : ndarray of bool, shape (n,)
        Where the loop has no inductance.
    """

    current: Array
    magnetising: Array
    loop: Array
    zero: Array
    terminal: Array
    star_point: Array
    torque: Array
    instant: Array

    @property
    def worst(self) -> float:
        """Largest of all."""
        return float(max(getattr(self, one.name).max() for one in fields(self) if one.name != "instant"))


def _settle_instant(model: CoilModel, i: Array, theta_e: Array, omega: Array, v_t: Array) -> tuple[Array, Array]:
    """Mesh currents and derivatives where the loop has no inductance, from the coils alone.

    The inductance then has a null direction z: a current along z makes no flux, so it follows from z^T voltages = 0.
    """
    fixed, drop = coil_voltages(model, i, theta_e, omega)
    z = np.linalg.svd(fixed)[2][:, -1, :]
    z = z / z[:, 3:4]
    source = np.zeros_like(i)
    source[:, :3] = np.where(model.is_delta[:, None], v_t @ K_DELTA.T, v_t)
    along = coil_voltages(model, z, theta_e, omega)[1]
    size = np.einsum("ni,ni->n", z, source - drop) / np.einsum("ni,ni->n", z, along)
    settled = i + size[:, None] * z
    drop = coil_voltages(model, settled, theta_e, omega)[1]
    n = len(i)
    system = np.zeros((n, 8, 8))
    system[:, :7, :7] = fixed
    system[:, :3, 7] = system[:, 7, :3] = np.where(model.is_delta, 0.0, 1.0)[:, None]
    system[:, 7, 7] = np.where(model.is_delta, 1.0, 0.0)
    right = np.concatenate((source - drop, np.zeros((n, 1))), axis=1)
    # any solution will do: what differs along z makes no flux
    return settled, np.einsum("nij,nj->ni", np.linalg.pinv(system, rcond=1e-11, hermitian=True), right)


def check_pointwise(motor: Motor, rng: Generator, n: int = 3000) -> PointwiseCheck:
    """Compare the model with the coils at random machines, faults and states.

    Parameters
    ----------
    motor : Motor
        Its parameters are varied by a factor 0.5..2, in Y and delta.
    rng : numpy.random.Generator
        Source of randomness.
    n : int
        Number of states.

    Returns
    -------
    PointwiseCheck

    Raises
    ------
    ParameterError
        If `n` is below 1.
    """
    if n < 1:
        raise ParameterError(f"check_pointwise: n = {n}; give at least one state.")
    machines: list[tuple[Motor, Short]] = []
    for _ in range(n):
        factor = 2 ** rng.uniform(-1, 1, 5)
        varied = replace(
            motor, r_s=motor.r_s * factor[0], r_r=motor.r_r * factor[1], L_m=motor.L_m * factor[2],
            L_ls=motor.L_ls * factor[3], L_lr=motor.L_lr * factor[4], z_p=int(rng.integers(1, 4)),
            connection="Y" if rng.random() < 0.5 else "delta",
        )  # fmt: skip
        machines.append((varied, draw_short(rng)))
    c = stacked([short_constants(*one) for one in machines])
    model = coil_model(machines)
    gamma = np.array([short.gamma for _, short in machines])
    L_m = np.array([one.L_m for one, _ in machines])
    L_r = np.array([one.L_r for one, _ in machines])
    currents = rng.normal(0.0, 20.0, (n, 7))
    in_y = ~model.is_delta
    currents[in_y, :3] -= currents[in_y, :3].mean(axis=1, keepdims=True)
    theta_e, omega = rng.uniform(0, 2 * np.pi, n), rng.uniform(-400, 400, n)
    v_t = rng.normal(0.0, 300.0, (n, 3))
    instant = c.inv_loop_L == 0
    rates = np.zeros((n, 8))
    moving = np.flatnonzero(~instant)
    part = _part(model, moving)
    found = coil_rates(part, currents[moving], theta_e[moving], omega[moving], v_t[moving])
    rates[moving, :7], rates[moving, 7] = found.di, found.v_0
    if instant.any():
        rows = np.flatnonzero(instant)
        currents[rows], rates[rows] = _settle_instant(
            _part(model, rows), currents[rows], theta_e[rows], omega[rows], v_t[rows]
        )
    # the same states in the coordinates of the model
    turn = np.exp(1j * theta_e)

    def transformed(x: Array) -> tuple[Array, Array, Array]:
        effective = x[:, :3] - gamma * x[:, 3:4]
        return to_space_vector(effective), zero_sequence(effective), to_space_vector(x[:, 4:7])

    i, i_0, i_r = transformed(currents)
    di, di_0, di_r = transformed(rates[:, :7])
    i_m = (L_r * turn * i_r + L_m * i) / L_m
    di_m = (L_r * turn * (1j * model.z_p * omega * i_r + di_r) + L_m * di) / L_m
    i_f = currents[:, 3]
    # the model
    v = to_space_vector(v_t)
    v_s = (c.b_d + 1j * c.b_q) * v
    args = (v_s.real, v_s.imag)
    i_f_model = np.where(instant, instant_current.py_func(*args, c), i_f)
    speed = model.z_p * omega
    d = short_derivatives.py_func(i.real, i.imag, i_m.real, i_m.imag, i_f_model, speed, *args, c)
    seen = terminals.py_func(i.real, i.imag, i_m.real, i_m.imag, i_f_model, d[4], i_0, zero_sequence(v_t), c)
    # terminal currents of the coils: a delta's line current is the difference of two windings
    lines = np.where(model.is_delta[:, None], currents[:, :3] - currents[:, [2, 0, 1]], currents[:, :3])
    i_t = to_space_vector(lines)
    i_s0 = currents[:, :3].mean(axis=1)
    decay = -c.r_s / c.L_ls * i_0  # zero sequence of a delta
    terms_i = c.inv_L_s * (np.abs(v_s) + (c.r_s + c.R_r) * np.abs(i) + (c.R_r + np.abs(speed) * c.L_m) * np.abs(i_m))
    terms_m = c.inv_L_m * (c.R_r * np.abs(i) + (c.R_r + np.abs(speed) * c.L_m) * np.abs(i_m))
    drive = 1.5 * np.abs(c.g_d + 1j * c.g_q) * np.abs(v_s)
    loop = np.where(
        instant,
        np.abs(i_f - i_f_model) * c.loop_R / drive,
        np.abs(rates[:, 3] - d[4]) / np.where(instant, 1.0, c.inv_loop_L * (drive + c.loop_R * np.abs(i_f))),
    )
    T_e = coil_torque(model, currents, theta_e)
    star = np.abs(zero_sequence(v_t)) + np.abs(c.star) * (c.r_s * np.abs(i_f) + c.L_ls * np.abs(d[4]))
    circulating = np.where(model.is_delta, np.abs(seen.i_s0 - i_s0), 0.0) / np.abs(currents[:, :3]).max(axis=1)
    zero = np.where(model.is_delta, np.abs(di_0 - decay), 0.0) / (
        c.r_s / c.L_ls * np.abs(currents[:, :3]).max(axis=1) + np.abs(c.star * d[4])
    )
    return PointwiseCheck(
        current=np.abs(di - (d[0] + 1j * d[1])) / terms_i,
        magnetising=np.abs(di_m - (d[2] + 1j * d[3])) / terms_m,
        loop=loop,
        zero=np.maximum(circulating, zero),
        terminal=np.abs(i_t - (seen.i_td + 1j * seen.i_tq)) / np.abs(lines).max(axis=1),
        star_point=np.where(model.is_delta, 0.0, np.abs(rates[:, 7] - seen.v_0)) / star,
        torque=np.abs(T_e - seen.torque) / (c.k_T * np.abs(i) * np.abs(i_m)),
        instant=instant,
    )


def _part(model: CoilModel, rows: Array) -> CoilModel:
    return CoilModel(**{one.name: getattr(model, one.name)[rows] for one in fields(model)})


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class TrajectoryCheck:
    """Runs of the model and of the coils, time first, machines second; SI.

    Parameters
    ----------
    t : ndarray, shape (n,)
        s.
    i_t, i_t_coils : ndarray, shape (n, m, 3)
        Terminal currents of the model and of the coils, A.
    i_f, i_f_coils, omega, omega_coils, v_0, v_0_coils : ndarray, shape (n, m)
        Loop current, A; speed, rad/s; star-point voltage, V.
    """

    t: Array
    i_t: Array
    i_t_coils: Array
    i_f: Array
    i_f_coils: Array
    omega: Array
    omega_coils: Array
    v_0: Array
    v_0_coils: Array

    @property
    def terminal(self) -> Array:
        """Largest difference of the terminal currents relative to their peak, of each machine, shape (m,)."""
        return np.abs(self.i_t - self.i_t_coils).max(axis=(0, 2)) / np.abs(self.i_t_coils).max(axis=(0, 2))

    @property
    def loop(self) -> Array:
        """The same of the loop current."""
        return np.abs(self.i_f - self.i_f_coils).max(axis=0) / np.abs(self.i_f_coils).max(axis=0)

    @property
    def speed(self) -> Array:
        """The same of the speed."""
        return np.abs(self.omega - self.omega_coils).max(axis=0) / np.abs(self.omega_coils).max(axis=0)

    @property
    def worst(self) -> float:
        """Largest difference of a current relative to its peak."""
        return float(max(self.terminal.max(), self.loop.max()))


def _phasors(supply: Supply) -> tuple[Array, Array, Array, Array]:
    """Angular frequencies and amplitudes of space vector and zero sequence of a supply of constant frequency."""
    if supply.frequency is not None:
        raise ParameterError("check_trajectory: give a supply of constant frequency (frequency = None).")
    w = 2 * np.pi * supply.rated_frequency
    turns, vectors, zero_turns, zeros = [w], [supply.amplitude * np.exp(1j * supply.phase)], [], []
    for part in supply.components:
        phasor = supply.amplitude * part.ratio * np.exp(1j * (part.phase + part.order * supply.phase))
        if part.sequence == 0:
            zero_turns.append(part.order * w)
            zeros.append(phasor)
        else:
            turns.append(part.sequence * part.order * w)
            vectors.append(phasor if part.sequence > 0 else phasor.conjugate())
    return np.array(turns), np.array(vectors), np.array(zero_turns), np.array(zeros, dtype=complex)


def default_shorts() -> tuple[Short, ...]:
    """Faults of the trajectory check: one phase and loops between phases, small and large, coupled leakage and not.

    Returns
    -------
    tuple of Short
    """
    return (
        Short(gamma=(0.02, 0.0, 0.0), kappa_c=1.0),
        Short(gamma=(0.0, 0.3, 0.0), kappa_c=0.5),
        Short(gamma=(0.1, -0.06, 0.0), kappa_c=1.0, r_f=0.2),
        Short(gamma=(0.0, 0.15, 0.1), kappa_c=0.5, r_f=0.02),
    )


def check_trajectory(
    motor: Motor, supply: Supply, *, shorts: Sequence[Short] | None = None, inertia: float = 2e-3,
    load: float = 5e-5, duration: float = 0.15, points: int = 301, rtol: float = 1e-12,
) -> TrajectoryCheck:  # fmt: skip
    """Run the model and the coils from standstill, in Y and in delta, and compare.

    Parameters
    ----------
    motor : Motor
        The motor.
    supply : Supply
        Constant frequency; unbalance, harmonics and zero sequence at will.
    shorts : sequence of Short, optional
        Faults, each run in Y and in delta; `default_shorts` by default. Loops need an inductance.
    inertia : float
        kg m2, small to have the start-up within a short run.
    load : float
        Torque of the pump over the square of the speed, N m s2.
    duration : float
        s.
    points : int
        Times of the result.
    rtol : float
        Relative tolerance of DOP853.

    Returns
    -------
    TrajectoryCheck

    Raises
    ------
    ParameterError
        If a loop has no inductance (use `check_pointwise`) or the supply's frequency varies.
    SimulationError
        If the integration fails.
    """
    faults = default_shorts() if shorts is None else tuple(shorts)
    machines = [(replace(motor, connection=k), short) for k in ("Y", "delta") for short in faults]
    c = stacked([short_constants(*one) for one in machines])
    if np.any(c.inv_loop_L == 0):
        raise ParameterError("check_trajectory: a loop has no inductance; check it with check_pointwise.")
    model = coil_model(machines)
    m = len(machines)
    turns, vectors, zero_turns, zeros = _phasors(supply)
    b = c.b_d + 1j * c.b_q
    z_p = model.z_p

    def voltage(t: float) -> tuple[complex, float]:
        return complex(vectors @ np.exp(1j * turns * t)), float((zeros @ np.exp(1j * zero_turns * t)).real)

    def model_rhs(t: float, x: Array) -> Array:
        i_d, i_q, m_d, m_q, i_f, omega = x.reshape(6, m)
        v_s = b * voltage(t)[0]
        d = short_derivatives.py_func(i_d, i_q, m_d, m_q, i_f, z_p * omega, v_s.real, v_s.imag, c)
        torque = c.k_T * (m_d * i_q - m_q * i_d)
        return np.concatenate((*d, (torque - load * omega * np.abs(omega)) / inertia))

    def coil_rhs(t: float, x: Array) -> Array:
        i, theta, omega = x[: 7 * m].reshape(m, 7), x[7 * m : 8 * m], x[8 * m :]
        v, v_0 = voltage(t)
        v_t = np.broadcast_to((v * PHASE_AXES.conj()).real + v_0, (m, 3))
        found = coil_rates(model, i, z_p * theta, omega, v_t)
        return np.concatenate((found.di.ravel(), omega, (found.torque - load * omega * np.abs(omega)) / inertia))

    t = np.linspace(0.0, duration, points)
    x = _integrate(model_rhs, np.zeros(6 * m), t, rtol).reshape(points, 6, m)
    y = _integrate(coil_rhs, np.zeros(9 * m), t, rtol)
    i, theta, omega = y[:, : 7 * m].reshape(points, m, 7), y[:, 7 * m : 8 * m], y[:, 8 * m :]
    v, v_0 = np.array([voltage(one) for one in t]).T
    v_s = b * v[:, None]
    states = [x[:, k] for k in range(5)]
    d = short_derivatives.py_func(*states, z_p * x[:, 5], v_s.real, v_s.imag, c)
    seen = terminals.py_func(*states, d[4], 0.0, v_0.real[:, None], c)
    v_t = to_phases(v, v_0.real)
    star = [coil_rates(model, i[k], z_p * theta[k], omega[k], np.tile(v_t[k], (m, 1))).v_0 for k in range(points)]
    lines = np.where(model.is_delta[:, None], i[..., :3] - i[..., [2, 0, 1]], i[..., :3])
    return TrajectoryCheck(
        t=t,
        i_t=to_phases(seen.i_td + 1j * seen.i_tq),
        i_t_coils=lines,
        i_f=x[:, 4],
        i_f_coils=i[..., 3],
        omega=x[:, 5],
        omega_coils=omega,
        v_0=seen.v_0,
        v_0_coils=np.array(star),
    )


def _integrate(rhs: Any, start: Array, t: Array, rtol: float) -> Array:
    from scipy.integrate import solve_ivp

    solution = solve_ivp(rhs, (t[0], t[-1]), start, method="DOP853", t_eval=t, rtol=rtol, atol=1e-11)
    if not solution.success:
        raise SimulationError(f"check_trajectory stopped at t = {solution.t[-1]:g} s: {solution.message}")
    return np.asarray(solution.y.T)
