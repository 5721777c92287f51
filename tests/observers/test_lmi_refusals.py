"""Thesis B.2: what is wrong is refused with its name, place and remedy; what does not verify is never used."""

import subprocess
import sys

import numpy as np
import pytest

from pumplib.errors import ParameterError, PumplibError
from pumplib.observers import (
    Gain,
    InaccurateError,
    InfeasibleError,
    LmiError,
    NotVerifiedError,
    Scaling,
    bisect,
    complex_form,
    largest_decay_rate,
    lmi,
    lmi_solver,
    lyapunov_certificate,
    observer_gain,
    refute_decay_rate,
    structural_gain,
    verify_decay,
)

A2 = np.array([[[0.0, 1.0], [-2.0, -1.0]], [[0.0, 1.0], [-4.0, -1.0]]])
C = np.array([[1.0, 0.0]])


def gain(**changes):
    arguments = {"A": A2, "C": C, "decay_rate": 1.0} | changes
    return observer_gain(**arguments)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"A": np.ones((2, 2, 3))}, r"A has shape \(2, 2, 3\); must be \(k, n, n\)"),
        ({"A": np.ones(3)}, r"A has shape \(3,\)"),
        ({"A": np.zeros((0, 2, 2))}, "at least one square matrix"),
        ({"A": [[[1, 2], [3, 4]], [[1, 2]]]}, "A is not an array of numbers of one shape"),
        ({"A": np.where(A2 == -4, np.nan, A2)}, r"A\[1, 1, 0\] = nan; every entry must be finite"),
        ({"A": "abc"}, "observer_gain: A"),
        ({"C": np.ones((1, 3))}, r"C has shape \(1, 3\); must be \(any, 2\)"),
        ({"C": np.zeros((0, 2))}, "C has no row"),
        ({"C": [[np.inf, 0]]}, r"C\[0, 0\] = inf"),
        ({"decay_rate": -1.0}, r"decay_rate = -1\.0 1/s; must be a real number >= 0"),
        ({"decay_rate": np.nan}, "decay_rate.* = nan; every entry must be finite"),
        ({"decay_rate": [1.0, 2.0]}, r"decay_rate has shape \(2,\)"),
        ({"decay_rate": 1j}, "must be a real number"),
        ({"form": "discrete"}, 'form = \'discrete\'; must be "continuous" or "delta"'),
        ({"form": "delta"}, "needs the sampling interval h"),
        ({"form": "delta", "h": 0.0}, r"h = 0 s; must be > 0 s"),
        ({"form": "delta", "h": 1.0, "decay_rate": 1.0}, "must be below 1/h = 1 1/s"),
        ({"h": 0.1}, "with the continuous form"),
        ({"kappa": 1.0}, "kappa = 1; must be > 1"),
        ({"schedule": "cubic"}, 'must be "constant" or "affine"'),
        ({"schedule": "affine"}, "needs nu"),
        ({"schedule": "affine", "nu": [1.0]}, r"nu has shape \(1, 1\); must be \(2, any\)"),
        ({"dense": np.ones((3, 1, 1))}, r"dense has shape \(3, 1, 1\)"),
        ({"nu_dense": [1.0]}, "nu_dense without dense"),
        ({"schedule": "affine", "nu": [0, 1.0], "dense": A2}, "needs nu_dense"),
        ({"schedule": "affine", "nu": [0, 1.0], "dense": A2, "nu_dense": np.ones((2, 2))}, "nu_dense has 2 parameters"),
        ({"solvers": ("MOSEK",)}, "choose from CLARABEL, SCS"),
        ({"solvers": ()}, "choose from"),
        ({"scaling": Scaling(time=0.0, state=np.ones(2), output=np.ones(1))}, "scaling must be positive"),
        ({"scaling": Scaling(time=1.0, state=np.ones(3), output=np.ones(1))}, r"scaling.state has shape \(3,\)"),
    ],
)
def test_bad_input(changes, message):
    with pytest.raises(ParameterError, match=message):
        gain(**changes)


def test_name_of_the_problem_is_shown():
    with pytest.raises(ParameterError, match="stator gain: decay_rate"):
        gain(decay_rate=-1, name="stator gain")
    assert issubclass(LmiError, PumplibError)


def test_other_bad_input():
    with pytest.raises(ParameterError, match="both C and gain"):
        verify_decay(np.eye(2), A2, C=C)
    with pytest.raises(ParameterError, match=r"P has shape \(3, 3\)"):
        verify_decay(np.eye(3), A2)
    scheduled = Gain(K=(np.ones((2, 1)), np.ones((2, 1))), low=np.array([-1.0]), high=np.array([1.0]))
    with pytest.raises(ParameterError, match="scheduled; give nu"):
        verify_decay(np.eye(2), A2, C=C, gain=scheduled)
    with pytest.raises(ParameterError, match="low < high"):
        bisect(lambda _: None, lambda _: None, 2.0, 1.0)
    with pytest.raises(ParameterError, match="at least one A_i or B_i"):
        structural_gain(A2, C, [])
    with pytest.raises(ParameterError, match="even"):
        complex_form(np.eye(3))


def test_gain_refuses_what_was_not_verified():
    scheduled = Gain(K=(np.ones((2, 1)), np.eye(2)[:, :1]), low=np.array([-1.0]), high=np.array([1.0]))
    assert scheduled.at(0.5).shape == (2, 1)
    assert scheduled.at([0.5, -1.0, 1.0]).shape == (3, 2, 1)
    np.testing.assert_array_equal(scheduled.at(0.5), [[1.5], [1.0]])
    with pytest.raises(ParameterError, match=r"nu\[0\] = 1.1 is outside -1 to 1.*wider range"):
        scheduled.at([0.0, 1.1])
    with pytest.raises(ParameterError, match="nan is outside"):
        scheduled.at(np.nan)
    two = Gain(K=(np.ones((2, 1)),) * 3, low=-np.ones(2), high=np.ones(2))
    assert two.at([0.5, 0.5]).shape == (2, 1)
    with pytest.raises(ParameterError, match=r"nu has shape \(3,\)"):
        two.at([0.1, 0.2, 0.3])


def test_unobservable_unstable_mode_is_named():
    A = np.array([np.diag([-1.0, -2.0]), [[-1.0, 0.0], [0.0, 0.7]]])
    with pytest.raises(InfeasibleError, match=r"vertex 1 has the mode 0\.7 1/s.*no output sees it.*detectability"):
        observer_gain(A, C, decay_rate=0.5)
    with pytest.raises(
        InfeasibleError, match=r"vertex 1 has the mode 0\.7 1/s, which decays at -0\.7 1/s; it is slower"
    ):
        lyapunov_certificate(A)
    complex_mode = np.diag([-1.0, -0.5 + 3j])
    with pytest.raises(InfeasibleError, match=r"vertex 0 has the mode -0\.5\+3j 1/s"):
        observer_gain(complex_mode, C, decay_rate=0.6)


def test_wrong_P_is_refused():
    good = lyapunov_certificate(A2)
    assert verify_decay(good.P, A2).decay == pytest.approx(good.decay)
    with pytest.raises(NotVerifiedError, match=r"proves a decay rate of -1.* 1/s, not the 0 1/s.*number 1.*narrow"):
        verify_decay(np.eye(2), A2)
    with pytest.raises(NotVerifiedError, match="not positive definite"):
        verify_decay(np.diag([1.0, -1.0]), A2)
    with pytest.raises(NotVerifiedError, match="not positive definite"):
        verify_decay(np.zeros((2, 2)), A2)
    with pytest.raises(NotVerifiedError, match="not Hermitian"):
        verify_decay(good.P + np.array([[0, 1e-6], [0, 0]]), A2)
    with pytest.raises(NotVerifiedError, match="proves a decay rate"):
        verify_decay(good.P, A2, decay_rate=good.decay * (1 + 1e-6))
    # a wrong gain with the right P
    found, certificate = gain(decay_rate=3.0)
    assert verify_decay(certificate.P, A2, decay_rate=3.0, C=C, gain=found).decay >= 3.0
    with pytest.raises(NotVerifiedError):
        verify_decay(certificate.P, A2, decay_rate=3.0, C=C, gain=0.9 * found.at())


@pytest.mark.parametrize("status", ["optimal", "optimal_inaccurate"])
def test_perturbed_solver_result_is_refused(monkeypatch, status):
    def spoilt(problem, blocks, goal, solver):
        found = lmi_solver.propose(problem, blocks, goal, solver)
        x = found.x.copy()
        x[len(blocks.basis) :] *= 0.5
        return lmi_solver.Proposal(x=x, value=found.value, multipliers=[], solver=solver, status=status)

    monkeypatch.setattr(lmi, "propose", spoilt)
    with pytest.raises(NotVerifiedError, match=rf"observer_gain: decay rate 3 1/s.*status {status}.*is not verified"):
        gain(decay_rate=3.0)


def test_indefinite_solver_result_is_refused(monkeypatch):
    def spoilt(problem, blocks, goal, solver):
        found = lmi_solver.propose(problem, blocks, goal, solver)
        return lmi_solver.Proposal(x=-found.x, value=0.0, multipliers=[], solver=solver, status="optimal")

    monkeypatch.setattr(lmi, "propose", spoilt)
    with pytest.raises(NotVerifiedError, match="P is not positive definite"):
        gain(decay_rate=3.0)


def test_solver_that_gives_up_is_explained(monkeypatch):
    def silent(problem, blocks, goal, solver):
        return lmi_solver.Proposal(x=None, value=np.nan, multipliers=[], solver=solver, status="solver error: stalled")

    monkeypatch.setattr(lmi, "propose", silent)
    with pytest.raises(InaccurateError, match=r"solver SCS, status solver error: stalled.*neither solved nor refuted"):
        gain(decay_rate=3.0)


def test_inaccurate_status_is_accepted_only_with_certificate(monkeypatch):
    def doubtful(problem, blocks, goal, solver):
        found = lmi_solver.propose(problem, blocks, goal, solver)
        return lmi_solver.Proposal(x=found.x, value=0.0, multipliers=[], solver=solver, status="optimal_inaccurate")

    monkeypatch.setattr(lmi, "propose", doubtful)
    certificate = gain(decay_rate=3.0)[1]
    assert certificate.status == "optimal_inaccurate"
    assert certificate.decay >= 3.0


def test_second_solver_is_named(monkeypatch):
    def first_fails(problem, blocks, goal, solver):
        if solver == "CLARABEL":
            return lmi_solver.Proposal(x=None, value=np.nan, multipliers=[], solver=solver, status="solver error: none")
        return lmi_solver.propose(problem, blocks, goal, solver)

    monkeypatch.setattr(lmi, "propose", first_fails)
    assert gain(decay_rate=1.0)[1].solver == "SCS"


def test_multipliers_are_checked(monkeypatch):
    """A feasible problem cannot be refuted, and wrong multipliers refute nothing."""
    with pytest.raises(InaccurateError, match="prove nothing"):
        refute_decay_rate(A2, decay_rate=0.0)
    unstable = np.array([[0.5, 0.0], [0.0, -1.0]])
    proof = refute_decay_rate(unstable, decay_rate=0.0)
    Z = proof.multipliers[0]  # <Z, -(P A + A' P)> < 0 for every P >= 0, by hand
    assert np.linalg.eigvalsh(Z)[0] >= -1e-12
    assert np.linalg.eigvalsh(unstable @ Z + Z @ unstable.T)[0] > -1e-6

    problem = lmi.family("x", unstable, None, None, "constant", "continuous", None, 0.0, 100.0)
    blocks = lmi.decay_blocks(problem)
    good = lmi_solver.refutation(problem, blocks, [np.diag([1.0, 0.0])], "hand", "exact")
    assert good.slack == pytest.approx(1.0)  # -(P A + A' P) has the corner -P_11, at most -1
    for wrong in (np.diag([0.0, 1.0]), np.zeros((2, 2)), -np.eye(2)):
        with pytest.raises(InaccurateError):
            lmi_solver.refutation(problem, blocks, [wrong], "hand", "exact")
    with pytest.raises(InaccurateError, match="gave no multipliers"):
        lmi_solver.refutation(problem, blocks, [], "hand", "none")


def test_largest_rate_of_an_unstable_system_is_refused():
    with pytest.raises(InfeasibleError, match=r"mode 0\.5 1/s"):
        largest_decay_rate(np.diag([0.5, -1.0]))


def test_cvxpy_is_imported_only_when_needed():
    code = "import sys, pumplib.observers; sys.exit('cvxpy' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
