"""Thesis 1.3, 6.2: residuals that differentiate the measurements, and their noise beside that of the realization.

The same constraints can be tested with difference quotients instead of states. Behind a filter of the bandwidth of
the observer both see the same faults, so that their noise, bias and dependence on the sampling can be compared.
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import sympy as sp
from numpy.typing import ArrayLike, NDArray

from pumplib.errors import DataError, ParameterError
from pumplib.kernels import kernel
from pumplib.structure.codegen_generator import ResidualGenerator
from pumplib.structure.elimination import Prefer, eliminate
from pumplib.structure.model import StructuralModel
from pumplib.structure.realization import realize
from pumplib.structure.symbolics import shortest

Array = NDArray[Any]
Difference = Literal["backward", "central", "backward, nominal step"]
DIFFERENCES: tuple[Difference, ...] = ("backward", "central", "backward, nominal step")
_RATE = "_rate"


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class DerivativeResidual:
    """A residual in known signals and their derivatives.

    Parameters
    ----------
    name : str
        Name of the subsystem.
    expression : sympy.Expr
        Zero in the healthy system; contains signals, parameters and rates.
    rates : dict
        Symbol of a derivative -> signal.
    signals : tuple of sympy.Symbol
        Signals that occur, themselves or differentiated.
    """

    name: str
    expression: Any
    rates: dict[Any, Any]
    signals: tuple[Any, ...]

    def evaluate(
        self,
        t: ArrayLike,
        signals: Mapping[str, ArrayLike],
        parameters: Mapping[str, float],
        difference: Difference = "backward",
    ) -> Array:
        """Residual of a record by difference quotients.

        Parameters
        ----------
        t : ndarray, shape (n,)
            s.
        signals : mapping of str to ndarray, shape (n,)
            SI.
        parameters : mapping of str to float
            SI.
        difference : {"backward", "central", "backward, nominal step"}
            Quotient. The last one divides by the mean step, as code does that is written for a fixed rate.

        Returns
        -------
        ndarray, shape (n,)
            The first sample (and with central differences the last) repeats its neighbour.

        Raises
        ------
        ParameterError
            If the difference is another word or a parameter is missing.
        DataError
            If a signal is missing or of another length, or the record has fewer than three samples.
        """
        if difference not in DIFFERENCES:
            raise ParameterError(f"{self.name}: difference = {difference!r}; must be one of {', '.join(DIFFERENCES)}.")
        time = np.asarray(t, dtype=float)
        if time.ndim != 1 or len(time) < 3 or not (np.diff(time) > 0).all():
            raise DataError(f"{self.name}: t has shape {time.shape}; must be at least three increasing instants in s.")
        values: dict[Any, Any] = {}
        for s in self.signals:
            column = np.asarray(signals[s.name], dtype=float) if s.name in signals else None
            if column is None or column.shape != time.shape or not np.isfinite(column).all():
                raise DataError(f"{self.name}: signal {s} is missing, not finite or not as long as t.")
            values[s] = column
        for rate, s in self.rates.items():
            slope = np.empty_like(time)
            if difference == "central":
                slope[1:-1] = (values[s][2:] - values[s][:-2]) / (time[2:] - time[:-2])
                slope[-1] = slope[-2]
            elif difference == "backward":
                slope[1:] = np.diff(values[s]) / np.diff(time)
            else:
                slope[1:] = np.diff(values[s]) / np.diff(time).mean()
            slope[0] = slope[1]
            values[rate] = slope
        for p in self.expression.free_symbols - set(values):
            if p.name not in parameters:
                raise ParameterError(f"{self.name}: parameter {p} is missing; give its value in SI units.")
            values[p] = float(parameters[p.name])
        order = sorted(values, key=lambda one: one.name)
        code = sp.lambdify(order, self.expression, modules="numpy", cse=True)
        return np.broadcast_to(np.asarray(code(*(values[one] for one in order)), dtype=float), time.shape).copy()


def derivative_residual(
    model: StructuralModel, constraints: Iterable[str] | None = None, *, prefer: Prefer | None = None
) -> DerivativeResidual:
    """Residual of a subsystem in derivative causality: states from measurements, their rates by differentiation.

    Parameters
    ----------
    model : StructuralModel
        The model; its faults are taken as zero.
    constraints : iterable of str, optional
        The subsystem's constraints; by default all.
    prefer : callable, optional
        Which of several solutions is meant.

    Returns
    -------
    DerivativeResidual

    Raises
    ------
    ParameterError
        If the measurements do not determine the states, or not exactly one equation is left.
    """
    report = realize(model, constraints, prefer=prefer)
    system = report.explicit
    if system is None:
        raise ParameterError(f"{report.name}: {report.outcome.value}: {report.detail}")
    solved = eliminate(system.outputs, system.states, prefer=prefer, express=False)
    if solved.left:
        raise ParameterError(
            f"{report.name}: the measurements do not determine {', '.join(map(str, solved.left))} without a derivative."
        )
    known = [s for s in model.known if any(s in e.free_symbols for e in solved.values.values())]
    rates = {sp.Symbol(f"{s.name}{_RATE}", real=True): s for s in known}
    equations = []
    for x, f in zip(system.states, system.rates, strict=True):
        value = solved.values[x]
        slope = sum((sp.diff(value, s) * rate for rate, s in rates.items()), sp.S.Zero)
        equations.append((x.name, slope - f.subs(solved.values)))
    rest = eliminate([*equations, *solved.remaining], system.inputs, prefer=prefer, express=False)
    if len(rest.remaining) != 1 or rest.left:
        raise ParameterError(
            f"{report.name}: {len(rest.remaining)} equations, {len(rest.left)} unknowns are left; must be one and none."
        )
    expression = shortest(rest.remaining[0][1])
    used = {rate: s for rate, s in rates.items() if rate in expression.free_symbols}
    signals = tuple(s for s in model.known if s in expression.free_symbols or s in used.values())
    return DerivativeResidual(name=report.name, expression=expression, rates=used, signals=signals)


@kernel
def _follow(share, value, result):  # type: ignore[no-untyped-def]
    state = 0.0
    for k in range(value.shape[0]):
        state += share[k] * (value[k] - state)
        result[k] = state


def low_pass(t: ArrayLike, x: ArrayLike, rate: float) -> Array:
    """First-order low-pass filter that is exact for a held input, also between unequal steps.

    Parameters
    ----------
    t : ndarray, shape (n,)
        s.
    x : ndarray, shape (n,)
        Input.
    rate : float
        Corner frequency, rad/s.

    Returns
    -------
    ndarray, shape (n,)
        Starts at zero.

    Raises
    ------
    ParameterError
        If the rate is not positive.
    DataError
        If the shapes differ.
    """
    if not rate > 0:
        raise ParameterError(f"low_pass: rate = {rate} rad/s; must be positive.")
    time, value = np.asarray(t, dtype=float), np.asarray(x, dtype=float)
    share = -np.expm1(-rate * np.diff(time, prepend=time[:1]))
    if time.shape != value.shape or time.ndim != 1:
        raise DataError(f"low_pass: t has shape {time.shape} and x {value.shape}; must be one axis of one length.")
    result = np.empty_like(value)
    _follow(share, value, result)
    return result


@dataclass(frozen=True, kw_only=True, slots=True)
class NoiseRow:
    """Noise of one residual under one sampling.

    Parameters
    ----------
    case : str
        System.
    dt : float
        Mean sampling interval, s.
    sigma : float
        Standard deviation of the noise, unit of the noisy signal.
    sampling : str
        "regular" or "irregular".
    method : str
        "realization", or the difference quotient with or without a filter.
    std : float
        Standard deviation of the residual, unit of the differentiated equation.
    bias : float
        Its mean.
    bias_error : float
        Standard error of the mean, from the spread of the means of 20 pieces of the record.
    ratio : float
        Standard deviation over that of the realization.
    """

    case: str
    dt: float
    sigma: float
    sampling: str
    method: str
    std: float
    bias: float
    bias_error: float
    ratio: float


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class NoiseCase:
    """A system with an exact trajectory, tested by a realization and by differentiation.

    Parameters
    ----------
    name : str
        Name in the table.
    generator : ResidualGenerator
        Of the realization, output="correction", one residual.
    derivative : DerivativeResidual
        Of the same constraints.
    signals : callable
        Instants -> noise-free signals by name.
    start : callable
        Instants -> states z at the first sample.
    parameters : mapping of str to float
        SI.
    rate : float
        Decay rate of the realization's error, corner frequency of the filters, 1/s.
    noisy : str
        Signal with noise.
    scale : callable
        Signals -> factor that brings the derivative residual to the realization's unit.
    """

    name: str
    generator: ResidualGenerator
    derivative: DerivativeResidual
    signals: Callable[[Array], dict[str, Array]]
    start: Callable[[Array], Array]
    parameters: Mapping[str, float]
    rate: float
    noisy: str
    scale: Callable[[Mapping[str, Array]], Array]


def noise_rows(
    case: NoiseCase,
    dt: float,
    sigma: float,
    rng: np.random.Generator,
    *,
    duration: float = 200.0,
    jitter: float = 0.0,
    settle: float = 10.0,
) -> tuple[NoiseRow, ...]:
    """Compare realization and difference quotients on one noisy record.

    Parameters
    ----------
    case : NoiseCase
        The system.
    dt : float
        Mean sampling interval, s.
    sigma : float
        Standard deviation of white noise on the noisy signal.
    rng : numpy.random.Generator
        Source of the noise and of the jitter.
    duration : float
        Length of the record, s.
    jitter : float
        Steps are drawn from dt (1 - jitter) to dt (1 + jitter), below one.
    settle : float
        First part left out, s.

    Returns
    -------
    tuple of NoiseRow
        The realization first.

    Raises
    ------
    ParameterError
        If a number is out of range.
    """
    if not (dt > 0 and sigma >= 0 and 0 <= jitter < 1 and duration > settle + 20 * dt):
        raise ParameterError(
            f"noise_rows: dt = {dt} s, sigma = {sigma}, jitter = {jitter}, {duration} s with {settle} s left out."
        )
    count = int(duration / dt)
    t = np.cumsum(dt * (1 + jitter * rng.uniform(-1, 1, count)))
    clean = case.signals(t)
    signals = {**clean, case.noisy: clean[case.noisy] + sigma * rng.standard_normal(count)}
    weight = case.scale(clean)  # of the clean signals: the same factor for every method
    found = {"realization": case.generator.run(t, signals, case.parameters, case.start(t)).residual[:, 0] / weight}
    for difference in DIFFERENCES:
        raw = case.derivative.evaluate(t, signals, case.parameters, difference)
        found[f"{difference}, raw"] = raw
        found[f"{difference}, filtered"] = low_pass(t, raw, case.rate)
    late = t > t[0] + settle
    reference = float(found["realization"][late].std())
    rows = []
    for method, residual in found.items():
        kept = residual[late]
        means = np.array([piece.mean() for piece in np.array_split(kept, 20)])
        rows.append(
            NoiseRow(
                case=case.name,
                dt=dt,
                sigma=sigma,
                sampling="irregular" if jitter else "regular",
                method=method,
                std=float(kept.std()),
                bias=float(kept.mean()),
                bias_error=float(means.std(ddof=1) / np.sqrt(len(means))),
                ratio=float(kept.std()) / reference if reference > 0 else float("nan"),
            )
        )
    return tuple(rows)
