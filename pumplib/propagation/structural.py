"""Thesis 4.2.2, 6.1: the pump's steady state as a structure, to compare fault propagation with structural analysis.

Structural analysis asks which equations are left over once every unknown is determined; it counts any dependence
and knows neither signs nor thresholds. Fault propagation asks which deviations must be seen. Where the two agree
on sensors the choice does not depend on the method.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from pumplib.errors import ParameterError

Array = NDArray[Any]
Goal = Literal["detect", "isolate"]


@dataclass(frozen=True, kw_only=True, slots=True)
class Relation:
    """One equation of a structure.

    Parameters
    ----------
    name : str
        What it says.
    unknowns : tuple of str
        Unknowns in it.
    fault : str
        Fault that makes it false; empty for none. A fault of two equations is an unknown of both with a relation
        of its own, "is zero".
    """

    name: str
    unknowns: tuple[str, ...]
    fault: str = ""


SENSORS = {"I": "i", "V": "v", "Q": "Q", "dp": "H"}
"""Sensors of the structure and the unknown that each measures."""

PUMP = (
    Relation(name="current of the motor", unknowns=("i", "v", "w")),
    Relation(name="torque of the motor", unknowns=("v", "w", "Te")),
    Relation(name="balance of torques", unknowns=("Te", "Tp", "w"), fault="dB"),
    Relation(name="torque of the impeller", unknowns=("Tp", "Qi", "w", "x_c", "x_d")),
    Relation(name="head of the impeller", unknowns=("Hi", "Qi", "w", "x_c", "x_d")),
    Relation(name="internal leakage", unknowns=("Qi", "Q", "H"), fault="K_l"),
    Relation(name="head loss", unknowns=("H", "Hi", "Q"), fault="K_f"),
    Relation(name="no cavitation", unknowns=("x_c",), fault="f_c"),
    Relation(name="no dry running", unknowns=("x_d",), fault="f_d"),
)
"""The pump in steady state without its pipes: the hydraulic resistance is unknown, as it is a disturbance."""


def with_sensors(sensors: Iterable[str], relations: Sequence[Relation] = PUMP) -> tuple[Relation, ...]:
    """The relations and one more for each sensor.

    Parameters
    ----------
    sensors : iterable of str
        Some of `SENSORS`.
    relations : sequence of Relation
        The structure without sensors.

    Returns
    -------
    tuple of Relation

    Raises
    ------
    ParameterError
        If a sensor is not known.
    """
    added = []
    for name in sensors:
        if name not in SENSORS:
            raise ParameterError(f"sensor {name!r}: not in the structure; allowed are {', '.join(SENSORS)}.")
        added.append(Relation(name=f"sensor {name}", unknowns=(SENSORS[name],)))
    return (*relations, *added)


def overdetermined(relations: Sequence[Relation]) -> frozenset[int]:
    """Positions of the relations that are left over for checking (the overdetermined part).

    Every unknown is assigned to a relation as far as possible; what alternating paths reach from the relations
    without an unknown is overdetermined.

    Parameters
    ----------
    relations : sequence of Relation
        Structure.

    Returns
    -------
    frozenset of int

    References
    ----------
    A. L. Dulmage and N. S. Mendelsohn, Coverings of bipartite graphs, Canad. J. Math. 10 (1958). M. Krysander and
    E. Frisk, Sensor placement for fault diagnosis, IEEE Trans. SMC A 38 (2008).
    """
    owner: dict[str, int] = {}

    def assign(row: int, seen: set[str]) -> bool:
        for name in relations[row].unknowns:
            if name not in seen:
                seen.add(name)
                if name not in owner or assign(owner[name], seen):
                    owner[name] = row
                    return True
        return False

    free = [row for row in range(len(relations)) if not assign(row, set())]
    # a row that found no unknown stays without one, whatever is assigned later
    reached, waiting = set(free), list(free)
    while waiting:
        for name in relations[waiting.pop()].unknowns:
            if (row := owner[name]) not in reached:
                reached.add(row)
                waiting.append(row)
    return frozenset(reached)


def faults(relations: Sequence[Relation]) -> tuple[str, ...]:
    """Faults of a structure.

    Parameters
    ----------
    relations : sequence of Relation
        Structure.

    Returns
    -------
    tuple of str
    """
    return tuple(dict.fromkeys(one.fault for one in relations if one.fault))


def structurally_isolable(relations: Sequence[Relation]) -> tuple[tuple[str, ...], Array, Array]:
    """Structural detectability and isolability.

    A fault is detectable if its relation is overdetermined, and isolable from another if it still is when the
    other's relation is not used.

    Parameters
    ----------
    relations : sequence of Relation
        Structure with sensors.

    Returns
    -------
    faults : tuple of str
        Names.
    detectable : ndarray of bool, shape (m,)
    isolable : ndarray of bool, shape (m, m)
        Row from column; False on the diagonal.
    """

    def visible(used: Sequence[Relation]) -> set[str]:
        return {used[row].fault for row in overdetermined(used)}

    names = faults(relations)
    seen = visible(relations)
    found = np.zeros((len(names), len(names)), bool)
    for j, other in enumerate(names):
        left = visible([one for one in relations if one.fault != other])
        found[:, j] = [name in left for name in names]
    return names, np.array([name in seen for name in names]), found


def structural_sets(goal: Goal, relations: Sequence[Relation] = PUMP) -> tuple[frozenset[str], ...]:
    """All minimal sets of sensors that detect, or detect and isolate, all faults structurally.

    Parameters
    ----------
    goal : {"detect", "isolate"}
        What to reach.
    relations : sequence of Relation
        The structure without sensors.

    Returns
    -------
    tuple of frozenset of str
        Smallest first.

    Raises
    ------
    ParameterError
        If the goal is not known.
    """
    if goal not in get_args(Goal):
        raise ParameterError(f"goal = {goal!r}: must be one of {', '.join(get_args(Goal))}.")
    minimal: list[frozenset[str]] = []
    for size in range(len(SENSORS) + 1):
        for some in combinations(SENSORS, size):
            if any(one <= set(some) for one in minimal):
                continue
            _, seen, apart = structurally_isolable(with_sensors(some, relations))
            pairs = apart | np.eye(len(seen), dtype=bool)
            if seen.all() and (goal == "detect" or pairs.all()):
                minimal.append(frozenset(some))
    return tuple(minimal)


def compare(propagated: Sequence[tuple[str, Goal, Sequence[frozenset[str]]]]) -> list[dict[str, str]]:
    """Rows that put the sensors of fault propagation beside those of structural analysis.

    Parameters
    ----------
    propagated : sequence of (str, goal, sets of sensors)
        What was asked, as text and as a goal, and the minimal sets that fault propagation found.

    Returns
    -------
    list of dict of str to str
        Columns "goal", "fault propagation", "structure", "why they differ".
    """

    def written(sets: Iterable[frozenset[str]]) -> str:
        texts = ["{" + ", ".join(name for name in SENSORS if name in one) + "}" for one in sets]
        return " ".join(texts) or "impossible"

    rows = []
    for text, goal, sets in propagated:
        ours, theirs = written(sets), written(structural_sets(goal))
        why = "" if ours == theirs else (
            "structure counts any dependence, however small, and may compute the speed from any two of the motor's "
            "relations; fault propagation needs a signal that must exceed its threshold, and its signals are given"
        )  # fmt: skip
        rows.append({"goal": text, "fault propagation": ours, "structure": theirs, "why they differ": why})
    return rows
