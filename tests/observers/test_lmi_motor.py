"""Thesis 5.2.2: the gains that chapter 5 needs: reference motor, 150-340 rad/s, delta form at 100 us."""

import importlib.util
import math
import time
from pathlib import Path

import numpy as np
import pytest

from pumplib.observers import (
    InfeasibleError,
    Scaling,
    complex_form,
    largest_decay_rate,
    observer_gain,
    real_form,
    structural_gain,
    verify_decay,
)

spec = importlib.util.spec_from_file_location("motor_model", Path(__file__).with_name("motor_model.py"))
model = importlib.util.module_from_spec(spec)
spec.loader.exec_module(model)
C, STEP = model.C, model.STEP
NU, VERTICES = model.grid(5)
NU_DENSE, DENSE = model.grid(201)
TEN_MS = Scaling(time=0.01, state=np.ones(2), output=np.ones(1))


def design(rate, schedule="affine", **options):
    return observer_gain(
        VERTICES, C, decay_rate=rate, form="delta", h=STEP, nu=NU, schedule=schedule, dense=DENSE, nu_dense=NU_DENSE,
        **options,
    )  # fmt: skip


@pytest.mark.parametrize("schedule", ["constant", "affine"])
@pytest.mark.parametrize("rate", [40.0, 60.0, 160.0, 400.0, 800.0])
def test_certificate_on_201_speeds(rate, schedule):
    gain, certificate = design(rate, schedule)
    assert certificate.points == 201
    assert not gain.scheduled or (gain.low[0], gain.high[0]) == (-1.0, 1.0)
    assert rate <= certificate.decay < rate * (1 + 1e-3)
    assert certificate.rounding < 1e-8
    assert certificate.between < 1e-2
    assert certificate.condition < 20
    # independent of the certificate's own route: Cholesky coordinates by eigenvectors, singular values by hand
    values, vectors = np.linalg.eigh(certificate.P)
    root = vectors * np.sqrt(values) @ vectors.conj().T
    for nu, A in zip(NU_DENSE, DENSE, strict=True):
        step = np.eye(2) + STEP * (A - gain.at(nu) @ C)
        size = np.linalg.norm(root @ step @ np.linalg.inv(root), 2)
        assert size <= 1 - STEP * rate
        assert np.abs(np.linalg.eigvals(step)).max() <= size * (1 + 1e-12)


def test_gain_in_the_units_of_the_specification():
    """States as they are, time in 10 ms, P <= 100 I: the published gains are about these."""
    largest = [np.abs(design(rate, scaling=TEN_MS, kappa=100.0)[0].K[0]).max() for rate in (40.0, 160.0)]
    assert largest == pytest.approx([272, 440], rel=0.1)
    largest = [np.abs(design(rate, "constant", scaling=TEN_MS)[0].K[0]).max() for rate in (400.0, 800.0)]
    assert largest == pytest.approx([1090, 2614], rel=1e-3)
    # scaling the states as well gives the same rate with a gain five times smaller
    assert np.abs(design(60.0)[0].K[0]).max() < 0.25 * np.abs(design(60.0, scaling=TEN_MS, kappa=100.0)[0].K[0]).max()


def test_schedule_is_not_needed_at_60():
    constant, affine = design(60.0, "constant")[0], design(60.0)[0]
    assert np.abs(affine.K[1]).max() < 1e-3
    np.testing.assert_allclose(affine.K[0], constant.K[0], rtol=1e-3, atol=1e-2)


def test_solve_is_quick_after_import():
    design(60.0)
    start = time.perf_counter()
    for _ in range(3):
        design(60.0)
    assert (time.perf_counter() - start) / 3 < 0.5  # 35 ms on an idle machine


def test_continuous_range_needs_two_vertices():
    """The continuous motor is affine in the speed: two vertices, verified between them."""
    ends = np.stack([model.system(150.0), model.system(340.0)])
    gain, certificate = observer_gain(ends, C, decay_rate=60.0)
    between = np.stack([model.system(w) for w in np.linspace(150, 340, 201)])
    dense = verify_decay(certificate.P, between, decay_rate=60.0, C=C, gain=gain, dense=True)
    assert dense.decay >= 60.0
    assert dense.between == 0.0


def test_real_and_complex_problem_agree():
    """Reduction lemma: the real 4 x 4 problem reaches what the complex 2 x 2 one does."""
    ends = np.stack([model.system(150.0), model.system(340.0)])
    unit = Scaling(time=0.01, state=np.ones(2), output=np.ones(1))
    twice = Scaling(time=0.01, state=np.ones(4), output=np.ones(2))
    gain, one = observer_gain(ends, C, decay_rate=60.0, scaling=unit)
    real_gain, two = observer_gain(real_form(ends), real_form(C), decay_rate=60.0, scaling=twice)
    assert real_form(gain.at()).shape == real_gain.at().shape
    # the average over rotations of the real solution is a complex solution of the same gain
    averaged = complex_form(two.P)
    K = np.linalg.solve(averaged, complex_form(two.P @ real_gain.at()))
    assert verify_decay(averaged, ends, decay_rate=60.0, C=C, gain=K).decay >= 60.0
    assert verify_decay(real_form(one.P), real_form(ends), C=real_form(C), gain=real_form(gain.at()), decay_rate=60.0)
    size = [np.linalg.norm(one.P @ gain.at()), np.linalg.norm(two.P @ real_gain.at()) / math.sqrt(2)]
    assert size[1] == pytest.approx(size[0], rel=1e-4)  # the same optimum
    # and both stop at the same rate
    small = dict(kappa=30.0, rtol=1e-3)
    a = largest_decay_rate(ends, C, scaling=unit, **small)
    b = largest_decay_rate(real_form(ends), real_form(C), scaling=twice, **small)
    assert max(a.low, b.low) < min(a.high, b.high)
    assert a.high / a.low < 1 + 2e-3


def test_gain_does_not_depend_on_units():
    d, s, t = np.array([1e3, 1e-4]), 20.0, 1e-3  # states, output and time in other units
    gain, one = design(60.0)
    scaled = lambda A: t * A * d[None, :] / d[:, None]  # noqa: E731
    other, two = observer_gain(
        scaled(VERTICES), C * d[None, :] / s, decay_rate=60.0 * t, form="delta", h=STEP / t, nu=NU, schedule="affine",
        dense=scaled(DENSE), nu_dense=NU_DENSE,
    )  # fmt: skip
    np.testing.assert_allclose(other.K[0] * d[:, None] / s / t, gain.K[0], rtol=1e-3, atol=1e-3)
    assert two.decay / t == pytest.approx(one.decay, rel=1e-5)
    assert two.condition == pytest.approx(one.condition, rel=1e-3)


def test_infeasible_rate_is_refuted():
    """With P bounded tightly the rate is limited; the message says what would help."""
    with pytest.raises(InfeasibleError, match=r"800 1/s.*delta form, 5 vertices.*exclude every P.*raise kappa"):
        design(800.0, kappa=10.0)


class TestStructure:
    """The direct adaptive observer of chapter 5."""

    slope = model.system(1.0) - model.system(0.0)
    ends = np.stack([model.system(150.0), model.system(340.0)])
    q = model.MOTOR.r_s / model.MOTOR.L_ls

    def extended(self, omega):
        A = np.zeros((3, 3), dtype=complex)
        A[:2, :2], A[2, 2] = model.system(omega), -self.q
        return A

    @pytest.mark.parametrize("scaling", [None, TEN_MS])
    def test_speed_is_never_strictly_feasible(self, scaling):
        found = structural_gain(self.ends, C, [self.slope], scaling=scaling, name="motor speed")
        assert found.verdict == "boundary"
        assert found.freedom == 2  # q1 |i|^2 + q2 |psi_s|^2
        assert found.definite > 0.05
        assert -1e-12 < found.margin <= found.margin_bound < 1e-12
        assert found.residual < 1e-14
        assert "never strictly feasible" in found.explanation
        assert found.gain is None
        np.testing.assert_allclose(found.P @ self.slope, C.conj().T @ found.F[0], atol=1e-12 * np.abs(found.P).max())
        # P is q1 |i|^2 + q2 |L_s' i + L_m' i_m|^2
        ratio = found.P[0, 1] / found.P[1, 1]
        assert ratio == pytest.approx(model.MOTOR.L_s_prime / model.MOTOR.L_m_prime, rel=1e-9)

    def test_known_boundary_gain_reaches_it(self):
        """The scheduled gain of the closed form makes the error energy fall, at rate zero at best."""
        m = model.MOTOR
        found = structural_gain(self.ends, C, [self.slope], name="motor speed")
        # e^H P e = q1 |e_i|^2 + q2 |L_s' e_i + L_m' e_m|^2; the closed form wants mu = q1/q2
        q2 = (found.P[1, 1] / m.L_m_prime**2).real
        mu = (found.P[0, 0].real - q2 * m.L_s_prime**2) / q2
        for omega in (150.0, 245.0, 340.0):
            c = (m.R_r_prime - 1j * omega * m.L_m_prime) / (m.L_s_prime * m.L_m_prime)
            k1, k_psi = 200.0, mu * np.conj(c) - m.r_s
            M = model.system(omega) - np.array([[k1], [(k_psi - m.L_s_prime * k1) / m.L_m_prime]]) @ C
            rate = found.P @ M
            values = np.linalg.eigvalsh(rate + rate.conj().T)
            assert values[-1] < 1e-12 * abs(values[0])

    def test_speed_and_fault_current_have_no_definite_P(self):
        A = np.stack([self.extended(150.0), self.extended(340.0)])
        found = structural_gain(
            A, [[1, 0, 1]], [self.extended(1.0) - self.extended(0.0)], [[[0], [0], [1 / model.MOTOR.L_ls]]], name="both"
        )
        assert found.verdict == "infeasible"
        assert abs(found.definite) < 1e-12
        assert found.definite_bound < 1e-7
        assert "singular" in found.explanation
        assert found.gain is None

    def test_fault_current_alone_is_strictly_feasible(self):
        A = np.stack([self.extended(150.0), self.extended(340.0)])
        B = np.array([[0], [0], [1 / model.MOTOR.L_ls]])
        out = np.array([[1.0, 0, 1]])
        found = structural_gain(A, out, [], [B], decay_rate=5.0, name="fault")
        assert found.verdict == "strict"
        assert found.definite == pytest.approx((math.sqrt(2) - 1) ** 2, rel=1e-6)  # closed form, P13 = P33, P23 = 0
        assert 0 < found.margin <= found.margin_bound
        assert found.certificate.decay >= 5.0
        np.testing.assert_allclose(found.P @ B, out.T @ found.G[0], atol=1e-9 * np.abs(found.P @ B).max())
        again = verify_decay(found.P, A, decay_rate=5.0, C=out, gain=found.gain)
        assert again.decay == pytest.approx(found.certificate.decay)

    def test_too_fast_is_infeasible(self):
        A = np.stack([self.extended(150.0), self.extended(340.0)])
        B = [[0], [0], [1 / model.MOTOR.L_ls]]
        found = structural_gain(A, [[1, 0, 1]], [], [B], decay_rate=500.0, name="fault")
        assert found.verdict == "infeasible"
        assert found.margin_bound < 0
        assert "with decay rate 500 1/s" in found.explanation
