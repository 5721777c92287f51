"""Thesis 4.3.4, 4.4.2: does physics contradict the FMEA tables? Every fault under every disturbing event.

Thresholds are set on healthy states: raw signals by a share of their size, compensated ones above everything that
healthy states show under the disturbing events of the scenario, at operating points of their own. A deviation
above its threshold whose sign the tables do not allow is a contradiction and names the entry.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pumplib.errors import ParameterError
from pumplib.events.physics import DISTURBANCES, FAULTS, Disturbance, OperatingPoint, draw_points, steady_state
from pumplib.events.signals import COMPENSATED, RAW, SIGNALS, Maps, Speed, fit_maps, measure, residuals
from pumplib.machines.parameters import Motor
from pumplib.machines.profiles import profile_machine
from pumplib.observers.stator_design import design_gain
from pumplib.propagation import Effects
from pumplib.propagation.symbols import MINUS, PLUS, ZERO, observable
from pumplib.testbench.machine import BenchMachine
from pumplib.testbench.scenario import draw_machine
from pumplib.testbench.simulate import STEP

Array = NDArray[Any]
RAW_SHARE = {"yI": 0.02, "yP": 0.02, "yw": 0.004, "yQ": 0.02, "ydp": 0.02}
"""Threshold of raw signals, share of the undisturbed value."""
RAW_FLOOR = {"ypin": 1e3, "yIn": 0.05, "yI0": 0.05}
"""Threshold of raw signals that are near zero in a healthy machine, Pa and A."""
MARGIN = 1.3
"""Factor on the largest healthy residual."""
DRIFT = (-0.04, 0.08)
"""Range of the stator resistance's relative drift, as in the bench profile; thresholds lie above it."""
FLOOR = {"yZn": 2e-3, "ymc": 2e-4, "yLT": 0.0, "yrT": 0.01, "yrH": 1500.0, "yrTH": 0.01, "yrpin": 0.0}
"""Smallest thresholds of the compensated signals (-, -, N m, N m, Pa, N m, Pa): the bias of the profile's pressure
sensor, and what is left of noise in a mean."""
NONE = "none"
SPEEDS = ("observer", "circuit")


@dataclass(frozen=True, kw_only=True, slots=True)
class Contradiction:
    """A deviation that the tables do not allow.

    Parameters
    ----------
    fault, disturbance, signal : str
        Case and signal.
    sign : str
        What physics shows, "+" or "-".
    allowed : str
        Symbols that the tables allow.
    deviation : float
        In units of the threshold.
    point : int
        Operating point.
    entries : tuple of str
        Table entries that lead from the fault or the disturbing event into the signal; all of the signal's if none
        does.
    """

    fault: str
    disturbance: str
    signal: str
    sign: str
    allowed: str
    deviation: float
    point: int
    entries: tuple[str, ...]

    def __str__(self) -> str:
        return (
            f"{self.fault} with {self.disturbance} at point {self.point}: {self.signal} goes {self.sign} "
            f"({self.deviation:.1f} thresholds), the tables allow {self.allowed}; entries: {'; '.join(self.entries)}"
        )


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Confrontation:
    """Outcome over faults, disturbing events and operating points.

    Parameters
    ----------
    faults, disturbances, signals : tuple of str
        Axes; the first fault and the first disturbing event are "none".
    sign : ndarray of int8, shape (faults, disturbances, points, signals)
        -1, 0, 1: deviation below, within, above the thresholds.
    deviation : ndarray, shape (faults, disturbances, points, signals)
        The same in thresholds.
    allowed : ndarray of uint8, shape (faults, disturbances, signals)
        Sets of symbols that the tables allow, see `pumplib.propagation.symbols`.
    thresholds : dict
        Of the compensated signals.
    contradictions : tuple of Contradiction
        Empty if physics and tables agree.
    """

    faults: tuple[str, ...]
    disturbances: tuple[str, ...]
    signals: tuple[str, ...]
    sign: Array
    deviation: Array
    allowed: Array
    thresholds: dict[str, float]
    contradictions: tuple[Contradiction, ...]

    @property
    def cases(self) -> int:
        """Steady states that were compared."""
        return int(np.prod(self.sign.shape[:3]))

    def shares(self) -> Array:
        """Share of the operating points at which each symbol was seen, disturbing events pooled.

        Returns
        -------
        ndarray, shape (signals, faults, 3)
            Of -, 0, +.
        """
        flat = self.sign.reshape(len(self.faults), -1, len(self.signals))
        return np.stack([np.mean(flat == s, axis=1).T for s in (-1, 0, 1)], axis=-1)

    def predicted(self) -> Array:
        """Symbols that the tables allow, disturbing events pooled.

        Returns
        -------
        ndarray of bool, shape (signals, faults, 3)
            Of -, 0, +.
        """
        pooled = np.bitwise_or.reduce(self.allowed, axis=1).T
        return np.stack([(pooled & code) != 0 for code in (MINUS, ZERO, PLUS)], axis=-1)

    def largest(self, fault: str, signal: str) -> float:
        """Largest deviation of a signal under a fault, over disturbing events and operating points.

        Parameters
        ----------
        fault, signal : str
            Of `faults` and `signals`.

        Returns
        -------
        float
            In thresholds, with its sign.
        """
        found = self.deviation[self.faults.index(fault), ..., self.signals.index(signal)].ravel()
        return float(found[np.argmax(np.abs(found))])


CELL_SIGNALS = ("yI", "yP", "yw", "yQ", "ydp", "ypin", "yrT", "yrH", "yrTH", "yLT", "yrpin")
CELL_FAULTS = ("HY1", "HY2", "HY3", "HY4", "MP3", "MM1", "MP2", "IN1")


def ambiguous_cells(
    effects: Effects, signals: Iterable[str] = CELL_SIGNALS, faults: Iterable[str] = CELL_FAULTS
) -> tuple[int, int]:
    """Fault cells whose sign the tables leave open, and all cells.

    Parameters
    ----------
    effects : Effects
        Propagated tables.
    signals, faults : iterable of str
        Cells to count: eleven signals that have a sign, eight faults of pump and bearings.

    Returns
    -------
    ambiguous, cells : int
    """
    chosen = effects.narrow(signals=tuple(signals), faults=tuple(faults))
    return int(chosen.ambiguous.sum()), int(chosen.ambiguous.size)


def confront(
    effects: Effects,
    disturbances: Iterable[str],
    rng: np.random.Generator,
    *,
    points: int = 6,
    faults: Iterable[str] | None = None,
    training: int = 16,
    speed: Speed = "observer",
) -> Confrontation:
    """Compare the bench with the tables.

    Parameters
    ----------
    effects : Effects
        Propagated tables, frozen.
    disturbances : iterable of str
        Disturbing events of the scenario, see `pumplib.events.physics.DISTURBANCES`.
    rng : Generator
        Source of randomness: machine and operating points.
    points : int
        Operating points a case.
    faults : iterable of str, optional
        See `pumplib.events.physics.FAULTS`; all that the effects know if left out.
    training : int
        Operating points for maps and thresholds.
    speed : {"observer", "circuit"}
        Speed and torque from the observer of chapter 5, or from the plain equivalent circuit, which takes the
        current of a short for load.

    Returns
    -------
    Confrontation

    Raises
    ------
    ParameterError
        If the bench cannot act out a fault or an event, or numbers are too small.
    """
    if speed not in SPEEDS:
        raise ParameterError(f"confront: speed = {speed!r}: must be one of {', '.join(SPEEDS)}.")
    if points < 1 or training < 8:
        raise ParameterError(f"confront: points = {points}, training = {training}: at least 1 and 8 are needed.")
    chosen = tuple(faults) if faults is not None else tuple(name for name in FAULTS if name in effects.faults)
    events = tuple(disturbances)
    for names, known in ((chosen, tuple(FAULTS)), (events, tuple(DISTURBANCES))):
        for name in names:
            if name not in known:
                raise ParameterError(f"confront: the bench cannot act out {name!r}; it knows {', '.join(known)}.")
    bench = _Bench(draw_machine("pump", rng), profile_machine("pump").motor, rng, speed)
    maps, thresholds = _taught(bench, events, draw_points(training, rng))
    kept = tuple(name for name in SIGNALS if name in effects.signals)
    at = [effects.signals.index(name) for name in kept]
    places = draw_points(points, rng)
    sign = np.zeros((len(chosen) + 1, len(events) + 1, points, len(kept)), np.int8)
    size = np.zeros(sign.shape)
    allowed = np.zeros((len(chosen) + 1, len(events) + 1, len(kept)), np.uint8)
    for k, place in enumerate(places):
        healthy = bench.measure(place, Disturbance(), {})
        for f, fault in enumerate((NONE, *chosen)):
            for d, event in enumerate((NONE, *events)):
                condition = DISTURBANCES[event] if event != NONE else Disturbance()
                found = bench.measure(place, condition, FAULTS.get(fault, {}))
                size[f, d, k] = _deviations(found, healthy, maps, thresholds, kept)
    sign[...] = np.sign(size) * (np.abs(size) > 1.0)
    for f, fault in enumerate((NONE, *chosen)):
        column = effects.faults.index(fault) if fault != NONE else None
        may = effects.may[at, column] if column is not None else np.zeros(len(kept), np.uint8)
        for d, event in enumerate((NONE, *events)):
            hit = (
                effects.hits[at, effects.disturbances.index(event)] if event != NONE else np.zeros(len(kept), np.uint8)
            )
            # a fault of this size need not be above every threshold, so that "nothing" is always allowed here
            allowed[f, d] = observable(np.zeros(len(kept), np.uint8), may, hit)
    found_wrong = _contradictions(effects, (NONE, *chosen), (NONE, *events), kept, sign, size, allowed)
    return Confrontation(
        faults=(NONE, *chosen), disturbances=(NONE, *events), signals=kept, sign=sign, deviation=size, allowed=allowed,
        thresholds=thresholds, contradictions=found_wrong,
    )  # fmt: skip


class _Bench:
    """A machine whose winding is a little different in every state, and what is measured on it."""

    def __init__(self, machine: BenchMachine, motor: Motor, rng: np.random.Generator, speed: Speed) -> None:
        self.machine, self.motor, self.rng, self.speed = machine, motor, rng, speed
        self.gain = design_gain(motor, 1 / STEP)[0]

    def measure(
        self, place: OperatingPoint, condition: Disturbance, fault: Mapping[str, float], drift: float | None = None
    ) -> dict[str, float]:
        drift = self.rng.uniform(*DRIFT) if drift is None else drift
        return measure(steady_state(self.machine, place, condition, fault, drift), self.motor, self.gain, self.speed)


def _taught(
    bench: _Bench, events: tuple[str, ...], places: tuple[OperatingPoint, ...]
) -> tuple[Maps, dict[str, float]]:
    """Maps and thresholds from healthy states with and without disturbing events."""
    calm = [bench.measure(place, Disturbance(), {}) for place in places]
    maps = fit_maps(calm, bench.motor)
    # thresholds have to lie above the drift of the winding, so its ends are taught in turns
    turns = [(place, DRIFT[k % 2]) for k, place in enumerate(places)]
    disturbed = [bench.measure(place, DISTURBANCES[event], {}, end) for event in events for place, end in turns]
    largest = dict(FLOOR)
    for found in (*calm, *disturbed):
        values = residuals(found, maps) | {"yZn": found["yZn"], "ymc": found["ymc"]}
        for name in COMPENSATED:
            largest[name] = max(largest[name], MARGIN * abs(values[name]))
    # torque below the closed valve's and the pressure at the source have thresholds of their own
    return maps, largest | {"yLT": 0.0, "yrpin": 1e3}


def _deviations(
    found: dict[str, float], healthy: dict[str, float], maps: Maps, thresholds: dict[str, float], kept: tuple[str, ...]
) -> Array:
    """Deviations in thresholds: from the undisturbed state for raw signals, from zero for compensated ones."""
    values = residuals(found, maps) | {"yZn": found["yZn"], "ymc": found["ymc"]}
    out = []
    for name in kept:
        if name in RAW:
            threshold = RAW_FLOOR.get(name) or RAW_SHARE[name] * abs(healthy[name])
            out.append((found[name] - healthy[name]) / threshold)
        elif name == "yLT":
            out.append(2.0 if values["yLT"] > 0 else 0.0)
        else:
            out.append(values[name] / thresholds[name])
    return np.array(out)


def _contradictions(
    effects: Effects, faults: tuple[str, ...], events: tuple[str, ...], signals: tuple[str, ...], sign: Array,
    size: Array, allowed: Array,
) -> tuple[Contradiction, ...]:  # fmt: skip
    bit = np.where(sign > 0, PLUS, np.where(sign < 0, MINUS, 0)).astype(np.uint8)
    wrong = (sign != 0) & ((bit & allowed[:, :, None, :]) == 0)
    found = []
    for f, d, k, s in np.argwhere(wrong):
        marks = ((int(MINUS), "-"), (int(PLUS), "+"))
        symbols = "".join(mark for code, mark in marks if int(allowed[f, d, s]) & code)
        found.append(
            Contradiction(
                fault=faults[f], disturbance=events[d], signal=signals[s], sign="+" if sign[f, d, k, s] > 0 else "-",
                allowed=symbols or "0", deviation=float(abs(size[f, d, k, s])), point=int(k),
                entries=_entries(effects, faults[f], events[d], signals[s]),
            )
        )  # fmt: skip
    return tuple(found)


def _entries(effects: Effects, fault: str, event: str, signal: str) -> tuple[str, ...]:
    """Table entries into a signal whose cause the fault or the disturbing event can raise."""
    system = effects.system
    raised = {one.event for one in system.fault(fault).effects} if fault != NONE else set()
    raised |= {one.event for one in system.disturbance(event).effects} if event != NONE else set()
    waiting = list(raised)
    while waiting:
        now = waiting.pop()
        new = {edge.effect for edge in system.edges if edge.cause == now and edge.kind == "effect"} - raised
        raised |= new
        waiting += new
    last = [edge for edge in system.edges if edge.effect in system.signal(signal).symbols]
    leading = [edge for edge in last if edge.cause in raised and edge.kind == "effect"]
    return tuple(f"{edge.component}: {edge.id}" for edge in leading or last)
