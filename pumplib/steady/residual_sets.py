"""Thesis 7.3, 7.4: residual sets of single points given the healthy block, and their signs (reconstructed).

A parallelotope around everything that explains the healthy points is wider than that set itself, and it forgets that
the sensors' biases are still the same. Here each residual is bounded over the set itself: with the affine form
c + k zeta + e of a point, the range of k zeta over all zeta that explain the healthy block is a pair of linear
programs whose bounds are proven by duality. Zero outside a set proves a fault, the side on which it lies is its sign.

With all effects of a fault small, the signs of (R1, R2, R3) are

    K_f  (-, 0, -)     dB  (0, +, +)     K_l  (-, +, 0)     f_c, f_d  (-, -, -)

in the region where head falls and torque rises with flow. Cavitation and dry running differ by the level of R1 alone;
the border is an assumption.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pumplib.errors import DataError, ParameterError
from pumplib.steady.enclose import Enclosure
from pumplib.steady.membership import Program
from pumplib.steady.windows import DRY_LEVEL, WindowTest

Array = NDArray[Any]
OUTPUTS = ("R1", "R2", "R3")
SIGNATURES: Mapping[str, tuple[int, int, int]] = {
    "K_f": (-1, 0, -1),
    "dB": (0, 1, 1),
    "K_l": (-1, 1, 0),
    "f_c": (-1, -1, -1),
    "f_d": (-1, -1, -1),
}


class ReferenceSets:
    """Residual sets of single points given a healthy block.

    Parameters
    ----------
    test : WindowTest
        With its healthy block, margins, and parameters that change.

    Raises
    ------
    ParameterError
        If the test has no healthy block.
    """

    def __init__(self, test: WindowTest) -> None:
        if test.reference is None:
            raise ParameterError("ReferenceSets: the window test has no healthy block; give it a reference.")
        self._test = test
        self._program = Program(test.reference)

    def enclose(self, signals: Mapping[str, ArrayLike]) -> Enclosure:
        """Sets of R1, R2 and R3, point by point.

        Parameters
        ----------
        signals : mapping of str to array_like, shape (n,)
            Channels of the points, SI.

        Returns
        -------
        Enclosure
            The whole line for R3 where the head may be above the pump's largest.

        Raises
        ------
        DataError
            If a channel is missing or not finite, or R1 or R2 not defined.
        ProgramError
            If nothing explains the healthy block.
        """
        columns = {name: np.atleast_1d(np.asarray(x, dtype=float)) for name, x in signals.items()}
        wide = self._test.model.enclose(columns)
        low, high = np.full((len(wide.lo), 3), -np.inf), np.full((len(wide.lo), 3), np.inf)
        low[:, :2], high[:, :2] = self._ranges(columns, OUTPUTS[:2])
        good = np.isfinite(wide.lo[:, 2]) & np.isfinite(wide.hi[:, 2])
        if good.any():
            part = {name: x[good] for name, x in columns.items()}
            low[good, 2:], high[good, 2:] = self._ranges(part, OUTPUTS[2:])
        return Enclosure(outputs=OUTPUTS, lo=low, hi=high, method="affine")

    def _ranges(self, columns: Mapping[str, Array], outputs: tuple[str, ...]) -> tuple[Array, Array]:
        rows = self._test.rows(columns, outputs=outputs)
        ends = np.array([self._program.extreme(k) for k in rows.k]).reshape(-1, 2)
        low, high = rows.c + ends[:, 0] - rows.r, rows.c + ends[:, 1] + rows.r
        return low.reshape(-1, len(outputs)), high.reshape(-1, len(outputs))


def gathered_signs(sets: Enclosure) -> tuple[int, ...] | None:
    """Signs that some of the points have proven.

    Parameters
    ----------
    sets : Enclosure
        Of one or more points with the same fault.

    Returns
    -------
    tuple of int or None
        One a residual, 0 where no set excludes zero; None if two points prove opposite signs of a residual.
    """
    signs = sets.sign
    up, down = (signs > 0).any(axis=0), (signs < 0).any(axis=0)
    if (up & down).any():
        return None
    return tuple(int(x) for x in up.astype(int) - down.astype(int))


def named_by_signs(signs: tuple[int, ...] | None, level: float) -> str:
    """Fault by the signs of the three residuals, and by the level of the first for cavitation or dry running.

    A signature fits if it has every sign that is proven. Of those that fit the one with the fewest signs that are not
    proven is named; "" if there is none or a tie.

    Parameters
    ----------
    signs : tuple of int or None
        Of R1, R2, R3 by `gathered_signs`.
    level : float
        Lost share of the head, -R1 / f_H.

    Returns
    -------
    str
        "K_f", "dB", "K_l", "f_c", "f_d" or "".

    Raises
    ------
    DataError
        If there are not three signs, or the level is not finite.

    References
    ----------
    Thesis 7.4 (reconstructed); the level is an assumption.
    """
    if signs is None or not any(signs):
        return ""
    if len(signs) != 3 or not np.isfinite(level):
        raise DataError(f"signs {signs!r}, level {level!r}: give three signs and the lost share of the head.")
    missing = {
        name: sum(s != 0 and seen == 0 for s, seen in zip(pattern, signs, strict=True))
        for name, pattern in SIGNATURES.items()
        if name != "f_d" and all(seen in (0, s) for s, seen in zip(pattern, signs, strict=True))
    }
    best = [name for name, count in missing.items() if count == min(missing.values())]
    if len(best) != 1:
        return ""
    return "f_d" if best[0] == "f_c" and level > DRY_LEVEL else best[0]
