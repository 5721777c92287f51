"""Thesis 2.1.4, B.1: simulated run lengths of the CUSUM, independent or correlated samples."""

import math
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from pumplib.decide.checks import generator, number, one_of
from pumplib.decide.cusum import cusum_step
from pumplib.decide.strict import strict_kernel
from pumplib.decide.whitening import ArModel
from pumplib.errors import ParameterError
from pumplib.machines.quantity import Quantity

Array = NDArray[Any]
_RUNS = Quantity("-", "number of runs", 2, 1e8)
_LIMIT = Quantity("samples", "longest run", 1, 1e15)
_LEVEL = Quantity("-", "confidence level", 0.0, 0.9999999, True)


@dataclass(frozen=True, kw_only=True, eq=False)
class RunLengths:
    """Simulated run lengths.

    Parameters
    ----------
    lengths : ndarray of int, shape (runs,)
        Samples until the alarm, or until the run was cut.
    cut : int
        Runs without alarm up to the limit.
    """

    lengths: Array
    cut: int = 0

    @property
    def mean(self) -> float:
        """Mean run length, samples: all simulated samples over the number of alarms; infinite without alarm."""
        alarms = len(self.lengths) - self.cut
        return float(self.lengths.sum()) / alarms if alarms else math.inf

    def interval(self, level: float = 0.95) -> tuple[float, float]:
        """Confidence interval of the mean run length.

        Parameters
        ----------
        level : float
            Confidence level.

        Returns
        -------
        tuple of float
            Samples. Normal if all runs ended in an alarm, else from the number of alarms (Poisson).

        Raises
        ------
        ParameterError
            If the level is not between 0 and 1.
        """
        from scipy.stats import chi2, norm

        number("RunLengths.interval", "level", level, _LEVEL)
        if self.cut == 0:
            half = float(norm.ppf(0.5 + level / 2)) * float(self.lengths.std(ddof=1)) / math.sqrt(len(self.lengths))
            return self.mean - half, self.mean + half
        total, alarms = float(self.lengths.sum()), len(self.lengths) - self.cut
        low = 2 * total / float(chi2.ppf(0.5 + level / 2, 2 * alarms + 2))
        return low, 2 * total / float(chi2.ppf(0.5 - level / 2, 2 * alarms)) if alarms else math.inf


@strict_kernel
def _simulate(nu, h_up, h_down, mu, table, spread, limit, fresh, rng, lengths):  # type: ignore[no-untyped-def]
    order = table.shape[1]
    past = np.zeros(max(order, 1))
    seen, cut = 0, 0
    for run in range(len(lengths)):
        if fresh:
            seen = 0
        up = down = 0.0
        k = 0
        hit = False
        while k < limit and not hit:
            m = min(seen, order)
            x = spread[m] * rng.standard_normal()
            for i in range(m):
                x += table[m, i] * past[i]
            for i in range(order - 1, 0, -1):
                past[i] = past[i - 1]
            past[0] = x
            seen += 1
            k += 1
            up = cusum_step(up, x + mu - nu)
            down = cusum_step(down, -x - mu - nu)
            hit = up > h_up or down > h_down
        lengths[run] = k
        if not hit:
            cut += 1
    return cut


def simulate_run_lengths(
    nu: float,
    h: float,
    mu: float = 0.0,
    *,
    rng: np.random.Generator,
    runs: int = 2000,
    sides: Literal["up", "down", "both"] = "both",
    model: ArModel | None = None,
    start: Literal["fresh", "continue"] = "fresh",
    limit: int = 10**12,
) -> RunLengths:
    """Simulate run lengths of a CUSUM on samples of standard deviation 1.

    Parameters
    ----------
    nu, h : float
        Drift and threshold, sigma.
    mu : float
        Mean of the samples, sigma of the residual.
    rng : numpy.random.Generator
        Source of randomness.
    runs : int
        Number of runs.
    sides : {"up", "down", "both"}
        Directions that are watched.
    model : ArModel, optional
        Correlation of the samples; its mean and sigma are not used. Independent by default.
    start : {"fresh", "continue"}
        Every run begins at an independent instant; or where the one before raised its alarm, as a detector that
        restarts does: correlated samples are then still extreme, and the next alarm comes sooner.
    limit : int
        Samples after which a run is cut.

    Returns
    -------
    RunLengths

    Raises
    ------
    ParameterError
        If an argument is wrong.
    """
    where = "simulate_run_lengths"
    number(where, "nu", nu, Quantity("sigma", "drift", 0.0, 100.0))
    number(where, "h", h, Quantity("sigma", "threshold", 0.0, 1e6, True))
    number(where, "mu", mu, Quantity("sigma", "mean of the samples", -100.0, 100.0))
    count = int(number(where, "runs", runs, _RUNS, whole=True))
    longest = int(number(where, "limit", limit, _LIMIT, whole=True))
    one_of(where, "sides", sides, ("up", "down", "both"))
    one_of(where, "start", start, ("fresh", "continue"))
    generator(rng, where)
    if model is None:
        model = ArModel(coefficients=(), sigma=1.0)
    if not isinstance(model, ArModel):
        raise ParameterError(f"{where}: model = {model!r} must be an ArModel; fit one with fit_ar.")
    assert model.ladder is not None
    table, spread = model.ladder
    lengths = np.empty(count, dtype=np.int64)
    cut = _simulate(
        float(nu),
        math.inf if sides == "down" else float(h),
        math.inf if sides == "up" else float(h),
        float(mu),
        table,
        spread / spread[0],
        longest,
        start == "fresh",
        rng,
        lengths,
    )
    return RunLengths(lengths=lengths, cut=int(cut))
