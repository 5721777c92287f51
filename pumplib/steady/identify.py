"""Thesis 7.3, 7.4: from healthy slow data to parameters, their guaranteed set and what to measure next (reconstructed).

Head and torque are linear in a_h and in (B, a_t) once speed and torque are known from the electrical signals. The
point estimate is least squares by the singular values of the regression with columns scaled to unit length; the
normal matrix is never formed. The guaranteed set is another thing: the parallelotope, along the singular directions,
around all parameters that explain every point within the stated bounds of the errors, found by linear programs.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pumplib.errors import DataError, ParameterError
from pumplib.machines import Motor
from pumplib.steady.enclose import set_model
from pumplib.steady.membership import Program, ProgramError, Rows, shared_rows
from pumplib.steady.phasors import torque_and_speed
from pumplib.steady.relations import UNITS, pump_relations, stack
from pumplib.steady.sets import MeasurementErrors, ParameterSet, box, join, own_columns

Array = NDArray[Any]
HEAD = ("a_h0", "a_h1", "a_h2")
TORQUE = ("B", "a_t0", "a_t1", "a_t2")
MOTOR = ("r_s", "L_s_prime", "R_r_prime", "G_core", "stray")
COLLINEAR = 1e-3  # singular value of the scaled regression below which a direction cannot be seen
WEAK = 0.05  # below this it is reported
_ATTEMPTS = 8


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Regression:
    """A linear fit by singular values.

    Parameters
    ----------
    names : tuple of str
        Parameters.
    estimate : ndarray, shape (p,)
        SI.
    deviation : ndarray, shape (p,)
        Standard deviation of the estimate from the scatter of the residual, SI.
    singular : ndarray, shape (p,)
        Singular values of the regression matrix with columns of unit length, largest first; 1 for all would mean
        that the parameters do not share anything.
    directions : ndarray, shape (p, p)
        Right singular vectors as rows, in the scaled parameters.
    scale : ndarray, shape (p,)
        Length of the columns.
    residual : ndarray, shape (n,)
        Measured minus fitted.
    """

    names: tuple[str, ...]
    estimate: Array
    deviation: Array
    singular: Array
    directions: Array
    scale: Array
    residual: Array

    @property
    def condition(self) -> float:
        """Largest over smallest singular value."""
        return float(self.singular[0] / self.singular[-1])

    def together(self) -> list[tuple[float, tuple[str, ...]]]:
        """Directions that the data see badly, with the parameters that cannot be told apart in them.

        Returns
        -------
        list of tuple
            Singular value and names, worst first; those below `WEAK`.
        """
        found = []
        for value, row in zip(self.singular[::-1], self.directions[::-1], strict=True):
            if value < WEAK:
                share = np.abs(row) / np.abs(row).max()
                found.append((float(value), tuple(n for n, s in zip(self.names, share, strict=True) if s > 0.3)))
        return found


def regress(names: tuple[str, ...], matrix: Array, y: Array) -> Regression:
    """Least squares through the singular values of the scaled matrix.

    Parameters
    ----------
    names : tuple of str
        Parameters, one a column.
    matrix : ndarray, shape (n, p)
        Regressors.
    y : ndarray, shape (n,)
        Measured quantity.

    Returns
    -------
    Regression

    Raises
    ------
    DataError
        If there are fewer points than parameters, or the columns are collinear; the message says which parameters
        cannot be told apart and what to vary.
    """
    n, p = matrix.shape
    if n < p:
        raise DataError(f"{n} points for the {p} parameters {', '.join(names)}: record at least {p + 2} points.")
    scale = np.linalg.norm(matrix, axis=0)
    if np.any(scale == 0):
        raise DataError(f"regressor of {names[int(np.argmin(scale))]} is zero at all points; the pump must deliver.")
    U, S, Vt = np.linalg.svd(matrix / scale, full_matrices=False)
    if S[-1] < COLLINEAR:
        worst = np.abs(Vt[-1]) / np.abs(Vt[-1]).max()
        blurred = [name for name, share in zip(names, worst, strict=True) if share > 0.1]
        raise DataError(
            f"collinear data: the points cannot tell {', '.join(blurred)} apart (least singular value {S[-1]:.2g} of "
            f"the scaled regression, needed {COLLINEAR:g}). Points on one affinity parabola (flow proportional to "
            "speed) or at one speed are the usual reason: change the valve at two speeds at least."
        )
    theta = (Vt.T / scale[:, None]) @ ((U.T @ y) / S)
    residual = y - matrix @ theta
    sigma = float(np.sqrt(residual @ residual / max(n - p, 1)))
    return Regression(
        names=names,
        estimate=theta,
        deviation=sigma * np.linalg.norm((Vt.T / scale[:, None]) / S, axis=1),
        singular=S,
        directions=Vt,
        scale=scale,
        residual=residual,
    )


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Identification:
    """Outcome of a commissioning.

    Parameters
    ----------
    head, torque : Regression
        Fits of the head, Pa, and of the torque, N m.
    guaranteed : ParameterSet
        Motor box joined with the guaranteed parallelotopes of the pump; all parameters of the relations.
    factor : float
        Smallest common factor of the stated measurement errors with which the data are explained; at most 1 where
        the statement fits.
    margin : tuple of float
        Smallest additional model errors in R1, Pa, and R2, N m, with which the data are explained; (0, 0) where the
        factor is at most 1.
    margin_used : tuple of float
        What was allowed as model error when the set was made.
    suggested : MeasurementErrors
        The stated bounds, enlarged where the data call for it.
    """

    head: Regression
    torque: Regression
    guaranteed: ParameterSet
    factor: float
    margin: tuple[float, float]
    margin_used: tuple[float, float]
    suggested: MeasurementErrors

    def report(self) -> list[tuple[str, str, float, float, float]]:
        """Identified parameters for display.

        Returns
        -------
        list of tuple
            Name, unit, estimate, standard deviation, half width of the guaranteed set.
        """
        rows = []
        radius = dict(zip(self.guaranteed.names, self.guaranteed.radius, strict=True))
        for fit in (self.head, self.torque):
            for name, value, deviation in zip(fit.names, fit.estimate, fit.deviation, strict=True):
                rows.append((name, UNITS[name], float(value), float(deviation), float(radius[name])))
        return rows


def regressors(
    motor: Motor, parameters: Mapping[str, float], signals: Mapping[str, ArrayLike]
) -> tuple[Array, Array, Array, Array]:
    """Regression matrices and measured quantities of head and torque.

    Parameters
    ----------
    motor : Motor
        Pole pairs and connection.
    parameters : mapping of str to float
        Nominal motor parameters.
    signals : mapping of str to array_like, shape (n,)
        Channels, SI.

    Returns
    -------
    head, H, torque, T : ndarray, shapes (n, 3), (n,), (n, 4), (n,)
    """
    relations = pump_relations(motor)
    x = stack(relations, signals)
    z_p, voltage, current = relations.constants
    p = parameters
    T_e, w = torque_and_speed(
        voltage * x[:, 0],
        current * x[:, 1],
        x[:, 2],
        x[:, 3],
        p["r_s"],
        p["L_s_prime"],
        p["R_r_prime"],
        p["G_core"],
        z_p,
    )
    Q = x[:, 5]
    head = np.column_stack((w**2, w * Q, -(Q**2)))
    return head, x[:, 4], np.column_stack((w, head)), T_e - p["stray"] * (current * x[:, 1]) ** 2


def identify(
    motor: Motor,
    nominal: Mapping[str, float],
    signals: Mapping[str, ArrayLike],
    errors: MeasurementErrors,
    *,
    motor_box: Mapping[str, float] | None = None,
    prior: float = 1.0,
    margin: tuple[float, float] | None = None,
    rounds: int = 12,
    own: tuple[str, ...] = (),
) -> Identification:
    """Identify the pump from healthy steady points.

    Parameters
    ----------
    motor : Motor
        The motor.
    nominal : mapping of str to float
        Motor parameters r_s, L_s_prime, R_r_prime, G_core, stray, from the data sheet.
    signals : mapping of str to array_like, shape (n,)
        Channels of healthy points, SI.
    errors : MeasurementErrors
        Stated bounds of the measurement errors.
    motor_box : mapping of str to float, optional
        Relative half widths of the motor parameters; exact where left out.
    prior : float
        Half width of the box around the estimates in which the true pump parameters are taken to lie, relative to
        the estimate; the guarantee holds under this assumption. For the friction it is added to the torque's
        whole linear part, since an estimate of it may come out near zero.
    margin : tuple of float, optional
        Bound of the model's own error in R1, Pa, and R2, N m; by default twice what the data call for.
    rounds : int
        Largest number of passes; each uses the set of the last one for the remainder of the linearisation. They end
        when the half widths shrink by less than 2 %.
    own : tuple of str
        Motor parameters that may differ from point to point within `motor_box`.

    Returns
    -------
    Identification

    Raises
    ------
    DataError
        If the data are too few or collinear, or nothing in the prior box explains them.
    ParameterError
        If a nominal parameter is missing, or one of `own` is none of the motor's.

    References
    ----------
    Thesis 7.3 (reconstructed). F. C. Schweppe, Recursive state estimation: unknown but bounded errors (1968).
    """
    missing = [name for name in MOTOR if name not in nominal]
    if missing:
        raise ParameterError(f"identify: nominal {', '.join(missing)} missing; G_core and stray may be 0.")
    A_h, H, A_t, T = regressors(motor, nominal, signals)
    head, torque = regress(HEAD, A_h, H), regress(TORQUE, A_t, T)
    relations = pump_relations(motor)
    motor_set = box({name: float(nominal[name]) for name in MOTOR}, relative=dict(motor_box or {}), origin="motor box")
    strange = [name for name in own if name not in MOTOR]
    if strange:
        raise ParameterError(f"identify: own = {', '.join(strange)}: must be of {', '.join(MOTOR)}.")
    single = own_columns(motor_set, own)
    start = (_prior(head, A_h, prior), _prior(torque, A_t, prior))
    first, fits = motor_set.generators.shape[1], (head, torque)
    used = np.zeros(2) if margin is None else np.asarray(margin, dtype=float)
    for _ in range(_ATTEMPTS):
        parts, factor, needed, short, more = list(start), 0.0, np.zeros(2), np.zeros(2), False
        for _ in range(rounds):
            forms = set_model(relations, join(motor_set, *parts), errors).forms(signals)
            noise = _noise(forms, errors, relations.channels)
            plain = shared_rows(forms, errors, relations.channels, own=single)
            factor = max(factor, _factor(plain, forms.parameters, noise))
            if factor > 1.0:
                needed = np.maximum(needed, model_margins(plain))
            rows = shared_rows(forms, errors, relations.channels, margin=used, own=single)
            short = model_margins(rows)
            more = margin is None and bool(short.any())
            if more:
                break  # the remainder that stood in for a model error has shrunk: begin again with more margin
            smaller = [
                _shrink(part, fit, rows, first + sum(q.generators.shape[1] for q in parts[:k]))
                for k, (part, fit) in enumerate(zip(parts, fits, strict=True))
            ]
            change = max(float((b.radius / a.radius).max()) for a, b in zip(parts, smaller, strict=True))
            parts = smaller
            if 0.98 < change <= 1.0:
                break
        if not more:
            break
        used = used + 2 * short
    else:
        raise DataError("healthy points: no margin was found that explains them; enlarge the bounds of the errors.")
    grown = max(1.0, factor)
    return Identification(
        head=head,
        torque=torque,
        guaranteed=join(motor_set, *parts),
        factor=factor,
        margin=(float(needed[0]), float(needed[1])),
        margin_used=(float(used[0]), float(used[1])),
        suggested=MeasurementErrors(
            relative={k: grown * v for k, v in errors.relative.items()},
            absolute={k: grown * v for k, v in errors.absolute.items()},
            bias_share=errors.bias_share,
        ),
    )


def _prior(fit: Regression, matrix: Array, size: float) -> ParameterSet:
    """Box of the prior, turned into the singular directions so that later rounds only shrink it."""
    # a coefficient may take the place of the whole fitted quantity
    whole = np.linalg.norm(matrix @ fit.estimate) / fit.scale
    radius = size * np.maximum(np.abs(fit.estimate), 0.2 * whole)
    return ParameterSet(names=fit.names, center=fit.estimate, generators=np.diag(radius), origin="prior box")


def _shrink(part: ParameterSet, fit: Regression, rows: Rows, at: int) -> ParameterSet:
    """Parallelotope along the singular directions around everything that explains the rows."""
    program = Program(rows)
    size = part.generators.shape[1]
    into = fit.directions * fit.scale  # scaled coordinates along the singular directions
    low, high = np.empty(len(fit.names)), np.empty(len(fit.names))
    for k, direction in enumerate(into):
        full = np.zeros(rows.k.shape[1])
        full[at : at + size] = direction @ part.generators
        try:
            low[k], high[k] = program.extreme(full)
        except ProgramError:
            raise DataError(
                "no parameters inside the prior box explain the healthy points within the stated errors: enlarge the "
                "bounds of the errors, the prior or the model's margin, or check units, and that no fault was there."
            ) from None
    out = np.linalg.inv(into)  # orthogonal times diagonal: well conditioned after scaling
    return ParameterSet(
        names=part.names,
        center=part.center + out @ (0.5 * (low + high)),
        generators=out * (0.5 * (high - low) * (1 + 1e-9)),
        origin=f"guaranteed set from {len(rows.c) // 2} healthy points",
    )


def _noise(forms: Any, errors: MeasurementErrors, channels: tuple[str, ...]) -> Array:
    chosen = [forms.outputs.index(name) for name in ("R1", "R2")]
    share = errors.bounds(channels)[2]
    return np.asarray((np.abs(forms.k[:, chosen, forms.parameters :]) @ (1.0 - share)).ravel())


def _factor(rows: Rows, n_p: int, noise: Array) -> float:
    """Smallest factor of all measurement errors that explains the rows."""
    from scipy.optimize import linprog

    n, scale = rows.k.shape[1], rows.r
    other = rows.r - noise
    # unknowns: parameter zetas in the box, bias zetas up to the factor, the factor
    k, column = rows.k / scale[:, None], noise[:, None] / scale[:, None]
    link = np.zeros((2 * (n - n_p), n + 1))
    for i, b in enumerate(range(n_p, n)):
        link[2 * i, [b, n]], link[2 * i + 1, [b, n]] = (1.0, -1.0), (-1.0, -1.0)
    found = linprog(
        np.append(np.zeros(n), 1.0),
        A_ub=np.vstack((np.hstack((k, -column)), np.hstack((-k, -column)), link)),
        b_ub=np.concatenate(((other - rows.c) / scale, (other + rows.c) / scale, np.zeros(len(link)))),
        bounds=[(-1, 1)] * n_p + [(None, None)] * (n - n_p) + [(0, None)], method="highs",
    )  # fmt: skip
    return float(found.fun) if found.success else np.inf


def model_margins(rows: Rows) -> Array:
    """Smallest additional margins of R1 and R2 that explain rows.

    Parameters
    ----------
    rows : Rows
        Of R1 and R2 in turn.

    Returns
    -------
    ndarray, shape (2,)
        Pa and N m; zero if none are needed.

    Raises
    ------
    ProgramError
        If the solver fails.
    """
    from scipy.optimize import linprog

    if Program(rows).margin()[0] <= 0:
        return np.zeros(2)
    n, scale = rows.k.shape[1], rows.r
    k = rows.k / scale[:, None]
    typical = np.array([np.median(scale[0::2]), np.median(scale[1::2])])
    extra = np.zeros((len(rows.c), 2))
    extra[0::2, 0], extra[1::2, 1] = typical[0] / scale[0::2], typical[1] / scale[1::2]
    found = linprog(
        np.append(np.zeros(n), [1.0, 1.0]),
        A_ub=np.vstack((np.hstack((k, -extra)), np.hstack((-k, -extra)))),
        b_ub=np.concatenate(((rows.r - rows.c) / scale, (rows.r + rows.c) / scale)),
        bounds=[(-1, 1)] * n + [(0, None)] * 2, method="highs",
    )  # fmt: skip
    if not found.success:
        raise ProgramError(f"margins of the model: {found.message}")
    return np.asarray(found.x[n:] * typical)


def suggest_points(fit: Regression, done: Array, candidates: Array, count: int) -> list[int]:
    """Operating points that add most to what is known: greedy D-optimal choice.

    Each step takes the candidate whose addition enlarges the determinant of the information most, by its leverage.

    Parameters
    ----------
    fit : Regression
        For the scale of the columns.
    done : ndarray, shape (n, p)
        Regressors of the points there are; n may be 0.
    candidates : ndarray, shape (m, p)
        Regressors of possible points.
    count : int
        How many to choose; a candidate may come again.

    Returns
    -------
    list of int
        Indices of candidates, the most useful first.

    Raises
    ------
    ParameterError
        If shapes do not fit or count is not positive.

    References
    ----------
    V. V. Fedorov, Theory of Optimal Experiments (1972).
    """
    from scipy.linalg import solve_triangular

    p = len(fit.names)
    if done.ndim != 2 or candidates.ndim != 2 or done.shape[1] != p or candidates.shape[1] != p or count < 1:
        raise ParameterError(
            f"suggest_points: done {done.shape}, candidates {candidates.shape}, count {count}: must be (n, {p}), "
            f"(m, {p}) and at least 1."
        )
    options = candidates / fit.scale
    # a weak prior keeps the triangle regular before there are p points
    R = np.linalg.qr(np.vstack((done / fit.scale, 1e-6 * np.eye(p))), mode="r")
    chosen = []
    for _ in range(count):
        leverage = (solve_triangular(R, options.T, trans="T") ** 2).sum(axis=0)
        best = int(np.argmax(leverage))
        chosen.append(best)
        R = np.linalg.qr(np.vstack((R, options[best])), mode="r")
    return chosen
