"""Thesis, all chapters: gather the values of all claims, from notebooks and dated files, and judge them.

What was not measured reads "not run"; what was recorded wrongly is an error, never a verdict.
"""

import datetime
import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from pumplib.errors import ClaimError
from pumplib.workbook.claims import Claim, Measurement, Verdict, find, judge, measure
from pumplib.workbook.layout import write_json

Row = dict[str, Any]


def load_measured(folder: Path, ledger: Mapping[str, Claim]) -> dict[str, tuple[Measurement, str]]:
    """Read the dated results of benchmarks and campaigns.

    Parameters
    ----------
    folder : Path
        Folder of JSON files, each with date, machine, versions, seed and claims.
    ledger : mapping of str to Claim
        All claims.

    Returns
    -------
    dict of str to (Measurement, str)
        The value of each claim and the file and date it comes from.

    Raises
    ------
    ClaimError
        If a file lacks a field, names an unknown claim or one that a notebook records, or two
        files hold the same claim.
    """
    found: dict[str, tuple[Measurement, str]] = {}
    for path in sorted(folder.glob("*.json")):
        try:
            content = json.loads(path.read_text(encoding="utf-8"))
        except (OSError, ValueError) as error:
            raise ClaimError(f"{path.name}: cannot be read as JSON: {error}") from error
        missing = [k for k in ("date", "machine", "versions", "seed", "claims") if k not in content]
        if missing:
            raise ClaimError(f"{path.name}: missing {', '.join(missing)}; a measured file has these fields")
        try:
            datetime.date.fromisoformat(str(content["date"])[:10])
        except ValueError as error:
            raise ClaimError(f"{path.name}: date = {content['date']!r}; write YYYY-MM-DD") from error
        for name, entry in content["claims"].items():
            claim = find(ledger, name)
            if claim.notebook is not None:
                raise ClaimError(f"{path.name}: {name} is recorded by notebook {claim.notebook}, not measured")
            if name in found:
                raise ClaimError(f"{name}: in {path.name} and in {found[name][1]}; keep one of them")
            unknown = sorted(set(entry) - {"value", "n", "successes", "note"})
            if unknown or "value" not in entry:
                raise ClaimError(f"{path.name}: {name}: needs value; n, successes and note are optional")
            found[name] = (measure(claim, **entry), f"{path.name}, {content['date']}")
    return found


def problems(ledger: Mapping[str, Claim], notebook: str, values: Iterable[Measurement]) -> list[str]:
    """Return what is wrong with the values that a completed notebook recorded.

    Parameters
    ----------
    ledger : mapping of str to Claim
        All claims.
    notebook : str
        Name of the notebook.
    values : iterable of Measurement
        What it recorded.

    Returns
    -------
    list of str
        One line for each unknown, foreign, repeated or missing claim; empty if all is well.
    """
    lines: list[str] = []
    seen: set[str] = set()
    for value in values:
        claim = ledger.get(value.id)
        if claim is None:
            lines.append(f"{value.id}: unknown claim id")
        elif claim.notebook != notebook:
            lines.append(f"{value.id}: recorded by notebook {notebook}, but its source is {claim.source}")
        elif value.id in seen:
            lines.append(f"{value.id}: recorded twice")
        seen.add(value.id)
    expected = [claim.id for claim in ledger.values() if claim.notebook == notebook]
    lines += [f"{name}: not recorded by its notebook {notebook}" for name in expected if name not in seen]
    return lines


def _row(claim: Claim, value: Measurement | None, origin: str, reason: str) -> Row:
    verdict: Verdict = "not run"
    note = reason
    if value is not None:
        note = value.note
        if value.value is None:
            pass  # could not be measured on this machine
        elif claim.n is not None and (value.n or 0) < claim.n:
            note = f"n = {value.n} of {claim.n}" + (f"; {note}" if note else "")
        else:
            verdict = judge(claim, value.value)
    plain = None if value is None else value.value
    interval = None if value is None else value.interval
    return {
        "id": claim.id,
        "chapter": claim.chapter,
        "section": claim.section,
        "class": claim.kind,
        "level": claim.level,
        "statement": claim.statement,
        "thesis": claim.thesis,
        "metric": claim.metric,
        "value": list(plain) if isinstance(plain, tuple) else plain,
        "unit": claim.unit,
        "op": claim.op,
        "bound": list(claim.bound) if isinstance(claim.bound, tuple) else claim.bound,
        "verdict": verdict,
        "n": None if value is None else value.n,
        "n_required": claim.n,
        "interval": None if interval is None else list(interval),
        "profile": claim.profile,
        "why": claim.why,
        "source": claim.source,
        "origin": origin,
        "note": note,
    }


def collect(
    ledger: Mapping[str, Claim],
    recorded: Mapping[str, list[Measurement]],
    measured: Mapping[str, tuple[Measurement, str]] | None = None,
    reasons: Mapping[str, str] | None = None,
) -> list[Row]:
    """Judge every claim of the ledger.

    Parameters
    ----------
    ledger : mapping of str to Claim
        All claims.
    recorded : mapping of str to list of Measurement
        Values by notebook, of notebooks that completed with default parameters.
    measured : mapping, optional
        Result of `load_measured`.
    reasons : mapping of str to str, optional
        By notebook, why it did not run (shown in the note of its claims).

    Returns
    -------
    list of dict
        One row a claim, in the order of the ledger, ready for JSON.

    Raises
    ------
    ClaimError
        If a notebook recorded an unknown, foreign or repeated claim, or left one of its own out.
    """
    wrong = [line for name, values in recorded.items() for line in problems(ledger, name, values)]
    if wrong:
        raise ClaimError("claims recorded wrongly:\n  " + "\n  ".join(wrong))
    values = {value.id: value for found in recorded.values() for value in found}
    rows = []
    for claim in ledger.values():
        value, origin, reason = values.get(claim.id), "", ""
        if claim.notebook is None:
            if measured and claim.id in measured:
                value, origin = measured[claim.id]
            else:
                reason = "no committed result in data/measured"
        elif value is not None:
            origin = f"notebook {claim.notebook}"
        else:
            reason = (reasons or {}).get(claim.notebook, f"notebook {claim.notebook} has not run")
        rows.append(_row(claim, value, origin, reason))
    return rows


def write_rows(rows: list[Row], path: Path) -> None:
    """Write judged claims as a JSON list.

    Parameters
    ----------
    rows : list of dict
        Result of `collect`.
    path : Path
        File to write.
    """
    write_json(path, rows)
