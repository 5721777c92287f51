"""Thesis 6.1: a model as named constraints between known and unknown variables, one definition for every use.

The relations are SymPy expressions that are zero when the constraint holds. From the same definition come the structure
(`StructuralModel.structure`), the symbolic realization and the numbers of the residuals (`StructuralModel.function`).
That a rate is the time derivative of a state is a constraint of its own.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import sympy as sp

from pumplib.errors import ParameterError
from pumplib.structure.constraint import Constraint, check_constraint, check_rates, kinds
from pumplib.structure.graph import Structure

__all__ = ["FAULTS_AS", "Constraint", "FaultsAs", "StructuralModel", "define"]

FaultsAs = Literal["terms", "absent", "unknown"]
FAULTS_AS = ("terms", "absent", "unknown")


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class StructuralModel:
    """Constraints with their variables, faults and parameters; `define` builds one from plain dictionaries.

    Parameters
    ----------
    name : str
        Name of the model, shown in errors.
    constraints : tuple of Constraint
        In the order of the table of the model.
    unknown : tuple of sympy.Symbol
        Variables that are not measured: states, their rates and algebraic ones.
    known : tuple of sympy.Symbol
        Inputs and measurements.
    faults : tuple of sympy.Symbol
        Zero in the healthy machine.
    parameters : tuple of sympy.Symbol
        Constants with known values.
    part : bool
        Whether the model is a part of another one: a rate may then be without its differential constraint.

    Raises
    ------
    ParameterError
        If the definition contradicts itself; the message names the constraint or the symbol.
    """

    name: str
    constraints: tuple[Constraint, ...]
    unknown: tuple[sp.Symbol, ...]
    known: tuple[sp.Symbol, ...] = ()
    faults: tuple[sp.Symbol, ...] = ()
    parameters: tuple[sp.Symbol, ...] = ()
    part: bool = False

    def __post_init__(self) -> None:
        kind = kinds(
            self.name,
            {"unknown": self.unknown, "known": self.known, "fault": self.faults, "parameter": self.parameters},
        )
        seen: set[str] = set()
        for constraint in self.constraints:
            if constraint.name in seen:
                raise ParameterError(f"{self.name}: two constraints are named {constraint.name}; rename one.")
            seen.add(constraint.name)
            check_constraint(self.name, constraint, kind)
        check_rates(self.name, self.constraints, self.unknown, self.part)
        used = frozenset().union(*(c.symbols for c in self.constraints))
        for what, symbols in (("unknown", self.unknown), ("fault", self.faults), ("known variable", self.known)):
            for symbol in symbols:
                if symbol not in used:
                    raise ParameterError(
                        f"{self.name}: {what} {symbol} is in no constraint; leave it out or write its relation."
                    )

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the constraints."""
        return tuple(c.name for c in self.constraints)

    @property
    def derivatives(self) -> dict[sp.Symbol, sp.Symbol]:
        """Rate -> state of the differential constraints."""
        return {c.rate: c.state for c in self.constraints if c.rate is not None and c.state is not None}

    @property
    def states(self) -> tuple[sp.Symbol, ...]:
        """States of the differential constraints."""
        return tuple(self.derivatives.values())

    @property
    def rates(self) -> tuple[sp.Symbol, ...]:
        """Rates of the differential constraints."""
        return tuple(self.derivatives)

    @property
    def algebraic(self) -> tuple[sp.Symbol, ...]:
        """Unknowns that are neither a state nor a rate."""
        dynamic = {*self.states, *self.rates}
        return tuple(x for x in self.unknown if x not in dynamic)

    @property
    def relations(self) -> dict[str, sp.Expr]:
        """Name -> relation of the algebraic constraints."""
        return {c.name: c.relation for c in self.constraints if c.relation is not None}

    def __getitem__(self, name: str) -> Constraint:
        """Constraint of a name."""
        for constraint in self.constraints:
            if constraint.name == name:
                return constraint
        raise ParameterError(f"{self.name}: no constraint {name!r}; there are {', '.join(self.names)}.")

    def symbol(self, name: str) -> sp.Symbol:
        """Symbol of a name.

        Parameters
        ----------
        name : str
            Name of an unknown, known variable, fault or parameter.

        Returns
        -------
        sympy.Symbol

        Raises
        ------
        ParameterError
            If the model has no such symbol.
        """
        for symbol in (*self.unknown, *self.known, *self.faults, *self.parameters):
            if symbol.name == name:
                return symbol
        raise ParameterError(f"{self.name}: no symbol {name!r}.")

    def faults_of(self, name: str) -> tuple[sp.Symbol, ...]:
        """Faults that enter a constraint.

        Parameters
        ----------
        name : str
            Name of the constraint.

        Returns
        -------
        tuple of sympy.Symbol
        """
        found = self[name].symbols
        return tuple(f for f in self.faults if f in found)

    def submodel(self, constraints: Iterable[str], name: str | None = None) -> StructuralModel:
        """Model of some of the constraints, with only the symbols that occur in them.

        Parameters
        ----------
        constraints : iterable of str
            Names; they keep the order of the model.
        name : str, optional
            Name of the part; by default that of the model.

        Returns
        -------
        StructuralModel

        Raises
        ------
        ParameterError
            If there is no such constraint or none is given.
        """
        asked = {self[one].name for one in constraints}
        if not asked:
            raise ParameterError(f"{self.name}: a part needs at least one constraint.")
        chosen = tuple(c for c in self.constraints if c.name in asked)
        used = frozenset().union(*(c.symbols for c in chosen))
        return StructuralModel(
            name=name or self.name,
            constraints=chosen,
            unknown=tuple(s for s in self.unknown if s in used),
            known=tuple(s for s in self.known if s in used),
            faults=tuple(s for s in self.faults if s in used),
            parameters=tuple(s for s in self.parameters if s in used),
            part=True,
        )

    def with_known(self, symbols: Iterable[sp.Symbol | str], name: str | None = None) -> StructuralModel:
        """The same model with some unknowns taken as known, because another subsystem determines them.

        Parameters
        ----------
        symbols : iterable of sympy.Symbol or str
            Unknowns; neither the state nor the rate of a differential constraint.
        name : str, optional
            Name of the new model.

        Returns
        -------
        StructuralModel

        Raises
        ------
        ParameterError
            If one is no unknown, or belongs to a differential constraint, or a constraint is left without an unknown.
        """
        asked = [self.symbol(s) if isinstance(s, str) else s for s in symbols]
        for symbol in asked:
            if symbol not in self.unknown:
                raise ParameterError(f"{self.name}: {symbol} is no unknown, so it cannot become known.")
            if symbol in self.states or symbol in self.rates:
                raise ParameterError(
                    f"{self.name}: {symbol} is in a differential constraint; add the measurement y - {symbol} = 0."
                )
        return StructuralModel(
            name=name or self.name,
            constraints=self.constraints,
            unknown=tuple(s for s in self.unknown if s not in asked),
            known=(*self.known, *asked),
            faults=self.faults,
            parameters=self.parameters,
            part=self.part,
        )

    def healthy(self, faults: Iterable[sp.Symbol | str] | None = None, name: str | None = None) -> StructuralModel:
        """The model with faults at zero: variables that occur only together with such a fault leave the constraint.

        Parameters
        ----------
        faults : iterable of sympy.Symbol or str, optional
            Faults that are absent; by default all.
        name : str, optional
            Name of the new model.

        Returns
        -------
        StructuralModel

        Raises
        ------
        ParameterError
            If one is no fault of the model.
        """
        absent = list(self.faults) if faults is None else [self.symbol(f) if isinstance(f, str) else f for f in faults]
        for fault in absent:
            if fault not in self.faults:
                raise ParameterError(f"{self.name}: {fault} is no fault; there are {', '.join(map(str, self.faults))}.")
        zero = {fault: sp.S.Zero for fault in absent}
        constraints = tuple(
            c if c.relation is None else Constraint(name=c.name, relation=c.relation.subs(zero))
            for c in self.constraints
        )
        used = frozenset().union(*(c.symbols for c in constraints))
        return StructuralModel(
            name=name or self.name,
            constraints=constraints,
            unknown=tuple(s for s in self.unknown if s in used),
            known=tuple(s for s in self.known if s in used),
            faults=tuple(s for s in self.faults if s in used),
            parameters=tuple(s for s in self.parameters if s in used),
            part=True,
        )

    def structure(self, faults: FaultsAs = "terms") -> Structure:
        """Structure of the model.

        Parameters
        ----------
        faults : {"terms", "absent", "unknown"}
            "terms": a fault is no variable, but what it multiplies belongs to the constraint (a leakage brings the
            head into the flow balance). "absent": structure of the healthy model, faults at zero. "unknown": every
            fault symbol is one more unknown variable.

        Returns
        -------
        Structure
            The faults of each constraint are kept in all three forms.

        Raises
        ------
        ParameterError
            If `faults` is another word.
        """
        if faults not in FAULTS_AS:
            raise ParameterError(f"{self.name}: faults = {faults!r}; must be one of {', '.join(FAULTS_AS)}.")
        source = self.healthy() if faults == "absent" else self
        columns = (*source.unknown, *self.faults) if faults == "unknown" else source.unknown
        place = {symbol: k for k, symbol in enumerate(columns)}
        fault_place = {symbol: k for k, symbol in enumerate(self.faults)}
        return Structure(
            name=self.name,
            constraints=self.names,
            unknowns=tuple(s.name for s in columns),
            rows=tuple(sum(1 << place[s] for s in c.symbols if s in place) for c in source.constraints),
            faults=tuple(f.name for f in self.faults),
            fault_rows=tuple(sum(1 << fault_place[s] for s in c.symbols if s in fault_place) for c in self.constraints),
            differential=tuple(
                (c.name, c.rate.name, c.state.name)
                for c in self.constraints
                if c.rate is not None and c.state is not None
            ),
        )

    def function(self, name: str) -> Callable[[Mapping[str, Any]], Any]:
        """Numeric residual of an algebraic constraint, from the same relation as the structure.

        Parameters
        ----------
        name : str
            Name of the constraint.

        Returns
        -------
        callable
            Takes values by the names of the symbols (numbers or arrays of one shape, SI) and returns the residual,
            zero where the constraint holds, in the unit of the relation. Faults that are left out are zero.

        Raises
        ------
        ParameterError
            If the constraint is a differential one; the callable raises it for a value that is missing or not a
            number.
        """
        constraint = self[name]
        if constraint.relation is None:
            raise ParameterError(f"{self.name}: {constraint} has no value at one instant; compare {constraint.rate} "
                                 f"with the slope of {constraint.state} over a record.")  # fmt: skip
        order = sorted(constraint.symbols, key=str)
        code = sp.lambdify(order, constraint.relation, modules="numpy", cse=True)
        optional = {f.name for f in self.faults}

        def residual(values: Mapping[str, Any]) -> Any:
            given = []
            for symbol in order:
                if symbol.name not in values and symbol.name not in optional:
                    raise ParameterError(f"{self.name}, constraint {name}: no value of {symbol.name} was given.")
                value = np.asarray(values.get(symbol.name, 0.0), dtype=np.float64)
                if np.isnan(value).any():
                    raise ParameterError(f"{self.name}, constraint {name}: {symbol.name} contains NaN.")
                given.append(value)
            return code(*given)

        return residual


def define(
    name: str,
    *,
    relations: Mapping[str, Any],
    derivatives: Mapping[str, tuple[sp.Symbol, sp.Symbol]] | None = None,
    unknown: Iterable[sp.Symbol],
    known: Iterable[sp.Symbol] = (),
    faults: Iterable[sp.Symbol] = (),
    parameters: Iterable[sp.Symbol] = (),
) -> StructuralModel:
    """Define a model from dictionaries.

    Parameters
    ----------
    name : str
        Name of the model, shown in errors.
    relations : mapping of str to sympy.Eq or sympy.Expr
        Algebraic constraints; an expression is zero where the constraint holds.
    derivatives : mapping of str to (sympy.Symbol, sympy.Symbol), optional
        Differential constraints: name -> (rate, state).
    unknown, known, faults, parameters : iterable of sympy.Symbol
        What each symbol is.

    Returns
    -------
    StructuralModel

    Raises
    ------
    ParameterError
        If a relation is no SymPy relation, or the definition contradicts itself; the message names the constraint.
    """
    constraints = []
    for label, relation in relations.items():
        if isinstance(relation, sp.Equality):
            expression = relation.lhs - relation.rhs
        elif isinstance(relation, sp.Expr):
            expression = relation
        else:
            raise ParameterError(f"{name}: constraint {label} is {relation!r}; must be a SymPy equation or expression.")
        constraints.append(Constraint(name=label, relation=expression))
    for label, pair in (derivatives or {}).items():
        if not (isinstance(pair, tuple) and len(pair) == 2 and all(isinstance(s, sp.Symbol) for s in pair)):
            raise ParameterError(f"{name}: differential constraint {label} is {pair!r}; must be (rate, state).")
        constraints.append(Constraint(name=label, rate=pair[0], state=pair[1]))
    return StructuralModel(
        name=name,
        constraints=tuple(constraints),
        unknown=tuple(unknown),
        known=tuple(known),
        faults=tuple(faults),
        parameters=tuple(parameters),
    )
