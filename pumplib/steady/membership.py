"""Thesis 7.3: linear programs over shared errors (beyond the thesis): is there any parameter vector that explains all?

Residuals of many samples in affine form share the parameters and the sensors' biases. A sample j says

    |c_j + k_j zeta - d_j s| <= r_j + q_j s,    zeta in the unit box, s >= 0,

where r_j holds what may differ from sample to sample and s are sizes of a supposed fault. The smallest margin t with
|...| <= (1 + t) r_j + q_j s for all j is a linear program that always has a solution; t > 0 says that nothing in the
sets explains the samples. The solver's word is not taken for it: with its multipliers a lower bound of t follows from
weak duality, and only this bound decides, so a tolerance of the solver cannot raise a false alarm.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pumplib.errors import DataError, PumplibError
from pumplib.steady.enclose import AffineForms
from pumplib.steady.sets import MeasurementErrors

Array = NDArray[Any]
_SMALL = 1e-9  # feasibility to this relative margin is called feasible


class ProgramError(PumplibError, ArithmeticError):
    """A linear program was not solved; the solver's status is in the message."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Rows:
    """Samples as rows |c + k zeta| <= r.

    Parameters
    ----------
    c : ndarray, shape (rows,)
        Centres.
    k : ndarray, shape (rows, n)
        Coefficients of the shared errors: parameters, then biases of the channels.
    r : ndarray, shape (rows,)
        What may differ from sample to sample: noise and what is not linear.
    """

    c: Array
    k: Array
    r: Array

    def __add__(self, other: "Rows") -> "Rows":
        return Rows(
            c=np.concatenate((self.c, other.c)), k=np.concatenate((self.k, other.k)),
            r=np.concatenate((self.r, other.r)),
        )  # fmt: skip


def shared_rows(
    forms: AffineForms,
    errors: MeasurementErrors,
    channels: tuple[str, ...],
    outputs: tuple[str, ...] = ("R1", "R2"),
    margin: Array | None = None,
    own: Sequence[int] = (),
) -> Rows:
    """Split affine forms into what samples share and what they do not.

    Parameters
    ----------
    forms : AffineForms
        Residuals of n samples.
    errors : MeasurementErrors
        Says which part of each channel's error is a bias.
    channels : tuple of str
        Channels of the relations.
    outputs : tuple of str
        Residuals to use. R3 follows from R1 and R2 and adds nothing here.
    margin : ndarray, shape (outputs,), optional
        Bound of the model's own error, Pa and N m, different in every sample.
    own : sequence of int, optional
        Columns of the parameter set that are not shared: those parameters may differ from sample to sample, as
        inductances do that depend on the flux.

    Returns
    -------
    Rows
        Sample by sample, in each the outputs in their order.

    Raises
    ------
    DataError
        If a relation is not defined on the set at a sample.
    """
    chosen = [forms.outputs.index(name) for name in outputs]
    n_p = forms.parameters
    _, _, share = errors.bounds(channels)
    c, k, e = forms.center[:, chosen], forms.k[:, chosen], forms.e[:, chosen]
    if not np.isfinite(e).all():
        j, o = (int(x) for x in np.argwhere(~np.isfinite(e))[0])
        raise DataError(f"sample {j}: {outputs[o]} is not defined on the whole set; shrink the set or drop the sample.")
    noise = np.abs(k[..., n_p:]) @ (1.0 - share)
    if len(own):
        k, single = k.copy(), list(own)
        noise = noise + np.abs(k[..., single]).sum(axis=-1)
        k[..., single] = 0.0
    r = noise + e + (0.0 if margin is None else np.asarray(margin, dtype=float))
    both = np.concatenate((k[..., :n_p], k[..., n_p:] * share), axis=-1)
    # the few roundings of this split, against radii that carry 1e-12 of slack
    return Rows(
        c=c.ravel(), k=both.reshape(-1, both.shape[-1]), r=r.ravel() * (1.0 + 1e-12) + 1e-12 * np.abs(c).ravel()
    )


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Sizes:
    """Sizes of a supposed fault as further unknowns.

    Parameters
    ----------
    d : ndarray, shape (rows, m)
        Effect of a unit of each size on a row.
    q : ndarray, shape (rows, m)
        How uncertain this effect is.
    low, high : ndarray, shape (m,)
        Limits of the sizes, low >= 0.
    """

    d: Array
    q: Array
    low: Array
    high: Array


class Program:
    """Smallest margin and range of a size over one set of rows, by HiGHS with warm starts.

    Parameters
    ----------
    rows : Rows
        Samples.
    sizes : Sizes, optional
        Sizes of a fault.
    """

    def __init__(self, rows: Rows, sizes: Sizes | None = None) -> None:
        import highspy

        self._inf = highspy.kHighsInf
        self._optimal = highspy.HighsModelStatus.kOptimal
        n, m = rows.k.shape[1], 0 if sizes is None else sizes.d.shape[1]
        r = rows.r[:, None]
        d = np.zeros((len(rows.c), 0)) if sizes is None else sizes.d
        q = np.zeros((len(rows.c), 0)) if sizes is None else sizes.q
        ones = np.ones((len(rows.c), 1))
        # divided by r, so that all rows are of one size: A x <= b with x = (zeta, sizes scaled, t)
        self._span = np.ones(m) if sizes is None else np.where(sizes.high > 0, sizes.high, 1.0)
        A = np.vstack((
            np.hstack((rows.k / r, (-d - q) * self._span / r, -ones)),
            np.hstack((-rows.k / r, (d - q) * self._span / r, -ones)),
        ))  # fmt: skip
        b = np.concatenate((1.0 - rows.c / rows.r, 1.0 + rows.c / rows.r))
        self._A, self._b, self._n, self._m = A, b, n, m
        low = np.zeros(m) if sizes is None else sizes.low / self._span
        high = np.zeros(m) if sizes is None else sizes.high / self._span
        # the margin may be negative down to -1: how far inside the best explanation is
        self._low = np.concatenate((-np.ones(n), low, [-1.0]))
        self._high = np.concatenate((np.ones(n), high, [1e9]))
        lp = highspy.HighsLp()
        rows_n, cols = A.shape
        lp.num_col_, lp.num_row_ = cols, rows_n
        lp.col_cost_ = np.append(np.zeros(cols - 1), 1.0)
        lp.col_lower_, lp.col_upper_ = self._low, self._high
        lp.row_lower_, lp.row_upper_ = np.full(rows_n, -self._inf), b
        mask = A != 0
        lp.a_matrix_.format_ = highspy.MatrixFormat.kRowwise
        lp.a_matrix_.start_ = np.concatenate(([0], np.cumsum(mask.sum(axis=1))))
        lp.a_matrix_.index_ = np.nonzero(mask)[1]
        lp.a_matrix_.value_ = A[mask]
        self._solver = highspy.Highs()
        self._solver.setOptionValue("output_flag", False)
        self._solver.setOptionValue("threads", 1)
        self._solver.setOptionValue("parallel", "off")
        self._solver.setOptionValue("solver", "simplex")
        self._solver.setOptionValue("presolve", "off")
        self._solver.passModel(lp)

    def _run(self) -> Array:
        self._solver.run()
        status = self._solver.getModelStatus()
        if status != self._optimal:
            raise ProgramError(f"linear program: HiGHS ended with {status}; check the rows for extreme scales.")
        return np.asarray(self._solver.getSolution().col_value)

    def _bound(self, cost: Array) -> float:
        """Lower bound of cost . x by weak duality, whatever the multipliers' accuracy."""
        y = np.maximum(-np.asarray(self._solver.getSolution().row_dual), 0.0)
        reduced = cost + self._A.T @ y
        low = reduced * np.where(reduced > 0, self._low, self._high)
        slack = 1e-13 * (np.abs(self._b) @ y + np.abs(self._A).T.dot(y) @ np.maximum(np.abs(self._low), 1.0))
        return float(low.sum() - self._b @ y - slack)

    def margin(self) -> tuple[float, float]:
        """Smallest margin with which the rows are explained.

        Returns
        -------
        value, proven : float
            Margin, relative to each row's own r, and the lower bound that duality proves. ``proven > 0`` is a proof
            that the rows cannot be explained.

        Raises
        ------
        ProgramError
            If the solver fails.
        """
        n = self._n + self._m
        cost = np.append(np.zeros(n), 1.0)
        self._solver.changeColsBounds(1, np.array([n], dtype=np.int32), self._low[-1:], self._high[-1:])
        self._costs(cost)
        return float(self._run()[-1]), self._bound(cost)

    def extreme(self, direction: Array) -> tuple[float, float]:
        """Range of a linear function of the unknowns over everything that explains the rows.

        Parameters
        ----------
        direction : ndarray, shape (n + m,)
            Coefficients of the shared errors and of the sizes.

        Returns
        -------
        low, high : float
            Outer bounds, proven by duality.

        Raises
        ------
        ProgramError
            If the rows have no explanation, or the solver fails.
        """
        n = self._n + self._m
        scaled = np.append(direction * np.concatenate((np.ones(self._n), self._span)), 0.0)
        # the solver's tolerance of reduced costs is absolute
        unit = float(np.abs(scaled).max()) or 1.0
        scaled = scaled / unit
        last, keep = np.array([n], dtype=np.int32), (self._low, self._high)
        self._solver.changeColsBounds(1, last, np.zeros(1), np.full(1, _SMALL))
        self._low, self._high = np.append(keep[0][:-1], 0.0), np.append(keep[1][:-1], _SMALL)
        ends = []
        try:
            for sign in (1.0, -1.0):
                self._costs(sign * scaled)
                self._run()
                ends.append(unit * sign * self._bound(sign * scaled))
        finally:
            self._low, self._high = keep
        return ends[0], ends[1]

    def _costs(self, cost: Array) -> None:
        self._solver.changeColsCost(len(cost), np.arange(len(cost), dtype=np.int32), cost)
