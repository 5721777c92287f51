"""Thesis 2.1.4, 8.1: debounce a raw decision: m of n samples or time, hold time, latch with operator reset."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pumplib.decide.checks import channel_names, flags, number, one_of
from pumplib.decide.strict import strict_kernel
from pumplib.errors import ParameterError
from pumplib.machines.quantity import Parameters, Quantity

Array = NDArray[Any]


@dataclass(frozen=True, kw_only=True, slots=True)
class PersistenceSettings(Parameters):
    """When a raw decision becomes an alarm, and when the alarm ends.

    The condition is met when at least `m` of the latest `n` samples are on and the on-time integral has reached
    `on_time`. The integral grows while the sample is on, falls at the same rate while it is off, and is kept
    between zero and twice `on_time`. The alarm ends `hold` after the condition was last met, or, with `latch`, at
    the operator's reset.

    Parameters
    ----------
    m, n : int
        At least m of the latest n samples; 1 of 1 asks nothing.
    on_time : float
        Integral of the on-time, s; 0 asks nothing.
    hold : float
        Time that the alarm outlasts its condition, s.
    latch : bool
        Whether the alarm stays until `Persistence.acknowledge`.
    """

    m: Annotated[int, Quantity("samples", "samples that must be on", 1, 1_000_000)] = 1
    n: Annotated[int, Quantity("samples", "length of the window", 1, 1_000_000)] = 1
    on_time: Annotated[float, Quantity("s", "integral of the on-time", 0.0, 1e7)] = 0.0
    hold: Annotated[float, Quantity("s", "time that the alarm outlasts its condition", 0.0, 1e7)] = 0.0
    latch: bool = False

    def _check_together(self) -> None:
        if self.m > self.n:
            raise ParameterError(f"PersistenceSettings.m = {self.m} of n = {self.n} samples: m must not exceed n.")
        if not isinstance(self.latch, bool):
            raise ParameterError(f"PersistenceSettings.latch = {self.latch!r}: must be True or False.")


@strict_kernel
def _persist(x, m, n, need, hold, latch, first, ring, count, integral, left, latched, out):  # type: ignore[no-untyped-def]
    samples, channels = x.shape
    for k in range(samples):
        place = (first + k) % n
        for c in range(channels):
            on = x[k, c]
            count[c] += np.int64(on) - np.int64(ring[place, c])
            ring[place, c] = on
            # the counter stops at twice the need, so that a long alarm does not take as long to end
            integral[c] = min(integral[c] + 1, 2 * need) if on else max(integral[c] - 1, 0)
            met = count[c] >= m and integral[c] >= need
            if met:
                left[c] = hold
                latched[c] = latch or latched[c]
                out[k, c] = True
            else:
                out[k, c] = latched[c] or left[c] > 0
                left[c] = max(left[c] - 1, 0)


class Persistence:
    """Debounce of one or many raw decisions; keeps its state between calls, batch and stream agree.

    Parameters
    ----------
    settings : PersistenceSettings
        Rule of all channels.
    dt : float
        Sampling interval, s.
    names : sequence of str, optional
        Names of the channels; one channel ``alarm`` by default.

    Raises
    ------
    ParameterError
        If an argument is wrong, or the times are longer than 1e9 samples.
    """

    def __init__(self, settings: PersistenceSettings, dt: float, *, names: Sequence[str] = ("alarm",)) -> None:
        number("Persistence", "dt", dt, Quantity("s", "sampling interval", 0.0, 1e6, True))
        if not isinstance(settings, PersistenceSettings):
            raise ParameterError(f"Persistence.settings = {settings!r}: must be PersistenceSettings.")
        self.settings, self.dt = settings, float(dt)
        self.names = channel_names(names, len(tuple(names)))
        if not self.names:
            raise ParameterError("Persistence.names is empty: give one name a channel.")
        count = Quantity("samples", "time in samples", 0.0, 1e9)
        self._need = int(np.ceil(number("Persistence", "on_time / dt", settings.on_time / dt, count) - 1e-9))
        self._hold = int(np.ceil(number("Persistence", "hold / dt", settings.hold / dt, count) - 1e-9))
        self.reset()

    def reset(self) -> None:
        """Start anew: no alarm, no memory."""
        channels = len(self.names)
        self._first = 0
        self._ring = np.zeros((self.settings.n, channels), dtype=np.bool_)
        self._count, self._integral, self._left = (np.zeros(channels, dtype=np.int64) for _ in range(3))
        self._latched = np.zeros(channels, dtype=np.bool_)

    def acknowledge(self, name: str | None = None) -> None:
        """Operator's reset of one channel or of all: the alarm ends and the evidence is counted anew.

        If the fault is still there the alarm comes back as soon as the rule is met again.

        Parameters
        ----------
        name : str, optional
            Channel; all by default.

        Raises
        ------
        ParameterError
            If there is no such channel.
        """
        if name is not None:
            one_of("Persistence", "name", name, self.names)
        chosen = np.array([name in (None, one) for one in self.names])
        self._ring[:, chosen] = False
        for part in (self._count, self._integral, self._left):
            part[chosen] = 0
        self._latched[chosen] = False

    def run(self, raw: ArrayLike) -> Array:
        """Take a block of raw decisions.

        Parameters
        ----------
        raw : array_like of bool, shape (n, channels) or (n,) for one channel
            Raw decisions, time first.

        Returns
        -------
        ndarray of bool, shape (n, channels)
            Alarms.

        Raises
        ------
        DataError
            If the entries are not Booleans or the shape is wrong.
        """
        x = flags(raw, self.names)
        out = np.empty(x.shape, dtype=np.bool_)
        s = self.settings
        _persist(
            x, s.m, s.n, self._need, self._hold, s.latch, self._first,
            self._ring, self._count, self._integral, self._left, self._latched, out,
        )  # fmt: skip
        self._first += len(x)
        return out

    def update(self, raw: ArrayLike) -> Array:
        """Take one sample of raw decisions.

        Parameters
        ----------
        raw : array_like of bool, shape (channels,) or one bool
            Raw decisions.

        Returns
        -------
        ndarray of bool, shape (channels,)
            Alarms.

        Raises
        ------
        DataError
            If the entries are not Booleans or the shape is wrong.
        """
        return self.run(np.atleast_1d(np.asarray(raw))[None, :])[0]
