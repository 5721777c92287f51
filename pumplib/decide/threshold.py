"""Thesis 2.1.4: adaptive residual evaluation: a threshold that rises while the operating point moves.

kappa_i(t) = k0_i + c_i A(t). The activity A(t) is the distance of chosen signals from their own low-passed
values, each in its own scale. k0 and c are learned from healthy runs. An alarm is raised when the time integral
of (|r_i| - kappa_i)/k0_i above zero reaches a limit: kappa is the drift of a CUSUM in continuous time. With
c_i = 0 the threshold is constant.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pumplib.decide.checks import block, channel_names, number, one_of, sample
from pumplib.decide.strict import strict_kernel
from pumplib.errors import DataError, ParameterError
from pumplib.machines.quantity import Choice, Parameters, Quantity

Array = NDArray[Any]
Recovery = Literal["drift", "never"]
_DT = Quantity("s", "sampling interval", 0.0, 1e6, True)


@dataclass(frozen=True, kw_only=True)
class ActivitySettings(Parameters):
    """How the activity A(t) is formed: sum over the signals of |s - low-passed s| / scale.

    References
    ----------
    Thesis 2.1.4. P. M. Frank and X. Ding, Survey of robust residual generation and evaluation methods in
    observer-based fault detection systems, Journal of Process Control 7 (1997).
    """

    signals: tuple[str, ...]
    scales: Annotated[
        tuple[float, ...], Quantity("unit of the signal", "deviation of a signal that counts as 1", 0.0, open_low=True)
    ]
    time_constant: Annotated[float, Quantity("s", "time constant of the low-pass", 0.0, 1e6, True)] = 0.25

    def _check_together(self) -> None:
        channel_names(self.signals, len(self.signals))
        if not self.signals or len(self.signals) != len(self.scales):
            raise ParameterError(
                f"ActivitySettings: {len(self.signals)} signals and {len(self.scales)} scales; give one scale, in the "
                "unit of the signal, for each of at least one signal."
            )


@strict_kernel
def _activity(x, weight, gain, low, started, out):  # type: ignore[no-untyped-def]
    n, signals = x.shape
    for k in range(n):
        total = 0.0
        for s in range(signals):
            if started or k > 0:
                low[s] = low[s] + gain * (x[k, s] - low[s])
            else:
                low[s] = x[k, s]
            total += abs(x[k, s] - low[s]) * weight[s]
        out[k] = total


class Activity:
    """Activity A(t) of the operating point; keeps its state between calls, batch and stream agree bit for bit.

    The low-pass starts at the first sample: A(0) = 0.

    Parameters
    ----------
    settings : ActivitySettings
        Signals, scales, time constant.
    dt : float
        Sampling interval, s.

    Raises
    ------
    ParameterError
        If the sampling interval is wrong or longer than the time constant.
    """

    def __init__(self, settings: ActivitySettings, dt: float) -> None:
        number("Activity", "dt", dt, _DT)
        if dt > settings.time_constant:
            raise ParameterError(
                f"Activity.dt = {dt:g} s: longer than the time constant {settings.time_constant:g} s of the low-pass, "
                "which then passes everything; sample faster or lengthen it."
            )
        self.settings, self.dt = settings, float(dt)
        self._gain = -math.expm1(-dt / settings.time_constant)
        self._weight = 1.0 / np.array(settings.scales, dtype=float)
        self.reset()

    def reset(self) -> None:
        """Forget the past: the next sample is the first."""
        self._low = np.zeros(len(self.settings.signals))
        self._seen = 0

    def run(self, signals: ArrayLike) -> Array:
        """Take a block of samples.

        Parameters
        ----------
        signals : array_like, shape (n, signals) or (n,) for one signal
            The signals in the units of the scales, time first.

        Returns
        -------
        ndarray, shape (n,)
            A(t).

        Raises
        ------
        DataError
            If the shape is wrong or a value not finite; the state stays as it was.
        """
        return self._feed(block(signals, self.settings.signals, self._seen))

    def update(self, values: ArrayLike) -> float:
        """Take one sample.

        Parameters
        ----------
        values : array_like, shape (signals,)
            The signals.

        Returns
        -------
        float
            A.

        Raises
        ------
        DataError
            If the shape is wrong or a value not finite; the state stays as it was.
        """
        return float(self._feed(sample(values, self.settings.signals, self._seen))[0])

    def _feed(self, x: Array) -> Array:
        out = np.empty(len(x))
        _activity(x, self._weight, self._gain, self._low, self._seen > 0, out)
        self._seen += len(x)
        return out


@dataclass(frozen=True, kw_only=True)
class Threshold(Parameters):
    """Thresholds kappa_i = k0_i + c_i A of some residuals, and when they raise an alarm.

    Parameters
    ----------
    residuals : tuple of str
        Names of the residuals.
    k0 : tuple of float
        Threshold at rest, unit of each residual.
    c : tuple of float
        Rise of the threshold per unit of activity; zero for a constant threshold.
    limit : float
        Integral of (|r| - kappa)/k0 that raises the alarm, s.
    recovery : {"drift", "never"}
        Below kappa the integral falls as in a CUSUM whose drift is kappa; or it never falls and every short
        excess counts for ever, which fits short records only.
    """

    residuals: tuple[str, ...]
    k0: Annotated[tuple[float, ...], Quantity("unit of r", "threshold at rest", 0.0, open_low=True)]
    c: Annotated[tuple[float, ...], Quantity("unit of r", "rise of the threshold per unit of activity")]
    limit: Annotated[float, Quantity("s", "integral of the relative excess that raises the alarm", 0.0, 1e6)] = 0.1
    recovery: Annotated[Recovery, Choice("what the integral does below kappa", ("drift", "never"))] = "drift"

    def _check_together(self) -> None:
        channel_names(self.residuals, len(self.residuals))
        if not self.residuals or not len(self.residuals) == len(self.k0) == len(self.c):
            raise ParameterError(
                f"Threshold: {len(self.residuals)} residuals, {len(self.k0)} k0 and {len(self.c)} c; give one of each "
                "for at least one residual."
            )

    def at(self, activity: ArrayLike) -> Array:
        """Thresholds for given activities.

        Parameters
        ----------
        activity : array_like, shape (n,)
            A(t).

        Returns
        -------
        ndarray, shape (n, residuals)
            kappa, units of the residuals.

        Raises
        ------
        DataError
            If an activity is negative or not finite.
        """
        a = _activities(activity)
        return np.array(self.k0) + a[:, None] * np.array(self.c)

    def constant(self) -> "Threshold":
        """The same thresholds without adaptation.

        Returns
        -------
        Threshold
        """
        return Threshold(
            residuals=self.residuals, k0=self.k0, c=(0.0,) * len(self.c), limit=self.limit, recovery=self.recovery
        )


def _activities(values: ArrayLike, first: int = 0) -> Array:
    a = block(values, ("activity",), first)[:, 0]
    if (a < 0).any():
        k = int(np.argmax(a < 0))
        raise DataError(f"activity, sample {first + k}: {a[k]:g} is negative; form it with Activity.")
    return a


@dataclass(frozen=True, kw_only=True, slots=True)
class ThresholdAlarm:
    """First crossing of the integral's limit by one residual.

    Parameters
    ----------
    residual : str
        Name of the residual.
    sample : int
        Sample of the alarm, counted from the start of the stream.
    onset : int
        First sample of the excess that led to it: the one after the integral's last zero.
    """

    residual: str
    sample: int
    onset: int


@dataclass(frozen=True, kw_only=True, eq=False, slots=True)
class ThresholdResult:
    """Outcome of a block.

    Parameters
    ----------
    alarms : tuple of ThresholdAlarm
        Upward crossings of the limit, in the order of their samples, then of the residuals.
    kappa, integral : ndarray, shape (n, residuals)
        Thresholds, unit of the residual, and integrals of the relative excess, s.
    """

    alarms: tuple[ThresholdAlarm, ...]
    kappa: Array
    integral: Array

    def first(self, residual: str | None = None) -> ThresholdAlarm | None:
        """First alarm, of one residual or of any.

        Parameters
        ----------
        residual : str, optional
            Name of the residual.

        Returns
        -------
        ThresholdAlarm or None
        """
        return next((alarm for alarm in self.alarms if residual in (None, alarm.residual)), None)


@strict_kernel
def _evaluate(r, activity, k0, c, rate, limit, falls, first, total, zero, kappa, integral, onset):  # type: ignore[no-untyped-def]
    n, residuals = r.shape
    for k in range(n):
        for i in range(residuals):
            level = k0[i] + c[i] * activity[k]
            excess = (abs(r[k, i]) - level) * rate[i]
            if not falls:
                excess = max(excess, 0.0)
            total[i] = max(total[i] + excess, 0.0)
            if total[i] <= 0.0:
                zero[i] = first + k
            kappa[k, i] = level
            integral[k, i] = total[i]
            onset[k, i] = zero[i] + 1


class Evaluator:
    """Evaluates residuals against adaptive thresholds; keeps its state between calls.

    Batch and sample by sample agree bit for bit.

    Parameters
    ----------
    threshold : Threshold
        Learned or chosen thresholds.
    dt : float
        Sampling interval, s.

    Raises
    ------
    ParameterError
        If an argument is wrong.
    """

    def __init__(self, threshold: Threshold, dt: float) -> None:
        number("Evaluator", "dt", dt, _DT)
        if not isinstance(threshold, Threshold):
            raise ParameterError(f"Evaluator.threshold = {threshold!r}: must be a Threshold, for example of learn.")
        self.threshold, self.dt = threshold, float(dt)
        self._k0, self._c = np.array(threshold.k0, dtype=float), np.array(threshold.c, dtype=float)
        self._rate = self.dt / self._k0
        self.reset()

    def reset(self) -> None:
        """Start anew: integrals zero, sample 0."""
        self._first = 0
        self._total = np.zeros(len(self._k0))
        self._zero = np.full(len(self._k0), -1, dtype=np.int64)

    def run(self, residuals: ArrayLike, activity: ArrayLike) -> ThresholdResult:
        """Take a block of samples.

        Parameters
        ----------
        residuals : array_like, shape (n, residuals) or (n,) for one residual
            Residuals, time first.
        activity : array_like, shape (n,)
            A(t) of the same samples.

        Returns
        -------
        ThresholdResult

        Raises
        ------
        DataError
            If shapes differ or a value is not finite; the state stays as it was.
        """
        return self._feed(block(residuals, self.threshold.residuals, self._first), _activities(activity, self._first))

    def update(self, residuals: ArrayLike, activity: float) -> tuple[ThresholdAlarm, ...]:
        """Take one sample.

        Parameters
        ----------
        residuals : array_like, shape (residuals,)
            Residuals.
        activity : float
            A.

        Returns
        -------
        tuple of ThresholdAlarm
            Alarms that this sample raised.

        Raises
        ------
        DataError
            If a shape is wrong or a value not finite; the state stays as it was.
        """
        x = sample(residuals, self.threshold.residuals, self._first)
        return self._feed(x, _activities([activity], self._first)).alarms

    def _feed(self, x: Array, a: Array) -> ThresholdResult:
        if len(a) != len(x):
            raise DataError(f"{len(x)} residual samples and {len(a)} activities: must be of the same instants.")
        kappa, integral = np.empty_like(x), np.empty_like(x)
        onset = np.empty(x.shape, dtype=np.int64)
        limit = self.threshold.limit
        before = self._total > limit
        _evaluate(
            x, a, self._k0, self._c, self._rate, limit, self.threshold.recovery == "drift", self._first,
            self._total, self._zero, kappa, integral, onset,
        )  # fmt: skip
        over = integral > limit
        rising = over & ~np.vstack([before, over[:-1]]) if len(x) else over
        alarms = tuple(
            ThresholdAlarm(residual=self.threshold.residuals[i], sample=int(self._first + k), onset=int(onset[k, i]))
            for k, i in np.argwhere(rising)
        )
        self._first += len(x)
        return ThresholdResult(alarms=alarms, kappa=kappa, integral=integral)


def learn(
    residual_runs: Sequence[ArrayLike],
    activity_runs: Sequence[ArrayLike],
    *,
    residuals: Sequence[str],
    quiet: float = 0.15,
    quantile: float = 0.999,
    margin: float = 1.15,
    limit: float = 0.1,
    recovery: Recovery = "drift",
    least_runs: int = 10,
) -> Threshold:
    """Learn adaptive thresholds from healthy runs.

    k0_i is `margin` times the quantile of |r_i| over all samples with A below `quiet`; c_i is `margin` times the
    same quantile of (|r_i| - k0_i)/A over all others, at least zero.

    Parameters
    ----------
    residual_runs : sequence of array_like, shape (n_j, residuals) or (n_j,)
        Residuals of healthy runs that cover the operating points and their changes.
    activity_runs : sequence of array_like, shape (n_j,)
        A(t) of the same runs.
    residuals : sequence of str
        Names of the residuals.
    quiet : float
        Activity below which the operating point counts as at rest.
    quantile : float
        Share of healthy samples below the threshold, before the margin.
    margin : float
        Factor on the quantiles.
    limit : float
        Limit of the integral, s; goes into the result.
    recovery : {"drift", "never"}
        Goes into the result.
    least_runs : int
        Fewer runs are refused: thresholds of few runs do not hold on the next one.

    Returns
    -------
    Threshold

    Raises
    ------
    DataError
        If runs are too few, do not fit together, hold no samples at rest, too few samples for the quantile, or
        a residual that is zero throughout.
    ParameterError
        If a number is out of range.

    References
    ----------
    Thesis 2.1.4. P. M. Frank and X. Ding (1997).
    """
    number("learn", "quiet", quiet, Quantity("-", "activity at rest", 0.0, open_low=True))
    number("learn", "quantile", quantile, Quantity("-", "share of healthy samples", 0.5, 1.0))
    number("learn", "margin", margin, Quantity("-", "factor on the quantiles", 1.0, 100.0))
    number("learn", "least_runs", least_runs, Quantity("-", "least number of runs", 1), whole=True)
    one_of("learn", "recovery", recovery, ("drift", "never"))
    names = channel_names(residuals, len(tuple(residuals)))
    if len(residual_runs) != len(activity_runs):
        raise DataError(f"learn: {len(residual_runs)} residual runs and {len(activity_runs)} activity runs.")
    if len(residual_runs) < least_runs:
        raise DataError(
            f"learn: {len(residual_runs)} healthy runs, at least {least_runs} are needed; record more, or lower "
            "least_runs and test the thresholds on other healthy runs."
        )
    parts = []
    for j, (run, active) in enumerate(zip(residual_runs, activity_runs, strict=True)):
        x, a = block(run, names), _activities(active)
        if len(x) != len(a):
            raise DataError(f"learn: run {j} has {len(x)} residual samples and {len(a)} activities.")
        parts.append((np.abs(x), a))
    size, a = np.concatenate([x for x, _ in parts]), np.concatenate([b for _, b in parts])
    rest = a < quiet
    need = math.ceil(10 / (1 - quantile)) if quantile < 1 else 100
    if rest.sum() < need:
        raise DataError(
            f"learn: {int(rest.sum())} samples at rest (A < {quiet:g}), the {quantile:.4g} quantile needs {need}; "
            "record longer, lower the quantile, or raise quiet."
        )
    k0 = margin * np.quantile(size[rest], quantile, axis=0)
    for name, value in zip(names, k0, strict=True):
        if not value > 0:
            raise DataError(f"learn: residual {name} is zero at rest throughout; check that it is connected.")
    c = np.zeros(len(names))
    if not rest.all():
        c = np.maximum(margin * np.quantile((size[~rest] - k0) / a[~rest, None], quantile, axis=0), 0.0)
    return Threshold(residuals=names, k0=tuple(k0.tolist()), c=tuple(c.tolist()), limit=limit, recovery=recovery)
