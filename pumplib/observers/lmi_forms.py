"""Thesis 5.2.2, B.2: bases of Hermitian matrices, and complex matrices as real ones and back."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import null_space

from pumplib.errors import ParameterError

Array = NDArray[Any]


def hermitian_basis(n: int, is_complex: bool) -> Array:
    """Orthonormal basis of the Hermitian (or real symmetric) matrices.

    Parameters
    ----------
    n : int
        Order.
    is_complex : bool
        Whether imaginary parts are allowed.

    Returns
    -------
    ndarray, shape (d, n, n)
    """
    found = []
    for i in range(n):
        for j in range(i, n):
            for factor in (1.0, 1j) if is_complex and i != j else (1.0,):
                e = np.zeros((n, n), dtype=complex if is_complex else float)
                e[i, j] += factor if i == j else factor / math.sqrt(2)
                if i != j:
                    e[j, i] += np.conj(factor) / math.sqrt(2)
                found.append(e)
    return np.stack(found)


def structured_basis(basis: Array, C: Array, actions: Sequence[Array]) -> Array:
    """Part of a basis whose matrices P satisfy P X = C^H F with some F for each given X.

    Parameters
    ----------
    basis : ndarray, shape (d, n, n)
        Orthonormal basis of P.
    C : ndarray, shape (p, n)
        Output matrix.
    actions : sequence of ndarray, shape (n, any)
        The matrices X.

    Returns
    -------
    ndarray, shape (d', n, n)
        Orthonormal; d' may be zero.
    """
    hidden = null_space(C)
    conditions = []
    for X in actions:
        size = np.linalg.norm(X)
        if size > 0:
            products = np.einsum("ni,dnm,mj->ijd", hidden.conj(), basis, X / size).reshape(-1, len(basis))
            conditions += [products.real, products.imag]
    if not conditions:
        return basis
    return np.einsum("de,dij->eij", null_space(np.vstack(conditions), rcond=1e-10), basis)


def real_form(matrix: ArrayLike) -> Array:
    """Write a complex matrix as the real one of twice the size that acts on real and imaginary parts.

    Parameters
    ----------
    matrix : array_like, shape (..., n, m)
        Complex matrix. The states of the real one are all real parts, then all imaginary parts.

    Returns
    -------
    ndarray, shape (..., 2n, 2m)
        [[Re, -Im], [Im, Re]].
    """
    x = np.asarray(matrix)
    top = np.concatenate([x.real, -x.imag], axis=-1)
    return np.concatenate([top, np.concatenate([x.imag, x.real], axis=-1)], axis=-2)


def complex_form(matrix: ArrayLike) -> Array:
    """Average a real matrix of even size over rotations and write it as a complex one of half the size.

    It undoes `real_form`. If P proves a decay rate for systems that commute with rotation, so does its average: this
    is the reduction of the motor's real 4 x 4 problem to a complex 2 x 2 one.

    Parameters
    ----------
    matrix : array_like, shape (..., 2n, 2m)
        Real matrix, real parts first.

    Returns
    -------
    ndarray, shape (..., n, m)

    Raises
    ------
    ParameterError
        If a side has odd length.
    """
    x = np.asarray(matrix)
    if x.ndim < 2 or x.shape[-1] % 2 or x.shape[-2] % 2:
        raise ParameterError(f"complex_form: shape {x.shape}; the last two sides must be even.")
    n, m = x.shape[-2] // 2, x.shape[-1] // 2
    a, b, c, d = x[..., :n, :m], x[..., :n, m:], x[..., n:, :m], x[..., n:, m:]
    return (a + d) / 2 + 1j * (c - b) / 2
