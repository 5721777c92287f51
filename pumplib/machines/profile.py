"""Thesis, all chapters: quantities prescribed over time (frequency, valve, load) as data."""

from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from pumplib.errors import ParameterError

Array = NDArray[Any]


@dataclass(frozen=True, slots=True)
class Profile:
    """A quantity over time: steps or straight lines between points, constant before and after them.

    Parameters
    ----------
    points : tuple of (float, float)
        Times in s, strictly increasing, and values in SI units.
    kind : {"steps", "lines"}
        ``"steps"`` holds a value from its time on, ``"lines"`` joins the points.

    Raises
    ------
    ParameterError
        If there is no point, a number is not finite, or the times do not increase.
    """

    points: tuple[tuple[float, float], ...]
    kind: Literal["steps", "lines"] = "steps"

    def __post_init__(self) -> None:
        if self.kind not in ("steps", "lines"):
            raise ParameterError(f'Profile.kind = {self.kind!r}: must be "steps" or "lines".')
        if not self.points:
            raise ParameterError("Profile.points is empty: give at least one (time in s, value).")
        for point in self.points:
            if len(point) != 2 or not all(np.isfinite(point)):
                raise ParameterError(f"Profile point {point!r}: must be two finite numbers (time in s, value).")
        times = [t for t, _ in self.points]
        for earlier, later in pairwise(times):
            if later <= earlier:
                raise ParameterError(
                    f"Profile times {earlier:g} s, {later:g} s: must increase; sort the points and remove doubles."
                )

    @property
    def times(self) -> Array:
        """Times of the points, s."""
        return np.array([t for t, _ in self.points])

    @property
    def values(self) -> Array:
        """Values of the points."""
        return np.array([v for _, v in self.points])

    def breaks(self) -> Array:
        """Times at which the value or its slope jumps.

        Returns
        -------
        ndarray
            s.
        """
        return self.times[1:] if self.kind == "steps" else self.times

    def sample(self, t: Array, start: float) -> Array:
        """Values at the times `t` of a segment that begins at `start` and has no break inside.

        At a step the value after it holds when the segment begins there and the value before it when
        the segment ends there, so that no integration step sees both.

        Parameters
        ----------
        t : ndarray, shape (n,)
            Times, s, not before `start`.
        start : float
            Begin of the segment, s.

        Returns
        -------
        ndarray, shape (n,)
        """
        times, values = self.times, self.values
        if self.kind == "lines":
            return np.interp(t, times, values)
        index = max(int(np.searchsorted(times, start + 1e-12, side="right")) - 1, 0)
        return np.full(len(t), values[index])


def as_profile(value: float | Profile, name: str) -> Profile:
    """Turn a constant into a profile; profiles pass through.

    Parameters
    ----------
    value : float or Profile
        What the caller gave.
    name : str
        Shown in the error.

    Returns
    -------
    Profile

    Raises
    ------
    ParameterError
        If it is neither a profile nor a finite number.
    """
    if isinstance(value, Profile):
        return value
    if isinstance(value, bool) or not isinstance(value, int | float | np.number) or not np.isfinite(value):
        raise ParameterError(f"{name} = {value!r}: must be a finite number or a Profile.")
    return Profile(((0.0, float(value)),))
