"""Thesis 2.1.4, B.1: run lengths of the designed CUSUM on white noise: time to false alarm, delay of detection."""

import math
from dataclasses import dataclass
from functools import cache
from typing import Annotated, Any

import numpy as np

from pumplib.campaign.schemes import Row
from pumplib.campaign.spec import Campaign
from pumplib.decide import arl, design
from pumplib.decide.runs import simulate_run_lengths
from pumplib.machines.quantity import Parameters, Quantity


@dataclass(frozen=True, kw_only=True, slots=True)
class RunLengthSettings(Parameters):
    """Design of the CUSUM and the change that it sees.

    Parameters
    ----------
    change : float
        Smallest change that it is designed to detect; the drift is half of it.
    false_alarm_samples : float
        Mean time between false alarms that it is designed for.
    shift : float
        True change of the mean; 0 is healthy.
    batch : int
        Run lengths of one unit of work.
    """

    change: Annotated[float, Quantity("sigma", "change to detect", 0.05, 10.0)] = 1.0
    false_alarm_samples: Annotated[float, Quantity("samples", "designed mean time to false alarm", 10.0, 1e9)] = 1e4
    shift: Annotated[float, Quantity("sigma", "true change of the mean", 0.0, 10.0)] = 0.0
    batch: Annotated[int, Quantity("-", "run lengths of one unit of work", 2, 1_000_000)] = 50


LEVEL = 0.95
name = "run_length"
settings = RunLengthSettings


@cache
def _design(change: float, samples: float) -> tuple[float, float]:
    rule = design(sigma=1.0, change=change, dt=1.0, false_alarm_samples=samples).settings()
    return rule.nu, rule.h


def score(settings: RunLengthSettings, rng: np.random.Generator) -> list[Row]:
    """Simulate some run lengths.

    Parameters
    ----------
    settings : RunLengthSettings
        Design and change.
    rng : numpy.random.Generator
        Source of randomness.

    Returns
    -------
    list of dict
        ``length``: samples from the change to the alarm.
    """
    nu, h = _design(float(settings.change), float(settings.false_alarm_samples))
    found = simulate_run_lengths(nu, h, float(settings.shift), rng=rng, runs=settings.batch)
    return [{"length": int(length)} for length in found.lengths]


def summarise(table: Any, campaign: Campaign) -> dict[str, list[dict[str, Any]]]:
    """Mean run length of each cell beside the exact one of the design.

    Parameters
    ----------
    table : pandas.DataFrame
        The results.
    campaign : Campaign
        The campaign.

    Returns
    -------
    dict of str to list of dict
        ``means``: simulated mean with its normal interval, and the solution of the integral equation, samples.
    """
    from scipy.special import ndtri

    z = float(ndtri(0.5 + LEVEL / 2))
    rows = []
    for cell in campaign.cells:
        assert isinstance(cell.settings, RunLengthSettings)
        nu, h = _design(float(cell.settings.change), float(cell.settings.false_alarm_samples))
        lengths = table.loc[table["cell"] == cell.name, "length"].to_numpy()
        mean, half = float(lengths.mean()), z * float(lengths.std(ddof=1)) / math.sqrt(len(lengths))
        exact = arl(nu, h, float(cell.settings.shift)).value
        rows.append(
            {
                "cell": cell.name,
                "n": len(lengths),
                "mean": mean,
                "low": mean - half,
                "high": mean + half,
                "exact": exact,
            }
        )
    return {"means": rows}
