"""Thesis 1.3, 6.2: what a realization is, and the report of how it was reached or why there is none."""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from typing import Any

import sympy as sp

from pumplib.errors import ParameterError, PumplibError
from pumplib.structure.elimination import Branch
from pumplib.structure.integrals import Closure, Integrals


class RealizationError(PumplibError):
    """A subsystem has no realization; the message has the outcome, what failed and the remedy."""


class Outcome(Enum):
    """Outcome of a realization; `meaning` explains it and `remedy` says what can be done.

    References
    ----------
    Thesis 6.2 (reconstruction).
    """

    OK = "OK"
    OK_NO_OUTPUT = "OK, no output"
    FAIL_1 = "FAIL-1"
    FAIL_2 = "FAIL-2"
    FAIL_3 = "FAIL-3"
    FAIL_4 = "FAIL-4"
    FAIL_5 = "FAIL-5"
    FAIL_6 = "FAIL-6"

    @property
    def meaning(self) -> str:
        """What happened."""
        return _MEANING[self][0]

    @property
    def remedy(self) -> str:
        """What can be done about it."""
        return _MEANING[self][1]


_MEANING = {
    Outcome.OK: ("states, outputs and residuals without unknowns and without a differentiated signal", "none needed"),
    Outcome.OK_NO_OUTPUT: (
        "a state-space form without unknowns, but no equation is left to test",
        "add a constraint: the subsystem is not over-constrained",
    ),
    Outcome.FAIL_1: (
        "an algebraic unknown in an output equation has no solution in closed form",
        "give the equation in a form that can be solved, or take that unknown as measured",
    ),
    Outcome.FAIL_2: (
        "an unknown input does not enter the rates linearly",
        "name the nonlinear terms as new unknown inputs (separate=True does it for all of them)",
    ),
    Outcome.FAIL_3: (
        "the unknown inputs reach every function of the state, at once or through their Lie brackets",
        "no residual without derivatives exists for this subsystem; differentiate a measurement (derivative causality)",
    ),
    Outcome.FAIL_4: (
        "functions that the unknown inputs do not reach exist locally, but none was found in closed form",
        "raise max_degree, change the coordinates, or integrate the fields numerically",
    ),
    Outcome.FAIL_5: (
        "such functions exist only with a known signal in them, whose rate would be needed",
        "if the signal is an input whose rate is known, pass it in signal_rates; or put |dT/ds ds/dt| in the threshold",
    ),
    Outcome.FAIL_6: (
        "the new states and the outputs cannot be solved for the old states, also not after iteration",
        "give another preference of branches, or leave out an output",
    ),
}


@dataclass(frozen=True, kw_only=True, slots=True)
class Explicit:
    """A subsystem after the output transformation.

    Parameters
    ----------
    states : tuple of sympy.Symbol
        x.
    rates : tuple of sympy.Expr
        dx/dt in x, the unknown inputs and the known signals.
    inputs : tuple of sympy.Symbol
        Unknown inputs that are left.
    outputs : tuple of (str, sympy.Expr)
        Names of the unused constraints and what is zero in them.
    """

    states: tuple[Any, ...]
    rates: tuple[Any, ...]
    inputs: tuple[Any, ...]
    outputs: tuple[tuple[str, Any], ...]


@dataclass(frozen=True, kw_only=True, slots=True)
class Transformation:
    """One state transformation.

    Parameters
    ----------
    system : Explicit
        What it started from.
    fields : tuple of tuple of sympy.Expr
        Input fields, one per unknown input.
    replaced : dict
        Known signals that were replaced in the fields by what the outputs say they are.
    closure : Closure
        Their involutive closure.
    integrals : Integrals
        The functions T of the states that become the new states.
    used : tuple of str
        Outputs that the old states were solved from; empty if the transformation had to be iterated.
    tried : tuple of (tuple of str, int or None)
        Every combination of outputs with the number of operations of the result, None where it could not be solved.
    dropped : tuple of sympy.Symbol
        States whose differential equations were dropped for the next iteration.
    """

    system: Explicit
    fields: tuple[tuple[Any, ...], ...]
    replaced: dict[Any, Any]
    closure: Closure
    integrals: Integrals
    used: tuple[str, ...] = ()
    tried: tuple[tuple[tuple[str, ...], int | None], ...] = ()
    dropped: tuple[Any, ...] = ()


@dataclass(frozen=True, kw_only=True, slots=True)
class Realization:
    """dz/dt = f_z(z, s), 0 = h_z(z, s): no unknown but the states z, no derivative of a known signal s.

    Parameters
    ----------
    name : str
        Name of the subsystem.
    constraints : tuple of str
        Constraints it uses.
    states : tuple of sympy.Symbol
        z.
    definitions : tuple of sympy.Expr
        z = T(x) in the states of the model.
    rates : tuple of sympy.Expr
        f_z.
    residuals : tuple of sympy.Expr
        h_z, zero in the healthy system.
    signals : tuple of sympy.Symbol
        Known signals that occur, inputs of the residual generator.
    parameters : tuple of sympy.Symbol
        Parameters that occur.
    values : dict
        Unknowns of the model that are determined -> expressions in z and s.
    singular : tuple of sympy.Expr
        The form holds where none of these is zero.
    radicands : tuple of sympy.Expr
        The form holds where none of these is negative.
    equivalent : bool
        Whether the form has the same trajectories of known signals as the subsystem; otherwise those of the subsystem
        are among its own (a dropped equation would need a derivative).
    """

    name: str
    constraints: tuple[str, ...]
    states: tuple[Any, ...]
    definitions: tuple[Any, ...]
    rates: tuple[Any, ...]
    residuals: tuple[Any, ...]
    signals: tuple[Any, ...]
    parameters: tuple[Any, ...]
    values: dict[Any, Any]
    singular: tuple[Any, ...]
    radicands: tuple[Any, ...]
    equivalent: bool

    def latex(self) -> str:
        """The realization as LaTeX, states with their meaning.

        Returns
        -------
        str
            An `aligned` environment without dollar signs.
        """
        lines = [
            rf"{sp.latex(z)} &= {sp.latex(T)}" for z, T in zip(self.states, self.definitions, strict=True) if z != T
        ]
        lines += [rf"\dot{{{sp.latex(z)}}} &= {sp.latex(f)}" for z, f in zip(self.states, self.rates, strict=True)]
        lines += [rf"0 &= {sp.latex(h)}" for h in self.residuals]
        return "\\begin{aligned}\n" + " \\\\\n".join(lines) + "\n\\end{aligned}"

    def start(self, values: Mapping[str, float]) -> tuple[float, ...]:
        """New states at known old ones.

        Parameters
        ----------
        values : mapping of str to float
            Old states and parameters by name, SI.

        Returns
        -------
        tuple of float

        Raises
        ------
        ParameterError
            If one is missing.
        """
        result = []
        for z, T in zip(self.states, self.definitions, strict=True):
            missing = sorted(s.name for s in T.free_symbols if s.name not in values)
            if missing:
                raise ParameterError(f"{self.name}: start of {z} = {T} needs {', '.join(missing)}; give its value.")
            result.append(float(T.evalf(30, subs={s: values[s.name] for s in T.free_symbols})))
        return tuple(result)


@dataclass(frozen=True, kw_only=True, slots=True)
class Report:
    """How a realization went.

    Parameters
    ----------
    name : str
        Name of the subsystem.
    constraints : tuple of str
        Its constraints.
    outcome : Outcome
        OK or what failed.
    detail : str
        What exactly.
    remedy : str
        What can be done.
    realization : Realization or None
        The result, None unless the outcome is OK or OK_NO_OUTPUT.
    explicit : Explicit or None
        System after the output transformation.
    transformations : tuple of Transformation
        One per iteration.
    steps : tuple of str
        Which constraint was solved for what.
    branches : tuple of Branch
        Where there were several solutions.
    singular : tuple of sympy.Expr
        Divisors met on the way.
    """

    name: str
    constraints: tuple[str, ...]
    outcome: Outcome
    detail: str
    remedy: str
    realization: Realization | None
    explicit: Explicit | None
    transformations: tuple[Transformation, ...]
    steps: tuple[str, ...]
    branches: tuple[Branch, ...]
    singular: tuple[Any, ...]

    @property
    def ok(self) -> bool:
        """Whether there is a residual."""
        return self.outcome is Outcome.OK

    def require(self) -> Realization:
        """The realization.

        Returns
        -------
        Realization

        Raises
        ------
        RealizationError
            If there is no residual; the message says why and what can be done.
        """
        if self.realization is None or not self.ok:
            raise RealizationError(
                f"{self.name}: {self.outcome.value}: {self.outcome.meaning}. {self.detail} Remedy: {self.remedy}."
            )
        return self.realization

    def text(self) -> str:
        """The whole report as plain text.

        Returns
        -------
        str
        """
        lines = [f"{self.name} ({', '.join(self.constraints)}): {self.outcome.value}", f"  {self.outcome.meaning}"]
        lines += [f"  {self.detail}"] if self.detail else []
        lines += [f"  remedy: {self.remedy}"] if not self.ok else []
        lines += [f"  solved: {step}" for step in self.steps]
        for branch in self.branches:
            names = ", ".join(map(str, branch.unknowns))
            why = "as preferred" if branch.preferred else "NO PREFERENCE GIVEN, the first was taken"
            lines.append(f"  branch {branch.chosen + 1} of {len(branch.solutions)} for {names}: {why}")
        for k, one in enumerate(self.transformations, 1):
            lines.append(
                f"  transformation {k}: {len(one.system.states)} states, rank of the inputs {one.closure.span}, "
                f"of their closure {one.closure.rank}"
            )
            lines += [f"    {s} replaced in the fields by {v}" for s, v in one.replaced.items()]
            if one.integrals.functions:
                lines.append(f"    T = {', '.join(map(str, one.integrals.functions))} ({one.integrals.method})")
            for origin, cost in one.tried:
                result = "no solution in closed form" if cost is None else f"{cost} operations"
                lines.append(f"    old states from {', '.join(origin) or 'T alone'}: {result}")
            if one.dropped:
                lines.append(f"    iterated without the equations of {', '.join(map(str, one.dropped))}")
        if self.singular:
            lines.append(f"  not valid where one of these is zero: {', '.join(map(str, self.singular))}")
        found = self.realization
        if found is not None:
            if found.radicands:
                lines.append(f"  not valid where one of these is negative: {', '.join(map(str, found.radicands))}")
            if not found.equivalent:
                lines.append("  necessary only: an equation that would need a derivative was dropped")
            lines += [f"  {z} = {T}" for z, T in zip(found.states, found.definitions, strict=True)]
            lines += [f"  d{z}/dt = {f}" for z, f in zip(found.states, found.rates, strict=True)]
            lines += [f"  0 = {h}" for h in found.residuals]
        return "\n".join(lines)
