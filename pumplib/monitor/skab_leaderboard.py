"""Thesis 7.3, 8.1: the published leaderboard of the SKAB benchmark (beyond the thesis)."""

import math
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pumplib.errors import DataError
from pumplib.paths import DATA

LEADERBOARD = DATA / "datasets" / "skab_leaderboard.toml"


@dataclass(frozen=True, kw_only=True, slots=True)
class Published:
    """One line of the published leaderboard, over all 34 files.

    Parameters
    ----------
    name : str
        Algorithm.
    f1 : float
        F1.
    far, mar : float
        Shares, 0..1.
    nab : float
        Standard profile; NaN where none is published.
    remark : str
        What is odd about the line.
    """

    name: str
    f1: float
    far: float
    mar: float
    nab: float
    remark: str = ""


def read_leaderboard(path: str | Path = LEADERBOARD) -> tuple[Published, ...]:
    """Read the published leaderboard.

    Parameters
    ----------
    path : str or Path
        TOML file with one ``[[entry]]`` a line: name, f1, far_percent, mar_percent; nab and remark where there are.

    Returns
    -------
    tuple of Published
        Best F1 first.

    Raises
    ------
    DataError
        If the file is absent or has a wrong entry.
    """
    path = Path(path)
    try:
        raw = tomllib.loads(path.read_text(encoding="utf-8"))
        entries = [_published(entry) for entry in raw["entry"]]
    except FileNotFoundError:
        raise DataError(f"{path}: the leaderboard is absent; restore it from the repository.") from None
    except (tomllib.TOMLDecodeError, KeyError, TypeError, ValueError) as error:
        raise DataError(f"{path.name}: not a leaderboard: {error!r}") from None
    return tuple(sorted(entries, key=lambda entry: -entry.f1))


def _published(entry: Mapping[str, Any]) -> Published:
    name, f1 = str(entry["name"]), float(entry["f1"])
    far, mar, nab = float(entry["far_percent"]), float(entry["mar_percent"]), float(entry.get("nab", math.nan))
    if not (0 <= f1 <= 1 and 0 <= far <= 100 and 0 <= mar <= 100):
        raise ValueError(f"{name}: f1 in 0..1, rates in 0..100 %")
    return Published(name=name, f1=f1, far=far / 100, mar=mar / 100, nab=nab, remark=str(entry.get("remark", "")))
