"""Thesis 3.5: simulate a motor-pump set, one run or many parameter sets, into trajectories."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pumplib.errors import ParameterError, SimulationError
from pumplib.hydraulics.pressure import casing_pressure, impeller_pressure, impeller_torque
from pumplib.machines.parameters import PumpSet
from pumplib.machines.profile import Profile, as_profile
from pumplib.motor.dq import torque
from pumplib.motor.frames import stator_voltage, terminal_current, to_phases
from pumplib.motor.supply import Supply, terminal_voltage
from pumplib.plant.equations import STATE_UNITS, STATES, Coefficients, coefficients
from pumplib.plant.kernels import LANES, N_COEFFICIENTS, N_STATES, derivatives_along, run_many, run_one

Array = NDArray[Any]


@dataclass(frozen=True, kw_only=True, eq=False)
class Trajectory:
    """Result of one run. Time is the first axis; SI units.

    Parameters
    ----------
    t : ndarray, shape (n,)
        Times, s.
    x : ndarray, shape (n, 7)
        States i_sd, i_sq, i_md, i_mq (A), omega (rad/s), q, Q_p (m3/s).
    v_t : complex ndarray, shape (n,)
        Terminal voltage as space vector, V.
    v_t0 : ndarray, shape (n,)
        Zero sequence of the terminal voltage, V.
    K_v, T_load : ndarray, shape (n,)
        Valve, Pa s2/m6, and load torque, N m, from this time on.
    machine : PumpSet
        What was simulated.
    c : Coefficients
        Its coefficients, with the model variant that was chosen.
    """

    t: Array
    x: Array
    v_t: Array
    v_t0: Array
    K_v: Array
    T_load: Array
    machine: PumpSet
    c: Coefficients

    @property
    def i_s(self) -> Array:
        """Stator (winding) current as space vector, A."""
        return self.x[:, 0] + 1j * self.x[:, 1]

    @property
    def i_m(self) -> Array:
        """Magnetising current as space vector, A."""
        return self.x[:, 2] + 1j * self.x[:, 3]

    @property
    def omega(self) -> Array:
        """Shaft speed, rad/s."""
        return self.x[:, 4]

    @property
    def q(self) -> Array:
        """Leakage flow, m3/s."""
        return self.x[:, 5]

    @property
    def Q_p(self) -> Array:
        """Flow through the pump, m3/s."""
        return self.x[:, 6]

    @property
    def Q_i(self) -> Array:
        """Flow through the impeller, m3/s."""
        return self.Q_p + self.q

    @property
    def v_s(self) -> Array:
        """Stator (winding) voltage as space vector, V."""
        return stator_voltage(self.v_t, self.machine.motor.connection)

    @property
    def i_t(self) -> Array:
        """Terminal current as space vector, A."""
        return terminal_current(self.i_s, self.machine.motor.connection)

    @property
    def i_abc(self) -> Array:
        """Terminal currents, shape (n, 3), A."""
        return to_phases(self.i_t)

    @property
    def v_abc(self) -> Array:
        """Terminal voltages to the supply's neutral, shape (n, 3), V."""
        return to_phases(self.v_t, self.v_t0)

    @property
    def T_e(self) -> Array:
        """Electromagnetic torque (3.11), N m."""
        x = self.x
        return torque.py_func(x[:, 0], x[:, 1], x[:, 2], x[:, 3], self.c.k_T)

    @property
    def T_p(self) -> Array:
        """Steady part of the impeller torque (3.19), N m."""
        c = self.c
        return impeller_torque.py_func(self.Q_i, self.omega, c.a_t0, c.a_t1, c.a_t2)

    @property
    def H_i(self) -> Array:
        """Pressure of the impellers (3.24), Pa."""
        c = self.c
        algebraic = impeller_pressure.py_func(self.Q_i, self.omega, c.a_h0, c.a_h1, c.a_h2)
        return algebraic + c.c_H * self.dx[:, 4] if c.c_H else algebraic

    @property
    def H_p(self) -> Array:
        """Pressure between the flanges (3.25), Pa."""
        return casing_pressure.py_func(self.H_i, self.Q_p, self.c.K_c)

    @property
    def dx(self) -> Array:
        """Time derivatives of the states, shape (n, 7)."""
        v, out = self.v_s, np.empty_like(self.x)
        derivatives_along(self.x, v.real.copy(), v.imag.copy(), self.K_v, self.T_load, self.c, out)
        return out


@dataclass(frozen=True, kw_only=True, eq=False)
class Batch:
    """Result of many runs on the same inputs.

    Parameters
    ----------
    t : ndarray, shape (n,)
        Times, s.
    x : ndarray, shape (n, machines, 7)
        States as in `Trajectory`.
    machines : tuple of PumpSet
        What was simulated, in the order of the second axis.
    """

    t: Array
    x: Array
    machines: tuple[PumpSet, ...]


@dataclass(frozen=True, slots=True)
class _Inputs:
    """Inputs of one smooth segment at half steps."""

    v_t: Array
    v_t0: Array
    K_v: Array
    T_load: Array


def _grid(duration: float, step: float, every: int, breaks: Array) -> list[int]:
    """Indices of the segment ends on the step grid; every break has to lie on the record grid."""
    if not (isinstance(duration, int | float) and math.isfinite(duration) and duration > 0):
        raise ParameterError(f"duration = {duration!r} s: must be a finite number > 0.")
    if not (isinstance(step, int | float) and 0 < step <= duration):
        raise ParameterError(f"step = {step!r} s: must be > 0 and not longer than the duration, {duration:g} s.")
    if not isinstance(every, int) or every < 1:
        raise ParameterError(f"every = {every!r}: must be a whole number of steps >= 1.")
    record = step * every
    ends = [duration, *(float(b) for b in breaks if 0 < b < duration)]
    indices = {0}
    for end in ends:
        k = round(end / record)
        if abs(k * record - end) > 1e-6 * record:
            what = "duration" if end == duration else "a step or corner of an input at t"
            raise ParameterError(
                f"{what} = {end:.9g} s is not a multiple of the recorded step {record:g} s; "
                f"move it to {k * record:.9g} s or choose another step."
            )
        indices.add(k * every)
    return sorted(indices)


def _segments(
    supply: Supply, valve: Profile, load: Profile, duration: float, step: float, every: int
) -> list[tuple[int, int, _Inputs]]:
    breaks = np.concatenate((supply.breaks(), valve.breaks(), load.breaks()))
    ends = _grid(duration, step, every, breaks)
    found = []
    for first, last in pairwise(ends):
        start, n = first * step, 2 * (last - first) + 1
        v_t, v_t0 = terminal_voltage(supply, start, 0.5 * step, n)
        K_v, T_load = _sampled(valve, start, 0.5 * step, n), _sampled(load, start, 0.5 * step, n)
        found.append((first, last, _Inputs(v_t, v_t0, K_v, T_load)))
    return found


def _sampled(profile: Profile, start: float, step: float, n: int) -> Array:
    if profile.kind == "steps":  # constant within a segment
        return np.full(n, profile.sample(np.array([start]), start)[0])
    return profile.sample(start + step * np.arange(n), start)


def _initial(initial: Array | Sequence[float] | None) -> Array:
    if initial is None:
        return np.zeros(N_STATES)
    x = np.array(initial, dtype=float)
    if x.shape != (N_STATES,) or not np.isfinite(x).all():
        raise ParameterError(
            f"initial has shape {x.shape}: must be {N_STATES} finite numbers "
            f"({', '.join(f'{n} in {u}' for n, u in zip(STATES, STATE_UNITS, strict=True))})."
        )
    return x


def _check_valve(valve: Profile) -> None:
    if valve.values.min() < 0:
        raise ParameterError(
            f"valve = {valve.values.min():g} Pa s2/m6: must be >= 0; a closed valve is a large number (1e18)."
        )


def _check_finite(t: Array, x: Array, step: float, motor_time: float) -> None:
    if np.isfinite(x[-1]).all():
        return
    bad = int(np.argmin(np.isfinite(x).reshape(len(x), -1).all(axis=1)))
    state = STATES[int(np.argmin(np.isfinite(x[bad]).reshape(-1, N_STATES).all(axis=0)))]
    raise SimulationError(
        f"{state} left the finite numbers at t = {t[bad]:g} s. The step of {step:g} s is probably too long: the "
        f"fastest electrical time constant is {motor_time:.3g} s and needs a step below about twice that; also check "
        "inertias (J, K_p, K_J) for values that are far too small."
    )


def simulate(
    machine: PumpSet,
    supply: Supply,
    *,
    duration: float,
    step: float = 1e-4,
    valve: float | Profile | None = None,
    load_torque: float | Profile = 0.0,
    initial: Array | Sequence[float] | None = None,
    every: int = 1,
    leakage: bool = True,
    flow: bool = True,
    reciprocal: bool = False,
) -> Trajectory:
    """Simulate a motor-pump set from standstill or a given state.

    Parameters
    ----------
    machine : PumpSet
        Motor, pump and application.
    supply : Supply
        Voltage at the terminals.
    duration : float
        s, a multiple of the recorded step.
    step : float
        Step of the Runge-Kutta integration, s.
    valve : float or Profile, optional
        K_v, Pa s2/m6; the application's own value if left out.
    load_torque : float or Profile
        Torque on the shaft beside the pump's, N m.
    initial : array_like, shape (7,), optional
        Initial state; zeros (standstill, no field, no flow) if left out.
    every : int
        Steps per recorded sample.
    leakage, flow, reciprocal : bool
        Model variant, see `pumplib.plant.equations.coefficients`.

    Returns
    -------
    Trajectory

    Raises
    ------
    ParameterError
        If an argument is wrong, or a step or corner of an input does not lie on the recorded grid.
    SimulationError
        If the solution leaves the finite numbers.

    References
    ----------
    Thesis (3.7), (3.11), (3.21), (3.25); 3.4-3.5 reconstructed.
    """
    valve_profile = as_profile(machine.application.K_v if valve is None else valve, "valve (Pa s2/m6)")
    load_profile = as_profile(load_torque, "load_torque (N m)")
    _check_valve(valve_profile)
    segments = _segments(supply, valve_profile, load_profile, duration, step, every)
    c = coefficients(machine, leakage=leakage, flow=flow, reciprocal=reciprocal)
    n = segments[-1][1] // every
    x = np.empty((n + 1, N_STATES))
    state = _initial(initial)
    x[0] = state
    v_t = np.empty(n + 1, dtype=complex)
    v_t0, K_v, T_load = np.empty(n + 1), np.empty(n + 1), np.empty(n + 1)
    for first, last, u in segments:
        v_s = stator_voltage(u.v_t, machine.motor.connection)
        a, b = first // every, last // every
        run_one(state, v_s.real, v_s.imag, u.K_v, u.T_load, step, every, c, x[a + 1 : b + 1])
        # the last sample of a segment is overwritten by the first of the next: "from this time on"
        kept = slice(a, b + 1)
        for target, source in ((v_t, u.v_t), (v_t0, u.v_t0), (K_v, u.K_v), (T_load, u.T_load)):
            target[kept] = source[:: 2 * every]
    t = step * every * np.arange(n + 1)
    motor = machine.motor
    _check_finite(t, x, step, motor.L_s_prime / (motor.r_s + motor.R_r_prime))
    return Trajectory(t=t, x=x, v_t=v_t, v_t0=v_t0, K_v=K_v, T_load=T_load, machine=machine, c=c)


def simulate_many(
    machines: Sequence[PumpSet],
    supply: Supply,
    *,
    duration: float,
    step: float = 1e-4,
    valve: float | Profile,
    load_torque: float | Profile = 0.0,
    every: int = 100,
    leakage: bool = True,
    flow: bool = True,
    reciprocal: bool = False,
) -> Batch:
    """Simulate many machines of equal connection on the same inputs, from standstill.

    Parameters
    ----------
    machines : sequence of PumpSet
        The parameter sets.
    supply : Supply
        Voltage at the terminals.
    duration, step : float
        As in `simulate`, s.
    valve : float or Profile
        K_v, Pa s2/m6, common to all.
    load_torque : float or Profile
        N m, common to all.
    every : int
        Steps per recorded sample.
    leakage, flow, reciprocal : bool
        Model variant, see `pumplib.plant.equations.coefficients`.

    Returns
    -------
    Batch

    Raises
    ------
    ParameterError
        If there is no machine, the connections differ, or an argument is wrong.
    SimulationError
        If a solution leaves the finite numbers.
    """
    if not machines:
        raise ParameterError("machines is empty: give at least one PumpSet.")
    connections = {m.motor.connection for m in machines}
    if len(connections) > 1:
        raise ParameterError("machines mix Y and delta motors: run them in two batches, the stator voltage differs.")
    valve_profile = as_profile(valve, "valve (Pa s2/m6)")
    _check_valve(valve_profile)
    segments = _segments(supply, valve_profile, as_profile(load_torque, "load_torque (N m)"), duration, step, every)
    rows = np.array([coefficients(m, leakage=leakage, flow=flow, reciprocal=reciprocal) for m in machines])
    count, blocks = len(machines), -(-len(machines) // LANES)
    # unused lanes of the last block repeat the last machine
    rows = np.concatenate((rows, np.repeat(rows[-1:], blocks * LANES - count, axis=0)))
    c = np.ascontiguousarray(rows.reshape(blocks, LANES, N_COEFFICIENTS).transpose(0, 2, 1))
    n = segments[-1][1] // every
    x = np.zeros((n + 1, count, N_STATES))
    state = np.zeros((blocks, N_STATES, LANES))
    for first, last, u in segments:
        v_s = stator_voltage(u.v_t, connections.copy().pop())
        a, b = first // every, last // every
        out = np.empty((blocks, b - a, N_STATES, LANES))
        run_many(state, v_s.real, v_s.imag, u.K_v, u.T_load, step, every, c, out)
        x[a + 1 : b + 1] = out.transpose(1, 0, 3, 2).reshape(b - a, blocks * LANES, N_STATES)[:, :count]
    t = step * every * np.arange(n + 1)
    fastest = min(m.motor.L_s_prime / (m.motor.r_s + m.motor.R_r_prime) for m in machines)
    _check_finite(t, x, step, fastest)
    return Batch(t=t, x=x, machines=tuple(machines))
