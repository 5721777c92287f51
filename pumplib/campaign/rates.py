"""Thesis, all chapters: rates, quantiles and smallest detectable sizes from many runs, each with its interval."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pumplib.errors import DataError, ParameterError
from pumplib.machines.quantity import Quantity, check_value

Array = NDArray[Any]
Method = Literal["clopper-pearson", "wilson"]
METHODS = ("clopper-pearson", "wilson")
_LEVEL = Quantity("-", "confidence level", 0.0, 0.9999999, True)
_COUNT = Quantity("-", "count", 0.0, 1e15)


@dataclass(frozen=True, kw_only=True, slots=True)
class Estimate:
    """A number with its confidence interval.

    Parameters
    ----------
    value, low, high : float
        Point estimate and limits.
    n : int
        Runs it comes from.
    """

    value: float
    low: float
    high: float
    n: int

    def text(self, factor: float = 1.0, digits: int = 3) -> str:
        """Write estimate and interval.

        Parameters
        ----------
        factor : float
            On all three numbers, 100 for percent.
        digits : int
            Significant digits.

        Returns
        -------
        str
        """
        low, value, high = (f"{factor * x:.{digits}g}" for x in (self.low, self.value, self.high))
        return f"{value} ({low} - {high})"


def _checked(where: str, k: int, n: int, level: float) -> tuple[int, int, float]:
    check_value(where, "n", n, Quantity("-", "number of runs", 1.0, 1e15), whole=True)
    check_value(where, "k", k, _COUNT, whole=True)
    check_value(where, "level", level, _LEVEL)
    if k > n:
        raise ParameterError(f"{where}: k = {k} of n = {n} runs: there cannot be more hits than runs.")
    return int(k), int(n), float(level)


def wilson(k: int, n: int, level: float = 0.95) -> Estimate:
    """Rate with Wilson's score interval: covers its level on average, not for every true rate.

    Parameters
    ----------
    k, n : int
        Hits and runs.
    level : float
        Confidence level.

    Returns
    -------
    Estimate

    Raises
    ------
    ParameterError
        If a number is wrong.

    References
    ----------
    E. B. Wilson, J. Am. Stat. Assoc. 22 (1927) 209.
    """
    k, n, level = _checked("wilson", k, n, level)
    low, high = _wilson_limits(k / n, n, level)
    # at the ends the limit is the estimate itself, which rounding would miss
    return Estimate(value=k / n, low=low if k else 0.0, high=high if k < n else 1.0, n=n)


def _wilson_limits(p: float, n: float, level: float) -> tuple[float, float]:
    from scipy.special import ndtri

    z = float(ndtri(0.5 + level / 2))
    share = z * z / n
    centre = (p + share / 2) / (1 + share)
    half = math.sqrt(share * (p * (1 - p) + share / 4)) / (1 + share)
    return centre - half, centre + half


def clopper_pearson(k: int, n: int, level: float = 0.95) -> Estimate:
    """Rate with the exact interval of Clopper and Pearson: covers at least its level whatever the true rate.

    Parameters
    ----------
    k, n : int
        Hits and runs.
    level : float
        Confidence level.

    Returns
    -------
    Estimate

    Raises
    ------
    ParameterError
        If a number is wrong.

    References
    ----------
    C. J. Clopper, E. S. Pearson, Biometrika 26 (1934) 404.
    """
    from scipy.special import betaincinv

    k, n, level = _checked("clopper_pearson", k, n, level)
    tail = (1 - level) / 2
    low = float(betaincinv(k, n - k + 1, tail)) if k else 0.0
    high = float(betaincinv(k + 1, n - k, 1 - tail)) if k < n else 1.0
    return Estimate(value=k / n, low=low, high=high, n=n)


def rate(
    hits: ArrayLike, level: float = 0.95, method: Method = "clopper-pearson", clusters: ArrayLike | None = None
) -> Estimate:
    """Share of runs with a hit.

    Runs of one machine are alike, so they say less than as many runs of different machines. With `clusters` the
    number of runs is reduced to that of independent ones with the same variance of the rate, and by the ratio of
    the normal to the t quantile for the few machines that the variance comes from.

    Parameters
    ----------
    hits : array_like, shape (n,)
        Zeros and ones, or bool.
    level : float
        Confidence level.
    method : {"clopper-pearson", "wilson"}
        Interval.
    clusters : array_like, shape (n,), optional
        Machine of each run; independent runs by default.

    Returns
    -------
    Estimate

    Raises
    ------
    DataError
        If something is neither 0 nor 1, there is no run, or the clusters do not fit.
    ParameterError
        If there is no such method.

    References
    ----------
    E. L. Korn, B. I. Graubard, Survey Methodology 24 (1998) 193.
    """
    if method not in METHODS:
        raise ParameterError(f"rate: method = {method!r}: must be one of {', '.join(METHODS)}.")
    values = np.asarray(hits)
    if values.ndim != 1 or not len(values) or not np.isin(values, (0, 1)).all():
        raise DataError("rate: hits must be a list of zeros and ones, one a run, with at least one run.")
    k, n = int(values.sum()), len(values)
    interval = clopper_pearson if method == "clopper-pearson" else wilson
    if clusters is None:
        return interval(k, n, level)
    _checked("rate", k, n, level)
    return _clustered(values.astype(float), np.asarray(clusters), level, method)


def _clustered(hits: Array, clusters: Array, level: float, method: Method) -> Estimate:
    from scipy.special import betaincinv, ndtri, stdtrit

    if clusters.shape != hits.shape:
        raise DataError(f"rate: clusters of shape {clusters.shape}, hits of shape {hits.shape}: give one for each run.")
    n, p = len(hits), float(hits.mean())
    machine = np.unique(clusters, return_inverse=True)[1]
    m = int(machine.max()) + 1
    exact = clopper_pearson if method == "clopper-pearson" else wilson
    if p in (0.0, 1.0):
        # no variance is seen: the safe side is that all runs of a machine say the same
        return replace(exact(int(p) * m, m, level), n=n)
    if m < 2:
        return Estimate(value=p, low=0.0, high=1.0, n=n)
    excess = np.bincount(machine, hits - p)
    variance = m / (m - 1) * float((excess**2).sum()) / n**2
    tail = (1 - level) / 2
    few = (float(ndtri(tail)) / float(stdtrit(m - 1, tail))) ** 2
    alone = min(n, p * (1 - p) / variance) * few if variance > 0 else n * few
    k = p * alone
    if method == "clopper-pearson":
        low, high = float(betaincinv(k, alone - k + 1, tail)), float(betaincinv(k + 1, alone - k, 1 - tail))
    else:
        low, high = _wilson_limits(p, alone, level)
    return Estimate(value=p, low=low, high=high, n=n)


def rate_table(
    table: Any, columns: Sequence[str], by: Sequence[str] = ("cell",), level: float = 0.95,
    method: Method = "clopper-pearson",
    clusters: str | None = None,
) -> list[dict[str, Any]]:  # fmt: skip
    """Rates of several columns, group by group.

    Parameters
    ----------
    table : pandas.DataFrame
        Such as `Result.table`.
    columns : sequence of str
        Columns of zeros and ones.
    by : sequence of str
        Columns whose values make a group.
    level : float
        Confidence level.
    method : {"clopper-pearson", "wilson"}
        Interval.
    clusters : str, optional
        Column that names the machine: ``"run"`` where a run of the campaign is a machine with several rows.

    Returns
    -------
    list of dict
        For each group and column, in the order of the table: the group, ``column``, ``hits``, ``n``, ``rate``,
        ``low``, ``high``.

    Raises
    ------
    DataError
        If a column is absent or holds something else.
    """
    for name in (*columns, *by, *(() if clusters is None else (clusters,))):
        if name not in table:
            raise DataError(f"rate_table: column {name!r} is absent; there are {', '.join(map(str, table.columns))}.")
    found = []
    for key, part in table.groupby(list(by), sort=False, dropna=False):
        for name in columns:
            try:
                one = rate(
                    part[name].to_numpy(), level, method, None if clusters is None else part[clusters].to_numpy()
                )
            except DataError as error:
                raise DataError(f"rate_table: column {name!r}: {error}") from None
            place = dict(zip(by, key, strict=True))
            hits = int(part[name].sum())
            found.append(
                {**place, "column": name, "hits": hits, "n": one.n, "rate": one.value, "low": one.low, "high": one.high}
            )
    return found


def quantile(values: ArrayLike, q: float, level: float = 0.95) -> Estimate:
    """Quantile with an interval between two order statistics: right for every distribution.

    Parameters
    ----------
    values : array_like, shape (n,)
        One number a run; infinite is allowed (never detected).
    q : float
        Between 0 and 1.
    level : float
        Confidence level, which the interval reaches or exceeds.

    Returns
    -------
    Estimate
        The value is the smallest of the numbers that at least a share q does not exceed. A limit is infinite where
        the runs are too few for it.

    Raises
    ------
    DataError
        If there is no number, or one is NaN.
    ParameterError
        If q or the level is not between 0 and 1.

    References
    ----------
    H. A. David, H. N. Nagaraja, Order Statistics (2003), section 7.1.
    """
    from scipy.stats import binom

    check_value("quantile", "q", q, Quantity("-", "share", 0.0, 0.9999999, True))
    check_value("quantile", "level", level, _LEVEL)
    x = np.sort(np.asarray(values, dtype=float))
    if x.ndim != 1 or not len(x) or np.isnan(x).any():
        raise DataError(
            "quantile: values must be a list of numbers, at least one and none of them NaN; infinite is never."
        )
    n, tail = len(x), (1 - level) / 2
    # P(x_(r) > quantile) = P(fewer than r of n are not above it) <= tail, and the same from the other end
    r = int(binom.ppf(tail, n, q))
    s = int(binom.ppf(1 - tail, n, q)) + 1
    low = float(x[r - 1]) if r >= 1 else -math.inf
    high = float(x[s - 1]) if s <= n else math.inf
    place = max(0, math.ceil(q * n - 1e-9) - 1)
    return Estimate(value=float(x[place]), low=low, high=high, n=n)


@dataclass(frozen=True, kw_only=True, slots=True)
class DetectionSize:
    """Size of a fault that is detected in a given share of the runs.

    Parameters
    ----------
    share : float
        The share.
    size : float or None
        Where the rate reaches it; None if it does not within the sizes that were tried.
    low, high : float
        Confidence limits: 0 if even the smallest size may be detected so often, infinite if the largest may not be.
    smallest, largest : float
        Sizes that were tried.
    """

    share: float
    size: float | None
    low: float
    high: float
    smallest: float
    largest: float

    def __str__(self) -> str:
        if self.size is None:
            return (
                f"< {self.smallest:.3g}" if self.low == 0.0 and self.high <= self.smallest else f"> {self.largest:.3g}"
            )
        return f"{self.size:.3g} ({self.low:.3g} - {self.high:.3g})"


def _rising(p: Array, weight: Array) -> Array:
    """Nearest rates that never fall with the size (pool adjacent violators)."""
    blocks: list[list[float]] = []
    for value, w in zip(p, weight, strict=True):
        blocks.append([float(value), float(w), 1])
        while len(blocks) > 1 and blocks[-2][0] > blocks[-1][0]:
            value_2, w_2, n_2 = blocks.pop()
            value_1, w_1, n_1 = blocks.pop()
            blocks.append([(value_1 * w_1 + value_2 * w_2) / (w_1 + w_2), w_1 + w_2, n_1 + n_2])
    return np.concatenate([np.full(int(n), value) for value, _, n in blocks])


def _reached(x: Array, p: Array, share: float) -> float | None:
    """First place where a rising line through the points reaches a share."""
    above = np.flatnonzero(p >= share)
    if not len(above):
        return math.inf
    k = int(above[0])
    if k == 0:
        return None
    return float(x[k - 1] + (share - p[k - 1]) / (p[k] - p[k - 1]) * (x[k] - x[k - 1]))


def detection_size(
    sizes: ArrayLike, hits: ArrayLike, runs: ArrayLike, share: float = 0.9, level: float = 0.95
) -> DetectionSize:
    """Size that is detected in a share of the runs, between the sizes that were tried.

    The rate is taken to rise with the size. It is made to do so (isotonic regression) and joined by straight lines
    over the logarithm of the size. The limits are where the exact limits of the rates reach the share: as the rate
    rises, the lower limit at a smaller size holds for the larger ones too, and the upper one for the smaller ones.

    Parameters
    ----------
    sizes : array_like, shape (m,)
        Positive, rising.
    hits, runs : array_like of int, shape (m,)
        Detected runs and runs of each size.
    share : float
        To be detected.
    level : float
        Confidence level of the limits at one size.

    Returns
    -------
    DetectionSize

    Raises
    ------
    DataError
        If the lists do not fit together or the sizes do not rise from above zero.
    ParameterError
        If share or level is not between 0 and 1.
    """
    check_value("detection_size", "share", share, Quantity("-", "share to be detected", 0.0, 0.9999999, True))
    x, k, n = (np.asarray(values, dtype=float) for values in (sizes, hits, runs))
    if x.ndim != 1 or len(x) < 2 or not x.shape == k.shape == n.shape:
        raise DataError("detection_size: sizes, hits and runs must be lists of the same length, two at least.")
    if not (np.isfinite(x).all() and x[0] > 0 and (np.diff(x) > 0).all()):
        raise DataError("detection_size: sizes must be positive and rise; healthy runs (size 0) do not belong here.")
    limits = [clopper_pearson(int(hit), int(run), level) for hit, run in zip(k, n, strict=True)]
    place = np.log(x)
    lower = np.maximum.accumulate([one.low for one in limits])
    upper = np.minimum.accumulate([one.high for one in limits][::-1])[::-1]
    found = _reached(place, _rising(k / n, n), share)
    early, late = _reached(place, upper, share), _reached(place, lower, share)
    return DetectionSize(
        share=float(share),
        size=None if found is None or math.isinf(found) else math.exp(found),
        low=0.0 if early is None else math.exp(early),
        high=float(x[0]) if late is None else math.exp(late),
        smallest=float(x[0]),
        largest=float(x[-1]),
    )  # fmt: skip
