"""Thesis 2.1.4, B.1: make a correlated residual independent: autoregressive whitening, and thinning.

The healthy residual is described as r_k - mean = sum of a_i (r_(k-i) - mean) + e_k with independent e_k. The
whitened residual is e_k. The first samples have no complete past; they are predicted with the shorter
predictors of the same model and scaled, so that the output is white from its very first sample.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pumplib.decide.checks import block, channel_names, number, sample
from pumplib.decide.strict import strict_kernel
from pumplib.errors import DataError, ParameterError
from pumplib.machines.quantity import Quantity

Array = NDArray[Any]
_ORDER = Quantity("-", "order of the autoregressive model", 0, 64)
_EVERY = Quantity("samples", "step of the thinning", 1, 1e9)
_SIGMA = Quantity("unit of r", "standard deviation of the independent part", 0.0, open_low=True)
_LIMIT = Quantity("-", "largest correlation left between the kept samples", 0.0, 0.5, True)


@dataclass(frozen=True, kw_only=True)
class ArModel:
    """Autoregressive model of a healthy residual.

    Parameters
    ----------
    coefficients : tuple of float
        a_1 ... a_p; empty for a white residual.
    sigma : float
        Standard deviation of the independent part e, unit of r.
    mean : float
        Mean of the residual, unit of r.

    Raises
    ------
    ParameterError
        If a number is wrong or the model is not stable.
    """

    coefficients: tuple[float, ...]
    sigma: float
    mean: float = 0.0

    def __post_init__(self) -> None:
        number("ArModel", "sigma", self.sigma, _SIGMA)
        number("ArModel", "mean", self.mean, Quantity("unit of r", "mean", -math.inf))
        for k, a in enumerate(self.coefficients):
            number("ArModel", f"coefficients[{k}]", a, Quantity("-", "coefficient", -math.inf))
        number("ArModel", "order", self.order, _ORDER, whole=True)
        if self.ladder is None:
            raise ParameterError(
                f"ArModel.coefficients = {self.coefficients}: not a stable model, a healthy residual would grow "
                "without bound; fit it with fit_ar to a longer record without drift."
            )

    @property
    def order(self) -> int:
        """Number of coefficients p."""
        return len(self.coefficients)

    @cached_property
    def ladder(self) -> tuple[Array, Array] | None:
        """Predictors from m = 0 ... p past samples, shape (p+1, p), and their errors in sigma, shape (p+1,).

        None if the model is not stable. Row m holds the coefficients of the latest m samples.
        """
        p = self.order
        table, spread = np.zeros((p + 1, p)), np.ones(p + 1)
        a = np.array(self.coefficients, dtype=float)
        for m in range(p, 0, -1):
            table[m, :m] = a
            k = a[-1]
            if not abs(k) < 1:
                return None
            spread[m - 1] = spread[m] / math.sqrt(1 - k * k)
            a = (a[:-1] + k * a[-2::-1]) / (1 - k * k)
        return table, spread

    @property
    def residual_sigma(self) -> float:
        """Standard deviation of the residual itself, unit of r."""
        assert self.ladder is not None
        return float(self.sigma * self.ladder[1][0])

    @property
    def steady_gain(self) -> float:
        """Factor by which whitening changes a constant change of the mean, 1 - sum of a_i.

        A change of size m appears in the whitened residual as m * steady_gain / sigma standard deviations: for a
        slow residual less than before, which is the price of the correct false-alarm rate.
        """
        return 1.0 - math.fsum(self.coefficients)

    def autocorrelation(self, lags: int) -> Array:
        """Autocorrelation of the residual according to the model.

        Parameters
        ----------
        lags : int
            Largest lag.

        Returns
        -------
        ndarray, shape (lags+1,)
            From lag 0.
        """
        from scipy.signal import lfilter

        p = self.order
        assert self.ladder is not None
        table, spread = self.ladder
        rho = np.zeros(max(lags, p) + 1)
        rho[0] = 1.0
        for m in range(1, p + 1):
            # predictor of order m is exact for the correlation at lag m, given the shorter ones
            k = table[m, m - 1]
            rho[m] = k * (spread[m - 1] / spread[0]) ** 2 + table[m - 1, : m - 1] @ rho[m - 1 : 0 : -1]
        if lags > p > 0:
            a = np.array(self.coefficients)
            # the recursion as a filter without input that starts from the first correlations
            state = np.array([a[i:] @ rho[p : p - (p - i) : -1] for i in range(p)])
            rho[p + 1 :] = lfilter([1.0], np.concatenate(([1.0], -a)), np.zeros(lags - p), zi=state)[0]
        return rho[: lags + 1]

    def thinning(self, limit: float = 0.01, longest: int = 100_000) -> int:
        """Step of a thinning after which no correlation above `limit` is left between kept samples.

        Parameters
        ----------
        limit : float
            0.01 keeps the run length of a CUSUM at (0.5, 5) within about 7 %; 0.05, three time constants, would
            still cost 28 %.
        longest : int
            Largest step that is looked for, samples.

        Returns
        -------
        int
            Samples.

        Raises
        ------
        ParameterError
            If there is none up to `longest`.
        """
        number("thinning", "limit", limit, _LIMIT)
        above = np.flatnonzero(np.abs(self.autocorrelation(longest)[1:]) > limit)
        if len(above) == 0:
            return 1
        if above[-1] + 2 > longest:
            raise ParameterError(
                f"thinning: correlation above {limit:g} beyond {longest} samples; remove drift from the residual first."
            )
        return int(above[-1]) + 2


def autocovariance(x: Array, lags: int) -> Array:
    """Biased autocovariance of one record, from lag 0.

    Parameters
    ----------
    x : ndarray, shape (n,)
        Samples; the mean is removed.
    lags : int
        Largest lag, below n.

    Returns
    -------
    ndarray, shape (lags+1,)
    """
    from scipy.fft import irfft, next_fast_len, rfft

    n = len(x)
    size = next_fast_len(n + lags, real=True)
    spectrum = np.abs(rfft(x - x.mean(), size)) ** 2
    return irfft(spectrum, size)[: lags + 1] / n


def fit_ar(healthy: ArrayLike, order: int | None = None, max_order: int = 10, name: str = "r1") -> ArModel:
    """Fit an autoregressive model to a healthy record by the Yule-Walker equations.

    Parameters
    ----------
    healthy : array_like, shape (n,)
        Residual of a healthy record, unit of r.
    order : int, optional
        Order; by default the one with the smallest Bayesian information criterion up to `max_order`.
    max_order : int
        Largest order that is tried.
    name : str
        Name of the channel, shown in errors.

    Returns
    -------
    ArModel
        Always stable.

    Raises
    ------
    DataError
        If a value is not finite, the record is too short or constant.
    ParameterError
        If an order is out of range.

    References
    ----------
    P. J. Brockwell and R. A. Davis, Time Series: Theory and Methods (1991), chapter 8. Thesis B.1.
    """
    from scipy.linalg import solve_toeplitz

    x = block(healthy, (name,))[:, 0]
    highest = int(number("fit_ar", "order", max_order if order is None else order, _ORDER, whole=True))
    n = len(x)
    if n < 20 * (highest + 1):
        raise DataError(
            f"channel {name}: {n} healthy samples are too few for order {highest}; give at least "
            f"{20 * (highest + 1)} or a lower order."
        )
    c = autocovariance(x, highest)
    if not c[0] > 1e-24 * max(float(np.mean(x * x)), 1e-280):
        raise DataError(f"channel {name}: the healthy record is constant ({x[0]:g}); its noise cannot be learned.")
    best: tuple[float, Array, float] | None = None
    for p in range(highest + 1) if order is None else (highest,):
        a = solve_toeplitz(c[:p], c[1 : p + 1]) if p else np.empty(0)
        variance = max(float(c[0] - a @ c[1 : p + 1]), 1e-12 * float(c[0]))
        criterion = n * math.log(variance) + p * math.log(n)
        if best is None or criterion < best[0]:
            best = (criterion, a, variance)
    assert best is not None
    return ArModel(coefficients=tuple(best[1].tolist()), sigma=math.sqrt(best[2]), mean=float(x.mean()))


@strict_kernel
def whiten_run(x, mean, table, ratio, order, seen, past, out):  # type: ignore[no-untyped-def]
    """Prediction errors of a block.

    Parameters
    ----------
    x : ndarray, shape (n, channels)
        Samples.
    mean : ndarray, shape (channels,)
        Healthy means.
    table : ndarray, shape (channels, p+1, p)
        Predictors from 0 ... p past samples.
    ratio : ndarray, shape (channels, p+1)
        Scale of the error of each predictor.
    order : ndarray of int, shape (channels,)
        Orders of the models.
    seen : int
        Samples before this block.
    past : ndarray, shape (channels, p)
        Latest samples without mean, newest first; changed.
    out : ndarray, shape (n, channels)
        Receives the whitened samples.
    """
    for c in range(x.shape[1]):
        p = order[c]
        for k in range(x.shape[0]):
            m = min(seen + k, p)
            deviation = x[k, c] - mean[c]
            predicted = 0.0
            for i in range(m):
                predicted += table[c, m, i] * past[c, i]
            out[k, c] = (deviation - predicted) * ratio[c, m]
            for i in range(p - 1, 0, -1):
                past[c, i] = past[c, i - 1]
            if p > 0:
                past[c, 0] = deviation


class Whitener:
    """Removes the healthy correlation from residuals; keeps its state between calls.

    A record in one piece or sample by sample gives the same numbers bit for bit. The output has mean zero and
    the standard deviation ``model.sigma`` of each channel.

    Parameters
    ----------
    models : ArModel or sequence of ArModel
        One a channel.
    names : sequence of str, optional
        Names of the channels.

    Raises
    ------
    ParameterError
        If models or names are wrong.
    """

    def __init__(self, models: ArModel | Sequence[ArModel], *, names: Sequence[str] | None = None) -> None:
        self.models = (models,) if isinstance(models, ArModel) else tuple(models)
        if not self.models or not all(isinstance(one, ArModel) for one in self.models):
            raise ParameterError("Whitener.models: give one ArModel a channel, at least one.")
        n, p = len(self.models), max(one.order for one in self.models)
        self.names = channel_names(names, n)
        self._mean = np.array([one.mean for one in self.models])
        self._order = np.array([one.order for one in self.models])
        self._table, self._ratio = np.zeros((n, p + 1, max(p, 1))), np.ones((n, p + 1))
        for c, one in enumerate(self.models):
            assert one.ladder is not None
            table, spread = one.ladder
            self._table[c, : one.order + 1, : one.order] = table
            self._ratio[c, : one.order + 1] = 1.0 / spread
        self.reset()

    def reset(self) -> None:
        """Forget the past samples."""
        self._seen = 0
        self._past = np.zeros((len(self.models), self._table.shape[2]))

    def update(self, values: ArrayLike) -> Array:
        """Take one sample.

        Parameters
        ----------
        values : array_like, shape (channels,) or a number for one channel
            Residuals.

        Returns
        -------
        ndarray, shape (channels,)
            Whitened residuals.

        Raises
        ------
        DataError
            If the shape is wrong or a value not finite; the state stays as it was.
        """
        return self._feed(sample(values, self.names, self._seen))[0]

    def run(self, values: ArrayLike) -> Array:
        """Take a block of samples.

        Parameters
        ----------
        values : array_like, shape (n, channels) or (n,) for one channel
            Residuals, time first.

        Returns
        -------
        ndarray, shape (n, channels)
            Whitened residuals.

        Raises
        ------
        DataError
            If the shape is wrong or a value not finite; the state stays as it was.
        """
        return self._feed(block(values, self.names, self._seen))

    def _feed(self, x: Array) -> Array:
        out = np.empty_like(x)
        whiten_run(x, self._mean, self._table, self._ratio, self._order, self._seen, self._past, out)
        self._seen += len(x)
        return out


class Thinner:
    """Keeps one sample of every `every`; keeps its place between calls.

    Parameters
    ----------
    every : int
        Step, samples; `ArModel.thinning` finds it.
    channels : int
        Number of channels.

    Raises
    ------
    ParameterError
        If a number is wrong.
    """

    def __init__(self, every: int, channels: int = 1) -> None:
        self.every = int(number("Thinner", "every", every, _EVERY, whole=True))
        self.names = channel_names(None, int(number("Thinner", "channels", channels, _EVERY, whole=True)))
        self._seen = 0

    def run(self, values: ArrayLike) -> tuple[Array, Array]:
        """Take a block of samples.

        Parameters
        ----------
        values : array_like, shape (n, channels) or (n,) for one channel
            Samples, time first; NaN passes.

        Returns
        -------
        index : ndarray of int, shape (m,)
            Indices of the kept samples, counted from the start of the stream.
        kept : ndarray, shape (m, channels)
            The samples.

        Raises
        ------
        DataError
            If the shape is wrong or a value infinite.
        """
        x = block(values, self.names, self._seen, "hold")
        index = np.arange((-self._seen) % self.every, len(x), self.every)
        found = index + self._seen, x[index]
        self._seen += len(x)
        return found
