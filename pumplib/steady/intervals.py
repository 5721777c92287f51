"""Thesis 7.3: interval arithmetic with outward rounding, the plain enclosure that forgets which operands are shared.

Each bound is computed in double precision, rounded to nearest, and then moved outwards by one step of the number
format. Addition, multiplication, division and the square root of IEEE 754 are correctly rounded, so one step is
enough; sine and cosine of the C library are not, they get `TRIG_STEPS`.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pumplib.errors import ParameterError

Array = NDArray[Any]
TRIG_STEPS = 4  # C libraries in use are good to one unit in the last place, numpy's vector versions to four


def down(x: ArrayLike, steps: int = 1) -> Array:
    """Move numbers towards minus infinity.

    Parameters
    ----------
    x : array_like
        Numbers.
    steps : int
        Steps of the number format.

    Returns
    -------
    ndarray
    """
    y = np.asarray(x, dtype=float)
    for _ in range(steps):
        y = np.nextafter(y, -np.inf)
    return y


def up(x: ArrayLike, steps: int = 1) -> Array:
    """Move numbers towards plus infinity.

    Parameters
    ----------
    x : array_like
        Numbers.
    steps : int
        Steps of the number format.

    Returns
    -------
    ndarray
    """
    y = np.asarray(x, dtype=float)
    for _ in range(steps):
        y = np.nextafter(y, np.inf)
    return y


@dataclass(frozen=True, slots=True, eq=False)
class Interval:
    """Intervals, elementwise over arrays.

    An operation that is not defined everywhere on its operand (division by an interval with zero, root of one that
    reaches below zero) gives the whole line, which contains every result there is.

    Parameters
    ----------
    lo, hi : ndarray
        Bounds of one shape.

    References
    ----------
    R. E. Moore, Interval Analysis (1966).
    """

    lo: Array
    hi: Array

    __array_ufunc__ = None  # numpy arrays on the left leave the operation to this class

    @property
    def mid(self) -> Array:
        """A point near the middle."""
        return np.asarray(0.5 * self.lo + 0.5 * self.hi)

    @property
    def magnitude(self) -> Array:
        """Largest absolute value."""
        return np.asarray(np.maximum(np.abs(self.lo), np.abs(self.hi)))

    def contains(self, x: ArrayLike) -> Array:
        """Tell whether values lie inside.

        Parameters
        ----------
        x : array_like
            Values.

        Returns
        -------
        ndarray of bool
        """
        return np.asarray((self.lo <= x) & (np.asarray(x) <= self.hi))

    def __neg__(self) -> "Interval":
        return Interval(-self.hi, -self.lo)

    def __add__(self, other: Any) -> "Interval":
        b = interval(other)
        with np.errstate(invalid="ignore"):
            return Interval(down(self.lo + b.lo), up(self.hi + b.hi))

    __radd__ = __add__

    def __sub__(self, other: Any) -> "Interval":
        return self + (-interval(other))

    def __rsub__(self, other: Any) -> "Interval":
        return (-self) + other

    def __mul__(self, other: Any) -> "Interval":
        b = interval(other)
        with np.errstate(invalid="ignore"):
            products = (self.lo * b.lo, self.lo * b.hi, self.hi * b.lo, self.hi * b.hi)
        # 0 * inf is 0 here: an unbounded operand times exactly nothing
        ends = [np.where(np.isnan(p), 0.0, p) for p in products]
        return Interval(down(np.minimum.reduce(ends)), up(np.maximum.reduce(ends)))

    __rmul__ = __mul__

    def inverse(self) -> "Interval":
        """Reciprocal.

        Returns
        -------
        Interval
        """
        crossing = (self.lo <= 0) & (self.hi >= 0)
        with np.errstate(divide="ignore"):
            lo, hi = down(1.0 / self.hi), up(1.0 / self.lo)
        return Interval(np.where(crossing, -np.inf, lo), np.where(crossing, np.inf, hi))

    def __truediv__(self, other: Any) -> "Interval":
        return self * interval(other).inverse()

    def __rtruediv__(self, other: Any) -> "Interval":
        return interval(other) * self.inverse()

    def __pow__(self, exponent: int) -> "Interval":
        if exponent != 2:
            raise ParameterError(f"Interval ** {exponent!r}: only squares are defined; write products.")
        a, b = self.lo * self.lo, self.hi * self.hi
        least = np.where((self.lo <= 0) & (self.hi >= 0), 0.0, np.maximum(down(np.minimum(a, b)), 0.0))
        return Interval(least, up(np.maximum(a, b)))

    def sqrt(self) -> "Interval":
        """Square root.

        Returns
        -------
        Interval
        """
        outside = self.lo < 0
        with np.errstate(invalid="ignore"):
            lo, hi = np.maximum(down(np.sqrt(self.lo)), 0.0), up(np.sqrt(self.hi))
        return Interval(np.where(outside, -np.inf, lo), np.where(outside, np.inf, hi))

    def cos(self) -> "Interval":
        """Cosine.

        Returns
        -------
        Interval
        """
        a, b = np.cos(self.lo), np.cos(self.hi)
        lo, hi = down(np.minimum(a, b), TRIG_STEPS), up(np.maximum(a, b), TRIG_STEPS)
        # an extremum at k pi inside, with room for the rounding of k pi
        first, last = np.ceil(self.lo / np.pi - 1e-12), np.floor(self.hi / np.pi + 1e-12)
        top = (first <= last) & ((np.mod(first, 2) == 0) | (last > first))
        bottom = (first <= last) & ((np.mod(first, 2) == 1) | (last > first))
        return Interval(np.where(bottom, -1.0, np.maximum(lo, -1.0)), np.where(top, 1.0, np.minimum(hi, 1.0)))

    def sin(self) -> "Interval":
        """Sine.

        Returns
        -------
        Interval
        """
        # pi/2 is not a double: the interval of its two neighbours is
        return (self - Interval(down(np.pi / 2), up(np.pi / 2))).cos()


def interval(x: Any) -> Interval:
    """Make an interval of a number or array; intervals are passed on.

    Parameters
    ----------
    x : array_like or Interval
        What to convert; taken as exact.

    Returns
    -------
    Interval
    """
    if isinstance(x, Interval):
        return x
    a = np.asarray(x, dtype=float)
    return Interval(a, a)
