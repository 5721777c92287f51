"""Thesis 7.4: is this point steady? A test on slow samples with a stated rate of wrong answers (reconstructed).

Over a window the samples of every channel are split into a straight line and a rest. While the point is steady, the
slope divided by its standard error follows Student's distribution, whatever the noise's size, as long as the noise of
different samples is independent; the rest must not exceed what is known of the noise. The point is called
steady when no channel's change over the window is larger than a tolerance *with confidence*: the tolerance test. So a
drift that is real but smaller than the tolerance passes, and noise alone rarely blocks.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pumplib.errors import DataError, ParameterError
from pumplib.machines.quantity import Parameters, Quantity
from pumplib.steady.relations import CHANNELS, UNITS

Array = NDArray[Any]


@dataclass(frozen=True, kw_only=True, slots=True)
class SteadySettings(Parameters):
    """Settings of the detector.

    Parameters
    ----------
    window : int
        Samples looked at.
    wrong_steady : float
        Probability of calling a window steady whose change of some channel is as large as its tolerance.
    """

    window: Annotated[int, Quantity("-", "samples of a window", 4, 100_000)] = 8
    wrong_steady: Annotated[float, Quantity("-", "probability of a wrong 'steady'", 1e-9, 0.5)] = 0.01


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class SteadyResult:
    """Answer of the detector for windows that end at each sample.

    Parameters
    ----------
    steady : ndarray of bool, shape (n,)
        False also where the window is not full or has a missing sample.
    change : dict of str to ndarray, shape (n,)
        Change of each channel over the window by its straight line, in the channel's unit; NaN where not known.
    bound : dict of str to ndarray, shape (n,)
        Upper confidence bound of the absolute change.
    missed : float
        Probability of not calling a perfectly steady window steady, from the scatter seen in the windows called
        steady; NaN where there are none.
    """

    steady: Array
    change: dict[str, Array]
    bound: dict[str, Array]
    missed: float


def steady_windows(
    signals: Mapping[str, ArrayLike], tolerance: Mapping[str, float], settings: SteadySettings | None = None
) -> SteadyResult:
    """Find steady windows in slow samples.

    The change of a channel is the slope of its straight line times the window. Its confidence bound is
    |change| + t s, with the slope's standard error s and the quantile t of Student's distribution; steady means that
    the bounds of all channels are below their tolerances. A channel that changes by exactly its tolerance passes
    with at most the stated probability, for independent normal noise and a linear change. A step inside the window
    is no line: it raises the scatter and with it the bound.

    Parameters
    ----------
    signals : mapping of str to array_like, shape (n,)
        Channels at equal distances in time, such as 1 Hz means; NaN marks missing samples.
    tolerance : mapping of str to float
        Largest change over the window, by channel, in SI units; channels left out are not looked at.
    settings : SteadySettings, optional
        Window and probability.

    Returns
    -------
    SteadyResult

    Raises
    ------
    DataError
        If a channel is missing or of another length.
    ParameterError
        If a tolerance is not positive or of an unknown channel.

    References
    ----------
    Thesis 7.4 (reconstructed). S. Cao and R. R. Rhinehart, An efficient method for on-line identification of
    steady state, J. Process Control 5 (1995), for the problem.
    """
    from scipy.stats import t

    chosen = settings or SteadySettings()
    if not tolerance:
        raise ParameterError("steady_windows: give a tolerance for one channel at least.")
    for name, value in tolerance.items():
        if name not in CHANNELS:
            raise ParameterError(f"tolerance: {name!r} is no channel; use {', '.join(CHANNELS)}.")
        if not (0 < value < math.inf):
            raise ParameterError(f"tolerance[{name!r}] = {value!r} {UNITS[name]}: must be > 0 and finite.")
    missing = [name for name in tolerance if name not in signals]
    if missing:
        raise DataError(f"channel {', '.join(missing)} has a tolerance but is not there.")
    columns = {name: np.asarray(signals[name], dtype=float) for name in tolerance}
    shapes = {name: x.shape for name, x in columns.items()}
    if len(set(shapes.values())) > 1 or any(len(s) != 1 for s in shapes.values()):
        raise DataError(f"channels must be one-dimensional and of one length: {shapes}.")
    n, w = len(next(iter(columns.values()))), chosen.window
    time = np.arange(w) - 0.5 * (w - 1)
    spread = float(time @ time)
    quantile = float(t.ppf(1.0 - chosen.wrong_steady, w - 2))
    steady = np.full(n, n >= w)
    steady[: w - 1] = False
    change, bound, ratios = {}, {}, []
    for name, x in columns.items():
        change[name], bound[name] = np.full(n, np.nan), np.full(n, np.nan)
        if n < w:
            continue
        rows = np.lib.stride_tricks.sliding_window_view(x, w)
        centered = rows - rows.mean(axis=1, keepdims=True)
        slope = centered @ time / spread
        rest = centered - slope[:, None] * time
        error = np.sqrt((rest**2).sum(axis=1) / (w - 2) / spread)
        change[name][w - 1 :] = slope * w
        bound[name][w - 1 :] = (np.abs(slope) + quantile * error) * w
        steady &= np.nan_to_num(bound[name], nan=np.inf) < tolerance[name]
        ratios.append((tolerance[name], error * w))
    passed = steady[w - 1 :]
    missed = math.nan
    if passed.any():
        # a steady channel fails when |slope| + quantile * error > tolerance; slope is normal with the true error,
        # the estimated one follows the chi distribution: averaged over it by quadrature
        kept = 1.0
        for limit, error in ratios:
            true = float(np.sqrt(np.mean(error[passed] ** 2)))
            kept *= _passes(limit / true if true > 0 else math.inf, quantile, w - 2)
        missed = 1.0 - kept
    return SteadyResult(steady=steady, change=change, bound=bound, missed=missed)


def _passes(limit: float, quantile: float, freedom: int) -> float:
    """Probability of |z| + quantile * s < limit with z normal and s^2 chi-square over its degrees of freedom."""
    from scipy.stats import chi2, norm

    if not math.isfinite(limit):
        return 1.0
    share = (np.arange(2000) + 0.5) / 2000
    room = limit - quantile * np.sqrt(chi2.ppf(share, freedom) / freedom)
    return float(np.mean(np.where(room > 0, 2 * norm.cdf(np.maximum(room, 0)) - 1, 0.0)))
