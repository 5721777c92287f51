"""Thesis 6.6, 6.7: the pump part as a monitor: commissioning, thresholds, alarms, classification.

    commission_monitor(healthy run)            belief, winding map
    teach(ten other healthy runs)              adaptive thresholds; coupling of the rotor's temperature
    PumpMonitor.judge(run)                     alarms, and the class of the first one

Everything is learned from healthy records of the same machine; nothing about a fault is.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray

from pumplib.decide import Activity, ActivitySettings, Evaluator, Threshold, ThresholdAlarm, learn
from pumplib.errors import DataError
from pumplib.machines.parameters import Motor
from pumplib.machines.quantity import Choice, Parameters, Quantity
from pumplib.observers.residual import ResidualObserver, Residuals, ResidualSettings
from pumplib.observers.residual_calibration import apply_calibration, calibrate
from pumplib.observers.residual_model import REST, PumpBelief, commission
from pumplib.observers.residual_signature import DRY_LEVEL, Classified, classify
from pumplib.observers.residual_winding import (
    Electrical,
    WindingMap,
    commission_winding,
    corrected,
    electrical,
    winding_change,
)
from pumplib.observers.stator import Estimates

Array = NDArray[Any]
NAMES = ("r1", "r2", "r3")
ACTIVITY = ActivitySettings(signals=("Q", "omega"), scales=(1e-4, 3.0), time_constant=0.25)
"""How far flow (m3/s) and speed (rad/s) are from their own low-passed values."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class PumpRecord:
    """What the pump part sees of a run, at the rate of pressure and flow.

    Parameters
    ----------
    dt : float
        Sampling interval, s.
    omega, T_e : ndarray, shape (n,)
        Speed (rad/s) and torque (N m) of the motor's observer; NaN where it does not run.
    H, Q : ndarray, shape (n,)
        Differential pressure (Pa) and flow (m3/s).
    side : Electrical
        Electrical side of the motor.
    """

    dt: float
    omega: Array
    T_e: Array
    H: Array
    Q: Array
    side: Electrical


def pump_record(found: Estimates, H: Array, Q: Array, rate: float) -> PumpRecord:
    """Put the motor observer's rows beside pressure and flow.

    Parameters
    ----------
    found : Estimates
        Rows at the rate of the hydraulic signals.
    H, Q : ndarray, shape (n,)
        Differential pressure (Pa) and flow (m3/s).
    rate : float
        Their rate, Hz.

    Returns
    -------
    PumpRecord

    Raises
    ------
    DataError
        If the rates differ, or the records differ in length by more than one sample.
    """
    if abs(found.rate - rate) > 1e-9 * rate:
        raise DataError(
            f"pump_record: the motor's observer gives {found.rate:g} rows a second, pressure and flow {rate:g}; "
            "run it with `every` so that they agree."
        )
    n = min(len(found.rows), len(H), len(Q))
    if max(len(found.rows), len(H), len(Q)) - n > 1:
        raise DataError(
            f"pump_record: {len(found.rows)} rows of the observer, {len(H)} of pressure, {len(Q)} of flow; "
            "give records of the same time."
        )
    side = electrical(found)
    cut = Electrical(
        omega_s=side.omega_s[:n], v2=side.v2[:n], i2=side.i2[:n], p=side.p[:n], q=side.q[:n], trusted=side.trusted[:n]
    )
    return PumpRecord(
        dt=1 / rate, omega=found.omega[:n], T_e=found.T_e[:n], H=np.asarray(H[:n]), Q=np.asarray(Q[:n]), side=cut
    )


@dataclass(frozen=True, kw_only=True, slots=True)
class MonitorSettings(Parameters):
    """How the monitor learns and decides.

    Parameters
    ----------
    winding : {"believed", "estimated"}
        Resistances as believed, or the stator's estimated and the rotor's following it as learned.
    self_calibration : float
        Healthy beginning of every run that residuals are calibrated on, s; 0 for none. Alarms are judged after it.
    quantile, margin : float
        Of the healthy residuals: the threshold is `margin` times the quantile.
    limit : float
        Integral of the relative excess that raises an alarm.
    wait, collect : float
        After an alarm the fault's own transient passes for `wait`; then residuals at rest are collected for `collect`
        seconds and their mean is classified. Residuals taken while the operating point moves would point anywhere.
    """

    winding: Annotated[Literal["believed", "estimated"], Choice("resistances", ("believed", "estimated"))] = "believed"
    self_calibration: Annotated[float, Quantity("s", "healthy beginning of a run", 0.0, 1e6)] = 0.0
    quantile: Annotated[float, Quantity("-", "quantile of healthy residuals", 0.5, 1.0)] = 0.9995
    margin: Annotated[float, Quantity("-", "factor on the quantile", 1.0, 10.0)] = 1.25
    limit: Annotated[float, Quantity("s", "integral of the relative excess", 0.0, 1e3, True)] = 0.1
    wait: Annotated[float, Quantity("s", "transient of the fault", 0.0, 1e3)] = 0.5
    collect: Annotated[float, Quantity("s", "rest that is collected", 0.0, 1e3, True)] = 0.6


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Judged:
    """What the monitor says about a run.

    Parameters
    ----------
    alarms : tuple of ThresholdAlarm
        All upward crossings; samples counted from the start of the record.
    t : tuple of float
        Their times, s.
    first : float or None
        Time of the first alarm, s.
    dry : float or None
        Time of the level rule "runs dry", s; it does not wait for the classification.
    classified : Classified or None
        Class of the first alarm; None without an alarm, or with too little rest after it.
    classified_at : float or None
        Time of the classification, s.
    residuals : Residuals
        As generated.
    r : ndarray, shape (n, 3)
        Calibrated r1, r2, r3; NaN where they are not judged.
    kappa : ndarray, shape (n, 3)
        Thresholds, NaN there.
    activity : ndarray, shape (n,)
        Of the operating point.
    winding : ndarray, shape (n,)
        Estimated relative change of r_s, zero if believed.
    """

    alarms: tuple[ThresholdAlarm, ...]
    t: tuple[float, ...]
    first: float | None
    dry: float | None
    classified: Classified | None
    classified_at: float | None
    residuals: Residuals
    r: Array
    kappa: Array
    activity: Array
    winding: Array


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class PumpMonitor:
    """A commissioned and taught monitor of the pump part.

    Parameters
    ----------
    belief : PumpBelief
        With the maps of this pump.
    motor : Motor
        What is believed about the motor.
    settings : MonitorSettings
        How it decides.
    observer : ResidualSettings
        Gains of the residual observers.
    reference : WindingMap or None
        Main inductance as commissioned; None if resistances are believed.
    rotor_share : float
        Relative change of r_r per relative change of r_s.
    nominal : tuple of float
        Median speed (rad/s), flow (m3/s) and copper term of the commissioning.
    threshold : Threshold or None
        None before `teach`.
    """

    belief: PumpBelief
    motor: Motor
    settings: MonitorSettings
    observer: ResidualSettings
    reference: WindingMap | None
    rotor_share: float
    nominal: tuple[float, float, float]
    threshold: Threshold | None = None

    def generate(self, record: PumpRecord) -> tuple[Residuals, Array]:
        """Residuals of a run, and the estimated change of the winding.

        Parameters
        ----------
        record : PumpRecord
            The run.

        Returns
        -------
        residuals : Residuals
        winding : ndarray, shape (n,)
            Relative change of r_s; zero if believed.
        """
        omega, T_e, change = self._speed_and_torque(record)
        found = ResidualObserver(self.belief, record.dt, self.observer).run(
            omega, T_e, record.H, record.Q, record.side.trusted
        )
        return found, change

    def _speed_and_torque(self, record: PumpRecord) -> tuple[Array, Array, Array]:
        if self.reference is None:
            return record.omega, record.T_e, np.zeros(len(record.omega))
        change = winding_change(record.side, self.reference, record.dt)
        omega, T_e = corrected(record.omega, record.T_e, record.side, self.motor, change, self.rotor_share)
        return omega, T_e, change

    def evaluate(self, record: PumpRecord) -> tuple[Residuals, Array, Array, Array, Array]:
        """Residuals ready to be judged.

        Parameters
        ----------
        record : PumpRecord
            The run.

        Returns
        -------
        residuals : Residuals
        r : ndarray, shape (n, 3)
            Calibrated.
        activity : ndarray, shape (n,)
        judged : ndarray of bool, shape (n,)
        winding : ndarray, shape (n,)
        """
        found, change = self.generate(record)
        activity = activity_of(found)
        judged = found.judged.copy()
        r = found.r[:, :3].copy()
        r[:, 2] = np.where(found.flag & 8, 0.0, r[:, 2])  # near shut-off r3 says nothing; the flag tells
        begin = self.settings.self_calibration
        if begin > 0:
            early = judged & (found.t < begin)
            rest = early & (activity < REST)
            copper = self._copper(record)
            nominal = self.nominal[:2]
            filled = np.where(judged[:, None], r, 0.0)
            w, Q = np.where(judged, found["omega"], nominal[0]), np.where(judged, found["Q"], nominal[1])
            learned = calibrate(filled, w, Q, copper, rest, dt=record.dt, nominal=nominal)
            r = np.where(judged[:, None], apply_calibration(filled, w, Q, copper, learned, nominal), np.nan)
            judged &= found.t >= begin
        return found, r, activity, judged, change

    def _copper(self, record: PumpRecord) -> Array:
        ratio = np.where(record.side.trusted, record.side.i2 / record.side.omega_s, self.nominal[2])
        return np.asarray(ratio / self.nominal[2])

    def judge(self, record: PumpRecord) -> Judged:
        """Judge a run.

        Parameters
        ----------
        record : PumpRecord
            The run.

        Returns
        -------
        Judged

        Raises
        ------
        DataError
            If the monitor was not taught, or the record does not fit.
        """
        if self.threshold is None:
            raise DataError("PumpMonitor.judge: no thresholds; call teach with healthy runs first.")
        found, r, activity, judged, change = self.evaluate(record)
        kappa = np.full((len(r), 3), np.nan)
        alarms: list[ThresholdAlarm] = []
        for first, stop in spans(judged):
            outcome = Evaluator(self.threshold, record.dt).run(r[first:stop], activity[first:stop])
            kappa[first:stop] = outcome.kappa
            alarms += [replace(one, sample=one.sample + first, onset=one.onset + first) for one in outcome.alarms]
        t = tuple(float(found.t[one.sample]) for one in alarms)
        said, when = None, None
        if alarms:
            said, when = self._classified(found, r, activity, judged, alarms[0].sample, record.dt)
        return Judged(
            alarms=tuple(alarms),
            t=t,
            first=t[0] if t else None,
            dry=self._dry(found, judged, record.dt),
            classified=said,
            classified_at=when,
            residuals=found,
            r=np.where(judged[:, None], r, np.nan),
            kappa=kappa,
            activity=activity,
            winding=change,
        )

    def _dry(self, found: Residuals, judged: Array, dt: float) -> float | None:
        f_H = self.belief.head(found["Q"], found["omega"])
        with np.errstate(invalid="ignore"):
            low = judged & (-found["r1"] > DRY_LEVEL * f_H)
        hold = round(0.1 / dt)
        run = np.flatnonzero(np.convolve(low, np.ones(hold), "valid") >= hold)
        return float(found.t[run[0] + hold - 1]) if len(run) else None

    def _classified(
        self, found: Residuals, r: Array, activity: Array, judged: Array, alarm: int, dt: float
    ) -> tuple[Classified | None, float | None]:
        assert self.threshold is not None
        begin, need = alarm + round(self.settings.wait / dt), round(self.settings.collect / dt)
        rest = begin + np.flatnonzero((judged & (activity < REST))[begin:])[:need]
        if len(rest) < need:
            return None, None
        omega, Q = float(found["omega"][rest].mean()), float(found["Q"][rest].mean())
        said = classify(r[rest].mean(axis=0), np.array(self.threshold.k0), self.belief, omega, Q)
        return said, float(found.t[rest[-1]])


def activity_of(found: Residuals) -> Array:
    """Activity of the operating point; where residuals are untrusted it is zero and starts anew.

    Parameters
    ----------
    found : Residuals
        Of a run.

    Returns
    -------
    ndarray, shape (n,)
    """
    out = np.zeros(len(found.rows))
    for first, stop in spans(np.isfinite(found["omega"])):
        both = np.column_stack((found["Q"][first:stop], found["omega"][first:stop]))
        out[first:stop] = Activity(ACTIVITY, found.dt).run(both)
    return out


def spans(good: Array) -> list[tuple[int, int]]:
    """First and one past the last index of every stretch of True.

    Parameters
    ----------
    good : ndarray of bool, shape (n,)
        Flags.

    Returns
    -------
    list of tuple of int
    """
    edges = np.flatnonzero(np.diff(np.concatenate(([False], np.asarray(good, dtype=bool), [False])).astype(np.int8)))
    return [(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def commission_monitor(
    record: PumpRecord,
    prior: PumpBelief,
    motor: Motor,
    settings: MonitorSettings | None = None,
    observer: ResidualSettings | None = None,
) -> PumpMonitor:
    """Teach the maps of the pump, and of the winding if it is to be estimated, from one healthy run.

    Parameters
    ----------
    record : PumpRecord
        Healthy, several operating points.
    prior : PumpBelief
        From the sheets.
    motor : Motor
        What is believed.
    settings : MonitorSettings, optional
        How the monitor decides.
    observer : ResidualSettings, optional
        Gains.

    Returns
    -------
    PumpMonitor
        Without thresholds.

    Raises
    ------
    DataError
        If the record has too little rest, or operating points too much alike.
    """
    settings, observer = settings or MonitorSettings(), observer or ResidualSettings()
    reference = commission_winding(record.side, motor, record.dt) if settings.winding == "estimated" else None
    raw = PumpMonitor(
        belief=prior, motor=motor, settings=settings, observer=observer, reference=reference, rotor_share=0.0,
        nominal=(300.0, 1e-3, 1.0),
    )  # fmt: skip
    return _fitted(raw, record)


def _fitted(monitor: PumpMonitor, record: PumpRecord) -> PumpMonitor:
    """The same monitor with the maps of a healthy run."""
    found, _ = monitor.generate(record)
    good = found.judged
    activity = activity_of(found)
    omega, T_e, H, Q = (found[name][good] for name in ("omega", "T_e", "H", "Q"))
    taught = commission(monitor.belief, omega, T_e, H, Q, activity[good])
    copper = (record.side.i2 / record.side.omega_s)[good]
    nominal = (float(np.median(omega)), float(np.median(Q)), float(np.median(copper)))
    return replace(monitor, belief=taught.belief, nominal=nominal)


def teach(monitor: PumpMonitor, commissioning: PumpRecord, healthy: Sequence[PumpRecord]) -> PumpMonitor:
    """Learn the thresholds from further healthy runs.

    With an estimated winding the share by which the rotor's resistance follows the stator's is learned first: it is
    the one that makes the head residual of all these runs smallest, between none and half more.

    Parameters
    ----------
    monitor : PumpMonitor
        Commissioned.
    commissioning : PumpRecord
        The run it was commissioned on; the maps are fitted to it again with the learned share.
    healthy : sequence of PumpRecord
        At least ten others.

    Returns
    -------
    PumpMonitor

    Raises
    ------
    DataError
        If runs are too few.
    """
    if monitor.reference is not None:
        share = _rotor_share(monitor, (commissioning, *healthy))
        monitor = _fitted(replace(monitor, rotor_share=share), commissioning)
    residuals, activities = [], []
    for record in healthy:
        _, r, activity, judged, _ = monitor.evaluate(record)
        residuals.append(r[judged])
        activities.append(activity[judged])
    threshold = learn(
        residuals, activities, residuals=NAMES, quantile=monitor.settings.quantile, margin=monitor.settings.margin,
        limit=monitor.settings.limit, quiet=REST,
    )  # fmt: skip
    return replace(monitor, threshold=threshold)


def _rotor_share(monitor: PumpMonitor, runs: Sequence[PumpRecord]) -> float:
    """Least squares: head residuals against what a warmer rotor would do to the estimated speed."""
    rows, target = [], []
    for record in runs:
        found, change = monitor.generate(record)
        rest = found.judged & (activity_of(found) < REST)
        w, Q = found["omega"][rest][::50], found["Q"][rest][::50]
        slip = record.side.omega_s[rest][::50] / monitor.motor.z_p - w
        b = monitor.belief
        effect = (2 * b.a_h0 * w + b.a_h1 * Q) * change[rest][::50] * slip
        maps = np.column_stack((w**2, w * Q, -(Q**2)))
        rows.append(np.column_stack((maps, -effect)))
        target.append(found["H"][rest][::50])
    X, y = np.concatenate(rows), np.concatenate(target)
    scale = np.abs(X).max(axis=0)
    if scale[3] == 0.0:
        return 0.0
    return float(np.clip(np.linalg.lstsq(X / scale, y, rcond=None)[0][3] / scale[3], 0.0, 1.5))
