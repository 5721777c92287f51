"""Thesis 4.4.1, 4.4.2: the signal-based scheme: thresholds of the signal events and the decision logic behind them.

Every signal has a threshold learned from healthy runs of the same machine. The thresholds of the residuals are then
balanced: a must entry of the tables says that a fault shows in several signals, which is true only of faults that
pass all their thresholds. Left as learned, the head would speak up for leakages ten times smaller than the torque
can see, and the tables would find no fault that shows in the head alone. So a head deviation counts from what a
leakage or a clogging at the torque's threshold takes of the head, by the slopes of the machine's own maps.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cache
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray

from pumplib.errors import DataError
from pumplib.events.features import SIGNALS, SIGNED, Features
from pumplib.events.symbols import EventSymbols, SymbolSettings
from pumplib.fmea.load import shipped
from pumplib.machines.quantity import Parameters, Quantity
from pumplib.observers.residual_monitor import PumpMonitor
from pumplib.propagation import (
    UNKNOWN,
    DecisionLogic,
    DecisionRecord,
    DecisionTable,
    LogicSettings,
    compile_table,
    propagate,
)

Array = NDArray[Any]
SENSORS = ("I", "V", "Q", "dp")
GROUPS = tuple(f"G{k}" for k in range(1, 8))
LEAST = 100
"""Samples at rest that thresholds are learned from, at least."""


@dataclass(frozen=True, kw_only=True, slots=True)
class EventSettings(Parameters):
    """How the thresholds of the signal events are formed.

    Parameters
    ----------
    margin : float
        Factor on the largest healthy value at rest of fault coefficient and sideband.
    smallest : float
        Least threshold of the fault coefficient: a share of the turns well below the single turn that the smallest
        short has.
    ripple : float
        Least threshold of the sideband: about what a torque ripple of the size of the torque's threshold makes.
    tolerance : float
        Relative error of the believed impedances, as the motor's sheet states it: how much of the supply's
        unbalance the fault coefficient may take for a fault, and how much of the torque, which goes with the squared
        flux, may be wrong when the supply leaves the flux that was taught.
    balance : float
        Thresholds of head and of the torque by head over that of the torque.
    symbols : SymbolSettings
        From deviations to symbols.
    logic : LogicSettings
        From symbols to what is acted on.
    """

    margin: Annotated[float, Quantity("-", "factor on healthy values", 1.0, 100.0)] = 1.5
    smallest: Annotated[float, Quantity("-", "least threshold of the fault coefficient", 0.0, 0.1)] = 1e-3
    ripple: Annotated[float, Quantity("-", "least threshold of the sideband", 0.0, 1.0)] = 5e-4
    tolerance: Annotated[float, Quantity("-", "error of the believed impedances", 0.0, 1.0)] = 0.06
    balance: Annotated[float, Quantity("-", "thresholds of head over torque", 0.1, 100.0)] = 1.5
    symbols: SymbolSettings = field(default_factory=SymbolSettings)
    logic: LogicSettings = field(default_factory=lambda: LogicSettings(hold=0.5, latch=("G6",)))


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class EventScheme:
    """The scheme of one machine; `teach_events` makes it.

    Parameters
    ----------
    monitor : PumpMonitor
        Commissioned and taught: maps and learned thresholds of the residuals.
    reference : complex
        Healthy fault coefficient.
    coefficient, sideband : float
        Thresholds of yZn (at rest, without unbalance) and of ymc.
    flux : float
        Voltage over frequency that was taught, V s.
    rises : tuple of float
        Rise of the thresholds of yZn and of yLT (N m) with the activity.
    settings : EventSettings
        How it was made.
    """

    monitor: PumpMonitor
    reference: complex
    coefficient: float
    sideband: float
    flux: float
    rises: tuple[float, float]
    settings: EventSettings

    def thresholds(self, f: Features) -> Array:
        """Thresholds of the signals over a run.

        Parameters
        ----------
        f : Features
            The run.

        Returns
        -------
        ndarray, shape (n, 6)
            In the units of the signals.
        """
        assert self.monitor.threshold is not None
        learned, own = self.monitor.threshold.at(f.activity), self.settings
        head = own.balance * self.monitor.threshold.k0[1] * f.exchange
        away = 2 * own.margin * own.tolerance * f.torque * np.abs(f.flux / self.flux - 1.0)
        torque = learned[:, 1] + away
        with np.errstate(invalid="ignore"):
            balanced = np.where(np.isfinite(head), np.maximum(learned[:, 0], head), learned[:, 0])
        return np.column_stack((
            self.coefficient + self.rises[0] * f.activity + own.margin * own.tolerance * f.leverage * f.unbalance,
            np.full(len(f.t), self.sideband),
            self.monitor.threshold.k0[1] + self.rises[1] * f.activity,
            torque,
            balanced,
            np.maximum(own.balance * torque, learned[:, 2] + away),
        ))  # fmt: skip

    def deviations(self, f: Features) -> Array:
        """Signals in units of their thresholds.

        Parameters
        ----------
        f : Features
            The run.

        Returns
        -------
        ndarray, shape (n, 6)
            NaN where a signal says nothing.
        """
        return np.asarray(_values(f, self.reference) / self.thresholds(f))

    def judge(self, f: Features) -> "Told":
        """Symbols and decisions of a run.

        Parameters
        ----------
        f : Features
            The run.

        Returns
        -------
        Told
        """
        z = self.deviations(f)
        usable, rest = f.usable & np.isfinite(z), f.rest & np.isfinite(z)
        dt = float(f.t[1] - f.t[0])
        seen = EventSymbols(SIGNED, dt, self.settings.symbols).run(f.t, z, usable, rest)
        table = pump_table()
        every = np.full((len(seen), len(table.signals)), UNKNOWN, np.int8)
        every[:, [table.signals.index(name) for name in SIGNALS]] = seen
        decisions = DecisionLogic(table, self.settings.logic).run(f.t, every)
        return Told(t=f.t, names=SIGNALS, z=z, symbols=seen, decisions=decisions)


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Told:
    """What the scheme says about a run.

    Parameters
    ----------
    t : ndarray, shape (n,)
        Time, s.
    names : tuple of str
        Signals.
    z : ndarray, shape (n, 6)
        Deviations in thresholds; NaN where a signal says nothing.
    symbols : ndarray of int8, shape (n, 6)
        -1, 0, 1 or `pumplib.propagation.decision.UNKNOWN`.
    decisions : DecisionRecord
        Verdicts, and what is acted on.
    """

    t: Array
    names: tuple[str, ...]
    z: Array
    symbols: Array
    decisions: DecisionRecord


@cache
def pump_table() -> DecisionTable:
    """Decision table of the pump for the four sensors and the default scenario.

    Returns
    -------
    DecisionTable
    """
    pump = shipped("pump")
    effects = propagate(pump).narrow(disturbances=pump.scenario("D_B").disturbances)
    return compile_table(effects, SENSORS, GROUPS)


def _values(f: Features, reference: complex) -> Array:
    out = f.values.copy()
    out[:, 0] = np.where(f.usable[:, 0], 3 * np.abs(f.g - reference), np.nan)
    return out


def teach_events(
    monitor: PumpMonitor, healthy: Sequence[Features], settings: EventSettings | None = None
) -> EventScheme:
    """Learn the thresholds that the residual monitor has not learned.

    Parameters
    ----------
    monitor : PumpMonitor
        Commissioned and taught.
    healthy : sequence of Features
        Of healthy runs.
    settings : EventSettings, optional
        How.

    Returns
    -------
    EventScheme

    Raises
    ------
    DataError
        If the monitor was not taught, or there is too little rest.
    """
    own = settings or EventSettings()
    if monitor.threshold is None:
        raise DataError("teach_events: the monitor has no thresholds; teach it with the healthy runs first.")

    def gather(column: int, values: Sequence[Array], chosen: Sequence[Array]) -> tuple[Array, Array]:
        found = [v[one[:, column]] for v, one in zip(values, chosen, strict=True)]
        return np.concatenate(found), np.concatenate(
            [f.activity[o[:, column]] for f, o in zip(healthy, chosen, strict=True)]
        )

    usable, rest = [f.usable for f in healthy], [f.rest for f in healthy]
    if min(sum(int(one[:, k].sum()) for one in rest) for k in range(len(SIGNALS))) < LEAST:
        raise DataError(
            f"teach_events: fewer than {LEAST} samples of a signal at rest in the healthy runs; record longer, or "
            "more runs."
        )
    resting, _ = gather(0, [f.g for f in healthy], rest)
    reference = complex(resting.mean())
    coefficient = max(own.margin * 3 * float(np.abs(resting - reference).max()), own.smallest)
    g, activity = gather(0, [f.g for f in healthy], usable)
    sideband, _ = gather(1, [f.values[:, 1] for f in healthy], rest)
    lack, active = gather(2, [f.values[:, 2] for f in healthy], usable)
    return EventScheme(
        monitor=monitor,
        reference=reference,
        coefficient=coefficient,
        sideband=max(own.margin * float(sideband.max()), own.ripple),
        flux=float(np.median(np.concatenate([f.flux[one[:, 0]] for f, one in zip(healthy, rest, strict=True)]))),
        rises=(
            own.margin * _steepest(3 * np.abs(g - reference) - coefficient, activity),
            own.margin * _steepest(lack - monitor.threshold.k0[1], active),
        ),
        settings=own,
    )


def _steepest(excess: Array, activity: Array) -> float:
    moving = activity > 0
    return float(np.max(excess[moving] / activity[moving], initial=0.0))
