"""Thesis 6.6: residual generators from realizations: compiled, sample by sample or whole records, same rounding.

dz/dt = f_z(z, s) + L(z, s) h_z(z, s) is integrated from sample to sample, by default with Heun's rule, which takes the
signals as straight lines between samples; the sampling need not be regular. The residual belongs to the new
sample. Code is written for each generator, compiled without fused operations and kept in the package's cache.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pumplib.errors import DataError, ParameterError, SimulationError
from pumplib.structure.codegen import Code, straight_line
from pumplib.structure.codegen_numba import Scheme, compiled_source, python_source
from pumplib.structure.realization_report import Realization

Array = NDArray[Any]
Output = Literal["residual", "correction"]
SCHEMES = ("heun", "euler")
OUTPUTS = ("residual", "correction")


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class ResidualRun:
    """Residuals of a record.

    Parameters
    ----------
    t : ndarray, shape (n,)
        s.
    residual : ndarray, shape (n, residuals)
        Unit of the equation, or of the states' rates (output="correction").
    states : ndarray, shape (n, states)
        z.
    flags : ndarray of int, shape (n,)
        Bit k is set where the k-th radicand was negative and taken as zero (`ResidualGenerator.radicands`).
    """

    t: Array
    residual: Array
    states: Array
    flags: Array


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class ResidualGenerator:
    """A compiled residual generator; `residual_generator` makes one.

    Parameters
    ----------
    name : str
        Name of the subsystem.
    states, signals, parameters : tuple of str
        Names of z, of the known signals and of the parameters, in the order of the arrays.
    outputs : int
        Number of residuals.
    scheme : {"heun", "euler"}
        Integration rule.
    radicands : tuple of sympy.Expr
        Meaning of the flags.
    rates, residuals : Code
        Straight-line code of dz/dt (with injection) and of the residuals.
    kernel : callable
        Compiled loop over a record.
    """

    name: str
    states: tuple[str, ...]
    signals: tuple[str, ...]
    parameters: tuple[str, ...]
    outputs: int
    scheme: Scheme
    radicands: tuple[Any, ...]
    rates: Code
    residuals: Code
    kernel: Any

    def values(self, parameters: Mapping[str, float]) -> Array:
        """Parameter array from named values.

        Parameters
        ----------
        parameters : mapping of str to float
            SI; more than needed is allowed.

        Returns
        -------
        ndarray, shape (parameters,)

        Raises
        ------
        ParameterError
            If one is missing or not a finite number.
        """
        missing = [name for name in self.parameters if name not in parameters]
        if missing:
            raise ParameterError(f"{self.name}: parameter {', '.join(missing)} is missing; give its value in SI units.")
        result = np.array([float(parameters[name]) for name in self.parameters], dtype=float)
        for name, value in zip(self.parameters, result, strict=True):
            if not math.isfinite(value):
                raise ParameterError(f"{self.name}: parameter {name} = {value}; must be finite.")
        return result

    def _start(self, start: ArrayLike) -> Array:
        state = np.asarray(start, dtype=float)
        if state.shape != (len(self.states),) or not np.isfinite(state).all():
            raise ParameterError(
                f"{self.name}: start = {start!r}; must be {len(self.states)} finite numbers for "
                f"{', '.join(self.states) or 'no state'} (Realization.start)."
            )
        return np.concatenate([state, np.zeros(len(self.signals))])

    def record(self, signals: Mapping[str, ArrayLike]) -> Array:
        """Array of the signals of a record.

        Parameters
        ----------
        signals : mapping of str to ndarray, shape (n,)
            By name, SI.

        Returns
        -------
        ndarray, shape (n, signals)

        Raises
        ------
        DataError
            If one is missing, of another length or has a value that is not finite.
        """
        columns: list[Array] = []
        for name in self.signals:
            if name not in signals:
                raise DataError(f"{self.name}: signal {name} is missing; it needs {', '.join(self.signals)}.")
            column = np.asarray(signals[name], dtype=float)
            if column.ndim != 1 or (columns and len(column) != len(columns[0])):
                raise DataError(
                    f"{self.name}: signal {name} has shape {column.shape}; all need one axis of one length."
                )
            if not np.isfinite(column).all():
                k = int(np.flatnonzero(~np.isfinite(column))[0])
                raise DataError(f"{self.name}: signal {name} is {column[k]} at sample {k}; cut or repair the record.")
            columns.append(column)
        return np.ascontiguousarray(np.stack(columns, axis=1))

    def run(
        self, t: ArrayLike, signals: Mapping[str, ArrayLike], parameters: Mapping[str, float], start: ArrayLike = ()
    ) -> ResidualRun:
        """Residuals of a whole record.

        Parameters
        ----------
        t : ndarray, shape (n,)
            Sampling instants, s, increasing; the steps may differ.
        signals : mapping of str to ndarray, shape (n,)
            Known signals by name, SI.
        parameters : mapping of str to float
            By name, SI.
        start : ndarray, shape (states,)
            States z at the first sample.

        Returns
        -------
        ResidualRun

        Raises
        ------
        DataError
            If the record has gaps, unequal lengths or instants that do not increase.
        SimulationError
            If a residual is not finite: outside the domain of the form, or the gain is too large for the step.
        """
        time = np.asarray(t, dtype=float)
        inputs = self.record(signals)
        if time.shape != (len(inputs),) or not np.isfinite(time).all() or not (np.diff(time) > 0).all():
            raise DataError(f"{self.name}: t has shape {time.shape}; must be {len(inputs)} increasing instants in s.")
        state = self._start(start)
        residual = np.empty((len(time), self.outputs))
        states = np.empty((len(time), len(self.states)))
        flags = np.empty(len(time), dtype=np.int64)
        steps = np.diff(time, prepend=time[:1])
        self.kernel(state, inputs, steps, self.values(parameters), residual, states, flags)
        _finite(self.name, residual, states, time)
        return ResidualRun(t=time, residual=residual, states=states, flags=flags)

    def stream(self, parameters: Mapping[str, float], start: ArrayLike = ()) -> "ResidualStream":
        """Generator that takes one sample after the other and gives the same numbers as `run`.

        Parameters
        ----------
        parameters : mapping of str to float
            By name, SI.
        start : ndarray, shape (states,)
            States z at the first sample.

        Returns
        -------
        ResidualStream
        """
        return ResidualStream(self, self.values(parameters), self._start(start))


def _finite(name: str, residual: Array, states: Array, time: Array) -> None:
    good = np.isfinite(residual).all(axis=1) & np.isfinite(states).all(axis=1)
    if not good.all():
        k = int(np.flatnonzero(~good)[0])
        raise SimulationError(
            f"{name}: residual {residual[k]} with states {states[k]} at t = {time[k]} s is not finite; the signals "
            "left the domain of the form (Realization.singular), or the gain is too large for the sampling interval."
        )


class ResidualStream:
    """Residuals sample by sample.

    Parameters
    ----------
    generator : ResidualGenerator
        What is computed.
    values : ndarray, shape (parameters,)
        Parameters.
    state : ndarray, shape (states + signals,)
        States and the last sample; owned by the stream.
    """

    def __init__(self, generator: ResidualGenerator, values: Array, state: Array) -> None:
        self.generator = generator
        self._values = values
        self._state = state
        self._fresh = True
        self._inputs = np.empty((1, len(generator.signals)))
        self._step = np.empty(1)
        self._residual = np.empty((1, generator.outputs))
        self._states = np.empty((1, len(generator.states)))
        self._flags = np.zeros(1, dtype=np.int64)

    @property
    def states(self) -> Array:
        """States z after the last sample."""
        return self._state[: len(self.generator.states)].copy()

    @property
    def flag(self) -> int:
        """Flag of the last sample."""
        return int(self._flags[0])

    def step(self, sample: Sequence[float], dt: float) -> Array:
        """Residuals of the next sample.

        Parameters
        ----------
        sample : sequence of float
            Signals in the order of `ResidualGenerator.signals`, SI.
        dt : float
            Time since the sample before, s; zero for the first one.

        Returns
        -------
        ndarray, shape (residuals,)

        Raises
        ------
        DataError
            If the sample is not complete or not finite, or dt is not positive (zero at first).
        SimulationError
            If the result is not finite.
        """
        name = self.generator.name
        if len(sample) != self._inputs.shape[1] or not all(map(math.isfinite, sample)):
            raise DataError(f"{name}: sample {sample!r}; needs finite {', '.join(self.generator.signals)}.")
        if not math.isfinite(dt) or (dt != 0.0 if self._fresh else dt <= 0.0):
            raise DataError(f"{name}: dt = {dt} s; must be positive, and zero for the first sample.")
        self._inputs[0] = sample
        self._step[0] = dt
        self.generator.kernel(
            self._state, self._inputs, self._step, self._values, self._residual, self._states, self._flags
        )
        self._fresh = False
        _finite(name, self._residual, self._states, self._step)
        return self._residual[0].copy()


def residual_generator(
    realization: Realization,
    *,
    gain: Sequence[Sequence[Any]] | None = None,
    scheme: Scheme = "heun",
    output: Output = "residual",
) -> ResidualGenerator:
    """Compile a residual generator for a realization.

    Parameters
    ----------
    realization : Realization
        The form.
    gain : sequence of sequence of (float or sympy.Expr), shape (states, residuals), optional
        L in dz/dt = f_z + L h_z, from `realization_gain`; symbols other than states and signals become parameters.
        None: no injection, the form must be stable by itself.
    scheme : {"heun", "euler"}
        Integration from sample to sample: signals as straight lines, or held.
    output : {"residual", "correction"}
        What is put out: h_z, or L h_z in the units of the states' rates (for a constant fault in a rate: its size).

    Returns
    -------
    ResidualGenerator

    Raises
    ------
    ParameterError
        If the shape of the gain, the scheme or the output is wrong, or there is no residual.

    References
    ----------
    Thesis 6.6 (reconstruction).
    """
    import sympy as sp

    what = realization.name
    if scheme not in SCHEMES or output not in OUTPUTS:
        raise ParameterError(f"{what}: scheme = {scheme!r}, output = {output!r}; must be of {SCHEMES} and {OUTPUTS}.")
    if not realization.residuals:
        raise ParameterError(f"{what}: no residual is left; add a constraint to the subsystem.")
    n, q = len(realization.states), len(realization.residuals)
    L = sp.zeros(n, q) if gain is None else sp.Matrix([[sp.sympify(e) for e in row] for row in gain])
    if (L.rows, L.cols) != (n, q) and n:
        raise ParameterError(f"{what}: gain has shape {L.rows, L.cols}; must be {n, q} (states, residuals).")
    if output == "correction" and (gain is None or not n):
        raise ParameterError(f"{what}: output='correction' needs states and a gain.")
    correction = list(L * sp.Matrix(realization.residuals)) if n else []
    rates = [f + c for f, c in zip(realization.rates, correction, strict=True)]
    shown = correction if output == "correction" else list(realization.residuals)
    used = set().union(*(e.free_symbols for e in (*rates, *shown)))
    signals = tuple(s for s in realization.signals if s in used)
    free = used - set(realization.states) - set(signals)
    order = [p for p in realization.parameters if p in free]
    order += sorted(free - set(order), key=lambda p: p.name)
    names = {
        **{x: f"z{k}" for k, x in enumerate(realization.states)},
        **{x: f"s{k}" for k, x in enumerate(signals)},
        **{x: f"p{k}" for k, x in enumerate(order)},
    }
    rate_code = straight_line(rates, names, prefix="t", what=what)
    residual_code = straight_line(shown, names, prefix="t", radicands=rate_code.radicands, what=what)
    source = python_source(n, len(signals), len(order), rate_code, residual_code, scheme)
    return ResidualGenerator(
        name=what,
        states=tuple(x.name for x in realization.states),
        signals=tuple(x.name for x in signals),
        parameters=tuple(x.name for x in order),
        outputs=len(shown),
        scheme=scheme,
        radicands=residual_code.radicands,
        rates=rate_code,
        residuals=residual_code,
        kernel=compiled_source(source),
    )
