"""Thesis 4.4.1: the decision over time: young alarms, hold time, latched groups; for records and sample by sample."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pumplib.errors import DataError, ParameterError
from pumplib.kernels import kernel
from pumplib.machines.quantity import Parameters, Quantity
from pumplib.propagation.decision import UNKNOWN, DecisionTable, Verdict

Array = NDArray[Any]


@dataclass(frozen=True, kw_only=True, slots=True)
class LogicSettings(Parameters):
    """How verdicts become decisions.

    Parameters
    ----------
    settle : float
        Age up to which an alarm is young, s. While one is, signals that show nothing count as unknown: they may be
        about to react, only slower.
    hold : float
        Time for which a verdict has to stay the same before it is acted on, s.
    latch : tuple of str
        Groups acted on at once when certain, and until the operator's reset.
    """

    settle: Annotated[float, Quantity("s", "age up to which an alarm is young", 0.0, 1e7)] = 0.0
    hold: Annotated[float, Quantity("s", "time for which a verdict has to stay", 0.0, 1e7)] = 0.0
    latch: tuple[str, ...] = ()


@dataclass(frozen=True, kw_only=True, slots=True)
class Decision:
    """State of the logic after one sample.

    Parameters
    ----------
    t : float
        Time, s.
    verdict : Verdict
        What the symbols say now.
    acted : Verdict
        What to act on: the last verdict that stayed long enough, or the one that was latched.
    latched : bool
        Whether it is latched.
    """

    t: float
    verdict: Verdict
    acted: Verdict
    latched: bool


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class DecisionRecord:
    """Decisions over a record.

    Parameters
    ----------
    t : ndarray, shape (n,)
        Time, s.
    verdicts : tuple of Verdict
        Every verdict that occurs.
    verdict, acted : ndarray of int, shape (n,)
        Positions in `verdicts`.
    latched : ndarray of bool, shape (n,)
        Whether the acted one is latched.
    """

    t: Array
    verdicts: tuple[Verdict, ...]
    verdict: Array
    acted: Array
    latched: Array

    def __getitem__(self, k: int) -> Decision:
        return Decision(
            t=float(self.t[k]),
            verdict=self.verdicts[self.verdict[k]],
            acted=self.verdicts[self.acted[k]],
            latched=bool(self.latched[k]),
        )

    def first_alarm(self) -> Decision | None:
        """First sample whose acted verdict is an alarm.

        Returns
        -------
        Decision or None
            None if there is none.
        """
        alarm = np.array([verdict.alarm for verdict in self.verdicts], bool)[self.acted]
        return self[int(np.argmax(alarm))] if alarm.any() else None


@kernel
def _known_now(t, y, settle, sign, since, out):  # type: ignore[no-untyped-def]
    """Replace "shows nothing" by "unknown" while another signal's alarm is young."""
    for k in range(len(t)):
        young = False
        for x in range(y.shape[1]):
            value = y[k, x]
            if value != UNKNOWN:  # a gap does not make an alarm new
                if value != sign[x]:
                    sign[x] = value
                    since[x] = t[k]
                young = young or (value != 0 and t[k] - since[x] < settle)
        for x in range(y.shape[1]):
            out[k, x] = UNKNOWN if young and y[k, x] == 0 else y[k, x]


@kernel
def _held(t, which, latching, hold, state, start, acted, latched):  # type: ignore[no-untyped-def]
    """Follow the verdicts; state: pending, acted, latched or -1; start[0]: since when it is pending."""
    for k in range(len(t)):
        if which[k] != state[0]:
            state[0] = which[k]
            start[0] = t[k]
        if t[k] - start[0] >= hold:
            state[1] = which[k]
        if latching[which[k]] and state[2] < 0:
            state[2] = which[k]
        acted[k] = state[2] if state[2] >= 0 else state[1]
        latched[k] = state[2] >= 0


class DecisionLogic:
    """Decision logic over time; keeps its state between calls, batch and stream agree.

    Parameters
    ----------
    table : DecisionTable
        Compiled table.
    settings : LogicSettings, optional
        Times and latched groups; by default the table alone decides.

    Raises
    ------
    ParameterError
        If a group to latch is not in the table.
    """

    def __init__(self, table: DecisionTable, settings: LogicSettings | None = None) -> None:
        self.table, self.settings = table, settings or LogicSettings()
        for name in self.settings.latch:
            if name not in table.names:
                raise ParameterError(f"LogicSettings.latch: {name!r} is not in the table; it has {table.names}.")
        self.reset()

    def reset(self) -> None:
        """Start anew: no alarm, no memory; nothing is acted on until a first verdict has stayed."""
        signals = len(self.table.signals)
        self._last = -np.inf
        self._sign, self._since = np.zeros(signals, np.int8), np.full(signals, -np.inf)
        self._number: dict[Verdict, int] = {Verdict(status="fault free"): 0}
        self._state, self._start = np.array([-1, 0, -1], np.int64), np.full(1, -np.inf)

    def acknowledge(self) -> None:
        """Operator's reset of what is latched; it comes back at once if it is still certain."""
        self._state[2] = -1

    def run(self, t: ArrayLike, symbols: ArrayLike) -> DecisionRecord:
        """Take a block of samples.

        Parameters
        ----------
        t : array_like, shape (n,)
            Time, increasing, s.
        symbols : array_like of int, shape (n, signals)
            -1, 0, 1 or `pumplib.propagation.decision.UNKNOWN`, in the order of the table's signals.

        Returns
        -------
        DecisionRecord

        Raises
        ------
        DataError
            If the times do not increase, or the shape or a symbol is wrong.
        """
        y, at = self.table.check(symbols), np.atleast_1d(np.asarray(t, float))
        if at.shape != (len(y),):
            raise DataError(f"t: shape {at.shape}, symbols: {y.shape}; give one time a row.")
        steps = np.diff(at, prepend=self._last)
        if not np.all(np.isfinite(at)) or not np.all(steps > 0):
            k = int(np.argmax(~(steps > 0) | ~np.isfinite(at)))
            raise DataError(f"t = {at[k]:g} s, row {k}: times must be finite and increase; the one before is "
                            f"{at[k - 1] if k else self._last:g} s.")  # fmt: skip
        if len(at):
            self._last = float(at[-1])
        now = np.empty_like(y)
        _known_now(at, y, self.settings.settle, self._sign, self._since, now)
        which, found = self.table.decide_each(now)
        number = np.array([self._number.setdefault(one, len(self._number)) for one in found], np.int64)
        verdicts = tuple(self._number)
        latching = np.array([any(one.certain(name) for name in self.settings.latch) for one in verdicts], bool)
        acted, latched = np.empty(len(at), np.int64), np.empty(len(at), bool)
        verdict = number[which]
        _held(at, verdict, latching, self.settings.hold, self._state, self._start, acted, latched)
        return DecisionRecord(t=at, verdicts=verdicts, verdict=verdict, acted=acted, latched=latched)

    def update(self, t: float, symbols: Mapping[str, str | int] | ArrayLike) -> Decision:
        """Take one sample.

        Parameters
        ----------
        t : float
            Time, s.
        symbols : mapping of str to str or int, or array_like of int, shape (signals,)
            Symbols; signals that a mapping lacks are unknown.

        Returns
        -------
        Decision
        """
        row = self.table.pattern(symbols) if isinstance(symbols, Mapping) else np.asarray(symbols)
        return self.run(np.array([t]), row[None, :])[0]
