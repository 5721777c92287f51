"""What a short leaves in the currents: closed forms against the steady state of the model and of its coils."""

import dataclasses
import math

import numpy as np
import pytest

from pumplib.errors import ParameterError
from pumplib.machines import load_motor
from pumplib.motor.frames import PHASE_AXES, to_space_vector
from pumplib.motor.short import Short, phase_short, short_constants, short_derivatives
from pumplib.motor.short_abc import coil_model, coil_voltages
from pumplib.motor.short_identify import (
    contact_resistance_bound,
    fault_admittance,
    fault_coefficient,
    g_hat_of_phase,
    g_of_gamma,
    gamma_of_g,
    gamma_R,
    loop_impedance,
    phi_z,
    sector_centres,
    stator_impedance,
)

Y = load_motor("reference_1k5")
DELTA = dataclasses.replace(Y, connection="delta")
W = 100 * math.pi
SHORTS = [
    phase_short(0, 0.02),
    phase_short(1, 0.3, kappa_c=0.0, r_f=0.01),
    phase_short(2, 0.05, r_f=0.25, kappa_c=0.5),
    Short(gamma=(0.1, -0.1, 0.0)),
    Short(gamma=(0.0, 0.15, 0.05), kappa_c=0.3, r_f=0.1),
]


def steady_model(motor, short, v, omega_s, omega):
    """Opposite-sequence winding current of the model: its five real states as a linear system, solved at omega_s."""
    c = short_constants(motor, short)

    def rhs(x, v_s):
        return np.array(short_derivatives.py_func(*x, motor.z_p * omega, v_s.real, v_s.imag, c))

    A = np.stack([rhs(one, 0j) for one in np.eye(5)], axis=1)
    B = np.stack([rhs(np.zeros(5), one) for one in (1 + 0j, 1j)], axis=1)
    if c.inv_loop_L == 0:  # the loop's current is an output
        drive = 1.5 * np.array([c.g_d, c.g_q]) / c.loop_R
    # real signals v_d, v_q = Re((v, -j v) exp(j w t))
    X = np.linalg.solve(1j * omega_s * np.eye(5) - A, B @ np.array([v, -1j * v]))
    i_f = X[4] if c.inv_loop_L else drive @ np.array([v, -1j * v])
    s = complex(c.g_d, c.g_q)
    d, q = X[0] + s.real * i_f, X[1] + s.imag * i_f
    return (np.conj(d) + 1j * np.conj(q)) / 2  # coefficient of exp(-j w t)


def steady_coils(motor, short, v, omega_s):
    """The same from the coils at standstill, where their inductances are constant."""
    model = coil_model([(motor, short)])
    unit = np.eye(7)
    L, _ = coil_voltages(model, unit[:1], np.array([0.4]), np.array([0.0]))
    R = model.resistance[0]
    phasors = v * PHASE_AXES.conj()
    system = np.zeros((8, 8), dtype=complex)
    system[:7, :7] = R + 1j * omega_s * L[0]
    if motor.connection == "Y":
        system[:3, 7] = system[7, :3] = 1
    else:
        system[7, 7] = 1
    i = np.linalg.solve(system, np.concatenate((phasors, np.zeros(5))))[:3]
    return to_space_vector(i.real) / 2 - 1j * to_space_vector(i.imag) / 2


@pytest.mark.parametrize("motor", [Y, DELTA], ids=["Y", "delta"])
@pytest.mark.parametrize("short", SHORTS, ids=str)
@pytest.mark.parametrize("omega_s", [W, -W, 0.3 * W])
def test_fault_term_is_the_opposite_sequence_of_the_steady_state(motor, short, omega_s):
    v = 250 + 130j
    w = v / stator_impedance(motor.r_s, motor.L_ls, omega_s)
    expected = np.conj(w) * fault_coefficient(
        short.gamma, motor.r_s, motor.L_ls, omega_s, connection=motor.connection, r_f=short.r_f, kappa_c=short.kappa_c
    )
    assert abs(steady_model(motor, short, v, omega_s, 290.0) - expected) < 1e-12 * abs(w)
    assert abs(steady_coils(motor, short, v, omega_s) - expected) < 1e-12 * abs(w)


@pytest.mark.parametrize("connection", ["Y", "delta"])
def test_bolted_uncoupled_short_is_a_real_number_on_its_axis(connection):
    for k in range(3):
        for gamma in (0.005, 0.02, 0.3):
            g_c = fault_coefficient(
                [gamma if j == k else 0.0 for j in range(3)], Y.r_s, Y.L_ls, W, connection=connection
            )
            assert g_c == pytest.approx(PHASE_AXES[k] ** 2 * g_of_gamma(gamma, connection) / 3, rel=1e-12)
    gamma = np.linspace(0, 0.9, 50)
    np.testing.assert_allclose(gamma_of_g(g_of_gamma(gamma, connection), connection), gamma, rtol=1e-12)
    assert g_of_gamma(0.02, "Y") == pytest.approx(0.02027027027)
    assert g_of_gamma(0.02, "delta") == pytest.approx(0.02040816327)


@pytest.mark.parametrize("connection", ["Y", "delta"])
def test_angle_stays_in_the_sector_of_its_phase(connection):
    """Any contact and any leakage: between 0 and the angle of the impedance; the sectors do not touch."""
    rng = np.random.default_rng(2)
    width = float(phi_z(Y.r_s, Y.L_ls, W))
    assert math.degrees(width) == pytest.approx(42.6, abs=0.05)
    centres = sector_centres(Y.r_s, Y.L_ls, W)
    for _ in range(500):
        k, gamma = int(rng.integers(3)), rng.uniform(0.001, 0.95)
        shares = np.zeros(3)
        shares[k] = gamma * rng.choice([-1, 1])
        g_c = fault_coefficient(
            shares, Y.r_s, Y.L_ls, W, connection=connection, kappa_c=rng.uniform(),
            r_f=rng.choice([0.0, 10 ** rng.uniform(-4, 3)]),
        )  # fmt: skip
        angle = float(np.angle(g_hat_of_phase(g_c, k)))
        assert -1e-12 <= angle <= width + 1e-12
        off = np.abs(np.angle(g_c * np.exp(-1j * centres)))
        assert np.argmin(off) == k
        assert off[k] <= width / 2 + 1e-9
        assert np.sort(off)[1] >= 2 * math.pi / 3 - width / 2 - 1e-9
    # both edges are reached
    edges = [
        float(np.angle(g_hat_of_phase(
            fault_coefficient([gamma, 0, 0], Y.r_s, Y.L_ls, W, connection=connection, r_f=r_f), 0)))
        for gamma, r_f in ((0.1, 0.0), (0.1, 1e4))
    ]  # fmt: skip
    assert edges == pytest.approx([0.0, width], abs=1e-3)


@pytest.mark.parametrize("motor", [Y, DELTA], ids=["Y", "delta"])
@pytest.mark.parametrize("gamma", [0.005, 0.05, 0.3])
def test_size_does_not_depend_on_the_leakage(motor, gamma):
    connection = motor.connection
    for k, kappa_c in ((0, 0.0), (1, 0.37), (2, 1.0)):
        short = phase_short(k, gamma, kappa_c=kappa_c)
        v = 300j
        n = steady_model(motor, short, v, W, 300.0)  # a measurement, not the closed form
        g_c = n / np.conj(v / stator_impedance(motor.r_s, motor.L_ls, W))
        Y_f = fault_admittance(g_hat_of_phase(g_c, k), motor.r_s, motor.L_ls, W)
        assert gamma_R(Y_f, motor.r_s, connection) == pytest.approx(gamma, rel=1e-9)
        offset, inductive = (2 / 3, gamma / 3) if connection == "Y" else (1.0, 0.0)
        impedance = 1 / complex(Y_f)
        assert impedance.real == pytest.approx((1 / gamma - offset) * motor.r_s, rel=1e-9)
        assert impedance.imag == pytest.approx(
            W * motor.L_ls * (kappa_c * (1 - gamma) + inductive) / gamma, rel=1e-9, abs=1e-9 * abs(impedance)
        )
        # an error of r_s comes back one to one for a small short
        assert gamma_R(Y_f, 1.1 * motor.r_s, connection) == pytest.approx(1.1 * gamma, rel=0.04)


def test_contact_resistance_hides_turns_but_never_adds_them():
    for motor in (Y, DELTA):
        for r_f in (0.01, 0.25, 3.0):
            short = phase_short(1, 0.05, r_f=r_f, kappa_c=0.6)
            g_c = fault_coefficient(
                short.gamma, motor.r_s, motor.L_ls, W, connection=motor.connection, r_f=r_f, kappa_c=0.6
            )
            Y_f = complex(fault_admittance(g_hat_of_phase(g_c, 1), motor.r_s, motor.L_ls, W))
            least = float(gamma_R(Y_f, motor.r_s, motor.connection))
            assert least < 0.05
            assert contact_resistance_bound(Y_f, motor.r_s, 0.05, motor.connection) == pytest.approx(r_f, rel=1e-9)
            assert contact_resistance_bound(Y_f, motor.r_s, least, motor.connection) == pytest.approx(0.0, abs=1e-12)
            with pytest.raises(ParameterError, match="below the equivalent bolted short"):
                contact_resistance_bound(Y_f, motor.r_s, 0.9 * least, motor.connection)
    # r_f = 5 gamma ohm: about half of the turns (the caveat of every size)
    Z = loop_impedance([0.05, 0, 0], Y.r_s, Y.L_ls, W, connection="Y", r_f=0.25)
    g = 0.05**2 / complex(Z) * stator_impedance(Y.r_s, Y.L_ls, W)
    assert gamma_R(fault_admittance(g, Y.r_s, Y.L_ls, W), Y.r_s, "Y") == pytest.approx(0.05 / (1 + 5 / Y.r_s), rel=1e-9)


def test_loops_between_two_phases_have_an_angle_of_their_own():
    """The angle follows the square of the loop's space vector: a tap-to-tap loop lies between its two phases."""
    between = fault_coefficient([0.1, -0.1, 0], Y.r_s, Y.L_ls, W, connection="Y")
    assert math.degrees(np.angle(between)) == pytest.approx(-60.0, abs=1e-9)
    # phases a and b: 0 and -120 degrees
    assert [round(math.degrees(one)) for one in np.angle(PHASE_AXES**2)] == [0, -120, 120]
    # the same direction through both looks like phase c
    same = fault_coefficient([0.1, 0.1, 0], Y.r_s, Y.L_ls, W, connection="delta")
    assert math.degrees(np.angle(same)) == pytest.approx(120.0, abs=1e-9)
    assert fault_coefficient([0.0, 0, 0], Y.r_s, Y.L_ls, W, connection="delta") == 0
    assert abs(fault_coefficient([0.1, 0.1, 0.1], Y.r_s, Y.L_ls, W, connection="Y")) < 1e-15


def test_arrays_broadcast():
    gammas = np.zeros((4, 3))
    gammas[:, 1] = [0.0, 0.01, 0.02, 0.05]
    g_c = fault_coefficient(gammas, Y.r_s, Y.L_ls, W, connection="Y", kappa_c=np.array([0.0, 1.0, 0.5, 0.2]))
    found = gamma_R(fault_admittance(g_hat_of_phase(g_c, 1), Y.r_s, Y.L_ls, W), Y.r_s, "Y")
    np.testing.assert_allclose(found, gammas[:, 1], rtol=1e-12, atol=0)


def call(function, *args, **options):
    return lambda: function(*args, **options)


@pytest.mark.parametrize(
    ("what", "message"),
    [
        (call(g_of_gamma, 1.2, "Y"), r"gamma = 1.2 -: must be >= 0 and <= 1"),
        (call(g_of_gamma, math.nan, "Y"), "gamma = nan"),
        (call(g_of_gamma, 1.0, "delta"), "less than 1"),
        (call(g_of_gamma, 0.1, "star"), 'must be "Y" or "delta"'),
        (call(gamma_of_g, -0.1, "Y"), "g = -0.1"),
        (call(phi_z, 0.0, 0.01, W), "r_s = 0 ohm: must be > 0"),
        (call(phi_z, 4.0, -0.01, W), "L_ls = -0.01 H"),
        (call(phi_z, 4.0, 0.01, math.inf), "omega_s = inf"),
        (call(g_hat_of_phase, 0.1, 3), "phase = 3"),
        (call(g_hat_of_phase, complex(math.nan, 0), 0), "g_c holds a value that is not finite"),
        (call(fault_admittance, math.inf, 4.0, 0.01, W), "g_hat holds"),
        (call(gamma_R, -0.01 + 0.01j, 4.0, "Y"), "positive real part"),
        (call(loop_impedance, [0.1, 0.1], 4.0, 0.01, W, connection="Y"), "signed shares"),
        (call(loop_impedance, [0.1, 0, 2.0], 4.0, 0.01, W, connection="Y"), "signed shares"),
        (call(loop_impedance, [0.1, 0, 0], 4.0, 0.01, W, connection="Y", r_f=-1.0), "r_f = -1 ohm"),
        (call(loop_impedance, [0.1, 0, 0], 4.0, 0.01, W, connection="Y", kappa_c=2.0), "kappa_c = 2"),
        (call(fault_coefficient, [1.0, 0, 0], 4.0, 0.01, W, connection="delta"), "raise r_f"),
        (call(contact_resistance_bound, 0.01, 4.0, 0.0, "Y"), "gamma = 0"),
    ],
)  # fmt: skip
def test_refusals(what, message):
    with pytest.raises(ParameterError, match=message):
        what()
