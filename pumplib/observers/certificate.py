"""Thesis 5.2.2, B.2: observer gains and their certificates, verified in plain NumPy outside the solver.

A certificate is a matrix P > 0 such that V(e) = e^H P e falls at a stated rate along every system of a list. The
rate is the logarithmic norm of the system in the norm of P, a Hermitian eigenvalue. It is a convex function of the
system matrix: a rate verified at the vertices of a polytope holds in the whole polytope, also when the parameters
move. Every rate given here is rounded to the safe side by a bound of the floating-point error.
"""

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import solve_triangular

from pumplib.errors import ParameterError, PumplibError

Array = NDArray[Any]
Form = Literal["continuous", "delta"]
_EPS = float(np.finfo(float).eps)


class LmiError(PumplibError, ArithmeticError):
    """Base of what can go wrong with a matrix inequality."""


class InfeasibleError(LmiError):
    """No solution exists; the message names what stands against it and what to change."""


class InaccurateError(LmiError):
    """The solver gave up, or gave a result without the accuracy that a decision needs."""


class NotVerifiedError(LmiError):
    """A matrix P that was meant to prove a decay rate does not prove it."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Gain:
    """Observer gain, constant or affine in scheduling parameters.

    Parameters
    ----------
    K : tuple of ndarray, each shape (n, p)
        K_0, and K_1, K_2, ... for each scheduling parameter; unit of the state per unit of the output and second.
    low, high : ndarray, shape (m,)
        Range of each scheduling parameter in which the gain was verified.
    """

    K: tuple[Array, ...]
    low: Array
    high: Array

    @property
    def scheduled(self) -> bool:
        """Whether the gain depends on scheduling parameters."""
        return len(self.K) > 1

    def at(self, nu: ArrayLike = 0.0) -> Array:
        """Gain at one or many values of the scheduling parameters.

        Parameters
        ----------
        nu : array_like, shape (m,) or (N, m); for one parameter also a number or shape (N,)
            Scheduling parameters; a constant gain ignores them.

        Returns
        -------
        ndarray, shape (n, p) or (N, n, p)

        Raises
        ------
        ParameterError
            If the shape is wrong or a value lies outside the verified range.
        """
        if not self.scheduled:
            return self.K[0].copy()
        m = len(self.K) - 1
        x = np.asarray(nu, dtype=float)
        one = x.ndim == 0 or (x.ndim == 1 and m > 1)
        rows = x.reshape(-1, m) if x.size % m == 0 else x
        if rows.ndim != 2 or x.ndim > 2 or rows.shape[1] != m or (m > 1 and x.shape[-1] != m):
            raise ParameterError(f"Gain.at: nu has shape {x.shape}; must be ({m},) or (N, {m}).")
        slack = 1e-9 * (self.high - self.low)
        outside = ~((rows >= self.low - slack) & (rows <= self.high + slack))
        if outside.any():
            row, j = (int(k) for k in np.argwhere(outside)[0])
            raise ParameterError(
                f"Gain.at: nu[{j}] = {rows[row, j]:g} is outside {self.low[j]:g} to {self.high[j]:g}, the range in "
                "which the gain was verified; limit the parameter, or design the gain for a wider range."
            )
        gains = self.K[0] + np.einsum("Nm,mnp->Nnp", rows, np.stack(self.K[1:]))
        return gains[0] if one else gains


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Certificate:
    """Proof of a decay rate: |e(t)|_P <= |e(0)|_P exp(-decay t) for every system of the list and its convex hull.

    Parameters
    ----------
    P : ndarray, shape (n, n)
        Hermitian and positive definite; the norm is |e|_P = sqrt(e^H P e).
    form : {"continuous", "delta"}
        Whether the systems are de/dt = M e or (e_{k+1} - e_k)/h = M e_k.
    h : float
        Sampling interval of the delta form, s; zero for the continuous form.
    decay_rate : float
        What was asked for, 1/s.
    decay : float
        Smallest verified rate over all points, less `rounding` and `between`, 1/s. In delta form |e|_P shrinks by
        1 - h decay a sample, which is at least as fast as exp(-h decay).
    rates : ndarray, shape (N,)
        Verified rate at each point, less rounding, 1/s.
    eigen_rates : ndarray, shape (N,)
        Rate of the slowest eigenvalue at each point, 1/s: what no P can exceed.
    condition : float
        Condition number of P after scaling its diagonal to one, so independent of units.
    smallest : float
        Smallest eigenvalue of that scaled P.
    rounding : float
        Bound of the floating-point error that was subtracted, 1/s.
    between : float
        Allowance that was subtracted for parameters between the points of a dense grid, from second differences,
        1/s; zero where the points are vertices and convexity covers the rest.
    points : int
        Number of systems verified.
    solver, status : str
        Where P came from and what the solver said about it.
    """

    P: Array
    form: Form
    h: float
    decay_rate: float
    decay: float
    rates: Array
    eigen_rates: Array
    condition: float
    smallest: float
    rounding: float
    between: float
    points: int
    solver: str = "given"
    status: str = "given"

    def norm(self, e: ArrayLike) -> Array:
        """Norm in which errors shrink.

        Parameters
        ----------
        e : array_like, shape (..., n)
            Errors.

        Returns
        -------
        ndarray, shape (...)
            sqrt(e^H P e).
        """
        x = np.asarray(e)
        return np.sqrt(np.maximum(np.einsum("...i,ij,...j->...", x.conj(), self.P, x).real, 0.0))


def matrices(owner: str, name: str, value: ArrayLike, shape: tuple[int | None, ...]) -> Array:
    """Check an array of numbers and return it as float or complex.

    Parameters
    ----------
    owner, name : str
        Shown in errors.
    value : array_like
        What the caller gave.
    shape : tuple of int or None
        Wanted shape; None stands for any length.

    Returns
    -------
    ndarray

    Raises
    ------
    ParameterError
        If it is not numeric, not finite or of another shape.
    """
    try:
        x = np.asarray(value)
        x = x.astype(complex if np.iscomplexobj(x) else float)
    except (TypeError, ValueError) as error:
        raise ParameterError(f"{owner}: {name} is not an array of numbers of one shape ({error}).") from None
    wanted = "(" + ", ".join("any" if n is None else str(n) for n in shape) + ")"
    if x.ndim != len(shape) or any(n is not None and n != k for n, k in zip(shape, x.shape, strict=False)):
        raise ParameterError(f"{owner}: {name} has shape {x.shape}; must be {wanted}.")
    if not np.isfinite(x).all():
        place = tuple(int(k) for k in np.argwhere(~np.isfinite(x))[0])
        raise ParameterError(f"{owner}: {name}{list(place)} = {x[place]}; every entry must be finite.")
    return x


def check_form(owner: str, form: object, h: object) -> float:
    """Check the form of the systems and its sampling interval.

    Parameters
    ----------
    owner : str
        Shown in errors.
    form : {"continuous", "delta"}
        What the caller gave.
    h : float or None
        Sampling interval, s; only for the delta form.

    Returns
    -------
    float
        The sampling interval; zero for the continuous form.

    Raises
    ------
    ParameterError
        If the form is another word, or h is missing, not positive, or given for the continuous form.
    """
    if form not in ("continuous", "delta"):
        raise ParameterError(f'{owner}: form = {form!r}; must be "continuous" or "delta".')
    if form == "continuous":
        if h is not None:
            raise ParameterError(f'{owner}: h = {h!r} s with the continuous form; choose form="delta" or leave h out.')
        return 0.0
    if h is None:
        raise ParameterError(f"{owner}: the delta form needs the sampling interval h in s.")
    step = float(matrices(owner, "h", h, ()).real)  # type: ignore[arg-type]
    if step <= 0:
        raise ParameterError(f"{owner}: h = {step:g} s; must be > 0 s.")
    return step


def check_rate(owner: str, value: object, h: float) -> float:
    """Check a decay rate.

    Parameters
    ----------
    owner : str
        Shown in errors.
    value : float
        What the caller gave, 1/s.
    h : float
        Sampling interval, s; zero for the continuous form.

    Returns
    -------
    float

    Raises
    ------
    ParameterError
        If it is not a finite number >= 0, or not below 1/h in delta form.
    """
    x = matrices(owner, "decay_rate", value, ())  # type: ignore[arg-type]
    if np.iscomplexobj(x) or x < 0:
        raise ParameterError(f"{owner}: decay_rate = {x} 1/s; must be a real number >= 0 1/s (positive is stable).")
    if h > 0 and x * h >= 1:
        raise ParameterError(
            f"{owner}: decay_rate = {x:g} 1/s with h = {h:g} s; must be below 1/h = {1 / h:g} 1/s, where the error "
            "is gone after one sample; lower it or sample faster."
        )
    return float(x)


def contraction(P: Array, M: Array, h: float, magnitude: Array | None = None) -> tuple[Array, Array, Array]:
    """Rate at which sqrt(e^H P e) falls along each system, with a bound of its floating-point error.

    With P = L L^H and W = L^H M L^-H the rate is -lambda_max((W + W^H)/2) in continuous form, and
    (1 - |I + h W|)/h in delta form. Any nonsingular L defines a norm, so the error of the Cholesky factors does not
    matter; the errors of the two products and of M itself do.

    Parameters
    ----------
    P : ndarray, shape (n, n)
        Hermitian matrix.
    M : ndarray, shape (N, n, n)
        Systems.
    h : float
        Sampling interval, s; zero for the continuous form.
    magnitude : ndarray, shape (N, n, n), optional
        Sum of the magnitudes of the terms that M was made of; the magnitude of M by default.

    Returns
    -------
    rates : ndarray, shape (N,)
        1/s, not yet rounded.
    rounding : ndarray, shape (N,)
        Bound of the error of the rate, 1/s.
    W : ndarray, shape (N, n, n)
        Systems in coordinates in which the norm is Euclidean.

    Raises
    ------
    NotVerifiedError
        If P is not Hermitian or not positive definite.
    """
    n = len(P)
    size = np.abs(P)
    d = np.sqrt(np.maximum(np.diag(P).real, 0.0))
    if not (np.abs(P - P.conj().T) <= 1e-12 * np.outer(d, d)).all():
        raise NotVerifiedError(
            f"P is not Hermitian: entries differ from their mirror images by up to {np.abs(P - P.conj().T).max():.3g} "
            f"at size {size.max():.3g}; symmetrise it first."
        )
    try:
        L = np.linalg.cholesky((P + P.conj().T) / 2)
        upper = solve_triangular(L, np.eye(n), lower=True).conj().T  # L^-H
    except np.linalg.LinAlgError:
        raise NotVerifiedError(
            f"P is not positive definite: its smallest eigenvalue is {np.linalg.eigvalsh((P + P.conj().T) / 2)[0]:.3g} "
            f"of {size.max():.3g}; e^H P e is no norm, so it proves nothing."
        ) from None
    W = L.conj().T @ M @ upper
    left, right = np.abs(L.conj().T), np.abs(upper)
    total = np.linalg.norm(left @ (np.abs(M) if magnitude is None else magnitude) @ right @ left @ right, axis=(1, 2))
    rounding = 4 * (n + 2) * _EPS * total
    if h == 0.0:
        rates = -np.linalg.eigvalsh((W + np.swapaxes(W, 1, 2).conj()) / 2)[:, -1]
    else:
        rates = (1 - np.linalg.norm(np.eye(n) + h * W, ord=2, axis=(1, 2))) / h
        rounding = rounding + 4 * (n + 2) * _EPS / h
    return rates, rounding, W


def certify(
    P: Array, M: Array, *, decay_rate: float, form: Form, h: float, name: str, magnitude: Array | None = None,
    dense: bool = False, solver: str = "given", status: str = "given",
) -> Certificate:  # fmt: skip
    """Make a certificate from a matrix P, or refuse it.

    Parameters
    ----------
    P : ndarray, shape (n, n)
        Hermitian matrix.
    M : ndarray, shape (N, n, n)
        Systems, checked arrays.
    decay_rate : float
        Rate that must be reached, 1/s.
    form, h
        As in `Certificate`.
    name : str
        Name of the problem, shown in errors.
    magnitude : ndarray, optional
        As in `contraction`.
    dense : bool
        Whether the systems are neighbours on a grid of one parameter, so that what lies between is allowed for.
    solver, status : str
        As in `Certificate`.

    Returns
    -------
    Certificate

    Raises
    ------
    NotVerifiedError
        If P is no norm or the rate is not reached at some point.
    """
    source = "" if solver == "given" else f" (solver {solver}, status {status})"
    if not np.isfinite(P).all():
        raise NotVerifiedError(f"{name}{source}: P has entries that are not finite.")
    try:
        raw, error, W = contraction(P, M, h, magnitude)
    except NotVerifiedError as wrong:
        raise NotVerifiedError(f"{name}{source}: {wrong}") from None
    rates = raw - error
    between = 0.0
    if dense and len(M) > 2:
        bend = W[2:] - 2 * W[1:-1] + W[:-2]
        between = float(np.linalg.norm(bend, ord=2, axis=(1, 2)).max()) / 8
        between = between if between > error.max() else 0.0  # nothing but rounding: the systems lie on a line
    worst = int(np.argmin(rates))
    decay = float(rates[worst]) - between
    values = np.linalg.eigvals(M)
    eigen = -values.real.max(axis=1) if h == 0.0 else (1 - np.abs(1 + h * values).max(axis=1)) / h
    if not decay >= decay_rate:
        raise NotVerifiedError(
            f"{name}{source}: P proves a decay rate of {decay:.6g} 1/s, not the {decay_rate:.6g} 1/s asked for; the "
            f"worst of {len(M)} points is number {worst} (its slowest eigenvalue: {eigen[worst]:.6g} 1/s). Lower the "
            "decay rate, narrow the range of the parameters, or give more vertices."
        )
    d = np.sqrt(np.diag(P).real)
    spectrum = np.linalg.eigvalsh(P / np.outer(d, d))
    return Certificate(
        P=P,
        form=form,
        h=h,
        decay_rate=decay_rate,
        decay=decay,
        rates=rates,
        eigen_rates=eigen,
        condition=float(spectrum[-1] / spectrum[0]),
        smallest=float(spectrum[0]),
        rounding=float(error.max()),
        between=between,
        points=len(M),
        solver=solver,
        status=status,
    )


def verify_decay(
    P: ArrayLike, A: ArrayLike, *, decay_rate: float = 0.0, form: Form = "continuous", h: float | None = None,
    C: ArrayLike | None = None, gain: Gain | ArrayLike | None = None, nu: ArrayLike | None = None,
    dense: bool = False, name: str = "verify_decay",
) -> Certificate:  # fmt: skip
    """Verify that one matrix P proves a decay rate for all systems, without any solver.

    Parameters
    ----------
    P : array_like, shape (n, n)
        Hermitian matrix.
    A : array_like, shape (N, n, n) or (n, n)
        Systems; with a gain the error systems A - K C are verified.
    decay_rate : float
        Rate that must be reached, 1/s.
    form : {"continuous", "delta"}
        Meaning of the systems, see `Certificate`.
    h : float, optional
        Sampling interval of the delta form, s.
    C : array_like, shape (p, n), optional
        Output matrix; goes with the gain.
    gain : Gain or array_like, shape (n, p), optional
        Observer gain.
    nu : array_like, shape (N,) or (N, m), optional
        Scheduling parameters of the systems; needed by a scheduled gain.
    dense : bool
        Whether neighbours in the list are neighbours on a grid of one parameter; the rate then carries an allowance
        for what lies between, by second differences.
    name : str
        Shown in errors.

    Returns
    -------
    Certificate

    Raises
    ------
    ParameterError
        If an argument has a wrong shape, is not finite, or one of C and gain is missing.
    NotVerifiedError
        If P does not prove the rate.

    References
    ----------
    S. Boyd, L. El Ghaoui, E. Feron, V. Balakrishnan, Linear Matrix Inequalities in System and Control Theory (SIAM,
    1994), section 5.1. Thesis 5.2.2, B.2.
    """
    step = check_form(name, form, h)
    rate = check_rate(name, decay_rate, step)
    one = np.asarray(A)
    systems = matrices(name, "A", one[None] if one.ndim == 2 else A, (None, None, None))
    N, n = systems.shape[:2]
    if N == 0 or n == 0 or systems.shape[2] != n:
        raise ParameterError(f"{name}: A has shape {systems.shape}; must be (N, n, n), at least one square matrix.")
    norm = matrices(name, "P", P, (n, n))
    if (C is None) != (gain is None):
        raise ParameterError(f"{name}: give both C and gain, or neither.")
    if C is None or gain is None:
        return certify(norm, systems, decay_rate=rate, form=form, h=step, name=name, dense=dense)
    out = matrices(name, "C", C, (None, n))
    if isinstance(gain, Gain):
        if gain.scheduled and nu is None:
            raise ParameterError(f"{name}: the gain is scheduled; give nu, one row a system.")
        K = gain.at(0.0 if nu is None else np.asarray(nu, dtype=float).reshape(N, -1))
    else:
        K = matrices(name, "gain", gain, (n, len(out)))
    magnitude = np.abs(systems) + np.abs(K) @ np.abs(out)
    return certify(
        norm, systems - K @ out, decay_rate=rate, form=form, h=step, name=name, magnitude=magnitude, dense=dense
    )
