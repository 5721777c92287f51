"""Steady state from phasors: against the circuit, against the dq model, and the consistency relation."""

import math
from dataclasses import replace

import numpy as np
import pytest

from pumplib.errors import DataError, ParameterError
from pumplib.machines import load_losses, load_motor
from pumplib.motor.circuit import at_slip
from pumplib.motor.phasor import steady_currents, steady_torque
from pumplib.steady.phasors import electrical_parameters, resistance_condition, steady_state
from tests.steady.cases import MOTOR

W_E = 2 * math.pi * 50
SLIP = np.array([0.005, 0.02, 0.05, 0.08])


def phasors(motor, omega):  # type: ignore[no-untyped-def]
    winding = 325.0 * (1 if motor.connection == "Y" else math.sqrt(3))
    i, _ = steady_currents(motor, np.full(len(omega), winding + 0j), np.full(len(omega), W_E), omega)
    line = np.abs(i) * (1 if motor.connection == "Y" else math.sqrt(3))
    return {"V_rms": 325 / math.sqrt(2), "I_rms": line / math.sqrt(2), "omega_e": W_E, "phi": -np.angle(i)}


@pytest.mark.parametrize("connection", ["Y", "delta"])
@pytest.mark.parametrize("z_p", [1, 2, 3])
def test_torque_and_speed_of_the_dq_model_come_back(connection: str, z_p: int) -> None:
    motor = replace(MOTOR, connection=connection, z_p=z_p, rated_speed=None)
    omega = (1 - SLIP) * W_E / z_p
    found = steady_state(electrical_parameters(motor), **phasors(motor, omega))
    winding = 325.0 * (1 if connection == "Y" else math.sqrt(3))
    np.testing.assert_allclose(found.omega, omega, rtol=1e-12)
    torque = steady_torque(motor, np.full(4, winding), np.full(4, W_E), omega)
    np.testing.assert_allclose(found.torque_em, torque, rtol=1e-11)
    np.testing.assert_allclose(found.L_m_prime, motor.L_m_prime, rtol=1e-9)
    np.testing.assert_allclose(found.deviation, 0, atol=1e-11)


def test_losses_agree_with_the_circuit_of_the_measured_motor() -> None:
    motor, losses = load_motor("im_18k5"), load_losses("im_18k5")
    point = at_slip(motor, losses, 400.0, 50.0, SLIP, core_at="stator")
    found = steady_state(
        electrical_parameters(motor, losses), 400 / math.sqrt(3), point.current_line_rms, W_E,
        np.arccos(point.power_factor),
    )  # fmt: skip
    np.testing.assert_allclose(found.omega, point.omega, rtol=1e-10)
    np.testing.assert_allclose(found.torque_shaft, point.torque_shaft, rtol=1e-10)
    np.testing.assert_allclose(found.power_shaft, point.power_shaft, rtol=1e-10)


def test_torque_needs_no_inductance_and_slip_no_main_inductance() -> None:
    e = electrical_parameters(MOTOR)
    inputs = phasors(MOTOR, (1 - SLIP) * W_E)
    base = steady_state(e, **inputs)
    np.testing.assert_array_equal(
        steady_state(replace(e, L_s_prime=2 * e.L_s_prime), **inputs).torque_em, base.torque_em
    )
    other = steady_state(replace(e, L_m_prime=2 * e.L_m_prime), **inputs)
    np.testing.assert_array_equal(other.omega_slip, base.omega_slip)
    assert np.all(np.abs(other.deviation) > 0.3)


def test_resistance_from_the_consistency_relation_is_ill_conditioned() -> None:
    inputs = phasors(MOTOR, np.array([0.95 * W_E]))
    condition = resistance_condition(
        electrical_parameters(MOTOR), 325 / math.sqrt(2), float(inputs["I_rms"][0]), W_E, float(inputs["phi"][0])
    )
    assert condition.estimate == pytest.approx(MOTOR.r_s, rel=1e-8)
    # one per cent of L_m' costs several per cent of r_s, while all of r_s hardly moves the relation
    assert abs(condition.per_L_m) > 3
    assert abs(condition.relation_per_r_s) < 0.2
    assert abs(condition.relation_per_r_s * condition.per_L_m) == pytest.approx(1, rel=0.15)


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [("phi", 41.0, "degrees"), ("V_rms", math.nan, "V_rms"), ("omega_e", -1.0, "rad/s"), ("I_rms", 0.0, "current")],
)
def test_wrong_inputs_are_refused(name: str, value: float, words: str) -> None:
    good = {"V_rms": 230.0, "I_rms": 2.0, "omega_e": W_E, "phi": 0.7}
    with pytest.raises(DataError, match=words):
        steady_state(electrical_parameters(MOTOR), **(good | {name: value}))


def test_no_resistance_is_an_explained_error() -> None:
    e = electrical_parameters(MOTOR)
    with pytest.raises(ParameterError, match="no resistance"):
        resistance_condition(replace(e, L_m_prime=0.2), 230.0, 1.7, W_E, 1.45)
