import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad

from pumplib.errors import ParameterError
from pumplib.hydraulics.impeller import (
    blade_angle,
    euler_torque,
    real_head,
    simplified,
    stage_coefficients,
    tangential_speed,
    theoretical_head,
)
from pumplib.hydraulics.pressure import (
    casing_pressure,
    flow_derivative,
    impeller_pressure,
    impeller_torque,
    leakage_derivative,
)
from pumplib.machines import Impeller, load_pump, read_sheet, shipped

SHEET = read_sheet(shipped()["pumps/stage_geometry"])
IMPELLER, LIQUID = SHEET.parts["impeller"], SHEET.parts["liquid"]
STAGE = stage_coefficients(IMPELLER, LIQUID)
speeds, flows = st.floats(20, 400), st.floats(0, 5e-3)


@given(speeds, flows)
def test_no_losses_means_all_shaft_power_becomes_hydraulic_power(omega: float, Q: float) -> None:
    shaft = euler_torque(IMPELLER, LIQUID, omega, Q) * omega
    hydraulic = LIQUID.rho * LIQUID.g * Q * theoretical_head(IMPELLER, LIQUID, omega, Q)
    assert shaft == pytest.approx(hydraulic, rel=1e-12, abs=1e-12)


@given(speeds, flows)
def test_coefficients_reproduce_the_geometry(omega: float, Q: float) -> None:
    """(3.24) and (3.19) against the loss model and the moment of momentum they are derived from."""
    s = STAGE
    pressure = impeller_pressure(Q, omega, s.a_h0, s.a_h1, s.a_h2)
    head = real_head(IMPELLER, LIQUID, omega, Q)
    assert pressure == pytest.approx(LIQUID.rho * LIQUID.g * head, rel=1e-12, abs=1e-6)
    torque = impeller_torque(Q, omega, s.a_t0, s.a_t1, s.a_t2)
    exact = euler_torque(IMPELLER, LIQUID, omega, Q) + IMPELLER.K_n * omega**2
    assert torque == pytest.approx(exact, rel=1e-12, abs=1e-12)


def test_transient_coefficients_by_another_quadrature() -> None:
    """J_Mv and K_Q of (3.20) are the moment of momentum of the liquid per speed and per flow."""
    density = 2 * math.pi * IMPELLER.h * LIQUID.rho
    knots = np.linspace(IMPELLER.r_1, IMPELLER.r_2, len(IMPELLER.beta))[1:-1]

    def momentum(omega: float, Q: float) -> float:
        return quad(
            lambda r: density * r**2 * float(tangential_speed(IMPELLER, r, omega, Q)),
            IMPELLER.r_1, IMPELLER.r_2, points=knots, epsabs=1e-16, epsrel=1e-13,
        )[0]  # fmt: skip

    assert pytest.approx(momentum(1.0, 0.0), rel=1e-12) == STAGE.J_Mv
    assert pytest.approx(momentum(0.0, 1.0), rel=1e-11) == -STAGE.K_Q


def test_backward_blades_lose_momentum_when_the_flow_grows() -> None:
    assert STAGE.K_Q > 0
    assert tangential_speed(IMPELLER, IMPELLER.r_2, 300.0, 1e-3) < IMPELLER.r_2 * 300.0


def test_blade_angle_hits_its_knots() -> None:
    r = np.linspace(IMPELLER.r_1, IMPELLER.r_2, len(IMPELLER.beta))
    assert blade_angle(IMPELLER, r).tolist() == pytest.approx(list(IMPELLER.beta))


def test_radial_blades_need_no_flow_term() -> None:
    radial = dataclasses.replace(IMPELLER, beta=(math.pi / 2, math.pi / 2))
    stage = stage_coefficients(radial, LIQUID)
    assert abs(stage.a_t2) < 1e-9
    assert abs(stage.K_Q) < 1e-12


def test_losses_beyond_reason_are_refused() -> None:
    with pytest.raises(ParameterError, match=r"a_h0 = -.*both must be > 0"):
        stage_coefficients(dataclasses.replace(IMPELLER, K_d=1e-3), LIQUID)
    free = dataclasses.replace(IMPELLER, K_s=0.0, K_f=0.0)
    with pytest.raises(ParameterError, match="a_h2 = 0"):
        stage_coefficients(free, LIQUID)


@given(st.floats(1e-5, 1e-2), st.floats(10, 400))
def test_dissipation_keeps_its_sign_in_reverse(Q: float, omega: float) -> None:
    pump = load_pump("multistage_1k5")
    assert casing_pressure(0.0, Q, pump.K_c) == -casing_pressure(0.0, -Q, pump.K_c)
    assert leakage_derivative(Q, 0.0, 1.0, pump.K_l, 1.0) == -leakage_derivative(-Q, 0.0, 1.0, pump.K_l, 1.0)
    assert flow_derivative(Q, 0.0, 0.0, 1e11, 1.0) < 0 < flow_derivative(-Q, 0.0, 0.0, 1e11, 1.0)
    assert impeller_torque(0.0, -omega, pump.a_t0, 0.0, 0.0) < 0


def test_leakage_settles_at_the_square_root_law() -> None:
    q = math.sqrt(0.8 * 5e4 / 2e14)
    assert leakage_derivative(q, 5e4, 0.8, 2e14, 1e-6) == pytest.approx(0.0, abs=1e-9)


def test_simplified_pump_has_the_same_flange_pressure_without_leakage() -> None:
    pump = load_pump("multistage_1k5")
    simple, n, Q, omega = simplified(pump), pump.stages, 1.6e-3, 306.0
    full = casing_pressure(n * impeller_pressure(Q, omega, pump.a_h0, pump.a_h1, pump.a_h2), Q, pump.K_c)
    merged = n * impeller_pressure(Q, omega, simple.a_h0, simple.a_h1, simple.a_h2)
    assert merged == pytest.approx(full, rel=1e-14)
    assert simple.K_c == 0.0


def test_impeller_is_of_the_class() -> None:
    assert isinstance(IMPELLER, Impeller)
    assert 8 < real_head(IMPELLER, LIQUID, 304.0, 1.6e-3) < 14
