"""Thesis 7.3: what may be wrong: sets of parameters and of measurement errors, both as images of a unit box.

Parameters are p = p_0 + G zeta with |zeta_i| <= 1: a diagonal G is a box, as many independent columns as parameters a
parallelotope, more a zonotope. Off-diagonal entries say that errors go together, as they do after identification.

Measurement errors are bounded per channel. Each bound is split into a bias, which is the same in every sample of a
window, and noise, which is not; a single sample cannot tell the two apart, a window can.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pumplib.errors import ParameterError
from pumplib.steady.relations import CHANNELS, UNITS

Array = NDArray[Any]


def _unit(name: str) -> str:
    return UNITS.get(name, "-")


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class ParameterSet:
    """Parameters p_0 + G zeta, |zeta_i| <= 1.

    Parameters
    ----------
    names : tuple of str
        Parameters.
    center : ndarray, shape (p,)
        p_0, SI.
    generators : ndarray, shape (p, n)
        G; a parameter without uncertainty has a row of zeros.
    origin : str
        Where the set comes from, for the reader of a report.

    Raises
    ------
    ParameterError
        If shapes do not fit, a name comes twice or a value is not finite.
    """

    names: tuple[str, ...]
    center: Array
    generators: Array
    origin: str = "stated"

    def __post_init__(self) -> None:
        center, generators = np.asarray(self.center, dtype=float), np.asarray(self.generators, dtype=float)
        object.__setattr__(self, "center", center)
        object.__setattr__(self, "generators", generators)
        if len(set(self.names)) != len(self.names):
            raise ParameterError(f"ParameterSet.names = {self.names!r}: a name comes twice.")
        if center.shape != (len(self.names),) or generators.ndim != 2 or len(generators) != len(self.names):
            raise ParameterError(
                f"ParameterSet: {len(self.names)} names, center {center.shape}, generators {generators.shape}: must be "
                "(p,) and (p, n)."
            )
        for what, values in (("center", center), ("generators", generators)):
            if not np.isfinite(values).all():
                name = self.names[int(np.argwhere(~np.isfinite(values))[0][0])]
                raise ParameterError(f"ParameterSet.{what} of {name} ({_unit(name)}): must be finite.")

    @property
    def radius(self) -> Array:
        """Half width of each parameter, shape (p,)."""
        return np.asarray(np.abs(self.generators).sum(axis=1))

    def values(self, zeta: ArrayLike) -> Array:
        """Parameters at points of the unit box.

        Parameters
        ----------
        zeta : array_like, shape (..., n)
            Points.

        Returns
        -------
        ndarray, shape (..., p)
        """
        return np.asarray(self.center + np.asarray(zeta, dtype=float) @ self.generators.T)

    def hull(self) -> "ParameterSet":
        """Smallest box around the set.

        Returns
        -------
        ParameterSet
        """
        return ParameterSet(
            names=self.names, center=self.center, generators=np.diag(self.radius), origin=f"box around: {self.origin}"
        )

    def scaled(self, factor: float) -> "ParameterSet":
        """The set shrunk or grown around its centre.

        Parameters
        ----------
        factor : float
            Larger than or equal to 0.

        Returns
        -------
        ParameterSet

        Raises
        ------
        ParameterError
            If the factor is negative or not finite.
        """
        if not np.isfinite(factor) or factor < 0:
            raise ParameterError(f"scaled: factor = {factor!r}: must be finite and >= 0.")
        return ParameterSet(
            names=self.names, center=self.center, generators=factor * self.generators,
            origin=f"{factor:g} times: {self.origin}",
        )  # fmt: skip

    def coordinates(self, values: Mapping[str, float]) -> tuple[Array, float]:
        """Find a point of the unit box that gives some parameters, the one with the smallest largest coordinate.

        Parameters
        ----------
        values : mapping of str to float
            All parameters.

        Returns
        -------
        zeta : ndarray, shape (n,)
            The point.
        size : float
            Its largest absolute coordinate: at most 1 inside the set; infinite if no point gives the values.

        Raises
        ------
        ParameterError
            If a parameter is missing.
        """
        from scipy.optimize import linprog

        missing = [name for name in self.names if name not in values]
        if missing:
            raise ParameterError(f"coordinates: {', '.join(missing)} missing.")
        rows, n = self.generators, self.generators.shape[1]
        difference = np.array([float(values[name]) for name in self.names]) - self.center
        scale = np.where(self.radius > 0, self.radius, np.maximum(np.abs(self.center), 1e-300))
        rows, difference = rows / scale[:, None], difference / scale
        ones = np.ones((n, 1))
        found = linprog(
            np.append(np.zeros(n), 1.0),
            A_ub=np.block([[np.eye(n), -ones], [-np.eye(n), -ones]]), b_ub=np.zeros(2 * n),
            A_eq=np.hstack([rows, np.zeros((len(rows), 1))]), b_eq=difference,
            bounds=[(None, None)] * n + [(0, None)], method="highs",
        )  # fmt: skip
        if not found.success:
            return np.full(n, np.nan), np.inf
        return found.x[:n], float(found.x[n])

    def sample(self, rng: np.random.Generator, count: int, vertices: float = 0.5) -> Array:
        """Random points of the unit box, a share of them vertices.

        Parameters
        ----------
        rng : numpy.random.Generator
            Randomness.
        count : int
            Number of points.
        vertices : float
            Share of vertices, 0..1.

        Returns
        -------
        ndarray, shape (count, n)
        """
        return unit_points(rng, count, self.generators.shape[1], vertices)


def unit_points(rng: np.random.Generator, count: int, n: int, vertices: float = 0.5) -> Array:
    """Random points of the box |zeta_i| <= 1, a share of them vertices.

    Parameters
    ----------
    rng : numpy.random.Generator
        Randomness.
    count, n : int
        Number of points and their dimension.
    vertices : float
        Share of vertices, 0..1.

    Returns
    -------
    ndarray, shape (count, n)
    """
    points = rng.uniform(-1.0, 1.0, (count, n))
    corner = rng.random(count) < vertices
    points[corner] = np.where(points[corner] < 0, -1.0, 1.0)
    return points


def box(
    center: Mapping[str, float],
    *,
    relative: float | Mapping[str, float] = 0.0,
    absolute: Mapping[str, float] = MappingProxyType({}),
    names: Sequence[str] | None = None,
    origin: str = "stated box",
) -> ParameterSet:
    """Box around nominal parameters.

    Parameters
    ----------
    center : mapping of str to float
        Nominal values, SI.
    relative : float or mapping of str to float
        Half width relative to the value, of all or by name; the names left out are exact.
    absolute : mapping of str to float
        Half width in SI units, added to the relative one.
    names : sequence of str, optional
        Order of the parameters; that of `center` by default.
    origin : str
        For reports.

    Returns
    -------
    ParameterSet

    Raises
    ------
    ParameterError
        If a name is unknown or a half width is negative.
    """
    order = tuple(center) if names is None else tuple(names)
    by_name = dict.fromkeys(order, float(relative)) if isinstance(relative, int | float) else dict(relative)
    for what, given in (("relative", by_name), ("absolute", dict(absolute)), ("names", dict.fromkeys(order, 0.0))):
        for name, value in given.items():
            if name not in center:
                raise ParameterError(f"box: {what} names {name!r}, which is no parameter of {', '.join(center)}.")
            if not np.isfinite(value) or value < 0:
                raise ParameterError(f"box: {what} half width {value!r} of {name}: must be >= 0; write 0.02 for 2 %.")
    radius = [abs(center[name]) * by_name.get(name, 0.0) + absolute.get(name, 0.0) for name in order]
    used = [k for k, r in enumerate(radius) if r > 0]
    generators = np.zeros((len(order), len(used)))
    generators[used, range(len(used))] = [radius[k] for k in used]
    return ParameterSet(
        names=order, center=np.array([float(center[name]) for name in order]), generators=generators, origin=origin
    )


def join(*parts: ParameterSet) -> ParameterSet:
    """Put independent sets side by side.

    Parameters
    ----------
    *parts : ParameterSet
        Sets of different parameters.

    Returns
    -------
    ParameterSet

    Raises
    ------
    ParameterError
        If a parameter is in two of them.
    """
    from scipy.linalg import block_diag

    return ParameterSet(
        names=tuple(name for part in parts for name in part.names),
        center=np.concatenate([part.center for part in parts]),
        generators=block_diag(*[part.generators for part in parts]),
        origin="; ".join(part.origin for part in parts),
    )


def own_columns(parameters: ParameterSet, names: Sequence[str]) -> list[int]:
    """Columns of a set that belong to some parameters alone.

    Parameters
    ----------
    parameters : ParameterSet
        The set.
    names : sequence of str
        Parameters.

    Returns
    -------
    list of int
        Columns of the generators; none for an exact parameter.

    Raises
    ------
    ParameterError
        If a name is unknown, or its columns move other parameters too.
    """
    unknown = [name for name in names if name not in parameters.names]
    if unknown:
        raise ParameterError(f"{', '.join(unknown)} unknown; parameters are {', '.join(parameters.names)}.")
    used = parameters.generators != 0
    inside = np.array([name in names for name in parameters.names])
    columns = used[inside].any(axis=0)
    tied = [
        name for name, row in zip(parameters.names, used, strict=True) if name not in names and (row & columns).any()
    ]
    if tied:
        raise ParameterError(f"{', '.join(names)} are correlated with {', '.join(tied)} in the set.")
    return [int(k) for k in np.flatnonzero(columns)]


@dataclass(frozen=True, kw_only=True, slots=True)
class MeasurementErrors:
    """Bounds of the measurement errors: |true - measured| <= absolute + relative |measured|.

    V_rms, I_rms and omega_e are usually bounded relative to their value, phi, H and Q absolutely.

    Parameters
    ----------
    relative : mapping of str to float
        By channel, -.
    absolute : mapping of str to float
        By channel, SI.
    bias_share : mapping of str to float
        Part of a channel's bound that is constant over a window, 0..1; 0 where left out.

    Raises
    ------
    ParameterError
        If a channel is unknown, a bound negative or a share outside 0..1.
    """

    relative: Mapping[str, float] = field(default_factory=dict)
    absolute: Mapping[str, float] = field(default_factory=dict)
    bias_share: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for what, high in (("relative", 0.5), ("absolute", np.inf), ("bias_share", 1.0)):
            given = dict(getattr(self, what))
            object.__setattr__(self, what, MappingProxyType(given))
            for name, value in given.items():
                if name not in CHANNELS:
                    raise ParameterError(
                        f"MeasurementErrors.{what}: {name!r} is no channel; use {', '.join(CHANNELS)}."
                    )
                if not (0.0 <= value <= high):
                    raise ParameterError(
                        f"MeasurementErrors.{what}[{name!r}] = {value!r}: must be 0 to {high:g}; 2 % is 0.02."
                    )

    def bounds(self, channels: Sequence[str]) -> tuple[Array, Array, Array]:
        """Bounds as arrays.

        Parameters
        ----------
        channels : sequence of str
            Which ones.

        Returns
        -------
        absolute, relative, share : ndarray, shape (channels,)
        """
        each = (self.absolute, self.relative, self.bias_share)
        a, r, s = (np.array([float(part.get(name, 0.0)) for name in channels]) for part in each)
        return a, r, s
