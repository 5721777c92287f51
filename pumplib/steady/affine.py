"""Thesis 7.3: affine arithmetic with a bound on every rounding error, compiled; the default enclosure.

A value is c + sum_i k_i zeta_i + e eta with |zeta_i| <= 1 shared between all values and |eta| <= 1 its own. Sums are
exact in this form; products, roots and reciprocals add their nonlinear part to e.

Products: with rho = rad(x) / rad(y) the nonlinear part of x y is ((d_x + rho d_y)^2 - (d_x - rho d_y)^2) / (4 rho), so
it lies in [-rad(x - rho y)^2, rad(x + rho y)^2] / (4 rho). That is never wider than the usual rad(x) rad(y) and
tight for squares. Roots and reciprocals: any slope alpha gives an enclosure; the best one (Chebyshev) is computed in
floating point and the offset of the function from the line alpha x is bounded for the alpha actually used.

Rounding: one operation of round-to-nearest has a relative error of at most u = 2^-53. The coefficients of a product
are rounded three times, each time by at most u times its terms, so their errors sum to less than
2.01 u (|x_0| rad(y) + |y_0| rad(x)); this and the like for the other operations is added to e. What is computed for e
itself is a sum of less than n + 40 non-negative terms and is multiplied by `1 + 4 (n + 40) u`. No fused operations
are allowed here, though they would do no harm to these bounds.

Thirty-two samples are computed side by side, one in each lane of a flat buffer.

References: L. H. de Figueiredo and J. Stolfi, Affine arithmetic: concepts and applications, Numerical Algorithms 37
(2004); S. M. Rump and M. Kashiwagi, Implementation and improvements of affine arithmetic, NOLTA 6 (2015).
"""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pumplib.decide.strict import strict_inline, strict_kernel

Array = NDArray[Any]
LANES = 32
U = 2.0**-53
_TINY = 1e-290  # more than all underflows of one operation together
_TRIG = 16.0 * U  # sine and cosine of the C library, with room
_INF = math.inf


@strict_inline
def inverse_line(lo, hi):  # type: ignore[no-untyped-def]
    """Line alpha x + beta +- delta that encloses 1/x on [lo, hi], 0 < lo.

    Parameters
    ----------
    lo, hi : float
        Ends.

    Returns
    -------
    tuple of float
        alpha, beta, delta.
    """
    alpha = 1.0 / (lo * hi)
    # 1/x + alpha x is convex: least 2 sqrt(alpha) anywhere, largest at an end
    least = 2.0 * math.sqrt(alpha)
    a, b = 1.0 / lo + alpha * lo, 1.0 / hi + alpha * hi
    most = max(a, b)
    return -alpha, 0.5 * (least + most), 0.5 * (most - least) + 8.0 * U * most


@strict_inline
def root_line(lo, hi):  # type: ignore[no-untyped-def]
    """Line alpha x + beta +- delta that encloses the square root on [lo, hi], 0 <= lo < hi or 0 < lo.

    Parameters
    ----------
    lo, hi : float
        Ends.

    Returns
    -------
    tuple of float
        alpha, beta, delta.
    """
    a, b = math.sqrt(lo), math.sqrt(hi)
    alpha = 1.0 / (a + b)
    # sqrt(x) - alpha x is concave: largest 1 / (4 alpha) anywhere, least at an end
    most = 0.25 / alpha
    least = min(a - alpha * lo, b - alpha * hi)
    return alpha, 0.5 * (least + most), 0.5 * (most - least) + 8.0 * U * (most + b)


@strict_kernel
def affine_block(code, constant, start, columns, pairs, factors, left, right, inputs, n, buf):  # type: ignore[no-untyped-def]
    """Run a tape over one block of lanes.

    Parameters
    ----------
    code, constant, start, columns, pairs, factors, left, right : ndarray
        The tape (`pumplib.steady.tape.Tape`).
    inputs : int
        Number of inputs.
    n : int
        Number of uncertain quantities.
    buf : ndarray, shape (slots, n + 3, LANES)
        Centre, coefficients, e and radius of every slot; inputs filled, the rest zero where the tape writes nothing.
    """
    grow = 1.0 + 4.0 * (n + 40) * U
    pair_grow = 1.0 + 4.0 * n * n * U
    total, rs, rd, slope = np.empty(LANES), np.empty(LANES), np.empty(LANES), np.empty(LANES)
    dev = np.empty(LANES)
    E, R, slots = n + 1, n + 2, buf.shape[0]  # an INNER holds rows of pairs in place of slots, not used as such
    for q in range(code.shape[0]):
        op = code[q, 0]
        first, last = start[q], start[q + 1]
        X, Y, Z = buf[code[q, 1] % slots], buf[code[q, 2] % slots], buf[inputs + q]
        for m in range(LANES):
            total[m] = 0.0
        if op == 0 or op == 1:  # sum, difference
            sign = 1.0 if op == 0 else -1.0
            for j in range(first, last):
                k = 1 + columns[j]
                for m in range(LANES):
                    z = X[k, m] + sign * Y[k, m]
                    Z[k, m] = z
                    total[m] += abs(z)
            for m in range(LANES):
                c = X[0, m] + sign * Y[0, m]
                Z[0, m] = c
                rounding = 2.0 * U * (abs(c) + total[m]) + _TINY
                Z[E, m] = (X[E, m] + Y[E, m] + rounding) * grow
        elif op == 2:  # product
            for m in range(LANES):
                # any positive ratio is allowed
                both = X[R, m] > 0.0 and Y[R, m] > 0.0
                slope[m] = X[R, m] / Y[R, m] if both else 1.0
                rs[m] = X[E, m] + slope[m] * Y[E, m]
                rd[m] = rs[m]
            for j in range(first, last):
                k = 1 + columns[j]
                for m in range(LANES):
                    b = slope[m] * Y[k, m]
                    rs[m] += abs(X[k, m] + b)
                    rd[m] += abs(X[k, m] - b)
                    z = X[0, m] * Y[k, m] + Y[0, m] * X[k, m]
                    Z[k, m] = z
                    total[m] += abs(z)
            for m in range(LANES):
                # a small difference of k_x and k_y carries the rounding of both
                slack = 4.0 * U * (X[R, m] + slope[m] * Y[R, m])
                # a factor without any spread leaves nothing but the linear part
                share = grow / (4.0 * slope[m]) if X[R, m] > 0.0 and Y[R, m] > 0.0 else 0.0
                high = (rs[m] + slack) * (rs[m] + slack) * share
                low = (rd[m] + slack) * (rd[m] + slack) * share
                x0, y0 = abs(X[0, m]), abs(Y[0, m])
                c = X[0, m] * Y[0, m] + 0.5 * (high - low)
                Z[0, m] = c
                linear = x0 * Y[R, m] + y0 * X[R, m]
                rounding = 4.0 * U * (linear + x0 * y0 + abs(c) + high + low) + _TINY
                own = x0 * Y[E, m] + y0 * X[E, m]
                Z[E, m] = (own + 0.5 * (high + low) + rounding) * grow
        elif op == 3:  # square
            for j in range(first, last):
                k = 1 + columns[j]
                for m in range(LANES):
                    z = 2.0 * X[0, m] * X[k, m]
                    Z[k, m] = z
                    total[m] += abs(z)
            for m in range(LANES):
                x0 = abs(X[0, m])
                high = X[R, m] * X[R, m] * grow
                c = x0 * x0 + 0.5 * high
                Z[0, m] = c
                rounding = 4.0 * U * (2.0 * x0 * X[R, m] + x0 * x0 + c + high) + _TINY
                Z[E, m] = (2.0 * x0 * X[E, m] + 0.5 * high + rounding) * grow
        elif op == 12:  # sum of products
            for j in range(first, last):
                k = 1 + columns[j]
                for m in range(LANES):
                    Z[k, m] = 0.0
            for m in range(LANES):
                rs[m], rd[m], slope[m] = 0.0, 0.0, 0.0  # centre, own errors, size of all terms
            for t in range(code[q, 1], code[q, 2]):
                A, D = buf[pairs[t, 0]], buf[pairs[t, 1]]
                for j in range(first, last):
                    k = 1 + columns[j]
                    for m in range(LANES):
                        Z[k, m] += A[0, m] * D[k, m] + D[0, m] * A[k, m]
                for m in range(LANES):
                    a, b = abs(A[0, m]), abs(D[0, m])
                    rs[m] += A[0, m] * D[0, m]
                    rd[m] += a * D[E, m] + b * A[E, m] + A[E, m] * D[R, m] + (A[R, m] - A[E, m]) * D[E, m]
                    slope[m] += (a + A[R, m]) * (b + D[R, m])
            # nonlinear part: sum over j, l of |sum_t a_tj d_tl|, where correlated coefficients cancel
            for j in range(factors[q, 0], factors[q + 1, 0]):
                kj = 1 + left[j]
                for i in range(factors[q, 1], factors[q + 1, 1]):
                    ki = 1 + right[i]
                    for m in range(LANES):
                        dev[m] = 0.0
                    for t in range(code[q, 1], code[q, 2]):
                        A, D = buf[pairs[t, 0]], buf[pairs[t, 1]]
                        for m in range(LANES):
                            dev[m] += A[kj, m] * D[ki, m]
                    for m in range(LANES):
                        rd[m] += abs(dev[m])
            terms = 4.0 * (code[q, 2] - code[q, 1] + 2)
            for j in range(first, last):
                k = 1 + columns[j]
                for m in range(LANES):
                    total[m] += abs(Z[k, m])
            for m in range(LANES):
                Z[0, m] = rs[m]
                Z[E, m] = (rd[m] + terms * U * slope[m] + _TINY) * grow * pair_grow
        elif op == 11:  # a number
            for m in range(LANES):
                Z[0, m] = X[0, m]
        else:  # a function of one variable: line with slope and offset rs, error rd
            for m in range(LANES):
                r = X[R, m] * grow
                c = X[0, m]
                # one more relative step outwards covers the rounding of the difference and the sum
                lo, hi = (c - r) - 4.0 * U * (abs(c) + r), (c + r) + 4.0 * U * (abs(c) + r)
                if op == 4:
                    slope[m], rs[m], rd[m] = constant[q], 0.0, 0.0
                elif op == 5:
                    slope[m], rs[m], rd[m] = 1.0, constant[q], 0.0
                elif op == 10:
                    # the reciprocal is off by u at most
                    slope[m], rs[m] = 1.0 / constant[q], 0.0
                    rd[m] = 2.0 * U * abs(slope[m]) * (abs(c) + r)
                elif op == 6 and lo > 0.0:
                    slope[m], rs[m], rd[m] = inverse_line(lo, hi)
                elif op == 6 and hi < 0.0:
                    slope[m], beta, rd[m] = inverse_line(-hi, -lo)
                    rs[m] = -beta
                elif op == 7 and lo > 0.0:
                    slope[m], rs[m], rd[m] = root_line(lo, hi)
                elif op == 8 or op == 9:
                    # cos x = cos c - sin c d - cos c d^2/2 up to |d|^3/6, and sin likewise
                    f = math.cos(c) if op == 8 else math.sin(c)
                    g = -math.sin(c) if op == 8 else math.cos(c)
                    slope[m] = g
                    rs[m] = f - g * c - 0.25 * f * r * r
                    wide = 1.0 + abs(g * c) + r * r
                    rd[m] = (0.25 * abs(f) * r * r + r * r * r / 6.0) * grow + _TRIG * (wide + r) + 8.0 * U * wide
                else:
                    slope[m], rs[m], rd[m] = 0.0, 0.0, _INF
            for j in range(first, last):
                k = 1 + columns[j]
                for m in range(LANES):
                    z = slope[m] * X[k, m]
                    Z[k, m] = z
                    total[m] += abs(z)
            for m in range(LANES):
                a = abs(slope[m])
                c = slope[m] * X[0, m] + rs[m]
                Z[0, m] = c
                rounding = 4.0 * U * (a * (abs(X[0, m]) + X[R, m]) + abs(rs[m]) + abs(c)) + _TINY
                Z[E, m] = (a * X[E, m] + rd[m] + rounding) * grow
        for m in range(LANES):
            Z[R, m] = total[m] + Z[E, m]


@strict_kernel
def affine_run(  # type: ignore[no-untyped-def]
    code, constant, start, columns, pairs, factors, left, right, outputs,
    centers, generators, absolute, relative, low, high, center, k, e,
):  # fmt: skip
    """Enclose relations for many samples.

    Parameters
    ----------
    code, constant, start, columns, pairs, factors, left, right, outputs : ndarray
        The tape.
    centers : ndarray, shape (samples, channels)
        Measured values.
    generators : ndarray, shape (parameters, 1 + n_p)
        Centre of each parameter and its coefficients.
    absolute, relative : ndarray, shape (channels,)
        Radius of a channel is absolute + relative |value|.
    low, high : ndarray, shape (samples, m)
        Receive the bounds.
    center, k, e : ndarray, shape (samples or 0, m), (samples or 0, m, n), (samples or 0, m)
        Receive the affine forms; without rows they are not kept.
    """
    samples, channels = centers.shape
    parameters, n_p = generators.shape[0], generators.shape[1] - 1
    n = n_p + channels
    inputs = channels + parameters
    grow = 1.0 + 4.0 * (n + 40) * U
    buf = np.zeros((inputs + code.shape[0], n + 3, LANES))
    for p in range(parameters):
        for j in range(n_p + 1):
            for m in range(LANES):
                buf[channels + p, j, m] = generators[p, j]
                if j > 0:
                    buf[channels + p, n + 2, m] += abs(generators[p, j])
    for begin in range(0, samples, LANES):
        here = min(LANES, samples - begin)
        for i in range(channels):
            for m in range(LANES):
                value = centers[min(begin + m, samples - 1), i]
                buf[i, 0, m] = value
                # at least the stated radius in exact arithmetic
                r = (absolute[i] + relative[i] * abs(value)) * (1.0 + 8.0 * U)
                buf[i, 1 + n_p + i, m] = r
                buf[i, n + 2, m] = r
        affine_block(code, constant, start, columns, pairs, factors, left, right, inputs, n, buf)
        for o in range(outputs.shape[0]):
            Z = buf[outputs[o]]
            for m in range(here):
                radius, c = Z[n + 2, m], Z[0, m]
                radius = (radius + 2.0 * U * (abs(c) + radius)) * grow
                good = radius < _INF and c == c
                low[begin + m, o] = c - radius if good else -_INF
                high[begin + m, o] = c + radius if good else _INF
                if center.shape[0] > 0:
                    center[begin + m, o] = c
                    e[begin + m, o] = Z[n + 1, m] if good else _INF
                    for j in range(n):
                        k[begin + m, o, j] = Z[1 + j, m]
