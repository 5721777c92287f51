"""Thesis 5.2.2, B.2: matrix inequalities of observers as arrays: checks, scaling of time and states, blocks.

All unknowns are real numbers: coordinates of P in an orthonormal basis of the Hermitian matrices (or of those that
satisfy structural equalities), then the entries of Y_j = P K_j. A block is an affine Hermitian matrix function of
them, kept as its constant and its coefficients. Complex and real problems, and both forms, are the same from here on.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pumplib.errors import ParameterError
from pumplib.observers.certificate import Form, check_form, check_rate, matrices
from pumplib.observers.lmi_forms import hermitian_basis

Array = NDArray[Any]
_NEGLIGIBLE = 1e-11  # entries that small in scaled units are rounding of zeros and do not set the scale
_TIE = 1e-3  # weight of the decay rate in the choice of the unit of time


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Scaling:
    """Units of the scaled problem: t = time t', x = state x', y = output y'.

    Parameters
    ----------
    time : float
        Unit of time, s.
    state : ndarray, shape (n,)
        Units of the states.
    output : ndarray, shape (p,)
        Units of the outputs.
    """

    time: float
    state: Array
    output: Array


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Family:
    """Checked systems of one problem, in the units of the caller.

    Parameters
    ----------
    name : str
        Shown in errors.
    A : ndarray, shape (k, n, n)
        Systems at the vertices.
    C : ndarray, shape (p, n)
        Output matrix; p = 0 where there is no gain to find.
    weights : ndarray, shape (k, 1 + m)
        One and the scheduling parameters of each vertex.
    form : {"continuous", "delta"}
        Meaning of the systems.
    h : float
        Sampling interval, s; zero for the continuous form.
    decay_rate : float
        Asked for, 1/s.
    kappa : float
        Upper bound of P where the lower one is the identity, in scaled units.
    """

    name: str
    A: Array
    C: Array
    weights: Array
    form: Form
    h: float
    decay_rate: float
    kappa: float

    @property
    def is_complex(self) -> bool:
        """Whether any matrix is complex."""
        return bool(np.iscomplexobj(self.A) or np.iscomplexobj(self.C))


def family(
    name: str, A: ArrayLike, C: ArrayLike | None, nu: ArrayLike | None, schedule: str, form: Form, h: float | None,
    decay_rate: float, kappa: float,
) -> Family:  # fmt: skip
    """Check the arguments of a problem.

    Parameters
    ----------
    name : str
        Name of the problem, shown in errors.
    A : array_like, shape (k, n, n) or (n, n)
        Systems.
    C : array_like, shape (p, n), optional
        Output matrix.
    nu : array_like, shape (k,) or (k, m), optional
        Scheduling parameters.
    schedule : {"constant", "affine"}
        Dependence of the gain on them.
    form, h, decay_rate, kappa
        As in `Family`.

    Returns
    -------
    Family

    Raises
    ------
    ParameterError
        If a shape, a number or a word is wrong; the message names it.
    """
    step = check_form(name, form, h)
    rate = check_rate(name, decay_rate, step)
    bound = float(matrices(name, "kappa", kappa, ()).real)
    if not bound > 1:
        raise ParameterError(f"{name}: kappa = {bound:g}; must be > 1, the bounds are I <= P <= kappa I.")
    try:
        one = np.ndim(A) == 2
    except ValueError:
        one = False  # ragged; the next check says so
    systems = matrices(name, "A", np.asarray(A)[None] if one else A, (None, None, None))
    k, n = systems.shape[:2]
    if k == 0 or n == 0 or systems.shape[2] != n:
        raise ParameterError(f"{name}: A has shape {systems.shape}; must be (k, n, n), at least one square matrix.")
    out = np.zeros((0, n)) if C is None else matrices(name, "C", C, (None, n))
    if C is not None and len(out) == 0:
        raise ParameterError(f"{name}: C has no row; an observer needs at least one output.")
    if schedule not in ("constant", "affine"):
        raise ParameterError(f'{name}: schedule = {schedule!r}; must be "constant" or "affine".')
    weights = np.ones((k, 1))
    if schedule == "affine":
        if nu is None:
            raise ParameterError(f"{name}: an affine gain needs nu, the scheduling parameters of each vertex.")
        given = np.asarray(nu)
        rows = matrices(name, "nu", given[:, None] if given.ndim == 1 else nu, (k, None))
        weights = np.hstack([weights, rows.real])
    return Family(name=name, A=systems, C=out, weights=weights, form=form, h=step, decay_rate=rate, kappa=bound)


def automatic_scaling(problem: Family) -> Scaling:
    """Units in which the entries of A and C, and the decay rate, are as close to one as possible.

    The logarithms of the units are the least-squares solution of log|A_ij| + t + d_j - d_i = 0,
    log|C_ij| + d_j - s_i = 0 over the entries that are not zero, and log(decay) + t = 0 with so little weight that it
    only decides where A leaves the unit of time open (a chain of integrators). So the scaled problem, and with it the
    gain, does not depend on the units that the caller uses.

    Parameters
    ----------
    problem : Family
        The problem.

    Returns
    -------
    Scaling

    References
    ----------
    A. R. Curtis, J. K. Reid, On the automatic scaling of matrices for Gaussian elimination, IMA J. Appl. Math. 10
    (1972).
    """
    all_a, all_c = np.abs(problem.A).max(axis=0), np.abs(problem.C)
    a, c = all_a, all_c
    n, p = len(a), len(c)
    time, state, output = 1.0, np.ones(n), np.ones(p)
    for turn in range(4):
        if turn > 0:  # again without entries that turn out to be rounding of zeros
            scaled_a = time * all_a * state[None, :] / state[:, None]
            scaled_c = all_c * state[None, :] / output[:, None]
            limit = _NEGLIGIBLE * max(scaled_a.max(initial=0.0), scaled_c.max(initial=0.0))
            a, c = np.where(scaled_a > limit, all_a, 0.0), np.where(scaled_c > limit, all_c, 0.0)
        rows, right = [], []
        for i, j in np.argwhere(a > 0):
            row = np.zeros(1 + n + p)
            row[0] = 1.0
            row[1 + j] += 1.0
            row[1 + i] -= 1.0
            rows.append(row)
            right.append(-math.log(a[i, j]))
        for i, j in np.argwhere(c > 0):
            row = np.zeros(1 + n + p)
            row[1 + j] = 1.0
            row[1 + n + i] = -1.0
            rows.append(row)
            right.append(-math.log(c[i, j]))
        if problem.decay_rate > 0:
            row = np.zeros(1 + n + p)
            row[0] = _TIE
            rows.append(row)
            right.append(-_TIE * math.log(problem.decay_rate))
        if not rows:
            break
        logs = np.linalg.lstsq(np.array(rows), np.array(right), rcond=None)[0]
        new = (math.exp(logs[0]), np.exp(logs[1 : 1 + n]), np.exp(logs[1 + n :]))
        settled = abs(math.log(new[0] / time)) + float(np.abs(np.log(new[1] / state)).sum()) < 1e-9
        time, state, output = new
        if settled:
            break
    return Scaling(time=time, state=state, output=output)


def rescaled(problem: Family, scaling: Scaling) -> Family:
    """Write a problem in other units.

    Parameters
    ----------
    problem : Family
        The problem.
    scaling : Scaling
        The units.

    Returns
    -------
    Family

    Raises
    ------
    ParameterError
        If the units have wrong shapes or are not positive.
    """
    n, p = problem.A.shape[1], len(problem.C)
    state = matrices(problem.name, "scaling.state", scaling.state, (n,))
    output = matrices(problem.name, "scaling.output", scaling.output, (p,))
    if not (scaling.time > 0 and math.isfinite(scaling.time)) or (state <= 0).any() or (output <= 0).any():
        raise ParameterError(f"{problem.name}: scaling must be positive, units of time, states and outputs.")
    return Family(
        name=problem.name,
        A=scaling.time * problem.A * state[None, :] / state[:, None],
        C=problem.C * state[None, :] / output[:, None],
        weights=problem.weights,
        form=problem.form,
        h=problem.h / scaling.time,
        decay_rate=problem.decay_rate * scaling.time,
        kappa=problem.kappa,
    )


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Blocks:
    """The inequalities of a scaled problem: decay blocks and the place of the unknowns.

    Parameters
    ----------
    coefficients : ndarray, shape (k, N, N, d)
        Coefficients of the decay blocks, which have no constant; each block must be positive semidefinite.
    basis : ndarray, shape (d_P, n, n)
        Basis of P; its coordinates come first among the unknowns.
    y_basis : ndarray, shape (d_Y, n, p)
        Basis of each Y_j.
    terms : int
        Number of Y_j.
    """

    coefficients: Array
    basis: Array
    y_basis: Array
    terms: int

    @property
    def unknowns(self) -> int:
        """Number of real unknowns."""
        return len(self.basis) + self.terms * len(self.y_basis)

    def P(self, x: Array) -> Array:
        """Matrix P of a solution.

        Parameters
        ----------
        x : ndarray, shape (d,)
            The unknowns.

        Returns
        -------
        ndarray, shape (n, n)
        """
        return np.einsum("d,dij->ij", x[: len(self.basis)], self.basis)

    def Y(self, x: Array) -> list[Array]:
        """Matrices Y_j of a solution.

        Parameters
        ----------
        x : ndarray, shape (d,)
            The unknowns.

        Returns
        -------
        list of ndarray, shape (n, p)
        """
        rest = x[len(self.basis) :].reshape(self.terms, -1)
        return [np.einsum("d,dij->ij", one, self.y_basis) for one in rest]


def decay_blocks(problem: Family, basis: Array | None = None) -> Blocks:
    """Inequalities that say that sqrt(e^H P e) falls at the decay rate at every vertex.

    With M = P A - Y C, Y = P K: continuous -(M + M^H) - 2 alpha P >= 0; delta
    [[-(M + M^H) - (2 alpha - h alpha^2) P, sqrt(h) M^H], [sqrt(h) M, P]] >= 0, which says |I + h (A - K C)|_P <=
    1 - h alpha.

    Parameters
    ----------
    problem : Family
        Scaled problem.
    basis : ndarray, shape (d, n, n), optional
        Basis of P; all Hermitian matrices by default.

    Returns
    -------
    Blocks

    References
    ----------
    Boyd et al. (1994), sections 5.1 and 7.2; the delta form by the Schur complement, section 2.1.
    """
    A, C, h, alpha = problem.A, problem.C, problem.h, problem.decay_rate
    (k, n, _), p = A.shape, len(C)
    if basis is None:
        basis = hermitian_basis(n, problem.is_complex)
    units = np.eye(n * p).reshape(n * p, n, p)
    y_basis = np.concatenate([units, 1j * units]) if problem.is_complex else units
    terms = problem.weights.shape[1] if p else 0
    kind = np.result_type(basis, A, C, y_basis)
    columns: list[Array] = []
    for v in range(k):
        m = [basis @ A[v]] + [-problem.weights[v, j] * (y_basis @ C) for j in range(terms)]
        M = np.concatenate(m)
        P = np.concatenate([basis, np.zeros((len(M) - len(basis), n, n))])
        MH = np.swapaxes(M, 1, 2).conj()
        top = -(M + MH) - (2 * alpha - h * alpha**2) * P
        if h > 0:
            root = math.sqrt(h)
            top = np.concatenate(
                [np.concatenate([top, root * MH], axis=2), np.concatenate([root * M, P], axis=2)], axis=1
            )
        columns.append(np.moveaxis(top.astype(kind), 0, 2))
    return Blocks(coefficients=np.stack(columns), basis=basis, y_basis=y_basis, terms=terms)


@dataclass(frozen=True, kw_only=True, slots=True)
class HiddenMode:
    """A mode that the output does not see, at one vertex.

    Parameters
    ----------
    vertex : int
        Number of the vertex.
    eigenvalue : complex
        Its eigenvalue, 1/s.
    decay : float
        Its decay rate, 1/s; in delta form (1 - |1 + h lambda|)/h. No gain changes it.
    residual : float
        Smallest singular value of [A - lambda I; C] in scaled units.
    """

    vertex: int
    eigenvalue: complex
    decay: float
    residual: float


def hidden_modes(problem: Family, tolerance: float = 1e-8) -> list[HiddenMode]:
    """Modes that the output does not see, by the rank test of Popov, Belevitch and Hautus at every vertex.

    Parameters
    ----------
    problem : Family
        The problem, scaled or not; rates come in its unit of time.
    tolerance : float
        Smallest singular value that counts as zero, relative to the largest.

    Returns
    -------
    list of HiddenMode
        The slowest first.
    """
    n = problem.A.shape[1]
    found = []
    for v, A in enumerate(problem.A):
        for value in np.linalg.eigvals(A):
            singular = np.linalg.svd(np.vstack([A - value * np.eye(n), problem.C]), compute_uv=False)
            if singular[-1] <= tolerance * max(singular[0], 1e-300):
                h = problem.h
                decay = -value.real if h == 0 else (1 - abs(1 + h * value)) / h
                found.append(
                    HiddenMode(vertex=v, eigenvalue=complex(value), decay=float(decay), residual=float(singular[-1]))
                )
    return sorted(found, key=lambda mode: mode.decay)
