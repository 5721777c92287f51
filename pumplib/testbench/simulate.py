"""Thesis 4.4.2, 5.3, 6.7, 7.4: one run of the bench's plant from prescribed quantities to its true signals."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pumplib.errors import ParameterError, SimulationError
from pumplib.machines.profile import Profile, as_profile
from pumplib.motor.supply import Supply, angle_at, frequency_at
from pumplib.plant.operating import operating_point
from pumplib.testbench.kernels import FAST, STEPS_PER_TICK, TICK, Source, run_bench
from pumplib.testbench.machine import BenchMachine, constants, source, thermal
from pumplib.testbench.plant import N_STATES, Slow

Array = NDArray[Any]
STEP = 1e-4  # s
TICK_SECONDS = STEP * STEPS_PER_TICK
_NEUTRAL = Slow(
    valve=0.0, load=0.0, r_s=1.0, r_r=1.0, density=1.0, p_source=0.0, gamma_a=0.0, gamma_b=0.0, gamma_c=0.0, r_f=0.0,
    G_ground=0.0, K_f=0.0, dB=0.0, K_l=0.0, f_c=0.0, f_d=0.0, K_ext=0.0, K_in=0.0, bearing=0.0, block=0.0,
)  # fmt: skip


@dataclass(frozen=True, kw_only=True, eq=False)
class Truth:
    """True signals of a run; for sensors, and for scoring only.

    Parameters
    ----------
    t_fast : ndarray, shape (10 n,)
        Times of the electrical signals, s.
    fast : ndarray, shape (10 n, 7)
        Terminal voltages (V), terminal currents (A), star-point voltage (V), see `FAST`.
    t : ndarray, shape (n,)
        Times of the slower signals, s.
    tick : ndarray, shape (n, 14)
        See `TICK`.
    slow : ndarray, shape (n, 20)
        Operating point, disturbances and faults, in the order of `pumplib.testbench.plant.Slow`.
    frequency : ndarray, shape (n,)
        Supply frequency, Hz.
    state, extra : ndarray
        Final state, for a run that goes on.
    """

    t_fast: Array
    fast: Array
    t: Array
    tick: Array
    slow: Array
    frequency: Array
    state: Array
    extra: Array

    def __getitem__(self, name: str) -> Array:
        """One signal by its name in `FAST`, `TICK` or `Slow`."""
        for names, values in ((FAST, self.fast), (TICK, self.tick), (Slow._fields, self.slow)):
            if name in names:
                return np.asarray(values[:, names.index(name)])
        raise ParameterError(f"signal {name!r}: must be one of {', '.join((*FAST, *TICK, *Slow._fields))}.")


def start_state(machine: BenchMachine, amplitude: float, frequency: float, valve: float) -> Array:
    """State near the operating point, so that a run need not begin with a start-up.

    Parameters
    ----------
    machine : BenchMachine
        The machine.
    amplitude, frequency : float
        Supply at the start, V and Hz.
    valve : float
        Valve at the start, Pa s2/m6.

    Returns
    -------
    ndarray, shape (9,)
        The operating point of the plain model; what saturation and losses change settles within tenths of a second.

    Raises
    ------
    ParameterError
        If there is no operating point.
    """
    motor = machine.base.motor
    point = operating_point(machine.base, amplitude, frequency, valve)
    i_s, i_m = point.i_s, point.i_m
    if motor.connection == "delta":  # the phasor refers to the stator voltage, which leads by 30 degrees
        turn = complex(np.exp(1j * np.pi / 6))
        i_s, i_m = i_s * turn, i_m * turn
    psi_s, psi_r = motor.L_s_prime * i_s + motor.L_m_prime * i_m, motor.L_m * i_m
    return np.array(
        [psi_s.real, psi_s.imag, psi_r.real, psi_r.imag, point.omega, 0.0, point.q, point.Q_p, valve], dtype=float
    )


def simulate_bench(
    machine: BenchMachine,
    supply: Supply,
    *,
    duration: float,
    slow: Mapping[str, float | Profile | Array] | None = None,
    negative: complex | Array = 0.0,
    level: float | Profile | Array = 1.0,
    wave: Source | None = None,
    initial: Array | None = None,
    extra: Array | None = None,
) -> Truth:
    """Simulate the bench's plant.

    Parameters
    ----------
    machine : BenchMachine
        The machine.
    supply : Supply
        Amplitude and frequency over time; its own components are not used here, see `negative` and `wave`.
    duration : float
        s, a multiple of a millisecond.
    slow : mapping, optional
        Prescribed quantities by the names of `pumplib.testbench.plant.Slow`: a number, a profile over time or one
        value a millisecond. Left out: the application's valve, everything else neutral.
    negative : complex or ndarray, shape (n,)
        Negative sequence of the supply relative to the fundamental, constant or one value a millisecond.
    level : float or Profile or ndarray, shape (n,)
        Factor of the supply's amplitude: sags, swells and steps.
    wave : Source, optional
        Harmonics and inverter; a clean grid if left out.
    initial, extra : ndarray, optional
        State to go on from, `Truth.state` and `Truth.extra`; standstill if left out.

    Returns
    -------
    Truth

    Raises
    ------
    ParameterError
        If a quantity is unknown, has the wrong length, or is impossible (shorted turns beyond 100 %, f_c >= 0.35 ...).
    SimulationError
        If the solution leaves the finite numbers.
    """
    n = round(duration / TICK_SECONDS)
    if n < 1 or abs(n * TICK_SECONDS - duration) > 1e-9 * max(duration, 1.0):
        raise ParameterError(f"duration = {duration!r} s: must be a positive multiple of {TICK_SECONDS:g} s.")
    t = TICK_SECONDS * np.arange(n + 1)
    table = _slow_table({"valve": machine.base.application.K_v, **(slow or {})}, t[:-1])
    sequence = np.empty((n, 2))
    given = np.broadcast_to(np.asarray(negative, dtype=complex), (n,))
    sequence[:, 0], sequence[:, 1] = given.real, given.imag
    hertz = frequency_at(supply, t)
    full = supply.boost + (supply.amplitude - supply.boost) * hertz / supply.rated_frequency
    amplitude = np.minimum(full, supply.amplitude) if supply.frequency is not None else np.full(n + 1, supply.amplitude)
    factor = column(level, "level", t[:-1])
    amplitude = amplitude * np.append(factor, factor[-1])
    wave = wave or source()
    _check_modulation(wave, amplitude, given)
    turns = np.mod(angle_at(supply, t) / (2 * np.pi), 1.0)
    state = np.zeros(N_STATES) if initial is None else np.array(initial, dtype=float)
    if initial is None:
        state[8] = table[0, 0]
    loop = np.array([0.0, machine.ambient]) if extra is None else np.array(extra, dtype=float)
    fast = np.empty((n * STEPS_PER_TICK, len(FAST)))
    tick = np.empty((n, len(TICK)))
    run_bench(
        state, loop, turns, hertz, amplitude, sequence, table, STEP, constants(machine), wave, thermal(machine), fast,
        tick,
    )  # fmt: skip
    if not np.isfinite(state).all():
        bad = int(np.argmin(np.isfinite(tick).all(axis=1)))
        raise SimulationError(
            f"the bench left the finite numbers at t = {t[bad]:g} s; check the machine's inertias (J, K_p, K_J) and "
            "leakage inductances for values that are far too small for steps of 0.1 ms."
        )
    return Truth(
        t_fast=STEP * np.arange(n * STEPS_PER_TICK),
        fast=fast,
        t=t[:-1],
        tick=tick,
        slow=table,
        frequency=hertz[:-1],
        state=state,
        extra=loop,
    )


_LIMITS = {  # lowest and highest value that the equations make sense for
    "valve": (0.0, 1e18), "r_s": (0.1, 5.0), "r_r": (0.1, 5.0), "density": (0.0, 3.0), "gamma_a": (-1.0, 1.0),
    "gamma_b": (-1.0, 1.0), "gamma_c": (-1.0, 1.0), "r_f": (0.0, 1e9), "G_ground": (0.0, 1e3), "K_f": (0.0, 1e16),
    "dB": (0.0, 10.0), "K_l": (0.0, 1e-3), "f_c": (0.0, 0.35), "f_d": (0.0, 1.0), "K_ext": (0.0, 1e-3),
    "K_in": (0.0, 1e16), "bearing": (0.0, 1e3), "block": (0.0, 1e4), "level": (0.0, 2.0),
}  # fmt: skip


def column(value: float | Profile | Array, name: str, t: Array) -> Array:
    """One prescribed quantity at the ticks.

    Parameters
    ----------
    value : float or Profile or ndarray, shape (n,)
        As given.
    name : str
        For its limits and for messages.
    t : ndarray, shape (n,)
        Times of the ticks, s.

    Returns
    -------
    ndarray, shape (n,)

    Raises
    ------
    ParameterError
        If the shape is wrong or a value lies outside the limits of the quantity.
    """
    if isinstance(value, np.ndarray):
        if value.shape != t.shape:
            raise ParameterError(f"{name} has shape {value.shape}: one value a millisecond is {t.shape}.")
        values = value
    else:
        profile = as_profile(value, name)
        if profile.kind == "lines":
            values = np.interp(t, profile.times, profile.values)
        else:
            # half a step of tolerance, so that a time of 0.3 s is the tick 300
            index = np.searchsorted(profile.times, t + 0.5 * STEP, side="right") - 1
            values = profile.values[np.maximum(index, 0)]
    low, high = _LIMITS.get(name, (-np.inf, np.inf))
    if not np.isfinite(values).all() or values.min() < low or values.max() > high:
        raise ParameterError(
            f"{name} runs from {values.min():g} to {values.max():g}: must stay within {low:g} to {high:g}."
        )
    return np.asarray(values, dtype=float)


def _check_modulation(wave: Source, amplitude: Array, negative: Array) -> None:
    if wave.carrier <= 0.0:
        return
    parts = abs(complex(wave.h5_re, wave.h5_im)) + abs(complex(wave.h7_re, wave.h7_im)) + float(np.abs(negative).max())
    highest = float(amplitude.max()) * (1.0 + parts)
    if highest > wave.link / np.sqrt(3.0):
        raise ParameterError(
            f"the supply reaches {highest:.0f} V with its harmonics: pulses of a {wave.link:g} V link end at "
            f"{wave.link / np.sqrt(3.0):.0f} V; raise dc_link or lower the supply's amplitude."
        )


def _slow_table(given: Mapping[str, float | Profile | Array], t: Array) -> Array:
    table = np.tile(np.array(_NEUTRAL), (len(t), 1))
    for name, value in given.items():
        if name not in Slow._fields:
            raise ParameterError(f"quantity {name!r}: must be one of {', '.join(Slow._fields)}.")
        table[:, Slow._fields.index(name)] = column(value, name, t)
    shorted = np.abs(table[:, 6:9]).sum(axis=1)
    if np.any((np.abs(table[:, 6:9]) >= 1.0).any(axis=1)):
        raise ParameterError(f"gamma reaches {shorted.max():g}: a shorted share of the turns must stay below 1.")
    if np.any((shorted > 0) & (table[:, 9] < 0)):
        raise ParameterError("r_f must be >= 0 ohm.")
    return table
