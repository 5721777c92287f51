"""Thesis 6.1: minimal over-constrained subsets beside those of the Fault Diagnosis Toolbox, and the time of both.

Run as `python -m benchmarks.structure`. The toolbox is an oracle: pumplib never imports it.
"""

import tomllib
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.timing import Times, interleaved, ratio
from pumplib.paths import ROOT
from pumplib.structure import examples, pump
from pumplib.structure.graph import Structure
from pumplib.structure.mso import mso_matrix

Array = NDArray[Any]
Sets = frozenset[frozenset[int]]

ENGINE = ROOT / "tests" / "structure" / "engine.toml"
ENGINE_SUBSETS = 4496  # as the authors of the toolbox publish
RANDOM_SYSTEMS = 40
MOST = 40_000  # subsets of a random system; larger ones are drawn anew
LARGE = 10_000  # at least one random system has as many
# incidence of two small examples that the toolbox is shipped with
COMMAULT = [
    "0000100",
    "0000001",
    "0000010",
    "1000101",
    "0100010",
    "1110000",
    "1101000",
    "0010000",
    "0011000",
    "0001000",
]
SMALL_LINEAR = ["11001", "01110", "00101", "00011", "00001"]


def engine() -> Structure:
    """Engine model with 94 constraints."""
    with ENGINE.open("rb") as file:
        facts = tomllib.load(file)
    return Structure.from_sets("engine", facts["constraints"], facts["faults"])


def _from_text(name: str, rows: list[str]) -> Structure:
    return Structure.from_matrix(name, [[int(digit) for digit in row] for row in rows])


def published() -> dict[str, Structure]:
    """Models of the toolbox, and ours."""
    models = [
        examples.three_tanks(),
        examples.dc_motor(),
        examples.induction_motor(),
        examples.pendulum(),
        examples.satellite("velocity"),
        examples.satellite("force"),
        pump.pump_part(),
        pump.pump_with_motor(),
        pump.steady_state(),
    ]
    found = {model.name: model.structure() for model in models}
    found["pump part, clogging loss in Q_p"] = pump.pump_part(loss_flow="Q_p").structure()
    found["Commault"] = _from_text("Commault", COMMAULT)
    found["small linear"] = _from_text("small linear", SMALL_LINEAR)
    found["engine"] = engine()
    return found


def shipped() -> dict[str, Array]:
    """Incidence of the models in the toolbox's own package, as the toolbox builds it."""
    from faultdiagnosistoolbox import models

    return {
        name: np.asarray(getattr(models, name).X) != 0 for name in ("three_tank", "electric_motor", "induction_motor")
    }


def random_systems(seed: int, count: int = RANDOM_SYSTEMS) -> Iterator[tuple[Structure, Array]]:
    """Random incidence matrices of 8 to 44 unknowns with 2 to 5 more constraints, with their subsets."""
    rng, done, largest = np.random.default_rng(seed), 0, 0
    while done < count or largest < LARGE:
        unknowns, more = int(rng.integers(8, 45)), int(rng.integers(2, 6))
        matrix = rng.random((unknowns + more, unknowns)) < rng.uniform(1.5, 4.0) / unknowns
        structure = Structure.from_matrix(f"random {done}", matrix)
        try:
            found = mso_matrix(structure, limit=MOST)
        except ValueError:
            continue
        if done >= count and len(found) < LARGE:
            continue
        done, largest = done + 1, max(largest, len(found))
        yield structure, found


def ours(found: Array) -> Sets:
    """Rows of a matrix of subsets as sets of positions."""
    return frozenset(frozenset(np.flatnonzero(row).tolist()) for row in found)


def oracle_model(incidence: Array) -> Any:
    """The toolbox's model of an incidence matrix."""
    import faultdiagnosistoolbox as toolbox

    return toolbox.DiagnosisModel({"type": "MatrixStruc", "X": incidence.astype(int).tolist(), "F": [], "Z": []})


def oracle(incidence: Array) -> Sets:
    """Subsets that the toolbox finds."""
    return frozenset(frozenset(map(int, subset)) for subset in oracle_model(incidence).MSO())


def differing(incidence: Array, found: Array) -> int:
    """Number of subsets that only one of the two has, or that we list twice."""
    mine = ours(found)
    return len(mine ^ oracle(incidence)) + len(found) - len(mine)


def mso_oracle(rounds: int, seed: int) -> dict[str, dict[str, Any]]:
    """ch6.mso_oracle: all published models and random systems; the time on the engine model."""
    try:
        import faultdiagnosistoolbox  # noqa: F401
    except ImportError:
        return {"ch6.mso_oracle": {"reason": "faultdiagnosistoolbox is not installed"}}
    wrong, counts = 0, {}
    for name, structure in published().items():
        found = mso_matrix(structure)
        wrong += differing(structure.incidence().toarray(), found)
        counts[name] = len(found)
    for name, incidence in shipped().items():
        wrong += differing(incidence, mso_matrix(Structure.from_matrix(name, incidence)))
    if counts["engine"] != ENGINE_SUBSETS:
        raise RuntimeError(f"the engine model has {counts['engine']} subsets, published are {ENGINE_SUBSETS}")
    random = []
    for structure, found in random_systems(seed):
        wrong += differing(structure.incidence().toarray(), found)
        random.append(len(found))
    times = engine_times(rounds)
    value, low, high = ratio(times["pumplib"], times["toolbox"])
    note = (
        f"{len(counts)} models, {len(random)} random systems with {min(random)} to {max(random)} subsets, "
        f"{sum(random)} in all; engine model ({ENGINE_SUBSETS} subsets): ours {times['pumplib']}, "
        f"toolbox {times['toolbox']}, ratio {value:.2f}, by round {low:.2f} - {high:.2f}"
    )
    return {
        "ch6.mso_oracle": {
            "value": wrong,
            "note": note,
            "details": {
                "models": counts,
                "random": random,
                "engine_times": {name: one.row() for name, one in times.items()},
                "engine_ratio": value,
            },
        }
    }


def engine_times(rounds: int) -> dict[str, Times]:
    """Both searches on the engine model; models are built and code is compiled before."""
    structure = engine()
    model = oracle_model(structure.incidence().toarray())
    return interleaved({"pumplib": lambda: mso_matrix(structure), "toolbox": model.MSO}, rounds, block=0.2)


if __name__ == "__main__":
    result = mso_oracle(7, 20051)["ch6.mso_oracle"]
    print(result.get("value", result.get("reason")), result.get("note", ""))
    print(result.get("details", ""))
