"""Thesis 5.3: tables of the Monte Carlo campaigns of the stator observer: detection, phase, delay, size.

Rows are plain mappings: the conditions of the runs, the fault, and the result with its exact limits.
"""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pumplib.campaign.rates import clopper_pearson, quantile
from pumplib.campaign.stator_runs import CONDITIONS, DETECTORS, MAIN, StatorRuns
from pumplib.errors import DataError

Array = NDArray[Any]
_FAULT = ("gamma", "r_f", "loop", "test")


def _rate(hits: Array) -> dict[str, Any]:
    one = clopper_pearson(int(np.sum(hits)), len(hits))
    return {"runs": one.n, "hits": int(np.sum(hits)), "share": one.value, "low": one.low, "high": one.high}


def conditions_of(runs: StatorRuns) -> list[dict[str, Any]]:
    """Conditions under which a threshold was set, the main ones first.

    Parameters
    ----------
    runs : StatorRuns
        The runs.

    Returns
    -------
    list of dict
        Of `CONDITIONS`.
    """
    rows = runs.table[runs.table["role"] == "threshold"][list(CONDITIONS)].drop_duplicates()
    found = [{str(key): value for key, value in row.items()} for row in rows.to_dict("records")]
    return sorted(found, key=lambda one: one != MAIN)


def false_alarms(runs: StatorRuns, detectors: Iterable[str] = tuple(DETECTORS)) -> list[dict[str, Any]]:
    """Healthy runs above the threshold, which other healthy runs have set.

    Parameters
    ----------
    runs : StatorRuns
        The runs.
    detectors : iterable of str
        Of `DETECTORS`.

    Returns
    -------
    list of dict
        Conditions, ``detector``, ``threshold``, ``set by`` (runs), ``runs``, ``hits``, ``share``, exact limits.
    """
    found = []
    for chosen in conditions_of(runs):
        healthy, taught = runs.where("healthy", **chosen), runs.where("threshold", **chosen)
        for name in detectors:
            level = runs.threshold(name, **chosen)
            if np.isnan(level) or healthy.empty:
                continue
            found.append(
                {**chosen, "detector": DETECTORS[name], "threshold": level, "set by": len(taught)}
                | _rate(healthy[name].to_numpy(dtype=float) > level)
            )
    return found


def detections(runs: StatorRuns, detectors: Iterable[str] = tuple(DETECTORS)) -> list[dict[str, Any]]:
    """Faulty runs above the threshold, for every condition and fault, detector by detector.

    Parameters
    ----------
    runs : StatorRuns
        The runs.
    detectors : iterable of str
        Of `DETECTORS`.

    Returns
    -------
    list of dict
        Conditions, ``gamma``, ``r_f``, ``loop``, ``test``, ``detector``, ``runs``, ``hits``, ``share``, exact limits.
        Conditions without a threshold of their own are left out; `unscored` names them.
    """
    found = []
    names = tuple(detectors)
    for chosen in conditions_of(runs):
        levels = {name: runs.threshold(name, **chosen) for name in names}
        for fault, part in runs.where("fault", **chosen).groupby(list(_FAULT), sort=True):
            place = dict(zip(_FAULT, fault, strict=True))
            for name in names:
                if not np.isnan(levels[name]):
                    found.append(
                        {**chosen, **place, "detector": DETECTORS[name]}
                        | _rate(part[name].to_numpy(dtype=float) > levels[name])
                    )
    return found


def unscored(runs: StatorRuns) -> list[str]:
    """Cells of faulty runs that no threshold belongs to.

    Parameters
    ----------
    runs : StatorRuns
        The runs.

    Returns
    -------
    list of str
        Their names.
    """
    rows = runs.table[runs.table["role"] == "fault"]
    known = {tuple(one[key] for key in CONDITIONS) for one in conditions_of(runs)}
    keys = list(zip(*(rows[key] for key in CONDITIONS), strict=True))
    return sorted({str(cell) for cell, key in zip(rows["cell"], keys, strict=True) if key not in known})


def phases(runs: StatorRuns) -> list[dict[str, Any]]:
    """Whether the phase was right, in all runs and in those with an alarm, and what kind of fault was said.

    Parameters
    ----------
    runs : StatorRuns
        The runs; single-phase shorts and loops between two phases.

    Returns
    -------
    list of dict
        Conditions, fault, ``runs``, ``hits`` (phase right, alarmed or not), ``share``, exact limits, ``wrong alarms``
        (share with an alarm and the wrong phase), ``one phase``, ``undecided``, ``two phases``, ``no short`` (shares
        of all runs, were they alarmed).
    """
    found = []
    for chosen in conditions_of(runs):
        level = runs.threshold("statistic", **chosen)
        for fault, part in runs.where("fault", **chosen).groupby(list(_FAULT), sort=True):
            right = part["phase_right"].to_numpy(dtype=float) > 0.5
            alarm = part["statistic"].to_numpy(dtype=float) > level
            place = dict(zip(_FAULT, fault, strict=True))
            kind = part["kind"].to_numpy(dtype=int)
            kinds = {
                word: float(np.mean(kind == k))
                for k, word in enumerate(("one phase", "undecided", "two phases", "no short"))
            }
            single = {} if place["loop"] == "pair" else _rate(right) | {"wrong alarms": float(np.mean(alarm & ~right))}
            found.append({**chosen, **place, "runs": len(part), **single, **kinds})
    return found


def sizes(runs: StatorRuns) -> list[dict[str, Any]]:
    """Relative error of the estimated size: median and the limits that hold 90 % of the runs.

    Parameters
    ----------
    runs : StatorRuns
        The runs.

    Returns
    -------
    list of dict
        Conditions, fault, ``resistance`` ("not known", "from the healthy part", "known"), ``runs``, ``median``,
        ``low``, ``high`` (5 and 95 %), ``half`` (half their distance), ``median low``, ``median high`` (95 % limits).
    """
    found = []
    for chosen in conditions_of(runs):
        for fault, part in runs.where("fault", **{**chosen, "loop": "phase"}).groupby(list(_FAULT), sort=True):
            place = dict(zip(_FAULT, fault, strict=True))
            for column, words in (
                ("gamma_R", "not known"), ("gamma_R_watching", "from the healthy part"), ("gamma_R_known", "known")
            ):  # fmt: skip
                values = part[column].to_numpy(dtype=float)
                error = values[np.isfinite(values)] / place["gamma"] - 1
                if len(error) == 0:
                    continue
                low, high = (float(np.quantile(error, q)) for q in (0.05, 0.95))
                middle = quantile(error, 0.5)
                found.append(
                    {
                        **chosen, **place, "resistance": words, "runs": len(part), "sized": len(error),
                        "median": middle.value, "low": low, "high": high, "half": 0.5 * (high - low),
                        "median low": middle.low, "median high": middle.high,
                    }
                )  # fmt: skip
    return found


def delays(runs: StatorRuns) -> list[dict[str, Any]]:
    """Delay from the onset to the first crossing, of the sliding decision and of the observer's coefficient.

    Parameters
    ----------
    runs : StatorRuns
        The runs.

    Returns
    -------
    list of dict
        Conditions, fault, ``runs``, ``window``, ``window 95 %``, ``instant``, ``instant 95 %`` (s, infinite where so
        many never cross within the run).
    """
    found = []
    for chosen in conditions_of(runs):
        for fault, part in runs.where("fault", **chosen).groupby(list(_FAULT), sort=True):
            row: dict[str, Any] = {**chosen, **dict(zip(_FAULT, fault, strict=True)), "runs": len(part)}
            for name in ("window", "instant"):
                values = part[f"delay_{name}"].to_numpy(dtype=float)
                filled = np.sort(np.where(np.isfinite(values), values, np.inf))
                row[name] = float(filled[int(np.ceil(0.5 * len(filled))) - 1])
                row[f"{name} 95 %"] = float(filled[int(np.ceil(0.95 * len(filled))) - 1])
            found.append(row)
    return found


def find_row(rows: Sequence[Mapping[str, Any]], **wanted: Any) -> Mapping[str, Any] | None:
    """Row of a table with given entries; conditions left out are the main ones, the fault a bolted short of one phase.

    Parameters
    ----------
    rows : sequence of mapping
        Of `detections`, `phases`, `sizes` or `false_alarms`.
    **wanted
        Entries by name.

    Returns
    -------
    mapping or None
        None where the campaign holds no such runs.

    Raises
    ------
    DataError
        If several rows fit.
    """
    fixed = {**MAIN, **({"r_f": 0.0, "loop": "phase", "test": "drawn"} if "gamma" in wanted else {}), **wanted}

    def fits(row: Mapping[str, Any]) -> bool:
        return all(
            key in row and (bool(np.isclose(row[key], value)) if isinstance(value, float) else row[key] == value)
            for key, value in fixed.items()
        )

    found = [row for row in rows if fits(row)]
    if len(found) > 1:
        raise DataError(f"find_row: {len(found)} rows fit {fixed}; name more of their entries.")
    return found[0] if found else None


def condition_name(row: Mapping[str, Any]) -> str:
    """Say in which way the conditions of a row differ from the main ones.

    Parameters
    ----------
    row : mapping
        Of a table of this module.

    Returns
    -------
    str
    """
    words = {
        "records": f"{row['records']} records", "accuracy": f"class {row['accuracy']}",
        "connection": str(row["connection"]), "rate": f"{float(row['rate']) / 1e3:g} kHz",
        "supply": str(row["supply"]).upper(),
    }  # fmt: skip
    return ", ".join(words[key] for key in CONDITIONS if row[key] != MAIN[key]) or "1 record, A, Y, 10 kHz, grid"


def fault_name(row: Mapping[str, Any]) -> str:
    """Describe the fault of a row.

    Parameters
    ----------
    row : mapping
        Of a table of this module.

    Returns
    -------
    str
    """
    words = [f"{100 * row['gamma']:g} %"]
    if row["loop"] == "pair":
        words.append("between two phases")
    if row["r_f"] > 0:
        words.append(f"r_f {row['r_f']:g} ohm")
    if row["test"] != "drawn":
        words.append(str(row["test"]).replace("_", " "))
    return ", ".join(words)


def overview(rows: Sequence[Mapping[str, Any]]) -> list[dict[str, str]]:
    """Detections or false alarms as a table for people: a line for each condition and fault, a column a detector.

    Parameters
    ----------
    rows : sequence of mapping
        Of `detections` or `false_alarms`.

    Returns
    -------
    list of dict
        Percent with exact 95 % limits; "-" where a detector says nothing.
    """
    found: dict[tuple[str, str], dict[str, str]] = {}
    for row in rows:
        key = (condition_name(row), fault_name(row) if "gamma" in row else "healthy")
        blank = {"conditions": key[0], "fault": key[1], "runs": str(row["runs"])} | dict.fromkeys(
            DETECTORS.values(), "-"
        )
        line = found.setdefault(key, blank)
        line[row["detector"]] = f"{100 * row['share']:.1f} ({100 * row['low']:.1f}-{100 * row['high']:.1f})"
    return list(found.values())


def baseline_ratio(rows: Sequence[Mapping[str, Any]], gamma: float) -> tuple[float, int] | None:
    """How many times more often the decision detects than raw |I2|, at an equal rule for false alarms.

    Parameters
    ----------
    rows : sequence of mapping
        Of `detections`.
    gamma : float
        Shorted share of the turns.

    Returns
    -------
    ratio : float
        Where raw |I2| detected nothing at all, the upper limit of its share takes its place.
    runs : int
        None in place of both where the campaign holds no such runs.
    """
    ours = find_row(rows, gamma=gamma, detector=DETECTORS["statistic"])
    raw = find_row(rows, gamma=gamma, detector=DETECTORS["raw_I2"])
    if ours is None or raw is None:
        return None
    return float(ours["share"] / (raw["share"] or raw["high"])), int(ours["runs"])
