"""Thesis 2.1.4, B.1: residual evaluation: CUSUM and its design, adaptive thresholds, persistence, isolation."""

from pumplib.decide.arl import RunLength, arl, arl_integral, arl_markov, siegmund, steady_delay
from pumplib.decide.correlation import (
    CorrelatedResidualWarning,
    Correlation,
    assess,
    correlation_time,
    ljung_box,
)
from pumplib.decide.cusum import Alarm, Cusum, CusumResult, CusumSettings
from pumplib.decide.design import CusumDesign, design, solve_threshold
from pumplib.decide.isolate import NONE_FITS, Candidate, Isolation, SignatureTable, isolate_direction, window_mean
from pumplib.decide.persistence import Persistence, PersistenceSettings
from pumplib.decide.runs import RunLengths, simulate_run_lengths
from pumplib.decide.threshold import (
    Activity,
    ActivitySettings,
    Evaluator,
    Threshold,
    ThresholdAlarm,
    ThresholdResult,
    learn,
)
from pumplib.decide.whitening import ArModel, Thinner, Whitener, fit_ar

__all__ = [
    "NONE_FITS",
    "Activity",
    "ActivitySettings",
    "Alarm",
    "ArModel",
    "Candidate",
    "CorrelatedResidualWarning",
    "Correlation",
    "Cusum",
    "CusumDesign",
    "CusumResult",
    "CusumSettings",
    "Evaluator",
    "Isolation",
    "Persistence",
    "PersistenceSettings",
    "RunLength",
    "RunLengths",
    "SignatureTable",
    "Thinner",
    "Threshold",
    "ThresholdAlarm",
    "ThresholdResult",
    "Whitener",
    "arl",
    "arl_integral",
    "arl_markov",
    "assess",
    "correlation_time",
    "design",
    "fit_ar",
    "isolate_direction",
    "learn",
    "ljung_box",
    "siegmund",
    "simulate_run_lengths",
    "solve_threshold",
    "steady_delay",
    "window_mean",
]
