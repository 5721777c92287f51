"""Signs, balance and three routes to the same motor: dq kernel, phase coordinates, space vectors."""

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from pumplib.machines import PumpSet, load_application, load_motor, load_pump
from pumplib.motor.dq import current_derivatives, torque
from pumplib.motor.frames import stator_voltage, terminal_current
from pumplib.motor.phasor import power_gap, steady_currents, steady_torque
from pumplib.motor.supply import Supply, grid, harmonic, negative_sequence, terminal_voltage
from pumplib.plant import simulate
from pumplib.plant.verify import compare_phase_model, for_connection, motor_alone

MOTOR = load_motor("reference_1k5")
SET = PumpSet(motor=MOTOR, pump=load_pump("multistage_1k5"), application=load_application("multistage_1k5"))
W = 100 * math.pi
DIRTY = (negative_sequence(0.03, 0.4), harmonic(5, 0.02, 1.0), harmonic(7, 0.015, 2.0), harmonic(3, 0.05, 0.3))


def rates(i_s: complex, i_m: complex, omega_e: float, v: complex) -> tuple[complex, complex]:
    m = MOTOR
    d = current_derivatives(
        i_s.real, i_s.imag, i_m.real, i_m.imag, omega_e, v.real, v.imag,
        m.r_s, m.R_r_prime, m.L_m_prime, 1 / m.L_s_prime, 1 / m.L_m_prime,
    )  # fmt: skip
    return complex(d[0], d[1]), complex(d[2], d[3])


@pytest.mark.parametrize(("slip", "right", "wrong"), [(0.05, 8.03, 7.29), (-0.05, -10.86, 6.99)])
def test_torque_has_the_sign_of_the_slip_and_the_other_j_fails(slip: float, right: float, wrong: float) -> None:
    omega = W * (1 - slip)
    T_e, gap = power_gap(MOTOR, 325.0, W, omega, omega)
    assert T_e == pytest.approx(right, abs=0.005)
    assert abs(gap) < 1e-9
    T_wrong, gap_wrong = power_gap(MOTOR, 325.0, W, -omega, omega)  # the J printed after (3.6)
    assert T_wrong == pytest.approx(wrong, abs=0.005)
    assert abs(gap_wrong) > 1.0  # the balance notices


@pytest.mark.parametrize("slip", [-0.5, -0.05, 0.01, 0.05, 0.3, 1.0, 1.5])
def test_phasors_satisfy_the_differential_equations(slip: float) -> None:
    omega = W * (1 - slip)
    i_s, i_m = (complex(i) for i in steady_currents(MOTOR, np.array(325.0), np.array(W), np.array(omega)))
    di_s, di_m = rates(i_s, i_m, omega, 325.0)
    assert abs(di_s - 1j * W * i_s) < 1e-9 * abs(W * i_s)
    assert abs(di_m - 1j * W * i_m) < 1e-9 * abs(W * i_m)


@given(st.floats(-2.0, 2.0))
def test_mirrored_supply_and_speed_give_mirrored_torque(slip: float) -> None:
    """Sequence symmetry: a negative-sequence supply at negative speed gives the negative torque."""
    omega = W * (1 - slip)
    forward = steady_torque(MOTOR, np.array(325.0), np.array(W), np.array(omega))
    backward = steady_torque(MOTOR, np.array(325.0), np.array(-W), np.array(-omega))
    assert forward == pytest.approx(-backward, rel=1e-12)


currents = st.complex_numbers(max_magnitude=50.0, allow_nan=False, allow_infinity=False)


@given(currents, currents, st.floats(-400, 400), currents)
def test_power_balance_holds_at_every_state(i_s, i_m, omega, v) -> None:
    m = MOTOR
    di_s, di_m = rates(i_s, i_m, m.z_p * omega, 10 * v)
    stored = 1.5 * (m.L_s_prime * np.conj(i_s) * di_s + m.L_m_prime * np.conj(i_m) * di_m).real
    copper = 1.5 * (m.r_s * abs(i_s) ** 2 + m.R_r_prime * abs(i_m - i_s) ** 2)
    T_e = torque.py_func(i_s.real, i_s.imag, i_m.real, i_m.imag, 1.5 * m.z_p * m.L_m_prime)
    supplied = 1.5 * (10 * v * np.conj(i_s)).real
    scale = abs(supplied) + copper + abs(T_e * omega) + 1e-6
    assert abs(supplied - copper - stored - T_e * omega) < 1e-9 * scale


def test_no_load_run_settles_at_synchronous_speed() -> None:
    run = simulate(motor_alone(SET), grid(400.0), duration=1.0, flow=False, leakage=False)
    assert run.omega[-1] == pytest.approx(W / MOTOR.z_p, rel=1e-4)


@pytest.mark.parametrize("connection", ["Y", "delta"])
def test_dq_equals_phase_coordinates(connection: str) -> None:
    motor, amplitude = for_connection(MOTOR, 400.0, connection)
    machine = dataclasses.replace(SET, motor=motor)
    result = compare_phase_model(machine, Supply(amplitude=amplitude, components=DIRTY), duration=0.04)
    assert result.current < 1e-8
    assert result.torque < 1e-8
    assert result.star_point < 1e-9
    assert np.abs(result.dq.i_t).max() > 20.0  # a start, not a trivial run


@pytest.mark.parametrize("connection", ["Y", "delta"])
def test_dq_equals_space_vectors(connection: str) -> None:
    """A third route: complex flux linkages, written from (3.5) and (3.6), in another integrator."""
    motor, amplitude = for_connection(MOTOR, 400.0, connection)
    supply = Supply(amplitude=amplitude, components=DIRTY)
    machine = motor_alone(dataclasses.replace(SET, motor=motor), 5.0 / 300**2)
    run = simulate(machine, supply, duration=0.04, step=5e-6, every=20, flow=False, leakage=False)
    L = np.array([[motor.L_s, motor.L_m], [motor.L_m, motor.L_r]])
    inverse, k = np.linalg.inv(L), 5.0 / 300**2

    def rhs(t: float, x: np.ndarray) -> np.ndarray:
        psi_s, psi_r, omega = x
        i_s, i_r = inverse @ np.array([psi_s, psi_r])
        v_s = stator_voltage(terminal_voltage(supply, t, 1.0, 1)[0], motor.connection)[0]
        T_e = 1.5 * motor.z_p * (np.conj(psi_s) * i_s).imag
        omega = omega.real
        domega = (T_e - k * omega * abs(omega)) / machine.inertia
        return np.array([v_s - motor.r_s * i_s, -motor.r_r * i_r + 1j * motor.z_p * omega * psi_r, domega])

    found = solve_ivp(rhs, (0, 0.04), np.zeros(3, complex), "DOP853", t_eval=run.t, rtol=1e-12, atol=1e-12)
    i_s = (inverse @ found.y[:2])[0]
    assert np.abs(terminal_current(i_s, connection) - run.i_t).max() < 1e-8 * np.abs(run.i_t).max()
    assert np.abs(found.y[2].real - run.omega).max() < 1e-8 * np.abs(run.omega).max()


@settings(deadline=None, max_examples=10)
@given(st.floats(50, 250))
def test_star_and_delta_of_the_same_windings_are_the_same_machine(line_voltage: float) -> None:
    runs = []
    for connection in ("Y", "delta"):
        motor, amplitude = for_connection(MOTOR, line_voltage, connection)
        machine = dataclasses.replace(SET, motor=motor)
        turn = 0.0 if connection == "Y" else -math.pi / 6  # delta turns the winding voltage by 30 degrees
        runs.append(simulate(machine, Supply(amplitude=amplitude, phase=turn), duration=0.05))
    assert np.abs(runs[0].x - runs[1].x).max() < 1e-9
