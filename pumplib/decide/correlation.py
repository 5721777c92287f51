"""Thesis 2.1.4, B.1: is a healthy residual independent enough for the design, and what happens if it is not.

The run-length formulas hold for independent samples. Residuals of observers are low-pass filtered, and the
CUSUM then alarms far more often than designed. `assess` measures the correlation on a healthy record,
simulates the run length that the CUSUM has on such a residual, and says which remedy is due.
"""

import math
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pumplib.decide.arl import RunLength, arl
from pumplib.decide.checks import block, channel_names, generator, number
from pumplib.decide.cusum import CusumSettings
from pumplib.decide.runs import simulate_run_lengths
from pumplib.decide.whitening import ArModel, autocovariance, fit_ar
from pumplib.errors import DataError, ParameterError
from pumplib.machines.quantity import Quantity

Array = NDArray[Any]
_BUDGET = 20_000_000  # simulated samples a channel, about 0.3 s


class CorrelatedResidualWarning(UserWarning):
    """A residual is correlated: the CUSUM will alarm more often than designed."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Correlation:
    """What a healthy record says about one channel.

    Parameters
    ----------
    channel : str
        Name of the channel.
    samples : int
        Length of the record.
    dt : float
        Sampling interval, s.
    model : ArModel
        Autoregressive model fitted to it.
    lag_one : float
        Correlation of neighbouring samples.
    correlation_time : float
        Integrated correlation time dt (1 + 2 sum of the autocorrelation), s; dt for an independent residual.
    p_value : float
        Ljung-Box test that the residual is independent.
    designed : RunLength
        Mean run length of the settings on an independent residual, samples.
    actual : float
        Simulated mean run length on the fitted model, samples.
    interval : tuple of float
        Its 95 % confidence interval, samples.
    restarted : float
        Mean time between alarms if the detector restarts at once after each alarm, samples.
    independent : bool
        Whether the design holds: no significant correlation, or one without effect on the run length.
    thinning : int
        Step of a thinning that leaves no correlation above 0.01, samples.
    """

    channel: str
    samples: int
    dt: float
    model: ArModel
    lag_one: float
    correlation_time: float
    p_value: float
    designed: RunLength
    actual: float
    interval: tuple[float, float]
    restarted: float
    independent: bool
    thinning: int

    @property
    def message(self) -> str:
        """The finding in words, with the remedies."""
        if self.independent:
            return f"channel {self.channel}: independent enough, the designed run length holds."
        return (
            f"channel {self.channel}: correlation {self.lag_one:.2f} between neighbouring samples, correlation time "
            f"{self.correlation_time:.3g} s (Ljung-Box p = {self.p_value:.2g}). The CUSUM will alarm every "
            f"{self.actual * self.dt:.3g} s (95 %: {self.interval[0] * self.dt:.3g} to "
            f"{self.interval[1] * self.dt:.3g} s) instead of every {self.designed.value * self.dt:.3g} s. "
            f"Whiten with Whitener (order {self.model.order}), or keep one sample of every {self.thinning} with "
            "Thinner, and design again."
        )


def correlation_time(healthy: ArrayLike, dt: float, name: str = "r1") -> float:
    """Integrated correlation time of a healthy record.

    dt (1 + 2 sum of the autocorrelation) up to the first lag that is more than 5 times the time found so far, the
    usual compromise between bias and noise.

    Parameters
    ----------
    healthy : array_like, shape (n,)
        Residual.
    dt : float
        Sampling interval, s.
    name : str
        Name of the channel, shown in errors.

    Returns
    -------
    float
        Seconds; dt for an independent residual.

    Raises
    ------
    DataError
        If a value is not finite, or the record is constant or shorter than 100 samples or than 20 correlation times.

    References
    ----------
    A. D. Sokal, Monte Carlo methods in statistical mechanics (1989), section 3.
    """
    number("correlation_time", "dt", dt, Quantity("s", "sampling interval", 0.0, 1e6, True))
    x = block(healthy, (name,))[:, 0]
    n = len(x)
    if n < 100:
        raise DataError(f"channel {name}: {n} healthy samples are too few for a correlation time; give 100 or more.")
    c = autocovariance(x, n // 2)
    if not c[0] > 1e-24 * max(float(np.mean(x * x)), 1e-280):
        raise DataError(f"channel {name}: the healthy record is constant ({x[0]:g}); its noise cannot be learned.")
    times = 1 + 2 * np.cumsum(c[1:]) / c[0]
    enough = np.flatnonzero(np.arange(1, len(times) + 1) >= 5 * times)
    steps = float(times[enough[0]]) if len(enough) else math.inf
    if 20 * steps > n:
        raise DataError(
            f"channel {name}: the correlation time is not short against the record of {n * dt:.3g} s; remove drift "
            "or give a longer healthy record."
        )
    return max(steps, 1e-3) * dt


def ljung_box(healthy: ArrayLike, lags: int = 20, name: str = "r1") -> float:
    """Ljung-Box test of independence.

    Parameters
    ----------
    healthy : array_like, shape (n,)
        Residual.
    lags : int
        Number of lags.
    name : str
        Name of the channel, shown in errors.

    Returns
    -------
    float
        Probability of a correlation at least as strong in an independent residual.

    Raises
    ------
    DataError
        If the record is too short or constant, or a value not finite.

    References
    ----------
    G. M. Ljung and G. E. P. Box, On a measure of lack of fit in time series models, Biometrika 65 (1978).
    """
    from scipy.stats import chi2

    x = block(healthy, (name,))[:, 0]
    m = int(number("ljung_box", "lags", lags, Quantity("-", "number of lags", 1, 10_000), whole=True))
    n = len(x)
    if n < 5 * m:
        raise DataError(f"channel {name}: {n} healthy samples are too few for {m} lags; give {5 * m} or more.")
    c = autocovariance(x, m)
    if not c[0] > 1e-24 * max(float(np.mean(x * x)), 1e-280):
        raise DataError(f"channel {name}: the healthy record is constant ({x[0]:g}); its noise cannot be learned.")
    rho = c[1:] / c[0]
    return float(chi2.sf(n * (n + 2) * np.sum(rho * rho / (n - np.arange(1, m + 1))), m))


def assess(
    healthy: ArrayLike,
    settings: CusumSettings | Sequence[CusumSettings],
    *,
    dt: float,
    rng: np.random.Generator,
    names: Sequence[str] | None = None,
    tolerance: float = 0.2,
    max_order: int = 10,
    runs: int = 2000,
    warn: bool = True,
) -> tuple[Correlation, ...]:
    """Check on a healthy record that residuals are independent enough for their CUSUM settings.

    Parameters
    ----------
    healthy : array_like, shape (n, channels) or (n,) for one channel
        Residuals of a healthy record.
    settings : CusumSettings or sequence of CusumSettings
        One a channel.
    dt : float
        Sampling interval, s.
    rng : numpy.random.Generator
        Source of randomness of the simulated run lengths.
    names : sequence of str, optional
        Names of the channels.
    tolerance : float
        Loss of run length that is accepted.
    max_order : int
        Largest order of the autoregressive model.
    runs : int
        Simulated runs a channel; together they are cut at 20 million samples.
    warn : bool
        Whether to warn for every channel that is not independent.

    Returns
    -------
    tuple of Correlation
        One a channel.

    Raises
    ------
    DataError
        If the record is too short, constant or not finite.
    ParameterError
        If an argument is wrong.

    Warns
    -----
    CorrelatedResidualWarning
        For every channel that is not independent, with numbers and remedies.

    References
    ----------
    Thesis 2.1.4, B.1. R. A. Johnson and M. Bagshaw, The effect of serial correlation on the performance of CUSUM
    tests, Technometrics 16 (1974).
    """
    many = (settings,) if isinstance(settings, CusumSettings) else tuple(settings)
    if not many or not all(isinstance(one, CusumSettings) for one in many):
        raise ParameterError("assess: give one CusumSettings a channel, at least one.")
    generator(rng, "assess")
    number("assess", "dt", dt, Quantity("s", "sampling interval", 0.0, 1e6, True))
    number("assess", "tolerance", tolerance, Quantity("-", "accepted loss of run length", 0.01, 0.9))
    labels = channel_names(names, len(many))
    x = block(healthy, labels)
    found = tuple(
        _assess_one(x[:, c], one, labels[c], dt, rng, tolerance, max_order, runs) for c, one in enumerate(many)
    )
    for one in found:
        if warn and not one.independent:
            warnings.warn(one.message, CorrelatedResidualWarning, stacklevel=2)
    return found


def _assess_one(
    x: Array,
    settings: CusumSettings,
    name: str,
    dt: float,
    rng: np.random.Generator,
    tolerance: float,
    max_order: int,
    runs: int,
) -> Correlation:
    model = fit_ar(x, max_order=max_order, name=name)
    p_value = ljung_box(x, name=name)
    designed = arl(settings.nu, settings.h, sides=settings.sides)
    if p_value > 0.01 or model.order == 0:
        actual = restarted = designed.value
        interval, independent = (actual, actual), True
    else:
        limit = max(int(min(20 * designed.value, _BUDGET / runs)), 1)
        nu, h, sides = settings.nu, settings.h, settings.sides
        fresh = simulate_run_lengths(nu, h, rng=rng, runs=runs, sides=sides, model=model, limit=limit)
        going = simulate_run_lengths(nu, h, rng=rng, runs=runs, sides=sides, model=model, limit=limit, start="continue")
        actual, interval, restarted = fresh.mean, fresh.interval(), going.mean
        independent = interval[1] >= (1 - tolerance) * designed.value
    c = autocovariance(x, 1)
    return Correlation(
        channel=name,
        samples=len(x),
        dt=dt,
        model=model,
        lag_one=float(c[1] / c[0]),
        correlation_time=correlation_time(x, dt, name),
        p_value=p_value,
        designed=designed,
        actual=actual,
        interval=interval,
        restarted=restarted,
        independent=independent,
        thinning=model.thinning(),
    )
