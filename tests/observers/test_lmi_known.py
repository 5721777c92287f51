"""Thesis 5.2.2, B.2: matrix inequalities with known answers, both sides of the bound."""

import math

import numpy as np
import pytest

from pumplib.observers import (
    InaccurateError,
    InfeasibleError,
    Scaling,
    bisect,
    largest_decay_rate,
    lyapunov_certificate,
    observer_gain,
    refute_decay_rate,
)

UNIT = Scaling(time=1.0, state=np.ones(2), output=np.ones(1))
NEAR = 1e-3


def zelentsovsky(k):
    """x'' + x' + (2 + k(t)) x = 0 with 0 <= k(t) <= k."""
    return np.array([[[0, 1], [-2, -1]], [[0, 1], [-2 - k, -1]]], dtype=float)


class TestHiddenMode:
    """y = x1 does not see x2: no gain makes the error faster than that mode."""

    A, C, bound = np.array([[-1.0, 0.0], [4.0, -3.0]]), [[1.0, 0.0]], 3.0

    def test_below(self):
        gain, certificate = observer_gain(self.A, self.C, decay_rate=self.bound * (1 - NEAR))
        assert self.bound * (1 - NEAR) <= certificate.decay < self.bound
        assert certificate.eigen_rates[0] >= certificate.decay
        np.testing.assert_allclose(gain.at()[1, 0], 4.0 * (1 - NEAR), rtol=5e-3)  # decouples the hidden mode

    def test_above(self):
        with pytest.raises(InfeasibleError, match=r"decay rate 3\.003 1/s.*vertex 0 has the mode -3 1/s.*measure"):
            observer_gain(self.A, self.C, decay_rate=self.bound * (1 + NEAR))
        proof = refute_decay_rate(self.A, self.C, decay_rate=self.bound * (1 + NEAR))
        assert proof.slack > 0
        assert proof.gain_limit > 1e9

    def test_on_the_edge_nothing_is_claimed(self):
        with pytest.raises(InaccurateError, match="close to the edge"):
            observer_gain(self.A, self.C, decay_rate=self.bound)

    def test_bracket(self):
        found = largest_decay_rate(self.A, self.C, rtol=1e-5)
        assert found.low < self.bound < found.high
        assert found.high - found.low < 5e-5
        assert found.found[1].decay >= found.low


class TestDoubleIntegrator:
    """y = x1, I <= P <= kappa I: by elimination alpha <= -p12/p22, at most (kappa - 1)/(2 sqrt(kappa))."""

    A, C = np.array([[0.0, 1.0], [0.0, 0.0]]), [[1.0, 0.0]]

    @pytest.mark.parametrize("kappa", [9.0, 100.0])
    def test_both_sides(self, kappa):
        bound = (kappa - 1) / (2 * math.sqrt(kappa))
        _, certificate = observer_gain(self.A, self.C, decay_rate=bound * (1 - NEAR), kappa=kappa, scaling=UNIT)
        assert certificate.decay >= bound * (1 - NEAR)
        with pytest.raises(InfeasibleError, match=r"exclude every P.*raise kappa"):
            observer_gain(self.A, self.C, decay_rate=bound * (1 + NEAR), kappa=kappa, scaling=UNIT)
        found = largest_decay_rate(self.A, self.C, kappa=kappa, scaling=UNIT, rtol=1e-5)
        assert found.low < bound < found.high
        assert found.high / found.low < 1 + 3e-5


class TestCircleCriterion:
    """A common quadratic Lyapunov function of A and A - k b c exists iff Re G(jw) > -1/k for all w."""

    def test_zelentsovsky_three_routes(self):
        bound = 1 + 2 * math.sqrt(2)  # from min Re G at w^2 = 2 + sqrt(2)
        w = np.sqrt(np.linspace(0, 50, 2_000_001))
        assert -1 / np.min((1 / (2 - w**2 + 1j * w)).real) == pytest.approx(bound, rel=1e-9)

        # Shorten and Narendra (2003): A1 A2 must have no negative real eigenvalue; the discriminant vanishes there
        def product(k):
            return np.linalg.eigvals(zelentsovsky(k)[0] @ zelentsovsky(k)[1])

        assert np.abs(product(bound * (1 - NEAR)).imag).min() > 0
        below = product(bound * (1 + NEAR))
        assert np.isreal(below).all()
        assert (below.real < 0).all()

        certificate = lyapunov_certificate(zelentsovsky(bound * (1 - NEAR)))
        assert certificate.decay > 0
        with pytest.raises(InfeasibleError, match=r"2 vertices.*exclude every P.*every vertex alone may be feasible"):
            lyapunov_certificate(zelentsovsky(bound * (1 + NEAR)))
        found = bisect(
            lambda k: lyapunov_certificate(zelentsovsky(k)),
            lambda k: refute_decay_rate(zelentsovsky(k), decay_rate=0.0, kappa=1e6),
            3.0,
            5.0,
            rtol=1e-4,
        )
        assert found.low < bound < found.high
        assert found.high - found.low < 1e-3

    def test_third_order(self):
        """G = 1/(s + 1)^3: min Re G from its frequency response, the bound from the LMI."""
        A = np.array([[-1.0, 1, 0], [0, -1, 1], [0, 0, -1]])
        b, c = np.array([[0.0], [0], [1]]), np.array([[1.0, 0, 0]])
        w = np.linspace(0, 10, 1_000_001)
        bound = -1 / np.min(((1 + 1j * w) ** -3).real)

        def family(k):
            return np.stack([A, A - k * b @ c])

        assert lyapunov_certificate(family(bound * (1 - NEAR))).decay > 0
        proof = refute_decay_rate(family(bound * (1 + NEAR)), decay_rate=0.0, kappa=1e6)
        assert proof.slack > 0


def test_ando_shih_discrete():
    """Ando and Shih (1998): the best common norm of a P contracts this pair by s sqrt(2), no better (delta form)."""
    pair, h = np.array([[[1.0, 0], [1, 0]], [[0, 1], [0, -1]]]), 0.1
    for s, feasible in ((1 - NEAR, True), (1 + NEAR, False)):
        A = (s * 0.9 / math.sqrt(2) * pair - np.eye(2)) / h  # |Phi|_P = 0.9 s
        rate = (1 - 0.9) / h
        if feasible:
            certificate = lyapunov_certificate(A, form="delta", h=h, decay_rate=rate)
            assert rate <= certificate.decay <= (1 - 0.9 * s) / h
        else:
            with pytest.raises(InfeasibleError, match="delta form"):
                lyapunov_certificate(A, form="delta", h=h, decay_rate=rate)
            assert refute_decay_rate(A, form="delta", h=h, decay_rate=rate, kappa=1e6).slack > 0


def test_normal_matrix_decays_as_its_slowest_eigenvalue():
    found = largest_decay_rate(np.diag([-2.0, -5.0]), rtol=1e-4)
    assert found.low <= 2.0 <= found.high
    assert found.high - found.low < 3e-4


def test_everything_measured_has_no_bound():
    found = largest_decay_rate(np.array([[1.0, 2], [3, -1]]), np.eye(2), limit=50.0)
    assert found.low == pytest.approx(50.0)
    assert found.high == math.inf
    assert found.refutation is None
