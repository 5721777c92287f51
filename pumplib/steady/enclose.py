"""Thesis 7.3: set-valued evaluation of relations by five methods, four of them with a guarantee (reconstructed).

    interval   plain interval arithmetic
    mean       mean value form: value at the centre plus gradient over the set times the deviations
    affine     affine arithmetic (`pumplib.steady.affine`), compiled: the method for use on-line
    taylor     value and gradient at the centre plus an enclosure of the second-order remainder over the set
    linear     value and gradient at the centre alone: the thesis's Taylor expansion, *no* enclosure

If the true parameters and measurement errors are in their sets and the pump obeys the relations, zero lies in every
residual set that one of the first four gives. So a set without zero proves a fault; there is no false alarm
as long as the assumptions hold.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pumplib.errors import ParameterError
from pumplib.steady.affine import affine_run
from pumplib.steady.intervals import Interval, down, interval, up
from pumplib.steady.jets import Jet, variable
from pumplib.steady.relations import Relations, stack
from pumplib.steady.sets import MeasurementErrors, ParameterSet
from pumplib.steady.tape import Tape, record

Array = NDArray[Any]
Method = Literal["interval", "mean", "affine", "taylor", "linear"]
METHODS: tuple[Method, ...] = ("interval", "mean", "affine", "taylor", "linear")
RIGOROUS: tuple[Method, ...] = METHODS[:4]


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Enclosure:
    """Sets of some outputs at some samples.

    Parameters
    ----------
    outputs : tuple of str
        Names.
    lo, hi : ndarray, shape (n, outputs)
        Bounds; the whole line where the relation is not defined on the set (a head above the pump's largest).
    method : str
        Of `METHODS`.
    """

    outputs: tuple[str, ...]
    lo: Array
    hi: Array
    method: Method

    @property
    def guaranteed(self) -> bool:
        """Whether the method encloses, or only approximates."""
        return self.method in RIGOROUS

    @property
    def width(self) -> Array:
        """Width of the sets, shape (n, outputs)."""
        return np.asarray(self.hi - self.lo)

    @property
    def alarm(self) -> Array:
        """Whether a set excludes zero, shape (n, outputs)."""
        return np.asarray((self.lo > 0) | (self.hi < 0))

    @property
    def sign(self) -> Array:
        """+1 where a set lies above zero, -1 below, 0 where it contains zero; shape (n, outputs)."""
        return np.where(self.lo > 0, 1, np.where(self.hi < 0, -1, 0))

    def contains(self, values: ArrayLike) -> Array:
        """Tell whether values lie in the sets.

        Parameters
        ----------
        values : array_like, shape (n, outputs)
            Values.

        Returns
        -------
        ndarray of bool
        """
        return np.asarray((self.lo <= values) & (np.asarray(values) <= self.hi))


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class AffineForms:
    """Residuals as c + k zeta + e eta; the zetas are those of the parameter set, then one a channel.

    Parameters
    ----------
    outputs : tuple of str
        Names.
    center : ndarray, shape (n, outputs)
        c.
    k : ndarray, shape (n, outputs, n_p + channels)
        Coefficients.
    e : ndarray, shape (n, outputs)
        Bound of what is not linear, infinite where the relation is not defined on the set.
    parameters : int
        Number n_p of zetas of the parameter set.
    enclosure : Enclosure
        The same as bounds.
    """

    outputs: tuple[str, ...]
    center: Array
    k: Array
    e: Array
    parameters: int
    enclosure: Enclosure


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class SetModel:
    """Relations with what is uncertain about them, ready to be evaluated.

    Parameters
    ----------
    relations : Relations
        The relations.
    parameters : ParameterSet
        All parameters of the relations, in their order.
    errors : MeasurementErrors
        Bounds of the measurement errors.
    tape : Tape
        Recorded operations; `set_model` makes them.
    """

    relations: Relations
    parameters: ParameterSet
    errors: MeasurementErrors
    tape: Tape

    def bounds(self) -> tuple[Array, Array]:
        """Bounds of the measurement errors.

        Returns
        -------
        absolute, relative : ndarray, shape (channels,)
        """
        absolute, relative, _ = self.errors.bounds(self.relations.channels)
        return absolute, relative

    @property
    def size(self) -> int:
        """Number of uncertain quantities: columns of the parameter set, then channels."""
        return self.parameters.generators.shape[1] + len(self.relations.channels)

    def radii(self, x: Array) -> Array:
        """Radii of the measurement errors at some samples.

        Parameters
        ----------
        x : ndarray, shape (n, channels)
            Measured values.

        Returns
        -------
        ndarray, shape (n, channels)
        """
        absolute, relative = self.bounds()
        # the same formula as in the kernel, so that all methods speak of the same set
        return (absolute + relative * np.abs(x)) * (1.0 + 8.0 * 2.0**-53)

    def point(self, x: Array, zeta: Array) -> Array:
        """Outputs for given errors: what the residual would be if zeta were the truth.

        Parameters
        ----------
        x : ndarray, shape (n, channels)
            Measured values.
        zeta : ndarray, shape (n, size)
            Points of the unit box.

        Returns
        -------
        ndarray, shape (n, outputs)
        """
        n_p = self.parameters.generators.shape[1]
        channels = x + self.radii(x) * zeta[:, n_p:]
        found = self.relations(channels.T, self.parameters.values(zeta[:, :n_p]).T)
        return np.stack(np.broadcast_arrays(*found), axis=1)

    def forms(self, signals: Mapping[str, ArrayLike]) -> AffineForms:
        """Affine forms of the outputs.

        Parameters
        ----------
        signals : mapping of str to array_like, shape (n,)
            Measured channels, SI.

        Returns
        -------
        AffineForms

        Raises
        ------
        DataError
            If a channel is missing or not finite.
        """
        return self._affine(stack(self.relations, signals), True)

    def enclose(self, signals: Mapping[str, ArrayLike], method: Method = "affine") -> Enclosure:
        """Sets of the outputs.

        Parameters
        ----------
        signals : mapping of str to array_like, shape (n,)
            Measured channels, SI.
        method : {"affine", "interval", "mean", "taylor", "linear"}
            See the module; "linear" gives no enclosure.

        Returns
        -------
        Enclosure

        Raises
        ------
        DataError
            If a channel is missing or not finite.
        ParameterError
            If there is no such method.

        References
        ----------
        Thesis 7.3 (reconstructed).
        """
        x = stack(self.relations, signals)
        if method == "affine":
            return self._affine(x, False).enclosure
        if method == "interval":
            values = self._intervals(x)
            found = self.relations(values[: x.shape[1]], values[x.shape[1] :])
            lo, hi = ([getattr(f, end) for f in found] for end in ("lo", "hi"))
            return self._result(np.broadcast_arrays(*lo), np.broadcast_arrays(*hi), method)
        if method in ("mean", "taylor", "linear"):
            return self._jets(x, method)
        raise ParameterError(f"method = {method!r}: must be one of {', '.join(METHODS)}.")

    def _affine(self, x: Array, keep: bool) -> AffineForms:
        names, n, t = self.relations.outputs, self.size, self.tape
        absolute, relative = self.bounds()
        rows = np.column_stack((self.parameters.center, self.parameters.generators))
        count, m = len(x), len(names)
        low, high = np.empty((count, m)), np.empty((count, m))
        kept = count if keep else 0
        center, k, e = np.empty((kept, m)), np.empty((kept, m, n)), np.empty((kept, m))
        if count:
            affine_run(
                t.code, t.constant, t.start, t.columns, t.pairs, t.factors, t.left, t.right, t.outputs,
                np.ascontiguousarray(x), rows, absolute, relative, low, high, center, k, e,
            )  # fmt: skip
        return AffineForms(
            outputs=names, center=center, k=k, e=e, parameters=n - x.shape[1],
            enclosure=Enclosure(outputs=names, lo=down(low), hi=up(high), method="affine"),
        )  # fmt: skip

    def _intervals(self, x: Array) -> list[Interval]:
        r = self.radii(x)
        channels = [Interval(down(a - b), up(a + b)) for a, b in zip(x.T, r.T, strict=True)]
        rows = self.parameters.generators
        unit = Interval(np.array(-1.0), np.array(1.0))
        parameters = []
        for c, row in zip(self.parameters.center, rows, strict=True):
            value = interval(c)
            for g in row[row != 0]:
                value = value + unit * float(g)
            parameters.append(value)
        return [*channels, *parameters]

    def _variables(self, x: Array, over_set: bool, second: bool) -> list[Jet]:
        n_p, count = self.parameters.generators.shape[1], len(x)
        values = self._intervals(x) if over_set else [interval(v) for v in (*x.T, *self.parameters.center)]
        r, jets = self.radii(x), []
        for i in range(x.shape[1]):
            slopes = np.zeros((count, self.size))
            slopes[:, n_p + i] = r[:, i]
            jets.append(variable(values[i], slopes, second))
        for row, value in zip(self.parameters.generators, values[x.shape[1] :], strict=True):
            slopes = np.zeros((1, self.size))
            slopes[0, :n_p] = row
            jets.append(variable(Interval(np.reshape(value.lo, (1,)), np.reshape(value.hi, (1,))), slopes, second))
        return jets

    def _jets(self, x: Array, method: Method) -> Enclosure:
        cut = x.shape[1]
        at_center = self._variables(x, False, False)
        base = self.relations(at_center[:cut], at_center[cut:])
        if method == "linear":
            mid = [b.v.mid for b in base]
            radius = [np.abs(b.g.mid).sum(axis=-1) for b in base]
            return self._result(
                [m - r for m, r in zip(mid, radius, strict=True)], [m + r for m, r in zip(mid, radius, strict=True)],
                method,
            )  # fmt: skip
        over = self._variables(x, True, method == "taylor")
        full = self.relations(over[:cut], over[cut:])
        lows, highs = [], []
        for point, whole in zip(base, full, strict=True):
            if method == "mean":
                reach = Interval(*_symmetric(whole.g.magnitude))
            else:
                assert whole.h is not None
                reach = Interval(*_symmetric(point.g.magnitude)) + 0.5 * _quadratic(whole.h)
            total = point.v + reach
            bad = ~(np.isfinite(total.lo) & np.isfinite(total.hi))
            lows.append(np.where(bad, -np.inf, total.lo))
            highs.append(np.where(bad, np.inf, total.hi))
        return self._result(lows, highs, method)

    def _result(self, lows: Any, highs: Any, method: Method) -> Enclosure:
        return Enclosure(
            outputs=self.relations.outputs, lo=np.stack(lows, axis=1), hi=np.stack(highs, axis=1), method=method
        )


def _sum_up(x: Array) -> Array:
    """Upper bound of a sum of non-negative numbers over the last axis."""
    # n - 1 roundings of at most u each
    return up(x.sum(axis=-1) * (1.0 + 4.0 * x.shape[-1] * 2.0**-53))


def _symmetric(magnitudes: Array) -> tuple[Array, Array]:
    r = _sum_up(magnitudes)
    return -r, r


def _quadratic(h: Interval) -> Interval:
    """Range of zeta' H zeta over the unit box."""
    n = h.lo.shape[-1]
    lo = np.diagonal(h.lo, axis1=-2, axis2=-1)
    hi = np.diagonal(h.hi, axis1=-2, axis2=-1)
    both = h.magnitude
    cross = np.where(np.eye(n, dtype=bool), 0.0, both).reshape(*both.shape[:-2], n * n)
    off = _sum_up(cross)
    high = up(_sum_up(np.maximum(hi, 0.0)) + off)
    low = down(-_sum_up(np.maximum(-lo, 0.0)) - off)
    return Interval(low, high)


def set_model(relations: Relations, parameters: ParameterSet, errors: MeasurementErrors) -> SetModel:
    """Bring relations, parameter set and measurement errors together.

    Parameters
    ----------
    relations : Relations
        The relations.
    parameters : ParameterSet
        At least the parameters of the relations, in any order.
    errors : MeasurementErrors
        Bounds of the measurement errors.

    Returns
    -------
    SetModel

    Raises
    ------
    ParameterError
        If a parameter of the relations is missing in the set.

    References
    ----------
    Thesis 7.3 (reconstructed).
    """
    missing = [name for name in relations.parameters if name not in parameters.names]
    if missing:
        raise ParameterError(
            f"parameter set: {', '.join(missing)} missing for the relations {relations.name!r}; a parameter that is "
            "known exactly needs a row of zeros, one that is not modelled the value 0."
        )
    order = [parameters.names.index(name) for name in relations.parameters]
    chosen = ParameterSet(
        names=relations.parameters, center=parameters.center[order], generators=parameters.generators[order],
        origin=parameters.origin,
    )  # fmt: skip
    cut, n_p = len(relations.channels), chosen.generators.shape[1]
    depends = np.zeros((cut + len(order), n_p + cut), dtype=bool)
    depends[range(cut), n_p + np.arange(cut)] = True
    depends[cut:, :n_p] = chosen.generators != 0
    fixed = {
        cut + k: float(c)
        for k, (c, row) in enumerate(zip(chosen.center, chosen.generators, strict=True))
        if not row.any()
    }
    return SetModel(
        relations=relations, parameters=chosen, errors=errors, tape=record(relations, depends, fixed)
    )  # fmt: skip
