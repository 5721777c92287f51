import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pumplib.errors import ParameterError
from pumplib.machines import Impeller, Motor, PumpSet, from_inverse_gamma, load_application, load_motor, load_pump
from pumplib.machines.quantity import Quantity, quantities, table
from pumplib.motor.phasor import steady_currents

MOTOR = load_motor("reference_1k5")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"r_s": -3.0}, r"Motor\.r_s = -3 ohm: must be > 0 ohm.*stator resistance"),
        ({"r_s": 0.0}, r"Motor\.r_s = 0 ohm: must be > 0"),
        ({"r_r": math.nan}, r"Motor\.r_r = nan ohm: must be finite"),
        ({"L_m": math.inf}, r"Motor\.L_m = inf H: must be finite"),
        ({"L_ls": "12 mH"}, r"Motor\.L_ls = '12 mH': must be a number in H"),
        ({"J": True}, r"Motor\.J = True: must be a number in kg m2"),
        ({"z_p": 1.5}, r"Motor\.z_p = 1\.5: must be a whole number"),
        ({"z_p": 0}, r"Motor\.z_p = 0: must be >= 1"),
        ({"connection": "star"}, r"Motor\.connection = 'star': must be one of Y, delta"),
        ({"L_ls": 9.9}, r"leakage of an induction motor is a few per cent"),
        ({"rated_speed": 2900.0}, r"Motor\.rated_speed = 2900 rad/s: must be .*rpm"),
        ({"rated_speed": 30.4}, r"gives a slip of 0\.903.*rpm against rad/s"),
        ({"rated_speed": 320.0}, r"gives a slip of -0\.01"),
        ({"r_s": np.array([4.1])}, r"must be a number in ohm"),
    ],
)
def test_impossible_motor_is_refused(change: dict, message: str) -> None:
    with pytest.raises(ParameterError, match=message):
        dataclasses.replace(MOTOR, **change)


def test_parameters_cannot_be_changed() -> None:
    with pytest.raises(dataclasses.FrozenInstanceError):
        MOTOR.r_s = 1.0  # type: ignore[misc]


def test_parameters_are_keyword_only() -> None:
    with pytest.raises(TypeError):
        Motor(4.1, 2.5)  # type: ignore[call-arg, misc]


def test_numpy_scalars_are_numbers() -> None:
    assert dataclasses.replace(MOTOR, r_s=np.float64(5.0)).r_s == 5.0


def test_derived_parameters_are_those_after_3_7() -> None:
    L_s, L_r = MOTOR.L_m + MOTOR.L_ls, MOTOR.L_m + MOTOR.L_lr
    assert MOTOR.L_s_prime == pytest.approx(L_s - MOTOR.L_m**2 / L_r, rel=1e-13)
    assert MOTOR.L_m_prime == pytest.approx(MOTOR.L_m**2 / L_r, rel=1e-15)
    assert MOTOR.R_r_prime == pytest.approx((MOTOR.L_m / L_r) ** 2 * MOTOR.r_r, rel=1e-15)


@given(st.floats(0.1, 10), st.floats(0.1, 10), st.floats(1e-3, 0.05), st.floats(0.1, 1.0), st.floats(0.2, 5.0))
def test_inverse_gamma_keeps_the_primed_quantities(R_s, R_R, L_sigma, L_M, ratio) -> None:
    t = from_inverse_gamma(R_s=R_s, R_R=R_R, L_sigma=L_sigma, L_M=L_M, leakage_ratio=ratio)
    motor = Motor(**t, z_p=2, connection="Y", J=0.01, B=0.0)
    assert motor.R_r_prime == pytest.approx(R_R, rel=1e-12)
    assert motor.L_s_prime == pytest.approx(L_sigma, rel=1e-11)
    assert motor.L_m_prime == pytest.approx(L_M, rel=1e-12)
    assert motor.L_ls / motor.L_lr == pytest.approx(ratio, rel=1e-11)


def test_leakage_split_does_not_change_the_terminals() -> None:
    data = {"R_s": 3.7, "R_R": 2.1, "L_sigma": 0.021, "L_M": 0.224}
    rest = {"z_p": 2, "connection": "Y", "J": 0.015, "B": 0.0}
    a, b = (Motor(**from_inverse_gamma(**data, leakage_ratio=c), **rest) for c in (0.5, 2.0))
    omega_s = np.array(100 * np.pi)
    current = [steady_currents(m, np.array(326.6), omega_s, np.array(150.0))[0] for m in (a, b)]
    assert abs(current[0] - current[1]) < 1e-11
    assert abs(a.L_m - b.L_m) > 1e-3  # the circuits do differ


def test_leakage_ratio_must_be_positive() -> None:
    with pytest.raises(ParameterError, match=r"leakage_ratio = 0.*> 0"):
        from_inverse_gamma(R_s=1, R_R=1, L_sigma=0.01, L_M=0.1, leakage_ratio=0)


def test_impeller_geometry_is_checked() -> None:
    good = {"r_1": 0.015, "r_2": 0.045, "h": 0.004, "beta": (0.4, 0.35), "sigma_s": 0.75}
    losses = {"K_s": 4e5, "K_f": 3e5, "K_d": 5e-6, "K_n": 1e-6}
    with pytest.raises(ParameterError, match=r"r_2 = 0\.01 m: must be larger than r_1"):
        Impeller(**{**good, "r_2": 0.01}, **losses)
    with pytest.raises(ParameterError, match=r"at least the inlet and the outlet angle"):
        Impeller(**{**good, "beta": (0.4,)}, **losses)
    with pytest.raises(ParameterError, match=r"Impeller\.beta = 22 rad.*degrees"):
        Impeller(**{**good, "beta": (22.0, 26.0)}, **losses)
    with pytest.raises(ParameterError, match=r"Impeller\.r_2 = 45 m.*mm"):
        Impeller(**{**good, "r_2": 45.0}, **losses)


def test_set_without_inertia_is_refused() -> None:
    pump = dataclasses.replace(load_pump("multistage_1k5"), J=0.0, J_Mv=0.0)
    with pytest.raises(ParameterError, match="at least one inertia must be positive"):
        PumpSet(
            motor=dataclasses.replace(MOTOR, J=0.0),
            pump=pump,
            application=load_application("multistage_1k5"),
        )


def test_every_field_has_a_unit_and_a_meaning() -> None:
    for name, rule in quantities(Motor).items():
        assert rule.meaning, name
        if isinstance(rule, Quantity):
            assert rule.unit
    assert {row[0] for row in table(MOTOR)} == {f.name for f in dataclasses.fields(Motor)}
