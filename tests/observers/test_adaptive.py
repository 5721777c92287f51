"""The general adaptive observers: simulation, theorems A and B on two plants, what happens without excitation."""

import dataclasses
import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from pumplib.errors import ParameterError, SimulationError
from pumplib.machines import load_motor
from pumplib.observers.adaptive import (
    BilinearSystem,
    DirectObserver,
    FilteredRegressorObserver,
    simulate_system,
)
from pumplib.observers.adaptive_design import direct_gain, excitation, motor_boundary, polytopic_gain
from pumplib.observers.adaptive_examples import (
    HeatExchanger,
    heat_exchanger,
    motor_short_state,
    motor_speed,
    motor_speed_and_short,
)
from pumplib.observers.adaptive_study import lyapunov_run, regressor

MOTOR = load_motor("reference_1k5")
W = 100 * math.pi
EXCHANGER = heat_exchanger(HeatExchanger())
HOT_COLD = np.array([60.0, 15.0])


def random_system(rng, n=3, r=2, p=2, m=2, complex_=True):
    def draw(*shape):
        x = rng.normal(size=shape)
        return x + 1j * rng.normal(size=shape) if complex_ else x

    return BilinearSystem(
        A0=draw(n, n) - 3 * np.eye(n), A=draw(m, n, n), B0=draw(n, r), B=draw(m, n, r), C=draw(p, n), D=draw(m, p, r),
        names=tuple(f"p{i}" for i in range(m)), name="random",
    )  # fmt: skip


def supply(h, duration, unbalance=0.0):
    t = h * np.arange(round(duration / h))
    v = 325 * np.exp(1j * W * t)
    v = v + unbalance * v.conj()
    return t, v


class TestSimulation:
    @pytest.mark.parametrize("h", [1e-3, 0.4, 5.0])
    def test_equals_the_exponential_for_straight_lines(self, h):
        rng = np.random.default_rng(1)
        system = random_system(rng)
        theta, u, x0 = rng.normal(size=2), rng.normal(size=(4, 2)) + 1j * rng.normal(size=(4, 2)), rng.normal(size=3)
        x, y = simulate_system(system, theta, u, h, x0)
        A, B = system.system_matrix(theta), system.input_matrix(theta)
        now = x0.astype(complex)
        for k in range(3):
            big = np.zeros((5, 5), complex)
            big[:3, :3], big[:3, 3], big[:3, 4], big[3, 4] = A, B @ u[k], 0, 1
            big[:3, 3] = B @ u[k]
            # state (x, 1, t): dx = A x + B u_k 1 + B slope t
            big = np.zeros((5, 5), complex)
            big[:3, :3], big[:3, 3], big[:3, 4], big[4, 3] = A, B @ u[k], B @ (u[k + 1] - u[k]) / h, 1
            now = (expm(big * h) @ np.concatenate([now, [1, 0]]))[:3]
            np.testing.assert_allclose(x[k + 1], now, rtol=1e-10, atol=1e-12 * np.abs(now).max())
        expected = x @ system.C.T + u @ np.einsum("i,ipr->pr", theta, system.D).T
        np.testing.assert_allclose(y, expected, rtol=1e-12)

    def test_parameters_may_change_from_sample_to_sample(self):
        theta = np.array([[50.0], [50.0], [300.0], [300.0]])
        u = np.tile(HOT_COLD, (4, 1))
        x, _ = simulate_system(EXCHANGER, theta, u, 2.0, [40, 30])
        one, _ = simulate_system(EXCHANGER, [50.0], u[:3], 2.0, [40, 30])
        two, _ = simulate_system(EXCHANGER, [300.0], u[:2], 2.0, one[2])
        np.testing.assert_allclose(x, np.vstack([one, two[1:]]), rtol=1e-13)

    def test_divergence_is_said(self):
        system = BilinearSystem(
            A0=[[900.0]], A=[[[1.0]]], B0=[[1.0]], B=[[[0.0]]], C=[[1.0]], D=[[[0.0]]], names=("a",), name="blow-up"
        )
        with pytest.raises(SimulationError, match="blow-up: the simulation left the finite numbers at t ="):
            simulate_system(system, [0.0], np.ones((2000, 1)), 1e-3, [1.0])


class TestDirect:
    """Theorem A."""

    def test_global_decrease_and_convergence_heat_exchanger(self):
        """Constant gain, parameter times unmeasured state: from any start, exponentially with a temperature step."""
        design = direct_gain(EXCHANGER, [50.0], [400.0])
        np.testing.assert_allclose(design.P @ EXCHANGER.A[0], EXCHANGER.C.T @ design.F[0], atol=1e-9)
        # a violent start needs short steps, as the function falls in continuous time
        for guess, x_guess, rate, h, n in (
            (60.0, [20, 20], 0.2, 0.02, 20000),
            (2000.0, [-400, 300], 0.005, 0.002, 100000),
        ):
            run = lyapunov_run(
                EXCHANGER, design, theta=[250.0], rates=[rate], u=np.tile(HOT_COLD, (n, 1)), h=h, x0=[40, 30],
                x_guess=x_guess, theta_guess=[guess],
            )  # fmt: skip
            assert run.largest_rise < 1e-9
            assert np.abs(run.estimate.e[-1]).max() < 5.0
            if rate == 0.2:  # exponential, not a power of time: equal factors in equal times
                first, second, third = (np.sqrt(run.V[k * n // 4 - 1]) for k in (1, 2, 3))
                assert second < 0.1 * first
                assert third < 0.1 * second

    def test_without_excitation_the_error_goes_and_the_parameter_stays(self):
        """Equal temperatures on both sides transfer no heat: nothing is learnt about the transfer."""
        design = direct_gain(EXCHANGER, [50.0], [400.0])
        run = lyapunov_run(
            EXCHANGER, design, theta=[250.0], rates=[0.02], u=np.full((20000, 2), 20.0), h=0.02, x0=[40, 30],
            x_guess=[40, 30], theta_guess=[100.0],
        )  # fmt: skip
        assert np.abs(run.estimate.e[-1]).max() < 1e-9
        assert abs(run.e_theta[-1, 0]) > 100
        assert run.e_theta[-1, 0] == pytest.approx(run.e_theta[-2000, 0], abs=1e-6)

    def test_observability_of_the_known_part_is_not_needed(self):
        A0, C = EXCHANGER.A0, EXCHANGER.C
        assert np.linalg.matrix_rank(np.vstack([C, C @ A0])) == 1  # the hot side does not show without transfer
        at_200 = EXCHANGER.system_matrix([200.0])
        assert np.linalg.matrix_rank(np.vstack([C, C @ at_200])) == 2
        design = direct_gain(EXCHANGER, [50.0], [400.0])
        u = np.tile(HOT_COLD, (20000, 1))
        run = lyapunov_run(
            EXCHANGER, design, theta=[250.0], rates=[0.2], u=u, h=0.02, x0=[40, 30], x_guess=[20, 20], theta_guess=[60]
        )
        assert np.abs(run.e_x[-1, 0]) < 1e-2  # the temperature that nobody measures

    def test_motor_short_with_known_speed(self):
        """Linear in the parameters: V falls and the error does so by the same factor from any start."""
        system = motor_short_state(MOTOR, 290.0)
        design = direct_gain(system, [0, 0], [0, 0], decay_rate=20.0)
        h = 5e-6
        _, v = supply(h, 0.15)
        ratios = []
        for scale in (1.0, 1e4):
            run = lyapunov_run(
                system, design, theta=[0.02, 0.005], rates=[2e-5, 2e-5], u=np.stack([v, v.conj()], axis=1), h=h,
                x0=[0, 0, 0], x_guess=np.array([30, -20, 10]) * scale, theta_guess=[0.02 + scale, 0.005 - scale],
            )  # fmt: skip
            assert run.largest_rise < 1e-9
            ratios.append(np.linalg.norm(run.e_theta[-1]) / np.linalg.norm(run.e_theta[0]))
        assert ratios[0] < 0.01
        assert ratios[1] == pytest.approx(ratios[0], rel=1e-6)

    def test_motor_speed_with_the_boundary_gain_converges_locally(self):
        system, design = motor_speed(MOTOR), motor_boundary(MOTOR, k1=200.0, mu=1e-3)
        h = 5e-6
        _, v = supply(h, 0.5)
        A = system.system_matrix([300.0])
        x0 = np.linalg.solve(1j * W * np.eye(2) - A, system.B0[:, 0] * 325)
        run = lyapunov_run(
            system, design, theta=[300.0], rates=[1e7], u=v[:, None], h=h, x0=x0, x_guess=[0, 0], theta_guess=[265.0]
        )
        assert abs(run.e_theta[-1, 0]) < 1e-3
        assert np.abs(run.e_x[-1]).max() < 1e-4

    def test_innovation_form_has_no_bias(self):
        """A vanishing output error disturbs nothing: started on the truth it stays there, with a large gain too."""
        design = direct_gain(EXCHANGER, [50.0], [400.0])
        u = np.tile(HOT_COLD, (500, 1))
        x, y = simulate_system(EXCHANGER, [250.0], u, 1.0, [40, 30])
        observer = DirectObserver(
            system=EXCHANGER, K=design.K + np.array([[0.4], [0.6]]), F=design.F, G=design.G, rates=[0.2]
        )
        found = observer.run(u, y, 1.0, x0=[40, 30], theta0=[250.0])
        np.testing.assert_allclose(found.theta, 250.0, rtol=1e-12)
        np.testing.assert_allclose(found.x, x, rtol=1e-12)

    def test_law_is_the_written_one(self):
        """One step against the formula, complex, with every matrix at work."""
        rng = np.random.default_rng(4)
        s = random_system(rng)
        shape = lambda *k: rng.normal(size=k) + 1j * rng.normal(size=k)  # noqa: E731
        K, F, G, u, y = shape(3, 3, 2), shape(2, 2, 3), shape(2, 2, 2), shape(2, 2), shape(2, 2)
        theta0, x0, rates, h = rng.normal(size=2), shape(3), np.array([0.3, 2.0]), 1e-3
        observer = DirectObserver(system=s, K=K, F=F, G=G, rates=rates)
        found = observer.run(u, y, h, x0=x0, theta0=theta0)
        D = np.einsum("i,ipr->pr", theta0, s.D)
        e = y[0] - s.C @ x0 - D @ u[0]
        np.testing.assert_allclose(found.e[0], e, rtol=1e-12)
        change = [(e.conj() @ (F[i] @ x0 + G[i] @ u[0] + s.D[i] @ u[0])).real for i in range(2)]
        np.testing.assert_allclose(found.theta[1], theta0 + h * rates * change, rtol=1e-12)
        free, _ = simulate_system(s, theta0, u, h, x0)
        gain = K[0] + theta0[0] * K[1] + theta0[1] * K[2]
        np.testing.assert_allclose(found.x[1], free[1] + h * gain @ e, rtol=1e-12)


class TestFiltered:
    """Theorem B."""

    def test_linear_case_converges_globally(self):
        """Known speed: the error is a linear function of the initial one, whatever its size."""
        full = motor_speed_and_short(MOTOR)
        known = BilinearSystem(
            A0=full.system_matrix([290.0, 0, 0]), A=np.zeros((2, 2, 2)), B0=full.B0, B=np.zeros((2, 2, 2)), C=full.C,
            D=full.D[1:], names=full.names[1:], name="known speed",
        )  # fmt: skip
        h = 1e-4
        _, v = supply(h, 1.0)
        u = np.stack([v, v.conj() / 6], axis=1)
        gain = polytopic_gain(known, [0, 0], [0, 0], h=h, decay_rate=60.0)
        x, y = simulate_system(known, [0.01, -0.02], u, h, [1, 2])
        observer = FilteredRegressorObserver(
            system=known, K=gain.K, noise=0.01, lags=[0.1, 0.1], spread=[0.03, 0.03], limits=None
        )
        errors = []
        for scale in (1.0, 1e5):
            found = observer.run(u, y, h, x0=x[0] + scale * np.array([3, -1j]), theta0=[0.01 + scale, -0.02 - scale])
            errors.append(np.abs(found.theta - [0.01, -0.02]).max(axis=1) / scale)
        assert errors[0][-1] < 1e-4
        np.testing.assert_allclose(errors[1], errors[0], rtol=1e-6, atol=1e-11)
        # exponential: equal factors in equal times
        a, b, c = (errors[1][k] for k in (3000, 6000, 9000))
        assert b < 0.2 * a
        assert c < 0.2 * b

    @pytest.mark.parametrize("h", [1e-4, 5e-4])
    def test_speed_and_short_together(self, h):
        system = motor_speed_and_short(MOTOR)
        fine, ratio = 2e-5, round(h / 2e-5)
        t, v = supply(fine, 1.2, unbalance=0.02)
        w = v / 6  # any known input turning backwards will do
        u = np.stack([v, w.conj()], axis=1)
        theta = np.array([300.0, 0.004, -0.003])
        x, y = simulate_system(system, theta, u, fine, [0, 0])
        gain = polytopic_gain(system, [150, -1, -1], [340, 1, 1], h=h, decay_rate=60.0)
        observer = FilteredRegressorObserver(
            system=system, K=gain.K, noise=0.01, lags=[0.02, 0.1, 0.1], spread=[30, 0.03, 0.03],
            limits=[(100, 400), (-0.3, 0.3), (-0.3, 0.3)],
        )  # fmt: skip
        found = observer.run(u[::ratio], y[::ratio], h, x0=[0, 0], theta0=[265, 0, 0])
        assert abs(found.theta[-1, 0] - 300) < (0.002 if h < 2e-4 else 0.05)
        assert np.abs(found.theta[-1, 1:] - theta[1:]).max() < (
            1e-6 if h < 2e-4 else 5e-5
        )  # straight lines for sines: h^2
        assert np.abs(found.x[-1] - x[::ratio][len(found.x) - 1]).max() < 0.01
        assert found.limited.sum() < 100
        assert not found.limited[len(t) // ratio // 4 :].any()
        # and it is the observer, not the start: no gain does it too, as the motor is stable by itself
        free = dataclasses.replace(observer, K=np.zeros((2, 1)))
        again = free.run(u[::ratio], y[::ratio], h, x0=[0, 0], theta0=[265, 0, 0])
        assert abs(again.theta[-1, 0] - 300) < 0.06

    def test_heat_exchanger_with_the_same_code(self):
        h = 1.0
        u = np.tile(HOT_COLD, (900, 1))
        gain = polytopic_gain(EXCHANGER, [50.0], [400.0], h=h, decay_rate=0.1)
        assert gain.margin >= 0
        theta = np.full((900, 1), 250.0)
        theta[450:] = 200.0  # fouling
        x, y = simulate_system(EXCHANGER, theta, u, h, [40, 30])
        observer = FilteredRegressorObserver(
            system=EXCHANGER, K=gain.K, noise=0.01, lags=[20.0], spread=[100.0], power_lag=20.0, limits=[(10, 1000)]
        )
        found = observer.run(u, y, h, x0=[20, 20], theta0=[100.0])
        assert found.theta[440, 0] == pytest.approx(250.0, rel=1e-3)
        assert found.theta[-1, 0] == pytest.approx(200.0, rel=1e-3)
        assert np.abs(found.x[-1] - x[-1]).max() < 0.02  # the hot outlet, not measured

    def test_without_excitation_the_parameter_stays(self):
        system = motor_speed_and_short(MOTOR)
        u = np.zeros((2000, 2), complex)
        _, y = simulate_system(system, [300, 0.02, 0], u, 1e-4, [5, 3j])
        observer = FilteredRegressorObserver(
            system=system, K=np.zeros((2, 1)), noise=0.01, lags=[0.02, 0.1, 0.1], spread=[30, 0.03, 0.03]
        )
        found = observer.run(u, y, 1e-4, x0=[5, 3j], theta0=[300, 0, 0])
        np.testing.assert_array_equal(found.theta[:, 1:], 0.0)
        assert np.abs(found.e).max() < 1e-9
        assert found.deviation[-1, 1] == pytest.approx(0.03)

    def test_constant_parameters_have_a_fading_gain(self):
        """Infinite time constants: recursive least squares, whose deviations only fall."""
        h = 1.0
        rng = np.random.default_rng(3)
        u = np.tile(HOT_COLD, (2000, 1))
        _, y = simulate_system(EXCHANGER, [250.0], u, h, [40, 30])
        noisy = y + 0.1 * rng.normal(size=y.shape)
        observer = FilteredRegressorObserver(
            system=EXCHANGER, K=np.zeros((2, 1)), noise=0.01, lags=[math.inf], spread=[100.0], limits=[(10, 1000)]
        )
        found = observer.run(u, noisy, h, x0=[40, 30], theta0=[200.0])
        assert (np.diff(found.deviation[:, 0]) <= 1e-12).all()
        assert abs(found.theta[-1, 0] - 250) < 5 * found.deviation[-1, 0]

    def test_recursion_is_weighted_least_squares(self):
        """Feedthrough only, no state to speak of: the recursion must give the textbook solution, complex outputs."""
        rng = np.random.default_rng(9)
        D = rng.normal(size=(2, 2, 3)) + 1j * rng.normal(size=(2, 2, 3))
        system = BilinearSystem(
            A0=[[-1.0]], A=np.zeros((2, 1, 1)), B0=np.zeros((1, 3)), B=np.zeros((2, 1, 3)), C=[[0.0], [0.0]], D=D,
            names=("a", "b"), name="least squares",
        )  # fmt: skip
        u = rng.normal(size=(40, 3)) + 1j * rng.normal(size=(40, 3))
        y = rng.normal(size=(40, 2)) + 1j * rng.normal(size=(40, 2))
        observer = FilteredRegressorObserver(
            system=system, K=np.zeros((1, 2)), noise=0.5, lags=[math.inf] * 2, spread=[2.0, 3.0]
        )
        found = observer.run(u, y, 0.1, x0=[0.0], theta0=[0.3, -0.2])
        phi = np.einsum("ipr,Nr->Npi", D, u).reshape(-1, 2)
        rows, right = np.vstack([phi.real, phi.imag]), np.concatenate([y.reshape(-1).real, y.reshape(-1).imag])
        prior = np.diag([1 / 4, 1 / 9])
        information = rows.T @ rows / 0.5 + prior
        expected = np.linalg.solve(information, rows.T @ right / 0.5 + prior @ [0.3, -0.2])
        np.testing.assert_allclose(found.theta[-1], expected, rtol=1e-9)
        np.testing.assert_allclose(found.deviation[-1] ** 2, np.diag(np.linalg.inv(information)), rtol=1e-9)

    def test_state_error_is_the_filtered_regressor_times_the_parameter_error(self):
        """x - xhat - Upsilon (theta - thetahat) decays by the gain's dynamics alone: the identity of the proof."""
        full = motor_speed_and_short(MOTOR)
        h = 1e-4
        _, v = supply(h, 0.3)
        u = np.stack([v, v.conj() / 6], axis=1)
        x, y = simulate_system(full, [290, 0.02, 0.0], u, h, [0, 0])
        # speed known and held: its limits leave it no room
        observer = FilteredRegressorObserver(
            system=full, K=np.array([[150.0], [30j]]), noise=0.01, lags=[1, 0.1, 0.1], spread=[1e-9, 0.03, 0.03]
        )
        found = observer.run(u, y, h, x0=[4, -2], theta0=[290, 0, 0])
        A = full.system_matrix([290, 0, 0])
        step = expm(A * h) - h * np.array([[150.0], [30j]]) @ full.C
        filtered = np.zeros((2, 2), complex)  # of the two fault parameters
        eta = (x[0] - [4, -2]).astype(complex)
        for k in range(1, 600):
            fed = np.array([u[k - 1, 1], 1j * u[k - 1, 1]])
            filtered = step @ filtered - h * np.outer([150.0, 30j], fed)
            eta = step @ eta
            # theta[k - 1] is what x[k] was computed with
            error = np.array([0.02, 0.0]) - found.theta[k - 1, 1:]
            rest = x[k] - found.x[k] - filtered @ error
            assert np.abs(rest - eta).max() < 1e-7
        assert np.abs(eta).max() < 1e-3


class TestExcitation:
    def test_rotating_supply_excites_and_standing_supply_does_not(self):
        system = motor_speed_and_short(MOTOR)
        h = 1e-4
        t, v = supply(h, 0.6)
        gain = np.array([[60.0], [0.0]])
        turning = regressor(system, gain, [290, 0.01, 0], np.stack([v, v.conj() / 6], axis=1), h, [0, 0])
        scale = 1 / np.sqrt(np.mean(np.abs(turning[3000:, 0]) ** 2, axis=0))  # comparable regressors
        standing = np.full((len(t), 2), 20.0 + 0j)
        standing[:, 1] = 20 / MOTOR.r_s
        still = regressor(system, gain, [290, 0.01, 0], standing, h, [0, 0])
        strong = excitation(turning[3000:] * scale, t[3000:], 0.02)
        weak = excitation(still[3000:] * scale, t[3000:], 0.02)
        assert strong.min() > 0.1
        assert np.abs(weak).max() < 1e-6 * strong.min()
        # speed and fault turn against each other: independent over a period
        phi = turning[3000:3200]
        mixed = np.real(np.einsum("Np,Npi->i", phi[:, :, 0].conj(), phi[:, :, 1:]))
        sizes = np.sqrt(np.einsum("Npi,Npi->i", phi.conj(), phi).real)
        assert np.abs(mixed / (sizes[0] * sizes[1:])).max() < 1e-3

    def test_equal_temperatures_do_not_excite(self):
        warm = regressor(EXCHANGER, np.zeros((2, 1)), [250.0], np.tile(HOT_COLD, (400, 1)), 1.0, [40, 30])
        equal = regressor(EXCHANGER, np.zeros((2, 1)), [250.0], np.full((400, 2), 20.0), 1.0, [20, 20])
        t = np.arange(400.0)
        assert excitation(warm[100:], t[100:], 50.0).min() > 1e-5
        assert np.abs(excitation(equal, t, 50.0)).max() < 1e-25

    @pytest.mark.parametrize("window", [0.0, 500.0])
    def test_refusals(self, window):
        with pytest.raises(ParameterError, match="window within the record"):
            excitation(np.ones((400, 1, 1)), np.arange(400.0), window)


def test_kernel_against_continuous_time():
    """With short steps the filtered-regressor observer follows its differential equations (fixed covariance gain)."""
    system = EXCHANGER
    u = np.tile(HOT_COLD, (4001, 1))
    h = 0.01
    _, y = simulate_system(system, [250.0], u, h, [40, 30])
    noise, spread = 1e3, 300.0  # constant covariance over the run to four digits
    observer = FilteredRegressorObserver(
        system=system, K=np.array([[0.05], [0.3]]), noise=noise, lags=[math.inf], spread=[spread]
    )
    found = observer.run(u, y, h, x0=[30, 25], theta0=[100.0])
    K = np.array([0.05, 0.3])
    truth = solve_ivp(
        lambda t, x: system.system_matrix([250.0]).real @ x + system.B0.real @ HOT_COLD, (0, 40), [40, 30], rtol=1e-10,
        dense_output=True,
    )  # fmt: skip

    def rhs(t, z):
        x, filtered, theta, P = z[:2], z[2:4], z[4], z[5]
        A = system.system_matrix([theta]).real
        e = truth.sol(t)[1] - x[1]
        gain = P * filtered[1] / (noise * h)  # least squares over samples as an integral
        d_theta = gain * e
        dx = A @ x + system.B0.real @ HOT_COLD + K * e + filtered * d_theta
        df = A @ filtered - K * filtered[1] + system.A[0].real @ x
        return np.concatenate([dx, df, [d_theta, -(P**2) * filtered[1] ** 2 / (noise * h)]])

    z = solve_ivp(rhs, (0, 40), [30, 25, 0, 0, 100.0, spread**2], rtol=1e-9, t_eval=[10, 20, 40]).y
    picked = found.theta[[1000, 2000, 4000], 0]
    assert np.abs(z[4] - 100).max() > 1
    np.testing.assert_allclose(picked, z[4], rtol=3e-3)
    np.testing.assert_allclose(found.x[[1000, 2000, 4000]].real, z[:2].T, rtol=3e-3)
