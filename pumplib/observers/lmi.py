"""Thesis 5.2.2, B.2: from a matrix inequality to a gain with a certificate, or to an explained refusal.

A problem is scaled, solved, scaled back and verified outside the solver (`certificate`). A result that does not
verify raises, and so does a problem without solution, with a verified proof (`Refutation`) and a hint at the cause.
"""

from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pumplib.errors import ParameterError
from pumplib.observers.certificate import (
    Certificate,
    Form,
    Gain,
    InaccurateError,
    InfeasibleError,
    LmiError,
    NotVerifiedError,
    certify,
    matrices,
)
from pumplib.observers.lmi_problem import (
    Blocks,
    Family,
    Scaling,
    automatic_scaling,
    decay_blocks,
    family,
    hidden_modes,
    rescaled,
)
from pumplib.observers.lmi_solver import SOLVERS, Proposal, propose, refute

Array = NDArray[Any]
Schedule = Literal["constant", "affine"]
_RESERVE = 1e-6  # added to the decay rate asked of the solver, in scaled units, so that its tolerance does not matter


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Prepared:
    """A problem with its units and the points at which a result is verified.

    Parameters
    ----------
    problem : Family
        In the units of the caller.
    scaling : Scaling
        Units to solve in.
    A : ndarray, shape (N, n, n)
        Systems to verify.
    weights : ndarray, shape (N, 1 + m)
        One and the scheduling parameters of each.
    dense : bool
        Whether they are a dense grid rather than the vertices.
    """

    problem: Family
    scaling: Scaling
    A: Array
    weights: Array
    dense: bool

    def scaled(self, rate: float) -> Family:
        """Scaled problem with another decay rate.

        Parameters
        ----------
        rate : float
            1/s.

        Returns
        -------
        Family
        """
        return rescaled(replace(self.problem, decay_rate=rate), self.scaling)


def check_solvers(name: str, solvers: tuple[str, ...]) -> None:
    """Check the names of the solvers.

    Parameters
    ----------
    name : str
        Name of the problem, shown in errors.
    solvers : tuple of str
        What the caller gave.

    Raises
    ------
    ParameterError
        If there is none or an unknown one.
    """
    unknown = [one for one in solvers if one not in SOLVERS]
    if unknown or not solvers:
        raise ParameterError(f"{name}: solvers = {solvers!r}; choose from {', '.join(SOLVERS)}.")


def _unscaled(ready: Prepared, blocks: Blocks, found: Proposal) -> tuple[Array, Array]:
    """P and the gains K_j of a proposal in the units of the caller."""
    assert found.x is not None
    P = blocks.P(found.x)
    unit = ready.scaling
    K = np.zeros((0, *P.shape))
    if blocks.terms:
        if not np.linalg.eigvalsh(P)[0] > 0:
            raise NotVerifiedError(
                f"{ready.problem.name} (solver {found.solver}, status {found.status}): P is not positive definite."
            )
        K = np.stack([np.linalg.solve(P, Y) for Y in blocks.Y(found.x)])
        K = K * unit.state[:, None] / unit.output[None, :] / unit.time
    return P / np.outer(unit.state, unit.state), K


def _verified(ready: Prepared, P: Array, K: Array, rate: float, solver: str, status: str) -> Certificate:
    problem = ready.problem
    gains = np.einsum("kj,jnp->knp", ready.weights, K) if len(K) else np.zeros((1, *problem.C.T.shape))
    return certify(
        P,
        ready.A - gains @ problem.C,
        decay_rate=rate,
        form=problem.form,
        h=problem.h,
        name=problem.name,
        magnitude=np.abs(ready.A) + np.abs(gains) @ np.abs(problem.C),
        dense=ready.dense,
        solver=solver,
        status=status,
    )


def solve_prepared(
    ready: Prepared, solvers: tuple[str, ...], basis: Array | None = None
) -> tuple[Array, Array, Certificate]:
    """Solve and verify a prepared problem.

    Parameters
    ----------
    ready : Prepared
        The problem.
    solvers : tuple of str
        Tried in turn.
    basis : ndarray, shape (d, n, n), optional
        Basis of P in scaled units; all Hermitian matrices by default.

    Returns
    -------
    P : ndarray, shape (n, n)
        In the units of the caller.
    K : ndarray, shape (1 + m, n, p)
        Gains; empty where the problem has no output.
    certificate : Certificate

    Raises
    ------
    InfeasibleError, InaccurateError, NotVerifiedError
        With the cause, the proof and the remedy.
    """
    error: LmiError
    for solver in solvers:
        solved, said, wrong = _attempts(ready, solver, basis)
        if solved is not None:
            return solved
        error = _explained(ready, solver, said, wrong, basis)
        if isinstance(error, InfeasibleError) or said.endswith("status infeasible"):
            break  # another solver would not change it
    raise error


def _attempts(
    ready: Prepared, solver: str, basis: Array | None
) -> tuple[tuple[Array, Array, Certificate] | None, str, str]:
    """Solution by one solver, what the solver said, and what was wrong; asks for more where the rate falls short."""
    problem, unit = ready.problem, ready.scaling.time
    rate = problem.decay_rate
    reserve, said, wrong = _RESERVE / unit, f"solver {solver} not called", ""
    for _ in range(4):
        asked = rate + reserve
        if problem.h * asked >= 1:
            break
        scaled = ready.scaled(asked)
        blocks = decay_blocks(scaled, basis)
        found = propose(scaled, blocks, "gain" if blocks.terms else "condition", solver)
        said = f"solver {solver}, status {found.status}"
        if found.x is None:
            break
        try:
            P, K = _unscaled(ready, blocks, found)
            proven = _verified(ready, P, K, -np.inf, solver, found.status)
        except NotVerifiedError as error:
            return None, said, str(error)
        if proven.decay >= rate and proven.decay > 0:
            return (P, K, replace(proven, decay_rate=rate)), said, wrong
        wrong = f"it proves {proven.decay:.6g} 1/s, {proven.rates.min():.6g} 1/s at the points"
        reserve += 1.5 * (rate - proven.decay)
    return None, said, wrong


def _explained(
    ready: Prepared, solver: str, said: str, wrong: str, basis: Array | None
) -> InfeasibleError | InaccurateError | NotVerifiedError:
    """The error of a problem without verified solution: cause, proof and remedy."""
    problem, unit = ready.problem, ready.scaling.time
    rate = problem.decay_rate
    asked = f"{problem.name}: decay rate {rate:.6g} 1/s ({problem.form} form, {len(problem.A)} vertices, {said})"
    for mode in hidden_modes(ready.scaled(rate)):
        if mode.decay / unit < rate * (1 - 1e-9):
            value = mode.eigenvalue / unit
            text = f"{value.real:.6g}" if abs(value.imag) < 1e-9 * abs(value) else f"{value:.6g}"
            source = "no output sees it and no gain can move it" if len(problem.C) else "it is slower than asked"
            return InfeasibleError(
                f"{asked} is infeasible: vertex {mode.vertex} has the mode {text} 1/s, which decays at "
                f"{mode.decay / unit:.6g} 1/s; {source}. Ask for at most that rate, or measure a quantity that shows "
                "the mode (check detectability at this vertex)."
            )
    scaled = ready.scaled(rate)
    blocks = decay_blocks(scaled, basis)
    try:
        proof = refute(scaled, blocks, (solver,))
    except InaccurateError as error:
        if wrong:
            return NotVerifiedError(
                f"{asked} is not verified: {wrong}. Lower the decay rate, narrow the range of the parameters, "
                "give more vertices, or pass a scaling by hand."
            )
        return InaccurateError(
            f"{asked} is neither solved nor refuted: {error} It lies close to the edge of what is feasible, or is "
            "badly scaled; lower the decay rate, or pass a scaling by hand."
        )
    wide = replace(scaled, kappa=1e4 * scaled.kappa)
    looser = propose(wide, decay_blocks(wide, basis), "margin", solver)
    bound = (
        f"A bound of P of kappa = {wide.kappa:g} would do: raise kappa, or lower the decay rate."
        if looser.status == "optimal" and looser.value > 1e-6
        else "Lower the decay rate, narrow the range of the parameters, or measure more; every vertex alone may be "
        "feasible while one P for all of them is not."
    )
    gain = f" for any gain with |P K| < {proof.gain_limit:.2g} (scaled)" if len(problem.C) else ""
    return InfeasibleError(
        f"{asked} is infeasible: verified multipliers exclude every P with I <= P <= {problem.kappa:g} I{gain} by "
        f"{proof.slack:.2g}. {bound}"
    )


def prepare(
    problem: Family, schedule: str, dense: ArrayLike | None, nu_dense: ArrayLike | None,
    scaling: Scaling | None,
) -> Prepared:  # fmt: skip
    """Choose the units of a checked problem and check its dense grid.

    Parameters
    ----------
    problem : Family
        The problem.
    schedule, dense, nu_dense, scaling
        As in `observer_gain`.

    Returns
    -------
    Prepared

    Raises
    ------
    ParameterError
        If an argument is wrong.
    """
    name, n = problem.name, problem.A.shape[1]
    unit = automatic_scaling(problem) if scaling is None else scaling
    rescaled(problem, unit)
    if dense is None:
        if nu_dense is not None:
            raise ParameterError(f"{name}: nu_dense without dense; give the systems of these parameters too.")
        return Prepared(problem=problem, scaling=unit, A=problem.A, weights=problem.weights, dense=False)
    grid = matrices(name, "dense", dense, (None, n, n))
    weights = np.ones((len(grid), 1))
    if schedule == "affine":
        if nu_dense is None:
            raise ParameterError(f"{name}: a dense grid of a scheduled gain needs nu_dense.")
        given = np.asarray(nu_dense)
        rows = matrices(name, "nu_dense", given[:, None] if given.ndim == 1 else nu_dense, (len(grid), None))
        if rows.shape[1] != problem.weights.shape[1] - 1:
            raise ParameterError(f"{name}: nu_dense has {rows.shape[1]} parameters, nu {problem.weights.shape[1] - 1}.")
        weights = np.hstack([weights, rows.real])
    return Prepared(problem=problem, scaling=unit, A=grid, weights=weights, dense=True)


def lyapunov_certificate(
    A: ArrayLike, *, decay_rate: float = 0.0, form: Form = "continuous", h: float | None = None, kappa: float = 1e6,
    scaling: Scaling | None = None, name: str = "lyapunov_certificate", solvers: tuple[str, ...] = SOLVERS,
) -> Certificate:  # fmt: skip
    """Common quadratic Lyapunov function of a polytope of systems, best conditioned.

    Parameters
    ----------
    A : array_like, shape (k, n, n) or (n, n)
        Systems at the vertices, real or complex, 1/s.
    decay_rate : float
        Rate that must be reached in the whole polytope, 1/s.
    form : {"continuous", "delta"}
        Whether they are de/dt = A e or (e_{k+1} - e_k)/h = A e_k. A discrete e_{k+1} = Phi e_k is the delta form
        with A = (Phi - I)/h.
    h : float, optional
        Sampling interval of the delta form, s.
    kappa : float
        Largest condition number of P in scaled units.
    scaling : Scaling, optional
        Units to solve in; automatic by default.
    name : str
        Shown in errors.
    solvers : tuple of str
        Tried in turn.

    Returns
    -------
    Certificate

    Raises
    ------
    ParameterError
        If an argument is wrong.
    InfeasibleError
        If there is none, with the cause.
    InaccurateError
        If the problem is too close to the edge to decide.
    NotVerifiedError
        If what the solver found does not stand the verification.

    References
    ----------
    S. Boyd, L. El Ghaoui, E. Feron, V. Balakrishnan, Linear Matrix Inequalities in System and Control Theory (SIAM,
    1994), section 5.1. Thesis B.2.

    Examples
    --------
    >>> import numpy as np
    >>> found = lyapunov_certificate(np.array([[[0, 1], [-2, -1.0]], [[0, 1], [-5, -1.0]]]))
    >>> found.decay > 0
    True
    """
    check_solvers(name, solvers)
    problem = family(name, A, None, None, "constant", form, h, decay_rate, kappa)
    ready = prepare(problem, "constant", None, None, scaling)
    return solve_prepared(ready, solvers)[2]


def observer_gain(
    A: ArrayLike, C: ArrayLike, *, decay_rate: float, form: Form = "continuous", h: float | None = None,
    nu: ArrayLike | None = None, schedule: Schedule = "constant", dense: ArrayLike | None = None,
    nu_dense: ArrayLike | None = None, kappa: float = 1e4, scaling: Scaling | None = None,
    name: str = "observer_gain", solvers: tuple[str, ...] = SOLVERS,
) -> tuple[Gain, Certificate]:  # fmt: skip
    """Observer gain that gives the error a decay rate for all systems of a polytope, with the smallest norm.

    Finds P with I <= P <= kappa I and Y_j = P K_j that minimise the sum of the Frobenius norms of Y_j, in scaled
    units, such that sqrt(e^H P e) of the error falls at the rate asked for at every vertex.

    Parameters
    ----------
    A : array_like, shape (k, n, n) or (n, n)
        Systems at the vertices, real or complex, 1/s.
    C : array_like, shape (p, n)
        Output matrix, common to all.
    decay_rate : float
        Rate asked for, 1/s; in delta form |e|_P shrinks by 1 - h decay_rate a sample.
    form : {"continuous", "delta"}
        Error systems de/dt = (A - K C) e or (e_{k+1} - e_k)/h = (A - K C) e_k.
    h : float, optional
        Sampling interval of the delta form, s.
    nu : array_like, shape (k,) or (k, m), optional
        Scheduling parameters of the vertices.
    schedule : {"constant", "affine"}
        Gain K_0, or K_0 + nu_1 K_1 + ...
    dense : array_like, shape (N, n, n), optional
        Systems on a dense grid of equally spaced values of one parameter, where the result is verified instead of
        at the vertices. Needed where the systems are not affine in the parameter, as in delta form.
    nu_dense : array_like, shape (N,) or (N, m), optional
        Scheduling parameters of the dense grid.
    kappa : float
        Bound of P in scaled units; larger allows faster and more sensitive observers.
    scaling : Scaling, optional
        Units to solve in; automatic by default, which makes the gain independent of the units of the caller.
    name : str
        Shown in errors.
    solvers : tuple of str
        Tried in turn.

    Returns
    -------
    gain : Gain
        In the units of the caller.
    certificate : Certificate
        Verified at the vertices, or on the dense grid.

    Raises
    ------
    ParameterError
        If an argument is wrong.
    InfeasibleError
        If no gain reaches the rate, with the mode or the proof that stands against it.
    InaccurateError
        If the problem is too close to the edge to decide.
    NotVerifiedError
        If what the solver found does not stand the verification.

    Notes
    -----
    In continuous form a scheduled gain reaches nothing that a constant one does not: if P proves the rate with some
    gain at each vertex, it does so with K = s P^-1 C^H and s large enough at all of them (Finsler's lemma). A
    schedule can only make the gain smaller. In delta form the gain cannot be large, and a schedule can matter.

    References
    ----------
    Boyd et al. (1994), sections 2.6.2, 5.1 and 7.2. Thesis 5.2.2, B.2.
    """
    check_solvers(name, solvers)
    problem = family(name, A, C, nu, schedule, form, h, decay_rate, kappa)
    ready = prepare(problem, schedule, dense, nu_dense, scaling)
    _, K, certificate = solve_prepared(ready, solvers)
    return as_gain(K, ready.weights), certificate


def as_gain(K: Array, weights: Array) -> Gain:
    """Make the gain object from its matrices and the weights at which it was verified.

    Parameters
    ----------
    K : ndarray, shape (1 + m, n, p)
        K_0 and the slopes.
    weights : ndarray, shape (N, 1 + m)
        One and the scheduling parameters.

    Returns
    -------
    Gain
    """
    return Gain(K=tuple(K), low=weights[:, 1:].min(axis=0), high=weights[:, 1:].max(axis=0))
