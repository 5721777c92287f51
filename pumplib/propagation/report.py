"""Thesis 4.2.1, 4.3.4, 4.3.5: the analysis of a system in rows: its loops, its sensors, what its choices hang on."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pumplib.errors import ParameterError, SimulationError
from pumplib.fmea import System
from pumplib.propagation.build import Effects, Signs, event_matrices, propagate
from pumplib.propagation.decision import SYMBOLS, DecisionTable
from pumplib.propagation.graph import minimum_cut, pack, strong_components, unpack
from pumplib.propagation.loops import component_cut, cut_closure, plain_closure, scc_closure
from pumplib.propagation.sensors import Goal, cheapest, cost, demands, minimal_sets, minimal_sets_milp, reached
from pumplib.propagation.theorems import decodable

Array = NDArray[Any]
Goals = Mapping[str, tuple[Goal, Sequence[str]]]
AXIOMS = {
    "envelope": "disturbing events start no fault",
    "threshold": "thresholds of signal events lie above the drift of parameters",
    "progression": "a fault starts no other fault",
}
"""Assumptions on kinds of edges that can be dropped."""


def drop_names(system: System) -> tuple[str, ...]:
    """What `propagate_without` can drop.

    Parameters
    ----------
    system : System
        FMEA tables.

    Returns
    -------
    tuple of str
        The assumptions of `AXIOMS`, then the edges of the tables.
    """
    return (*AXIOMS, *dict.fromkeys(edge.id for edge in system.edges))


def propagate_without(system: System, dropped: Iterable[str] = (), signs: Signs = "closure") -> Effects:
    """End-effects when some assumptions are not made and some edges are not there.

    Parameters
    ----------
    system : System
        FMEA tables.
    dropped : iterable of str
        Names out of `drop_names`.
    signs : {"closure", "simple"}
        See `propagate`.

    Returns
    -------
    Effects

    Raises
    ------
    ParameterError
        If a name is neither an assumption nor an edge.
    """
    names = tuple(dropped)
    faults, disturbances = ["effect"], ["effect"]
    if "envelope" in names:
        disturbances.append("progression")
    if "threshold" in names:
        disturbances.append("drift")
    if "progression" in names:
        faults.append("progression")
    left = system.drop(name for name in names if name not in AXIOMS)
    return propagate(left, fault_kinds=faults, disturbance_kinds=disturbances, signs=signs)


@dataclass(frozen=True, kw_only=True, slots=True)
class LoopStudy:
    """Loops of a system, and what becomes of the effects when they are cut.

    Parameters
    ----------
    cut : tuple of (str, str)
        A smallest set of edges between components that cuts all loops.
    components, events : tuple of int
        Sizes of the loops, in components and in events, of ordinary effects; largest first.
    wider : tuple of int
        Sizes in components when effects may start faults.
    entries : int
        Pairs of event and root: what has to be found.
    sweeps : int
        Sweeps of the plain iteration.
    orders : int
        Random search orders that were tried.
    cuts : tuple of int
        Numbers of cut edges that came out, each once.
    different : int
        Different cuts.
    passes : tuple of int
        Numbers of passes that Algorithm 1 took, each once.
    wrong : int
        Orders whose result differs from the plain iteration.
    condensed : bool
        Whether Algorithm 2 gives the result of the plain iteration.
    lost : tuple of (int, int)
        Least and most entries that are missed when the cut effects are not carried on.
    """

    cut: tuple[tuple[str, str], ...]
    components: tuple[int, ...]
    events: tuple[int, ...]
    wider: tuple[int, ...]
    entries: int
    sweeps: int
    orders: int
    cuts: tuple[int, ...]
    different: int
    passes: tuple[int, ...]
    wrong: int
    condensed: bool
    lost: tuple[int, int]

    def rows(self) -> list[dict[str, str]]:
        """Rows for a table of ways and what they give.

        Returns
        -------
        list of dict
        """
        span = f"{min(self.passes)} to {max(self.passes)}"
        missed = f"{self.lost[0]} to {self.lost[1]} of {self.entries} entries missing"
        return [
            {"way": "plain iteration", "sweeps": str(self.sweeps), "result": "the definition"},
            {"way": f"Algorithm 1, {self.orders} search orders, {self.different} different cuts", "sweeps": span,
             "result": f"{self.orders - self.wrong} of {self.orders} equal"},
            {"way": "Algorithm 2", "sweeps": "1", "result": "equal" if self.condensed else "different"},
            {"way": "cut, and cut effects forgotten", "sweeps": "1", "result": missed},
        ]  # fmt: skip


def _loop_sizes(n: int, cause: Array, effect: Array) -> tuple[int, ...]:
    sizes = np.bincount(strong_components(n, cause, effect)[1])
    return tuple(sorted((int(size) for size in sizes if size > 1), reverse=True))


def study_loops(system: System, rng: np.random.Generator, orders: int = 100) -> LoopStudy:
    """Cut the loops of a system in many ways and compare the effects (Theorem 1).

    Parameters
    ----------
    system : System
        FMEA tables; all kinds of edges are used.
    rng : numpy.random.Generator
        Source of the search orders.
    orders : int
        Search orders.

    Returns
    -------
    LoopStudy

    Raises
    ------
    ParameterError
        If there is no search order to try.
    """
    if orders < 1:
        raise ParameterError(f"orders = {orders}: at least one search order is needed.")
    net, whole = system.incidence(), event_matrices(system)
    n, r = len(net.events), len(net.faults) + len(net.disturbances)
    raised = np.concatenate((net.fault_event, net.disturbance_event))
    seeds = pack(raised, np.concatenate((net.fault, net.disturbance + len(net.faults))), n, r)
    true = plain_closure(n, net.cause, net.effect, seeds)
    entries = int(unpack(true.bits, r).sum())
    cuts, passes, lost, wrong = set(), set(), [], 0
    for _ in range(orders):
        cut = component_cut(n, net.cause, net.effect, net.block, rng.permutation(len(net.blocks)))
        found = cut_closure(n, net.cause, net.effect, seeds, cut=cut, component=net.block)
        open_cut = cut_closure(n, net.cause, net.effect, seeds, cut=cut, component=net.block, inject=False)
        wrong += int(not np.array_equal(found.bits, true.bits))
        lost.append(entries - int(unpack(open_cut.bits, r).sum()))
        pairs = zip(net.block[net.cause[cut]].tolist(), net.block[net.effect[cut]].tolist(), strict=True)
        cuts.add(frozenset(pairs))
        passes.add(found.passes)
    effect = np.array([edge.kind == "effect" for edge in net.edges])
    names = whole.components
    plain = event_matrices(system.select(kinds=("effect",)))
    return LoopStudy(
        cut=tuple((names[i], names[j]) for i, j in minimum_cut(whole.D_e)),
        components=_loop_sizes(len(names), *np.nonzero(plain.D_e)),
        events=_loop_sizes(n, net.cause[effect], net.effect[effect]),
        wider=_loop_sizes(len(names), *np.nonzero(whole.D_e)),
        entries=entries,
        sweeps=true.passes,
        orders=orders,
        cuts=tuple(sorted({len(cut) for cut in cuts})),
        different=len(cuts),
        passes=tuple(sorted(passes)),
        wrong=wrong,
        condensed=np.array_equal(scc_closure(n, net.cause, net.effect, seeds), true.bits),
        lost=(min(lost), max(lost)),
    )


def written(system: System, sets: Iterable[Iterable[str]]) -> str:
    """Sets of sensors for people, in the order of the tables.

    Parameters
    ----------
    system : System
        FMEA tables.
    sets : iterable of iterable of str
        Sets of sensors.

    Returns
    -------
    str
        Such as ``"{I, V, Q} {I, V, dp}"``; "impossible" if there is none.
    """
    order = [sensor.id for sensor in system.sensors]
    texts = ["{" + ", ".join(name for name in order if name in set(one)) + "}" for one in sets]
    return " ".join(texts) or "impossible"


def sensor_rows(cases: Mapping[str, Effects], goals: Goals) -> list[dict[str, str]]:
    """All minimal sets of sensors, one row a case and one column a goal, found in two ways.

    Parameters
    ----------
    cases : mapping of str to Effects
        Effects under some assumptions, by the name of the case.
    goals : mapping of str to (goal, groups)
        ``{"isolate G1-G6": ("isolate", ["G1", ...])}``.

    Returns
    -------
    list of dict

    Raises
    ------
    SimulationError
        If enumeration and integer programming differ.
    """
    rows = []
    for case, effects in cases.items():
        row = {"case": case}
        for name, (goal, groups) in goals.items():
            problem = demands(effects, goal, groups)
            sets = minimal_sets(problem)
            if minimal_sets_milp(problem) != sets:
                raise SimulationError(f"{case}, {name}: enumeration and integer programming differ; no answer.")
            row[name] = written(effects.system, sets)
        rows.append(row)
    return rows


def scenario_cases(system: System, dropped: Iterable[str] = ()) -> dict[str, Effects]:
    """Effects under each scenario of a system.

    Parameters
    ----------
    system : System
        FMEA tables.
    dropped : iterable of str
        See `drop_names`.

    Returns
    -------
    dict of str to Effects
        By the scenario's id.
    """
    effects = propagate_without(system, dropped)
    return {one.id: effects.narrow(disturbances=one.disturbances) for one in system.scenarios}


def assumption_cases(system: System, scenario: str, dropped: Iterable[str] = ()) -> dict[str, Effects]:
    """Effects when further assumptions are dropped or made, one at a time.

    Parameters
    ----------
    system : System
        FMEA tables.
    scenario : str
        Disturbing events.
    dropped : iterable of str
        What is dropped in all of them.

    Returns
    -------
    dict of str to Effects
    """
    always, events = tuple(dropped), system.scenario(scenario).disturbances
    found = {"as assumed": propagate_without(system, always)}
    for name in AXIOMS:
        if name not in always:
            found[f"without {name!r}: {AXIOMS[name]}"] = propagate_without(system, (*always, name))
    if "progression" not in always:
        simple = propagate_without(system, (*always, "progression"), "simple")
        found["without 'progression', feedback never reverses a deviation"] = simple
    no_features = [one.id for one in system.signals if one.kind not in ("spectral", "slope")]
    found["without spectral and slope signals"] = found["as assumed"].narrow(signals=no_features)
    return {name: one.narrow(disturbances=events) for name, one in found.items()}


def value_cases(system: System, scenario: str, dropped: Iterable[str] = ()) -> dict[str, Effects]:
    """What disturbing events do to the answer: none, read in three ways, against a scenario.

    Parameters
    ----------
    system : System
        FMEA tables.
    scenario : str
        Disturbing events.
    dropped : iterable of str
        See `drop_names`.

    Returns
    -------
    dict of str to Effects
    """
    always = tuple(dropped)
    simple = propagate_without(system, always, "simple")
    left = system.drop(name for name in always if name not in AXIOMS)
    guarded = propagate(left, signs="simple", guarded=True)
    return {
        "nothing disturbs; feedback never reverses a deviation": simple.narrow(disturbances=()),
        "the same; an effect pulled both ways may vanish": guarded.narrow(disturbances=()),
        "nothing disturbs; all paths": propagate_without(system, always).narrow(disturbances=()),
        f"{scenario} disturbs; feedback never reverses": simple.narrow(
            disturbances=system.scenario(scenario).disturbances
        ),
        f"{scenario} disturbs; all paths": propagate_without(system, always).narrow(
            disturbances=system.scenario(scenario).disturbances
        ),
    }


def group_rows(effects: Effects, groups: Sequence[str], sensors: Iterable[str]) -> list[dict[str, str]]:
    """Groups one by one: minimal sets of sensors, and what given sensors reach.

    Parameters
    ----------
    effects : Effects
        Narrowed to the disturbing events to be tolerated.
    groups : sequence of str
        Groups that can be present.
    sensors : iterable of str
        Sensors that are fitted.

    Returns
    -------
    list of dict
        The last column tells whether the presence of a group can be read off, with all sensors, whatever other
        faults are present at the same time (Theorem 3c).
    """
    system, fitted = effects.system, list(sensors)
    member = {fault: name for name in groups for fault in system.group(name).faults}
    chosen = effects.narrow(faults=list(member))
    names, read = decodable(chosen.A_f, chosen.A_d, list(member.values()))
    together = dict(zip(names, read.tolist(), strict=True))
    seen = {goal: reached(effects, goal, groups, fitted) for goal in ("detect", "isolate")}
    return [
        {
            "group": f"{name} {system.group(name).name}",
            "sets that detect": written(system, minimal_sets(demands(effects, "detect", [name]))),
            "sets that isolate": written(system, minimal_sets(demands(effects, "isolate", [name], groups))),
            "with the chosen sensors": "isolated" if name in seen["isolate"] else "detected"
            if name in seen["detect"] else "not seen",
            "among other faults": "yes" if together[name] else "no",
        }
        for name in groups
    ]  # fmt: skip


def variant_rows(system: System, scenario: str, dropped: Iterable[str] = ()) -> list[dict[str, str]]:
    """Every choice for an uncertain group: sets of sensors that detect and isolate it.

    Parameters
    ----------
    system : System
        FMEA tables.
    scenario : str
        Disturbing events.
    dropped : iterable of str
        See `drop_names`.

    Returns
    -------
    list of dict
    """
    rows = []
    for variant in system.variants:
        other = system.choose(variant.id)
        effects = propagate_without(other, dropped).narrow(disturbances=system.scenario(scenario).disturbances)
        groups, name = [group.id for group in other.groups], variant.group.id
        rows.append(
            {
                "choice": variant.id,
                "faults": ", ".join(variant.group.faults),
                "detect": written(system, minimal_sets(demands(effects, "detect", [name]))),
                "isolate": written(system, minimal_sets(demands(effects, "isolate", [name], groups))),
            }
        )
    return rows


def cost_rows(effects: Effects, goals: Goals, dearer: Mapping[str, float]) -> list[dict[str, str]]:
    """Cheapest sensors of each goal at the costs of the tables and at other ones.

    Parameters
    ----------
    effects : Effects
        Narrowed to the disturbing events to be tolerated.
    goals : mapping of str to (goal, groups)
        Goals.
    dearer : mapping of str to float
        Other costs of some sensors, in the unit of the tables.

    Returns
    -------
    list of dict

    Raises
    ------
    ParameterError
        If a sensor is not known.
    """
    system, known = effects.system, [sensor.id for sensor in effects.system.sensors]
    for name in dearer:
        if name not in known:
            raise ParameterError(f"sensor {name!r}: not known; allowed are {', '.join(known)}.")
    sensors = tuple(replace(one, cost=dearer.get(one.id, one.cost)) for one in system.sensors)
    rows = []
    for name, (goal, groups) in goals.items():
        row = {"goal": name}
        for title, tables in (("costs of the tables", system), ("other costs", replace(system, sensors=sensors))):
            problem = demands(replace(effects, system=tables), goal, groups)
            best = cheapest(problem)
            row[title] = "impossible" if best is None else f"{written(system, [best[0]])}: {cost(problem, best[0]):g}"
        rows.append(row)
    return rows


def verdict_rows(table: DecisionTable, cases: Mapping[str, Mapping[str, str]]) -> list[dict[str, str]]:
    """What the decision logic says to some patterns of symbols.

    Parameters
    ----------
    table : DecisionTable
        Compiled table.
    cases : mapping of str to mapping of str to str
        Patterns by name, as ``{"yrH": "-"}``; signals that are not named show nothing, ``"?"`` is not known. Signals
        that the sensors do not give are left out.

    Returns
    -------
    list of dict
    """
    rows = []
    for name, symbols in cases.items():
        seen = {signal: SYMBOLS["0"] for signal in table.signals}
        seen |= {signal: SYMBOLS[symbol] for signal, symbol in symbols.items() if signal in seen}
        (verdict,) = table.decide([table.pattern(seen).astype(int)])
        shown = ", ".join(f"{signal} {symbol}" for signal, symbol in symbols.items())
        rows.append({"case": name, "symbols": shown, "verdict": str(verdict)})
    return rows
