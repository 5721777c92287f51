"""Thesis B.2: on random systems a certificate implies the decay that simulation shows."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import expm

from pumplib.observers import (
    InaccurateError,
    InfeasibleError,
    LmiError,
    lyapunov_certificate,
    observer_gain,
    refute_decay_rate,
    verify_decay,
)


def random_family(seed, n, k, is_complex, spread=0.3):
    rng = np.random.default_rng(seed)
    shape = (k, n, n)
    noise = rng.standard_normal(shape) + (1j * rng.standard_normal(shape) if is_complex else 0)
    base = rng.standard_normal((n, n)) + (1j * rng.standard_normal((n, n)) if is_complex else 0)
    scale = 10.0 ** rng.uniform(-3, 3, n)  # badly scaled states
    return rng, 10.0 ** rng.uniform(-2, 2) * (base + spread * noise) * scale[None, :, None] / scale[None, None, :]


families = {
    "seed": st.integers(0, 10**6), "n": st.integers(1, 4), "k": st.integers(1, 3), "is_complex": st.booleans()
}  # fmt: skip


@given(**families)
@settings(max_examples=25)
def test_certified_gain_makes_switched_error_decay(seed, n, k, is_complex):
    rng, A = random_family(seed, n, k, is_complex)
    C = rng.standard_normal((1, n)) / np.abs(A[0, 0]) + 0.1
    rate = 0.3 * float(np.abs(np.linalg.eigvals(A[0])).max())
    try:
        gain, certificate = observer_gain(A, C, decay_rate=rate)
    except LmiError:
        return
    with pytest.raises(InaccurateError):  # what is certified can never be refuted
        refute_decay_rate(A, C, decay_rate=rate, solvers=("CLARABEL",))
    M = A - gain.at() @ C
    e = rng.standard_normal(n) / np.sqrt(np.diag(certificate.P).real)
    t, start = 0.0, certificate.norm(e)
    for _ in range(20):  # switches at random instants to random systems of the hull
        weights = rng.dirichlet(np.ones(k))
        step = rng.exponential(0.1) / rate
        e = expm(np.einsum("k,kij->ij", weights, M) * step) @ e
        t += step
        assert certificate.norm(e) <= start * np.exp(-rate * t) * (1 + 1e-6)


@given(**families)
@settings(max_examples=15)
def test_certified_delta_form_contracts_every_sample(seed, n, k, is_complex):
    rng, A = random_family(seed, n, k, is_complex, spread=0.1)
    h = 0.5 / float(np.linalg.norm(A * 1.0, 2, axis=(1, 2)).max())
    A = A - np.eye(n) * 2 * np.abs(np.linalg.eigvals(A)).max()  # mostly stable
    try:
        certificate = lyapunov_certificate(A, form="delta", h=h)
    except (InfeasibleError, InaccurateError):
        return
    e = rng.standard_normal(n) / np.sqrt(np.diag(certificate.P).real)
    for _ in range(30):
        before = certificate.norm(e)
        e = e + h * A[rng.integers(k)] @ e
        assert certificate.norm(e) <= before * (1 - h * certificate.decay) * (1 + 1e-9)


@given(seed=st.integers(0, 10**6), n=st.integers(1, 5), is_complex=st.booleans())
@settings(max_examples=50)
def test_rate_is_rounded_to_the_safe_side(seed, n, is_complex):
    """Against 40 decimals: the verified rate is never above the exact one, and close to it."""
    mpmath = pytest.importorskip("mpmath")
    rng = np.random.default_rng(seed)
    F = rng.standard_normal((n, n)) + (1j * rng.standard_normal((n, n)) if is_complex else 0)
    P = F @ F.conj().T + 1e-6 * np.eye(n)
    P = (P + P.conj().T) / 2
    M = rng.standard_normal((n, n)) + (1j * rng.standard_normal((n, n)) if is_complex else 0) - 10 * np.eye(n)
    M = np.linalg.solve(P, M @ P)  # makes the norm of P matter
    try:
        found = verify_decay(P, M)
    except ArithmeticError:
        return
    with mpmath.workdps(40):
        p, m = mpmath.matrix(P.tolist()), mpmath.matrix(M.tolist())
        L = mpmath.cholesky(p)
        inverse = L**-1
        W = L.H * m * inverse.H
        exact = -float(max(mpmath.eighe((W + W.H) / 2, eigvals_only=True)))
    assert found.decay <= exact
    assert exact - found.decay <= 2 * found.rounding + 1e-9 * abs(exact)
