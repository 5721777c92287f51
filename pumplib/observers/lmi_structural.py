"""Thesis 5.2.2, B.2: structural matrix inequality of the direct adaptive observer: P A_i = C^H F_i, P B_i = C^H G_i.

With these equalities the adaptation law dtheta_i/dt = Gamma_i Re(e_y^H (F_i x + G_i u)) needs measured signals only.
They restrict P to a subspace, which is computed first; then the inequality is tested on what the output does not see
(Finsler's lemma), where no gain helps. Both the margin that is reached and a bound that no P can exceed are verified
outside the solver, so "never strictly feasible" is a proof and not a failure of the solver.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import null_space

from pumplib.errors import ParameterError
from pumplib.observers.certificate import Certificate, Gain, InaccurateError, LmiError, matrices
from pumplib.observers.lmi import Schedule, as_gain, prepare, solve_prepared
from pumplib.observers.lmi_forms import hermitian_basis, structured_basis
from pumplib.observers.lmi_problem import (
    Family,
    Scaling,
    automatic_scaling,
    family,
    rescaled,
)
from pumplib.observers.lmi_solver import SOLVERS, maximise

Array = NDArray[Any]
Verdict = Literal["strict", "boundary", "infeasible"]
_ZERO = 1e-7  # a margin below this, in scaled units, is none


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Structure:
    """What the structural inequality of a problem allows.

    Parameters
    ----------
    verdict : {"strict", "boundary", "infeasible"}
        Strictly feasible; feasible at most with equality in some direction; not feasible.
    explanation : str
        In words, with the numbers.
    freedom : int
        Number of real coordinates of P that the equalities leave.
    definite, definite_bound : float
        Smallest eigenvalue of P, largest one at most 1, scaled units: reached by some P, and bound for all of them.
    margin, margin_bound : float
        Smallest eigenvalue of the decay inequality on the directions that the output does not see, scaled units, with
        I/kappa <= P <= I: reached, and bound for all. NaN where no P is definite; infinite where the output sees all.
    P : ndarray, shape (n, n), or None
        Matrix that reaches the margin, in the units of the caller.
    F, G : tuple of ndarray
        F_i of shape (p, n) and G_i of shape (p, inputs) with P A_i = C^H F_i and P B_i = C^H G_i, for that P.
    residual : float
        Largest error of the equalities relative to |P| |A_i| and |P| |B_i|.
    gain : Gain or None
        Gain of smallest norm; only where strictly feasible.
    certificate : Certificate or None
        Its certificate; its P is the one of the gain.
    """

    verdict: Verdict
    explanation: str
    freedom: int
    definite: float
    definite_bound: float
    margin: float
    margin_bound: float
    P: Array | None = None
    F: tuple[Array, ...] = ()
    G: tuple[Array, ...] = ()
    residual: float = math.nan
    gain: Gain | None = None
    certificate: Certificate | None = None


def _bound(multipliers: list[Array], blocks: list[Array], basis: Array, floor: float) -> float:
    """Upper bound of the best margin over floor I <= P <= I, from multipliers of the blocks and of the two bounds.

    For Z_k, W, U >= 0 with traces of the Z_k that sum to one, the margin is at most the sum of <Z_k, F_k(P)>, which
    is <U - W, P> + <R, P> with a rest R that the solver makes small, so at most tr U - floor tr W + sqrt(n) |R|. The
    split of the sum into its positive and negative part takes the place of U and W where that gives less.
    """
    *Z, W, U = [_positive(one) for one in multipliers]
    total = sum(float(np.trace(one).real) for one in Z)
    if not total > 0:
        return math.inf
    slope = sum(np.einsum("ij,dji->d", one, block).real for one, block in zip(Z, blocks, strict=True))
    rest = slope + np.einsum("ij,dji->d", W - U, basis).real
    size = math.sqrt(len(U)) * float(np.linalg.norm(rest))
    values = np.linalg.eigvalsh(np.einsum("d,dij->ij", slope, basis))
    split = float(values[values > 0].sum() + floor * values[values < 0].sum())
    return min(float(np.trace(U).real) - floor * float(np.trace(W).real) + size, split) / total


def _positive(Z: Array) -> Array:
    values, vectors = np.linalg.eigh(Z)
    return (vectors * np.maximum(values, 0.0)) @ vectors.conj().T


def _best(
    problem: Family, basis: Array, blocks: list[Array], floor: float, solvers: tuple[str, ...]
) -> tuple[float, float, Array]:
    """Best margin of blocks that are linear in P: verified value, verified bound, P."""
    for solver in solvers:
        found = maximise(basis, blocks, floor, solver)
        if found.x is None or not found.multipliers:
            continue
        P = np.einsum("d,dij->ij", found.x, basis)
        largest = max(float(np.linalg.eigvalsh(P)[-1]), 1e-300)
        P, x = P / largest, found.x / largest
        value = min(float(np.linalg.eigvalsh(np.einsum("d,dij->ij", x, block))[0]) for block in blocks)
        bound = _bound(found.multipliers, blocks, basis, floor)
        if math.isfinite(bound):
            return value, bound, P
    raise InaccurateError(
        f"{problem.name}: no solver of {', '.join(solvers)} gave the margin of the structural inequality; pass a "
        "scaling by hand."
    )


def structural_gain(
    A: ArrayLike, C: ArrayLike, parameter_A: Sequence[ArrayLike], parameter_B: Sequence[ArrayLike] = (), *,
    decay_rate: float = 0.0, nu: ArrayLike | None = None, schedule: Schedule = "constant", kappa: float = 1e4,
    scaling: Scaling | None = None, name: str = "structural_gain", solvers: tuple[str, ...] = SOLVERS,
) -> Structure:  # fmt: skip
    """Gain of the direct adaptive observer, or the proof that the structural inequality has no strict solution.

    Parameters
    ----------
    A : array_like, shape (k, n, n)
        Systems at the vertices, continuous form, 1/s.
    C : array_like, shape (p, n)
        Output matrix.
    parameter_A : sequence of array_like, shape (n, n)
        A_i, derivative of the system matrix to each parameter.
    parameter_B : sequence of array_like, shape (n, inputs)
        B_i, derivative of the input matrix to each parameter.
    decay_rate : float
        Rate that the error must reach, 1/s.
    nu, schedule, kappa, scaling, name, solvers
        As in `observer_gain`.

    Returns
    -------
    Structure
        Also where nothing is feasible; the verdict and its explanation say so.

    Raises
    ------
    ParameterError
        If an argument is wrong.
    InaccurateError
        If no solver gives a usable answer, or margin and bound leave the verdict open.

    References
    ----------
    Boyd et al. (1994), sections 2.3.1 (Lyapunov inequalities with structure) and 2.6.2 (elimination). G. Besancon,
    Remarks on nonlinear adaptive observer design, Systems & Control Letters 41 (2000). Thesis 5.2.2, B.2.
    """
    problem = family(name, A, C, nu, schedule, "continuous", None, decay_rate, kappa)
    n = problem.A.shape[1]
    actions = [matrices(name, f"parameter_A[{i}]", one, (n, n)) for i, one in enumerate(parameter_A)]
    inputs = [matrices(name, f"parameter_B[{i}]", one, (n, None)) for i, one in enumerate(parameter_B)]
    if not actions and not inputs:
        raise ParameterError(f"{name}: give at least one A_i or B_i; without parameters use observer_gain.")
    unit = automatic_scaling(problem) if scaling is None else scaling
    scaled = rescaled(problem, unit)
    d = np.asarray(unit.state)
    scaled_actions = [one * d[None, :] / d[:, None] for one in actions] + [one / d[:, None] for one in inputs]
    is_complex = problem.is_complex or any(np.iscomplexobj(one) for one in scaled_actions)
    basis = structured_basis(hermitian_basis(n, is_complex), scaled.C, scaled_actions)
    free = len(basis)
    if free == 0:
        return Structure(
            verdict="infeasible", freedom=0, definite=0.0, definite_bound=0.0, margin=math.nan, margin_bound=math.nan,
            explanation=f"{name} is infeasible: only P = 0 satisfies the equalities; measure more or adapt fewer.",
        )  # fmt: skip
    definite, definite_bound, P = _best(scaled, basis, [basis], 0.0, solvers)
    start = Structure(
        verdict="infeasible", explanation="", freedom=free, definite=definite, definite_bound=definite_bound,
        margin=math.nan, margin_bound=math.nan,
    )  # fmt: skip
    if definite < 1 / kappa:
        vector = np.linalg.eigh(P)[1][:, 0] * d
        vector = vector / vector[np.argmax(np.abs(vector))]
        text = ", ".join(f"{one:.3g}" for one in vector)
        why = (
            "every P that satisfies the equalities is singular"
            if definite_bound < _ZERO
            else f"every P that satisfies the equalities has a condition number above kappa = {kappa:g}"
        )
        return replace(
            start,
            explanation=f"{name} is infeasible: {why} (smallest eigenvalue {definite:.2g}, proven to be at most "
            f"{definite_bound:.2g} of the largest; direction of the states [{text}]). Use the filtered-regressor "
            "observer, which needs no such equalities, or measure that direction.",
        )
    hidden = null_space(scaled.C)
    margin, margin_bound = math.inf, math.inf
    if hidden.shape[1]:
        blocks = []
        for one in scaled.A:
            shifted = basis @ (one + scaled.decay_rate * np.eye(n))
            full = -(shifted + np.swapaxes(shifted, 1, 2).conj())
            blocks.append(hidden.conj().T @ full @ hidden)
        margin, margin_bound, P = _best(scaled, basis, blocks, 1 / kappa, solvers)
    scale = np.outer(d, d)
    left, right = _factors(P, scaled.C, scaled_actions)
    start = replace(
        start,
        margin=margin,
        margin_bound=margin_bound,
        P=P / scale,
        residual=right,
        F=tuple(one * unit.output[:, None] ** -1 / d[None, :] for one in left[: len(actions)]),
        G=tuple(one * unit.output[:, None] ** -1 for one in left[len(actions) :]),
    )
    asked = f" with decay rate {decay_rate:g} 1/s" if decay_rate > 0 else ""
    if margin < _ZERO < margin_bound:
        raise InaccurateError(
            f"{name}: the best margin found is {margin:.2g}, the proven bound {margin_bound:.2g} (scaled): strict "
            "feasibility is not decided. Pass a scaling by hand, or try another kappa."
        )
    if margin_bound < -_ZERO:
        return replace(
            start,
            explanation=f"{name} is infeasible{asked}: on the directions that the output does not see the inequality "
            f"is violated by at least {-margin_bound:.2g} at some vertex for every P (best found {margin:.2g}); no "
            "gain acts there. Lower the decay rate, narrow the range, or use the filtered-regressor observer.",
        )
    if margin < _ZERO:
        return replace(
            start,
            verdict="boundary",
            explanation=f"{name} is never strictly feasible{asked}: on the directions that the output does not see the "
            f"best margin is {margin:.1e}, and proven to be at most {margin_bound:.1e}, for every P that satisfies the "
            "equalities, and no gain acts there. At best the error energy does not grow; use a scheduled gain that "
            "reaches the boundary, or the filtered-regressor observer.",
        )
    ready = prepare(problem, schedule, None, None, unit)
    try:
        found, K, certificate = solve_prepared(ready, solvers, basis)
    except LmiError as error:
        return replace(start, verdict="strict", explanation=f"{name} is strictly feasible, but has no gain: {error}")
    left, right = _factors(found * scale, scaled.C, scaled_actions)
    return replace(
        start,
        verdict="strict",
        P=found,
        residual=right,
        F=tuple(one * unit.output[:, None] ** -1 / d[None, :] for one in left[: len(actions)]),
        G=tuple(one * unit.output[:, None] ** -1 for one in left[len(actions) :]),
        gain=as_gain(K, problem.weights),
        certificate=certificate,
        explanation=f"{name} is strictly feasible{asked}: margin {margin:.3g} (at most {margin_bound:.3g}), smallest "
        f"eigenvalue of P up to {definite:.3g} of the largest, verified decay rate {certificate.decay:.6g} 1/s.",
    )


def _factors(P: Array, C: Array, actions: list[Array]) -> tuple[list[Array], float]:
    """F with P X = C^H F for each X, by least squares, and the largest relative residual."""
    found, worst = [], 0.0
    for X in actions:
        F = np.linalg.lstsq(C.conj().T, P @ X, rcond=None)[0]
        size = float(np.linalg.norm(P) * np.linalg.norm(X))
        worst = max(worst, float(np.linalg.norm(P @ X - C.conj().T @ F)) / size if size > 0 else 0.0)
        found.append(F)
    return found, worst
