"""Thesis 6.1: one constraint of a model, algebraic or differential, and the checks of a definition."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import sympy as sp

from pumplib.errors import ParameterError

_RATE = "_dot"  # a symbol x_dot is the time derivative of the unknown x


@dataclass(frozen=True, kw_only=True, slots=True)
class Constraint:
    """One algebraic or differential constraint.

    Parameters
    ----------
    name : str
        Short name, as in the table of the model.
    relation : sympy.Expr, optional
        Zero where the constraint holds; None for a differential constraint.
    rate, state : sympy.Symbol, optional
        Of a differential constraint: `rate` is the time derivative of `state`.
    """

    name: str
    relation: sp.Expr | None = None
    rate: sp.Symbol | None = None
    state: sp.Symbol | None = None

    @property
    def is_differential(self) -> bool:
        """Whether the constraint says that a rate is the derivative of a state."""
        return self.relation is None

    @property
    def symbols(self) -> frozenset[sp.Symbol]:
        """All symbols of the constraint: variables, faults and parameters."""
        if self.relation is None:
            return frozenset(s for s in (self.rate, self.state) if s is not None)
        return frozenset(self.relation.free_symbols)

    def __str__(self) -> str:
        return (
            f"{self.name}: {self.rate} = d{self.state}/dt"
            if self.relation is None
            else f"{self.name}: 0 = {self.relation}"
        )


def kinds(model: str, declared: Mapping[str, Sequence[sp.Symbol]]) -> dict[sp.Symbol, str]:
    """What each symbol of a model is.

    Parameters
    ----------
    model : str
        Name of the model, shown in errors.
    declared : mapping of str to sequence of sympy.Symbol
        Meaning -> symbols.

    Returns
    -------
    dict of sympy.Symbol to str

    Raises
    ------
    ParameterError
        If something is no symbol, a symbol has two meanings, or two symbols have one name.
    """
    kind: dict[sp.Symbol, str] = {}
    by_name: dict[str, sp.Symbol] = {}
    for what, symbols in declared.items():
        for symbol in symbols:
            if not isinstance(symbol, sp.Symbol):
                raise ParameterError(f"{model}: {what} {symbol!r} is no SymPy symbol.")
            if symbol in kind:
                both = f"both {kind[symbol]} and {what}" if kind[symbol] != what else f"twice among the {what}s"
                raise ParameterError(f"{model}: {symbol} is {both}; a symbol has one meaning.")
            if symbol.name in by_name:
                raise ParameterError(
                    f"{model}: two symbols are named {symbol}; SymPy tells them apart by their assumptions, "
                    "so use one symbol with the same assumptions everywhere."
                )
            kind[symbol], by_name[symbol.name] = what, symbol
    return kind


def check_constraint(model: str, constraint: Constraint, kind: Mapping[sp.Symbol, str]) -> None:
    """Check one constraint against the declared symbols.

    Parameters
    ----------
    model : str
        Name of the model, shown in errors.
    constraint : Constraint
        The constraint.
    kind : mapping of sympy.Symbol to str
        What each symbol is, as from `kinds`.

    Raises
    ------
    ParameterError
        If a symbol is not declared, no unknown is in it, or it is neither a relation nor a rate with its state.
    """
    where = f"{model}, constraint {constraint.name}"
    if (constraint.relation is None) != (constraint.rate is not None and constraint.state is not None):
        raise ParameterError(f"{where}: give either a relation or a rate with its state.")
    if constraint.relation is not None and constraint.relation.has(sp.Derivative, sp.Integral, sp.nan, sp.zoo, sp.oo):
        raise ParameterError(
            f"{where}: contains a derivative, an integral or something that is not finite; write a rate as a symbol "
            "x_dot of its own and add the differential constraint (x_dot, x)."
        )
    names = {symbol.name: symbol for symbol in kind}
    for symbol in sorted(constraint.symbols, key=str):
        if symbol not in kind and symbol.name in names:
            raise ParameterError(
                f"{where}: its {symbol} has other assumptions than the declared {symbol}; use the same SymPy symbol."
            )
        if symbol not in kind:
            raise ParameterError(
                f"{where}: symbol {symbol} is neither unknown, known, fault nor parameter; declare it."
            )
    if not any(kind[symbol] == "unknown" for symbol in constraint.symbols):
        raise ParameterError(
            f"{where}: contains no unknown variable: a relation among known variables is a residual already."
        )


def check_rates(model: str, constraints: Sequence[Constraint], unknown: Sequence[sp.Symbol], part: bool) -> None:
    """Check that each rate has one state, and each derivative its differential constraint.

    Parameters
    ----------
    model : str
        Name of the model, shown in errors.
    constraints : sequence of Constraint
        All constraints.
    unknown : sequence of sympy.Symbol
        Unknown variables.
    part : bool
        Whether the model is a part of another one: a rate may then be without its differential constraint.

    Raises
    ------
    ParameterError
        If a rate or state is used twice or is no unknown, a rate is in no relation, or a symbol x_dot of an unknown x
        is in no differential constraint.
    """
    rates: dict[sp.Symbol, str] = {}
    states: dict[sp.Symbol, str] = {}
    in_relations = frozenset().union(*(c.symbols for c in constraints if not c.is_differential))
    for c in constraints:
        if not c.is_differential:
            continue
        where = f"{model}, constraint {c.name}"
        if c.rate == c.state:
            raise ParameterError(f"{where}: rate and state are the same symbol {c.rate}.")
        for symbol, what, found in ((c.rate, "rate", rates), (c.state, "state", states)):
            if symbol in found:
                raise ParameterError(f"{where}: {what} {symbol} is already the {what} in {found[symbol]}.")
            if symbol not in unknown:
                raise ParameterError(f"{where}: {what} {symbol} must be an unknown; a measurement is y - {symbol} = 0.")
            found[symbol] = c.name
        if not part and c.rate not in in_relations and c.rate not in states:
            raise ParameterError(f"{where}: rate {c.rate} is in no other constraint.")
    if part:
        return
    for symbol in unknown:
        if symbol.name.endswith(_RATE) and symbol not in rates:
            state = symbol.name.removesuffix(_RATE)
            if any(one.name == state for one in unknown):
                users = ", ".join(c.name for c in constraints if symbol in c.symbols)
                raise ParameterError(
                    f"{model}, constraint {users}: {symbol} is a derivative without its differential constraint; "
                    f"add ({symbol}, {state})."
                )
