"""Thesis 7.3: values with first and second derivatives over a set, the base of Taylor and mean value enclosures.

A `Jet` carries intervals of a function's value, of its gradient and, if wanted, of its Hessian with respect to n
variables. The rules of differentiation are applied to intervals, so each part encloses its quantity over the whole
set that the variables stand for; with variables of no width it encloses the derivatives at a point.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pumplib.errors import ParameterError
from pumplib.steady.intervals import Interval, interval

Array = NDArray[Any]


def _wide(x: Interval, axes: int) -> Interval:
    """Append axes, so that values multiply gradients and Hessians."""
    index = (..., *([None] * axes))
    return Interval(x.lo[index], x.hi[index])


def _outer(a: Interval, b: Interval) -> Interval:
    return Interval(a.lo[..., :, None], a.hi[..., :, None]) * Interval(b.lo[..., None, :], b.hi[..., None, :])


@dataclass(frozen=True, slots=True, eq=False)
class Jet:
    """Value, gradient and Hessian as intervals.

    Parameters
    ----------
    v : Interval, shape (...)
        Value.
    g : Interval, shape (..., n)
        Gradient.
    h : Interval, shape (..., n, n), or None
        Hessian; None where only first derivatives are wanted.

    References
    ----------
    A. Griewank and A. Walther, Evaluating Derivatives (2008), chapter 13.
    """

    v: Interval
    g: Interval
    h: Interval | None = None

    __array_ufunc__ = None

    def _plus(self, other: "Jet", sign: int) -> "Jet":
        if sign < 0:
            return Jet(self.v - other.v, self.g - other.g, None if self.h is None else self.h - other.h)
        return Jet(self.v + other.v, self.g + other.g, None if self.h is None else self.h + other.h)

    def __neg__(self) -> "Jet":
        return Jet(-self.v, -self.g, None if self.h is None else -self.h)

    def __add__(self, other: Any) -> "Jet":
        if isinstance(other, Jet):
            return self._plus(other, 1)
        return Jet(self.v + other, self.g, self.h)

    __radd__ = __add__

    def __sub__(self, other: Any) -> "Jet":
        if isinstance(other, Jet):
            return self._plus(other, -1)
        return Jet(self.v - other, self.g, self.h)

    def __rsub__(self, other: Any) -> "Jet":
        return (-self) + other

    def __mul__(self, other: Any) -> "Jet":
        if not isinstance(other, Jet):
            factor = interval(other)
            h = None if self.h is None else self.h * _wide(factor, 2)
            return Jet(self.v * factor, self.g * _wide(factor, 1), h)
        g = self.g * _wide(other.v, 1) + other.g * _wide(self.v, 1)
        h = None
        if self.h is not None and other.h is not None:
            cross = _outer(self.g, other.g) + _outer(other.g, self.g)
            h = self.h * _wide(other.v, 2) + other.h * _wide(self.v, 2) + cross
        return Jet(self.v * other.v, g, h)

    __rmul__ = __mul__

    def _of(self, f: Interval, d1: Interval, d2: Interval) -> "Jet":
        """Chain rule for a function of one variable."""
        h = None if self.h is None else self.h * _wide(d1, 2) + _outer(self.g, self.g) * _wide(d2, 2)
        return Jet(f, self.g * _wide(d1, 1), h)

    def inverse(self) -> "Jet":
        """Reciprocal.

        Returns
        -------
        Jet
        """
        f = self.v.inverse()
        square = f**2
        return self._of(f, -square, 2.0 * (square * f))

    def __truediv__(self, other: Any) -> "Jet":
        return self * (other.inverse() if isinstance(other, Jet) else interval(other).inverse())

    def __rtruediv__(self, other: Any) -> "Jet":
        return self.inverse() * other

    def __pow__(self, exponent: int) -> "Jet":
        if exponent != 2:
            raise ParameterError(f"Jet ** {exponent!r}: only squares are defined; write products.")
        return self._of(self.v**2, 2.0 * self.v, interval(np.full(np.shape(self.v.lo), 2.0)))

    def anchor(self) -> Array:
        """A number in the middle of this jet's value.

        Returns
        -------
        ndarray, shape (...)
        """
        return self.v.mid

    def sqrt(self) -> "Jet":
        """Square root.

        Returns
        -------
        Jet
        """
        f = self.v.sqrt()
        d1 = 0.5 * f.inverse()
        return self._of(f, d1, -0.5 * (d1 * self.v.inverse()))

    def cos(self) -> "Jet":
        """Cosine.

        Returns
        -------
        Jet
        """
        c = self.v.cos()
        return self._of(c, -self.v.sin(), -c)

    def sin(self) -> "Jet":
        """Sine.

        Returns
        -------
        Jet
        """
        s = self.v.sin()
        return self._of(s, self.v.cos(), -s)


def variable(value: Interval, slopes: Array, second: bool) -> Jet:
    """Jet of a quantity that is linear in the variables.

    Parameters
    ----------
    value : Interval, shape (...)
        Its range.
    slopes : ndarray, shape (..., n)
        Its exact derivatives.
    second : bool
        Whether Hessians are carried.

    Returns
    -------
    Jet
    """
    n = slopes.shape[-1]
    zero = np.zeros((*np.shape(value.lo), n, n)) if second else None
    return Jet(value, interval(slopes), None if zero is None else interval(zero))
