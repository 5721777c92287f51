"""Thesis 2.1.4, B.1: average run length of the CUSUM: formula, integral equation, Markov chain, simulation.

All lengths are in samples and for independent normal samples with standard deviation 1, unless a simulation is
told otherwise. Run lengths start from a statistic of zero. Three routes lie side by side: Siegmund's formula,
the integral equation of the run length on Gauss-Legendre nodes (used for design), and the Markov chain of
Brook and Evans with extrapolation to infinitely many states (its check).
"""

import math
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from pumplib.decide.checks import number, one_of
from pumplib.decide.strict import strict_kernel
from pumplib.errors import ParameterError
from pumplib.machines.quantity import Quantity

Array = NDArray[Any]
SHIFT = 1.166  # Siegmund's correction of the threshold for the overshoot, both ends together
_NU = Quantity("sigma", "drift of the CUSUM", 0.0, 20.0)
_H = Quantity("sigma", "threshold of the CUSUM", 0.0, 200.0, True, "The residual is divided by its sigma first.")
_MU = Quantity("sigma", "mean of the samples", -20.0, 20.0)
_CHANNELS = Quantity("-", "number of channels", 1, 1e6)
_STATES = Quantity("-", "states of the coarsest Markov chain", 10, 500)
NEGLIGIBLE = 1e-40  # probability of a step that cannot matter for run lengths up to 1e14
_LARGEST = 1e14  # samples; beyond it double precision carries no digit of the escape probabilities


@dataclass(frozen=True, kw_only=True, slots=True)
class RunLength:
    """A computed average run length.

    Parameters
    ----------
    value : float
        Samples.
    error : float
        Estimate of the numerical error, samples.
    """

    value: float
    error: float


def _checked(where: str, nu: float, h: float, mu: float) -> tuple[float, float, float]:
    return number(where, "nu", nu, _NU), number(where, "h", h, _H), number(where, "mu", mu, _MU)


def siegmund(nu: float, h: float, mu: float = 0.0) -> float:
    """One-sided average run length by Siegmund's approximation.

    With Delta = mu - nu and b = h + 1.166 it is (exp(-2 Delta b) + 2 Delta b - 1)/(2 Delta^2), and b^2 for
    Delta = 0.

    Parameters
    ----------
    nu, h : float
        Drift and threshold, sigma.
    mu : float
        Mean of the samples, sigma.

    Returns
    -------
    float
        Samples; infinite where the formula exceeds the range of floating point.

    Raises
    ------
    ParameterError
        If a number is not finite or out of range.

    References
    ----------
    D. Siegmund, Sequential Analysis (1985), section 2.6. Thesis B.1.
    """
    nu, h, mu = _checked("siegmund", nu, h, mu)
    b = h + SHIFT
    x = (mu - nu) * b
    if abs(x) < 1e-2:  # series: the closed form subtracts nearly equal numbers
        return b * b * (1 - 2 * x / 3 + x * x / 3 - 2 * x**3 / 15 + 2 * x**4 / 45 - 4 * x**5 / 315)
    if x < -350:
        return math.inf
    return (math.expm1(-2 * x) + 2 * x) / (2 * (mu - nu) ** 2)


@strict_kernel
def mean_steps(inside, escape):  # type: ignore[no-untyped-def]
    """Mean number of steps until a chain escapes, from each of its states.

    Solves (I - P) L = 1 by elimination without subtractions: every row's diagonal is replaced by the sum of its
    other entries and its escape probability. Rounding is therefore relative to the result, however rare the escape.

    Parameters
    ----------
    inside : ndarray, shape (n, n)
        Probabilities of going from row to column; the diagonal is not used; destroyed.
    escape : ndarray, shape (n,)
        Probabilities of escaping; destroyed.

    Returns
    -------
    ndarray, shape (n,)

    References
    ----------
    W. K. Grassmann, M. I. Taksar, D. P. Heyman, Operations Research 33 (1985).
    """
    n = len(escape)
    steps = np.ones(n)
    leave = np.empty(n)
    for k in range(n - 1, -1, -1):
        total = escape[k]
        for j in range(k):
            total += inside[k, j]
        leave[k] = total
        for i in range(k):
            f = inside[i, k] / total
            if f > NEGLIGIBLE:  # also keeps the products out of the slow denormal numbers
                for j in range(k):
                    inside[i, j] += f * inside[k, j]
                escape[i] += f * escape[k]
                steps[i] += f * steps[k]
    for k in range(n):
        total = steps[k]
        for j in range(k):
            total += inside[k, j] * steps[j]
        steps[k] = total / leave[k]
    return steps


def _nystroem(nu: float, h: float, mu: float, nodes: int) -> tuple[Array, Array, Array]:
    """States (zero and the nodes), transition weights between them, escape probabilities."""
    from scipy.special import ndtr

    x, w = np.polynomial.legendre.leggauss(nodes)
    states = np.concatenate(([0.0], h * (x + 1) / 2))
    inside = np.empty((nodes + 1, nodes + 1))
    inside[:, 0] = ndtr(nu - mu - states)
    step = states[None, 1:] - states[:, None] + (nu - mu)
    inside[:, 1:] = (h * w / 2) * np.exp(-0.5 * step * step) / math.sqrt(2 * math.pi)
    return states, inside, ndtr(states - h - nu + mu)


def _nodes(h: float) -> int:
    return math.ceil(18 + 2.5 * h)  # the kernel is a bell of width 1: its resolution decides


def _limited(value: float, where: str, nu: float, h: float) -> float:
    if not value < _LARGEST:
        raise ParameterError(
            f"{where}: average run length {value:.3g} samples at nu = {nu:g} sigma, h = {h:g} sigma is beyond "
            f"{_LARGEST:g}, where double precision ends; lower h, or evaluate fewer samples a second."
        )
    return value


def arl_integral(nu: float, h: float, mu: float = 0.0) -> RunLength:
    """One-sided average run length from the integral equation on Gauss-Legendre nodes.

    L(g) = 1 + L(0) Phi(nu - mu - g) + integral over y in (0, h) of L(y) phi(y - g + nu - mu). The kernel is
    smooth, so the error falls exponentially with the number of nodes.

    Parameters
    ----------
    nu, h : float
        Drift and threshold, sigma.
    mu : float
        Mean of the samples, sigma.

    Returns
    -------
    RunLength
        The error is the difference to two thirds of the nodes, and the rounding.

    Raises
    ------
    ParameterError
        If a number is out of range, or the run length above 1e14 samples.

    References
    ----------
    E. S. Page (1954). L. C. Vance, Journal of Quality Technology 18 (1986). Thesis B.1.
    """
    nu, h, mu = _checked("arl_integral", nu, h, mu)
    value = mean_run_length(nu, h, mu)
    coarse = float(mean_steps(*_nystroem(nu, h, mu, _nodes(h))[1:])[0])
    return RunLength(value=_limited(value, "arl_integral", nu, h), error=abs(value - coarse) + 1e-14 * value)


def mean_run_length(nu: float, h: float, mu: float = 0.0) -> float:
    """Value of `arl_integral` without checks and without error estimate, for root finding.

    Parameters
    ----------
    nu, h, mu : float
        Drift, threshold and mean, sigma.

    Returns
    -------
    float
        Samples.
    """
    return float(mean_steps(*_nystroem(nu, h, mu, 3 * _nodes(h) // 2)[1:])[0])


def _chain(nu: float, h: float, mu: float, states: int) -> float:
    """Brook and Evans: the statistic rounded to multiples of a width, threshold on a border of cells."""
    from scipy.linalg import solve
    from scipy.special import ndtr

    width = h / (states - 0.5)
    index = np.arange(states)
    # probability of a step of j - i cells; the cell of zero takes everything below its upper border
    borders = (np.arange(-states, states) + 0.5) * width + nu - mu
    below = ndtr(borders)
    jump = index[None, :] - index[:, None]
    inside = below[jump + states] - below[jump + states - 1]
    inside[:, 0] = below[states - index]
    return float(solve(np.eye(states) - inside, np.ones(states))[0])


def arl_markov(nu: float, h: float, mu: float = 0.0, states: int = 60) -> RunLength:
    """One-sided average run length from Brook and Evans' Markov chain, extrapolated to infinitely many states.

    Chains with 1, 2, 4 and 8 times `states` states are solved by plain Gauss elimination; the powers 2, 3 and 4
    of the cell width are eliminated. It shares nothing with `arl_integral` but the normal distribution.

    Parameters
    ----------
    nu, h : float
        Drift and threshold, sigma.
    mu : float
        Mean of the samples, sigma.
    states : int
        States of the coarsest chain.

    Returns
    -------
    RunLength
        The error is the last correction of the extrapolation.

    Raises
    ------
    ParameterError
        If a number is out of range.

    References
    ----------
    D. Brook and D. A. Evans, An approach to the probability distribution of cusum run length, Biometrika 59 (1972).
    """
    nu, h, mu = _checked("arl_markov", nu, h, mu)
    n = int(number("arl_markov", "states", states, _STATES, whole=True))
    # (n - 1/2) doubles exactly only for half widths; the fit uses the true widths
    counts = np.array([n, 2 * n, 4 * n, 8 * n])
    widths = 1 / (counts - 0.5)
    values = np.array([_chain(nu, h, mu, int(count)) for count in counts])
    powers = np.array([0, 2, 3, 4])
    full = np.linalg.solve((widths[:, None] / widths[0]) ** powers, values)[0]
    less = np.linalg.solve((widths[1:, None] / widths[1]) ** powers[:3], values[1:])[0]
    return RunLength(value=_limited(float(full), "arl_markov", nu, h), error=abs(float(full - less)))


def arl(
    nu: float, h: float, mu: float = 0.0, *, sides: Literal["up", "down", "both"] = "both", channels: int = 1
) -> RunLength:
    """Average run length of a CUSUM, one- or two-sided, and of many independent channels together.

    Two-sided: 1/L = 1/L+ + 1/L-, which is exact from a start at zero, because one statistic is zero whenever the
    other passes the same threshold. Channels: L/channels, which is slightly too short (a run from zero cannot be
    shorter than the shortest way to h), so a design errs to the safe side.

    Parameters
    ----------
    nu, h : float
        Drift and threshold, sigma.
    mu : float
        Mean of the samples, sigma.
    sides : {"up", "down", "both"}
        Directions that are watched.
    channels : int
        Number of channels with independent residuals.

    Returns
    -------
    RunLength

    Raises
    ------
    ParameterError
        If a number is out of range or the run length above 1e14 samples.

    References
    ----------
    C. S. van Dobben de Bruyn, Cumulative Sum Tests (1968). D. Siegmund (1985). Thesis B.1.
    """
    one_of("arl", "sides", sides, ("up", "down", "both"))
    n = number("arl", "channels", channels, _CHANNELS, whole=True)
    nu, h, mu = _checked("arl", nu, h, mu)
    if sides != "both":
        found = arl_integral(nu, h, mu if sides == "up" else -mu)
        return RunLength(value=found.value / n, error=found.error / n)
    near = arl_integral(nu, h, abs(mu))
    if mu == 0.0:
        return RunLength(value=near.value / 2 / n, error=near.error / 2 / n)
    try:
        far = arl_integral(nu, h, -abs(mu))
    except ParameterError:  # so rare against the change that the other side does not count
        return RunLength(value=near.value / n, error=near.error / n)
    share = 1 / (1 + near.value / far.value)
    error = share**2 * (near.error + far.error * (near.value / far.value) ** 2)
    return RunLength(value=near.value * share / n, error=error / n)


def steady_delay(nu: float, h: float, mu: float) -> RunLength:
    """Mean delay of a change that comes late: the statistic has been running on healthy samples without alarm.

    The healthy statistic is distributed as it is after a long time without alarm (the left eigenvector of the
    integral equation); from there the run length with mean `mu` is averaged. One side.

    Parameters
    ----------
    nu, h : float
        Drift and threshold, sigma.
    mu : float
        Size of the change, sigma.

    Returns
    -------
    RunLength
        Shorter than the run length from zero.

    Raises
    ------
    ParameterError
        If a number is out of range or the run length above 1e14 samples.

    References
    ----------
    M. Basseville and I. V. Nikiforov (1993), section 5.2.
    """
    nu, h, mu = _checked("steady_delay", nu, h, mu)

    def once(nodes: int) -> float:
        _, healthy, _ = _nystroem(nu, h, 0.0, nodes)
        values, vectors = np.linalg.eig(healthy.T)
        weight = np.abs(vectors[:, np.argmax(values.real)].real)
        _, changed, escape = _nystroem(nu, h, mu, nodes)
        return float(weight @ mean_steps(changed, escape) / weight.sum())

    fine, coarse = once(3 * _nodes(h) // 2), once(_nodes(h))
    return RunLength(value=_limited(fine, "steady_delay", nu, h), error=abs(fine - coarse) + 1e-14 * fine)
