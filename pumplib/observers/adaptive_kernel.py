"""Thesis 5.2: compiled time steps of the general adaptive observers, for any small bilinear system.

Everything is complex; a real system is the special case without imaginary parts. Between two samples the input is
a straight line and the parameters are constant, and the linear system is then solved by its Taylor series, in as
many pieces as its norm needs: exact to rounding, with no matrix exponential. The observers inject their output
error once a sample (innovation form), so a vanishing error disturbs nothing, whatever the gain.
"""

import math
from typing import Any

import numpy as np

from pumplib.kernels import kernel

_LONGEST = 1e3  # norm of the system times the step beyond which nothing is computed any more
_TERMS = 16  # Taylor terms; with a norm of at most one they are exact to rounding


@kernel
def combine(A0: Any, A: Any, theta: Any, out: Any) -> None:
    """Matrix at given parameters, A_0 + sum theta_i A_i.

    Parameters
    ----------
    A0 : ndarray, shape (a, b)
        Known part.
    A : ndarray, shape (m, a, b)
        Part of each parameter.
    theta : ndarray, shape (m,)
        Parameters.
    out : ndarray, shape (a, b)
        Receives the result.
    """
    for r in range(A0.shape[0]):
        for c in range(A0.shape[1]):
            value = A0[r, c]
            for i in range(theta.shape[0]):
                value += theta[i] * A[i, r, c]
            out[r, c] = value


@kernel
def times(M: Any, x: Any, out: Any) -> None:
    """Product of a matrix and a vector.

    Parameters
    ----------
    M : ndarray, shape (a, b)
        Matrix.
    x : ndarray, shape (b,)
        Vector.
    out : ndarray, shape (a,)
        Receives the result; not x itself.
    """
    for r in range(M.shape[0]):
        value = 0j
        for c in range(M.shape[1]):
            value += M[r, c] * x[c]
        out[r] = value


@kernel
def advance(M: Any, x: Any, b: Any, slope: Any, h: float, term: Any, work: Any) -> None:
    """Solve dx/dt = M x + b + slope t over one step.

    Parameters
    ----------
    M : ndarray, shape (n, n)
        System.
    x : ndarray, shape (n,)
        State; updated.
    b, slope : ndarray, shape (n,)
        Input at the start and its slope.
    h : float
        Step, s. Where it is a thousand time constants or more the state becomes NaN.
    term, work : ndarray, shape (n,)
        Scratch.
    """
    n = x.shape[0]
    size = 0.0
    for r in range(n):
        row = 0.0
        for c in range(n):
            row += abs(M[r, c])
        size = max(size, row)
    if not size * h < _LONGEST:  # parameters or states ran away, or the step is absurd: let it show
        for r in range(n):
            x[r] = complex(math.nan, math.nan)
        return
    pieces = max(1, math.ceil(size * h))
    d = h / pieces
    for piece in range(pieces):
        start = piece * d
        times(M, x, term)
        for r in range(n):
            term[r] = d * (term[r] + b[r] + slope[r] * start)
            x[r] += term[r]
        for k in range(2, _TERMS + 1):
            times(M, term, work)
            for r in range(n):
                value = d * work[r]
                if k == 2:
                    value += d * d * slope[r]
                term[r] = value / k
                x[r] += term[r]


@kernel
def run_system(A0: Any, A: Any, B0: Any, B: Any, C: Any, D: Any, theta: Any, u: Any, h: float, x: Any, y: Any) -> None:
    """Simulate a bilinear system.

    Parameters
    ----------
    A0, A, B0, B, C, D : ndarray
        The system, see `BilinearSystem`.
    theta : ndarray, shape (N, m)
        Parameters, constant from a sample to the next.
    u : ndarray, shape (N, r)
        Inputs, straight lines between the samples.
    h : float
        Step, s.
    x : ndarray, shape (N, n)
        Receives the states; the first row holds the initial one.
    y : ndarray, shape (N, p)
        Receives the outputs.
    """
    n, p = A0.shape[0], C.shape[0]
    M, Bt = np.empty_like(A0), np.empty_like(B0)
    Dt, nought = np.empty((p, u.shape[1]), np.complex128), np.zeros((p, u.shape[1]), np.complex128)
    now, b, nxt = np.empty(n, np.complex128), np.empty(n, np.complex128), np.empty(n, np.complex128)
    term, work, seen, fed = (
        np.empty(n, np.complex128),
        np.empty(n, np.complex128),
        np.empty(p, np.complex128),
        np.empty(p, np.complex128),
    )
    for r in range(n):
        now[r] = x[0, r]
    for k in range(u.shape[0]):
        combine(nought, D, theta[k], Dt)
        times(C, now, seen)
        times(Dt, u[k], fed)
        for j in range(p):
            y[k, j] = seen[j] + fed[j]
        for r in range(n):
            x[k, r] = now[r]
        if k + 1 == u.shape[0]:
            break
        combine(A0, A, theta[k], M)
        combine(B0, B, theta[k], Bt)
        times(Bt, u[k], b)
        times(Bt, u[k + 1], nxt)
        for r in range(n):
            nxt[r] = (nxt[r] - b[r]) / h
        advance(M, now, b, nxt, h, term, work)


@kernel
def output_error(
    C: Any, D: Any, theta: Any, x: Any, u: Any, y: Any, fed: Any, e: Any
) -> None:  # fmt: skip
    """Output error, and what each parameter feeds through.

    Parameters
    ----------
    C, D : ndarray
        Of the system.
    theta, x, u, y : ndarray
        Estimates, input and measurement of one sample.
    fed : ndarray, shape (m, p)
        Receives D_i u.
    e : ndarray, shape (p,)
        Receives y - C x - sum theta_i D_i u.
    """
    times(C, x, e)
    for j in range(e.shape[0]):
        e[j] = y[j] - e[j]
    for i in range(theta.shape[0]):
        times(D[i], u, fed[i])
        for j in range(e.shape[0]):
            e[j] -= theta[i] * fed[i, j]


@kernel
def bounded(theta: Any, low: Any, high: Any) -> bool:
    """Keep the parameters in their box.

    Parameters
    ----------
    theta, low, high : ndarray, shape (m,)
        Parameters, updated; limits.

    Returns
    -------
    bool
        Whether one was moved.
    """
    moved = False
    for i in range(theta.shape[0]):
        kept = min(max(theta[i], low[i]), high[i])
        if kept != theta[i]:
            moved = True
        theta[i] = kept
    return moved


@kernel
def run_direct(
    A0: Any, A: Any, B0: Any, B: Any, C: Any, D: Any, K: Any, F: Any, G: Any, rates: Any, low: Any, high: Any,
    u: Any, y: Any, h: float, x: Any, theta: Any, errors: Any, limited: Any,
) -> None:  # fmt: skip
    """Run the direct Lyapunov observer.

    Parameters
    ----------
    A0, A, B0, B, C, D : ndarray
        The system.
    K : ndarray, shape (1 + m, n, p)
        Gain K_0 + sum theta_i K_i, 1/s.
    F, G : ndarray, shape (m, p, n), (m, p, r)
        Parameter law dtheta_i/dt = rate_i Re(e^H (F_i x + G_i u + D_i u)).
    rates, low, high : ndarray, shape (m,)
        Rates of adaptation and limits.
    u, y : ndarray, shape (N, r), (N, p)
        Inputs and measurements.
    h : float
        Sampling interval, s.
    x, theta, errors : ndarray, shape (N, n), (N, m), (N, p)
        Receive the estimates and output errors; the first rows of x and theta hold the initial values.
    limited : ndarray of bool, shape (N,)
        Receives where a parameter was held at its limit.
    """
    n, m, p = A0.shape[0], A.shape[0], C.shape[0]
    M, Bt, Kt = np.empty_like(A0), np.empty_like(B0), np.empty((n, p), np.complex128)
    now, b, slope = np.empty(n, np.complex128), np.empty(n, np.complex128), np.empty(n, np.complex128)
    term, work, push = np.empty(n, np.complex128), np.empty(n, np.complex128), np.empty(n, np.complex128)
    e, part, fed = np.empty(p, np.complex128), np.empty(p, np.complex128), np.empty((m, p), np.complex128)
    more = np.empty(p, np.complex128)
    t = theta[0].copy()
    for r in range(n):
        now[r] = x[0, r]
    for k in range(u.shape[0]):
        output_error(C, D, t, now, u[k], y[k], fed, e)
        for r in range(n):
            x[k, r] = now[r]
        for j in range(p):
            errors[k, j] = e[j]
        for i in range(m):
            theta[k, i] = t[i]
        if k + 1 == u.shape[0]:
            break
        combine(A0, A, t, M)
        combine(B0, B, t, Bt)
        combine(K[0], K[1:], t, Kt)
        times(Kt, e, push)
        for i in range(m):
            times(F[i], now, part)
            times(G[i], u[k], more)
            change = 0.0
            for j in range(p):
                whole = part[j] + more[j] + fed[i, j]
                change += e[j].real * whole.real + e[j].imag * whole.imag
            t[i] += h * rates[i] * change
        limited[k] = bounded(t, low, high)
        times(Bt, u[k], b)
        times(Bt, u[k + 1], slope)
        for r in range(n):
            slope[r] = (slope[r] - b[r]) / h
        advance(M, now, b, slope, h, term, work)
        for r in range(n):
            now[r] += h * push[r]


@kernel
def run_filtered(
    A0: Any, A: Any, B0: Any, B: Any, C: Any, D: Any, K: Any, noise: float, lags: Any, power_lag: float, spread: Any,
    low: Any, high: Any, is_complex: bool, u: Any, y: Any, h: float, x: Any, theta: Any, errors: Any, limited: Any,
    deviation: Any,
) -> None:  # fmt: skip
    """Run the filtered-regressor observer.

    Parameters
    ----------
    A0, A, B0, B, C, D : ndarray
        The system.
    K : ndarray, shape (1 + m, n, p)
        Gain K_0 + sum theta_i K_i, 1/s.
    noise : float
        Variance of a real part of the output, its unit squared.
    lags : ndarray, shape (m,)
        Time constant of each parameter, s; infinite: constant parameter, gain decreasing for ever.
    power_lag : float
        Time constant of the mean of the squared regressors, s.
    spread, low, high : ndarray, shape (m,)
        Initial standard deviations, which are also the largest; limits.
    is_complex : bool
        Whether the imaginary parts of the outputs are measurements.
    u, y : ndarray, shape (N, r), (N, p)
        Inputs and measurements.
    h : float
        Sampling interval, s.
    x, theta, errors, limited : ndarray
        As in `run_direct`.
    deviation : ndarray, shape (N, m)
        Receives the standard deviations that the algorithm works with.
    """
    n, m, p, inputs = A0.shape[0], A.shape[0], C.shape[0], u.shape[1]
    M, Bt, Kt = np.empty_like(A0), np.empty_like(B0), np.empty((n, p), np.complex128)
    now, b, slope = np.empty(n, np.complex128), np.empty(n, np.complex128), np.empty(n, np.complex128)
    term, work, push = np.empty(n, np.complex128), np.empty(n, np.complex128), np.empty(n, np.complex128)
    none, middle, mean_u = np.zeros(n, np.complex128), np.empty(n, np.complex128), np.empty(inputs, np.complex128)
    e, fed = np.empty(p, np.complex128), np.empty((m, p), np.complex128)
    filtered, regressor = np.zeros((m, n), np.complex128), np.empty((m, p), np.complex128)
    P, row, gain = np.zeros((m, m)), np.empty(m), np.empty(m)
    power, change = np.zeros(m), np.empty(m)
    keep = math.exp(-h / power_lag)
    full = 1.0
    for i in range(m):
        P[i, i] = spread[i] * spread[i]
    t = theta[0].copy()
    for r in range(n):
        now[r] = x[0, r]
    parts = 2 if is_complex else 1
    for k in range(u.shape[0]):
        output_error(C, D, t, now, u[k], y[k], fed, e)
        for r in range(n):
            x[k, r] = now[r]
        for j in range(p):
            errors[k, j] = e[j]
        combine(A0, A, t, M)
        combine(B0, B, t, Bt)
        combine(K[0], K[1:], t, Kt)
        full *= keep
        for i in range(m):
            times(C, filtered[i], regressor[i])
            size = 0.0
            for j in range(p):
                regressor[i, j] += fed[i, j]
                size += regressor[i, j].real ** 2 + regressor[i, j].imag ** 2
            power[i] = keep * power[i] + (1.0 - keep) * size
            # random walk that gives the parameter its time constant whatever the size of its regressor
            if power[i] > 0.0 and lags[i] < math.inf:
                P[i, i] += 2.0 * noise * (h / lags[i]) ** 2 * (1.0 - full) / power[i]
            largest = spread[i] * spread[i]
            if P[i, i] > largest:
                shrink = math.sqrt(largest / P[i, i])
                for j in range(m):
                    P[i, j] *= shrink
                    P[j, i] *= shrink
            change[i] = 0.0
        for j in range(p):
            for part in range(parts):
                for i in range(m):
                    row[i] = regressor[i, j].imag if part else regressor[i, j].real
                innovation = e[j].imag if part else e[j].real
                total = noise
                for i in range(m):
                    innovation -= row[i] * change[i]
                    value = 0.0
                    for q in range(m):
                        value += P[i, q] * row[q]
                    gain[i] = value
                    total += row[i] * value
                for i in range(m):
                    change[i] += gain[i] / total * innovation
                    for q in range(m):
                        P[i, q] -= gain[i] * gain[q] / total
        for i in range(m):
            row[i] = t[i]
            t[i] += change[i]
        limited[k] = bounded(t, low, high)
        for i in range(m):
            change[i] = t[i] - row[i]
            theta[k, i] = t[i]
            deviation[k, i] = math.sqrt(max(P[i, i], 0.0))
        if k + 1 == u.shape[0]:
            break
        times(Kt, e, push)
        times(Bt, u[k], b)
        times(Bt, u[k + 1], slope)
        for r in range(n):
            slope[r] = (slope[r] - b[r]) / h
            middle[r] = 0.5 * now[r]
        for r in range(inputs):
            mean_u[r] = 0.5 * (u[k, r] + u[k + 1, r])
        advance(M, now, b, slope, h, term, work)
        for r in range(n):
            middle[r] += 0.5 * now[r]
            now[r] += h * push[r]
        for i in range(m):
            # filtered <- (E - h K C) filtered + h (A_i x + B_i u) - h K D_i u; regressor holds C filtered + D_i u
            advance(M, filtered[i], none, none, h, term, work)
            times(Kt, regressor[i], push)
            times(A[i], middle, term)
            times(B[i], mean_u, work)
            for r in range(n):
                filtered[i, r] += h * (term[r] + work[r] - push[r])
                now[r] += filtered[i, r] * change[i]
