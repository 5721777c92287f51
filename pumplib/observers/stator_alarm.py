"""Thesis 5.3, B.1: alarm while the observer runs: CUSUM of the fault coefficient.

The decision about a window waits for half a second of data. A large short heats its turns within seconds, so the
size of the observer's own fault coefficient is watched as well, row by row: it needs no window, and a short of five
per cent crosses within a few periods.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pumplib.decide import Cusum, CusumResult, CusumSettings
from pumplib.errors import DataError, ParameterError
from pumplib.machines.quantity import Quantity, check_value
from pumplib.observers.stator import Estimates

Array = NDArray[Any]


def fault_signal(estimates: Estimates, reference: complex) -> Array:
    """Size of the fault coefficient beside its healthy value.

    Parameters
    ----------
    estimates : Estimates
        Of the observer.
    reference : complex
        Healthy value, from commissioning.

    Returns
    -------
    ndarray, shape (m,)
        3|g_c - reference|, about the shorted share; NaN in rows that carry a flag.

    Raises
    ------
    ParameterError
        If the reference is not finite.
    """
    if not np.isfinite(reference):
        raise ParameterError(f"reference = {reference!r}: must be finite; commission the machine first.")
    return np.where(estimates.trusted, 3 * np.abs(estimates.g_c - reference), np.nan)


def tune_alarm(healthy: Sequence[Array], smallest: float, margin: float = 1.2) -> CusumSettings:
    """CUSUM that is silent in healthy signals and sums what exceeds half of the smallest short looked for.

    Parameters
    ----------
    healthy : sequence of ndarray, each shape (m,)
        `fault_signal` of healthy runs.
    smallest : float
        Size of the smallest short to find, in the signal's unit.
    margin : float
        Threshold over the largest healthy sum.

    Returns
    -------
    CusumSettings

    Raises
    ------
    DataError
        If there is no healthy signal, or one without a single trusted row.
    ParameterError
        If a number is outside its limits.
    """
    check_value("tune_alarm", "smallest", smallest, Quantity("-", "smallest short to find", 0.0, 1.0, True))
    check_value("tune_alarm", "margin", margin, Quantity("-", "margin of the threshold", 1.0, 100.0))
    kept = [np.asarray(one)[np.isfinite(one)] for one in healthy]
    if not kept or any(len(one) == 0 for one in kept):
        raise DataError("tune_alarm: every healthy signal needs trusted rows; give at least one such signal.")
    every = np.concatenate(kept)
    mean, sigma = float(every.mean()), float(every.std())
    if sigma == 0:
        raise DataError("tune_alarm: the healthy signals do not vary at all; give measured ones.")
    nu = max(0.5 * (smallest - mean), 0.0) / sigma
    trial = CusumSettings(sigma=sigma, nu=nu, h=1e6, mean=mean, sides="up")
    largest = max(float(Cusum(trial, after_alarm="continue").run(one, trace=True).up.max()) for one in kept)
    return CusumSettings(sigma=sigma, nu=nu, h=max(margin * largest, 1.0), mean=mean, sides="up")


def run_alarm(signal: Array, settings: CusumSettings) -> CusumResult:
    """First alarm of a signal, if there is one.

    Parameters
    ----------
    signal : ndarray, shape (m,)
        `fault_signal`; rows without trust hold the sum.
    settings : CusumSettings
        Of `tune_alarm`.

    Returns
    -------
    CusumResult
    """
    return Cusum(settings, after_alarm="stop", missing="hold").run(np.asarray(signal, dtype=float))
