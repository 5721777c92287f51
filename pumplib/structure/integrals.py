"""Thesis 1.3, 6.2: functions of the state that an unknown input cannot move (first integrals).

A function T of the state has a derivative free of the unknown inputs exactly if it is constant along every
input field. Frobenius' theorem counts such functions: n minus the rank of the involutive closure of the fields.
This module builds the closure and looks for the functions in closed form.

A rank is evaluated at fixed points of 60 digits. It is then certainly not too high, and the integrals found
afterwards, whose derivatives are checked symbolically, prove that it is not too low either.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any, Literal

import sympy as sp

from pumplib.structure.ansatz import ansatz_integrals
from pumplib.structure.symbolics import is_zero, numeric_rank, shortest, tidy

Field = tuple[Any, ...]
_HINTS = ("Bernoulli", "1st_homogeneous_coeff_subs_dep_div_indep")  # quick and certain to end
Method = Literal["coordinates", "monomials", "ordinary differential equation", "functions"]


@dataclass(frozen=True, kw_only=True, slots=True)
class Closure:
    """Smallest involutive distribution that contains some fields.

    Parameters
    ----------
    fields : tuple of tuple of sympy.Expr
        A basis in reduced echelon form, one component per state.
    rank : int
        Its rank at a general point.
    span : int
        Rank of the fields that were given, for all values of the signals; below `rank` if they are not involutive.
    singular : tuple of sympy.Expr
        Denominators of the basis: where one is zero the rank may drop.
    """

    fields: tuple[Field, ...]
    rank: int
    span: int
    singular: tuple[Any, ...]

    @property
    def involutive(self) -> bool:
        """Whether the given fields were involutive as they came."""
        return self.rank == self.span


@dataclass(frozen=True, kw_only=True, slots=True)
class Integrals:
    """First integrals of a distribution.

    Parameters
    ----------
    functions : tuple of sympy.Expr
        Functionally independent, simplest first.
    method : str
        Where the last of them came from.
    wanted : int
        Number that exists locally (states minus rank).
    """

    functions: tuple[Any, ...]
    method: Method
    wanted: int

    @property
    def complete(self) -> bool:
        """Whether all that exist were found in closed form."""
        return len(self.functions) == self.wanted


def lie_bracket(g: Sequence[Any], h: Sequence[Any], states: Sequence[Any]) -> Field:
    """Lie bracket [g, h] = (dh/dx) g - (dg/dx) h.

    Parameters
    ----------
    g, h : sequence of sympy.Expr
        Two fields, one component per state.
    states : sequence of sympy.Symbol
        The coordinates.

    Returns
    -------
    tuple of sympy.Expr
    """
    return tuple(
        tidy(sum((sp.diff(b, x) * v - sp.diff(a, x) * w for x, v, w in zip(states, g, h, strict=True)), sp.S.Zero))
        for a, b in zip(g, h, strict=True)
    )


def _echelon(fields: Sequence[Field]) -> tuple[list[Field], list[Any]]:
    """Reduced echelon form of the fields and the pivots divided by."""
    rows = [list(row) for row in fields]
    pivots: list[Any] = []
    done = 0
    for column in range(len(rows[0])):
        found = [k for k in range(done, len(rows)) if not is_zero(rows[k][column])]
        if not found:
            continue
        # A constant pivot has no zero; otherwise the shortest expression keeps the others short.
        best = min(found, key=lambda k: (bool(rows[k][column].free_symbols), sp.count_ops(rows[k][column]), k))
        rows[done], rows[best] = rows[best], rows[done]
        pivot = rows[done][column]
        pivots.append(pivot)
        rows[done] = [tidy(entry / pivot) for entry in rows[done]]
        for k, row in enumerate(rows):
            if k != done and row[column] != 0:
                rows[k] = [tidy(a - row[column] * b) for a, b in zip(row, rows[done], strict=True)]
        done += 1
        if done == len(rows):
            break
    return [tuple(row) for row in rows[:done]], pivots


def involutive_closure(fields: Sequence[Sequence[Any]], states: Sequence[Any], varied: Sequence[Any] = ()) -> Closure:
    """Involutive closure of some fields, for every value of the signals that enter them.

    Parameters
    ----------
    fields : sequence of sequence of sympy.Expr
        The input fields, one component per state.
    states : sequence of sympy.Symbol
        The coordinates.
    varied : sequence of sympy.Symbol
        Signals whose rate is unknown. A function that does not depend on them must be constant along the fields
        for each of their values, so the derivatives of the fields by them belong to the distribution.

    Returns
    -------
    Closure

    References
    ----------
    Thesis 1.3, 6.2. A. Isidori, Nonlinear Control Systems (1995), sections 1.3 and 1.4 (Frobenius).
    """
    given = [tuple(sp.sympify(entry) for entry in field) for field in fields]
    given = [field for field in given if any(entry != 0 for entry in field)]
    if not given:
        return Closure(fields=(), rank=0, span=0, singular=())
    basis, pivots = _echelon(given)
    singular = list(pivots)

    def enlarge(candidates: list[Field]) -> bool:
        nonlocal basis
        for candidate in candidates:
            if len(basis) == len(states):
                return False
            if any(entry != 0 for entry in candidate) and numeric_rank([*basis, candidate]) > len(basis):
                basis, more = _echelon([*basis, candidate])
                singular.extend(more)
                return True
        return False

    while enlarge([tuple(sp.diff(entry, s) for entry in field) for field in basis for s in varied]):
        pass
    span = len(basis)
    # In echelon form the brackets vanish exactly if the distribution is involutive.
    while enlarge([lie_bracket(g, h, states) for g, h in combinations(basis, 2)]) or enlarge(
        [tuple(sp.diff(entry, s) for entry in field) for field in basis for s in varied]
    ):
        pass
    used = [sp.denom(sp.together(entry)) for field in basis for entry in field]
    kept = [one for one in dict.fromkeys([*singular, *used]) if one.free_symbols & {*states, *varied}]
    return Closure(fields=tuple(basis), rank=len(basis), span=span, singular=tuple(kept))


def annihilates(function: Any, fields: Sequence[Sequence[Any]], states: Sequence[Any]) -> bool:
    """Whether (dT/dx) g = 0 for every field, checked symbolically.

    Parameters
    ----------
    function : sympy.Expr
        T.
    fields : sequence of sequence of sympy.Expr
        The fields.
    states : sequence of sympy.Symbol
        The coordinates.

    Returns
    -------
    bool
    """
    gradient = [sp.diff(function, x) for x in states]
    return all(
        is_zero(sum((a * b for a, b in zip(gradient, field, strict=True)), sp.S.Zero), prove=True) for field in fields
    )


def _closed(expression: Any, variable: Any) -> Any | None:
    """Indefinite integral, None if there is no closed form."""
    found = sp.integrate(expression, variable, meijerg=False, heurisch=False)  # the slow methods are left out
    return None if found.has(sp.Integral) else found


def _ode_candidates(x: Any, y: Any, slope: Any) -> Iterator[Any]:
    """Constants of dy/dx = slope(x, y): separable, linear in y, Bernoulli, homogeneous."""
    parts = sp.separatevars(slope, symbols=[x, y], dict=True)
    if parts is not None:
        left, right = _closed(1 / parts[y], y), _closed(parts["coeff"] * parts[x], x)
        if left is not None and right is not None:
            yield left - right
    factor = sp.simplify(sp.diff(slope, y))
    if y not in factor.free_symbols:
        exponent = _closed(factor, x)
        if exponent is not None:
            rest = _closed(sp.simplify(slope.subs(y, 0)) * sp.exp(-exponent), x)
            if rest is not None:
                yield y * sp.exp(-exponent) - rest
    y_of, constant = sp.Function("y_of_x")(x), sp.Symbol("C1")
    for hint in _HINTS:
        try:
            solutions = sp.dsolve(sp.Eq(y_of.diff(x), slope.subs(y, y_of)), y_of, hint=hint, simplify=False)
        except (RuntimeError, ValueError, TypeError):  # SymPy has no method for it
            continue
        for solution in solutions if isinstance(solutions, list) else [solutions]:
            equation = (solution.lhs - solution.rhs).subs(y_of, y)
            slope_of = sp.diff(equation, constant)
            if not equation.has(sp.Integral) and slope_of != 0 and constant not in slope_of.free_symbols:
                yield -equation.subs(constant, 0) / slope_of


def _by_ode(field: Field, states: Sequence[Any]) -> Any | None:
    """First integral of one field in the plane, from its characteristic equation."""
    (first, second), (a, b) = states, field
    if is_zero(a):
        return first
    if is_zero(b):
        return second
    for x, y, slope in ((first, second, b / a), (second, first, a / b)):
        for candidate in _ode_candidates(x, y, slope):
            try:
                if candidate.free_symbols & {x, y} and annihilates(candidate, [field], states):
                    return shortest(candidate)
            except ArithmeticError:  # a constant that divides by zero everywhere
                continue
    return None


def first_integrals(fields: Sequence[Sequence[Any]], states: Sequence[Any], *, max_degree: int = 3) -> Integrals:
    """Functions of the state that are constant along an involutive family of fields.

    Parameters
    ----------
    fields : sequence of sequence of sympy.Expr
        Basis of an involutive distribution (`involutive_closure`).
    states : sequence of sympy.Symbol
        The coordinates.
    max_degree : int
        Sums of Laurent monomials are tried with exponents up to this size, the sum of their sizes up to one more.

    Returns
    -------
    Integrals
        Not necessarily complete: an integral exists locally but need not have a closed form.

    References
    ----------
    Thesis 1.3, 6.2.
    """
    wanted = len(states) - len(fields)
    found: list[Any] = []
    method: Method = "coordinates"

    def accept(candidates: Sequence[Any], origin: Method) -> None:
        nonlocal method
        for T in candidates:
            if len(found) == wanted:
                return
            if numeric_rank([[sp.diff(one, x) for x in states] for one in (*found, T)]) > len(found) and annihilates(
                T, fields, states
            ):
                found.append(T)
                method = origin

    accept([x for k, x in enumerate(states) if all(field[k] == 0 for field in fields)], "coordinates")
    for degree in range(max_degree + 1):
        if len(found) < wanted:
            accept(ansatz_integrals(fields, states, degree), "monomials")
    if len(found) < wanted and len(states) == 2 and len(fields) == 1:
        integral = _by_ode(tuple(fields[0]), states)
        if integral is not None:
            accept([integral], "ordinary differential equation")
    for degree in range(1, max_degree + 1):
        if len(found) < wanted:
            accept(ansatz_integrals(fields, states, degree, functions=True), "functions")
    return Integrals(functions=tuple(found), method=method, wanted=wanted)
