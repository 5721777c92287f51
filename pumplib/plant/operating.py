"""Thesis 3.3.4, 3.5: steady operating points and the check of assumption 3.3.1."""

import math
from dataclasses import dataclass

import numpy as np

from pumplib.errors import ParameterError
from pumplib.hydraulics.pressure import impeller_pressure, impeller_torque
from pumplib.machines.parameters import PumpSet
from pumplib.motor.phasor import steady_currents, steady_torque

_pressure, _torque = impeller_pressure.py_func, impeller_torque.py_func


@dataclass(frozen=True, kw_only=True, slots=True)
class OperatingPoint:
    """Steady state of a motor-pump set.

    Parameters
    ----------
    omega : float
        Shaft speed, rad/s.
    Q_p, q : float
        Pump and leakage flow, m3/s.
    H_p : float
        Pressure between the flanges, Pa.
    torque : float
        Shaft torque with bearing friction, N m.
    i_s, i_m : complex
        Stator and magnetising current phasors (amplitude), A; voltage is real.
    """

    omega: float
    Q_p: float
    q: float
    H_p: float
    torque: float
    i_s: complex
    i_m: complex

    def state(self) -> np.ndarray:
        """State vector of the simulation at an instant when the stator voltage vector is real.

        Returns
        -------
        ndarray, shape (7,)
            In the order and units of `pumplib.plant.STATES`.
        """
        return np.array([
            self.i_s.real, self.i_s.imag, self.i_m.real, self.i_m.imag, self.omega, self.q, self.Q_p,
        ])  # fmt: skip


def flows(machine: PumpSet, omega: float, valve: float, leakage: bool = True) -> tuple[float, float]:
    """Steady pump and leakage flow at a speed.

    Parameters
    ----------
    machine : PumpSet
        The set.
    omega : float
        Shaft speed, rad/s, > 0.
    valve : float
        K_v, Pa s2/m6.
    leakage : bool
        False takes q = 0.

    Returns
    -------
    Q_p, q : float
        m3/s.

    Raises
    ------
    ParameterError
        If the pump cannot overcome the static pressure at this speed.
    """
    from scipy.optimize import brentq

    pump, application = machine.pump, machine.application
    n = pump.stages
    K = valve + application.K_pipe + pump.K_c
    if K <= 0:
        raise ParameterError(
            "valve + K_pipe + K_c = 0 Pa s2/m6: without any loss outside the impeller there is no single "
            "operating point; give the valve or the pipe a loss."
        )

    def leak(impellers: float) -> float:
        return math.sqrt(max(pump.a * impellers / n, 0.0) / pump.K_l) if leakage else 0.0

    def excess(Q: float) -> float:
        needed = application.p_static + K * Q * abs(Q)
        return n * _pressure(Q + leak(needed), omega, pump.a_h0, pump.a_h1, pump.a_h2) - needed

    if excess(0.0) <= 0:
        raise ParameterError(
            f"p_static = {application.p_static:g} Pa is above the shut-off pressure at omega = {omega:g} rad/s: "
            "the pump does not deliver; lower p_static or raise the speed."
        )
    # beyond this flow the impeller pressure is negative
    high = (abs(pump.a_h1) * omega + math.sqrt(pump.a_h1**2 + 4 * pump.a_h2 * pump.a_h0) * omega) / pump.a_h2
    Q = float(brentq(excess, 0.0, high, xtol=1e-18, rtol=1e-14))
    return Q, leak(application.p_static + K * Q * Q)


def operating_point(
    machine: PumpSet, amplitude: float, frequency: float, valve: float | None = None, leakage: bool = True
) -> OperatingPoint:
    """Steady state at a balanced supply.

    Parameters
    ----------
    machine : PumpSet
        The set.
    amplitude : float
        Amplitude of the phase voltage at the terminals, V.
    frequency : float
        Hz.
    valve : float, optional
        K_v, Pa s2/m6; the application's if left out.
    leakage : bool
        False takes q = 0.

    Returns
    -------
    OperatingPoint

    Raises
    ------
    ParameterError
        If the motor cannot carry the pump at this supply, or the pump does not deliver.
    """
    from scipy.optimize import brentq

    motor, pump = machine.motor, machine.pump
    K_v = machine.application.K_v if valve is None else valve
    omega_s = 2 * math.pi * frequency
    # in the stator frame of a delta winding, voltage and current turn by the same angle
    v_s = amplitude * (1.0 if motor.connection == "Y" else math.sqrt(3))
    n = pump.stages

    def shaft_torque(omega: float) -> float:
        Q, q = flows(machine, omega, K_v, leakage)
        return machine.friction * omega + n * _torque(Q + q, omega, pump.a_t0, pump.a_t1, pump.a_t2)

    def excess(omega: float) -> float:
        return float(steady_torque(motor, np.array(v_s), np.array(omega_s), np.array(omega))) - shaft_torque(omega)

    synchronous = omega_s / motor.z_p
    # the stable branch ends at the pull-out slip; its estimate by the leakage circuit only brackets
    pull_out = motor.R_r_prime / math.hypot(motor.r_s, omega_s * motor.L_s_prime)
    low = synchronous * max(1 - 1.5 * pull_out, 0.2)
    if excess(low) <= 0:
        raise ParameterError(
            f"amplitude = {amplitude:g} V at {frequency:g} Hz: the motor cannot carry the pump (torque needed "
            f"{shaft_torque(low):.3g} N m at {low:.4g} rad/s); raise the voltage or close the valve."
        )
    omega = float(brentq(excess, low, synchronous, xtol=1e-13, rtol=1e-14))
    Q, q = flows(machine, omega, K_v, leakage)
    i_s, i_m = steady_currents(motor, np.array(v_s), np.array(omega_s), np.array(omega))
    H_p = machine.application.p_static + (K_v + machine.application.K_pipe) * Q * Q
    return OperatingPoint(
        omega=omega, Q_p=Q, q=q, H_p=H_p, torque=shaft_torque(omega), i_s=complex(i_s), i_m=complex(i_m)
    )


@dataclass(frozen=True, kw_only=True, slots=True)
class LeakageCheck:
    """Whether assumption 3.3.1 holds, with the numbers.

    Parameters
    ----------
    leakage_rate : float
        Rate of the leakage dynamics, 1/s.
    main_rate : float
        Fastest rate of speed and flow, 1/s.
    ratio : float
        leakage_rate / main_rate; the assumption asks for at least `decade`.
    share : float
        |q| / |Q_p|; the assumption asks for a small one.
    decade, small : float
        The limits applied.
    holds : bool
        Both parts hold.
    """

    leakage_rate: float
    main_rate: float
    ratio: float
    share: float
    decade: float
    small: float
    holds: bool


def check_leakage(
    machine: PumpSet, amplitude: float, frequency: float, *, decade: float = 10.0, small: float = 0.05
) -> LeakageCheck:
    """Check assumption 3.3.1: leakage dynamics a decade faster than the rest, leakage small against the flow.

    Speed and flow are linearised at the operating point, the motor by its quasi-static torque slope. The text
    breaks off before it says what the leakage is compared with; |q| against |Q_p| is our reading, and 5 %
    our limit for "small".

    Parameters
    ----------
    machine : PumpSet
        The set.
    amplitude : float
        Amplitude of the phase voltage, V.
    frequency : float
        Hz.
    decade : float
        Least ratio of the rates.
    small : float
        Largest share of the leakage.

    Returns
    -------
    LeakageCheck

    Raises
    ------
    ParameterError
        If there is no operating point.

    References
    ----------
    Thesis assumption 3.3.1.
    """
    point = operating_point(machine, amplitude, frequency)
    motor, pump, application = machine.motor, machine.pump, machine.application
    n, omega, Q_i = pump.stages, point.omega, point.Q_p + point.q
    dH_dQ = n * (pump.a_h1 * omega - 2 * pump.a_h2 * Q_i)
    dH_domega = n * (pump.a_h1 * Q_i + 2 * pump.a_h0 * omega)
    dT_dQ = n * (pump.a_t1 * omega - 2 * pump.a_t2 * Q_i)
    dT_domega = n * (pump.a_t1 * Q_i + 2 * pump.a_t0 * omega) + machine.friction
    v_s = amplitude * (1.0 if motor.connection == "Y" else math.sqrt(3))
    step = 1e-4 * omega
    up, down = (
        float(steady_torque(motor, np.array(v_s), np.array(2 * math.pi * frequency), np.array(w)))
        for w in (omega + step, omega - step)
    )
    stiffness = (up - down) / (2 * step)  # dT_e/domega, negative on the stable branch
    K = application.K_v + application.K_pipe + pump.K_c
    flow_slope = (dH_dQ - 2 * K * point.Q_p) / application.K_p
    flow_speed = dH_domega / application.K_p
    K_Q = n * pump.K_Q
    main = np.array([
        [(stiffness - dT_domega + K_Q * flow_speed) / machine.inertia, (K_Q * flow_slope - dT_dQ) / machine.inertia],
        [flow_speed, flow_slope],
    ])  # fmt: skip
    main_rate = float(np.abs(np.linalg.eigvals(main)).max())
    leakage_rate = (2 * pump.K_l * point.q - pump.a * dH_dQ / n) / pump.K_J
    ratio, share = leakage_rate / main_rate, point.q / point.Q_p
    return LeakageCheck(
        leakage_rate=leakage_rate,
        main_rate=main_rate,
        ratio=ratio,
        share=share,
        decade=decade,
        small=small,
        holds=ratio >= decade and share <= small,
    )
