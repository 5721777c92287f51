"""Thesis 4.4.1: decision logic compiled from the tables: which groups of faults explain the symbols of the signals.

A fault stays a hypothesis as long as every known signal shows a symbol that the fault, with any disturbing events,
can show. The true one is therefore never dropped, and two that Theorem 4 tells apart are never left together. A
signal that is not known says nothing.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import combinations, product
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pumplib.errors import DataError, ParameterError
from pumplib.propagation.build import Effects
from pumplib.propagation.symbols import ANY, MINUS, PLUS, ZERO, observable, separating

Array = NDArray[Any]
Status = Literal["fault free", "no alarm", "isolated", "ambiguous", "multiple", "inconsistent"]
UNKNOWN = 2
"""Symbol of a signal that is not known; the others are -1, 0 and 1."""
SYMBOLS: dict[str, int] = {"+": 1, "-": -1, "0": 0, "?": UNKNOWN}
_BIT = np.array([MINUS, ZERO, PLUS, ANY], np.uint8)  # of the symbols -1, 0, 1, UNKNOWN
_WRITTEN = ((ZERO, "0"), (PLUS, "+"), (MINUS, "-"))


@dataclass(frozen=True, kw_only=True, slots=True)
class Verdict:
    """What the symbols say.

    Parameters
    ----------
    status : str
        "fault free": nothing has to be wrong, and what could be would show. "no alarm": nothing has to be wrong, but
        the candidates cannot be excluded, as signals are unknown. "isolated": one group explains the symbols.
        "ambiguous": each of several groups does. "multiple": no single group does, each candidate set together
        does. "inconsistent": nothing in the table does (a fault outside it, or a sensor).
    candidates : tuple of tuple of str
        Groups, or sets of groups, that explain the symbols.
    """

    status: Status
    candidates: tuple[tuple[str, ...], ...] = ()

    @property
    def alarm(self) -> bool:
        """Whether something is wrong for certain."""
        return self.status not in ("fault free", "no alarm")

    def certain(self, group: str) -> bool:
        """Whether a group is present for certain: in every candidate of an alarm.

        Parameters
        ----------
        group : str
            Group.

        Returns
        -------
        bool
        """
        return self.alarm and bool(self.candidates) and all(group in one for one in self.candidates)

    def __str__(self) -> str:
        names = " or ".join("+".join(one) for one in self.candidates)
        return f"{self.status}: {names}" if names else self.status


@dataclass(frozen=True, kw_only=True, eq=False)
class DecisionTable:
    """Compiled decision logic; make it with `compile_table`.

    Parameters
    ----------
    signals : tuple of str
        Signals that the sensors give.
    two_sided : ndarray of bool, shape (signals,)
        Whether a signal has both signs.
    faults, groups : tuple of str
        Faults, and the group of each.
    must, may : ndarray of uint8, shape (signals, m)
        Pulls of each fault.
    hit : ndarray of uint8, shape (signals,)
        Pulls of the disturbing events.
    cancels : ndarray of bool, shape (signals,)
        Signals that are the size of a phasor: two pulls in the same direction can cancel, too.
    covered : tuple of str
        Groups that the sensors detect for certain, whatever the disturbing events do (Theorem 4).
    max_multiple : int
        Most groups that are looked at together when no single one explains the symbols.
    """

    signals: tuple[str, ...]
    two_sided: Array
    faults: tuple[str, ...]
    groups: tuple[str, ...]
    must: Array
    may: Array
    hit: Array
    cancels: Array
    covered: tuple[str, ...]
    max_multiple: int = 3
    shown: Array = field(init=False)
    none: Array = field(init=False)
    _known: dict[bytes, Verdict] = field(init=False, default_factory=dict, repr=False)

    def __post_init__(self) -> None:
        shown = observable(self.must, self.may, self.hit[:, None])
        shown[self.cancels & (self.hit != 0)] = ANY
        object.__setattr__(self, "shown", shown)
        object.__setattr__(self, "none", observable(np.zeros_like(self.hit), np.zeros_like(self.hit), self.hit))

    @property
    def names(self) -> tuple[str, ...]:
        """Groups, each once."""
        return tuple(dict.fromkeys(self.groups))

    @property
    def informative(self) -> tuple[str, ...]:
        """Signals of which not every symbol fits every hypothesis."""
        full = np.where(self.two_sided, ANY, ZERO | PLUS)
        says = np.any(self.shown & full[:, None] != full[:, None], axis=1) | (self.none & full != full)
        return tuple(name for name, yes in zip(self.signals, says, strict=True) if yes)

    def symbols(self, group: str | None, signal: str) -> str:
        """Cell of the table for people.

        Parameters
        ----------
        group : str or None
            Group; None for no fault.
        signal : str
            Signal.

        Returns
        -------
        str
            Symbols that fit, such as ``"-"`` or ``"0+"``; ``"*"`` for all.

        Raises
        ------
        ParameterError
            If the table has no such group or signal.
        """
        if signal not in self.signals:
            raise ParameterError(f"signal {signal!r}: not in the table; it has {', '.join(self.signals)}.")
        row = self.signals.index(signal)
        codes = (
            self.shown[row, [one == group for one in self.groups]] if group is not None else self.none[row : row + 1]
        )
        if not len(codes):
            raise ParameterError(f"group {group!r}: not in the table; it has {', '.join(self.names)}.")
        code = int(np.bitwise_or.reduce(codes))
        full = ANY if self.two_sided[row] else ZERO | PLUS
        return "*" if code & full == full else "".join(symbol for bit, symbol in _WRITTEN if code & bit)

    def pattern(self, symbols: Mapping[str, str | int]) -> Array:
        """Row of symbols from a mapping; signals that it lacks are unknown.

        Parameters
        ----------
        symbols : mapping of str to str or int
            ``{"yrH": "-"}``; "+", "-", "0", "?" or 1, -1, 0, `UNKNOWN`.

        Returns
        -------
        ndarray of int8, shape (signals,)

        Raises
        ------
        DataError
            If a signal or a symbol is not known.
        """
        row = np.full(len(self.signals), UNKNOWN, np.int8)
        for name, symbol in symbols.items():
            if name not in self.signals:
                raise DataError(f"signal {name!r}: not in the table; it has {', '.join(self.signals)}.")
            value = SYMBOLS.get(symbol) if isinstance(symbol, str) else symbol
            if value is None or value not in SYMBOLS.values():
                raise DataError(f"signal {name!r} = {symbol!r}: must be one of + - 0 ? or 1, -1, 0, {UNKNOWN}.")
            row[self.signals.index(name)] = value
        return row

    def check(self, patterns: ArrayLike) -> Array:
        """Check rows of symbols.

        Parameters
        ----------
        patterns : array_like of int, shape (n, signals)
            Symbols -1, 0, 1 or `UNKNOWN`.

        Returns
        -------
        ndarray of int8, shape (n, signals)

        Raises
        ------
        DataError
            If the shape or a symbol is wrong.
        """
        y = np.asarray(patterns)
        if y.ndim != 2 or y.shape[1] != len(self.signals) or y.dtype.kind not in "iu":
            raise DataError(
                f"symbols: {y.dtype} of shape {y.shape}; needs whole numbers, one column for each of "
                f"{', '.join(self.signals)}."
            )
        wrong = (y < -1) | (y > UNKNOWN) | ((y == -1) & ~self.two_sided)
        if wrong.any():
            k, x = (int(v) for v in np.argwhere(wrong)[0])
            allowed = "-1, 0, 1" if self.two_sided[x] else "0, 1"
            raise DataError(f"signal {self.signals[x]!r}, row {k}: {int(y[k, x])}; must be {allowed} or {UNKNOWN}.")
        return y.astype(np.int8)

    def fits(self, patterns: ArrayLike) -> tuple[Array, Array]:
        """Which hypotheses rows of symbols fit.

        Parameters
        ----------
        patterns : array_like of int, shape (n, signals)
            Symbols.

        Returns
        -------
        faults : ndarray of bool, shape (n, m)
            Fault fits.
        free : ndarray of bool, shape (n,)
            No fault fits.
        """
        bits = _BIT[self.check(patterns).astype(int) + 1]
        faults, free = np.ones((len(bits), len(self.faults)), bool), np.ones(len(bits), bool)
        for x in range(len(self.signals)):
            faults &= (bits[:, x, None] & self.shown[x]) != 0
            free &= (bits[:, x] & self.none[x]) != 0
        return faults, free

    def decide(self, patterns: ArrayLike) -> list[Verdict]:
        """Verdict for each row of symbols, by themselves: no hold times.

        Parameters
        ----------
        patterns : array_like of int, shape (n, signals)
            Symbols.

        Returns
        -------
        list of Verdict
        """
        which, verdicts = self.decide_each(patterns)
        return [verdicts[k] for k in which]

    def decide_each(self, patterns: ArrayLike) -> tuple[Array, list[Verdict]]:
        """As `decide`, every different verdict once.

        Parameters
        ----------
        patterns : array_like of int, shape (n, signals)
            Symbols.

        Returns
        -------
        which : ndarray of int, shape (n,)
            Position of each row's verdict.
        verdicts : list of Verdict
            Different verdicts.
        """
        rows, back = np.unique(self.check(patterns), axis=0, return_inverse=True)
        keys = [row.tobytes() for row in rows]
        new = [k for k, key in enumerate(keys) if key not in self._known]
        if new:
            faults, free = self.fits(rows[new])
            for k, fault, nothing in zip(new, faults, free, strict=True):
                self._known[keys[k]] = self._verdict(rows[k], fault, bool(nothing))
        number: dict[Verdict, int] = {}
        of_row = np.array([number.setdefault(self._known[key], len(number)) for key in keys], int)
        return of_row[back.ravel()], list(number)

    def _verdict(self, row: Array, fits: Array, free: bool) -> Verdict:
        groups = tuple(dict.fromkeys(name for name, yes in zip(self.groups, fits, strict=True) if yes))
        alone = tuple((name,) for name in groups)
        if free:
            hidden = tuple((name,) for name in groups if name in self.covered)
            return Verdict(status="no alarm", candidates=hidden) if hidden else Verdict(status="fault free")
        if alone:
            return Verdict(status="isolated" if len(alone) == 1 else "ambiguous", candidates=alone)
        together = self._together(_BIT[row.astype(int) + 1])
        return Verdict(status="multiple", candidates=together) if together else Verdict(status="inconsistent")

    def _together(self, bits: Array) -> tuple[tuple[str, ...], ...]:
        """Smallest sets of two or more groups, one fault of each, that explain the symbols."""
        members = {name: [k for k, one in enumerate(self.groups) if one == name] for name in self.names}
        for size in range(2, min(self.max_multiple, len(members)) + 1):
            found = []
            for names in combinations(self.names, size):
                picks = np.array(list(product(*(members[name] for name in names))))
                must = np.bitwise_or.reduce(self.must[:, picks], axis=2)
                may = np.bitwise_or.reduce(self.may[:, picks], axis=2)
                shown = observable(must, may, self.hit[:, None])
                pulling = np.count_nonzero(self.may[:, picks], axis=2) + (self.hit[:, None] != 0)
                shown[self.cancels[:, None] & (pulling > 1)] = ANY
                if np.all(shown & bits[:, None], axis=0).any():
                    found.append(names)
            if found:
                return tuple(found)
        return ()


def compile_table(
    effects: Effects, sensors: Iterable[str], groups: Sequence[str], max_multiple: int = 3
) -> DecisionTable:
    """Compile the decision logic for some sensors.

    Parameters
    ----------
    effects : Effects
        Of all faults, narrowed to the disturbing events to be tolerated and to the signals that are considered.
    sensors : iterable of str
        Sensors that are fitted.
    groups : sequence of str
        Groups that can be present, also those that the sensors do not cover.
    max_multiple : int
        Most groups that are looked at together when no single one explains the symbols.

    Returns
    -------
    DecisionTable

    Raises
    ------
    ParameterError
        If the sensors give no signal, or a sensor or group does not exist.
    """
    system = effects.system
    fitted, known = list(sensors), [sensor.id for sensor in system.sensors]
    for name in fitted:
        if name not in known:
            raise ParameterError(f"sensor {name!r}: not known; allowed are {', '.join(known)}.")
    signals = [name for name in effects.signals if system.signal(name).revealed(fitted)]
    if not signals:
        raise ParameterError(f"sensors = {', '.join(fitted) or 'none'}: give no signal; add a sensor.")
    member = {fault: name for name in groups for fault in system.group(name).faults}
    ordered = [fault for name in groups for fault in system.group(name).faults]
    chosen = effects.narrow(signals=signals, faults=ordered)
    alone = np.any(separating(chosen.must, chosen.may, chosen.hit)[1], axis=0)
    of = tuple(member[fault] for fault in ordered)
    sides = [{system.event(symbol).sign for symbol in system.signal(name).symbols} for name in signals]
    return DecisionTable(
        signals=tuple(signals),
        two_sided=np.array([len(one) == 2 for one in sides]),
        faults=tuple(ordered),
        groups=of,
        must=chosen.must,
        may=chosen.may,
        hit=chosen.hit,
        cancels=np.array([system.signal(name).kind == "phasor" for name in signals]),
        covered=tuple(name for name in groups if all(yes for yes, one in zip(alone, of, strict=True) if one == name)),
        max_multiple=max_multiple,
    )
