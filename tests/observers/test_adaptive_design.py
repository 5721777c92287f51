"""Gains of the adaptive observers: certificate, structure of the motor, refusals; the study's tables."""

import dataclasses
import math

import numpy as np
import pytest
from scipy.linalg import expm

from pumplib.errors import ParameterError, SimulationError
from pumplib.machines import load_motor
from pumplib.motor.short_identify import g_of_gamma
from pumplib.observers.adaptive import (
    BilinearSystem,
    DirectObserver,
    FilteredRegressorObserver,
    simulate_system,
)
from pumplib.observers.adaptive_compare import compare_observers, gain_value
from pumplib.observers.adaptive_design import (
    delta_matrices,
    direct_gain,
    motor_boundary,
    motor_structure,
    polytopic_gain,
    structure_of,
)
from pumplib.observers.adaptive_examples import (
    HeatExchanger,
    heat_exchanger,
    motor_short_state,
    motor_speed,
    motor_speed_and_short,
)
from pumplib.observers.adaptive_study import lyapunov_run, motor_record
from pumplib.observers.certificate import InfeasibleError

MOTOR = load_motor("reference_1k5")
EXCHANGER = heat_exchanger(HeatExchanger())


@pytest.mark.parametrize("schedule", ["constant", "affine"])
def test_certificate_of_the_motor_gain(schedule):
    """On 201 speeds, and again by hand: exact discrete steps in Cholesky coordinates."""
    system, h = motor_speed_and_short(MOTOR), 1e-4
    gain = polytopic_gain(system, [150, -1, -1], [340, 1, 1], h=h, decay_rate=60.0, schedule=schedule)
    assert gain.margin >= 0
    assert gain.certificate.points == 201
    assert gain.K.shape == (4, 2, 1)
    root = np.linalg.cholesky(gain.certificate.P).conj().T
    for omega in np.linspace(150, 340, 333):
        step = expm(system.system_matrix([omega, 0, 0]) * h) - h * (gain.K[0] + omega * gain.K[1]) @ system.C
        size = np.linalg.norm(root @ step @ np.linalg.inv(root), 2)
        assert (1 - size) / h >= 60.0 - 1e-3


def test_delta_form_keeps_its_digits():
    system = motor_speed(MOTOR)
    slow = delta_matrices(system, [[300.0]], 1e-9)[0]
    np.testing.assert_allclose(slow, system.system_matrix([300.0]), rtol=1e-5)
    A = system.system_matrix([300.0])
    np.testing.assert_allclose(
        delta_matrices(system, [[300.0]], 1e-3)[0], (expm(A * 1e-3) - np.eye(2)) / 1e-3, rtol=1e-10
    )


def test_structure_of_the_motor():
    found = motor_structure(MOTOR, 150.0, 340.0)
    assert found.speed.verdict == "boundary"
    assert found.best_margin <= 1e-6
    assert np.abs(found.boundary).max() < 1e-12  # the scheduled gain is on the boundary at every speed
    assert found.constant.max() > 0.1  # a constant one is not
    assert np.argmin(np.abs(found.constant)) == 100  # except where it was taken
    assert found.short.verdict == "strict"
    assert found.short.definite == pytest.approx((math.sqrt(2) - 1) ** 2, rel=1e-6)
    assert found.both.verdict == "infeasible"
    assert found.both.definite_bound < 1e-6


@pytest.mark.parametrize(("k1", "mu"), [(200.0, 1e-3), (0.0, 3e-3), (-100.0, 1e-2)])
def test_closed_form_of_the_boundary(k1, mu):
    """dV/dt = -2 mu (alpha + k1) |e_i|^2 and P A_1 = C^H F exactly; the matrix has no other part."""
    design, system = motor_boundary(MOTOR, k1=k1, mu=mu), motor_speed(MOTOR)
    R, L_s, L_m = MOTOR.R_r_prime, MOTOR.L_s_prime, MOTOR.L_m_prime
    alpha = (MOTOR.r_s + R) / L_s + R / L_m
    np.testing.assert_allclose(design.P @ system.A[0], system.C.conj().T @ design.F[0], atol=1e-15)
    assert np.linalg.eigvalsh(design.P)[0] > 0
    for omega in (-50.0, 0.0, 150.0, 340.0):
        closed = system.system_matrix([omega]) - (design.K[0] + omega * design.K[1]) @ system.C
        rate = design.P @ closed
        expected = np.diag([-2 * mu * (alpha + k1), 0.0])
        np.testing.assert_allclose(rate + rate.conj().T, expected, atol=1e-11 * abs(rate).max())
        # poles: s^2 + (alpha - j omega + k1) s + mu |c|^2
        c2 = (R**2 + omega**2 * L_m**2) / (L_s * L_m) ** 2
        poles = np.sort_complex(np.roots([1, alpha - 1j * omega + k1, mu * c2]))
        np.testing.assert_allclose(np.sort_complex(np.linalg.eigvals(closed)), poles, rtol=1e-8)


def test_no_constant_gain_over_a_range():
    """The cross term must vanish at both ends: two different gains. Both ends demand K_psi = mu conj(c) - r_s."""
    design = motor_boundary(MOTOR, k1=200.0, mu=1e-3)
    assert np.abs(design.K[1]).max() * 190 > 0.1 * np.abs(design.K[0]).max()


def test_heat_exchanger_is_strictly_feasible():
    found = structure_of(EXCHANGER, [50.0], [400.0])
    assert found.verdict == "strict"
    design = direct_gain(EXCHANGER, [50.0], [400.0], decay_rate=0.1)
    for theta in np.linspace(50, 400, 36):
        rate = design.P @ (EXCHANGER.system_matrix([theta]) - design.K @ EXCHANGER.C + 0.1 * np.eye(2))
        assert np.linalg.eigvalsh(rate + rate.conj().T)[-1] < 1e-9 * np.abs(design.P).max()
    both = heat_exchanger(HeatExchanger(), hot_outlet_measured=True)
    assert direct_gain(both, [50.0], [400.0]).F.shape == (1, 2, 2)


def test_design_refusals():
    with pytest.raises(InfeasibleError, match="never strictly feasible"):
        direct_gain(motor_speed(MOTOR), [150.0], [340.0])
    with pytest.raises(ParameterError, match="no place for a feedthrough"):
        structure_of(motor_speed_and_short(MOTOR), [150, 0, 0], [340, 0, 0])
    with pytest.raises(InfeasibleError, match=r"1e\+06|infeasible"):
        polytopic_gain(motor_speed(MOTOR), [150.0], [340.0], h=5e-4, decay_rate=800.0)
    with pytest.raises(ParameterError, match="range of omega, rad/s is empty"):
        polytopic_gain(motor_speed(MOTOR), [150.0], [150.0], h=1e-4, decay_rate=60.0)
    for low, high in (([150.0, 1.0], [340.0]), ([math.nan], [340.0]), ([340.0], [150.0])):
        with pytest.raises(ParameterError, match="finite numbers each, low <= high"):
            polytopic_gain(motor_speed(MOTOR), low, high, h=1e-4, decay_rate=60.0)
    with pytest.raises(ParameterError, match="far more dense"):
        polytopic_gain(motor_speed(MOTOR), [150.0], [340.0], h=1e-4, decay_rate=60.0, dense=5)
    two = BilinearSystem(
        A0=-np.eye(2), A=np.stack([np.eye(2), np.diag([1, -1])]), B0=np.eye(2), B=np.zeros((2, 2, 2)), C=np.eye(2),
        D=np.zeros((2, 2, 2)), names=("a", "b"), name="two",
    )  # fmt: skip
    with pytest.raises(ParameterError, match="two: the system matrix depends on a, b"):
        polytopic_gain(two, [-0.1, -0.1], [0.1, 0.1], h=0.1, decay_rate=0.1)
    assert structure_of(two, [-0.1, -0.1], [0.1, 0.1]).verdict == "strict"
    for k1, mu in ((200.0, 0.0), (200.0, math.nan), (-1e4, 1e-3), (math.nan, 1e-3)):
        with pytest.raises(ParameterError, match="motor_boundary"):
            motor_boundary(MOTOR, k1=k1, mu=mu)
    with pytest.raises(ParameterError, match="omega_e = nan"):
        motor_short_state(MOTOR, math.nan)


GOOD = dict(
    A0=[[-1.0]], A=[[[1.0]]], B0=[[1.0]], B=[[[0.0]]], C=[[1.0]], D=[[[0.0]]], names=("a",), name="one"
)  # fmt: skip


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"A": [[[0.0]]]}, "parameter a acts nowhere"),
        ({"A": [[1.0]]}, "one: A"),
        ({"A0": [[math.nan]]}, "one: A0"),
        ({"B0": [[1.0], [1.0]]}, "one: B0"),
        ({"C": [["x"]]}, "one: C"),
        ({"D": np.zeros((1, 2, 1))}, "one: D"),
        ({"names": ()}, "at least one state"),
    ],
)
def test_system_refusals(change, message):
    BilinearSystem(**GOOD)
    with pytest.raises(ParameterError, match=message):
        BilinearSystem(**{**GOOD, **change})


def test_observer_refusals():
    system = BilinearSystem(**GOOD)
    filtered = dict(system=system, K=[[0.0]], noise=1.0, lags=[1.0], spread=[1.0])
    for change, message in [
        ({"K": [[1.0, 2.0]]}, "one: K"),
        ({"noise": 0.0}, "noise = 0.0"),
        ({"noise": "x"}, "noise = 'x'"),
        ({"lags": [0.0]}, "must be positive"),
        ({"lags": [math.nan]}, "lags"),
        ({"lags": [1.0, 1.0]}, "give 1 numbers"),
        ({"spread": [math.inf]}, "spread"),
        ({"spread": [-1.0]}, "spread"),
        ({"power_lag": -1.0}, "power_lag"),
        ({"limits": [(1.0, 1.0)]}, "low < high"),
        ({"limits": [(1.0, 2.0), (1.0, 2.0)]}, "limits"),
    ]:
        with pytest.raises(ParameterError, match=message):
            FilteredRegressorObserver(**{**filtered, **change})
    direct = dict(system=system, K=[[0.0]], F=[[[0.0]]], G=[[[0.0]]], rates=[1.0])
    for change, message in [({"F": [[0.0]]}, "one: F"), ({"G": [0.0]}, "one: G"), ({"rates": [-1.0]}, "each >= 0")]:
        with pytest.raises(ParameterError, match=message):
            DirectObserver(**{**direct, **change})
    good = np.ones((5, 1))
    bad = good.copy()
    bad[2] = math.nan
    for observer in (
        FilteredRegressorObserver(**{**filtered, "limits": [(0.0, 2.0)]}),
        DirectObserver(**{**direct, "limits": [(0.0, 2.0)]}),
    ):
        for args, options, message in [
            ((bad, good, 0.1), {}, "one: u"),
            ((good, bad, 0.1), {}, "one: y"),
            ((good, good[:4], 0.1), {}, "one: y"),
            ((good[:1], good[:1], 0.1), {}, "at least two"),
            ((good, good, 0.0), {}, "h = 0.0 s"),
            ((good, good, 0.1), {"x0": [1.0, 2.0]}, "one: x0"),
            ((good, good, 0.1), {"theta0": [math.nan]}, "theta0"),
            ((good, good, 0.1), {"theta0": [5.0]}, "outside the limits"),
        ]:
            with pytest.raises(ParameterError, match=message):
                observer.run(*args, **{"x0": [0.0], "theta0": [0.5], **options})
    with pytest.raises(ParameterError, match="theta has shape"):
        simulate_system(system, [1.0, 2.0], good, 0.1, [0.0])


def test_limits_hold_and_are_reported():
    u = np.tile([60.0, 15.0], (300, 1))
    _, y = simulate_system(EXCHANGER, [250.0], u, 1.0, [40, 30])
    observer = FilteredRegressorObserver(
        system=EXCHANGER, K=np.zeros((2, 1)), noise=0.01, lags=[20.0], spread=[100.0], limits=[(50.0, 200.0)]
    )
    found = observer.run(u, y, 1.0, x0=[40, 30], theta0=[100.0])
    assert found.theta.max() == 200.0
    assert found.limited[-1]
    assert not found.limited.all()


def test_divergence_is_said():
    u = np.tile([60.0, 15.0], (3000, 1))
    _, y = simulate_system(EXCHANGER, [250.0], u, 1.0, [40, 30])
    design = direct_gain(EXCHANGER, [50.0], [400.0])
    observer = DirectObserver(system=EXCHANGER, K=design.K, F=design.F, G=design.G, rates=[1e5])
    with pytest.raises(SimulationError, match="direct observer left the finite numbers at t ="):
        observer.run(u, y, 1.0, x0=[20, 20], theta0=[100.0])
    with pytest.raises(ParameterError, match="all must be positive"):
        lyapunov_run(
            EXCHANGER, design, theta=[250.0], rates=[0.0], u=u, h=1.0, x0=[40, 30], x_guess=[0, 0], theta_guess=[1.0]
        )


def test_record_of_the_motor():
    record = motor_record(MOTOR, duration=0.2, t_fault=0.1, unbalance=0.0, phase=1)
    assert record.g_c == pytest.approx(np.exp(-2j * np.pi / 3) * float(g_of_gamma(0.02, "Y")) / 3)
    # before the fault a pure positive sequence, from the first sample on
    before = record.y[record.t < 0.1, 0] * np.exp(-1j * 100 * np.pi * record.t[record.t < 0.1])
    assert np.abs(before - before[0]).max() < 1e-4 * abs(before[0])
    assert len(record.every(5).t) == math.ceil(len(record.t) / 5)
    for options in ({"noise": 0.1}, {"noise": -1.0}, {"step": 0.0}, {"t_fault": 5.0}):
        with pytest.raises(ParameterError, match="motor_record"):
            motor_record(MOTOR, **options)


def test_direct_law_against_filtered_regressor():
    rows = compare_observers(MOTOR)
    fine, coarse, slow, *coarsest = rows[:11]
    filtered = rows[11:]
    assert fine.outcome == "settled"
    assert (fine.speed_settling, fine.short_settling) == pytest.approx((0.19, 0.11), abs=0.01)
    assert coarse.outcome != "settled"  # the same rates at 100 us
    assert slow.speed_settling == pytest.approx(1.34, abs=0.03)  # ten times lower rates: uselessly slow
    assert slow.short_settling == math.inf
    assert len(coarsest) == 8
    assert all(row.speed_settling == math.inf for row in coarsest)
    assert [round(row.h * 1e6) for row in filtered] == [100, 200, 500]
    for row in filtered:
        assert row.outcome == "settled"
        assert row.speed_settling < 0.07
        assert row.short_settling == pytest.approx(0.164, abs=0.005)
        assert row.certified >= 60.0
        assert row.speed_error < 0.05
        assert row.short_error < 1e-8


def test_worth_of_the_gain():
    """Faster than without gain and paid for in noise; the direct law is as fast and hundreds of times noisier."""
    table = gain_value(MOTOR, np.random.default_rng(2))
    none, low, middle, high, direct = (one for one, _ in table)
    assert low.speed_settling < none.speed_settling
    assert middle.speed_settling < low.speed_settling
    assert none.speed_noise < low.speed_noise < middle.speed_noise < high.speed_noise
    assert direct.speed_noise > 100 * middle.speed_noise
    assert none.slowest < 30 < 60 <= low.slowest
    for one in (none, low, middle, high):
        assert one.short_settling == pytest.approx(0.176, abs=0.01)  # set by the time constant, not by the gain
    # a wrong resistance is not mended by any gain
    biases = [second.speed_error for _, second in table[:4]]
    assert max(biases) < 1.3 * min(biases)


def test_examples_are_the_motor_equations():
    from pumplib.motor.dq import current_derivatives

    system = motor_speed(MOTOR)
    x, v, omega = np.array([3 - 2j, 1 + 0.5j]), 200 + 80j, 280.0
    found = system.system_matrix([omega]) @ x + system.input_matrix([omega]) @ [v]
    d = current_derivatives.py_func(
        x[0].real, x[0].imag, x[1].real, x[1].imag, omega, v.real, v.imag, MOTOR.r_s, MOTOR.R_r_prime,
        MOTOR.L_m_prime, 1 / MOTOR.L_s_prime, 1 / MOTOR.L_m_prime,
    )  # fmt: skip
    np.testing.assert_allclose([found[0].real, found[0].imag, found[1].real, found[1].imag], d, rtol=1e-12)
    # heat balance of the exchanger: what the hot side loses the cold side gains
    cell = HeatExchanger()
    loss = EXCHANGER.A[0] @ [60.0, 20.0]
    assert loss[0].real * cell.volume_hot == pytest.approx(-loss[1].real * cell.volume_cold)
    with pytest.raises(ParameterError, match=r"HeatExchanger.flow_hot = 0"):
        dataclasses.replace(cell, flow_hot=0.0)
