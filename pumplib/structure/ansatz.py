"""Thesis 1.3, 6.2: first integrals that are sums of Laurent monomials, by linear algebra.

The coefficients of sum_k c_k prod_i x_i^e_ki are unknown, (dT/dx) g = 0 is linear in them. The null space is
first taken modulo a prime with numbers for the parameters, which tells which monomials take part; only those few
are then solved for exactly. With functions=True also exponentials, sines, cosines and roots of the state are factors.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import product
from typing import Any

import sympy as sp

_PRIME = 2**61 - 1
Exponent = tuple[int, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class _Frame:
    """Generators of the monomials, what a field does to each of them and the relations between them."""

    generators: tuple[Any, ...]
    moves: tuple[tuple[dict[Exponent, Any], ...], ...]  # per field: per generator: polynomial, common factor removed
    squares: dict[int, dict[Exponent, Any]]  # index of a generator -> polynomial equal to its square


@lru_cache(maxsize=64)
def _exponents(n: int, degree: int, whole: tuple[bool, ...]) -> tuple[Exponent, ...]:
    """Exponents in order of simplicity; degree 0 stands for the linear functions."""
    if degree == 0:
        return tuple(tuple(int(i == k) for i in range(n)) for k in range(n))
    ranges = [range(0 if only else -degree, degree + 1) for only in whole]
    chosen = [e for e in product(*ranges) if 0 < sum(map(abs, e)) <= degree + 1]
    return tuple(sorted(chosen, key=lambda e: (sum(map(abs, e)), any(v < 0 for v in e), [-v for v in e])))


def _terms(polynomial: Any, generators: Sequence[Any]) -> dict[Exponent, Any] | None:
    try:
        return dict(sp.Poly(polynomial, *generators).terms())
    except sp.PolynomialError:
        return None


def _frame(fields: Sequence[Sequence[Any]], states: Sequence[Any], functions: bool) -> _Frame | None:
    """Generators and moves, None if the fields are not rational in the generators."""
    extra: list[Any] = []
    squares: dict[int, Any] = {}
    names: dict[Any, Any] = {}
    generators = list(states)

    def name(function: Any) -> Any:
        if function not in names:
            names[function] = sp.Dummy(f"g{len(names)}")
            extra.append(function)
            generators.append(names[function])
        return names[function]

    if functions:
        for atom in sorted(
            set().union(*(entry.atoms(sp.Function, sp.Pow) for f in fields for entry in f)), key=sp.default_sort_key
        ):
            if not atom.free_symbols & set(states):
                continue
            if isinstance(atom, sp.exp):
                name(atom)
            elif isinstance(atom, sp.sin | sp.cos):
                sine, cosine = name(sp.sin(atom.args[0])), name(sp.cos(atom.args[0]))
                squares[generators.index(sine)] = 1 - cosine**2
            elif isinstance(atom, sp.Pow) and abs(atom.exp) == sp.S.Half:
                root = name(sp.sqrt(atom.base))
                names[1 / sp.sqrt(atom.base)] = 1 / root
                squares[generators.index(root)] = atom.base
        if not extra:
            return None
    moves = []
    for field in fields:
        along = [
            sum((sp.diff(g, x) * v for x, v in zip(states, field, strict=True)), sp.S.Zero).xreplace(names)
            for g in (*states, *extra)
        ]
        common = sp.S.One
        for entry in along:
            if not entry.is_rational_function(*generators):
                return None
            common = sp.lcm(common, sp.denom(sp.cancel(entry)))
        polynomials = [_terms(sp.cancel(entry * common), generators) for entry in along]
        if any(one is None for one in polynomials):
            return None
        moves.append(tuple(one for one in polynomials if one is not None))
    rules = {k: _terms(square.xreplace(names), generators) for k, square in squares.items()}
    if any(one is None for one in rules.values()):
        return None
    return _Frame(
        generators=(*states, *extra), moves=tuple(moves), squares={k: v for k, v in rules.items() if v is not None}
    )


def _reduced(terms: dict[Exponent, Any], squares: dict[int, dict[Exponent, Any]]) -> dict[Exponent, Any]:
    """Replace squares of generators by what they are equal to, until none is left."""
    done: dict[Exponent, Any] = {}
    waiting = list(terms.items())
    while waiting:
        e, c = waiting.pop()
        k = next((k for k in squares if e[k] >= 2), None)
        if k is None:
            done[e] = done.get(e, 0) + c
        else:
            low = tuple(v - 2 * (i == k) for i, v in enumerate(e))
            waiting.extend((tuple(a + b for a, b in zip(low, f, strict=True)), c * d) for f, d in squares[k].items())
    return done


def _column(frame: _Frame, e: Exponent, moves: Sequence[Sequence[dict[Exponent, Any]]], squares: Any) -> dict[Any, Any]:
    """Derivative of one monomial along every field: coefficient of each monomial that appears."""
    column: dict[Any, Any] = {}
    for number, move in enumerate(moves):
        terms: dict[Exponent, Any] = {}
        for i, power in enumerate(e):
            if power:
                for f, c in move[i].items():
                    key = tuple(a + b - (j == i) for j, (a, b) in enumerate(zip(e, f, strict=True)))
                    terms[key] = terms.get(key, 0) + power * c
        for key, value in (_reduced(terms, squares) if squares else terms).items():
            column[number, key] = value
    return column


def _modular(coefficient: Any) -> int:
    """Residue of a coefficient with numbers for its symbols; irrational constants are symbols, too."""
    import zlib

    atoms = {
        a
        for a in coefficient.atoms(sp.Symbol, sp.NumberSymbol, sp.Function, sp.Pow)
        if not (a.is_Pow and a.exp.is_Integer)
    }
    numbers = {a: sp.Integer(zlib.crc32(sp.srepr(a).encode()) + 12345) for a in atoms}
    value = sp.Rational(coefficient.xreplace(numbers))
    return int(value.p) * pow(int(value.q), -1, _PRIME) % _PRIME


def _supports(columns: Sequence[dict[Any, int]]) -> list[list[int]]:
    """Column sets of a null space basis modulo the prime; the last of a set is its most complicated monomial."""
    reduced: dict[Any, tuple[dict[Any, int], dict[int, int]]] = {}  # pivot row -> column, and its make-up
    result: list[list[int]] = []
    for k, column in enumerate(columns):
        rest, made = {r: v % _PRIME for r, v in column.items() if v % _PRIME}, {k: 1}
        while rest:
            row = next((r for r in rest if r in reduced), None)
            if row is None:
                break
            pivot, how = reduced[row]
            factor = rest[row] * pow(pivot[row], -1, _PRIME) % _PRIME
            for target, source in ((rest, pivot), (made, how)):
                for r, v in source.items():
                    left = (target.get(r, 0) - factor * v) % _PRIME
                    if left:
                        target[r] = left
                    else:
                        target.pop(r, None)
        if rest:
            # Keep every stored column free of the other pivot rows, so that the loop above always ends.
            row = min(rest, key=repr)
            for other, (pivot, how) in reduced.items():
                if row in pivot:
                    factor = pivot[row] * pow(rest[row], -1, _PRIME) % _PRIME
                    for target, source in ((pivot, rest), (how, made)):
                        for r, v in source.items():
                            left = (target.get(r, 0) - factor * v) % _PRIME
                            if left:
                                target[r] = left
                            else:
                                target.pop(r, None)
                    reduced[other] = (pivot, how)
            reduced[row] = (rest, made)
        else:
            result.append(sorted(made))
    return result


def _exact(columns: Sequence[dict[Any, Any]]) -> list[Any] | None:
    """Coefficients of the one relation between the columns, denominators cleared."""
    rows = sorted({r for column in columns for r in column}, key=repr)
    if not rows:
        return [sp.S.One] if len(columns) == 1 else None
    matrix = sp.Matrix([[sp.sympify(column.get(r, 0)) for column in columns] for r in rows])
    from sympy.polys.matrices import DomainMatrix

    null = DomainMatrix.from_Matrix(matrix).to_field().nullspace().to_Matrix()
    if null.rows != 1:
        return None
    entries = [sp.cancel(entry) for entry in null.row(0)]
    entries = [sp.cancel(entry / entries[-1]) for entry in entries]
    common = sp.S.One
    for entry in entries:
        common = sp.lcm(common, sp.denom(entry))
    entries = [sp.cancel(entry * common) for entry in entries]
    divisor = sp.S.Zero
    for entry in entries:
        divisor = sp.gcd(divisor, entry)
    entries = [sp.cancel(entry / divisor) for entry in entries]
    lead = entries[0]
    return [-entry for entry in entries] if lead.could_extract_minus_sign() else entries


def ansatz_integrals(
    fields: Sequence[Sequence[Any]], states: Sequence[Any], degree: int, *, functions: bool = False
) -> list[Any]:
    """Sums of Laurent monomials that are constant along all fields.

    Parameters
    ----------
    fields : sequence of sequence of sympy.Expr
        The fields, one component per state.
    states : sequence of sympy.Symbol
        The coordinates.
    degree : int
        Largest size of an exponent; their sum is at most one more. Zero: linear functions only.
    functions : bool
        Whether exponentials, sines, cosines and square roots found in the fields are factors, too.

    Returns
    -------
    list of sympy.Expr
        Simplest first; not necessarily independent as functions (powers and products of one another).
    """
    fields = [[sp.nsimplify(entry, rational=True) for entry in field] for field in fields]
    frame = _frame(fields, states, functions)
    if frame is None:
        return []
    whole = tuple(k in frame.squares or k >= len(states) for k in range(len(frame.generators)))
    exponents = [
        e for e in _exponents(len(frame.generators), degree, whole) if not any(e[k] > 1 for k in frame.squares)
    ]
    numbers = tuple(tuple({f: _modular(c) for f, c in p.items()} for p in move) for move in frame.moves)
    squares = {k: {f: _modular(c) for f, c in p.items()} for k, p in frame.squares.items()}
    supports = _supports([_column(frame, e, numbers, squares) for e in exponents])
    result = []
    for support in supports:
        chosen = [exponents[k] for k in support]
        coefficients = _exact([_column(frame, e, frame.moves, frame.squares) for e in chosen])
        if coefficients is not None:
            result.append(
                sum(
                    (
                        c * sp.prod(g**p for g, p in zip(frame.generators, e, strict=True))
                        for c, e in zip(coefficients, chosen, strict=True)
                    ),
                    sp.S.Zero,
                )
            )
    return result
