"""Thesis 7.4: from slow samples of a run to its steady points, one a stretch of steady windows (reconstructed)."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pumplib.errors import DataError
from pumplib.steady.detector import SteadySettings, steady_windows
from pumplib.steady.relations import CHANNELS
from pumplib.testbench.slow import SlowSignals

Array = NDArray[Any]


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class SteadyStretch:
    """Steady points of a record.

    Parameters
    ----------
    t : ndarray, shape (n,)
        Time of the last sample of each point's window, s.
    signals : dict of str to ndarray, shape (n,)
        Means of the channels over the window, SI.
    """

    t: Array
    signals: dict[str, Array]


def channels_of(slow: SlowSignals) -> dict[str, Array]:
    """Channels of slow signals by name, those that exist.

    Parameters
    ----------
    slow : SlowSignals
        Of the bench or of a controller.

    Returns
    -------
    dict of str to ndarray
    """
    found = {name: getattr(slow, name) for name in CHANNELS}
    return {name: np.asarray(x) for name, x in found.items() if x is not None}


def steady_stretches(
    t: ArrayLike,
    signals: Mapping[str, ArrayLike],
    tolerance: Mapping[str, float],
    settings: SteadySettings | None = None,
) -> SteadyStretch:
    """One point for each unbroken stretch of steady windows: the mean over its last window, where most has settled.

    Parameters
    ----------
    t : array_like, shape (n,)
        Times, s.
    signals : mapping of str to array_like, shape (n,)
        Channels, NaN where missing.
    tolerance : mapping of str to float
        See `pumplib.steady.detector.steady_windows`.
    settings : SteadySettings, optional
        Of the detector.

    Returns
    -------
    SteadyStretch

    Raises
    ------
    DataError
        If lengths differ or a channel with a tolerance is missing.

    References
    ----------
    Thesis 7.4 (reconstructed).
    """
    chosen = settings or SteadySettings()
    times = np.asarray(t, dtype=float)
    columns = {name: np.asarray(x, dtype=float) for name, x in signals.items()}
    wrong = [name for name, x in columns.items() if x.shape != times.shape]
    if wrong:
        raise DataError(f"channels {', '.join(wrong)} have other lengths than t, {times.shape}.")
    steady = steady_windows(columns, tolerance, chosen).steady
    for x in columns.values():  # a channel without a tolerance must at least be there
        steady = steady & _whole(x, chosen.window)
    last = np.flatnonzero(steady & ~np.append(steady[1:], False))
    mean = {
        name: np.array([x[k - chosen.window + 1 : k + 1].mean() for k in last]) for name, x in columns.items()
    }  # fmt: skip
    return SteadyStretch(t=times[last], signals=mean)


def _whole(x: Array, window: int) -> Array:
    there = np.isfinite(x).astype(float)
    count = np.convolve(there, np.ones(window))[: len(x)]
    return np.asarray(count > window - 0.5)
