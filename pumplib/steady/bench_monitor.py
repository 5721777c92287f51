"""Thesis 7.3, 7.4: the steady-state scheme as a monitor: commission, then judge steady points (reconstructed).

Commissioning takes one healthy run: parameters, their guaranteed set and the block of healthy points. Further
healthy runs are asked whether they can be explained; if one cannot, a margin of the model is learned from it. A new
run is judged steady point by steady point:

    plain     residual sets from the parameter set alone, as the thesis has them
    single    residual sets given the healthy block (`pumplib.steady.residual_sets`), still one point at a time
    window    linear program over the last points and the healthy block
    signs     the class by the signs of the single sets, gathered since their first alarm
    possible  hypotheses that the points after the window's first alarm leave over, with sizes

The sets are stated before any measurement: sensors by their sheets, the winding by its temperature, rotor resistance
and leakage inductance by how far saturation moves them. Nothing in them is fitted to the truth of a run.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray

from pumplib.errors import DataError, ParameterError
from pumplib.machines import Motor
from pumplib.machines.quantity import Parameters, Quantity
from pumplib.steady.detector import SteadySettings, steady_windows
from pumplib.steady.enclose import Enclosure, set_model
from pumplib.steady.identify import Identification, identify, model_margins
from pumplib.steady.points import channels_of
from pumplib.steady.relations import CHANNELS, parameter_values, pump_relations
from pumplib.steady.residual_sets import ReferenceSets, gathered_signs, named_by_signs
from pumplib.steady.sets import MeasurementErrors
from pumplib.steady.windows import HYPOTHESES, Verdict, WindowTest
from pumplib.testbench.sensors import SensorSpread
from pumplib.testbench.slow import SlowSignals

Array = NDArray[Any]
MARGIN_FACTOR = 1.15  # a margin learned from a few runs is taken this much larger


@dataclass(frozen=True, kw_only=True, slots=True)
class Statement:
    """What is stated about a pump set before anything is measured.

    Parameters
    ----------
    motor : Motor
        From its sheet.
    nominal : dict of str to float
        Middles of the motor's parameters.
    motor_box : dict of str to float
        Their relative half widths.
    changing, own : tuple of str
        Parameters that differ from run to run, and from point to point.
    errors : MeasurementErrors
        Of the means over a steady window.
    lags : dict of str to float
        Time constants of sensors, s.
    """

    motor: Motor
    nominal: dict[str, float]
    motor_box: dict[str, float]
    changing: tuple[str, ...] = ("r_s",)
    own: tuple[str, ...] = ("R_r_prime", "L_s_prime")
    errors: MeasurementErrors
    lags: dict[str, float]


def pump_statement(motor: Motor, sensors: Mapping[str, SensorSpread]) -> Statement:
    """Statement on a motor with a pump, from the sheets of motor and sensors.

    Beside the sheets it supposes a winding 10 K below to 20 K above the sheet's temperature, a core loss up to 2 % of
    1.5 kW at 325 V, and saturation that lowers R_r' by 0.5 % and moves L_s' by 0.2 % at most.

    Parameters
    ----------
    motor : Motor
        From its sheet.
    sensors : mapping of str to SensorSpread
        Types of the sensors: "pressure", "flow", "current".

    Returns
    -------
    Statement

    Raises
    ------
    ParameterError
        If a sensor is missing.
    """
    missing = [name for name in ("pressure", "flow", "current") if name not in sensors]
    if missing:
        raise ParameterError(f"pump_statement: no sheet of {', '.join(missing)}; give pressure, flow and current.")
    bias = {
        "H": max(map(abs, sensors["pressure"].offset)), "Q": max(map(abs, sensors["flow"].offset)),
        "I_rms": max(map(abs, sensors["current"].gain_error)),
    }  # fmt: skip
    nominal = parameter_values(motor) | {"G_core": 1e-4}
    nominal["r_s"] *= 1.02
    nominal["R_r_prime"] *= 0.9975
    return Statement(
        motor=motor,
        nominal=nominal,
        motor_box={"r_s": 0.06, "G_core": 1.0, "R_r_prime": 0.0025, "L_s_prime": 0.002},
        errors=MeasurementErrors(
            relative={name: bias.get(name, 0.0) + NOISE[name] for name in ("V_rms", "I_rms", "omega_e")},
            absolute={name: bias.get(name, 0.0) + NOISE[name] for name in ("phi", "H", "Q")},
            bias_share={name: value / (value + NOISE[name]) for name, value in bias.items()},
        ),
        lags={"H": sensors["pressure"].sensor.lag, "Q": sensors["flow"].sensor.lag},
    )


NOISE: Mapping[str, float] = {
    "V_rms": 1e-4, "I_rms": 1e-4, "omega_e": 2e-5, "phi": 3e-4, "H": 104.0, "Q": 5.2e-7
}  # fmt: skip
"""Part of the errors of a point that is no bias; V_rms, I_rms and omega_e relative, else SI.

Of H and Q three standard deviations of the mean over four slow windows of 0.2 s, from the noise in the sheets."""


def _tolerance() -> dict[str, float]:
    return {"H": 6000.0, "Q": 2e-5, "omega_e": 0.3, "I_rms": 0.02}


@dataclass(frozen=True, kw_only=True, slots=True)
class MonitorSettings(Parameters):
    """How the monitor makes its points and windows.

    Parameters
    ----------
    step : float
        Length and distance of the slow windows, s.
    samples : int
        Slow windows of a point.
    settle : int
        Of these, how many at the beginning are left out of the mean, so that the tail of a change does not count.
    wrong_steady : float
        Of the detector, see `pumplib.steady.detector.SteadySettings`.
    recent : int
        Points of a window.
    tolerance : dict of str to float
        Largest change of the channels over a point, SI.
    """

    step: Annotated[float, Quantity("s", "length of the slow windows", 0.2, 3600.0)] = 0.2
    samples: Annotated[int, Quantity("-", "slow windows of a point", 4, 10_000)] = 5
    settle: Annotated[int, Quantity("-", "slow windows left out of the mean", 0, 10_000)] = 1
    wrong_steady: Annotated[float, Quantity("-", "probability of a wrong 'steady'", 1e-9, 0.5)] = 0.05
    recent: Annotated[int, Quantity("-", "points of a window", 1, 1000)] = 8
    tolerance: dict[str, float] = field(default_factory=_tolerance)

    def _check_together(self) -> None:
        if self.settle > self.samples - 2:
            raise ParameterError(
                f"MonitorSettings.settle = {self.settle}: leaves fewer than two of {self.samples} slow windows."
            )


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Points:
    """Points of a run, means over windows that do not overlap.

    Parameters
    ----------
    start, t : ndarray, shape (n,)
        Beginning and end of each window, s; a decision on a point is made at its end.
    signals : dict of str to ndarray, shape (n,)
        Channels, SI.
    """

    start: Array
    t: Array
    signals: dict[str, Array]

    def __len__(self) -> int:
        return len(self.t)

    def take(self, chosen: Any) -> dict[str, Array]:
        """Channels of some points.

        Parameters
        ----------
        chosen : slice, mask or indices
            Which.

        Returns
        -------
        dict of str to ndarray
        """
        return {name: x[chosen] for name, x in self.signals.items()}


def points_of(
    slow: SlowSignals, lags: Mapping[str, float], settings: MonitorSettings | None = None, *, steady: bool = True
) -> Points:
    """Steady points of a run: as soon as a window is steady it becomes a point, and the next begins after it.

    A sensor with a lag shows a slowly changing quantity late; the mean is moved on by the lag times the slope that the
    detector has found.

    Parameters
    ----------
    slow : SlowSignals
        Of a run, with windows as in the settings.
    lags : mapping of str to float
        Time constants of the sensors, s.
    settings : MonitorSettings, optional
        How.
    steady : bool
        False takes every window, steady or not: what happens without the detector.

    Returns
    -------
    Points

    Raises
    ------
    DataError
        If a channel is missing.
    """
    chosen = settings or MonitorSettings()
    columns, n = channels_of(slow), chosen.samples
    missing = [name for name in CHANNELS if name not in columns]
    if missing:
        raise DataError(f"slow signals: {', '.join(missing)} missing; all of {', '.join(CHANNELS)} are needed.")
    found = steady_windows(
        columns, chosen.tolerance, SteadySettings(window=n, wrong_steady=chosen.wrong_steady)
    )  # fmt: skip
    there = np.all([np.isfinite(x) for x in columns.values()], axis=0)
    whole = np.convolve(there.astype(float), np.ones(n))[: len(there)] > n - 0.5
    allowed = whole & found.steady if steady else whole
    ends: list[int] = []
    for k in np.flatnonzero(allowed):
        if not ends or k - ends[-1] >= n:
            ends.append(int(k))
    first = n - 1 - chosen.settle
    signals = {name: np.array([x[k - first : k + 1].mean() for k in ends]) for name, x in columns.items()}
    if steady:
        for name, lag in lags.items():
            signals[name] = signals[name] + lag * found.change[name][ends] / (n * chosen.step)
    t = slow.t[ends] + 0.5 * chosen.step
    return Points(start=t - n * chosen.step, t=t, signals=signals)


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Judged:
    """What the monitor says about a run.

    Parameters
    ----------
    points : Points
        Steady points, n of them.
    plain, sets : Enclosure
        Residual sets from the parameter set alone, and given the healthy block.
    window : ndarray of bool, shape (n,)
        Whether the window that ends at a point cannot be explained.
    signs : str
        Class by the signs, "" if none is named.
    signs_at : float or None
        When this class was first said for good, s.
    verdicts : dict of str to Verdict
        Hypotheses on the points after the first alarm, of all of them; empty without such points.
    tested : int
        Points that the hypotheses were tested on.
    single_at : float or None
        When one hypothesis alone was left, s.
    """

    points: Points
    plain: Enclosure
    sets: Enclosure
    window: Array
    signs: str
    signs_at: float | None
    verdicts: dict[str, Verdict]
    tested: int
    single_at: float | None

    @property
    def possible(self) -> tuple[str, ...]:
        """Hypotheses that are not refuted."""
        return tuple(name for name, one in self.verdicts.items() if one.possible)

    def alarms(self, method: str) -> Array:
        """Times of the points at which a method sees a fault.

        Parameters
        ----------
        method : {"plain", "single", "window"}
            Which.

        Returns
        -------
        ndarray
            s.

        Raises
        ------
        ParameterError
            If there is no such method.
        """
        by = {"plain": self.plain.alarm.any(axis=1), "single": self.sets.alarm.any(axis=1), "window": self.window}
        if method not in by:
            raise ParameterError(f"method = {method!r}: must be one of {', '.join(by)}.")
        return np.asarray(self.points.t[by[method]])


class SteadyMonitor:
    """A commissioned monitor of one machine.

    Parameters
    ----------
    statement : Statement
        What was stated.
    identified : Identification
        From the commissioning run.
    healthy : mapping of str to ndarray
        Points of the commissioning run.
    margin : tuple of float
        Of the model in R1, Pa, and R2, N m; (0, 0) is the strict guarantee.
    settings : MonitorSettings
        Points and windows.
    """

    def __init__(
        self,
        statement: Statement,
        identified: Identification,
        healthy: Mapping[str, Array],
        margin: tuple[float, float],
        settings: MonitorSettings,
    ) -> None:
        self.statement, self.identified, self.margin, self.settings = statement, identified, margin, settings
        self.healthy = dict(healthy)
        self.model = set_model(pump_relations(statement.motor), identified.guaranteed, statement.errors)
        self.test = WindowTest(
            self.model, healthy, margin=margin, changing=statement.changing, own=statement.own
        )  # fmt: skip
        self.reference = ReferenceSets(self.test)

    def points(self, slow: SlowSignals, *, steady: bool = True) -> Points:
        """Points of a run.

        Parameters
        ----------
        slow : SlowSignals
            Of the run.
        steady : bool
            False switches the detector off.

        Returns
        -------
        Points
        """
        return points_of(slow, self.statement.lags, self.settings, steady=steady)

    def unexplained(self, signals: Mapping[str, Array]) -> bool:
        """Whether nothing in the sets explains points together with the healthy block.

        Parameters
        ----------
        signals : mapping of str to ndarray, shape (n,)
            Channels.

        Returns
        -------
        bool
        """
        return self.test.test(signals, ("none",), sizes=False).fault

    def moving_alarm(self, slow: SlowSignals, until: float = np.inf) -> bool:
        """Whether there would be an alarm without the detector.

        Parameters
        ----------
        slow : SlowSignals
            Of the run.
        until : float
            Windows that end after this time are left out, s.

        Returns
        -------
        bool
        """
        points = self.points(slow, steady=False)
        return any(self.unexplained(points.take([k])) for k in np.flatnonzero(points.t < until))

    def judge(self, slow: SlowSignals, *, sizes: bool = True) -> Judged:
        """Judge a run.

        Parameters
        ----------
        slow : SlowSignals
            Of the run.
        sizes : bool
            Whether to bound the sizes of the hypotheses that are left.

        Returns
        -------
        Judged

        Raises
        ------
        DataError
            If a channel is missing.
        """
        points, recent = self.points(slow), self.settings.recent
        plain, sets = self._plain(points), self.reference.enclose(points.signals)
        single = np.asarray(sets.alarm.any(axis=1))
        window = np.zeros(len(points), dtype=bool)
        for k in range(len(points)):
            part = slice(max(0, k - recent + 1), k + 1)
            # a point that alone is not explained is not explained among others
            window[k] = single[part].any() or self.unexplained(points.take(part))
        named, named_at = self._signs(points, sets, single)
        verdicts, tested, single_at = self._hypotheses(points, window, sizes)
        return Judged(
            points=points, plain=plain, sets=sets, window=window, signs=named, signs_at=named_at,
            verdicts=verdicts, tested=tested, single_at=single_at,
        )  # fmt: skip

    def _plain(self, points: Points) -> Enclosure:
        found = self.model.enclose(points.signals)
        margin = np.array([self.margin[0], self.margin[1], self.margin[1]])
        return Enclosure(outputs=found.outputs, lo=found.lo - margin, hi=found.hi + margin, method="affine")

    def _signs(self, points: Points, sets: Enclosure, single: Array) -> tuple[str, float | None]:
        if not single.any():
            return "", None
        first, said, at = int(np.argmax(single)), "", None
        for k in range(first, min(len(points), first + self.settings.recent)):
            part = Enclosure(
                outputs=sets.outputs, lo=sets.lo[first : k + 1], hi=sets.hi[first : k + 1], method=sets.method
            )  # fmt: skip
            middle = 0.5 * (sets.lo[k, 0] + sets.hi[k, 0])
            name = named_by_signs(gathered_signs(part), float(-middle / (points.signals["H"][k] - middle)))
            if name != said:
                said, at = name, float(points.t[k]) if name else None
        return said, at

    def _hypotheses(self, points: Points, window: Array, sizes: bool) -> tuple[dict[str, Verdict], int, float | None]:
        if not window.any():
            return {}, 0, None
        # windows that begin after the alarm are faulty from end to end if the fault is abrupt and stays
        later = points.start >= points.t[int(np.argmax(window))] - 1e-9
        # the effect of a leakage is not defined where the head may be zero or less, as with a pump run dry
        floor = self.statement.errors.absolute["H"]
        after = np.flatnonzero(later & (points.signals["H"] > floor))[: self.settings.recent]
        left: tuple[str, ...] = HYPOTHESES[1:]
        at: float | None = None
        found: dict[str, Verdict] = {}
        for count in range(1, len(after) + 1):
            # a hypothesis that fewer points have refuted stays refuted
            last = count == len(after)
            found |= self.test.test(points.take(after[:count]), left, sizes=sizes and last).verdicts
            left = tuple(name for name in left if found[name].possible)
            if len(left) == 1 and at is None:
                at = float(points.t[after[count - 1]])
            if not left:
                return found, count, None
        return found, len(after), at


def commission(
    healthy: SlowSignals,
    statement: Statement,
    settings: MonitorSettings | None = None,
    *,
    strict: bool = False,
) -> SteadyMonitor:
    """Commission a monitor on one healthy run.

    Parameters
    ----------
    healthy : SlowSignals
        Of the run.
    statement : Statement
        What is stated.
    settings : MonitorSettings, optional
        Points and windows.
    strict : bool
        Refuse a margin of the model; without it the smallest that explains the run is taken twice.

    Returns
    -------
    SteadyMonitor

    Raises
    ------
    DataError
        If the run has too few steady points or cannot be explained.
    """
    chosen = settings or MonitorSettings()
    points = points_of(healthy, statement.lags, chosen)
    identified = identify(
        statement.motor, statement.nominal, points.signals, statement.errors,
        motor_box=statement.motor_box, own=statement.own, margin=(0.0, 0.0) if strict else None,
    )  # fmt: skip
    return SteadyMonitor(statement, identified, points.signals, identified.margin_used, chosen)


def teach(monitor: SteadyMonitor, healthy: Sequence[SlowSignals]) -> SteadyMonitor:
    """Enlarge the margin of a monitor until further healthy runs are explained; usually nothing changes.

    Parameters
    ----------
    monitor : SteadyMonitor
        Commissioned.
    healthy : sequence of SlowSignals
        Further healthy runs.

    Returns
    -------
    SteadyMonitor
        The same if all runs are explained.

    Raises
    ------
    DataError
        If a channel is missing.
    """
    extra = np.zeros(2)
    reference = monitor.test.reference
    assert reference is not None
    for slow in healthy:
        points = monitor.points(slow)
        if len(points) and monitor.unexplained(points.signals):
            extra = np.maximum(extra, model_margins(reference + monitor.test.rows(points.signals)))
    if not extra.any():
        return monitor
    margin = (monitor.margin[0] + MARGIN_FACTOR * extra[0], monitor.margin[1] + MARGIN_FACTOR * extra[1])
    return SteadyMonitor(
        monitor.statement, monitor.identified, monitor.healthy, margin, monitor.settings
    )  # fmt: skip
