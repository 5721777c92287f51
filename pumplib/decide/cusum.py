"""Thesis 2.1.4, B.1: one- and two-sided CUSUM of many channels, for records and sample by sample.

With z = (r - mean)/sigma the two statistics are g+ = max(0, g+ + z - nu) and g- = max(0, g- - z - nu); an
alarm is raised when one of them exceeds h. The estimate of the onset is the sample after the last zero of
the statistic that raised the alarm: the most likely instant of a step.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pumplib.decide.checks import Missing, block, channel_names, one_of, sample
from pumplib.decide.strict import strict_inline, strict_kernel
from pumplib.errors import ParameterError
from pumplib.machines.quantity import Choice, Parameters, Quantity

Array = NDArray[Any]
Sides = Literal["up", "down", "both"]
AfterAlarm = Literal["restart", "stop", "continue"]
SIDES = ("up", "down", "both")
AFTER_ALARM = ("restart", "stop", "continue")
TILE = 256  # samples whose lines stay in the cache while channel after channel runs over them


@dataclass(frozen=True, kw_only=True, slots=True)
class CusumSettings(Parameters):
    """What the CUSUM of one channel is tuned to; `pumplib.decide.design.design` finds `nu` and `h`.

    References
    ----------
    Thesis 2.1.4, B.1. E. S. Page, Continuous inspection schemes, Biometrika 41 (1954). M. Basseville and
    I. V. Nikiforov, Detection of Abrupt Changes (1993), section 2.2.
    """

    sigma: Annotated[
        float, Quantity("unit of r", "standard deviation of the healthy residual", 0.0, open_low=True,
                        hint="Take it from a healthy record.")
    ]  # fmt: skip
    nu: Annotated[float, Quantity("sigma", "drift: half the smallest change to detect", 0.0, 100.0)]
    h: Annotated[float, Quantity("sigma", "threshold of the statistic", 0.0, 1e6, True)]
    mean: Annotated[float, Quantity("unit of r", "mean of the healthy residual", -np.inf)] = 0.0
    sides: Annotated[Sides, Choice("direction of the change", SIDES)] = "both"


@dataclass(frozen=True, kw_only=True, slots=True)
class Alarm:
    """One alarm of one channel.

    Parameters
    ----------
    channel : str
        Name of the channel.
    sample : int
        Index of the sample that raised it, counted from the start of the stream.
    side : {"up", "down"}
        Direction of the change.
    onset : int
        Estimated first sample of the change: the sample after the statistic's last zero.
    statistic : float
        Value of the statistic, sigma.
    """

    channel: str
    sample: int
    side: Literal["up", "down"]
    onset: int
    statistic: float

    def times(self, dt: float) -> tuple[float, float]:
        """Time of the alarm and estimated time of the onset.

        Parameters
        ----------
        dt : float
            Sampling interval, s.

        Returns
        -------
        tuple of float
            Both in s from the start of the stream.
        """
        return self.sample * dt, self.onset * dt


@dataclass(frozen=True, kw_only=True, eq=False, slots=True)
class CusumResult:
    """Outcome of a block of samples.

    Parameters
    ----------
    alarms : tuple of Alarm
        In the order of their samples, then of the channels.
    up, down : ndarray, shape (n, channels)
        Statistics g+ and g- after each sample (before a restart), sigma; without rows if no trace was asked for.
        Zero on a side that is not watched.
    """

    alarms: tuple[Alarm, ...]
    up: Array
    down: Array

    def first(self, channel: str | None = None) -> Alarm | None:
        """First alarm, of one channel or of any.

        Parameters
        ----------
        channel : str, optional
            Name of the channel.

        Returns
        -------
        Alarm or None
        """
        return next((alarm for alarm in self.alarms if channel in (None, alarm.channel)), None)


@strict_inline
def cusum_step(g, deviation):  # type: ignore[no-untyped-def]
    """One step of Page's recursion: max(0, g + deviation), both in sigma.

    Parameters
    ----------
    g : float
        Statistic before the sample.
    deviation : float
        z - nu for a change upwards, -z - nu for one downwards.

    Returns
    -------
    float
        Statistic after the sample.
    """
    s = g + deviation
    return max(s, 0.0)


@strict_inline
def _keep(trace, k, c, up, down, watch):  # type: ignore[no-untyped-def]
    if trace.shape[0] > 0:
        trace[k, 0, c] = up if watch[0, c] else 0.0
        trace[k, 1, c] = down if watch[1, c] else 0.0


@strict_kernel
def _scan(x, c, k, end, first, mean, scale, nu, h_up, h_down, up, down, zero_up, zero_down, trace, watch):  # type: ignore[no-untyped-def]
    """Go on to the sample after the next crossing, or to a missing sample, or to the end."""
    crossed = False
    while k < end:
        r = x[k, c]
        if r != r:
            break
        z = (r - mean) * scale
        up = cusum_step(up, z - nu)
        down = cusum_step(down, -z - nu)
        zero_up = zero_up if up > 0.0 else first + k
        zero_down = zero_down if down > 0.0 else first + k
        _keep(trace, k, c, up, down, watch)
        k += 1
        if up > h_up or down > h_down:
            crossed = True
            break
    return k, crossed, up, down, zero_up, zero_down


@strict_kernel
def cusum_run(x, constants, watch, after, first, g, zero, above, stopped, missing, trace, events, peaks):  # type: ignore[no-untyped-def]
    """Run over a block and return the number of alarms; only those that fit are stored.

    Parameters
    ----------
    x : ndarray, shape (n, channels)
        Samples; NaN holds the channel's state and is counted.
    constants : ndarray, shape (4, channels)
        Mean, 1/sigma, nu, h.
    watch : ndarray of bool, shape (2, channels)
        Sides that are watched.
    after : int
        0 restart, 1 stop, 2 continue.
    first : int
        Index of the first sample.
    g, zero, above : ndarray, shape (2, channels)
        Statistic, sample of its last zero, whether it is above h; changed.
    stopped, missing : ndarray, shape (channels,)
        Whether a channel has stopped; count of missing samples; changed.
    trace : ndarray, shape (n or 0, 2, channels)
        Statistics after each sample.
    events : ndarray of int, shape (capacity, 4)
        Sample, channel, side, onset.
    peaks : ndarray, shape (capacity,)
        Statistic at the alarm.

    Returns
    -------
    int
    """
    n, channels = x.shape
    count = 0
    for begin in range(0, n, TILE):
        end = min(begin + TILE, n)
        for c in range(channels):
            mean, scale, nu = constants[0, c], constants[1, c], constants[2, c]
            h_up = constants[3, c] if watch[0, c] else np.inf
            h_down = constants[3, c] if watch[1, c] else np.inf
            up, down, zero_up, zero_down = g[0, c], g[1, c], zero[0, c], zero[1, c]
            k = begin
            while k < end:
                if stopped[c] or x[k, c] != x[k, c]:
                    missing[c] += x[k, c] != x[k, c]
                    _keep(trace, k, c, up, down, watch)
                    k += 1
                    continue
                # above the threshold every sample is looked at, else the quick scan runs to the next crossing
                last = k + 1 if above[0, c] or above[1, c] else end
                k, crossed, up, down, zero_up, zero_down = _scan(
                    x, c, k, last, first, mean, scale, nu, h_up, h_down, up, down, zero_up, zero_down, trace, watch
                )
                if not crossed:
                    above[0, c] = above[1, c] = False
                    continue
                raised = False
                for side in range(2):
                    value = up if side == 0 else down
                    now = value > (h_up if side == 0 else h_down)
                    if now and not above[side, c]:
                        raised = True
                        if count < peaks.shape[0]:
                            events[count, 0] = first + k - 1
                            events[count, 1] = c
                            events[count, 2] = side
                            events[count, 3] = (zero_up if side == 0 else zero_down) + 1
                            peaks[count] = value
                        count += 1
                    above[side, c] = now and after == 2
                if raised and after == 0:
                    up = down = 0.0
                    zero_up = zero_down = first + k - 1
                elif raised and after == 1:
                    stopped[c] = True
            g[0, c], g[1, c], zero[0, c], zero[1, c] = up, down, zero_up, zero_down
    return count


class Cusum:
    """CUSUM of one or many channels that keeps its state between calls.

    A record given in one piece, in pieces of any length or sample by sample gives the same numbers bit for bit.

    Parameters
    ----------
    settings : CusumSettings or sequence of CusumSettings
        One a channel; a single one serves one channel.
    names : sequence of str, optional
        Names of the channels; ``r1``, ``r2``, ... by default.
    after_alarm : {"restart", "stop", "continue"}
        Set the channel's statistics to zero and go on; stop the channel until `reset`; or let them run on, where
        the next alarm needs a new crossing of the threshold.
    missing : {"error", "hold"}
        Refuse NaN, or hold the channel's state over it and count it in `missing_samples`.

    Raises
    ------
    ParameterError
        If a setting, name or policy is wrong.

    References
    ----------
    Thesis 2.1.4, B.1. E. S. Page (1954). M. Basseville and I. V. Nikiforov (1993), sections 2.2 and 2.6.
    """

    def __init__(
        self,
        settings: CusumSettings | Sequence[CusumSettings],
        *,
        names: Sequence[str] | None = None,
        after_alarm: AfterAlarm = "restart",
        missing: Missing = "error",
    ) -> None:
        self.settings = (settings,) if isinstance(settings, CusumSettings) else tuple(settings)
        if not self.settings or not all(isinstance(one, CusumSettings) for one in self.settings):
            raise ParameterError("Cusum.settings: give one CusumSettings a channel, at least one.")
        one_of("Cusum", "after_alarm", after_alarm, AFTER_ALARM)
        one_of("Cusum", "missing", missing, ("error", "hold"))
        self.names = channel_names(names, len(self.settings))
        self.missing, self.after_alarm = missing, after_alarm
        self._after = AFTER_ALARM.index(after_alarm)
        self._constants = np.array([(s.mean, 1.0 / s.sigma, s.nu, s.h) for s in self.settings]).T.copy()
        self._watch = np.array([(s.sides != "down", s.sides != "up") for s in self.settings]).T.copy()
        self._room = 16
        self.reset()

    def reset(self) -> None:
        """Start anew: sample 0, statistics zero, no channel stopped."""
        n = len(self.settings)
        self._first = 0
        self._g: Array = np.zeros((2, n))
        self._zero: Array = np.full((2, n), -1, dtype=np.int64)
        self._above: Array = np.zeros((2, n), dtype=np.bool_)
        self._stopped: Array = np.zeros(n, dtype=np.bool_)
        self._missing: Array = np.zeros(n, dtype=np.int64)

    def clear(self, channel: str) -> None:
        """Acknowledge the alarm of one channel: its statistics start from zero at the present sample.

        Parameters
        ----------
        channel : str
            Name of the channel.

        Raises
        ------
        ParameterError
            If there is no such channel.
        """
        one_of("Cusum", "channel", channel, self.names)
        c = self.names.index(channel)
        self._g[:, c], self._zero[:, c] = 0.0, self._first - 1
        self._above[:, c], self._stopped[c] = False, False

    @property
    def samples(self) -> int:
        """Samples seen since the start."""
        return self._first

    @property
    def statistic(self) -> Array:
        """Present g+ and g-, shape (2, channels), sigma; zero on a side that is not watched."""
        return np.where(self._watch, self._g, 0.0)

    @property
    def stopped(self) -> tuple[str, ...]:
        """Channels that stopped at an alarm."""
        return tuple(name for name, yes in zip(self.names, self._stopped, strict=True) if yes)

    @property
    def missing_samples(self) -> dict[str, int]:
        """Missing samples over which each channel was held."""
        return dict(zip(self.names, self._missing.tolist(), strict=True))

    def update(self, values: ArrayLike) -> tuple[Alarm, ...]:
        """Take one sample.

        Parameters
        ----------
        values : array_like, shape (channels,) or a number for one channel
            Residuals in their units.

        Returns
        -------
        tuple of Alarm
            Alarms that this sample raised.

        Raises
        ------
        DataError
            If the shape is wrong or a value is not allowed; the state stays as it was.
        """
        return self._feed(sample(values, self.names, self._first, self.missing), False).alarms

    def run(self, values: ArrayLike, *, trace: bool = False) -> CusumResult:
        """Take a block of samples.

        Parameters
        ----------
        values : array_like, shape (n, channels) or (n,) for one channel
            Residuals in their units, time first.
        trace : bool
            Whether to keep the statistics after each sample.

        Returns
        -------
        CusumResult

        Raises
        ------
        DataError
            If the shape is wrong or a value is not allowed; the state stays as it was.
        """
        return self._feed(block(values, self.names, self._first, self.missing), trace)

    def _feed(self, x: Array, trace: bool) -> CusumResult:
        n, channels = x.shape
        kept = np.empty((n if trace else 0, 2, channels))
        state = (self._g, self._zero, self._above, self._stopped, self._missing)
        while True:
            new = tuple(part.copy() for part in state)
            events, peaks = np.empty((self._room, 4), dtype=np.int64), np.empty(self._room)
            count = cusum_run(x, self._constants, self._watch, self._after, self._first, *new, kept, events, peaks)
            if count <= self._room:
                break
            self._room = 2 * count  # more alarms than expected: run again with room for all
        self._g, self._zero, self._above, self._stopped, self._missing = new
        self._first += n
        order = np.lexsort((events[:count, 2], events[:count, 1], events[:count, 0])) if count else ()
        alarms = tuple(
            Alarm(
                channel=self.names[events[i, 1]],
                sample=int(events[i, 0]),
                side="down" if events[i, 2] else "up",
                onset=int(events[i, 3]),
                statistic=float(peaks[i]),
            )
            for i in order
        )
        return CusumResult(alarms=alarms, up=kept[:, 0], down=kept[:, 1])
