"""Thesis, all chapters: the typed parameters of a notebook.

papermill checks nothing: `-p x true`, `null` and `[1,2]` arrive as text, `1e-3` may, and an unknown
name only warns. Each notebook therefore says what it accepts, and everything else is an error.
"""

import ast
import difflib
import math
import numbers as numeric
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pumplib import paths
from pumplib.errors import ParameterError

_NONE = ("", "none", "null")
_MOST_NAMES = 20  # listed in a message


@dataclass(frozen=True)
class Spec:
    """What one parameter accepts.

    Attributes
    ----------
    allowed : str
        The accepted values in words, with the unit.
    unit : str
        Unit, or "" where there is none.
    convert : callable
        Takes the raw value and returns the value, or raises ValueError.
    """

    allowed: str
    unit: str
    convert: Callable[[Any], Any]

    def check(self, name: str, value: Any) -> Any:
        """Return the value of the parameter.

        Parameters
        ----------
        name : str
            Name of the parameter.
        value : object
            The value as the notebook or papermill holds it.

        Returns
        -------
        object
            The value in its own type.

        Raises
        ------
        ParameterError
            If the value is not accepted; the message names parameter, value, unit and what is allowed.
        """
        try:
            return self.convert(value)
        except ValueError as error:
            unit = f" {self.unit}" if self.unit not in ("", "-") else ""
            detail = f" ({error})" if str(error) else ""
            raise ParameterError(
                f"parameter {name} = {value!r}{unit} is not accepted{detail}; use {self.allowed}"
            ) from None


def _is_none(value: Any) -> bool:
    return value is None or (isinstance(value, str) and value.strip().lower() in _NONE)


def _to_float(value: Any) -> float:
    if isinstance(value, str):
        try:
            value = float(value.strip())
        except ValueError:
            raise ValueError("not a number") from None
    # A bool is a number to Python; as a parameter it is a mistake.
    if isinstance(value, bool) or not isinstance(value, numeric.Real):
        raise ValueError(f"a {type(value).__name__} is not a number")
    found = float(value)
    if not math.isfinite(found):
        raise ValueError("not finite")
    return found


def _to_int(value: Any) -> int:
    if isinstance(value, str):
        try:
            return int(value.strip())
        except ValueError:
            raise ValueError("not a whole number") from None
    if isinstance(value, bool) or not isinstance(value, numeric.Integral):
        raise ValueError(f"a {type(value).__name__} is not a whole number")
    return int(value)


def _in_range(value: Any, low: float | None, high: float | None) -> Any:
    if low is not None and value < low:
        raise ValueError("too small")
    if high is not None and value > high:
        raise ValueError("too large")
    return value


def _range_text(what: str, low: float | None, high: float | None, unit: str) -> str:
    limits = {
        (False, False): f" from {low} to {high}",
        (False, True): f" of at least {low}",
        (True, False): f" of at most {high}",
        (True, True): "",
    }[low is None, high is None]
    return f"{what}{limits}" + (f" {unit}" if unit not in ("", "-") else "")


def _maybe(spec: Spec, optional: bool) -> Spec:
    if not optional:
        return spec
    return Spec(f"{spec.allowed}, or None", spec.unit, lambda raw: None if _is_none(raw) else spec.convert(raw))


def number(low: float | None = None, high: float | None = None, unit: str = "-", *, optional: bool = False) -> Spec:
    """Accept a finite number.

    Parameters
    ----------
    low, high : float, optional
        Range, both ends included.
    unit : str
        Unit of value and range.
    optional : bool
        Whether None is accepted as well.

    Returns
    -------
    Spec
        For `start`; the value is a float.
    """
    text = _range_text("a number", low, high, unit)
    return _maybe(Spec(text, unit, lambda raw: _in_range(_to_float(raw), low, high)), optional)


def integer(low: int | None = None, high: int | None = None, unit: str = "-", *, optional: bool = False) -> Spec:
    """Accept a whole number.

    Parameters
    ----------
    low, high : int, optional
        Range, both ends included.
    unit : str
        Unit of value and range.
    optional : bool
        Whether None is accepted as well.

    Returns
    -------
    Spec
        For `start`; the value is an int.
    """
    text = _range_text("a whole number", low, high, unit)
    return _maybe(Spec(text, unit, lambda raw: _in_range(_to_int(raw), low, high)), optional)


def numbers(low: float | None = None, high: float | None = None, unit: str = "-", *, length: int | None = None) -> Spec:
    """Accept a list of finite numbers.

    Parameters
    ----------
    low, high : float, optional
        Range of each element, both ends included.
    unit : str
        Unit of the elements and the range.
    length : int, optional
        Number of elements; at least one by default.

    Returns
    -------
    Spec
        For `start`; the value is a tuple of floats.
    """

    def convert(raw: Any) -> tuple[float, ...]:
        if isinstance(raw, str):
            try:
                raw = ast.literal_eval(raw.strip())
            except (ValueError, SyntaxError):
                raise ValueError("not a list") from None
        if not isinstance(raw, list | tuple) or not raw:
            raise ValueError("not a list with at least one element")
        if length is not None and len(raw) != length:
            raise ValueError(f"{len(raw)} elements")
        return tuple(_in_range(_to_float(item), low, high) for item in raw)

    count = f"a list of {length} numbers" if length else "a list of numbers"
    return Spec(_range_text(count, low, high, unit), unit, convert)


def flag() -> Spec:
    """Accept True or False.

    Returns
    -------
    Spec
        For `start`; the value is a bool.
    """

    def convert(raw: Any) -> bool:
        if isinstance(raw, bool):
            return raw
        if isinstance(raw, str) and raw.strip().lower() in ("true", "false"):
            return raw.strip().lower() == "true"
        raise ValueError("")

    return Spec("True or False", "", convert)


def choice(*allowed: str) -> Spec:
    """Accept one of some words.

    Parameters
    ----------
    *allowed : str
        The words, compared exactly.

    Returns
    -------
    Spec
        For `start`; the value is a str.
    """

    def convert(raw: Any) -> str:
        if isinstance(raw, str) and raw in allowed:
            return raw
        raise ValueError("")

    return Spec("one of " + ", ".join(repr(word) for word in allowed), "", convert)


def names(*allowed: str, empty: bool = True) -> Spec:
    """Accept some of many names, as a text with commas between them or as a list.

    Parameters
    ----------
    *allowed : str
        The names, compared exactly; none of them has a comma in it.
    empty : bool
        Whether none of them (an empty text, an empty list or None) is accepted as well.

    Returns
    -------
    Spec
        For `start`; the value is a tuple of str, in the given order. A message lists all names or, where there are
        many, the ones closest to what was given.
    """
    more = len(allowed) - _MOST_NAMES
    shown = ", ".join(allowed[:_MOST_NAMES]) + (f" and {more} more" if more > 0 else "")

    def convert(raw: Any) -> tuple[str, ...]:
        if _is_none(raw):
            raw = []
        if isinstance(raw, str):
            raw = raw.strip()
            if raw.startswith(("[", "(")):
                try:
                    raw = ast.literal_eval(raw)
                except (ValueError, SyntaxError):
                    raise ValueError("not a list") from None
            else:
                raw = raw.split(",")
        if not isinstance(raw, list | tuple) or not all(isinstance(name, str) for name in raw):
            raise ValueError("not a list of names")
        found = tuple(name.strip() for name in raw)
        if not found and not empty:
            raise ValueError("no name is given")
        for name in found:
            if name not in allowed:
                close = difflib.get_close_matches(name, allowed, n=3) if len(allowed) > _MOST_NAMES else []
                hint = f"; did you mean {' or '.join(map(repr, close))}?" if close else ""
                raise ValueError(f"{name!r} is not one of them{hint}")
            if found.count(name) > 1:
                raise ValueError(f"{name!r} is there twice")
        return found

    least = "" if empty else "at least one of "
    return Spec(f"names with commas between them, {least or 'any of '}{shown}", "", convert)


def text(*, optional: bool = False) -> Spec:
    """Accept a text that is not empty.

    Parameters
    ----------
    optional : bool
        Whether None (or an empty text) is accepted as well.

    Returns
    -------
    Spec
        For `start`; the value is a str.
    """

    def convert(raw: Any) -> str:
        if isinstance(raw, str) and raw.strip():
            return raw
        raise ValueError("")

    return _maybe(Spec("a text that is not empty", "", convert), optional)


def file(*, optional: bool = False) -> Spec:
    """Accept the path of an existing file.

    Parameters
    ----------
    optional : bool
        Whether None (or an empty text) is accepted as well.

    Returns
    -------
    Spec
        For `start`; the value is an absolute Path. A relative path is looked for in the working
        directory first and in the workbook's folder second, because papermill and JupyterLab
        start a notebook in different directories.
    """

    def convert(raw: Any) -> Path:
        if not isinstance(raw, str | Path) or not str(raw).strip():
            raise ValueError("not a path")
        given = Path(raw).expanduser()
        for candidate in (Path.cwd() / given, paths.ROOT / given):
            if candidate.is_file():
                return candidate.resolve()
        raise ValueError("no such file")

    described = "the path of an existing file, absolute or relative to the workbook's folder"
    return _maybe(Spec(described, "", convert), optional)


class Parameters(Mapping[str, Any]):
    """Checked parameters: read as attributes or by name, never changed."""

    def __init__(self, values: Mapping[str, Any]) -> None:
        object.__setattr__(self, "_values", dict(values))

    def __getattr__(self, name: str) -> Any:
        values: dict[str, Any] = object.__getattribute__(self, "_values")
        if name not in values:
            raise AttributeError(f"no parameter {name!r}; there are {', '.join(values) or 'none'}")
        return values[name]

    def __setattr__(self, name: str, value: Any) -> None:
        raise AttributeError(f"parameter {name!r} is fixed; change the parameters cell and run again")

    def __getitem__(self, name: str) -> Any:
        return self._values[name]

    def __iter__(self) -> Any:
        return iter(self._values)

    def __len__(self) -> int:
        return len(self._values)

    def __repr__(self) -> str:
        return "Parameters(" + ", ".join(f"{k}={v!r}" for k, v in self._values.items()) + ")"
