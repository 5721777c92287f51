"""Thesis 7.2, 7.3: functions that mean the same for numbers, symbols, intervals, jets and recorded operands.

An equation is written once as a plain Python function of its operands, with ``+ - * / **2`` and the three functions
here. Given floats it computes, given SymPy symbols it becomes the formula, given intervals or jets it encloses, given
the operands of `pumplib.steady.tape` it is recorded, and numba compiles it as it stands.
"""

import math
from typing import Any

import numpy as np

import pumplib.kernels  # noqa: F401  before numba.extending: sets numba's cache folder

from numba.extending import overload, register_jitable  # isort: skip

__all__ = ["cosine", "inner", "operand_function", "root", "sine"]

operand_function: Any = register_jitable(error_model="numpy")
"""Decorator of a function of operands: it stays a Python function and can also be called in compiled code."""


def _apply(x: Any, name: str) -> Any:
    method = getattr(x, name, None)
    if method is not None:
        return method()
    if hasattr(x, "free_symbols"):
        import sympy

        return getattr(sympy, name)(x)
    with np.errstate(invalid="ignore"):  # not a number where it is not defined, as in compiled code
        return getattr(np, name)(x)


def root(x: Any) -> Any:
    """Square root.

    Parameters
    ----------
    x : float, ndarray, symbol or any operand with a method ``sqrt``
        Operand.

    Returns
    -------
    same kind
    """
    return _apply(x, "sqrt")


def cosine(x: Any) -> Any:
    """Cosine.

    Parameters
    ----------
    x : float, ndarray, symbol or any operand with a method ``cos``
        Operand, rad.

    Returns
    -------
    same kind
    """
    return _apply(x, "cos")


def sine(x: Any) -> Any:
    """Sine.

    Parameters
    ----------
    x : float, ndarray, symbol or any operand with a method ``sin``
        Operand, rad.

    Returns
    -------
    same kind
    """
    return _apply(x, "sin")


def inner(a: Any, b: Any) -> Any:
    """Sum of products of two tuples of equal length, 2 to 4.

    Written apart from ``+`` and ``*`` because a recorder treats it as one operation: where the factors are
    correlated, the nonlinear parts of the products cancel, and only the sum shows it.

    Parameters
    ----------
    a, b : tuple of operands
        Factors.

    Returns
    -------
    same kind
    """
    for x in (*a, *b):
        method = getattr(x, "inner_product", None)
        if method is not None:
            return method(a, b)
    total = a[0] * b[0]
    for x, y in zip(a[1:], b[1:], strict=True):
        total = total + x * y
    return total


@overload(inner, inline="always")
def _inner(a, b):  # type: ignore[no-untyped-def]
    if len(a) == 2:
        return lambda a, b: a[0] * b[0] + a[1] * b[1]
    if len(a) == 3:
        return lambda a, b: a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
    return lambda a, b: a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3]


@overload(root, inline="always")
def _root(x):  # type: ignore[no-untyped-def]
    return lambda x: math.sqrt(x)


@overload(cosine, inline="always")
def _cosine(x):  # type: ignore[no-untyped-def]
    return lambda x: math.cos(x)


@overload(sine, inline="always")
def _sine(x):  # type: ignore[no-untyped-def]
    return lambda x: math.sin(x)
