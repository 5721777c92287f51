import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from pumplib.errors import ParameterError
from pumplib.machines import load_motor
from pumplib.motor.abc import mutual_inductance
from pumplib.motor.frames import (
    B_V_DELTA,
    C_I_DELTA,
    J_MATRIX,
    K_DELTA,
    dq0_matrix,
    stator_voltage,
    terminal_current,
    to_phases,
    to_space_vector,
    zero_sequence,
)

MOTOR = load_motor("reference_1k5")
phases = arrays(float, (5, 3), elements=st.floats(-1e3, 1e3))


@given(phases)
def test_phases_come_back(abc) -> None:
    assert np.allclose(to_phases(to_space_vector(abc), zero_sequence(abc)), abc, atol=1e-12, rtol=0)


@given(phases)
def test_space_vector_is_the_dq_part_of_the_matrix(abc) -> None:
    dq0 = abc @ dq0_matrix(0.0).T
    assert np.allclose(dq0[:, 0] + 1j * dq0[:, 1], to_space_vector(abc), atol=1e-12, rtol=0)
    assert np.allclose(dq0[:, 2], zero_sequence(abc), atol=1e-12, rtol=0)


def test_positive_sequence_turns_from_d_to_q() -> None:
    t = np.linspace(0, 0.02, 50)
    abc = np.cos(100 * np.pi * t[:, None] - np.array([0, 2, 4]) * np.pi / 3)
    assert np.allclose(to_space_vector(abc), np.exp(1j * 100 * np.pi * t), atol=1e-14)


def test_j_is_multiplication_by_j() -> None:
    x = np.array([0.3, -0.7])
    turned = J_MATRIX @ x
    assert turned[0] + 1j * turned[1] == pytest.approx(1j * (x[0] + 1j * x[1]))


@pytest.mark.parametrize("theta", [0.0, 0.4, 2.0, -1.3])
def test_only_the_positive_rotor_angle_removes_theta(theta: float) -> None:
    """The printed T(-z_p theta_r) of (3.4) leaves an inductance that depends on the angle."""
    inductance = mutual_inductance(MOTOR, theta)
    right = dq0_matrix(0.0) @ inductance @ np.linalg.inv(dq0_matrix(theta))
    assert np.allclose(right[:2, :2], MOTOR.L_m * np.eye(2), atol=1e-15)
    assert np.allclose(right[2], 0, atol=1e-15)
    printed = dq0_matrix(0.0) @ inductance @ np.linalg.inv(dq0_matrix(-theta))
    if theta:
        assert np.abs(printed[:2, :2] - MOTOR.L_m * np.eye(2)).max() > 0.1 * MOTOR.L_m


def test_delta_factors_are_the_blocks_of_the_matrices() -> None:
    T, inverse = dq0_matrix(0.0), np.linalg.inv(dq0_matrix(0.0))
    for matrix, factor in ((T @ K_DELTA @ inverse, B_V_DELTA), (T @ K_DELTA.T @ inverse, C_I_DELTA)):
        block = factor.real * np.eye(2) + factor.imag * J_MATRIX
        assert np.allclose(matrix[:2, :2], block, atol=1e-14)
        assert np.allclose(matrix[2], 0, atol=1e-14)
        assert np.allclose(matrix[:, 2], 0, atol=1e-14)


@given(phases, phases)
def test_power_is_the_same_at_terminals_and_windings(voltage, current) -> None:
    """Delta: v_t . i_t = v_s . i_s for any terminal voltage and winding current."""
    v_t, i_s = to_space_vector(voltage), to_space_vector(current)
    at_terminals = 1.5 * (v_t * terminal_current(i_s, "delta").conj()).real
    in_windings = 1.5 * (stator_voltage(v_t, "delta") * i_s.conj()).real
    assert np.allclose(at_terminals, in_windings, rtol=1e-12, atol=1e-6)


def test_delta_windings_see_the_line_voltage() -> None:
    assert abs(stator_voltage(np.array(1.0 + 0j), "delta")) == pytest.approx(math.sqrt(3))
    assert stator_voltage(np.array(1.0 + 0j), "Y") == 1.0


def test_wrong_shapes_and_names() -> None:
    with pytest.raises(ParameterError, match=r"shape \(3, 2\): the last axis must be the three phases"):
        to_space_vector(np.zeros((3, 2)))
    with pytest.raises(ParameterError, match=r"shape \(\)"):
        zero_sequence(np.array(1.0))
    with pytest.raises(ParameterError, match="connection = 'D'"):
        stator_voltage(np.array(1.0), "D")
