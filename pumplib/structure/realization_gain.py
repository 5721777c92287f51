"""Thesis 6.6: injection gains for realizations, and the form whose error equation is exactly linear."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import sympy as sp

from pumplib.errors import ParameterError
from pumplib.structure.elimination import Prefer, eliminate
from pumplib.structure.realization_report import Realization
from pumplib.structure.symbolics import is_zero, shortest


def with_linear_error(realization: Realization, prefer: Prefer | None = None) -> Realization:
    """The form in which every state is replaced by what the residual equations say it is.

    dz/dt = f_z(zeta(s), s) and 0 = zeta(s) - z. With the gain k times unity the error obeys e' = -k e exactly,
    from any start and for any k > 0; without it f_z is only integrated.

    Parameters
    ----------
    realization : Realization
        A form with as many residuals as states.
    prefer : callable, optional
        Which of several solutions is meant.

    Returns
    -------
    Realization

    Raises
    ------
    ParameterError
        If the residuals cannot be solved for the states.
    """
    solved = eliminate(
        [(f"h{k}", h) for k, h in enumerate(realization.residuals)], realization.states, prefer=prefer, express=False
    )
    if solved.left or solved.remaining:
        raise ParameterError(
            f"{realization.name}: {', '.join(map(str, solved.left)) or 'too few states'}: the residuals do not "
            "determine the states; use a gain (linearized_gain) instead."
        )
    residuals = tuple(shortest(solved.values[z] - z) for z in realization.states)
    rates = tuple(shortest(f.subs(solved.values)) for f in realization.rates)
    used = set().union(*(e.free_symbols for e in (*rates, *residuals)))
    roots = set().union(*(e.atoms(sp.Pow) for e in (*rates, *residuals)))
    return replace(
        realization,
        rates=rates,
        residuals=residuals,
        signals=tuple(s for s in realization.signals if s in used),
        parameters=tuple(p for p in realization.parameters if p in used),
        singular=tuple(dict.fromkeys((*realization.singular, *solved.record.singular))),
        radicands=tuple(
            sorted(
                {p.base for p in roots if p.exp.is_Rational and p.exp.q % 2 == 0 and not p.base.is_nonnegative},
                key=sp.default_sort_key,
            )
        ),
    )


def rate_gain(realization: Realization, k: float | Any) -> list[list[Any]]:
    """Gain of a form with one state and one residual under which a small error decays with rate k.

    Parameters
    ----------
    realization : Realization
        The form.
    k : float or sympy.Expr
        Rate added to the form's own, 1/s.

    Returns
    -------
    list of list of sympy.Expr, shape (1, 1)
        -k / (dh/dz).

    Raises
    ------
    ParameterError
        If the form has another shape, the residual does not see the state, or k is not positive.
    """
    if len(realization.states) != 1 or len(realization.residuals) != 1:
        raise ParameterError(
            f"{realization.name}: {len(realization.states)} states and {len(realization.residuals)} residuals; "
            "a rate alone is enough for one of each only (linearized_gain)."
        )
    if not isinstance(k, sp.Basic) and not k > 0:
        raise ParameterError(f"{realization.name}: k = {k} 1/s; must be positive.")
    slope = sp.diff(realization.residuals[0], realization.states[0])
    if is_zero(slope):
        raise ParameterError(f"{realization.name}: the residual does not depend on {realization.states[0]}.")
    return [[shortest(-sp.sympify(k) / slope)]]


def identity_gain(realization: Realization, k: float | Any) -> list[list[Any]]:
    """Gain k times unity, for forms from `with_linear_error`.

    Parameters
    ----------
    realization : Realization
        The form.
    k : float or sympy.Expr
        Decay rate of the error, 1/s.

    Returns
    -------
    list of list, shape (states, residuals)

    Raises
    ------
    ParameterError
        If the numbers of states and residuals differ.
    """
    n, q = len(realization.states), len(realization.residuals)
    if n != q:
        raise ParameterError(f"{realization.name}: {n} states and {q} residuals; must be as many.")
    return [[sp.sympify(k) if i == j else sp.S.Zero for j in range(n)] for i in range(n)]


def linearized_gain(
    realization: Realization, point: Mapping[str, float], rate: float, noise: Sequence[float] | None = None
) -> list[list[float]]:
    """Constant gain for the form linearized at an operating point, from a Riccati equation shifted by a decay rate.

    Parameters
    ----------
    realization : Realization
        The form.
    point : mapping of str to float
        States z, signals and parameters by name, SI.
    rate : float
        The linearized error decays at least as fast, 1/s.
    noise : sequence of float, optional
        Relative size of what disturbs each state (its scale), by default one.

    Returns
    -------
    list of list of float, shape (states, residuals)

    Raises
    ------
    ParameterError
        If a value is missing or the states are not detectable there.

    References
    ----------
    B. D. O. Anderson, J. B. Moore, Optimal Control (1990), section 3.5 (prescribed degree of stability).
    """
    from scipy.linalg import LinAlgError, solve_continuous_are

    def numbers(rows: list[list[Any]]) -> Any:
        result = np.empty((len(rows), len(rows[0])))
        for i, row in enumerate(rows):
            for j, entry in enumerate(row):
                missing = sorted(s.name for s in entry.free_symbols if s.name not in point)
                if missing:
                    raise ParameterError(f"{realization.name}: point lacks {', '.join(missing)}.")
                result[i, j] = float(entry.evalf(30, subs={s: point[s.name] for s in entry.free_symbols}))
        return result

    A = numbers([[sp.diff(f, z) for z in realization.states] for f in realization.rates])
    C = numbers([[sp.diff(h, z) for z in realization.states] for h in realization.residuals])
    scale = np.ones(len(A)) if noise is None else np.asarray(noise, dtype=float)
    shifted = A + rate * np.eye(len(A))
    try:
        X = solve_continuous_are(shifted.T, C.T, np.diag(scale**2), np.eye(len(C)))
    except (LinAlgError, ValueError) as error:
        raise ParameterError(
            f"{realization.name}: no gain for rate = {rate} 1/s at this point: the states are not detectable from the "
            f"residual there ({error}); choose another point or a smaller rate."
        ) from error
    # The residual is h = y - C z with slope C here, so the injected term needs the opposite sign.
    L = -X @ C.T
    slowest = float(np.linalg.eigvals(A + L @ C).real.max())
    if not slowest < -rate * (1 - 1e-6):
        raise ParameterError(f"{realization.name}: slowest error mode {slowest} 1/s at this point, wanted -{rate} 1/s.")
    return [[float(v) for v in row] for row in L]
