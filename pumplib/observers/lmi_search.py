"""Thesis 5.2.2, B.2: how far a matrix inequality reaches: largest decay rate or size, verified on both sides.

Bisection between a number with a certificate and a number with a refutation. Where rounding decides neither, the
bracket stays open and says so by its width.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, Generic, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pumplib.errors import ParameterError
from pumplib.observers.certificate import (
    Certificate,
    Form,
    Gain,
    InaccurateError,
    InfeasibleError,
    NotVerifiedError,
)
from pumplib.observers.lmi import Schedule, as_gain, check_solvers, prepare, solve_prepared
from pumplib.observers.lmi_problem import Scaling, automatic_scaling, decay_blocks, family, hidden_modes, rescaled
from pumplib.observers.lmi_solver import SOLVERS, Refutation, refute

Array = NDArray[Any]
Found = TypeVar("Found")


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Bracket(Generic[Found]):
    """Largest feasible number, between one that is certified and one that is refuted.

    Parameters
    ----------
    low : float
        Certified feasible.
    high : float
        Refuted; infinite where nothing was refuted up to the limit of the search.
    found : object
        What was found at `low`.
    refutation : Refutation or None
        Proof at `high`.
    steps : int
        Problems solved.
    """

    low: float
    high: float
    found: Found
    refutation: Refutation | None
    steps: int


def refute_decay_rate(
    A: ArrayLike, C: ArrayLike | None = None, *, decay_rate: float, form: Form = "continuous", h: float | None = None,
    nu: ArrayLike | None = None, schedule: Schedule = "constant", kappa: float = 1e4, scaling: Scaling | None = None,
    name: str = "refute_decay_rate", solvers: tuple[str, ...] = SOLVERS,
) -> Refutation:  # fmt: skip
    """Prove that no P within its bounds, and no gain, gives a polytope of systems a decay rate.

    Parameters
    ----------
    A : array_like, shape (k, n, n) or (n, n)
        Systems at the vertices, 1/s.
    C : array_like, shape (p, n), optional
        Output matrix; without it the systems are taken as they are, as in `lyapunov_certificate`.
    decay_rate : float
        Rate to refute, 1/s.
    form, h, nu, schedule, kappa, scaling, name, solvers
        As in `observer_gain`.

    Returns
    -------
    Refutation
        Verified outside the solver.

    Raises
    ------
    ParameterError
        If an argument is wrong.
    InaccurateError
        If it cannot be refuted: the rate is feasible, or too close to the edge.

    References
    ----------
    Boyd et al. (1994), section 2.2.3, theorems of alternatives.
    """
    check_solvers(name, solvers)
    problem = family(name, A, C, nu, schedule, form, h, decay_rate, kappa)
    scaled = rescaled(problem, automatic_scaling(problem) if scaling is None else scaling)
    return replace(refute(scaled, decay_blocks(scaled), solvers), decay_rate=problem.decay_rate)


def bisect(
    feasible: Callable[[float], Found], refuted: Callable[[float], Refutation], low: float, high: float, *,
    rtol: float = 1e-3,
) -> Bracket[Found]:  # fmt: skip
    """Enclose the largest number for which a problem is feasible, with both ends verified.

    Parameters
    ----------
    feasible : callable
        Returns a verified result, or raises an `LmiError`.
    refuted : callable
        Returns a verified refutation, or raises `InaccurateError`.
    low, high : float
        Start; must be feasible and refuted.
    rtol : float
        Wanted width of the bracket relative to its upper end. Where neither can be verified the bracket stays
        wider.

    Returns
    -------
    Bracket

    Raises
    ------
    ParameterError
        If the ends are in the wrong order or the tolerance is not positive.
    InfeasibleError, InaccurateError, NotVerifiedError
        If `low` is not feasible, or `high` cannot be refuted.
    """
    if not (low < high and rtol > 0):
        raise ParameterError(f"bisect: low = {low:g}, high = {high:g}, rtol = {rtol:g}; need low < high and rtol > 0.")
    low, high = float(low), float(high)
    best, proof, steps = feasible(low), refuted(high), 2
    undecided_low = undecided_high = np.nan  # range in which neither was verified
    for _ in range(80):
        if high - low <= rtol * abs(high):
            break
        if np.isnan(undecided_low):
            mid, try_low, try_high = (low + high) / 2, True, True
        elif undecided_low - low >= high - undecided_high:
            mid, try_low, try_high = (low + undecided_low) / 2, True, False
        else:
            mid, try_low, try_high = (undecided_high + high) / 2, False, True
        if not np.isnan(undecided_low) and max(undecided_low - low, high - undecided_high) <= 0.1 * rtol * abs(high):
            break
        steps += 1
        if try_high and (no := _attempt(refuted, mid)) is not None:
            high, proof = mid, no
        elif try_low and (got := _attempt(feasible, mid)) is not None:
            low, best = mid, got
        else:
            undecided_low, undecided_high = np.fmin(undecided_low, mid), np.fmax(undecided_high, mid)
    return Bracket(low=float(low), high=float(high), found=best, refutation=proof, steps=steps)


def _attempt(function: Callable[[float], Any], value: float) -> Any:
    try:
        return function(value)
    except (InfeasibleError, InaccurateError, NotVerifiedError):
        return None


def largest_decay_rate(
    A: ArrayLike, C: ArrayLike | None = None, *, form: Form = "continuous", h: float | None = None,
    nu: ArrayLike | None = None, schedule: Schedule = "constant", kappa: float = 1e4, limit: float | None = None,
    rtol: float = 1e-3, scaling: Scaling | None = None, name: str = "largest_decay_rate",
    solvers: tuple[str, ...] = SOLVERS,
) -> Bracket[tuple[Gain, Certificate]]:  # fmt: skip
    """Enclose the largest decay rate of a polytope, with or without a gain to be found.

    Parameters
    ----------
    A : array_like, shape (k, n, n) or (n, n)
        Systems at the vertices, 1/s.
    C : array_like, shape (p, n), optional
        Output matrix; without it the systems are taken as they are.
    form, h, nu, schedule, kappa
        As in `observer_gain`; the result is verified at the vertices.
    limit : float, optional
        Rate at which the search upwards ends, 1/s; by default 1e4 in units of the automatic time scale, or just
        below 1/h.
    rtol : float
        Wanted relative width of the bracket.
    scaling, name, solvers
        As in `observer_gain`.

    Returns
    -------
    Bracket
        In 1/s; `found` holds the gain (without C one of shape (n, 0)) and the certificate at the lower end.

    Raises
    ------
    ParameterError
        If an argument is wrong.
    InfeasibleError, InaccurateError, NotVerifiedError
        If already the rate zero is not feasible, or no bracket is found.
    """
    check_solvers(name, solvers)
    problem = family(name, A, C, nu, schedule, form, h, 0.0, kappa)
    unit = automatic_scaling(problem) if scaling is None else scaling
    base = prepare(problem, "constant", None, None, unit)

    def feasible(rate: float) -> tuple[Gain, Certificate]:
        ready = replace(base, problem=replace(problem, decay_rate=rate))
        _, K, certificate = solve_prepared(ready, solvers)
        return as_gain(K if len(K) else np.zeros((1, *problem.C.T.shape)), problem.weights), certificate

    def refuted(rate: float) -> Refutation:
        scaled = base.scaled(rate)
        return replace(refute(scaled, decay_blocks(scaled), solvers), decay_rate=rate)

    top = 1e4 / unit.time if limit is None else limit
    if problem.h > 0:
        top = min(top, (1 - 1e-9) / problem.h)
    low, best, steps = 0.0, feasible(0.0), 1
    modes = hidden_modes(base.scaled(0.0))  # without C these are all modes
    high = modes[0].decay / unit.time * (1 + rtol) if modes and modes[0].decay > 0 else 1.0 / unit.time
    high = min(high, top)
    while _attempt(refuted, high) is None:
        steps += 1
        if (got := _attempt(feasible, high)) is not None:
            low, best = high, got
        if high >= top:
            return Bracket(low=low, high=np.inf, found=best, refutation=None, steps=steps)
        high = min(2 * high, top)
    inside = bisect(feasible, refuted, low, high, rtol=rtol)
    return replace(inside, steps=inside.steps + steps)
