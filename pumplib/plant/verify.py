"""Thesis 3.2.1, 3.2.2, 3.3.1, 3.3.2, 3.3.4: experiments that confront the model with independent routes.

Each function runs one comparison and returns its numbers; the notebook of chapter 3 shows and records them.
"""

import math
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from pumplib.hydraulics.impeller import (
    euler_torque,
    simplified,
    stage_coefficients,
    tangential_speed,
    theoretical_head,
)
from pumplib.hydraulics.pressure import impeller_pressure, impeller_torque
from pumplib.machines.parameters import Impeller, Liquid, Motor, Pump, PumpSet
from pumplib.machines.profile import Profile
from pumplib.motor.abc import PhaseTrajectory, simulate_phases
from pumplib.motor.frames import to_phases, to_space_vector
from pumplib.motor.supply import Supply, terminal_voltage
from pumplib.plant.operating import operating_point
from pumplib.plant.simulate import Trajectory, simulate

Array = NDArray[Any]


@dataclass(frozen=True, kw_only=True, eq=False)
class PhaseComparison:
    """The dq model against the phase model under the same supply.

    Parameters
    ----------
    dq : Trajectory
        Simulated with the workbook's kernel.
    phases : PhaseTrajectory
        Simulated in phase coordinates with another integrator.
    difference : ndarray, shape (n,)
        |i_t,dq - i_t,abc| / max |i_t|, dimensionless.
    current, torque : float
        Largest relative difference of terminal current and torque.
    star_point : float
        Largest |v_0 - v_t0| / amplitude of a Y-connected stator; 0 for delta.
    """

    dq: Trajectory
    phases: PhaseTrajectory
    difference: Array
    current: float
    torque: float
    star_point: float


def motor_alone(machine: PumpSet, load: float = 0.0) -> PumpSet:
    """The same set with the pump's torque taken away; simulate it with ``flow=False, leakage=False``.

    Parameters
    ----------
    machine : PumpSet
        The set.
    load : float
        Load torque coefficient, T = load omega |omega|, N m s2.

    Returns
    -------
    PumpSet
    """
    pump = replace(machine.pump, a_t0=load / machine.pump.stages, a_t1=0.0, a_t2=0.0, J_Mv=0.0, K_Q=0.0, B=0.0)
    return replace(machine, pump=pump)


def compare_phase_model(
    machine: PumpSet, supply: Supply, *, duration: float = 0.04, step: float = 5e-6, sample: float = 1e-4
) -> PhaseComparison:
    """Start the motor direct on line in dq and in phase coordinates and compare.

    Parameters
    ----------
    machine : PumpSet
        Its motor is used, with a quadratic load; the pump is left out.
    supply : Supply
        Any supply, also unbalanced, with harmonics and zero sequence.
    duration : float
        s.
    step : float
        Step of the dq simulation, s.
    sample : float
        Distance of the compared samples, s, a multiple of `step`.

    Returns
    -------
    PhaseComparison

    References
    ----------
    Thesis (3.1)-(3.3) against (3.7), (3.9), (3.10); remark 3.2.1 for the star point.
    """
    motor = machine.motor
    k = 5.0 / 300.0**2  # 5 N m at 300 rad/s
    alone = motor_alone(machine, k)
    every = round(sample / step)
    dq = simulate(alone, supply, duration=duration, step=step, every=every, flow=False, leakage=False)

    def voltage(t: float) -> Array:
        vector, zero = terminal_voltage(supply, t, 1.0, 1)
        return np.asarray(to_phases(vector, zero)[0])

    phases = simulate_phases(motor, voltage, lambda w: k * w * abs(w), inertia=alone.inertia, t=dq.t, rtol=1e-12)
    peak = np.abs(dq.i_t).max()
    difference = np.abs(to_space_vector(phases.i_t) - dq.i_t) / peak
    star = np.abs(phases.v_0 - dq.v_t0).max() / supply.amplitude if motor.connection == "Y" else 0.0
    return PhaseComparison(
        dq=dq,
        phases=phases,
        difference=difference,
        current=float(difference.max()),
        torque=float(np.abs(phases.torque - dq.T_e).max() / np.abs(dq.T_e).max()),
        star_point=float(star),
    )


def for_connection(motor: Motor, line_voltage_rms: float, connection: Literal["Y", "delta"]) -> tuple[Motor, float]:
    """The same windings in Y or delta with the phase-voltage amplitude that suits them.

    Parameters
    ----------
    motor : Motor
        The motor.
    line_voltage_rms : float
        Line voltage for its own connection, V rms.
    connection : {"Y", "delta"}
        Connection wanted.

    Returns
    -------
    motor : Motor
        With that connection.
    amplitude : float
        Amplitude of the phase voltage (line to neutral) that puts the rated voltage on the windings, V.
    """
    amplitude = line_voltage_rms * math.sqrt(2 / 3)
    if connection != motor.connection:
        amplitude *= math.sqrt(3) if connection == "Y" else 1 / math.sqrt(3)
    return replace(motor, connection=connection), amplitude


@dataclass(frozen=True, kw_only=True, eq=False)
class HeadComparison:
    """Pressure of the full and of the simplified model in the same speed transients.

    Parameters
    ----------
    full, reciprocal, simple : Trajectory
        With leakage dynamics and K_Q; the same with the reciprocal pressure K_Q domega/dt; simplified.
    error, error_reciprocal : ndarray, shape (n,)
        |H_p,simple - H_p| / H_p against the two full models.
    """

    full: Trajectory
    reciprocal: Trajectory
    simple: Trajectory
    error: Array
    error_reciprocal: Array


def compare_simplified(machine: PumpSet, supply: Supply, duration: float) -> HeadComparison:
    """Run speed transients with the full and the simplified model (no leakage dynamics, K_Q = 0, K_c merged).

    Parameters
    ----------
    machine : PumpSet
        The set.
    supply : Supply
        Drive with frequency ramps; starts with a constant frequency.
    duration : float
        s.

    Returns
    -------
    HeadComparison

    References
    ----------
    Thesis 1.4 (algebraic conversion), 3.3.4 (simplified model).
    """
    first = 0.0 if supply.frequency is None else float(supply.frequency.values[0])
    frequency = first or supply.rated_frequency
    amplitude = supply.boost + (supply.amplitude - supply.boost) * frequency / supply.rated_frequency
    simple_set = replace(machine, pump=replace(simplified(machine.pump), K_Q=0.0))
    start = operating_point(machine, amplitude, frequency).state()
    simple_start = operating_point(simple_set, amplitude, frequency, leakage=False).state()
    full = simulate(machine, supply, duration=duration, initial=start)
    reciprocal = simulate(machine, supply, duration=duration, initial=start, reciprocal=True)
    simple = simulate(simple_set, supply, duration=duration, initial=simple_start, leakage=False)
    return HeadComparison(
        full=full,
        reciprocal=reciprocal,
        simple=simple,
        error=np.abs(simple.H_p - full.H_p) / full.H_p,
        error_reciprocal=np.abs(simple.H_p - reciprocal.H_p) / reciprocal.H_p,
    )


def speed_ramps(amplitude: float, boost: float, rated_frequency: float, slew: float) -> tuple[Supply, float]:
    """Drive that goes from 60 % to 100 % of its frequency and back.

    Parameters
    ----------
    amplitude, boost : float
        Phase-voltage amplitude at the rated frequency and at standstill, V.
    rated_frequency : float
        Hz.
    slew : float
        Hz/s.

    Returns
    -------
    supply : Supply
        The drive.
    duration : float
        s.
    """
    low, ramp = 0.6 * rated_frequency, 0.4 * rated_frequency / slew
    points = (
        (0.0, low),
        (1.0, low),
        (1.0 + ramp, rated_frequency),
        (2.0 + ramp, rated_frequency),
        (2.0 + 2 * ramp, low),
        (3.0 + 2 * ramp, low),
    )
    supply = Supply(
        amplitude=amplitude, boost=boost, rated_frequency=rated_frequency, frequency=Profile(points, "lines")
    )
    return supply, 3.0 + 2 * ramp


def momentum_speed_error(machine: PumpSet, impeller: Impeller, liquid: Liquid, supply: Supply) -> float:
    """Speed of a start-up against the angular momentum of rotor and liquid, the liquid's by quadrature.

    The impeller's geometry gives the pump's J_Mv and K_Q. The simulated speed is compared with the speed that
    the integral of the torques gives when the momentum of the liquid is integrated over the channel,
    2 pi h rho int r^2 c_x dr, without using J_Mv or K_Q.

    Parameters
    ----------
    machine : PumpSet
        The set; its pump's J_Mv and K_Q are replaced by the geometry's.
    impeller, liquid : Impeller, Liquid
        One stage.
    supply : Supply
        For the start-up.

    Returns
    -------
    float
        Largest difference of the speeds over the largest speed.

    References
    ----------
    Thesis (3.16), (3.20); 1.4 for the statement that the liquid adds inertia.
    """
    from scipy.integrate import cumulative_simpson

    stage = stage_coefficients(impeller, liquid)
    stages = machine.pump.stages
    geared = replace(machine, pump=replace(machine.pump, J_Mv=stage.J_Mv, K_Q=stage.K_Q))
    run = simulate(geared, supply, duration=0.6, step=1e-5)
    c = run.c
    impulse = cumulative_simpson(run.T_e - c.B * run.omega - run.T_p, x=run.t, initial=0.0)
    # momentum of the liquid is linear in omega and Q: two quadratures give it for all samples
    nodes, weights = np.polynomial.legendre.leggauss(400)
    half = 0.5 * (impeller.r_2 - impeller.r_1)
    r = impeller.r_1 + half * (1 + nodes)
    scale = stages * 2 * np.pi * impeller.h * liquid.rho * half * weights * r**2
    per_speed = float((scale * tangential_speed(impeller, r, np.array(1.0), np.array(0.0))).sum())
    per_flow = float((scale * tangential_speed(impeller, r, np.array(0.0), np.array(1.0))).sum())
    dry = geared.motor.J + geared.pump.J
    predicted = (impulse - per_flow * run.Q_i) / (dry + per_speed)
    return float(np.abs(predicted - run.omega).max() / np.abs(run.omega).max())


def theoretical_power_error(impeller: Impeller, liquid: Liquid, omega: float, Q: Array) -> float:
    """How far torque times speed is from rho g Q H_e when nothing is lost.

    Parameters
    ----------
    impeller, liquid : Impeller, Liquid
        One stage.
    omega : float
        rad/s.
    Q : ndarray
        Flows, m3/s.

    Returns
    -------
    float
        Largest difference over the largest power.

    References
    ----------
    Thesis (3.18), (3.22).
    """
    shaft = euler_torque(impeller, liquid, np.array(omega), Q) * omega
    hydraulic = liquid.rho * liquid.g * Q * theoretical_head(impeller, liquid, np.array(omega), Q)
    return float(np.abs(shaft - hydraulic).max() / np.abs(shaft).max())


def affinity_spread(pump: Pump, omegas: Array, flow_per_speed: Array) -> float:
    """How far head and torque curves at several speeds are from one curve in affinity coordinates.

    Parameters
    ----------
    pump : Pump
        The pump.
    omegas : ndarray, shape (k,)
        Speeds, rad/s.
    flow_per_speed : ndarray, shape (m,)
        Q/omega, m3.

    Returns
    -------
    float
        Largest relative spread of H/omega^2 and T/omega^2.

    References
    ----------
    Follows from (3.19) and (3.24), which are homogeneous in speed and flow.
    """
    w, s = omegas[:, None], flow_per_speed[None, :]
    head = impeller_pressure.py_func(w * s, w, pump.a_h0, pump.a_h1, pump.a_h2) / w**2
    twist = impeller_torque.py_func(w * s, w, pump.a_t0, pump.a_t1, pump.a_t2) / w**2
    return float(max(np.ptp(x, axis=0).max() / np.abs(x).max() for x in (head, twist)))


def stages_error(machine: PumpSet, supply: Supply) -> float:
    """Head and torque of n stages, added stage by stage along a start-up, against the model's n-stage coefficients.

    Parameters
    ----------
    machine : PumpSet
        The set; its pump has n stages.
    supply : Supply
        For the start-up.

    Returns
    -------
    float
        Largest difference of head and torque over their largest values.

    References
    ----------
    Thesis 3.3 (the same structure describes a multistage pump); 3.3.5 is not in the surviving text.
    """
    pump = machine.pump
    run = simulate(machine, supply, duration=0.5, every=10)
    head, twist = np.zeros_like(run.t), np.zeros_like(run.t)
    for _ in range(pump.stages):
        # the outlet of one stage is the inlet of the next; all carry the flow Q_p and leak q of their own
        head += impeller_pressure.py_func(run.Q_i, run.omega, pump.a_h0, pump.a_h1, pump.a_h2)
        twist += impeller_torque.py_func(run.Q_i, run.omega, pump.a_t0, pump.a_t1, pump.a_t2)
    pairs = ((head, run.H_i), (twist, run.T_p))
    return float(max(np.abs(a - b).max() / np.abs(b).max() for a, b in pairs))
