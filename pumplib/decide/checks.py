"""Thesis 2.1.4, B.1: checks of what comes into the decision layer: shapes, names, numbers, missing values."""

from collections.abc import Sequence
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pumplib.errors import DataError, ParameterError
from pumplib.machines.quantity import Quantity, check_value

Array = NDArray[Any]
Missing = Literal["error", "hold"]
_REMEDY = "repair or cut the record"


def number(owner: str, name: str, value: object, quantity: Quantity, whole: bool = False) -> float:
    """Check one number and return it as a float.

    Parameters
    ----------
    owner, name : str
        Shown in the error as ``owner.name``.
    value : object
        What the caller gave.
    quantity : Quantity
        What it must be.
    whole : bool
        Whether only integers are allowed.

    Returns
    -------
    float

    Raises
    ------
    ParameterError
        If it is not a finite number inside the limits.
    """
    check_value(owner, name, value, quantity, whole)
    return float(value)  # type: ignore[arg-type]


def one_of(owner: str, name: str, value: object, allowed: Sequence[str]) -> None:
    """Check that a word is one of the allowed ones.

    Parameters
    ----------
    owner, name : str
        Shown in the error.
    value : object
        What the caller gave.
    allowed : sequence of str
        The allowed words.

    Raises
    ------
    ParameterError
        If it is another word.
    """
    if value not in allowed:
        raise ParameterError(f"{owner}.{name} = {value!r}: must be one of {', '.join(allowed)}.")


def channel_names(names: Sequence[str] | None, count: int, kind: str = "r") -> tuple[str, ...]:
    """Return one distinct name a channel; ``r1``, ``r2``, ... where none are given.

    Parameters
    ----------
    names : sequence of str, optional
        What the caller gave.
    count : int
        Number of channels.
    kind : str
        First letters of the names made here.

    Returns
    -------
    tuple of str

    Raises
    ------
    ParameterError
        If the number of names is not the number of channels, or a name comes twice.
    """
    if names is None:
        return tuple(f"{kind}{k + 1}" for k in range(count))
    found = tuple(str(name) for name in names)
    if len(found) != count:
        raise ParameterError(f"{len(found)} channel names {found} for {count} channels: give one name a channel.")
    if len(set(found)) != count:
        raise ParameterError(f"channel names {found}: every name may come once; rename the double one.")
    return found


def block(values: ArrayLike, names: Sequence[str], first: int = 0, missing: Missing = "error") -> Array:
    """Return samples as a C-ordered float array, time first, after checking every number.

    Parameters
    ----------
    values : array_like, shape (n, channels) or (n,) for one channel
        Samples.
    names : sequence of str
        Channel names, shown in errors.
    first : int
        Index of the block's first sample in the stream, shown in errors.
    missing : {"error", "hold"}
        Whether NaN is refused or left in; an infinite number is always refused.

    Returns
    -------
    ndarray, shape (n, channels)

    Raises
    ------
    DataError
        If the shape is wrong, or at the first number that is not allowed, with its channel and sample.
    """
    try:
        x = np.asarray(values, dtype=float)
    except (TypeError, ValueError) as error:
        raise DataError(f"samples of {', '.join(names)} are not numbers ({error}): {_REMEDY}.") from error
    if x.ndim == 1 and len(names) == 1:
        x = x[:, None]
    if x.ndim != 2 or x.shape[1] != len(names):
        raise DataError(
            f"samples have shape {x.shape}: must be (samples, {len(names)}), time first, one column for each of "
            f"{', '.join(names)}; transpose a record that has channels first."
        )
    x = np.ascontiguousarray(x)
    if not np.isfinite(x).all():
        wrong = np.isinf(x) if missing == "hold" else ~np.isfinite(x)
        if wrong.any():
            k, c = (int(i) for i in np.argwhere(wrong)[0])
            hold = ', or where the state may be held over it choose missing="hold"' if np.isnan(x[k, c]) else ""
            raise DataError(f"channel {names[c]}, sample {first + k}: {x[k, c]} is not finite; {_REMEDY}{hold}.")
    return x


def sample(values: ArrayLike, names: Sequence[str], first: int, missing: Missing = "error") -> Array:
    """Return one sample of every channel as a block of one row.

    Parameters
    ----------
    values : array_like, shape (channels,) or a number for one channel
        The sample.
    names, first, missing
        As in `block`.

    Returns
    -------
    ndarray, shape (1, channels)

    Raises
    ------
    DataError
        As `block`.
    """
    try:
        x = np.atleast_1d(np.asarray(values, dtype=float))
    except (TypeError, ValueError) as error:
        raise DataError(f"sample {first} of {', '.join(names)} is not a number ({error}): {_REMEDY}.") from error
    if x.shape != (len(names),):
        raise DataError(
            f"sample {first} has shape {x.shape}: must be ({len(names)},), one number for each of {', '.join(names)}."
        )
    return block(x[None, :], names, first, missing)


def flags(values: ArrayLike, names: Sequence[str]) -> Array:
    """Return yes/no samples as a C-ordered Boolean array, time first.

    Parameters
    ----------
    values : array_like of bool, shape (n, channels) or (n,) for one channel
        Samples.
    names : sequence of str
        Channel names.

    Returns
    -------
    ndarray of bool, shape (n, channels)

    Raises
    ------
    DataError
        If the entries are not Booleans or the shape is wrong.
    """
    x = np.asarray(values)
    if x.dtype != np.bool_:
        raise DataError(f"flags of {', '.join(names)} have type {x.dtype}: must be bool; compare with a limit first.")
    if x.ndim == 1 and len(names) == 1:
        x = x[:, None]
    if x.ndim != 2 or x.shape[1] != len(names):
        raise DataError(f"flags have shape {x.shape}: must be (samples, {len(names)}), time first.")
    return np.ascontiguousarray(x)


def generator(rng: object, where: str) -> np.random.Generator:
    """Check that randomness was passed in.

    Parameters
    ----------
    rng : object
        What the caller gave.
    where : str
        The function, shown in the error.

    Returns
    -------
    numpy.random.Generator

    Raises
    ------
    ParameterError
        If it is not a Generator.
    """
    if not isinstance(rng, np.random.Generator):
        raise ParameterError(f"{where}: rng = {rng!r} must be a numpy.random.Generator, like default_rng(seed).")
    return rng
