"""Thesis 7.3: are the sets enclosures, and how much wider than needed: truths counted, ranges found by optimisation."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pumplib.errors import ParameterError
from pumplib.steady.enclose import Enclosure, Method, SetModel
from pumplib.steady.relations import residuals, stack, truths
from pumplib.steady.sets import unit_points

Array = NDArray[Any]
_BLOCK = 65_536


@dataclass(frozen=True, kw_only=True, slots=True)
class TruthCount:
    """Outcome of a test with known truths.

    Parameters
    ----------
    truths : int
        How many parameter and error vectors were tried.
    outside : tuple of int
        Residuals outside their set, for each output.
    undefined : tuple of int
        Of these, residuals that are not a number.
    """

    truths: int
    outside: tuple[int, ...]
    undefined: tuple[int, ...]

    @property
    def violations(self) -> int:
        """Residuals outside their set, all outputs together."""
        return sum(self.outside)


def count_violations(
    model: SetModel,
    signals: Mapping[str, ArrayLike],
    rng: np.random.Generator,
    *,
    count: int = 1_000_000,
    vertices: float = 0.5,
    method: Method = "affine",
) -> TruthCount:
    """Draw truths from the sets, evaluate the residuals there and count those outside their enclosure.

    Parameters
    ----------
    model : SetModel
        Of the pump relations.
    signals : mapping of str to array_like, shape (n,)
        Operating points; the truths are spread over them evenly.
    rng : numpy.random.Generator
        Randomness.
    count : int
        Number of truths.
    vertices : float
        Share of truths at vertices of the unit box, where linear functions have their extremes.
    method : str
        Enclosure that is tested, of `pumplib.steady.enclose.METHODS`.

    Returns
    -------
    TruthCount

    Raises
    ------
    ParameterError
        If the model has other relations, or count is not positive.

    References
    ----------
    Thesis 7.3 (reconstructed).
    """
    if model.relations.function is not residuals:
        raise ParameterError(
            f"count_violations: relations {model.relations.name!r}; only those of the pump are compiled."
        )
    if count < 1:
        raise ParameterError(f"count_violations: count = {count!r}: must be at least 1.")
    x = stack(model.relations, signals)
    found = model.enclose(signals, method)
    counts = np.zeros((3, 2), dtype=np.int64)
    done = 0
    while done < count:
        rows = min(_BLOCK // len(x) * len(x) or len(x), count - done)
        truths(
            x, model.radii(x), model.parameters.center, model.parameters.generators,
            unit_points(rng, rows, model.size, vertices), found.lo, found.hi, model.relations.constants, counts,
        )  # fmt: skip
        done += rows
    return TruthCount(truths=done, outside=tuple(counts[:, 0].tolist()), undefined=tuple(counts[:, 1].tolist()))


def true_range(
    model: SetModel, signals: Mapping[str, ArrayLike], rng: np.random.Generator, *, starts: int = 6, sweeps: int = 8
) -> Enclosure:
    """Range of the outputs over the sets, found from inside by coordinate search.

    From random vertices and the vertex that the gradient points to, one coordinate after the other is moved to the
    best of -1, 1 and the top of the parabola through -1, 0, 1. Every value found is attained, so the true range is
    at least this wide and a width divided by this one is at least the true excess.

    Parameters
    ----------
    model : SetModel
        The sets.
    signals : mapping of str to array_like, shape (n,)
        Operating points.
    rng : numpy.random.Generator
        Randomness of the starts.
    starts : int
        Random vertices beside the gradient's.
    sweeps : int
        Largest number of passes over the coordinates.

    Returns
    -------
    Enclosure
        With method "linear", which is not guaranteed: it is an inner approximation.
    """
    x = stack(model.relations, signals)
    n, size, outputs = len(x), model.size, len(model.relations.outputs)
    lo, hi = np.full((n, outputs), np.inf), np.full((n, outputs), -np.inf)
    for output in range(outputs):
        for sign, best in ((1.0, hi), (-1.0, lo)):

            def value(zeta: Array, output: int = output, sign: float = sign) -> Array:
                with np.errstate(invalid="ignore"):
                    found = sign * model.point(np.repeat(x, zeta.shape[1], axis=0), zeta.reshape(-1, size))[:, output]
                return np.where(np.isnan(found), -np.inf, found).reshape(n, -1)

            slopes = np.stack(
                [value(np.tile(row, (n, 1, 1))) - value(np.tile(-row, (n, 1, 1))) for row in 1e-3 * np.eye(size)],
                axis=2,
            )
            corner = np.where(slopes >= 0, 1.0, -1.0)
            zeta = np.concatenate([corner, rng.choice((-1.0, 1.0), (n, starts, size))], axis=1)
            top = value(zeta)
            for _ in range(sweeps):
                before = top.copy()
                for j in range(size):
                    three = []
                    for place in (-1.0, 0.0, 1.0):
                        moved = zeta.copy()
                        moved[..., j] = place
                        three.append(value(moved))
                    a, b, c = three
                    bend = a - 2 * b + c
                    with np.errstate(divide="ignore", invalid="ignore"):
                        peak = np.clip(np.where(bend < 0, 0.5 * (a - c) / bend, 1.0), -1.0, 1.0)
                    for at in (np.full_like(peak, -1.0), np.full_like(peak, 1.0), np.nan_to_num(peak, nan=1.0)):
                        moved = zeta.copy()
                        moved[..., j] = at
                        tried = value(moved)
                        better = tried > top
                        zeta[better, j], top = at[better], np.where(better, tried, top)
                if np.all(top == before):
                    break
            best[:, output] = sign * top.max(axis=1)
    return Enclosure(outputs=model.relations.outputs, lo=lo, hi=hi, method="linear")
