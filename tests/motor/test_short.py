"""The shorted motor: against its coils, against the bench, its energy, its limits and its symmetries."""

import dataclasses
import itertools
import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from pumplib.errors import ParameterError
from pumplib.machines import PumpSet, load_application, load_motor, load_pump
from pumplib.machines.profile import Profile
from pumplib.motor.dq import current_derivatives
from pumplib.motor.frames import PHASE_AXES, to_phases, to_space_vector
from pumplib.motor.short import (
    Short,
    copper_losses,
    healthy,
    instant_current,
    phase_short,
    short_constants,
    short_derivatives,
    stored_energy,
    terminals,
)
from pumplib.motor.short_verify import check_pointwise, check_trajectory, default_shorts, draw_short
from pumplib.motor.supply import Supply, grid, harmonic, negative_sequence
from pumplib.testbench.machine import BenchMachine
from pumplib.testbench.simulate import simulate_bench

MOTOR = load_motor("reference_1k5")
DELTA = dataclasses.replace(MOTOR, connection="delta")
DIRTY = grid(
    400.0, 50.0, negative_sequence(0.03, 0.4), harmonic(5, 0.02, 1.0), harmonic(7, 0.015, 2.0), harmonic(3, 0.05, 0.3)
)
W = 100 * math.pi


def rates(motor, short, x, omega_e, v_s):
    d = short_derivatives.py_func(*x, omega_e, v_s.real, v_s.imag, short_constants(motor, short))
    return np.array(d)


@pytest.mark.parametrize("seed", [0, 1])
def test_model_equals_its_coils_at_random_states(seed):
    found = check_pointwise(MOTOR, np.random.default_rng(seed), 3000)
    assert found.worst <= 1e-9
    assert len(found.current) == 3000
    assert 50 < found.instant.sum() < 500  # loops without inductance are among them, in delta and in Y


def test_pointwise_check_notices_a_wrong_equation(monkeypatch):
    """The check is not blind: leaving the star point's part out of the loop shows at once."""
    import pumplib.motor.short_verify as verify

    def wrong(motor, short):
        c = short_constants(motor, short)
        s_0 = short.turned**2 / 3 if motor.connection == "Y" else 0.0
        return c._replace(loop_R=c.loop_R - motor.r_s * s_0)

    monkeypatch.setattr(verify, "short_constants", wrong)
    assert verify.check_pointwise(MOTOR, np.random.default_rng(0), 50).worst > 1e-3


def test_runs_equal_those_of_the_coils():
    found = check_trajectory(MOTOR, DIRTY)
    assert found.worst <= 1e-8
    assert found.speed.max() <= 1e-8
    assert np.abs(found.v_0 - found.v_0_coils).max() <= 1e-8 * np.abs(found.v_0_coils).max()
    assert found.i_t.shape == (301, 2 * len(default_shorts()), 3)
    assert found.omega[-1].min() > 250  # through the start-up
    assert np.abs(found.i_t_coils).max() > 50


def test_trajectory_check_refuses_what_it_cannot_do():
    with pytest.raises(ParameterError, match="no inductance; check it with check_pointwise"):
        check_trajectory(MOTOR, DIRTY, shorts=[Short(gamma=(0.1, 0, 0), kappa_c=0.0)])
    ramp = Supply(amplitude=325.0, frequency=Profile(((0.0, 20.0), (0.5, 50.0)), "lines"))
    with pytest.raises(ParameterError, match="constant frequency"):
        check_trajectory(MOTOR, ramp)
    with pytest.raises(ParameterError, match="at least one state"):
        check_pointwise(MOTOR, np.random.default_rng(0), 0)


@pytest.mark.parametrize("motor", [MOTOR, DELTA], ids=["Y", "delta"])
@pytest.mark.parametrize("kappa_c", [1.0, 0.4])
@pytest.mark.parametrize("shares", [(0.03, 0.0, 0.0), (0.1, -0.04, 0.0), (0.0, 0.2, 0.1)])
def test_agrees_with_the_bench_without_its_extras(motor, kappa_c, shares):
    """Two codes: flux linkages and Runge-Kutta there, currents and DOP853 here; a millisecond from a random state."""
    motor = dataclasses.replace(motor, J=1000.0)  # the speed stays where it is
    base = PumpSet(motor=motor, pump=load_pump("multistage_1k5"), application=load_application("multistage_1k5"))
    bench = BenchMachine(base=base, kappa_c=kappa_c)
    short = Short(gamma=shares, kappa_c=kappa_c, r_f=0.05)
    c = short_constants(motor, short)
    i, i_m, i_f = 3 - 4j, 1.5 + 1j, 20.0
    psi_s, psi_r = motor.L_s_prime * i + motor.L_m_prime * i_m, motor.L_m * i_m
    start = np.array([psi_s.real, psi_s.imag, psi_r.real, psi_r.imag, 250.0, 0.3, 0.0, 0.0, 2e11])
    slow = {"gamma_a": shares[0], "gamma_b": shares[1], "gamma_c": shares[2], "r_f": 0.05, "valve": 2e11}
    run = simulate_bench(
        bench, grid(400.0), duration=1e-3, slow=slow, initial=start, extra=np.array([i_f, 293.15])
    )  # fmt: skip

    def voltage(t):
        return complex(c.b_d, c.b_q) * 400 * math.sqrt(2 / 3) * np.exp(1j * W * t)

    def rhs(t, x):
        return rates(motor, short, x, motor.z_p * 250.0, voltage(t))

    t = run.t_fast
    x = solve_ivp(rhs, (0, 1e-3), [3, -4, 1.5, 1, i_f], t_eval=t, rtol=1e-11, atol=1e-11).y
    di_f = np.array([rhs(t[k], x[:, k])[4] for k in range(10)])
    seen = terminals.py_func(*x, di_f, 0.0, 0.0, c)
    lines = to_phases(seen.i_td + 1j * seen.i_tq)
    theirs = np.stack([run[f"i_{k}"] for k in "abc"], axis=1)
    assert np.abs(lines - theirs)[0].max() < 1e-12 * np.abs(theirs).max()
    assert np.abs(lines - theirs).max() < 2e-5 * np.abs(theirs).max()  # error of the bench's steps
    assert np.abs(seen.v_0 - run["v_0"]).max() < 1e-4 * max(1.0, np.abs(run["v_0"]).max())
    assert abs(seen.v_0[0] - run["v_0"][0]) < 1e-9
    assert seen.torque[0] == pytest.approx(run["T_e"][0], rel=1e-12)


@pytest.mark.parametrize("motor", [MOTOR, DELTA], ids=["Y", "delta"])
def test_power_balance(motor):
    """Terminal power = copper and contact losses + torque times speed + change of the stored energy."""
    rng = np.random.default_rng(3)
    for _ in range(200):
        short = draw_short(rng)
        c = short_constants(motor, short)
        x, v_t = rng.normal(0, 20, 5), complex(*rng.normal(0, 300, 2))
        v_s = complex(c.b_d, c.b_q) * v_t
        if c.inv_loop_L == 0:
            x[4] = instant_current.py_func(v_s.real, v_s.imag, c)
        i_0 = rng.normal(0, 5) if motor.connection == "delta" else 0.0
        omega = rng.uniform(-300, 300)
        d = rates(motor, short, x, motor.z_p * omega, v_s)
        i, i_m, di, di_m = complex(*x[:2]), complex(*x[2:4]), complex(*d[:2]), complex(*d[2:4])
        di_0 = -motor.r_s / motor.L_ls * i_0
        seen = terminals.py_func(*x, d[4], i_0, 7.0, c)
        supplied = 1.5 * (v_t * complex(seen.i_td, -seen.i_tq)).real
        # the stored energy is quadratic: its derivative is the energy's change under the derivatives
        change = sum(
            sign * stored_energy(i + sign * di, i_m + sign * di_m, x[4] + sign * d[4], i_0 + sign * di_0, c) / 2
            for sign in (1, -1)
        )
        lost = copper_losses(i, i_m, x[4], i_0, c)
        assert supplied - lost - seen.torque * omega == pytest.approx(
            float(change), abs=1e-9 * (abs(supplied) + lost + stored_energy(di, di_m, d[4], di_0, c) * 1e3)
        )


def test_losses_are_those_of_the_sections():
    """r_s split by turns over the sections, each with its own current."""
    rng = np.random.default_rng(5)
    for motor in (MOTOR, DELTA):
        short = Short(gamma=(0.2, -0.1, 0.0), r_f=0.3)
        c = short_constants(motor, short)
        i, i_m, i_f = complex(*rng.normal(0, 10, 2)), complex(*rng.normal(0, 3, 2)), 12.0
        i_0 = 2.0 if motor.connection == "delta" else -c.star * i_f
        gamma = np.array(short.gamma)
        winding = to_phases(i, i_0) + gamma * i_f  # i_s = i' + gamma i_f
        if motor.connection == "Y":
            assert abs(winding.sum()) < 1e-12
        shorted = winding - np.sign(gamma) * i_f
        stator = motor.r_s * ((1 - abs(gamma)) @ winding**2 + abs(gamma) @ shorted**2) + 0.3 * i_f**2
        rotor = 1.5 * motor.R_r_prime * abs(i - i_m) ** 2
        zero = i_0 if motor.connection == "delta" else 0.0
        assert stator + rotor == pytest.approx(copper_losses(i, i_m, i_f, zero, c), rel=1e-12)


@pytest.mark.parametrize("motor", [MOTOR, DELTA], ids=["Y", "delta"])
def test_limits(motor):
    """No shorted turns, or a contact that does not conduct, is the healthy motor of (3.7)."""
    x, v_s = np.array([5.0, -3, 2, 1, 0.0]), 200 + 100j
    plain = current_derivatives.py_func(
        *x[:4], 290.0, v_s.real, v_s.imag, motor.r_s, motor.R_r_prime, motor.L_m_prime, 1 / motor.L_s_prime,
        1 / motor.L_m_prime,
    )  # fmt: skip
    none = rates(motor, healthy(), x, 290.0, v_s)
    assert tuple(none[:4]) == plain
    assert none[4] == 0.0
    assert instant_current.py_func(v_s.real, v_s.imag, short_constants(motor, healthy())) == 0.0
    for short, size in [(phase_short(1, 1e-9), 1e-8), (phase_short(1, 0.3, r_f=1e9), 1e-6)]:
        c = short_constants(motor, short)
        settled = abs(1.5 * (c.g_d * v_s.real + c.g_q * v_s.imag)) / c.loop_R
        assert abs(complex(c.g_d, c.g_q)) * settled < 1000 * size  # the terminals do not feel it
    # bolted: half the share makes the current of the loop nearly as large, its effect half
    c1, c2 = short_constants(motor, phase_short(0, 0.02)), short_constants(motor, phase_short(0, 0.01))
    assert (0.02 / c1.loop_R) / (0.01 / c2.loop_R) == pytest.approx(1.0, abs=0.02)


def test_loop_without_inductance():
    """Perfectly coupled sections: at once in delta; in Y only where the signed shares cancel."""
    for shares, motor, instant in [
        ((0.1, 0, 0), DELTA, True), ((0.1, -0.1, 0), DELTA, True), ((0.1, 0, 0), MOTOR, False),
        ((0.1, 0.05, 0), MOTOR, False), ((0.1, -0.1, 0), MOTOR, True),
    ]:  # fmt: skip
        c = short_constants(motor, Short(gamma=shares, kappa_c=0.0, r_f=0.1))
        assert (c.inv_loop_L == 0) is instant
        slow = short_constants(motor, Short(gamma=shares, kappa_c=1e-4, r_f=0.1))
        assert slow.inv_loop_L > 0
        # the fast loop settles to the current of the instant one
        v = 100 - 50j
        if instant:
            settled = instant_current.py_func(v.real, v.imag, c)
            d = short_derivatives.py_func(0.0, 0.0, 0.0, 0.0, settled, 0.0, v.real, v.imag, slow)
            assert abs(d[4]) < 1e-9 * abs(settled) * slow.inv_loop_L


@pytest.mark.parametrize("motor", [MOTOR, DELTA], ids=["Y", "delta"])
def test_phases_are_equal_up_to_a_rotation(motor):
    """The same short one phase further turns everything by 120 degrees; mirrored phases mirror the machine."""
    rng = np.random.default_rng(1)
    x, v = rng.normal(0, 10, 5), complex(*rng.normal(0, 200, 2))
    shares = (0.07, -0.02, 0.01)
    d = rates(motor, Short(gamma=shares, kappa_c=0.7), x, 280.0, v)
    a = PHASE_AXES[1]
    i, i_m, v_r = a * complex(*x[:2]), a * complex(*x[2:4]), a * v
    turned = rates(
        motor, Short(gamma=(shares[2], shares[0], shares[1]), kappa_c=0.7), [i.real, i.imag, i_m.real, i_m.imag, x[4]],
        280.0, v_r,
    )  # fmt: skip
    assert complex(*turned[:2]) == pytest.approx(a * complex(*d[:2]), rel=1e-12)
    assert turned[4] == pytest.approx(d[4], rel=1e-12)
    # swap b and c: conjugate vectors, opposite speed
    mirrored = rates(
        motor, Short(gamma=(shares[0], shares[2], shares[1]), kappa_c=0.7), x * [1, -1, 1, -1, 1], -280.0, v.conjugate()
    )
    np.testing.assert_allclose(mirrored, d * [1, -1, 1, -1, 1], rtol=1e-12)
    # the direction of the loop's own current is a convention
    flipped = Short(gamma=tuple(-one for one in shares), kappa_c=0.7)
    other = rates(motor, flipped, x * [1, 1, 1, 1, -1], 280.0, v)
    np.testing.assert_allclose(other, d * [1, 1, 1, 1, -1], rtol=1e-12)


def test_equal_shares_of_all_phases_are_invisible():
    """Three equal shares link no field: in Y and delta the loop is not even driven."""
    for motor in (MOTOR, DELTA):
        c = short_constants(motor, Short(gamma=(0.1, 0.1, 0.1)))
        assert abs(complex(c.g_d, c.g_q)) < 1e-16
        assert abs(short_derivatives.py_func(0.0, 0.0, 0.0, 0.0, 0.0, 300.0, 325.0, 0.0, c)[4]) < 1e-9


def test_compiled_and_interpreted_rates_agree():
    from pumplib.kernels import kernel

    @kernel
    def compiled(i_d, i_q, m_d, m_q, i_f, w, v_d, v_q, c):
        return short_derivatives(i_d, i_q, m_d, m_q, i_f, w, v_d, v_q, c)

    args = (3.0, -2.0, 1.0, 0.5, 7.0, 300.0, 200.0, 80.0)
    c = short_constants(MOTOR, phase_short(2, 0.05, r_f=0.1))
    np.testing.assert_allclose(compiled(*args, c), short_derivatives.py_func(*args, c), rtol=1e-13)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"gamma": (0.1, 0.0)}, "tuple of three shares"),
        ({"gamma": [0.1, 0.0, 0.0]}, "must be a number"),
        ({"gamma": (1.2, 0.0, 0.0)}, r"Short.gamma = 1.2: must be >= -1 and <= 1"),
        ({"gamma": (math.nan, 0.0, 0.0)}, "must be finite"),
        ({"gamma": (0.1, 0.0, 0.0), "r_f": -1.0}, r"Short.r_f = -1 ohm: must be >= 0"),
        ({"gamma": (0.1, 0.0, 0.0), "kappa_c": 1.5}, r"Short.kappa_c = 1.5"),
    ],
)
def test_impossible_faults_are_refused(options, message):
    with pytest.raises(ParameterError, match=message):
        Short(**options)


def test_more_refusals():
    with pytest.raises(ParameterError, match="phase = 3; must be 0, 1 or 2"):
        phase_short(3, 0.1)
    for gamma in (-0.1, math.nan):
        with pytest.raises(ParameterError, match="not negative"):
            phase_short(0, gamma)
    with pytest.raises(ParameterError, match="without any resistance"):
        short_constants(DELTA, phase_short(0, 1.0))
    assert short_constants(DELTA, phase_short(0, 1.0, r_f=0.1)).loop_R == pytest.approx(0.1)


def test_draws_cover_what_they_promise():
    rng = np.random.default_rng(0)
    drawn = [draw_short(rng) for _ in range(400)]
    kinds = {k: sum(np.count_nonzero(s.gamma) == k for s in drawn) for k in (1, 2, 3)}
    assert min(kinds.values()) > 80
    assert sum(s.kappa_c == 0 for s in drawn) > 10
    assert sum(s.r_f == 0 for s in drawn) > 100
    assert any(s.turned == 0 for s in drawn)
    assert {draw_short(rng, 0.3).kappa_c for _ in range(5)} == {0.3}
    for s, k in itertools.product(drawn[:50], (0, 1)):
        assert to_space_vector(np.array(s.gamma)) == pytest.approx(s.vector)
        assert s.sigma >= 0 or k
