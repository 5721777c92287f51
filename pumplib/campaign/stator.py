"""Thesis 5.3: the stator observer and its baselines on the bench, run by run; thresholds are set afterwards.

One unit of work is one motor: commissioned on cold healthy records, tested once. Rows hold statistics, not
decisions: the threshold of a method is a factor times the largest value of the healthy runs of its threshold cell.
"""

import math

import numpy as np

from pumplib.campaign.schemes import Row
from pumplib.observers.stator_score import ScoreSettings, score_run

name = "stator"
settings = ScoreSettings
groups = ("gamma",)


def score(settings: ScoreSettings, rng: np.random.Generator) -> Row:
    """Score one run.

    Parameters
    ----------
    settings : ScoreSettings
        What it is about.
    rng : numpy.random.Generator
        Source of randomness.

    Returns
    -------
    dict
        Columns of `pumplib.observers.stator_score.score_run`; None where there is no value.
    """
    found = {key: float(value) for key, value in score_run(settings, rng).items()}
    row: dict[str, float | None] = {key: None if math.isnan(value) else value for key, value in found.items()}
    return {"gamma": settings.gamma, **row}
