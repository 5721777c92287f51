"""Thesis 5.2.2, B.2: the semidefinite programs behind the gains, and the proof that a problem has no solution.

The solver is called here and nowhere else. What it returns is a proposal: feasible points go to `certificate`,
multipliers of infeasible problems to `refute`, both in plain NumPy.
"""

import math
import warnings
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import null_space

from pumplib.observers.certificate import InaccurateError
from pumplib.observers.lmi_forms import real_form
from pumplib.observers.lmi_problem import Blocks, Family

Array = NDArray[Any]
Goal = Literal["gain", "condition", "margin", "cone"]
SOLVERS = ("CLARABEL", "SCS")  # the second only where the first gives nothing that can be verified
_OPTIONS: dict[str, dict[str, Any]] = {"CLARABEL": {}, "SCS": {"eps": 1e-9, "max_iters": 5000}}
_CLEAR = 1e-7  # margin, scaled units, above which a problem counts as feasible in the search for a refutation
_GAIN_LIMIT = 1e3  # a refutation must exclude all Y = P K up to this size, in scaled units


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Proposal:
    """What a solver returned.

    Parameters
    ----------
    x : ndarray, shape (d,), or None
        The unknowns; None where the solver gave none.
    value : float
        Objective.
    multipliers : list of ndarray
        Multiplier of each decay block, as far as the solver gave one.
    solver, status : str
        Its name and what it said.
    """

    x: Array | None
    value: float
    multipliers: list[Array]
    solver: str
    status: str


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Refutation:
    """Proof, verified outside the solver, that no P within its bounds reaches a decay rate with any sensible gain.

    Multipliers Z_k >= 0 of the decay blocks F_k, with traces that sum to one, for which the sum of <Z_k, F_k> is
    negative for every P with I <= P <= kappa I, while it would be >= 0 if all blocks were positive semidefinite.

    Parameters
    ----------
    decay_rate : float
        The rate that cannot be reached, 1/s.
    slack : float
        How negative the sum is at best, scaled units.
    gain_limit : float
        Size of Y = P K, scaled units, up to which the proof holds despite rounding; infinite without a gain.
    multipliers : tuple of ndarray
        The Z_k.
    kappa : float
        Bound of P.
    solver, status : str
        Where the multipliers came from.
    """

    decay_rate: float
    slack: float
    gain_limit: float
    multipliers: tuple[Array, ...]
    kappa: float
    solver: str
    status: str


def _embedded(coefficients: Array) -> Array:
    """Coefficients (N, N, d) as real ones; a Hermitian block becomes a symmetric one of twice the order."""
    if not np.iscomplexobj(coefficients):
        return coefficients
    return np.moveaxis(real_form(np.moveaxis(coefficients, 2, 0)), 0, 2)


def _from_embedded(Z: Array, is_complex: bool) -> Array:
    """Multiplier of the Hermitian block from the one of its real form: <Z, F> stays the same."""
    if not is_complex:
        return (Z + Z.T) / 2
    n = len(Z) // 2
    half = (Z[:n, :n] + Z[n:, n:]) + 1j * (Z[n:, :n] - Z[:n, n:])
    return (half + half.conj().T) / 2


def propose(problem: Family, blocks: Blocks, goal: Goal, solver: str) -> Proposal:
    """Solve one of the semidefinite programs of a scaled problem.

    Parameters
    ----------
    problem : Family
        Scaled problem.
    blocks : Blocks
        Its inequalities.
    goal : {"gain", "condition", "margin", "cone"}
        Smallest sum of the norms of Y_j; smallest condition number of P (no gain to find); or largest s such that
        every decay block is >= s I, which has a solution whether the problem is feasible (s > 0) or not: "margin"
        over I <= P <= kappa I, "cone" over all P >= 0 with trace 1, whose multipliers hold for every kappa.
    solver : {"CLARABEL", "SCS"}
        Name of the solver.

    Returns
    -------
    Proposal

    Notes
    -----
    The unknowns are one real vector and each block one affine map of it. A motor problem with five vertices takes
    30 ms this way, and 540 ms with CVXPY's Hermitian variables (2 cores, cvxpy 1.9); the solver itself takes 10 ms.
    """
    import cvxpy as cp

    x = cp.Variable(blocks.unknowns)
    d = len(blocks.basis)
    P = _affine(np.moveaxis(blocks.basis, 0, 2), x[:d])
    identity = np.eye(P.shape[0])
    decay = [_affine(one, x) for one in blocks.coefficients]
    constraints = [P >> 0 if goal == "cone" else identity << P]
    if goal in ("margin", "cone"):
        margin = cp.Variable()
        active = [one - margin * np.eye(one.shape[0]) >> 0 for one in decay]
        bound = cp.trace(P) == 1 if goal == "cone" else problem.kappa * identity >> P
        constraints += [*active, bound, margin <= 1]
        objective: Any = cp.Maximize(margin)
    else:
        active = [one >> 0 for one in decay]
        constraints += active
        if goal == "gain":
            size = len(blocks.y_basis)
            parts = [x[d + j * size : d + (j + 1) * size] for j in range(blocks.terms)]
            constraints.append(problem.kappa * identity >> P)
            objective = cp.Minimize(sum(cp.norm(part) for part in parts))
        else:
            top = cp.Variable()
            constraints += [top * identity >> P, top <= problem.kappa]
            objective = cp.Minimize(top)
    return _run(objective, constraints, x, active, solver, np.iscomplexobj(blocks.coefficients))


def maximise(basis: Array, blocks: list[Array], floor: float, solver: str) -> Proposal:
    """Largest s such that blocks that are linear in P are all >= s I, over floor I <= P <= I.

    Parameters
    ----------
    basis : ndarray, shape (d, n, n)
        Basis of P.
    blocks : list of ndarray, shape (d, N, N)
        Coefficients of each block.
    floor : float
        Smallest eigenvalue of P.
    solver : {"CLARABEL", "SCS"}
        Name of the solver.

    Returns
    -------
    Proposal
        With the multipliers of the blocks, of P >= floor I and of I >= P.
    """
    import cvxpy as cp

    x, margin = cp.Variable(len(basis)), cp.Variable()
    P = _affine(np.moveaxis(basis, 0, 2), x)
    identity = np.eye(P.shape[0])
    maps = [_affine(np.moveaxis(one, 0, 2), x) for one in blocks]
    active = [one - margin * np.eye(one.shape[0]) >> 0 for one in maps]
    bounds = [P >> floor * identity, identity >> P]
    return _run(cp.Maximize(margin), [*active, *bounds], x, [*active, *bounds], solver, np.iscomplexobj(basis))


def _affine(coefficients: Array, unknowns: Any) -> Any:
    import cvxpy as cp

    real = _embedded(coefficients)
    N = len(real)
    return cp.reshape(real.reshape(N * N, -1) @ unknowns, (N, N), order="C")


def _run(objective: Any, constraints: list[Any], x: Any, active: list[Any], solver: str, is_complex: bool) -> Proposal:
    import cvxpy as cp

    task = cp.Problem(objective, constraints)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # accuracy is judged outside, and the status is kept
        try:
            task.solve(solver=solver, **_OPTIONS[solver])
        except cp.error.SolverError as error:
            return Proposal(x=None, value=math.nan, multipliers=[], solver=solver, status=f"solver error: {error}")
    found = None if x.value is None or not np.isfinite(x.value).all() else np.asarray(x.value)
    duals = [one.dual_value for one in active]
    usable = found is not None and all(one is not None and np.isfinite(one).all() for one in duals)
    multipliers = [_from_embedded(np.asarray(one), is_complex) for one in duals] if usable else []
    value = math.nan if task.value is None else float(task.value)
    return Proposal(x=found, value=value, multipliers=multipliers, solver=solver, status=str(task.status))


def _positive(Z: Array) -> Array:
    values, vectors = np.linalg.eigh(Z)
    return (vectors * np.maximum(values, 0.0)) @ vectors.conj().T


def refutation(problem: Family, blocks: Blocks, multipliers: list[Array], source: str, status: str) -> Refutation:
    """Verify multipliers that are meant to prove that a scaled problem has no solution.

    Parameters
    ----------
    problem : Family
        Scaled problem; its decay rate is the one refuted, in its unit of time.
    blocks : Blocks
        Its inequalities.
    multipliers : list of ndarray, shape (N, N)
        One for each decay block; made positive semidefinite here.
    source, status : str
        Solver and what it said.

    Returns
    -------
    Refutation

    Raises
    ------
    InaccurateError
        If they prove nothing.
    """
    if len(multipliers) != len(blocks.coefficients):
        raise InaccurateError(f"{problem.name}: solver {source} ({status}) gave no multipliers.")
    Z = [_positive(one) for one in multipliers]
    if len(problem.C) and problem.h == 0:  # blocks of the continuous form: C Z = 0 can be reached exactly
        hidden = null_space(problem.C)
        project = hidden @ hidden.conj().T
        Z = [project @ one @ project for one in Z]
    total = sum(float(np.trace(one).real) for one in Z)
    if not total > 0:
        raise InaccurateError(f"{problem.name}: all multipliers of solver {source} ({status}) are zero.")
    Z = [one / total for one in Z]
    slope = sum(
        np.einsum("ij,jid->d", one, block).real for one, block in zip(Z, blocks.coefficients, strict=True)
    )  # of the sum of <Z_k, F_k> in each unknown
    d = len(blocks.basis)
    H = np.einsum("d,dij->ij", slope[:d], blocks.basis) if d else np.zeros((1, 1))
    values = np.linalg.eigvalsh(H)
    rounding = 1e-13 * problem.kappa * float(np.abs(blocks.coefficients).max(initial=0.0)) * len(H)
    slack = float(-problem.kappa * values[values > 0].sum() - values[values < 0].sum()) - rounding
    leak = float(np.linalg.norm(slope[d:]))
    if not slack > 0:
        raise InaccurateError(f"{problem.name}: the multipliers of solver {source} ({status}) prove nothing.")
    limit = slack / leak if leak > 0 else math.inf
    if limit < _GAIN_LIMIT:
        raise InaccurateError(f"{problem.name}: multipliers of {source} ({status}) exclude only |Y| < {limit:.3g}.")
    return Refutation(
        decay_rate=problem.decay_rate,
        slack=slack,
        gain_limit=limit,
        multipliers=tuple(Z),
        kappa=problem.kappa,
        solver=source,
        status=status,
    )


def refute(problem: Family, blocks: Blocks, solvers: tuple[str, ...] = SOLVERS) -> Refutation:
    """Prove that a scaled problem has no solution.

    Parameters
    ----------
    problem : Family
        Scaled problem.
    blocks : Blocks
        Its inequalities.
    solvers : tuple of str
        Solvers to try in turn.

    Returns
    -------
    Refutation

    Raises
    ------
    InaccurateError
        If no solver gives multipliers that prove it; the problem is feasible or too close to call.
    """
    if not len(blocks.basis):
        raise InaccurateError(f"{problem.name}: no matrix P satisfies the equalities.")
    reasons = []
    tasks: list[tuple[Goal, str]] = [(goal, solver) for solver in solvers for goal in ("margin", "cone")]
    for goal, solver in tasks:
        found = propose(problem, blocks, goal, solver)
        try:
            return refutation(problem, blocks, found.multipliers, solver, found.status)
        except InaccurateError as error:
            reasons.append(str(error))
            if goal == "margin" and found.status == "optimal" and found.value > _CLEAR:
                break  # feasible: nothing will refute it
    raise InaccurateError(" ".join(reasons))
