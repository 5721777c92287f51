"""Thesis 1.3, 6.2: algebraic unknowns are solved for and substituted (output transformation), smallest blocks first.

Blocks of one, two or three equations with as many unknowns are solved, the cheapest first; when none is left, an
unknown that enters a remaining equation linearly is expressed by the others. Which of several solutions is
meant is asked of the caller: `nearest_to` and `largest_at` answer from an operating point.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import combinations
from typing import Any

import sympy as sp

from pumplib.errors import ParameterError
from pumplib.structure.symbolics import is_zero, shortest

Prefer = Callable[[tuple[Any, ...], tuple[Mapping[Any, Any], ...]], int | None]
_LARGEST = 3  # equations of the largest block solved at once
_LONG = 400  # operations of a root that is no longer called a closed form


@dataclass(frozen=True, kw_only=True, slots=True)
class Branch:
    """A block of equations that had several solutions.

    Parameters
    ----------
    unknowns : tuple of sympy.Symbol
        What was solved for.
    solutions : tuple of tuple of sympy.Expr
        All solutions, shortest first.
    chosen : int
        Number of the one taken.
    preferred : bool
        Whether the caller chose it; otherwise it is only the first.
    """

    unknowns: tuple[Any, ...]
    solutions: tuple[tuple[Any, ...], ...]
    chosen: int
    preferred: bool


@dataclass(slots=True)
class Record:
    """What an elimination decided and assumed; collected along the way.

    Parameters
    ----------
    branches : list of Branch
        Blocks with several solutions.
    singular : list of sympy.Expr
        Divisors: the result holds where none is zero.
    steps : list of str
        One line a step.
    """

    branches: list[Branch] = field(default_factory=list)
    singular: list[Any] = field(default_factory=list)
    steps: list[str] = field(default_factory=list)

    def add(self, other: "Record") -> None:
        """Append another record.

        Parameters
        ----------
        other : Record
            What a later elimination decided.
        """
        self.branches += other.branches
        self.singular += [one for one in other.singular if one not in self.singular]
        self.steps += other.steps

    def divide_by(self, divisor: Any) -> None:
        """Note a divisor that is not a constant.

        Parameters
        ----------
        divisor : sympy.Expr
            Must not vanish.
        """
        if divisor.free_symbols and divisor not in self.singular:
            self.singular.append(divisor)


@dataclass(frozen=True, kw_only=True, slots=True)
class Solved:
    """Outcome of an elimination.

    Parameters
    ----------
    values : dict
        Unknown -> expression, free of every solved unknown.
    remaining : tuple of (str, sympy.Expr)
        Equations not used, with the values substituted.
    left : tuple of sympy.Symbol
        Unknowns without a value.
    record : Record
        Branches, divisors, steps.
    """

    values: dict[Any, Any]
    remaining: tuple[tuple[str, Any], ...]
    left: tuple[Any, ...]
    record: Record


def _number(expression: Any, values: Mapping[str, float]) -> float | None:
    symbols = expression.free_symbols
    if any(s.name not in values for s in symbols):
        return None
    value = complex(expression.evalf(30, subs={s: sp.Float(values[s.name], 30) for s in symbols}))
    return value.real if abs(value.imag) <= 1e-9 * max(abs(value), 1e-300) else None


def nearest_to(values: Mapping[str, float]) -> Prefer:
    """Preference for the solution that is nearest to an operating point.

    Parameters
    ----------
    values : mapping of str to float
        Value of every symbol at the point, by name, SI; symbols made on the way (`z_1`) are not needed.

    Returns
    -------
    callable
        For `prefer`; has no opinion where a value is missing or all solutions are complex.
    """

    def prefer(unknowns: tuple[Any, ...], solutions: tuple[Mapping[Any, Any], ...]) -> int | None:
        known = [u for u in unknowns if u.name in values]
        best: tuple[float, int] | None = None
        for k, solution in enumerate(solutions):
            found = [(_number(solution[u], values), values[u.name]) for u in known]
            if not found or any(value is None for value, _ in found):
                continue
            error = sum(abs(value - goal) / (abs(goal) or 1.0) for value, goal in found if value is not None)
            if best is None or error < best[0]:
                best = (error, k)
        return None if best is None else best[1]

    return prefer


def largest_at(values: Mapping[str, float]) -> Prefer:
    """Preference for the solution that is largest at an operating point (a pump: the larger flow at a head).

    Parameters
    ----------
    values : mapping of str to float
        Value of every symbol that the solutions contain, by name, SI.

    Returns
    -------
    callable
        For `prefer`; has no opinion on blocks of several unknowns or where no solution is real.
    """

    def prefer(unknowns: tuple[Any, ...], solutions: tuple[Mapping[Any, Any], ...]) -> int | None:
        if len(unknowns) != 1:
            return None
        found = [(_number(solution[unknowns[0]], values), k) for k, solution in enumerate(solutions)]
        real = [(value, k) for value, k in found if value is not None]
        return max(real)[1] if real else None

    return prefer


def depends(expression: Any, symbol: Any) -> bool:
    """Whether an expression really depends on a symbol, not only in its written form.

    Parameters
    ----------
    expression : sympy.Expr
        The expression.
    symbol : sympy.Symbol
        The symbol.

    Returns
    -------
    bool
    """
    return symbol in expression.free_symbols and not is_zero(sp.diff(expression, symbol))


def _slope(expression: Any, unknown: Any) -> Any | None:
    """Factor of an unknown that enters linearly, None if it does not."""
    slope = sp.diff(expression, unknown)
    if unknown in slope.free_symbols:
        return None if depends(slope, unknown) else slope.subs(unknown, 0)
    return slope


def _inverses(function: Any, value: Any) -> list[tuple[Any, Any]]:
    """Pairs (argument, what it is equal to) where a function has a value."""
    if isinstance(function, sp.exp):
        return [(function.args[0], sp.log(value))]
    if isinstance(function, sp.log):
        return [(function.args[0], sp.exp(value))]
    if isinstance(function, sp.tan):
        return [(function.args[0], sp.atan(value))]
    if isinstance(function, sp.sin):
        return [(function.args[0], sp.asin(value)), (function.args[0], sp.pi - sp.asin(value))]
    if isinstance(function, sp.cos):
        return [(function.args[0], sp.acos(value)), (function.args[0], -sp.acos(value))]
    if function.is_Pow and function.exp.is_Rational:
        return [(function.base, value ** (1 / function.exp))]
    return []


def _through_a_function(equation: Any, unknown: Any, record: "Record") -> list[Any]:
    """Solutions where the unknown is in one function only (several calls of it with the same argument)."""
    inside = [
        a
        for a in equation.atoms(sp.Function, sp.Pow)
        if unknown in a.free_symbols and not (a.is_Pow and (a.exp.is_Integer or a.base == unknown))
    ]
    found: list[Any] = []
    for function in sorted(inside, key=lambda a: (-sp.count_ops(a), sp.default_sort_key(a))):
        value = sp.Dummy("value")
        rest = equation.xreplace({function: value, 1 / function: 1 / value})
        if unknown in rest.free_symbols:
            continue
        for one in roots(rest, value, record):
            for argument, goal in _inverses(function, one):
                found += roots(argument - goal, unknown, record)
        break
    return found


def roots(equation: Any, unknown: Any, record: Record) -> list[Any]:
    """Solutions of one equation in closed form.

    Parameters
    ----------
    equation : sympy.Expr
        Zero where it holds.
    unknown : sympy.Symbol
        What to solve for.
    record : Record
        Takes the divisors.

    Returns
    -------
    list of sympy.Expr
        Empty if no closed form was found.
    """
    slope = _slope(equation, unknown)
    if slope is not None:
        if is_zero(slope):
            return []
        record.divide_by(slope)
        return [-equation.subs(unknown, 0) / slope]
    numerator = sp.fraction(sp.together(equation))[0]
    found: list[Any] = []
    try:
        factors = [one for one, _ in sp.factor_list(numerator)[1] if unknown in one.free_symbols]
        polynomials = [sp.Poly(one, unknown) for one in factors]
    except sp.PolynomialError:
        polynomials = []
    for polynomial in polynomials:
        degree = polynomial.degree()
        coefficients = polynomial.all_coeffs()
        lead = coefficients[0]
        if degree <= 2 or not any(coefficients[1:-1]):
            record.divide_by(lead)
        if degree == 1:
            found.append(-coefficients[1] / lead)
        elif degree == 2:
            _, b, c = coefficients
            root = sp.sqrt(b**2 - 4 * lead * c)
            found += [(-b + root) / (2 * lead), (-b - root) / (2 * lead)]
        elif not any(coefficients[1:-1]):
            root = sp.root(-coefficients[-1] / lead, degree)
            found += [root] if degree % 2 else [root, -root]
        else:
            return []
    if not polynomials:
        found = _through_a_function(numerator, unknown, record)
    return [] if any(sp.count_ops(one) > _LONG for one in found) else found


def _linear(equations: Sequence[Any], unknowns: Sequence[Any], record: Record) -> dict[Any, Any] | None:
    try:
        matrix, right = sp.linear_eq_to_matrix(list(equations), list(unknowns))
    except (ValueError, sp.SympifyError):
        return None
    determinant = matrix.det()
    if is_zero(determinant):
        return None
    record.divide_by(shortest(determinant))
    solution = matrix.adjugate() * right
    return {u: shortest(value / determinant) for u, value in zip(unknowns, solution, strict=True)}


def _block(equations: Sequence[Any], unknowns: Sequence[Any], record: Record) -> list[dict[Any, Any]]:
    """All solutions of a block in closed form, by the cheapest substitution."""
    if len(unknowns) == 1:
        return [{unknowns[0]: one} for one in roots(equations[0], unknowns[0], record)]
    linear = _linear(equations, unknowns, record)
    if linear is not None:
        return [linear]
    order = []
    for k, equation in enumerate(equations):
        for u in unknowns:
            if u in equation.free_symbols:
                slope = _slope(equation, u)
                order.append((slope is None, sp.count_ops(slope or equation), k, u.name, u))
    for _, _, k, _, u in sorted(order, key=lambda one: one[:4]):
        solutions = []
        trial = Record()
        for value in roots(equations[k], u, trial):
            rest = [e.subs(u, value) for j, e in enumerate(equations) if j != k]
            others = [v for v in unknowns if v != u]
            solutions += [{**more, u: value.subs(more)} for more in _block(rest, others, trial)]
        if solutions:
            record.add(trial)
            return solutions
    return []


def _choose(solutions: list[dict[Any, Any]], names: Sequence[str], prefer: Prefer | None, record: Record) -> Any:
    """One solution of several, by the caller's preference."""
    unknowns = tuple(sorted(solutions[0], key=lambda u: str(u.name)))
    ordered = sorted(solutions, key=lambda s: [(sp.count_ops(s[u]), sp.default_sort_key(s[u])) for u in unknowns])
    chosen, preferred = 0, False
    if len(ordered) > 1:
        answer = prefer(unknowns, tuple(ordered)) if prefer is not None else None
        if answer is not None and not 0 <= answer < len(ordered):
            raise ParameterError(f"prefer: answer {answer} for {unknowns}; must be None or 0 to {len(ordered) - 1}.")
        chosen, preferred = (0, False) if answer is None else (answer, True)
        record.branches.append(
            Branch(
                unknowns=unknowns,
                solutions=tuple(tuple(s[u] for u in unknowns) for s in ordered),
                chosen=chosen,
                preferred=preferred,
            )
        )
    solution = ordered[chosen]
    record.steps.append(f"{', '.join(names)} -> " + ", ".join(f"{u} = {solution[u]}" for u in unknowns))
    return solution


def eliminate(
    equations: Iterable[tuple[str, Any]],
    unknowns: Iterable[Any],
    *,
    first: Sequence[Any] = (),
    prefer: Prefer | None = None,
    express: bool = True,
) -> Solved:
    """Solve for as many unknowns as the equations determine; the unused equations are the outputs.

    Parameters
    ----------
    equations : iterable of (str, sympy.Expr)
        Names and expressions that are zero.
    unknowns : iterable of sympy.Symbol
        What to solve for; every other symbol counts as given.
    first : sequence of sympy.Symbol
        Unknowns to express first when there are more of them than equations (the rates).
    prefer : callable, optional
        Told the unknowns of a block and its solutions, returns the number of the one that is meant or None.
    express : bool
        Whether unknowns are expressed by other unknowns when no block is left.

    Returns
    -------
    Solved

    References
    ----------
    Thesis 1.3, 6.2.
    """
    remaining = [(name, sp.sympify(expression)) for name, expression in equations]
    left = list(unknowns)
    values: dict[Any, Any] = {}
    record = Record()
    hopeless: set[tuple[frozenset[str], frozenset[Any]]] = set()

    def open_in(expression: Any) -> list[Any]:
        return [u for u in left if u in expression.free_symbols]

    def take(names: Sequence[str], solution: Mapping[Any, Any]) -> None:
        nonlocal remaining
        for u in solution:
            left.remove(u)
        for u in list(values):
            if values[u].free_symbols & set(solution):
                values[u] = values[u].xreplace(dict(solution))
        values.update(solution)
        news = set().union(*(v.free_symbols for v in solution.values()))
        kept = []
        for name, expression in remaining:
            if name in names:
                continue
            if expression.free_symbols & set(solution):
                expression = expression.xreplace(dict(solution))
                if news & set(left):  # an unknown may have cancelled; only then is a shorter form worth its time
                    for u in open_in(expression):
                        if not depends(expression, u):
                            expression = shortest(expression)
                            expression = expression.subs(u, 1) if u in expression.free_symbols else expression
            kept.append((name, expression))
        remaining = kept

    def price(equation: Any, unknown: Any) -> tuple[Any, ...]:
        slope = _slope(equation, unknown)
        return (slope is None, len(slope.free_symbols) if slope is not None else 0, sp.count_ops(equation))

    def one_block() -> bool:
        for size in range(1, _LARGEST + 1):
            candidates = []
            usable = [(k, n, e, open_in(e)) for k, (n, e) in enumerate(remaining)]
            usable = [one for one in usable if 0 < len(one[3]) <= size]
            for group in combinations(usable, size):
                block = set().union(*(one[3] for one in group))
                key = (frozenset(one[1] for one in group), frozenset(block))
                if len(block) == size and key not in hopeless:
                    cost = (
                        price(group[0][2], group[0][3][0]) if size == 1 else (sum(sp.count_ops(g[2]) for g in group),)
                    )
                    candidates.append((cost, [one[0] for one in group], group, key))
            for _, _, group, key in sorted(candidates, key=lambda one: one[:2]):
                unknown = [u for u in left if u in key[1]]
                trial = Record()
                solutions = _block([one[2] for one in group], unknown, trial)
                if solutions:
                    names = [one[1] for one in group]
                    solution = _choose(solutions, names, prefer, trial)
                    record.add(trial)
                    take(names, solution)
                    return True
                hopeless.add(key)
        return False

    def one_expression() -> bool:
        candidates = []
        for k, (name, expression) in enumerate(remaining):
            for u in open_in(expression):
                slope = _slope(expression, u)
                if slope is not None and not is_zero(slope):
                    rank = first.index(u) if u in first else len(first)
                    candidates.append(((rank, len(slope.free_symbols), sp.count_ops(slope), k, u.name), name, u))
        if not candidates:
            return False
        _, name, u = min(candidates, key=lambda one: one[0])
        expression = dict(remaining)[name]
        solution = {u: roots(expression, u, record)[0]}
        record.steps.append(f"{name} -> {u} = {solution[u]}")
        take([name], solution)
        return True

    while one_block() or (express and one_expression()):
        pass
    return Solved(values=values, remaining=tuple(remaining), left=tuple(left), record=record)
