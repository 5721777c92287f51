"""Thesis, all chapters: values of claims as text, and the table of claims for the terminal."""

import shutil
from collections import Counter
from typing import Any

from pumplib.workbook.collect import Row

_COLOUR = {"holds": "\x1b[32m", "fails": "\x1b[1;31m", "not run": "\x1b[90m"}


def format_number(value: Any) -> str:
    """Return a number, or a list of numbers, as short text.

    Parameters
    ----------
    value : number, list of numbers or None
        What to format.

    Returns
    -------
    str
        At most four digits of a float; an empty text for None.
    """
    if value is None:
        return ""
    if isinstance(value, list | tuple):
        return "[" + ", ".join(format_number(item) for item in value) + "]"
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def format_value(row: Row) -> str:
    """Return the measured value of a claim with unit and interval.

    Parameters
    ----------
    row : dict
        Judged claim.

    Returns
    -------
    str
        Such as "0.997 (0.991 to 0.999)"; empty if there is no value.
    """
    if row["value"] is None:
        return ""
    text = format_number(row["value"])
    if row["unit"] != "-":
        text += f" {row['unit']}"
    if row["interval"]:
        text += f" ({format_number(row['interval'][0])} to {format_number(row['interval'][1])})"
    return text


def format_bound(row: Row) -> str:
    """Return the bound of a claim with its comparison.

    Parameters
    ----------
    row : dict
        Judged claim.

    Returns
    -------
    str
        Such as ">= 0.99".
    """
    return f"{row['op']} {format_number(row['bound'])}"


def count_text(rows: list[Row]) -> str:
    """Return how many claims hold, fail and were not run, by level.

    Parameters
    ----------
    rows : list of dict
        Judged claims.

    Returns
    -------
    str
        One line.
    """
    parts = []
    for level in ("required", "stretch"):
        count = Counter(row["verdict"] for row in rows if row["level"] == level)
        parts.append(f"{level}: {count['holds']} hold, {count['fails']} fail, {count['not run']} not run")
    return "; ".join(parts)


def claims_table(rows: list[Row], *, everything: bool = False, colour: bool = False) -> str:
    """Return the claims as a table for the terminal.

    Parameters
    ----------
    rows : list of dict
        Judged claims.
    everything : bool
        Whether claims that were not run have a line each; else they are listed by reason.
    colour : bool
        Whether to colour the verdicts.

    Returns
    -------
    str
        The table, the claims that were not run, the counts, and at the end what fails.
    """
    shown = [row for row in rows if everything or row["verdict"] != "not run" or row["value"] is not None]
    cells = [
        (row["verdict"], row["id"], format_value(row), format_bound(row), row["level"], row["note"]) for row in shown
    ]
    lines: list[str] = []
    if cells:
        head = ("verdict", "claim", "value", "bound", "level", "note")
        widths = [max(len(line[k]) for line in [head, *cells]) for k in range(5)]
        room = shutil.get_terminal_size((120, 24)).columns
        for line in [head, *cells]:
            text = "  ".join(word.ljust(width) for word, width in zip(line[:5], widths, strict=True))
            text = f"{text}  {line[5]}".rstrip()
            # Notes may be cut, values never.
            text = text[: max(room, sum(widths) + 8)]
            lines.append(f"{_COLOUR[line[0]]}{text}\x1b[0m" if colour and line[0] in _COLOUR else text)
    if not everything:
        reasons: dict[str, list[str]] = {}
        for row in rows:
            if row["verdict"] == "not run" and row["value"] is None:
                reasons.setdefault(row["note"], []).append(row["id"])
        lines += [f"not run ({len(ids)}; {reason}): {', '.join(ids)}" for reason, ids in reasons.items()]
    lines += ["", f"Claims: {count_text(rows)}"]
    failing = [row for row in rows if row["verdict"] == "fails"]
    for level in ("required", "stretch"):
        for row in (row for row in failing if row["level"] == level):
            mark = "FAILS" if level == "required" else "missed (stretch)"
            lines.append(f"{mark}: {row['id']}: {row['metric']}: {format_value(row)}, bound {format_bound(row)}")
    return "\n".join(lines)
