"""Thesis 5.3: runs of the Monte Carlo campaigns of the stator observer, and the thresholds that they set.

Every statistic gets its threshold by one rule from the same healthy runs, a factor over the largest of them, so the
observer and its baselines are compared at an equal designed rate of false alarms. Runs with the role "threshold" only
set thresholds; false alarms are counted in those with the role "healthy".
"""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pumplib.campaign.results import RESULTS, Result, read
from pumplib.errors import DataError, ParameterError
from pumplib.observers.stator_score import ScoreSettings

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
MARGIN = 1.2
MAIN: dict[str, Any] = {"records": 1, "accuracy": "A", "connection": "Y", "rate": 10_000.0, "supply": "grid"}
"""Conditions that are left unsaid."""


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
        chosen = {**MAIN, **conditions}
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
