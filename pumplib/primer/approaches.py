"""Thesis 2.1.1-2.1.4: signal-based, model-based and parameter-estimation detection on the same measurements.

Each of the three is kept as simple as it can be and still be honest: it sees windows of measured signals, it is
set up on healthy runs of the same machine, and it is scored on runs that it has never seen.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from pumplib.decide import Cusum, CusumSettings, Evaluator, Threshold, learn, solve_threshold
from pumplib.decide.checks import one_of
from pumplib.errors import DataError
from pumplib.primer.model import Commissioned, commission, regressors
from pumplib.primer.windows import STEP, Windows

Array = NDArray[Any]
Method = Literal["adaptive", "constant", "cusum"]
METHODS: tuple[str, ...] = get_args(Method)
CHANNELS = ("H", "Q", "I_rms")
MARGIN = 1.15
"""Factor on what healthy runs showed, for every threshold."""
BAND = 0.02
"""Share of the range by which the bands of the limit check are widened."""
MEMORY = 2.0
"""Time of rest over which the parameter estimation forgets, s."""
THIN = 6
"""Windows at rest from one CUSUM sample to the next: 0.6 s, so that they are nearly independent."""
FALSE_ALARM_INTERVAL = 86_400.0
"""Designed mean time at rest between false alarms of the CUSUM, s."""


@dataclass(frozen=True, kw_only=True, eq=False, slots=True)
class Outcome:
    """What one approach says about one run.

    Parameters
    ----------
    approach : str
        For people.
    unit : str
        Of statistic and threshold.
    t : ndarray, shape (n,)
        Times, s.
    statistic, threshold : ndarray, shape (n,)
        What is compared with what. For the model-based approach the residual, else a positive number.
    alarms : tuple of float
        Times at which an alarm began, s.
    """

    approach: str
    unit: str
    t: Array
    statistic: Array
    threshold: Array
    alarms: tuple[float, ...]

    @property
    def alarm(self) -> float | None:
        """Time of the first alarm, s."""
        return self.alarms[0] if self.alarms else None


@dataclass(frozen=True, kw_only=True, eq=False, slots=True)
class Estimate:
    """Head coefficients estimated again and again during a run.

    Parameters
    ----------
    theta : ndarray, shape (n, 3)
        a_h0 (Pa s2), a_h1 (Pa s2/m3), a_h2 (Pa s2/m6) by each window.
    residual : ndarray, shape (n, 3)
        theta_0 - theta_hat, same units.
    distance : ndarray, shape (n,)
        Mahalanobis distance of the two.
    clogging : ndarray, shape (n,)
        K_f that explains the pressure residuals if nothing else is wrong, Pa s2/m6.
    """

    theta: Array
    residual: Array
    distance: Array
    clogging: Array


@dataclass(frozen=True, kw_only=True, eq=False, slots=True)
class Monitor:
    """A machine's model with all thresholds, set up on healthy runs.

    Parameters
    ----------
    model : Commissioned
        From the commissioning run.
    bands : ndarray, shape (3, 2)
        Lowest and highest healthy values of `CHANNELS`, widened.
    threshold : Threshold
        Adaptive threshold of the pressure residual.
    cusum : CusumSettings
        CUSUM of the pressure residual at rest.
    distance : float
        Threshold of the Mahalanobis distance.
    """

    model: Commissioned
    bands: Array
    threshold: Threshold
    cusum: CusumSettings
    distance: float

    def signal_based(self, w: Windows) -> Outcome:
        """Limit check: pressure, flow and current inside the bands of the healthy runs.

        Parameters
        ----------
        w : Windows
            The run.

        Returns
        -------
        Outcome
            Statistic: largest distance from a band's middle over half its width; the threshold is 1.

        References
        ----------
        Thesis 2.1.1.
        """
        statistic = np.abs(_channels(w) - self.bands.mean(axis=1)).T
        statistic = (statistic / (0.5 * np.diff(self.bands, axis=1))).max(axis=0)
        one = np.ones(len(w.t))
        return Outcome(
            approach="signal-based", unit="-", t=w.t, statistic=statistic, threshold=one,
            alarms=_crossings(w.t, statistic > one),
        )  # fmt: skip

    def model_based(self, w: Windows, method: Method = "adaptive", factor: float = 1.0) -> Outcome:
        """Pressure residual against a threshold, or in a CUSUM.

        Parameters
        ----------
        w : Windows
            The run.
        method : {"adaptive", "constant", "cusum"}
            Threshold kappa(t) = k0 + c A(t), or k0 alone, or CUSUM of the windows at rest.
        factor : float
            On the threshold of the first two.

        Returns
        -------
        Outcome

        Raises
        ------
        ParameterError
            If there is no such method, or the factor is not positive.

        References
        ----------
        Thesis 2.1.2, 2.1.4, Definition 2.1.1.
        """
        one_of("model_based", "method", method, METHODS)
        r = self.model.residual(w)
        if method == "cusum":
            return self._cusum(w, r)
        threshold = scaled(self.threshold if method == "adaptive" else self.threshold.constant(), factor)
        found = Evaluator(threshold, STEP).run(r, w.activity)
        return Outcome(
            approach="model-based", unit="Pa", t=w.t, statistic=r, threshold=found.kappa[:, 0],
            alarms=tuple(float(w.t[alarm.sample]) for alarm in found.alarms),
        )  # fmt: skip

    def _cusum(self, w: Windows, r: Array) -> Outcome:
        taken = np.flatnonzero(w.rest)[::THIN]
        found = Cusum(self.cusum).run(r[taken], trace=True)
        return Outcome(
            approach="model-based, CUSUM", unit="sigma", t=w.t[taken],
            statistic=np.maximum(found.up, found.down)[:, 0], threshold=np.full(len(taken), self.cusum.h),
            alarms=tuple(float(w.t[taken[alarm.sample]]) for alarm in found.alarms),
        )  # fmt: skip

    def parameter_estimation(self, w: Windows) -> Outcome:
        """Head coefficients by recursive least squares against those of the commissioning.

        Parameters
        ----------
        w : Windows
            The run.

        Returns
        -------
        Outcome
            Statistic: Mahalanobis distance.

        References
        ----------
        Thesis 2.1.3.
        """
        distance = estimate(self.model, w).distance
        level = np.full(len(w.t), self.distance)
        return Outcome(
            approach="parameter estimation", unit="-", t=w.t, statistic=distance, threshold=level,
            alarms=_crossings(w.t, distance > level),
        )  # fmt: skip

    def all(self, w: Windows, method: Method = "adaptive") -> tuple[Outcome, Outcome, Outcome]:
        """Apply the three approaches to the same run.

        Parameters
        ----------
        w : Windows
            The run.
        method : {"adaptive", "constant", "cusum"}
            Of the model-based approach.

        Returns
        -------
        tuple of Outcome
            Signal-based, model-based, parameter estimation.
        """
        return self.signal_based(w), self.model_based(w, method), self.parameter_estimation(w)


def estimate(model: Commissioned, w: Windows) -> Estimate:
    """Estimate the head coefficients again and again by recursive least squares.

    Windows at rest only; they are forgotten exponentially. It starts at the commissioned coefficients with the
    weight of the memory's length, so that few operating points do not make it drift.

    Parameters
    ----------
    model : Commissioned
        Expected coefficients.
    w : Windows
        The run.

    Returns
    -------
    Estimate

    References
    ----------
    Thesis 2.1.3. L. Ljung, System Identification: Theory for the User (1999).
    """
    phi, r, rest = regressors(w) / model.scale, model.residual(w), w.rest
    keep = float(np.exp(-STEP / MEMORY))
    information, moment = model.information * (MEMORY / STEP), np.zeros(3)
    power = information[2, 2]
    change, distance, clogging = np.zeros_like(phi), np.zeros(len(r)), np.zeros(len(r))
    for k in range(len(r)):
        if rest[k]:
            information = keep * information + np.outer(phi[k], phi[k])
            moment = keep * moment + phi[k] * r[k]
            power = keep * power + phi[k, 2] ** 2
        change[k] = np.linalg.solve(information, moment)
        distance[k] = np.sqrt(change[k] @ information @ change[k]) / model.sigma_H
        clogging[k] = moment[2] / power / model.scale[2]
    return Estimate(
        theta=model.head + change / model.scale,
        residual=-change / model.scale,
        distance=distance,
        clogging=clogging,
    )


def train(commissioning: Windows, healthy: Sequence[Windows], friction: float) -> Monitor:
    """Set up a monitor: the model from one healthy run, all thresholds from others.

    Parameters
    ----------
    commissioning : Windows
        Healthy run for the model.
    healthy : sequence of Windows
        At least ten further healthy runs of the same machine for the thresholds.
    friction : float
        Believed B, N m s.

    Returns
    -------
    Monitor

    Raises
    ------
    DataError
        If runs are too few or do not excite the model.

    References
    ----------
    Thesis 2.1.4.
    """
    model = commission(commissioning, friction)
    residuals = [model.residual(w) for w in healthy]
    threshold = learn(
        residuals, [w.activity for w in healthy], residuals=("r_H",), quantile=1.0, margin=MARGIN
    )  # fmt: skip
    values = np.concatenate([_channels(w) for w in healthy])
    low, high = values.min(axis=0), values.max(axis=0)
    bands = np.column_stack((low - BAND * (high - low), high + BAND * (high - low)))
    thinned = np.concatenate([r[w.rest][::THIN] for r, w in zip(residuals, healthy, strict=True)])
    sigma = float(thinned.std(ddof=1))
    # to detect twice the healthy standard deviation: the drift is one
    h = solve_threshold(1.0, FALSE_ALARM_INTERVAL / (THIN * STEP))
    return Monitor(
        model=model,
        bands=bands,
        threshold=threshold,
        cusum=CusumSettings(sigma=sigma, mean=float(thinned.mean()), nu=1.0, h=h),
        distance=MARGIN * max(float(estimate(model, w).distance.max()) for w in healthy),
    )


def scaled(threshold: Threshold, factor: float) -> Threshold:
    """The same threshold, higher or lower by a factor.

    Parameters
    ----------
    threshold : Threshold
        Learned threshold.
    factor : float
        Factor on k0 and c.

    Returns
    -------
    Threshold

    Raises
    ------
    ParameterError
        If the factor is not positive.
    """
    return Threshold(
        residuals=threshold.residuals,
        k0=tuple(factor * k for k in threshold.k0),
        c=tuple(factor * c for c in threshold.c),
        limit=threshold.limit,
        recovery=threshold.recovery,
    )


def critical_factor(threshold: Threshold, r: Array, activity: Array, first: int = 0) -> float:
    """Factor on a threshold up to which a run raises an alarm.

    Parameters
    ----------
    threshold : Threshold
        Threshold of one residual.
    r, activity : ndarray, shape (n,)
        Residual and activity.
    first : int
        Alarms before this window do not count.

    Returns
    -------
    float
        With a smaller factor there is an alarm, with a larger one there is none.

    Raises
    ------
    DataError
        If there is no window to judge.
    """
    if not 0 <= first < len(r):
        raise DataError(f"critical_factor: first = {first} of {len(r)} windows: nothing is left to judge.")
    low, high = 1e-6, 1e6
    while high / low > 1.0 + 1e-6:
        factor = float(np.sqrt(low * high))
        found = Evaluator(scaled(threshold, factor), STEP).run(r, activity)
        if (found.integral[first:] > threshold.limit).any():
            low = factor
        else:
            high = factor
    return low


def _channels(w: Windows) -> Array:
    return np.column_stack([getattr(w, name) for name in CHANNELS])


def _crossings(t: Array, over: Array) -> tuple[float, ...]:
    rising = over & ~np.concatenate(([False], over[:-1]))
    return tuple(float(time) for time in t[rising])
