"""Thesis 5.2: adaptive observers for any bilinear system with unknown constant parameters.

The class is

    dx/dt = (A_0 + sum theta_i A_i) x + (B_0 + sum theta_i B_i) u
        y = C x + sum theta_i D_i u

with known matrices and unknown real parameters theta. Two observers: the direct one, whose parameter law comes from
one Lyapunov function and needs P A_i = C^H F_i, and the filtered-regressor one, which needs no such equality. The
shorted motor is one member of the class; nothing here knows it. Gains come from `adaptive_design`.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pumplib.errors import ParameterError, SimulationError
from pumplib.observers.certificate import matrices

Array = NDArray[Any]


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class BilinearSystem:
    """Bilinear system with m unknown parameters, n states, r inputs and p outputs; real or complex.

    Parameters
    ----------
    A0 : array_like, shape (n, n)
        Known part of the system matrix.
    A : array_like, shape (m, n, n)
        What each parameter adds to it.
    B0 : array_like, shape (n, r)
        Known part of the input matrix.
    B : array_like, shape (m, n, r)
        What each parameter adds to it.
    C : array_like, shape (p, n)
        Output matrix.
    D : array_like, shape (m, p, r)
        What each parameter feeds from the input to the output.
    names : tuple of str
        Names of the parameters, with units.
    name : str
        Shown in errors.
    """

    A0: Array
    A: Array
    B0: Array
    B: Array
    C: Array
    D: Array
    names: tuple[str, ...]
    name: str = "system"

    def __post_init__(self) -> None:
        shape: dict[str, tuple[int | None, ...]] = {"A0": (None, None), "B0": (None, None), "C": (None, None)}
        found = {key: matrices(self.name, key, getattr(self, key), want) for key, want in shape.items()}
        n, r, p, m = len(found["A0"]), found["B0"].shape[1], len(found["C"]), len(self.names)
        if min(n, r, p, m) < 1:
            raise ParameterError(f"{self.name}: needs at least one state, input, output and parameter.")
        wanted = {
            "A0": (n, n), "B0": (n, r), "C": (p, n), "A": (m, n, n), "B": (m, n, r), "D": (m, p, r),
        }  # fmt: skip
        for key, want in wanted.items():
            value = matrices(self.name, key, getattr(self, key), want)
            if not np.isfinite(value).all():
                raise ParameterError(f"{self.name}: {key} holds a value that is not finite.")
            object.__setattr__(self, key, np.ascontiguousarray(value, dtype=complex))
        for i, label in enumerate(self.names):
            if not (self.A[i].any() or self.B[i].any() or self.D[i].any()):
                raise ParameterError(
                    f"{self.name}: parameter {label} acts nowhere (A_i = B_i = D_i = 0); leave it out."
                )

    @property
    def is_complex(self) -> bool:
        """Whether a matrix has an imaginary part: outputs then count twice, as real and imaginary part."""
        return any(
            np.iscomplexobj(x) and bool(x.imag.any()) for x in (self.A0, self.A, self.B0, self.B, self.C, self.D)
        )

    def system_matrix(self, theta: ArrayLike) -> Array:
        """A_0 + sum theta_i A_i.

        Parameters
        ----------
        theta : array_like, shape (m,) or (N, m)
            Parameters.

        Returns
        -------
        ndarray, shape (n, n) or (N, n, n)
        """
        return np.asarray(self.A0 + np.einsum("...i,iab->...ab", np.asarray(theta, dtype=float), self.A))

    def input_matrix(self, theta: ArrayLike) -> Array:
        """B_0 + sum theta_i B_i.

        Parameters
        ----------
        theta : array_like, shape (m,) or (N, m)
            Parameters.

        Returns
        -------
        ndarray, shape (n, r) or (N, n, r)
        """
        return np.asarray(self.B0 + np.einsum("...i,iab->...ab", np.asarray(theta, dtype=float), self.B))


def _vector(
    owner: str, name: str, value: ArrayLike, length: int, low: float = -math.inf, *, finite: bool = True
) -> Array:
    x = np.asarray(value, dtype=float)
    if x.shape != (length,) or np.isnan(x).any() or (finite and not np.isfinite(x).all()) or (x < low).any():
        limit = "" if low == -math.inf else f", each >= {low:g}"
        raise ParameterError(f"{owner}: {name} = {x!r}; give {length} numbers{limit}, one a parameter.")
    return x


def _positive(owner: str, name: str, value: float, unit: str) -> float:
    if isinstance(value, bool) or not (isinstance(value, (int, float, np.number)) and 0 < float(value) < math.inf):
        raise ParameterError(f"{owner}: {name} = {value!r} {unit}; must be a positive number.")
    return float(value)


def _record(system: BilinearSystem, u: ArrayLike, y: ArrayLike | None) -> tuple[Array, Array]:
    r, p = system.B0.shape[1], len(system.C)
    inputs = np.ascontiguousarray(matrices(system.name, "u", u, (None, r)), dtype=complex)
    if len(inputs) < 2:
        raise ParameterError(f"{system.name}: u has {len(inputs)} samples; give at least two.")
    if y is None:
        return inputs, inputs
    outputs = np.ascontiguousarray(matrices(system.name, "y", y, (len(inputs), p)), dtype=complex)
    return inputs, outputs


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Estimate:
    """Result of an observer, time first.

    Parameters
    ----------
    t : ndarray, shape (N,)
        Times from the first sample, s.
    theta : ndarray, shape (N, m)
        Parameters.
    x : complex ndarray, shape (N, n)
        States.
    e : complex ndarray, shape (N, p)
        Output errors before the sample was used.
    limited : ndarray of bool, shape (N,)
        Where a parameter was held at its limit.
    deviation : ndarray, shape (N, m) or None
        Standard deviations that the filtered-regressor observer works with.
    """

    t: Array
    theta: Array
    x: Array
    e: Array
    limited: Array
    deviation: Array | None = None


def simulate_system(
    system: BilinearSystem, theta: ArrayLike, u: ArrayLike, h: float, x0: ArrayLike
) -> tuple[Array, Array]:
    """Simulate the system, exactly for inputs that are straight lines between the samples.

    Parameters
    ----------
    system : BilinearSystem
        The system.
    theta : array_like, shape (m,) or (N, m)
        Parameters, constant or one row a sample.
    u : array_like, shape (N, r)
        Inputs.
    h : float
        Step, s.
    x0 : array_like, shape (n,)
        Initial state.

    Returns
    -------
    x, y : complex ndarray, shape (N, n), (N, p)
        States and outputs.

    Raises
    ------
    ParameterError
        If a shape is wrong or a value not finite.
    SimulationError
        If the states leave the finite numbers.
    """
    from pumplib.observers.adaptive_kernel import run_system

    inputs, _ = _record(system, u, None)
    rows, n, m = len(inputs), len(system.A0), len(system.names)
    step = _positive(system.name, "h", h, "s")
    courses = np.asarray(theta, dtype=float)
    if courses.shape not in ((m,), (rows, m)) or not np.isfinite(courses).all():
        raise ParameterError(f"{system.name}: theta has shape {courses.shape}; give ({m},) or ({rows}, {m}), finite.")
    x = np.empty((rows, n), complex)
    x[0] = matrices(system.name, "x0", x0, (n,))
    y = np.empty((rows, len(system.C)), complex)
    run_system(
        system.A0, system.A, system.B0, system.B, system.C, system.D,
        np.ascontiguousarray(np.broadcast_to(courses, (rows, m))), inputs, step, x, y,
    )  # fmt: skip
    _finite(system.name, x, step)
    return x, y


def _finite(name: str, x: Array, h: float, what: str = "simulation") -> None:
    good = np.isfinite(x).all(axis=1)
    if not good.all():
        raise SimulationError(
            f"{name}: the {what} left the finite numbers at t = {int(np.argmin(good)) * h:.4g} s; use a shorter step, "
            "smaller rates of adaptation or a smaller gain."
        )


def _box(owner: str, limits: Sequence[tuple[float, float]] | None, m: int) -> tuple[Array, Array]:
    if limits is None:
        return np.full(m, -np.inf), np.full(m, np.inf)
    pairs = np.asarray(limits, dtype=float)
    if pairs.shape != (m, 2) or not (pairs[:, 0] < pairs[:, 1]).all():
        raise ParameterError(
            f"{owner}: limits = {limits!r}; give (low, high) with low < high for each of {m} parameters."
        )
    return pairs[:, 0].copy(), pairs[:, 1].copy()


def _gain(system: BilinearSystem, K: ArrayLike) -> Array:
    """Gain K_0, K_1, ... of every parameter; a constant gain has zeros there."""
    n, p, m = len(system.A0), len(system.C), len(system.names)
    one = np.asarray(K)
    full = np.zeros((1 + m, n, p), complex)
    if one.shape == (n, p):
        full[0] = matrices(system.name, "K", one, (n, p))
    else:
        full[:] = matrices(system.name, "K", one, (1 + m, n, p))
    return full


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class DirectObserver:
    """Direct Lyapunov observer: state and parameters from one quadratic function.

    dx/dt = A(theta) x + B(theta) u + K(theta) e, e = y - C x - sum theta_i D_i u, and
    dtheta_i/dt = rate_i Re(e^H (F_i x + G_i u + D_i u)). The law follows from the Lyapunov function where
    P A_i = C^H F_i and P B_i = C^H G_i; on D_i it is a gradient, without that guarantee.

    Parameters
    ----------
    system : BilinearSystem
        The model.
    K : array_like, shape (n, p) or (1 + m, n, p)
        Gain, constant or K_0 + sum theta_i K_i with the estimated parameters, 1/s.
    F, G : array_like, shape (m, p, n), (m, p, r)
        Factors of the structural equalities.
    rates : array_like, shape (m,)
        Rates of adaptation, Gamma_i.
    limits : sequence of (float, float), optional
        Box in which the parameters are held; `Estimate.limited` says when.
    """

    system: BilinearSystem
    K: Array
    F: Array
    G: Array
    rates: Array
    limits: Sequence[tuple[float, float]] | None = None

    def __post_init__(self) -> None:
        s = self.system
        m, p, n, r = len(s.names), len(s.C), len(s.A0), s.B0.shape[1]
        object.__setattr__(self, "K", _gain(s, self.K))
        for key, shape in (("F", (m, p, n)), ("G", (m, p, r))):
            value = matrices(s.name, key, getattr(self, key), shape)
            object.__setattr__(self, key, np.ascontiguousarray(value, dtype=complex))
        object.__setattr__(self, "rates", _vector(s.name, "rates", self.rates, m, 0.0))
        _box(s.name, self.limits, m)

    def run(self, u: ArrayLike, y: ArrayLike, h: float, *, x0: ArrayLike, theta0: ArrayLike) -> Estimate:
        """Run over a record.

        Parameters
        ----------
        u, y : array_like, shape (N, r), (N, p)
            Inputs and measurements, equally spaced.
        h : float
            Sampling interval, s.
        x0, theta0 : array_like, shape (n,), (m,)
            Initial estimates.

        Returns
        -------
        Estimate

        Raises
        ------
        ParameterError
            If a shape is wrong or a value not finite.
        SimulationError
            If the observer diverges.
        """
        from pumplib.observers.adaptive_kernel import run_direct

        s = self.system
        inputs, outputs, x, theta, e, limited, low, high, step = _prepared(s, self.limits, u, y, h, x0, theta0)
        run_direct(
            s.A0, s.A, s.B0, s.B, s.C, s.D, self.K, self.F, self.G, self.rates, low, high, inputs, outputs, step, x,
            theta, e, limited,
        )  # fmt: skip
        _finite(s.name, np.hstack([x, theta]), step, "direct observer")
        return Estimate(t=step * np.arange(len(x)), theta=theta, x=x, e=e, limited=limited)


def _prepared(
    s: BilinearSystem, limits: Sequence[tuple[float, float]] | None, u: ArrayLike, y: ArrayLike, h: float,
    x0: ArrayLike, theta0: ArrayLike,
) -> tuple[Array, Array, Array, Array, Array, Array, Array, Array, float]:  # fmt: skip
    inputs, outputs = _record(s, u, y)
    rows, n, m = len(inputs), len(s.A0), len(s.names)
    low, high = _box(s.name, limits, m)
    x, theta = np.empty((rows, n), complex), np.empty((rows, m))
    x[0] = matrices(s.name, "x0", x0, (n,))
    theta[0] = _vector(s.name, "theta0", theta0, m)
    if (theta[0] < low).any() or (theta[0] > high).any():
        raise ParameterError(f"{s.name}: theta0 = {theta[0]} lies outside the limits {limits}.")
    e, limited = np.empty((rows, len(s.C)), complex), np.zeros(rows, bool)
    return inputs, outputs, x, theta, e, limited, low, high, _positive(s.name, "h", h, "s")


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class FilteredRegressorObserver:
    """Observer whose parameters see the output error through the regressor that the state's dynamics leave of it.

    The filtered regressor Upsilon obeys the error dynamics driven by what a parameter does to the state; with
    phi = C Upsilon + D the output error is phi (theta - estimate) plus a decaying rest, and least squares finds the
    parameters. Needs a stable A(theta) - K C only.

    Parameters
    ----------
    system : BilinearSystem
        The model.
    K : array_like, shape (n, p) or (1 + m, n, p)
        Gain, constant or K_0 + sum theta_i K_i with the estimated parameters, 1/s; of the delta form.
    noise : float
        Variance of a real part of an output, its unit squared: sets the speed against `spread`.
    lags : array_like, shape (m,)
        Time constant with which each parameter is followed, s; infinite for one that never changes.
    spread : array_like, shape (m,)
        Initial standard deviation of each parameter, also its largest.
    power_lag : float
        Time constant of the mean of the squared regressors, s.
    limits : sequence of (float, float), optional
        Box in which the parameters are held; `Estimate.limited` says when.

    References
    ----------
    Q. Zhang, Adaptive observer for multiple-input-multiple-output (MIMO) linear time-varying systems, IEEE Trans.
    Automatic Control 47 (2002) 525-529, for a state-space form with known matrices; the feedthrough, the estimated
    parameter in A and the least-squares form are added.
    """

    system: BilinearSystem
    K: Array
    noise: float
    lags: Array
    spread: Array
    power_lag: float = 0.02
    limits: Sequence[tuple[float, float]] | None = None

    def __post_init__(self) -> None:
        s = self.system
        m = len(s.names)
        object.__setattr__(self, "K", _gain(s, self.K))
        object.__setattr__(self, "noise", _positive(s.name, "noise", self.noise, "output unit squared"))
        object.__setattr__(self, "power_lag", _positive(s.name, "power_lag", self.power_lag, "s"))
        for key, finite in (("lags", False), ("spread", True)):
            value = _vector(s.name, key, getattr(self, key), m, 0.0, finite=finite)
            if (value == 0).any():
                raise ParameterError(f"{s.name}: {key} = {value}; must be positive, one a parameter.")
            object.__setattr__(self, key, value)
        _box(s.name, self.limits, m)

    def run(self, u: ArrayLike, y: ArrayLike, h: float, *, x0: ArrayLike, theta0: ArrayLike) -> Estimate:
        """Run over a record.

        Parameters
        ----------
        u, y : array_like, shape (N, r), (N, p)
            Inputs and measurements, equally spaced.
        h : float
            Sampling interval, s.
        x0, theta0 : array_like, shape (n,), (m,)
            Initial estimates.

        Returns
        -------
        Estimate

        Raises
        ------
        ParameterError
            If a shape is wrong or a value not finite.
        SimulationError
            If the observer diverges.
        """
        from pumplib.observers.adaptive_kernel import run_filtered

        s = self.system
        inputs, outputs, x, theta, e, limited, low, high, step = _prepared(s, self.limits, u, y, h, x0, theta0)
        deviation = np.empty_like(theta)
        both = s.is_complex or bool(inputs.imag.any() or outputs.imag.any())
        run_filtered(
            s.A0, s.A, s.B0, s.B, s.C, s.D, self.K, self.noise, self.lags, self.power_lag, self.spread, low, high,
            both, inputs, outputs, step, x, theta, e, limited, deviation,
        )  # fmt: skip
        _finite(s.name, np.hstack([x, theta]), step, "filtered-regressor observer")
        return Estimate(t=step * np.arange(len(x)), theta=theta, x=x, e=e, limited=limited, deviation=deviation)
