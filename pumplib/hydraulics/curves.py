"""Thesis 3.3.2, 3.3.3, 3.3.4: the forms of head (3.24) and torque (3.19) fitted to measured pump curves.

Beyond the thesis: uncertainty of the coefficients, leave-one-out prediction, and a check of where the rows come
from, since a curve tabulated from a polynomial, or copied from another pump, is no evidence for a form.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pumplib.errors import DataError
from pumplib.hydraulics.curve_table import PumpCurve, different_values, read_curves

__all__ = [
    "CurveFit",
    "CurveShape",
    "Provenance",
    "PumpCurve",
    "PumpFit",
    "explain",
    "fit_curve",
    "provenance",
    "read_curves",
    "shape",
]

Array = NDArray[Any]
_FOUR_DIGITS = 1e-4  # relative to the range: what counts as the same number, or as lying on a polynomial
_HIGH_LEVERAGE = 0.7


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class CurveFit:
    """Least-squares fit of ``y = c0 omega^2 + c1 omega Q - c2 Q^2``.

    Parameters
    ----------
    names : tuple of str
        ``("a_h0", "a_h1", "a_h2")`` in Pa s2, Pa s2/m3, Pa s2/m6 or ``("a_t0", "a_t1", "a_t2")`` in
        N m s2, N m s2/m3, N m s2/m6.
    coefficients, standard_errors : ndarray, shape (3,)
        Estimates and standard errors. They assume independent errors of equal size; `misfit_p` and
        `durbin_watson` tell whether that is credible.
    intervals : ndarray, shape (3, 2)
        95 % t-intervals.
    covariance : ndarray, shape (3, 3)
        Of the coefficients.
    fitted, residuals : ndarray, shape (n,)
        In the order of the curve, Pa or N m; residual = measured - fitted.
    predicted : ndarray, shape (n,)
        Each point from coefficients fitted without it (leave-one-out).
    leverage : ndarray, shape (n,)
        Weight of each point in its own fitted value, 0..1.
    r2, loo_r2 : float
        Coefficient of determination of the fit and of `predicted`, both about the mean of all points.
    max_residual : float
        Largest |residual|, Pa or N m.
    max_residual_relative : float
        Largest |residual| over the largest measured value.
    durbin_watson : float
        About 2 for independent residuals, small when neighbours have the same sign.
    runs : int
        Number of runs of equal sign along the curve.
    misfit_p : float
        p value (F test) of the further terms Q^3/omega and, from seven points on, Q^4/omega^2; small means that
        the misfit is systematic. NaN with four points.
    condition : float
        Condition number of the scaled regression matrix.
    """

    names: tuple[str, str, str]
    coefficients: Array
    standard_errors: Array
    intervals: Array
    covariance: Array
    fitted: Array
    residuals: Array
    predicted: Array
    leverage: Array
    r2: float
    loo_r2: float
    max_residual: float
    max_residual_relative: float
    durbin_watson: float
    runs: int
    misfit_p: float
    condition: float

    def __call__(self, flow: ArrayLike, omega: ArrayLike) -> Array:
        """Evaluate the fitted form.

        Parameters
        ----------
        flow, omega : array_like
            m3/s and rad/s, broadcast.

        Returns
        -------
        ndarray
            Pa or N m.
        """
        return np.asarray(_terms(np.asarray(flow), np.asarray(omega)) @ self.coefficients)

    def band(self, flow: ArrayLike, omega: ArrayLike) -> tuple[Array, Array]:
        """95 % confidence band of the fitted curve (of its mean, not of a new point).

        Parameters
        ----------
        flow, omega : array_like
            m3/s and rad/s, broadcast.

        Returns
        -------
        low, high : ndarray
            Pa or N m.
        """
        terms = _terms(np.asarray(flow), np.asarray(omega))
        half = _t_95(self.fitted.size - 3) * np.sqrt(np.einsum("...i,ij,...j", terms, self.covariance, terms))
        middle = terms @ self.coefficients
        return middle - half, middle + half


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class PumpFit:
    """Head and torque of one pump in the thesis's forms.

    Parameters
    ----------
    name : str
        Name of the pump.
    head : CurveFit
        Form (3.24), pressure in Pa.
    torque : CurveFit
        Form (3.19) in steady state, torque in N m.
    """

    name: str
    head: CurveFit
    torque: CurveFit


@dataclass(frozen=True, kw_only=True, slots=True)
class Provenance:
    """Whether the rows of a pump are evidence of their own.

    Parameters
    ----------
    name : str
        Name of the pump.
    copy_of : str or None
        Earlier pump of the same file of which at least half of the rows (flow, pressure; after scaling by the
        affinity laws) are repeated.
    shared : float
        Share of rows in common with `copy_of`, or the largest share with any earlier pump.
    scaled_speeds : bool
        Whether the pump's own speeds are scaled copies of one another: calculated by the affinity laws, so they
        count once and say nothing about these laws.
    head_degree, torque_degree : int or None
        Degree <= 3 of the polynomial in Q on which the rows lie to four digits, else None.
    reasons : tuple of str
        Why the pump is not counted; empty for an independent one.
    """

    name: str
    copy_of: str | None
    shared: float
    scaled_speeds: bool
    head_degree: int | None
    torque_degree: int | None
    reasons: tuple[str, ...]

    @property
    def independent(self) -> bool:
        """Whether the head curve counts as evidence for a form."""
        return self.copy_of is None and self.head_degree is None


@dataclass(frozen=True, kw_only=True, slots=True)
class CurveShape:
    """Features of a measured curve that tell why a quadratic may not fit it.

    Parameters
    ----------
    plateau : float
        Share of the flow range in which the pressure stays within 2 % of its value at the least flow.
    plateau_of_fit : float
        The same for the fitted form (3.24).
    inflection : bool
        Whether the curvature changes its sign by more than the noise.
    rises_first : bool
        Whether the pressure rises by more than 1 % before it falls.
    power_peak : float
        Flow of the largest power over the largest flow.
    power_drop : float
        Fall of the power from its peak to the largest flow, relative to the peak.
    best_efficiency : float
        Largest ratio of hydraulic to stated power.
    largest_power : float
        W.
    largest_gap : float
        Largest distance of neighbouring flows, as a share of the flow range.
    """

    plateau: float
    plateau_of_fit: float
    inflection: bool
    rises_first: bool
    power_peak: float
    power_drop: float
    best_efficiency: float
    largest_power: float
    largest_gap: float


def _terms(flow: Array, omega: Array) -> Array:
    return np.stack(np.broadcast_arrays(omega**2, omega * flow, -(flow**2)), axis=-1)


def _t_95(dof: int) -> float:
    from scipy.stats import t

    return float(t.ppf(0.975, dof))


def _least_squares(X: Array, y: Array) -> tuple[Array, Array, Array]:
    """Solution, residuals and inverse triangular factor of a regression, by QR."""
    Q, R = np.linalg.qr(X)
    inverse = np.linalg.solve(R, np.eye(R.shape[0]))
    solution = inverse @ (Q.T @ y)
    return solution, y - X @ solution, inverse


def _fit(curve: PumpCurve, y: Array, names: tuple[str, str, str]) -> CurveFit:
    flow, omega = curve.flow, curve.omega
    # flow, speed and values scaled to one: the columns then differ in shape, not by twelve powers of ten
    top_omega, top_flow, top = omega.max(), flow.max(), np.abs(y).max()
    w, x = omega / top_omega, flow / top_flow
    X, z = _terms(x, w), y / top
    n = z.size
    scaled, residual, inverse = _least_squares(X, z)
    leverage = np.sum((X @ inverse) ** 2, axis=1)
    variance = float(residual @ residual) / (n - 3)
    units = top / np.array([top_omega**2, top_omega * top_flow, top_flow**2])
    covariance = variance * (inverse @ inverse.T) * np.outer(units, units)
    errors = np.sqrt(np.diag(covariance))
    coefficients = scaled * units
    half = _t_95(n - 3) * errors
    # a point predicted without itself, in closed form; four different Q/omega keep every leverage below one
    left_out = residual / (1 - leverage)
    spread = float(np.sum((z - z.mean()) ** 2))
    if spread == 0:
        what = "pressures" if names[0] == "a_h0" else "torques"
        raise DataError(f"pump {curve.name!r}: all {what} are equal; R2 and the form have nothing to explain.")
    residuals = top * residual
    power = float(residual @ residual)
    signs = np.sign(residual)
    return CurveFit(
        names=names,
        coefficients=coefficients,
        standard_errors=errors,
        intervals=np.stack([coefficients - half, coefficients + half], axis=1),
        covariance=covariance,
        fitted=y - residuals,
        residuals=residuals,
        predicted=y - top * left_out,
        leverage=leverage,
        r2=1 - power / spread,
        loo_r2=1 - float(left_out @ left_out) / spread,
        max_residual=float(np.abs(residuals).max()),
        max_residual_relative=float(np.abs(residual).max()),
        durbin_watson=float(np.sum(np.diff(residual) ** 2)) / power if power > 0 else 2.0,
        runs=1 + int(np.sum(signs[1:] != signs[:-1])),
        misfit_p=_misfit_p(X, x / w, w, z),
        condition=float(np.linalg.cond(X)),
    )


def _misfit_p(X: Array, ratio: Array, w: Array, z: Array) -> float:
    """Test terms beyond the form, scaled as the affinity laws ask; p value, NaN if there are too few points."""
    further = 2 if z.size >= 7 else 1
    dof = z.size - 3 - further
    if dof < 1:
        return float("nan")
    wider = np.column_stack([X, *(w**2 * ratio ** (3 + k) for k in range(further))])
    if np.linalg.matrix_rank(wider) < wider.shape[1]:
        return float("nan")
    narrow, full = (float(np.sum(_least_squares(A, z)[1] ** 2)) for A in (X, wider))
    if full <= 1e-28 * float(z @ z):  # nothing but rounding is left to compare with
        return float("nan") if narrow <= 1e-28 * float(z @ z) else 0.0
    from scipy.stats import f

    return float(f.sf((narrow - full) / further / (full / dof), further, dof))


def fit_curve(curve: PumpCurve) -> PumpFit:
    """Fit head (3.24) and steady torque (3.19) to a measured curve.

    Parameters
    ----------
    curve : PumpCurve
        All its speeds are fitted together.

    Returns
    -------
    PumpFit

    Raises
    ------
    DataError
        If all pressures or all torques are equal.

    References
    ----------
    Thesis (3.24) with rho g absorbed, and (3.19) with T = P/omega.
    """
    return PumpFit(
        name=curve.name,
        head=_fit(curve, curve.pressure, ("a_h0", "a_h1", "a_h2")),
        torque=_fit(curve, curve.torque, ("a_t0", "a_t1", "a_t2")),
    )


def provenance(curves: Sequence[PumpCurve]) -> list[Provenance]:
    """Find curves that are copies of another pump's or tabulated from a polynomial.

    A copy is counted once: the first pump of the file that holds the rows is the original.

    Parameters
    ----------
    curves : sequence of PumpCurve
        The curves of one collection.

    Returns
    -------
    list of Provenance
        In the same order.
    """
    found: list[Provenance] = []
    for k, curve in enumerate(curves):
        shares = [_shared(curve, other) for other in curves[:k]]
        shared = max(shares, default=0.0)
        original = curves[int(np.argmax(shares))].name if shared >= 0.5 else None
        head = _polynomial_degree(curve.flow / curve.omega, curve.pressure / curve.omega**2)
        torque = _polynomial_degree(curve.flow / curve.omega, curve.power / curve.omega**3)
        scaled = _scaled_speeds(curve)
        reasons = []
        if original is not None:
            reasons.append(f"{100 * shared:.0f} % of its rows are those of {original}")
        if head is not None:
            reasons.append(f"its pressures lie on a polynomial of degree {head} to four digits: tabulated from a fit")
        if torque is not None:
            reasons.append(f"its powers lie on a polynomial of degree {torque} to four digits: tabulated from a fit")
        if scaled:
            reasons.append("its speeds are scaled copies of one another by the affinity laws: they count once")
        found.append(
            Provenance(
                name=curve.name,
                copy_of=original,
                shared=shared,
                scaled_speeds=scaled,
                head_degree=head,
                torque_degree=torque,
                reasons=tuple(reasons),
            )
        )
    return found


def _shared(curve: PumpCurve, other: PumpCurve) -> float:
    """Share of the rows (flow, pressure) of the shorter curve that the other has too, up to affinity scaling."""
    own = np.stack([curve.flow / curve.omega, curve.pressure / curve.omega**2], axis=1)
    its = np.stack([other.flow / other.omega, other.pressure / other.omega**2], axis=1)
    scale = np.maximum(own.max(axis=0), its.max(axis=0))
    equal = np.all(np.abs(own[:, None] - its[None]) <= _FOUR_DIGITS * scale, axis=2)
    # a row counts once on either side, so that repeated rows cannot make up a majority
    return min(int(equal.any(axis=0).sum()), int(equal.any(axis=1).sum())) / min(len(own), len(its))


def _scaled_speeds(curve: PumpCurve) -> bool:
    speeds = np.unique(curve.omega)
    one, *rest = (_rows(curve, curve.omega == speed) for speed in speeds)
    return any(_shared(one, other) >= 0.5 for other in rest)


def _rows(curve: PumpCurve, which: Array) -> PumpCurve:
    return PumpCurve(
        name=curve.name,
        omega=curve.omega[which],
        flow=curve.flow[which],
        pressure=curve.pressure[which],
        power=curve.power[which],
    )


def _polynomial_degree(x: Array, y: Array) -> int | None:
    """Smallest degree <= 3 of a polynomial through all points to four digits, if that is no accident."""
    x, y = x / x.max(), y / np.abs(y).max()
    points = different_values(x)
    for degree in range(4):
        # two points more than coefficients need: fewer always lie close to a polynomial
        if points <= degree + 2:
            return None
        X = np.vander(x, degree + 1)
        if float(np.abs(_least_squares(X, y)[1]).max()) <= _FOUR_DIGITS:
            return degree
    return None


def shape(curve: PumpCurve, fit: PumpFit) -> CurveShape:
    """Measure the features of a curve that `explain` speaks about.

    Parameters
    ----------
    curve : PumpCurve
        The curve. With several speeds all points are brought together by the affinity laws.
    fit : PumpFit
        Its fit.

    Returns
    -------
    CurveShape
    """
    ratio = curve.flow / curve.omega
    order = np.argsort(ratio, kind="stable")
    x = ratio[order] / ratio.max()
    pressure = (curve.pressure / curve.omega**2)[order]
    fitted = (fit.head.fitted / curve.omega**2)[order]
    power = (curve.power / curve.omega**3)[order]
    # slopes need different flows; repeated ones are averaged
    x, group = np.unique(x, return_inverse=True)
    count = np.bincount(group)
    pressure, fitted, power = (np.bincount(group, v) / count for v in (pressure, fitted, power))
    slope = np.diff(pressure) / np.diff(x)
    turn = np.diff(slope)
    big = np.abs(turn) > 0.05 * np.abs(slope).max()
    peak = int(np.argmax(power))
    return CurveShape(
        plateau=_plateau(x, pressure),
        plateau_of_fit=_plateau(x, fitted),
        inflection=bool(np.any(big & (turn > 0)) and np.any(big & (turn < 0))),
        rises_first=bool(pressure.max() > 1.01 * pressure[0]),
        power_peak=float(x[peak]),
        power_drop=float(1 - power[-1] / power[peak]),
        best_efficiency=float(np.nanmax(curve.efficiency)),
        largest_power=float(curve.power.max()),
        largest_gap=float(np.diff(x).max() / (x[-1] - x[0])),
    )


def _plateau(x: Array, y: Array) -> float:
    """Flow, as a share of the range, at which a curve first leaves 2 % around its first value."""
    away = np.abs(y / y[0] - 1) - 0.02
    outside = np.flatnonzero(away > 0)
    if outside.size == 0:
        return 1.0
    k = int(outside[0])
    # straight line between the last point inside and the first outside
    return float(x[k - 1] + (x[k] - x[k - 1]) * away[k - 1] / (away[k - 1] - away[k]) - x[0]) / float(1 - x[0])


def explain(curve: PumpCurve, fit: PumpFit, *, least_r2: float = 0.99) -> tuple[str, ...]:
    """Say why a pump falls short of the forms, from features of the measured curve.

    Parameters
    ----------
    curve : PumpCurve
        The curve.
    fit : PumpFit
        Its fit.
    least_r2 : float
        R^2 that head and torque should reach, in the fit and left out.

    Returns
    -------
    tuple of str
        Sentences; empty if nothing falls short.
    """
    features = shape(curve, fit)
    sentences = []
    if min(fit.head.r2, fit.head.loo_r2) < least_r2:
        sentences += _explain_head(features, fit.head)
    if min(fit.torque.r2, fit.torque.loo_r2) < least_r2:
        sentences += _explain_torque(features, fit.torque)
    return tuple(sentences)


def _short(what: str, fit: CurveFit) -> str:
    return (
        f"{what}: R2 {fit.r2:.4f}, left out {fit.loo_r2:.4f}, largest residual {100 * fit.max_residual_relative:.1f} %."
    )


def _systematic(fit: CurveFit) -> list[str]:
    if fit.misfit_p < 0.05:
        return [
            f"The misfit is systematic (terms of higher order have p = {fit.misfit_p:.2g}): it is not independent "
            "noise but the form, or a smooth error of the drawn curve."
        ]
    return []


def _carried(features: CurveShape, fit: CurveFit) -> list[str]:
    """Name a point that the prediction of all others hangs on, if there is one."""
    left_out = fit.residuals / (1 - fit.leverage)
    k = int(np.argmax(np.abs(left_out)))
    if fit.leverage[k] < _HIGH_LEVERAGE:
        return []
    share = 100 * left_out[k] ** 2 / float(left_out @ left_out)
    gap = ""
    if features.largest_gap > 0.3:
        gap = f"; no point lies in {100 * features.largest_gap:.0f} % of the flow range"
    return [
        f"Point {k + 1} of {left_out.size} carries the curve (leverage {fit.leverage[k]:.2f}{gap}): left out, it must "
        f"be extrapolated and makes {share:.0f} % of the left-out squared error."
    ]


def _explain_head(features: CurveShape, fit: CurveFit) -> list[str]:
    causes = []
    if features.plateau > 1.5 * features.plateau_of_fit and features.plateau > 0.2:
        causes.append(
            f"The pressure stays within 2 % over the first {100 * features.plateau:.0f} % of the flow range and then "
            f"falls; a quadratic of the same fall leaves that band at {100 * features.plateau_of_fit:.0f} %. A flat "
            "part and a knee are the mark of a limited or controlled speed or pressure: the curve shows the "
            "controller, not the impeller."
        )
    if features.inflection:
        causes.append("The curvature changes its sign along the curve, which a quadratic cannot follow.")
    if features.rises_first:
        causes.append("The pressure rises before it falls (unstable branch at low flow).")
    causes += _carried(features, fit)
    if not causes:
        causes.append("No plateau, inflection, rise or single decisive point was found: the cause is not visible here.")
    return [_short("Head", fit), *_systematic(fit), *causes]


def _explain_torque(features: CurveShape, fit: CurveFit) -> list[str]:
    causes = []
    if features.power_peak < 0.98 and features.power_drop > 0.01:
        causes.append(
            f"The power has its maximum at {100 * features.power_peak:.0f} % of the largest flow and falls by "
            f"{100 * features.power_drop:.0f} % after it."
        )
    if features.plateau > 1.5 * features.plateau_of_fit and features.plateau > 0.2:
        causes.append("The head of the same pump has a plateau and a knee: a limit acts on the power as well.")
    if features.best_efficiency < 0.6:
        # wet-rotor circulators stay below one half from plug to water, pumps on a shaft seldom do
        likely = "probably" if features.best_efficiency < 0.5 else "possibly"
        causes.append(
            f"The best ratio of hydraulic to stated power is {100 * features.best_efficiency:.0f} % at "
            f"{features.largest_power:.0f} W: the power is {likely} electric, with motor and electronics in it; "
            "P/omega is then not the shaft torque of (3.19)."
        )
    causes += _carried(features, fit)
    if not causes:
        causes.append("No cause is visible in the curve itself.")
    return [_short("Torque", fit), *_systematic(fit), *causes]
