"""Thesis 1.3, 6.2: zero tests, ranks and short forms of expressions, the same in every process."""

from collections.abc import Sequence
from functools import lru_cache
from math import isqrt
from typing import Any

import sympy as sp

_DIGITS = 60
_FACTORED = 40  # operations up to which factorization is worth its time
_TINY = 1e-30  # far above the rounding of 60 digits, far below any value of a nonzero expression at a general point


@lru_cache(maxsize=4096)
def _coordinate(index: int, point: int) -> Any:
    """Digits of the root of a prime, moved to (0.5, 1.5): as general as a point can be, without chance."""
    import mpmath  # type: ignore[import-untyped]

    prime = sp.prime(7 + 3 * index + 401 * point)
    scale = 10 ** (_DIGITS + 10)
    with mpmath.workdps(_DIGITS + 10):
        return mpmath.mpf(isqrt(prime * scale * scale) % scale) / scale + 0.5


def values_at(expressions: Sequence[Any], point: int = 0) -> list[Any]:
    """Values of expressions at a fixed general point, 60 digits.

    Parameters
    ----------
    expressions : sequence of sympy.Expr
        Their symbols are sorted by name and given the coordinates of the point.
    point : int
        Number of the point.

    Returns
    -------
    list of mpmath numbers
        Complex where a root of a negative number is taken.
    """
    import mpmath

    symbols = sorted(set().union(*(sp.sympify(one).free_symbols for one in expressions)), key=lambda s: s.name)
    with mpmath.workdps(_DIGITS):
        evaluate = sp.lambdify(symbols, list(expressions), modules="mpmath", cse=True)
        return list(evaluate(*(_coordinate(k, point) for k in range(len(symbols)))))


def numeric_rank(rows: Sequence[Sequence[Any]]) -> int:
    """Rank of a matrix of expressions at a general point: a certain lower bound of the generic rank.

    Parameters
    ----------
    rows : sequence of sequence of sympy.Expr
        The matrix.

    Returns
    -------
    int
    """
    import mpmath

    if not rows:
        return 0
    width = len(rows[0])
    flat = values_at([entry for row in rows for entry in row])
    with mpmath.workdps(_DIGITS):
        matrix = [flat[k * width : (k + 1) * width] for k in range(len(rows))]
        rank = 0
        for column in range(width):
            best = max(range(rank, len(matrix)), key=lambda k: abs(matrix[k][column]), default=None)
            if best is None or abs(matrix[best][column]) < _TINY * max(1, *(abs(v) for row in matrix for v in row)):
                continue
            matrix[rank], matrix[best] = matrix[best], matrix[rank]
            for k in range(rank + 1, len(matrix)):
                factor = matrix[k][column] / matrix[rank][column]
                matrix[k] = [a - factor * b for a, b in zip(matrix[k], matrix[rank], strict=True)]
            rank += 1
        return rank


def is_rational(expression: Any) -> bool:
    """Whether an expression is a rational function of its symbols.

    Parameters
    ----------
    expression : sympy.Expr
        The expression.

    Returns
    -------
    bool
    """
    return bool(expression.is_rational_function())


def is_zero(expression: Any, *, prove: bool = False) -> bool:
    """Whether an expression is identically zero.

    Parameters
    ----------
    expression : sympy.Expr
        The expression.
    prove : bool
        Demand a symbolic proof; without it two general points decide.

    Returns
    -------
    bool
        With `prove`, False also when the expression is zero at the points but no proof was found.
    """
    expression = sp.sympify(expression)
    if expression == 0:
        return True
    if not expression.free_symbols and expression.is_Rational:
        return False
    for point in (0, 1):
        terms = expression.args if expression.is_Add else (expression,)
        values = values_at([expression, *terms], point)
        if abs(values[0]) > _TINY * max(1, *(abs(v) for v in values[1:])):
            return False
    if not prove:
        return True
    if is_rational(expression):
        return bool(sp.cancel(sp.together(expression)) == 0)
    return any(method(expression) == 0 for method in (sp.expand, sp.cancel, sp.trigsimp, sp.simplify))


def tidy(expression: Any) -> Any:
    """Canonical form of a rational function; other expressions are brought over one denominator.

    Parameters
    ----------
    expression : sympy.Expr
        The expression.

    Returns
    -------
    sympy.Expr
        Zero if it is zero.
    """
    expression = sp.sympify(expression)
    if expression.is_Atom:
        return expression
    if is_rational(expression):
        return sp.cancel(expression)
    return sp.S.Zero if is_zero(expression) else sp.cancel(sp.together(expression))


@lru_cache(maxsize=4096)
def shortest(expression: Any) -> Any:
    """Among a few equal forms of an expression the one with the fewest operations, the given one if it is as short.

    Parameters
    ----------
    expression : sympy.Expr
        The expression.

    Returns
    -------
    sympy.Expr
    """
    expression = sp.sympify(expression)
    if expression.is_Atom:
        return expression
    forms = [expression, sp.cancel(expression)] if is_rational(expression) else [expression, sp.expand(expression)]
    forms.append(sp.factor_terms(forms[1]))
    if is_rational(expression):
        if sp.count_ops(forms[1]) <= _FACTORED:
            forms.append(sp.factor(forms[1]))
        forms.append(sp.expand(forms[1]))
    return min(forms, key=lambda form: (sp.count_ops(form), sp.default_sort_key(form)))
