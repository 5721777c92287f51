"""Thesis 2.1.4, B.1: design a CUSUM from noise, smallest change and the mean time between false alarms."""

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from pumplib.decide.arl import RunLength, arl, mean_run_length, siegmund, steady_delay
from pumplib.decide.checks import number, one_of
from pumplib.decide.cusum import CusumSettings, Sides
from pumplib.errors import ParameterError
from pumplib.machines.quantity import Quantity

_SIGMA = Quantity("unit of r", "standard deviation of the healthy residual", 0.0, open_low=True)
_CHANGE = Quantity("unit of r", "smallest change of the mean to detect", 0.0, open_low=True)
_DT = Quantity("s", "sampling interval", 0.0, 1e6, True)
_SECONDS = Quantity("s", "mean time between false alarms", 0.0, open_low=True)
_SAMPLES = Quantity("samples", "mean time between false alarms", 1.0, 1e14, True)
_CHANNELS = Quantity("-", "number of channels with independent residuals", 1, 1e6)
_HIGHEST = 200.0  # sigma, the largest threshold that arl_integral takes


@dataclass(frozen=True, kw_only=True, slots=True)
class CusumDesign:
    """A designed CUSUM and what it promises, for independent normal residuals.

    Parameters
    ----------
    sigma, mean, change : float
        Healthy standard deviation and mean, and the smallest change to detect; unit of r.
    dt : float
        Sampling interval, s.
    sides : {"up", "down", "both"}
        Directions that are watched.
    channels : int
        Channels that share the false alarms.
    method : {"exact", "siegmund"}
        What `h` was solved from.
    nu, h : float
        Drift and threshold, sigma.
    h_siegmund : float
        Threshold that Siegmund's formula gives for the same target, sigma.
    target : float
        Wanted mean run length of all channels together, samples.
    arl : RunLength
        Exact mean run length between false alarms, all channels together, samples.
    arl_siegmund : float
        The same by the formula at the same `h`, samples.
    delay : RunLength
        Mean delay of a change of the design size at the start, one channel, samples.
    delay_late : RunLength
        Mean delay of a change that comes after a long healthy time, samples.
    """

    sigma: float
    mean: float
    change: float
    dt: float
    sides: Sides
    channels: int
    method: Literal["exact", "siegmund"]
    nu: float
    h: float
    h_siegmund: float
    target: float
    arl: RunLength
    arl_siegmund: float
    delay: RunLength
    delay_late: RunLength

    @property
    def false_alarm_interval(self) -> float:
        """Exact mean time between false alarms, s."""
        return self.arl.value * self.dt

    @property
    def delay_s(self) -> float:
        """Mean delay of a change at the start, s."""
        return self.delay.value * self.dt

    def settings(self) -> CusumSettings:
        """Settings of one channel.

        Returns
        -------
        CusumSettings
        """
        return CusumSettings(sigma=self.sigma, mean=self.mean, nu=self.nu, h=self.h, sides=self.sides)


def _two(sides: Sides) -> int:
    return 2 if sides == "both" else 1


def solve_threshold(
    nu: float,
    target: float,
    *,
    sides: Sides = "both",
    channels: int = 1,
    method: Literal["exact", "siegmund"] = "exact",
) -> float:
    """Threshold at which the healthy mean run length is the target.

    The run length grows with the threshold, so the root is bracketed and found to rounding.

    Parameters
    ----------
    nu : float
        Drift, sigma.
    target : float
        Mean run length of all channels together, samples.
    sides : {"up", "down", "both"}
        Directions that are watched.
    channels : int
        Channels with independent residuals.
    method : {"exact", "siegmund"}
        Integral equation, or Siegmund's formula.

    Returns
    -------
    float
        Sigma.

    Raises
    ------
    ParameterError
        If a number is out of range, or no threshold up to 200 sigma reaches the target, or the target is so short
        that a threshold of zero is too high.
    """
    from scipy.optimize import brentq

    one_of("solve_threshold", "sides", sides, ("up", "down", "both"))
    one_of("solve_threshold", "method", method, ("exact", "siegmund"))
    number("solve_threshold", "target", target, _SAMPLES)
    count = number("solve_threshold", "channels", channels, _CHANNELS, whole=True)
    one = float(target) * count * _two(sides)  # of one side of one channel
    number("solve_threshold", "target * channels * sides", one, _SAMPLES)

    def formula(h: float) -> float:
        value = siegmund(nu, h)
        return (math.log(value) if value < math.inf else 800.0) - math.log(one)

    def exact(h: float) -> float:
        return math.log(mean_run_length(nu, h)) - math.log(one)

    low, high = 1e-6, _HIGHEST
    if formula(low) < 0 < formula(high):
        rough = float(brentq(formula, low, high, xtol=1e-12))
    elif method == "siegmund" or formula(high) <= 0:
        bound = siegmund(nu, low if formula(low) >= 0 else high) / count / _two(sides)
        raise ParameterError(
            f"solve_threshold: target {target:g} samples with nu = {nu:g} sigma is out of reach, the formula gives "
            f"{bound:.3g} at h = {low if formula(low) >= 0 else high:g} sigma; change the target or the drift."
        )
    else:
        rough = low
    if method == "siegmund":
        return rough
    left, right = max(rough - 0.3, low), rough + 0.3
    while exact(left) > 0:
        if left <= low:
            raise ParameterError(
                f"solve_threshold: target {target:g} samples with nu = {nu:g} sigma is shorter than the run length "
                f"without threshold; raise the target above {mean_run_length(nu, low) / count / _two(sides):.3g}."
            )
        left = max(left - 0.5, low)
    while exact(right) < 0:
        right = min(right + 0.5, _HIGHEST)
        if right == _HIGHEST:
            raise ParameterError(f"solve_threshold: no threshold up to {_HIGHEST:g} sigma reaches {target:g} samples.")
    return float(brentq(exact, left, right, xtol=1e-10, rtol=4 * float(np.finfo(float).eps)))


def design(
    *,
    sigma: float,
    change: float,
    dt: float,
    false_alarm_interval: float | None = None,
    false_alarm_samples: float | None = None,
    mean: float = 0.0,
    sides: Sides = "both",
    channels: int = 1,
    method: Literal["exact", "siegmund"] = "exact",
) -> CusumDesign:
    """Design a CUSUM: nu is half the smallest change, h follows from the mean time between false alarms.

    The promise holds for independent normal residuals: check it with `pumplib.decide.correlation.assess`.
    It is sensitive to `sigma`: one that is 1 % too small costs 9 % of the run length at (0.5, 5) and 21 % at
    (0.5, 12), so take it from a long healthy record and count the alarms on another one.

    Parameters
    ----------
    sigma : float
        Standard deviation of the healthy residual, unit of r.
    change : float
        Smallest change of the mean to detect, unit of r.
    dt : float
        Sampling interval, s.
    false_alarm_interval : float, optional
        Wanted mean time between false alarms of all channels together, s.
    false_alarm_samples : float, optional
        The same in samples; give one of the two.
    mean : float
        Healthy mean, unit of r.
    sides : {"up", "down", "both"}
        Directions to watch.
    channels : int
        Channels with independent residuals that share the false alarms.
    method : {"exact", "siegmund"}
        Solve `h` from the exact run length or from the formula.

    Returns
    -------
    CusumDesign

    Raises
    ------
    ParameterError
        If a number is wrong, both or none of the targets are given, or the target cannot be met.

    References
    ----------
    Thesis 2.1.4, B.1. D. Siegmund (1985). M. Basseville and I. V. Nikiforov (1993), section 5.2.

    Examples
    --------
    >>> d = design(sigma=2.0, change=2.0, dt=1.0, false_alarm_samples=465.44)
    >>> round(d.nu, 3), round(d.h, 3)
    (0.5, 5.0)
    """
    number("design", "sigma", sigma, _SIGMA)
    number("design", "change", change, _CHANGE)
    number("design", "dt", dt, _DT)
    number("design", "mean", mean, Quantity("unit of r", "healthy mean", -math.inf))
    count = int(number("design", "channels", channels, _CHANNELS, whole=True))
    if (false_alarm_interval is None) == (false_alarm_samples is None):
        raise ParameterError(
            "design: give the mean time between false alarms once, as false_alarm_interval in s or as "
            "false_alarm_samples."
        )
    if false_alarm_interval is not None:
        target = number("design", "false_alarm_interval", false_alarm_interval, _SECONDS) / dt
    else:
        target = number("design", "false_alarm_samples", false_alarm_samples, _SAMPLES)
    number("design", "false_alarm_interval / dt", target, _SAMPLES)
    ratio = float(change) / float(sigma)
    number(
        "design", "change / sigma", ratio,
        Quantity("-", "change in standard deviations", 0.01, 40.0,
                 hint="A tiny change needs averaging or thinning first, a huge one needs no CUSUM."),
    )  # fmt: skip
    nu = ratio / 2
    h = solve_threshold(nu, target, sides=sides, channels=count, method=method)
    formula = h if method == "siegmund" else _formula_threshold(nu, target, sides, count)
    size = min(ratio, 20.0)
    return CusumDesign(
        sigma=float(sigma),
        mean=float(mean),
        change=float(change),
        dt=float(dt),
        sides=sides,
        channels=count,
        method=method,
        nu=nu,
        h=h,
        h_siegmund=formula,
        target=target,
        arl=arl(nu, h, sides=sides, channels=count),
        arl_siegmund=siegmund(nu, h) / _two(sides) / count,
        delay=arl(nu, h, size if sides != "down" else -size, sides=sides),
        delay_late=steady_delay(nu, h, size),
    )


def _formula_threshold(nu: float, target: float, sides: Sides, channels: int) -> float:
    """Formula's threshold beside an exact design; NaN where the formula has none."""
    try:
        return solve_threshold(nu, target, sides=sides, channels=channels, method="siegmund")
    except ParameterError:
        return math.nan
