"""Thesis, all chapters: the ledger of claims, and the comparison of a value with its bound.

A claim is a statement with a metric and a bound that were written down before the value was known.
Nothing here can turn a miss into a hit: a value is judged as it was recorded, and what was not
measured reads "not run".
"""

import math
import numbers
import re
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from pumplib.errors import ClaimError
from pumplib.workbook.layout import Layout

Verdict = Literal["holds", "fails", "not run"]
Number = int | float

CLASSES = ("replicated", "reconstructed", "beyond")
OPS = (">=", "<=", "==", "within")
LEVELS = ("required", "stretch")
_TEXTS = ("id", "class", "statement", "metric", "op", "unit", "level", "section", "thesis", "why", "source")
_REQUIRED = (*_TEXTS, "chapter", "bound")
_OPTIONAL = ("profile", "n")


@dataclass(frozen=True, kw_only=True)
class Claim:
    """One entry of the ledger.

    Attributes
    ----------
    id, chapter, section : str, int, str
        Name of the claim and the place of its statement in the thesis.
    kind : str
        `replicated`, `reconstructed` or `beyond` (the field `class` of the file).
    statement, thesis, metric, why : str
        What is claimed, what the thesis reports, what is measured, and why the bound is what it is.
    op, bound, unit : str, number or list, str
        The test that the value must pass; a list is compared element by element.
    level : str
        `required` or `stretch`.
    source : str
        `notebook:NAME` or `measured`.
    profile, n : str or None, int or None
        Bench profile and least number of runs, where they apply.
    """

    id: str
    chapter: int
    kind: str
    statement: str
    metric: str
    op: str
    bound: Number | tuple[Number, ...]
    unit: str
    level: str
    section: str
    thesis: str
    why: str
    source: str
    profile: str | None = None
    n: int | None = None

    @property
    def notebook(self) -> str | None:
        """Notebook that records the value, or None if it is measured elsewhere."""
        return self.source.removeprefix("notebook:") if self.source.startswith("notebook:") else None


@dataclass(frozen=True, kw_only=True)
class Measurement:
    """A measured value of a claim.

    Attributes
    ----------
    id : str
        The claim.
    value : number or tuple of numbers, or None
        In the claim's unit; None if the notebook could not measure it here, and says why in the note.
    n, successes : int or None
        Number of runs, and how many of them count, where the value is a rate or a count.
    note : str
        One line for the table.
    """

    id: str
    value: Number | tuple[Number, ...] | None
    n: int | None = None
    successes: int | None = None
    note: str = ""

    @property
    def interval(self) -> tuple[float, float] | None:
        """Clopper-Pearson 95 % interval of successes / n, or None where that has no meaning."""
        if self.n is None or self.successes is None:
            return None
        from scipy.stats import binomtest

        limits = binomtest(self.successes, self.n).proportion_ci(0.95, method="exact")
        return float(limits.low), float(limits.high)


def _as_number(owner: str, value: Any) -> Number:
    if isinstance(value, numbers.Integral) and not isinstance(value, bool):
        return int(value)
    if isinstance(value, numbers.Real) and not isinstance(value, bool):
        if math.isfinite(value):
            return float(value)
        raise ClaimError(f"{owner}: value is {value}; record a finite number, or find out why there is none")
    raise ClaimError(f"{owner}: value {value!r} is a {type(value).__name__}; record a number (int or float)")


def as_value(owner: str, value: Any) -> Number | tuple[Number, ...]:
    """Return a recorded value as a plain number or a tuple of them.

    Parameters
    ----------
    owner : str
        Claim id, for the error message.
    value : object
        Number, NumPy scalar, or a sequence or one-dimensional array of them.

    Returns
    -------
    int, float or tuple
        The value in plain Python numbers.

    Raises
    ------
    ClaimError
        If it is not a finite number or a sequence of finite numbers.
    """
    if getattr(value, "shape", None) is not None:
        value = value.tolist()
    if isinstance(value, list | tuple):
        if not value:
            raise ClaimError(f"{owner}: value is an empty list; record at least one number")
        return tuple(_as_number(owner, item) for item in value)
    return _as_number(owner, value)


def judge(claim: Claim, value: Any) -> Verdict:
    """Compare a value with the bound of its claim.

    Parameters
    ----------
    claim : Claim
        The claim.
    value : number or sequence of numbers
        Measured value in the claim's unit. A claim with a list as bound takes as many numbers,
        `within` takes one number and includes both ends.

    Returns
    -------
    str
        "holds" or "fails".

    Raises
    ------
    ClaimError
        If the value is not finite, not a number, or has another length than the bound.
    """
    found = as_value(claim.id, value)
    if claim.op == "within":
        low, high = claim.bound  # type: ignore[misc]
        if isinstance(found, tuple):
            raise ClaimError(f"{claim.id}: {len(found)} values for a bound that takes one number")
        return "holds" if low <= found <= high else "fails"
    values = found if isinstance(found, tuple) else (found,)
    bounds = claim.bound if isinstance(claim.bound, tuple) else (claim.bound,)
    if len(values) != len(bounds) or isinstance(found, tuple) != isinstance(claim.bound, tuple):
        raise ClaimError(f"{claim.id}: {value!r} does not have the form of its bound {list(bounds)}")
    tests = {">=": lambda v, b: v >= b, "<=": lambda v, b: v <= b, "==": lambda v, b: v == b}
    test = tests[claim.op]
    return "holds" if all(test(v, b) for v, b in zip(values, bounds, strict=True)) else "fails"


def measure(
    claim: Claim, value: Any, n: int | None = None, successes: int | None = None, note: str = ""
) -> Measurement:
    """Check a value against its claim's form and return it as a measurement.

    Parameters
    ----------
    claim : Claim
        The claim.
    value : number or sequence of numbers
        In the claim's unit.
    n : int, optional
        Number of runs; obligatory where the claim asks for a least number.
    successes : int, optional
        Runs that count. The value must then be this count or its share of n.
    note : str
        One line for the table.

    Returns
    -------
    Measurement
        The checked value.

    Raises
    ------
    ClaimError
        If the value has the wrong form, n is absent or not positive, or successes contradict n or value.
    """
    judge(claim, value)
    plain = as_value(claim.id, value)
    counts: dict[str, int | None] = {"n": n, "successes": successes}
    for name, count in counts.items():
        if count is not None and (isinstance(count, bool) or not isinstance(count, numbers.Integral)):
            raise ClaimError(f"{claim.id}: {name} = {count!r} must be a whole number")
    if claim.n is not None and n is None:
        raise ClaimError(f"{claim.id}: the claim asks for at least {claim.n} runs; record n as well")
    if n is not None and n < 1:
        raise ClaimError(f"{claim.id}: n = {n} must be at least 1")
    if successes is not None:
        if n is None or not 0 <= successes <= n:
            raise ClaimError(f"{claim.id}: successes = {successes} must lie between 0 and n = {n}")
        matches = isinstance(plain, tuple) or any(
            math.isclose(plain, expected, rel_tol=1e-9, abs_tol=1e-12)
            for expected in (successes, successes / n, (n - successes) / n)
        )
        if not matches:
            raise ClaimError(f"{claim.id}: value {plain} is neither {successes} nor a share of {n} runs")
    return Measurement(
        id=claim.id,
        value=plain,
        n=None if n is None else int(n),
        successes=None if successes is None else int(successes),
        note=str(note),
    )


def _check_entry(entry: Mapping[str, Any], place: str) -> Claim:
    name = entry.get("id", "?")
    where = f"{place}: claim {name!r}"
    missing = [field for field in _REQUIRED if field not in entry]
    if missing:
        raise ClaimError(f"{where}: missing {', '.join(missing)}; every claim has these fields")
    unknown = sorted(set(entry) - set(_REQUIRED) - set(_OPTIONAL))
    if unknown:
        raise ClaimError(f"{where}: unknown field {', '.join(unknown)}; remove it or correct its name")
    for field in (*_TEXTS, *(["profile"] if "profile" in entry else [])):
        if not isinstance(entry[field], str) or not entry[field].strip():
            raise ClaimError(f"{where}: {field} = {entry[field]!r} must be a text that is not empty")
    for field, allowed in (("class", CLASSES), ("op", OPS), ("level", LEVELS)):
        if entry[field] not in allowed:
            raise ClaimError(f"{where}: {field} = {entry[field]!r}; use one of {', '.join(allowed)}")
    if not re.fullmatch(r"(measured|notebook:\d\d_\w+)", entry["source"]):
        raise ClaimError(f"{where}: source = {entry['source']!r}; use notebook:NAME or measured")
    for field in ("chapter", "n"):
        count = entry.get(field, 1)
        if isinstance(count, bool) or not isinstance(count, int) or count < 1:
            raise ClaimError(f"{where}: {field} = {count!r} must be a whole number of at least 1")
    bound = as_value(f"{where}: bound", entry["bound"])
    if entry["op"] == "within" and not (isinstance(bound, tuple) and len(bound) == 2 and bound[0] <= bound[1]):
        raise ClaimError(f"{where}: bound = {entry['bound']!r}; within takes [lower, upper]")
    fields = {key: value for key, value in entry.items() if key not in ("class", "bound")}
    return Claim(kind=entry["class"], bound=bound, **fields)


def load_claims(path: Path | None = None) -> dict[str, Claim]:
    """Read and check the ledger.

    Parameters
    ----------
    path : Path, optional
        The file; the committed `data/claims.toml` by default.

    Returns
    -------
    dict of str to Claim
        In the order of the file.

    Raises
    ------
    ClaimError
        If the file cannot be read, an id appears twice, or a field is missing, unknown or wrong.
    """
    path = path or Layout().ledger
    try:
        content = tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, tomllib.TOMLDecodeError) as error:
        raise ClaimError(f"{path.name}: cannot be read as a ledger: {error}") from error
    ledger: dict[str, Claim] = {}
    for entry in content.get("claim", []):
        claim = _check_entry(entry, path.name)
        if claim.id in ledger:
            raise ClaimError(f"{path.name}: claim {claim.id!r} appears twice; ids are unique")
        ledger[claim.id] = claim
    return ledger


def find(ledger: Mapping[str, Claim], name: str) -> Claim:
    """Return a claim by its id.

    Parameters
    ----------
    ledger : mapping of str to Claim
        All claims.
    name : str
        Id.

    Returns
    -------
    Claim
        The claim.

    Raises
    ------
    ClaimError
        If there is none; the message names similar ids.
    """
    if name in ledger:
        return ledger[name]
    import difflib

    close = difflib.get_close_matches(name, ledger, n=3)
    hint = f"; did you mean {' or '.join(close)}?" if close else "; add it to the ledger first"
    raise ClaimError(f"unknown claim id {name!r}{hint}")
