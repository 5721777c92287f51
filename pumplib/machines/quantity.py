"""Thesis, all chapters: what a parameter field is (unit, limits, meaning) and the check of its value."""

import math
from dataclasses import dataclass, fields, is_dataclass
from functools import cache
from typing import Annotated, Any, get_args, get_origin, get_type_hints

from pumplib.errors import ParameterError


@dataclass(frozen=True, slots=True)
class Quantity:
    """Meaning, SI unit and physical limits of one parameter field.

    Parameters
    ----------
    unit : str
        SI unit of the stored value.
    meaning : str
        What the field is, in the field's standard terms.
    low, high : float
        Limits of what is physically possible for the machines of this workbook; values outside are refused.
    open_low : bool
        Whether the lower limit itself is refused.
    hint : str
        Remedy for the usual mistake, shown with the error.
    """

    unit: str
    meaning: str
    low: float = 0.0
    high: float = math.inf
    open_low: bool = False
    hint: str = ""

    def allowed(self) -> str:
        """Return the allowed range in words.

        Returns
        -------
        str
        """
        unit = "" if self.unit == "-" else f" {self.unit}"
        low = f"{'>' if self.open_low else '>='} {self.low:g}{unit}" if self.low > -math.inf else ""
        high = f"<= {self.high:g}{unit}" if self.high < math.inf else ""
        return " and ".join(part for part in (low, high) if part) or "any finite number"


@dataclass(frozen=True, slots=True)
class Choice:
    """A field that takes one of a few names.

    Parameters
    ----------
    meaning : str
        What the field is.
    names : tuple of str
        Allowed values.
    """

    meaning: str
    names: tuple[str, ...]


@cache
def quantities(cls: Any) -> dict[str, Quantity | Choice]:
    """Return the description of every annotated field of a parameter class.

    Parameters
    ----------
    cls : type
        A frozen dataclass whose fields are ``Annotated[..., Quantity(...)]``.

    Returns
    -------
    dict
        Field name to `Quantity` or `Choice`.
    """
    hints = get_type_hints(cls, include_extras=True)
    found: dict[str, Quantity | Choice] = {}
    for field in fields(cls):
        for hint in (hints[field.name], *get_args(hints[field.name])):
            if get_origin(hint) is Annotated:
                found[field.name] = hint.__metadata__[0]
    return found


@cache
def _optional(cls: Any) -> frozenset[str]:
    hints = get_type_hints(cls)
    return frozenset(name for name, hint in hints.items() if type(None) in get_args(hint))


@cache
def whole_fields(cls: Any) -> frozenset[str]:
    """Return the names of the fields that hold integers.

    Parameters
    ----------
    cls : type
        A parameter class.

    Returns
    -------
    frozenset of str
    """
    hints = get_type_hints(cls)
    return frozenset(name for name, hint in hints.items() if hint is int)


def check_value(owner: str, name: str, value: Any, quantity: Quantity, whole: bool = False) -> None:
    """Check one number against its description.

    Parameters
    ----------
    owner, name : str
        Shown in the error as ``owner.name``.
    value : object
        The value to check.
    quantity : Quantity
        What it must be.
    whole : bool
        Whether only integers are allowed.

    Raises
    ------
    ParameterError
        If it is not a finite number, not whole, or outside the limits.
    """
    where = f"{owner}.{name}"
    unit = "" if quantity.unit == "-" else f" {quantity.unit}"
    remedy = f" {quantity.hint}" if quantity.hint else ""
    # numpy scalars are numbers too; bool is an int in Python but never a physical value
    if isinstance(value, bool) or not hasattr(value, "__float__") or hasattr(value, "__len__"):
        raise ParameterError(f"{where} = {value!r}: must be a number in {quantity.unit} ({quantity.meaning}).{remedy}")
    number = float(value)
    if not math.isfinite(number):
        raise ParameterError(
            f"{where} = {value!r}{unit}: must be finite ({quantity.meaning}); give a measured or data-sheet value."
        )
    if whole and number != int(number):
        raise ParameterError(f"{where} = {value!r}: must be a whole number ({quantity.meaning}).{remedy}")
    too_low = number < quantity.low or (quantity.open_low and number == quantity.low)
    if too_low or number > quantity.high:
        raise ParameterError(f"{where} = {number:g}{unit}: must be {quantity.allowed()} ({quantity.meaning}).{remedy}")


class Parameters:
    """Base of the frozen parameter classes: every field is checked when an object is made."""

    def __post_init__(self) -> None:
        cls = type(self)
        assert is_dataclass(self)
        described, optional, whole = quantities(cls), _optional(cls), whole_fields(cls)
        for field in fields(self):
            value = getattr(self, field.name)
            rule = described.get(field.name)
            if rule is None or (value is None and field.name in optional):
                continue
            if isinstance(rule, Choice):
                if value not in rule.names:
                    raise ParameterError(
                        f"{cls.__name__}.{field.name} = {value!r}: must be one of "
                        f"{', '.join(rule.names)} ({rule.meaning})."
                    )
                continue
            many = value if isinstance(value, tuple) else (value,)
            for item in many:
                check_value(cls.__name__, field.name, item, rule, whole=field.name in whole)
        self._check_together()

    def _check_together(self) -> None:
        """Check conditions between fields; classes that have some override this."""


def table(parameters: Parameters) -> list[tuple[str, object, str, str]]:
    """Return the fields of a parameter object for display.

    Parameters
    ----------
    parameters : Parameters
        Any parameter object.

    Returns
    -------
    list of tuple
        ``(name, value, unit, meaning)`` in the order of definition.
    """
    rows: list[tuple[str, object, str, str]] = []
    for name, rule in quantities(type(parameters)).items():  # type: ignore[arg-type]
        unit = rule.unit if isinstance(rule, Quantity) else "-"
        rows.append((name, getattr(parameters, name), unit, rule.meaning))
    return rows
