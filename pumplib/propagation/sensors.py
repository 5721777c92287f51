"""Thesis 4.2.2, 4.3.5: which sensors suffice to detect and isolate faults whatever the disturbing events do.

A goal is a list of demands, each met by any of some signals; a signal is there when one of its sets of sensors is.
More sensors never hurt, so the answer is the list of all minimal sets. It is found twice: by looking at every set,
and by integer programming that cuts off each set it has found.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from pumplib.errors import ParameterError, SimulationError
from pumplib.propagation.build import Effects
from pumplib.propagation.symbols import separating

Array = NDArray[Any]
Goal = Literal["detect", "isolate"]
GOALS: tuple[str, ...] = get_args(Goal)
MAX_SENSORS = 20  # all sets of them are looked at
MAX_EVENTS = 20  # disturbing events, likewise
_MOST = 1000  # minimal sets listed by integer programming


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Demands:
    """What signals have to do for a goal.

    Parameters
    ----------
    signals, sensors, disturbances : tuple of str
        Names.
    needs : ndarray of bool, shape (demands, signals)
        Signals of which one is enough, were it undisturbed.
    pulled : ndarray of bool, shape (signals, p)
        Signals that each disturbing event pulls.
    alternatives : tuple of tuple of int, length signals
        Sets of sensors that make each signal, one bit a sensor.
    costs : ndarray, shape (sensors,)
        Costs.
    """

    signals: tuple[str, ...]
    sensors: tuple[str, ...]
    disturbances: tuple[str, ...]
    needs: Array
    pulled: Array
    alternatives: tuple[tuple[int, ...], ...]
    costs: Array

    @property
    def robust(self) -> Array:
        """Signals that are enough whatever the disturbing events do, shape (demands, signals)."""
        found: Array = self.needs & ~np.any(self.pulled, axis=1)
        return found


def demands(effects: Effects, goal: Goal, groups: Iterable[str], among: Iterable[str] | None = None) -> Demands:
    """Demands of a goal on the signals.

    Parameters
    ----------
    effects : Effects
        Of all faults, narrowed to the disturbing events to be tolerated and to the signals that are considered.
    goal : {"detect", "isolate"}
        To tell every fault of the groups from no fault, or also from the faults of all other groups.
    groups : iterable of str
        Groups of the system.
    among : iterable of str, optional
        Groups that can be present when isolating; the same as `groups` if not given.

    Returns
    -------
    Demands

    Raises
    ------
    ParameterError
        If the goal or a group is not known.
    """
    if goal not in GOALS:
        raise ParameterError(f"goal = {goal!r}: must be one of {', '.join(GOALS)}.")
    system = effects.system
    names = list(groups)
    member = {fault: name for name in {*names, *(among or ())} for fault in system.group(name).faults}
    chosen = effects.narrow(faults=[fault for fault in effects.faults if fault in member])
    pairs, alone = separating(chosen.must, chosen.may, np.zeros(len(chosen.signals), int))
    group = [member[fault] for fault in chosen.faults]
    wanted = [k for k, name in enumerate(group) if name in names]
    needs = [alone[:, k] for k in wanted]
    if goal == "isolate":
        needs += [
            pairs[:, i, j]
            for i in wanted
            for j in range(len(group))
            if group[i] != group[j] and (i < j or group[j] not in names)
        ]
    sensors = tuple(sensor.id for sensor in system.sensors)
    return Demands(
        signals=chosen.signals,
        sensors=sensors,
        disturbances=chosen.disturbances,
        needs=np.array(needs, bool).reshape(-1, len(chosen.signals)),
        pulled=chosen.hits != 0,
        alternatives=tuple(
            tuple(sum(1 << sensors.index(s) for s in needed) for needed in system.signal(name).alternatives)
            for name in chosen.signals
        ),
        costs=np.array([sensor.cost for sensor in system.sensors]),
    )


def _present(problem: Demands, sets: Array) -> Array:
    """Whether each signal (row) is there with each set of sensors (column)."""
    found = np.zeros((len(problem.signals), len(sets)), bool)
    for k, alternatives in enumerate(problem.alternatives):
        for needed in alternatives:
            found[k] |= (sets & needed) == needed
    return found


def _enough(needs: Array, present: Array) -> Array:
    """Whether every demand has a signal, for each column of `present`."""
    found = np.ones(present.shape[1], bool)
    for one in np.unique(needs, axis=0):
        found &= np.any(present[one], axis=0)
    return found


def _sensor_names(problem: Demands, number: int) -> frozenset[str]:
    return frozenset(name for k, name in enumerate(problem.sensors) if number >> k & 1)


def _sorted(problem: Demands, sets: Iterable[frozenset[str]]) -> tuple[frozenset[str], ...]:
    at = {name: k for k, name in enumerate(problem.sensors)}
    return tuple(sorted(sets, key=lambda one: (len(one), sorted(at[name] for name in one))))


def suffices(problem: Demands, sensors: Iterable[str]) -> bool:
    """Whether a set of sensors meets all demands.

    Parameters
    ----------
    problem : Demands
        Goal.
    sensors : iterable of str
        Sensors.

    Returns
    -------
    bool
    """
    number = np.array([_number(problem, sensors)])
    return bool(_enough(problem.robust, _present(problem, number))[0])


def reached(
    effects: Effects, goal: Goal, groups: Sequence[str], sensors: Iterable[str] | None = None
) -> tuple[str, ...]:
    """Groups for which given sensors reach a goal, each group for itself.

    Parameters
    ----------
    effects : Effects
        Of all faults, narrowed to the disturbing events to be tolerated and to the signals that are considered.
    goal : {"detect", "isolate"}
        Isolation is from the faults of all other groups.
    groups : sequence of str
        Groups.
    sensors : iterable of str, optional
        Sensors; all if not given.

    Returns
    -------
    tuple of str
    """
    fitted = [sensor.id for sensor in effects.system.sensors] if sensors is None else list(sensors)
    return tuple(name for name in groups if suffices(demands(effects, goal, [name], groups), fitted))


def _number(problem: Demands, sensors: Iterable[str]) -> int:
    number = 0
    for name in sensors:
        if name not in problem.sensors:
            raise ParameterError(f"sensor {name!r}: not known; allowed are {', '.join(problem.sensors)}.")
        number |= 1 << problem.sensors.index(name)
    return number


def minimal_sets(problem: Demands) -> tuple[frozenset[str], ...]:
    """All minimal sets of sensors that meet the demands, by looking at every set.

    Parameters
    ----------
    problem : Demands
        Goal, at most `MAX_SENSORS` sensors.

    Returns
    -------
    tuple of frozenset of str
        Smallest first; empty if even all sensors are not enough.

    Raises
    ------
    ParameterError
        If there are too many sensors.
    """
    n = len(problem.sensors)
    if n > MAX_SENSORS:
        raise ParameterError(f"{n} sensors: at most {MAX_SENSORS}; use minimal_sets_milp.")
    sets = np.arange(1 << n, dtype=np.int64)
    enough = _enough(problem.robust, _present(problem, sets))
    minimal = enough.copy()
    for k in range(n):  # monotone: a set is minimal when no single sensor can be left out
        minimal &= ~(((sets >> k & 1) == 1) & enough[sets & ~(1 << k)])
    return _sorted(problem, (_sensor_names(problem, int(one)) for one in np.flatnonzero(minimal)))


class _Program:
    """Integer program: x sensors, z their sets, y signals; cuts are added one by one."""

    def __init__(self, problem: Demands) -> None:
        self.problem = problem
        self.sensors, signals = len(problem.sensors), len(problem.signals)
        flat = [(k, needed) for k, some in enumerate(problem.alternatives) for needed in some]
        self.width = self.sensors + len(flat) + signals
        self.rows: list[Array] = []
        self.least: list[float] = []
        y = self.sensors + len(flat)
        makes = np.zeros((signals, self.width))
        for a, (k, needed) in enumerate(flat):
            for s in range(self.sensors):
                if needed >> s & 1:  # a set is there only with each of its sensors
                    self._add({s: 1.0, self.sensors + a: -1.0}, 0.0)
            makes[k, self.sensors + a] = 1.0
        for k in range(signals):
            makes[k, y + k] = -1.0
            self.rows.append(makes[k])
            self.least.append(0.0)
        for one in np.unique(problem.robust, axis=0):
            self._add({y + int(k): 1.0 for k in np.flatnonzero(one)}, 1.0)

    def _add(self, entries: dict[int, float], least: float) -> None:
        row = np.zeros(self.width)
        row[list(entries)] = list(entries.values())
        self.rows.append(row)
        self.least.append(least)

    def exclude(self, found: frozenset[str]) -> None:
        """Cut off a set and all that contain it."""
        self._add({self.problem.sensors.index(name): -1.0 for name in found}, 1.0 - len(found))

    def solve(self, costs: Array) -> frozenset[str] | None:
        """Cheapest set, None if there is none."""
        from scipy.optimize import Bounds, LinearConstraint, milp

        result = milp(
            np.concatenate((costs, np.zeros(self.width - self.sensors))),
            integrality=np.ones(self.width),
            bounds=Bounds(0.0, 1.0),
            constraints=LinearConstraint(np.array(self.rows), np.array(self.least), np.inf),
        )
        if result.status == 2:
            return None
        if result.status != 0:
            raise SimulationError(f"milp ended with status {result.status} ({result.message}); no answer is given.")
        x = result.x[: self.sensors] > 0.5
        found = frozenset(name for name, there in zip(self.problem.sensors, x, strict=True) if there)
        if not suffices(self.problem, found):
            raise SimulationError(f"milp gave {sorted(found)}, which does not meet the demands; no answer is given.")
        return found


def minimal_sets_milp(problem: Demands) -> tuple[frozenset[str], ...]:
    """All minimal sets of sensors that meet the demands, by integer programming.

    The smallest set is minimal; it is cut off with all that contain it, and the next smallest is looked for.

    Parameters
    ----------
    problem : Demands
        Goal.

    Returns
    -------
    tuple of frozenset of str
        Smallest first; empty if even all sensors are not enough.

    Raises
    ------
    SimulationError
        If the solver fails or there are more than a thousand sets.

    References
    ----------
    HiGHS through `scipy.optimize.milp`.
    """
    if not len(problem.needs):
        return (frozenset(),)
    program, found = _Program(problem), list[frozenset[str]]()
    while (one := program.solve(np.ones(len(problem.sensors)))) is not None:
        found.append(one)
        if len(found) > _MOST:
            raise SimulationError(f"more than {_MOST} minimal sets; narrow the goal.")
        program.exclude(one)
    return _sorted(problem, found)


def cheapest(problem: Demands) -> tuple[frozenset[str], float] | None:
    """Cheapest set of sensors that meets the demands, by integer programming.

    Parameters
    ----------
    problem : Demands
        Goal.

    Returns
    -------
    tuple of (frozenset of str, float) or None
        Sensors and their cost; None if even all sensors are not enough.
    """
    if not len(problem.needs):
        return frozenset(), 0.0
    found = _Program(problem).solve(problem.costs)
    return None if found is None else (found, cost(problem, found))


def cost(problem: Demands, sensors: Iterable[str]) -> float:
    """Cost of some sensors.

    Parameters
    ----------
    problem : Demands
        Goal.
    sensors : iterable of str
        Sensors.

    Returns
    -------
    float
        In the unit of the costs of the tables.
    """
    number = _number(problem, sensors)
    return float(sum(value for k, value in enumerate(problem.costs) if number >> k & 1))


def tolerated(problem: Demands, sensors: Iterable[str]) -> tuple[frozenset[str], ...]:
    """The dual question: all maximal sets of disturbing events under which given sensors still meet the demands.

    Parameters
    ----------
    problem : Demands
        Goal; all its disturbing events are looked at, in any combination.
    sensors : iterable of str
        Sensors.

    Returns
    -------
    tuple of frozenset of str
        Largest first; empty if the sensors are not enough even without disturbing events.

    Raises
    ------
    ParameterError
        If there are more than `MAX_EVENTS` disturbing events.
    """
    p = len(problem.disturbances)
    if p > MAX_EVENTS:
        raise ParameterError(f"{p} disturbing events: at most {MAX_EVENTS} are looked at in all combinations.")
    there = _present(problem, np.array([_number(problem, sensors)]))[:, 0]
    sets = np.arange(1 << p, dtype=np.int64)
    pulls = problem.pulled @ (1 << np.arange(p, dtype=np.int64))
    clean = (pulls[:, None] & sets[None, :]) == 0
    enough = _enough(problem.needs, clean & there[:, None])
    maximal = enough.copy()
    for k in range(p):
        maximal &= ~(((sets >> k & 1) == 0) & enough[sets | 1 << k])
    found = [
        frozenset(name for k, name in enumerate(problem.disturbances) if int(one) >> k & 1)
        for one in np.flatnonzero(maximal)
    ]
    return tuple(sorted(found, key=lambda one: (-len(one), sorted(one))))


def sensor_table(
    cases: dict[str, Effects], goals: dict[str, tuple[Goal, Sequence[str]]]
) -> dict[str, dict[str, tuple[frozenset[str], ...]]]:
    """All minimal sets of sensors for some cases and goals.

    Parameters
    ----------
    cases : dict of str to Effects
        Effects under some assumptions, by the name of the case.
    goals : dict of str to (goal, groups)
        ``{"isolate G1-G6": ("isolate", ["G1", ...])}``.

    Returns
    -------
    dict of str to dict of str to tuple of frozenset of str
        Case, goal, minimal sets; none: impossible.
    """
    return {
        case: {name: minimal_sets(demands(effects, goal, groups)) for name, (goal, groups) in goals.items()}
        for case, effects in cases.items()
    }
