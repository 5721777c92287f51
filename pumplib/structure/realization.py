"""Thesis 1.3, 6.2: from a structural subsystem to a state-space form whose only unknowns are its states.

Output transformation: algebraic unknowns are solved for (`elimination`). State transformation: the new states are
functions that the remaining unknown inputs cannot move (`integrals`), the old states follow from them and from outputs.
Where they do not, the equations of as many states as the inputs reach are dropped and the steps repeated. The
signals are never differentiated. Reconstruction: the surviving text has the idea and the notation (f_o, h_o, f_z, h_z).
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from itertools import combinations, count
from typing import Any

import sympy as sp

from pumplib.errors import ParameterError
from pumplib.structure.elimination import Prefer, Record, depends, eliminate, roots
from pumplib.structure.integrals import Closure, Integrals, annihilates, first_integrals, involutive_closure
from pumplib.structure.model import StructuralModel
from pumplib.structure.realization_report import Explicit, Outcome, Realization, Report, Transformation
from pumplib.structure.symbolics import numeric_rank, shortest

_HOPELESS = 2  # a form this many times longer than the best so far is not worth shortening


class _Failure(Exception):
    """A step has no result; becomes the outcome of the report."""

    def __init__(self, outcome: Outcome, detail: str, remedy: str = "") -> None:
        super().__init__(detail)
        self.outcome, self.detail, self.remedy = outcome, detail, remedy or outcome.remedy


@dataclass(slots=True)
class _Work:
    """What is carried from one iteration to the next."""

    prefer: Prefer | None
    signals: tuple[Any, ...]
    signal_rates: Mapping[Any, Any]
    separate: bool
    max_degree: int
    record: Record = field(default_factory=Record)
    transformations: list[Transformation] = field(default_factory=list)
    equivalent: bool = True


@dataclass(frozen=True, slots=True, kw_only=True)
class _Form:
    """Result of the state transformations."""

    states: tuple[Any, ...]
    definitions: tuple[Any, ...]
    rates: tuple[Any, ...]
    outputs: tuple[tuple[str, Any], ...]
    values: dict[Any, Any]  # old states and dropped ones in the new states


def _explicit(
    equations: Iterable[tuple[str, Any]], pairs: Mapping[Any, Any], algebraic: Iterable[Any], work: _Work
) -> tuple[Explicit, dict[Any, Any]]:
    """Output transformation: rates and algebraic unknowns in terms of states, inputs that are left, and signals."""
    solved = eliminate(equations, [*pairs, *algebraic], first=tuple(pairs), prefer=work.prefer)
    work.record.add(solved.record)
    for name, expression in solved.remaining:
        stuck = [u for u in solved.left if depends(expression, u)]
        if stuck:
            raise _Failure(
                Outcome.FAIL_1, f"{name}: 0 = {expression} is not solvable for {', '.join(map(str, stuck))}."
            )
    rates = tuple(solved.values.get(rate, rate) for rate in pairs)
    inputs = tuple(u for u in solved.left if any(depends(f, u) for f in rates))
    outputs = tuple((n, e) for n, e in solved.remaining if e.free_symbols & {*pairs.values(), *work.signals})
    return Explicit(states=tuple(pairs.values()), rates=rates, inputs=inputs, outputs=outputs), solved.values


def _fields(system: Explicit, work: _Work) -> tuple[list[tuple[Any, ...]], dict[Any, Any], list[Any]]:
    """Input fields, the signals replaced in them, and what they still vary with."""
    fields, varied = [], []
    for v in system.inputs:
        column = tuple(shortest(sp.diff(f, v)) for f in system.rates)
        fields.append(column)
        bent = [x for f, x in zip(column, system.states, strict=True) if any(depends(f, w) for w in system.inputs)]
        if bent and not work.separate:
            terms = sorted(
                {t for f in system.rates for t in sp.Add.make_args(sp.expand(f)) if v in t.free_symbols},
                key=sp.default_sort_key,
            )
            new = [t.as_independent(*system.inputs)[1] for t in terms]
            split = all(not (t.free_symbols - {*system.inputs}) for t in new)
            remedy = (
                f"take {', '.join(dict.fromkeys(map(str, new)))} as the new unknown input (separate=True)"
                if split
                else f"{v} enters through a function of the states, so measure it or model it more closely"
            )
            raise _Failure(Outcome.FAIL_2, f"{v} enters the rate of {', '.join(map(str, bent))} nonlinearly.", remedy)
    if work.separate:
        varied = [w for w in system.inputs if any(w in entry.free_symbols for f in fields for entry in f)]
    replaced: dict[Any, Any] = {}
    for s in work.signals:
        if not any(s in entry.free_symbols for f in fields for entry in f):
            continue
        for _, output in sorted(system.outputs, key=lambda one: sp.count_ops(one[1])):
            if s not in output.free_symbols or not output.free_symbols & set(system.states):
                continue
            found = roots(output, s, work.record)
            # Another signal in its place would have to be replaced in turn.
            if len(found) == 1 and not found[0].free_symbols & set(work.signals):
                replaced[s] = found[0]
                fields = [tuple(shortest(entry.subs(s, found[0])) for entry in f) for f in fields]
                break
    varied += [
        s for s in work.signals if s not in work.signal_rates and any(depends(entry, s) for f in fields for entry in f)
    ]
    return fields, replaced, varied


def _signal_failure(system: Explicit, fields: Any, varied: list[Any], work: _Work) -> None:
    """Full rank only because the fields vary with signals: report the integrals that contain them."""
    signals = [s for s in varied if s in work.signals]
    frozen = involutive_closure(fields, system.states, [s for s in varied if s not in signals])
    if not signals or frozen.rank == len(system.states):
        return
    found = first_integrals(frozen.fields, system.states, max_degree=work.max_degree).functions
    inside = [s for s in signals if any(s in T.free_symbols for T in found)] or signals
    raise _Failure(
        Outcome.FAIL_5,
        f"T = {', '.join(map(str, found)) or 'not found in closed form'} contains {', '.join(map(str, inside))}.",
    )


def _touchy(rows: list[list[Any]], system: Explicit, work: _Work) -> int:
    """Number of parameters at whose zero the old states are lost although the system itself stays regular."""
    powers = set().union(*(e.atoms(sp.Pow) for e in (*system.rates, *(e for _, e in system.outputs))), set())
    divided = set().union(*(p.base.free_symbols for p in powers if p.exp.is_negative), set())
    symbols = set().union(*(sp.sympify(e).free_symbols for row in rows for e in row), set())
    candidates = symbols - divided - {*work.signals, *system.states}
    return sum(
        numeric_rank([[sp.sympify(e).subs(p, 0) for e in row] for row in rows]) < len(rows[0]) for p in candidates
    )


def _old_states(
    system: Explicit, T: tuple[Any, ...], z: tuple[Any, ...], rates: tuple[Any, ...], rank: int, work: _Work
) -> tuple[_Form | None, tuple[str, ...], list[tuple[tuple[str, ...], int | None]]]:
    """Old states from outputs, at least as many as the inputs reach, and from new states for the rest.

    With more outputs a definition z = T(x) is left over and becomes a residual, often without any root.
    Of all combinations the shortest is kept, after those that do not degenerate when a parameter is zero of which the
    system itself is no worse: such a parameter may be small, and the residual would be mostly noise.
    """
    best: tuple[tuple[int, int, int], _Form, Record, tuple[str, ...]] | None = None
    tried: list[tuple[tuple[str, ...], int | None]] = []
    states = set(system.states)
    definitions = [(f"z{k}", t - one) for k, (one, t) in enumerate(zip(z, T, strict=True), 1)]
    ways = [
        (group, kept)
        for size in range(min(len(states), len(system.outputs)), rank - 1, -1)  # the short ones are often the first
        for group in combinations(system.outputs, size)
        for kept in combinations(definitions, len(states) - size)
    ]
    for group, kept in ways:
        names = tuple(name for name, _ in group)
        label = names if len(kept) == len(definitions) else (*names, *(name for name, _ in kept))
        rows = [[sp.diff(e, x) for x in system.states] for _, e in (*kept, *group)]
        if numeric_rank(rows) < len(states):
            tried.append((label, None))
            continue
        solved = eliminate([*kept, *group], system.states, prefer=work.prefer, express=False)
        new_rates = [f.subs(solved.values) for f in rates]
        rest = [(n, e.subs(solved.values)) for n, e in system.outputs if n not in names]
        rest += [(n, e.subs(solved.values)) for n, e in definitions if (n, e) not in kept]
        if solved.remaining or any(e.free_symbols & states for e in (*new_rates, *(e for _, e in rest))):
            tried.append((label, None))
            continue
        touchy = _touchy(rows, system, work)
        cost = sum(int(sp.count_ops(e)) for e in (*new_rates, *(e for _, e in rest)))
        if best is None or (touchy, cost) < (best[0][0], _HOPELESS * best[0][1]):
            new_rates = [shortest(f) for f in new_rates]
            rest = [(n, shortest(e)) for n, e in rest]
            cost = sum(int(sp.count_ops(e)) for e in (*new_rates, *(e for _, e in rest)))
        tried.append((label, cost))
        key = (touchy, cost, len(group))
        if best is None or key < best[0]:
            form = _Form(
                states=z, definitions=T, rates=tuple(new_rates), outputs=tuple(rest), values=dict(solved.values)
            )
            best = (key, form, solved.record, label)
    if best is None:
        return None, (), tried
    work.record.add(best[2])
    return best[1], best[3], tried


def _reduced(
    system: Explicit, T: tuple[Any, ...], z: tuple[Any, ...], rates: tuple[Any, ...], rank: int, work: _Work
) -> tuple[tuple[Any, ...], dict[Any, Any]]:
    """States to drop, and the others in terms of them and of the new states."""
    definitions = [(f"z{k}", t - one) for k, (one, t) in enumerate(zip(z, T, strict=True), 1)]
    best: tuple[int, tuple[Any, ...], dict[Any, Any], Record] | None = None
    for dropped in combinations(system.states, rank):
        others = [x for x in system.states if x not in dropped]
        if others and numeric_rank([[sp.diff(t, x) for x in others] for t in T]) < len(others):
            continue
        solved = eliminate(definitions, others, prefer=work.prefer, express=False)
        if solved.left:
            continue
        cost = sum(int(sp.count_ops(f.subs(solved.values))) for f in (*rates, *(e for _, e in system.outputs)))
        if best is None or cost < best[0]:
            best = (cost, dropped, dict(solved.values), solved.record)
    if best is None:
        raise _Failure(Outcome.FAIL_6, f"z = {', '.join(map(str, T))} is not solvable for any choice of states.")
    work.record.add(best[3])
    return best[1], best[2]


def _transformed(system: Explicit, work: _Work, names: Any) -> _Form:
    """State transformations until no unknown input is left."""
    if not system.inputs:
        return _Form(
            states=system.states, definitions=system.states, rates=system.rates, outputs=system.outputs, values={}
        )
    fields, replaced, varied = _fields(system, work)
    closure = involutive_closure(fields, system.states, varied)
    for one in closure.singular:
        work.record.divide_by(one)
    n, r = len(system.states), closure.rank

    def note(integrals: Integrals, **more: Any) -> None:
        work.transformations.append(
            Transformation(
                system=system, fields=tuple(fields), replaced=replaced, closure=closure, integrals=integrals, **more
            )
        )

    if r == n:
        note(Integrals(functions=(), method="coordinates", wanted=0), dropped=system.states)
        _signal_failure(system, fields, varied, work)
        return _static(system, closure, work)
    integrals = first_integrals(closure.fields, system.states, max_degree=work.max_degree)
    if not integrals.complete:
        note(integrals)
        found = f"found {', '.join(map(str, integrals.functions))}" if integrals.functions else "found none"
        raise _Failure(Outcome.FAIL_4, f"{integrals.wanted} functions are constant along {closure.fields}, {found}.")
    T = integrals.functions
    assert all(annihilates(t, fields, system.states) for t in T)
    z = tuple(sp.Symbol(f"z_{next(names)}", real=True) for _ in T)
    quiet = _without_inputs(system)
    rates = tuple(
        shortest(
            sum((sp.diff(t, x) * f for x, f in zip(system.states, quiet, strict=True)), sp.S.Zero)
            + sum((sp.diff(t, s) * rate for s, rate in work.signal_rates.items()), sp.S.Zero)
        )
        for t in T
    )
    work.equivalent &= closure.involutive
    form, used, tried = _old_states(system, T, z, rates, r, work)
    if form is not None:
        note(integrals, used=used, tried=tuple(tried))
        return form
    dropped, others = _reduced(system, T, z, rates, r, work)
    note(integrals, tried=tuple(tried), dropped=dropped)
    dots = {sp.Symbol(f"{one.name}_dot", real=True): one for one in z}
    equations = [
        *((f"d{one.name}", dot - f.subs(others)) for (dot, one), f in zip(dots.items(), rates, strict=True)),
        *((name, e.subs(others)) for name, e in system.outputs),
    ]
    inner, values = _explicit(equations, dots, dropped, work)
    final = _transformed(inner, work, names)
    back = dict(zip(z, T, strict=True))
    values = {x: v.subs(final.values) for x, v in values.items() if x in dropped}
    values |= {x: v.subs(values).subs(final.values) for x, v in others.items()}
    return _Form(
        states=final.states,
        definitions=tuple(shortest(t.subs(back)) for t in final.definitions),
        rates=final.rates,
        outputs=final.outputs,
        values=values | {x: v for x, v in final.values.items() if x not in z},
    )


def _without_inputs(system: Explicit) -> list[Any]:
    """Rates with the unknown inputs at a value where they are finite; the new rates do not depend on it."""
    for value in (sp.S.Zero, sp.S.One):
        rates = [f.subs(dict.fromkeys(system.inputs, value)) for f in system.rates]
        if not any(f.has(sp.zoo, sp.nan, sp.oo) for f in rates):
            return rates
    raise _Failure(Outcome.FAIL_2, "the rates are not finite for the unknown inputs at 0 and at 1.")


def _static(system: Explicit, closure: Closure, work: _Work) -> _Form:
    """Nothing of the state is left; the outputs alone may still contradict one another."""
    solved = eliminate(system.outputs, system.states, prefer=work.prefer, express=False)
    rest = tuple((n, shortest(e)) for n, e in solved.remaining if not e.free_symbols & set(solved.left))
    if not rest:
        more = "" if closure.involutive else " Lie brackets of the fields add to their span."
        raise _Failure(Outcome.FAIL_3, f"the fields of {', '.join(map(str, system.inputs))} reach all states.{more}")
    work.record.add(solved.record)
    work.equivalent &= closure.involutive
    return _Form(states=(), definitions=(), rates=(), outputs=rest, values=dict(solved.values))


def _needed(form: _Form) -> list[int]:
    """Numbers of the states that an output depends on, at once or through the rates."""
    needed: set[Any] = set().union(*(e.free_symbols for _, e in form.outputs), set()) & set(form.states)
    while True:
        more = {s for z, f in zip(form.states, form.rates, strict=True) if z in needed for s in f.free_symbols} & set(
            form.states
        )
        if more <= needed:
            return [k for k, z in enumerate(form.states) if z in needed or not form.outputs]
        needed |= more


def _radicands(expressions: Iterable[Any]) -> tuple[Any, ...]:
    powers = sorted(set().union(*(e.atoms(sp.Pow) for e in expressions), set()), key=sp.default_sort_key)
    return tuple(
        dict.fromkeys(p.base for p in powers if p.exp.is_Rational and p.exp.q % 2 == 0 and not p.base.is_nonnegative)
    )


def realize(
    model: StructuralModel,
    constraints: Iterable[str] | None = None,
    *,
    prefer: Prefer | None = None,
    signal_rates: Mapping[Any, Any] | None = None,
    separate: bool = False,
    max_degree: int = 3,
    name: str | None = None,
) -> Report:
    """Realize a subsystem of a model (usually a minimal over-constrained one) as a state-space form.

    Parameters
    ----------
    model : StructuralModel
        The model; its faults are taken as zero.
    constraints : iterable of str, optional
        Names of the subsystem's constraints; by default all.
    prefer : callable, optional
        Which of several solutions of a block is meant: `elimination.nearest_to`, `largest_at` or own.
    signal_rates : mapping of sympy.Symbol to sympy.Symbol, optional
        Known signals whose time derivative is known, too (a reference, an input behind a filter).
    separate : bool
        Whether an unknown input that enters nonlinearly is allowed; the new states then withstand any value of it.
    max_degree : int
        Largest exponent in the search for the new states.
    name : str, optional
        Name of the realization.

    Returns
    -------
    Report
        Never raises because there is no realization: `Report.outcome` says why, `Report.require` raises.

    Raises
    ------
    ParameterError
        If `signal_rates` names a symbol that is no known signal, or a constraint does not exist.

    References
    ----------
    Thesis 1.3, 6.2 (reconstruction). C. De Persis and A. Isidori, A geometric approach to nonlinear fault detection
    and isolation, IEEE Trans. Automatic Control 46 (2001).
    """
    part = (model if constraints is None else model.submodel(constraints)).healthy()
    given = dict(signal_rates or {})
    for s in given:
        if s not in model.known:
            raise ParameterError(f"{model.name}: signal_rates has {s}, which is no known variable of the model.")
    rates_known = tuple(r for r in given.values() if r not in part.known)
    work = _Work(
        prefer=prefer, signals=(*part.known, *rates_known), signal_rates=given, separate=separate, max_degree=max_degree
    )
    label = name or part.name
    explicit: Explicit | None = None
    found: Realization | None = None
    outcome, detail, remedy = Outcome.OK, "", Outcome.OK.remedy
    try:
        pairs = part.derivatives
        algebraic = [u for u in part.unknown if u not in pairs and u not in pairs.values()]
        explicit, values = _explicit(part.relations.items(), pairs, algebraic, work)
        form = _transformed(explicit, work, count(1))
        found = _realization(label, part, explicit, form, values, work)
        if not found.residuals:
            outcome, detail, remedy = _no_output(part, work)
    except _Failure as failure:
        outcome, detail, remedy = failure.outcome, failure.detail, failure.remedy
        if outcome is Outcome.FAIL_3 and len(part.constraints) <= len(part.unknown):
            outcome, remedy = Outcome.OK_NO_OUTPUT, Outcome.OK_NO_OUTPUT.remedy
    if outcome is not Outcome.OK and outcome is not Outcome.OK_NO_OUTPUT:
        found = None
    return Report(
        name=label,
        constraints=part.names,
        outcome=outcome,
        detail=detail,
        remedy=remedy,
        realization=found,
        explicit=explicit,
        transformations=tuple(work.transformations),
        steps=tuple(work.record.steps),
        branches=tuple(work.record.branches),
        singular=tuple(work.record.singular),
    )


def _no_output(part: StructuralModel, work: _Work) -> tuple[Outcome, str, str]:
    """Why nothing is left to test: too few constraints, or the closure used up the redundancy."""
    if len(part.constraints) <= len(part.unknown):
        return Outcome.OK_NO_OUTPUT, "", Outcome.OK_NO_OUTPUT.remedy
    for one in work.transformations:
        fields, states = one.fields, one.system.states
        signals = [s for s in work.signals if any(depends(entry, s) for f in fields for entry in f)]
        frozen = involutive_closure(fields, states)
        if signals and frozen.rank < one.closure.rank:
            found = first_integrals(frozen.fields, states, max_degree=work.max_degree).functions
            more = [t for t in found if t.free_symbols & set(signals)]
            which = ", ".join(map(str, more)) if more else "a function not found in closed form"
            detail = f"The redundancy needs T = {which}, which contains {', '.join(map(str, signals))}."
            return Outcome.FAIL_5, detail, Outcome.FAIL_5.remedy
    return Outcome.FAIL_3, "Lie brackets of the input fields used up the redundancy.", Outcome.FAIL_3.remedy


def _realization(
    label: str, part: StructuralModel, explicit: Explicit, form: _Form, values: Mapping[Any, Any], work: _Work
) -> Realization:
    keep = _needed(form)
    states = tuple(form.states[k] for k in keep)
    rates = tuple(shortest(form.rates[k]) for k in keep)
    residuals = tuple(shortest(e) for _, e in form.outputs)
    used = set().union(*(e.free_symbols for e in (*rates, *residuals)), set())
    determined = {**form.values, **{u: v.subs(form.values) for u, v in values.items()}}
    allowed = {*states, *work.signals, *part.parameters}
    return Realization(
        name=label,
        constraints=part.names,
        states=states,
        definitions=tuple(form.definitions[k] for k in keep),
        rates=rates,
        residuals=residuals,
        signals=tuple(s for s in work.signals if s in used),
        parameters=tuple(p for p in part.parameters if p in used),
        values={u: v for u, v in determined.items() if v.free_symbols <= allowed},
        singular=tuple(work.record.singular),
        radicands=_radicands((*rates, *residuals)),
        equivalent=work.equivalent,
    )
