"""Thesis 5.3: tables of the Monte Carlo campaigns of the stator observer: thresholds, detection, phase, delay, size.

Every statistic gets its threshold by one rule from the same healthy runs, a factor over the largest of them, so the
observer and its baselines are compared at an equal designed rate of false alarms. Runs with the role "threshold" only
set thresholds; false alarms are counted in those with the role "healthy".
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pumplib.campaign.rates import clopper_pearson, quantile
from pumplib.campaign.results import RESULTS, Result, read
from pumplib.errors import DataError, ParameterError
from pumplib.machines.quantity import Quantity, check_value
from pumplib.observers.stator_score import ScoreSettings

Array = NDArray[Any]
DETECTORS = {
    "statistic": "decision",
    "statistic_observer": "decision on the observer's own g_c",
    "compensated": "static compensated I2",
    "star_point": "star-point voltage",
    "raw_I2": "raw I2",
}
"""Columns that are compared with a threshold, and what they are called."""
CONDITIONS = ("records", "accuracy", "connection", "rate", "supply")
"""Settings that a threshold belongs to; a threshold has to hold whatever the operating point does."""
MARGIN = 1.1
_MAIN = {"records": 1, "accuracy": "A", "connection": "Y", "rate": 10_000.0, "supply": "grid"}
_FAULT = ("gamma", "r_f", "loop", "test")


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class StatorRuns:
    """Runs of all campaigns of the stator observer with the full settings of each.

    Parameters
    ----------
    table : pandas.DataFrame
        One row a run: ``campaign``, ``cell``, ``role``, ``run``, all settings, all scores.
    names : tuple of str
        Campaigns.
    provenance : tuple of dict
        Of each.
    margin : float
        Factor of the thresholds over the largest healthy value.
    """

    table: Any
    names: tuple[str, ...]
    provenance: tuple[dict[str, Any], ...]
    margin: float = MARGIN

    def where(self, role: str, **settings: Any) -> Any:
        """Rows of a role with given settings.

        Parameters
        ----------
        role : str
            "threshold", "healthy" or "fault".
        **settings
            By the names of `ScoreSettings`.

        Returns
        -------
        pandas.DataFrame
            Perhaps empty.

        Raises
        ------
        ParameterError
            If there is no such setting.
        """
        rows = self.table[self.table["role"] == role]
        for name, value in settings.items():
            if name not in ScoreSettings.__dataclass_fields__:
                raise ParameterError(
                    f"setting {name!r}: must be one of {', '.join(ScoreSettings.__dataclass_fields__)}."
                )
            rows = rows[np.isclose(rows[name], value) if isinstance(value, float) else rows[name] == value]
        return rows

    def threshold(self, detector: str, **conditions: Any) -> float:
        """Threshold of a detector under given conditions.

        Parameters
        ----------
        detector : str
            Of `DETECTORS`.
        **conditions
            Of `CONDITIONS`; those left out are one record, accuracy A, Y, 10 kHz, grid.

        Returns
        -------
        float
            NaN where the detector says nothing, as the star point of a delta.

        Raises
        ------
        DataError
            If no run sets a threshold under these conditions.
        """
        chosen = {**_MAIN, **conditions}
        rows = self.where("threshold", **chosen)
        if rows.empty:
            words = ", ".join(f"{key} = {value}" for key, value in chosen.items())
            raise DataError(f"no run with the role threshold under the conditions {words}; add a cell to the campaign.")
        values = rows[detector].to_numpy(dtype=float)
        return self.margin * float(np.max(values)) if np.isfinite(values).all() else float("nan")


def load_runs(names: Sequence[str] | None = None, folder: Path | None = None) -> StatorRuns | None:
    """Read the tables of the stator campaigns.

    Parameters
    ----------
    names : sequence of str, optional
        Campaigns; all tables whose name begins with "stator" by default.
    folder : Path, optional
        ``data/campaigns/results`` by default.

    Returns
    -------
    StatorRuns or None
        None where there is no table: the campaign was not run.

    Raises
    ------
    DataError
        If a table is damaged or of another scheme.
    """
    import pandas as pd

    if names is None:
        names = sorted(path.name[: -len(".csv.gz")] for path in (folder or RESULTS).glob("stator*.csv.gz"))
    if not names:
        return None
    results = [read(name, folder) for name in names]
    return StatorRuns(
        table=pd.concat([_with_settings(one) for one in results], ignore_index=True),
        names=tuple(names),
        provenance=tuple(one.provenance for one in results),
    )


def _with_settings(result: Result) -> Any:
    table = result.table.copy()
    defaults = asdict(ScoreSettings())
    cells = {one["name"]: {**defaults, **one["settings"]} for one in result.provenance["definition"]["cells"]}
    missing = [name for name in DETECTORS if name not in table]
    if missing:
        raise DataError(f"results of {result.name}: column {missing[0]!r} is absent; is it of the stator's scheme?")
    for name in defaults:
        table[name] = [cells[cell][name] for cell in table["cell"]]
    table.insert(0, "campaign", result.name)
    return table


def _rate(hits: Array) -> dict[str, Any]:
    one = clopper_pearson(int(np.sum(hits)), len(hits))
    return {"runs": one.n, "hits": int(np.sum(hits)), "rate": one.value, "low": one.low, "high": one.high}


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
    return sorted(found, key=lambda one: one != _MAIN)


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
        Conditions, ``detector``, ``threshold``, ``set by`` (runs), ``runs``, ``hits``, ``rate``, exact limits.
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
        Conditions, ``gamma``, ``r_f``, ``loop``, ``test``, ``detector``, ``runs``, ``hits``, ``rate``, exact limits.
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
        Conditions, fault, ``runs``, ``hits`` (phase right, alarmed or not), ``rate``, exact limits, ``wrong alarms``
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


def claim_rate(rows: Sequence[Mapping[str, Any]], **wanted: Any) -> Mapping[str, Any] | None:
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
    fixed = {**_MAIN, **({"r_f": 0.0, "loop": "phase", "test": "drawn"} if "gamma" in wanted else {}), **wanted}

    def fits(row: Mapping[str, Any]) -> bool:
        return all(
            key in row and (bool(np.isclose(row[key], value)) if isinstance(value, float) else row[key] == value)
            for key, value in fixed.items()
        )

    found = [row for row in rows if fits(row)]
    if len(found) > 1:
        raise DataError(f"claim_rate: {len(found)} rows fit {fixed}; name more of their entries.")
    return found[0] if found else None


def scaled(runs: StatorRuns, margin: float) -> StatorRuns:
    """The same runs judged with another margin of the thresholds.

    Parameters
    ----------
    runs : StatorRuns
        The runs.
    margin : float
        Factor over the largest healthy value.

    Returns
    -------
    StatorRuns
    """
    check_value("scaled", "margin", margin, Quantity("-", "margin of the thresholds", 0.5, 100.0))
    return StatorRuns(table=runs.table, names=runs.names, provenance=runs.provenance, margin=float(margin))
