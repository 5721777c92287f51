"""Thesis 4.4.1: from deviations to symbols: alarm, then a second look at all signals with a lower threshold.

As long as nothing is wrong a signal speaks up only when the integral of its excess over its threshold reaches a
limit: false alarms are bought dearly. Once one has, a fault is likely, and the question is which one. Then every
signal is read again: its mean since the alarm, less what it was before, beyond a share of the threshold. What lies
between "shows something" and "shows nothing" is unknown, so that a signal that reacts little is not held against a
fault. The change since before the alarm is free of what was there all along: a warm winding, a biased sensor.
"""

from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pumplib.errors import DataError, ParameterError
from pumplib.kernels import kernel
from pumplib.machines.quantity import Parameters, Quantity
from pumplib.propagation.decision import UNKNOWN

Array = NDArray[Any]
_BLOCKS = 20


@dataclass(frozen=True, kw_only=True, slots=True)
class SymbolSettings(Parameters):
    """How deviations become symbols; all times but `wait` count rest only.

    Parameters
    ----------
    limit : float
        Integral of the excess over the threshold, in thresholds, that raises an alarm.
    shows, nothing : float
        Reading, in thresholds, above which a signal shows its sign, and below which it shows nothing.
    wait : float
        Time after the alarm that is not read: the fault's own transient.
    needed : float
        Rest that a reading needs; until then only signals in alarm are known.
    memory : float
        Forgetting of readings.
    before : float
        Rest before the alarm that is compared with; it ends `gap` before the alarm.
    gap : float
        Rest before the alarm that may hold the fault already.
    """

    limit: Annotated[float, Quantity("s", "integral of the excess that raises an alarm", 0.0, 1e3, True)] = 0.1
    shows: Annotated[float, Quantity("-", "reading that shows something", 0.0, 1.0, True)] = 0.5
    nothing: Annotated[float, Quantity("-", "reading that shows nothing", 0.0, 1.0)] = 0.35
    wait: Annotated[float, Quantity("s", "transient after the alarm", 0.0, 1e3)] = 0.4
    needed: Annotated[float, Quantity("s", "rest that a reading needs", 0.0, 1e3, True)] = 0.6
    memory: Annotated[float, Quantity("s", "forgetting of readings", 0.0, 1e6, True)] = 5.0
    before: Annotated[float, Quantity("s", "rest before the alarm to compare with", 0.0, 1e6, True)] = 8.0
    gap: Annotated[float, Quantity("s", "rest before the alarm that may hold the fault", 0.0, 1e6)] = 1.6

    def _check_together(self) -> None:
        if self.nothing > self.shows:
            raise ParameterError(
                f"SymbolSettings.nothing = {self.nothing:g}: above shows = {self.shows:g}; a reading cannot show "
                "something and nothing."
            )


@kernel
def _symbols(t, z, usable, rest, signed, dt, limit, shows, nothing, wait, needed, keep, block, skip,  # type: ignore[no-untyped-def]
             up, down, ring, weight, place, state, level, mean, time, out):  # fmt: skip
    """state: 1 if reading, time of the alarm; place: block being filled."""
    signals = z.shape[1]
    for k in range(len(t)):
        alarm = False
        for x in range(signals):
            if not usable[k, x]:
                continue
            up[x] = max(up[x] + (z[k, x] - 1.0) * dt, 0.0)
            if up[x] > 2.0 * limit:
                up[x] = 2.0 * limit
            if signed[x]:
                down[x] = max(down[x] + (-z[k, x] - 1.0) * dt, 0.0)
                if down[x] > 2.0 * limit:
                    down[x] = 2.0 * limit
            alarm = alarm or up[x] >= limit or down[x] >= limit
        if state[0] == 0.0 and alarm:
            state[0], state[1] = 1.0, t[k]
            for x in range(signals):
                total, count = 0.0, 0.0
                if signed[x]:
                    for b in range(skip, ring.shape[0]):
                        j = (place[0] - b) % ring.shape[0]
                        total += ring[j, x]
                        count += weight[j, x]
                level[x] = total / count if count > 0.0 else 0.0
                mean[x], time[x] = 0.0, 0.0
        if state[0] == 0.0:
            full = False
            for x in range(signals):
                if rest[k, x]:
                    ring[place[0], x] += z[k, x]
                    weight[place[0], x] += 1.0
                    full = full or weight[place[0], x] * dt >= block
                out[k, x] = 0 if usable[k, x] else 2
            if full:
                place[0] = (place[0] + 1) % ring.shape[0]
                for x in range(signals):
                    ring[place[0], x], weight[place[0], x] = 0.0, 0.0
            continue
        over, enough = True, True
        for x in range(signals):
            if rest[k, x] and t[k] - state[1] >= wait:
                # mean with forgetting: the weight of all that was read so far is time[x]
                time[x] = keep * time[x] + dt
                mean[x] += dt / time[x] * (z[k, x] - level[x] - mean[x])
            if time[x] >= needed:
                size = abs(mean[x]) if signed[x] else mean[x]
                out[k, x] = 2
                if size > shows:
                    out[k, x] = 1 if mean[x] > 0.0 else -1
                elif size < nothing:
                    out[k, x] = 0
                over = over and size < shows
            else:
                enough = False
                out[k, x] = 2
                if up[x] >= limit:
                    out[k, x] = 1
                elif down[x] >= limit:
                    out[k, x] = -1
        if over and enough and not alarm:
            state[0] = 0.0
            for x in range(signals):
                up[x], down[x] = 0.0, 0.0


class EventSymbols:
    """Symbols of signals, sample by sample or in blocks; keeps its state between calls.

    Parameters
    ----------
    signed : array_like of bool, shape (signals,)
        Whether a signal has both signs.
    dt : float
        Sampling interval, s.
    settings : SymbolSettings, optional
        Limits and times.

    Raises
    ------
    ParameterError
        If the sampling interval is not positive or longer than the shortest time.
    """

    def __init__(self, signed: ArrayLike, dt: float, settings: SymbolSettings | None = None) -> None:
        self.settings = settings or SymbolSettings()
        if not 0.0 < dt <= self.settings.needed / 4:
            raise ParameterError(
                f"EventSymbols.dt = {dt:g} s: must be positive and at most a quarter of needed = "
                f"{self.settings.needed:g} s; sample faster."
            )
        self.signed, self.dt = np.asarray(signed, dtype=bool).reshape(-1), float(dt)
        self.reset()

    def reset(self) -> None:
        """Forget everything."""
        n = len(self.signed)
        self._up, self._down, self._level, self._mean, self._time = (np.zeros(n) for _ in range(5))
        self._ring, self._weight = np.zeros((_BLOCKS, n)), np.zeros((_BLOCKS, n))
        self._place, self._state = np.zeros(1, np.int64), np.zeros(2)

    def run(self, t: ArrayLike, z: ArrayLike, usable: ArrayLike, rest: ArrayLike) -> Array:
        """Take a block of samples.

        Parameters
        ----------
        t : array_like, shape (n,)
            Time, s.
        z : array_like, shape (n, signals)
            Deviations in thresholds.
        usable, rest : array_like of bool, shape (n, signals)
            Whether a signal says something, and whether it says it at rest.

        Returns
        -------
        ndarray of int8, shape (n, signals)
            -1, 0, 1 or `pumplib.propagation.decision.UNKNOWN`.

        Raises
        ------
        DataError
            If shapes do not fit or a usable deviation is not finite.
        """
        at, deviation = np.asarray(t, dtype=float).reshape(-1), np.asarray(z, dtype=float)
        good, still = np.asarray(usable, dtype=bool), np.asarray(rest, dtype=bool)
        shape = (len(at), len(self.signed))
        for name, array in (("z", deviation), ("usable", good), ("rest", still)):
            if array.shape != shape:
                raise DataError(f"EventSymbols: {name} has shape {array.shape}, must be {shape}: times, signals.")
        if not np.isfinite(deviation[good]).all() or (still & ~good).any():
            raise DataError("EventSymbols: a usable deviation is not finite, or a signal rests that is not usable.")
        out = np.full(shape, UNKNOWN, np.int8)
        own = self.settings
        block = own.before / (_BLOCKS - 4)
        _symbols(
            at, deviation, good, still, self.signed, self.dt, own.limit, own.shows, own.nothing, own.wait, own.needed,
            float(np.exp(-self.dt / own.memory)), block, max(1, round(own.gap / block)), self._up, self._down,
            self._ring, self._weight, self._place, self._state, self._level, self._mean, self._time, out,
        )  # fmt: skip
        return out
