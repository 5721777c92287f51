import sys
import textwrap
from pathlib import Path

import pytest

from pumplib.campaign import SCHEMES, campaign_from, schemes
from pumplib.campaign.executors import local_pool

SOURCE = """
import os
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from pumplib.machines.quantity import Choice, Parameters, Quantity


@dataclass(frozen=True, kw_only=True, slots=True)
class Settings(Parameters):
    size: Annotated[float, Quantity("sigma", "shift", 0.0, 10.0)] = 0.0
    kind: Annotated[str, Choice("sort of shift", ("step", "ramp"))] = "step"
    many: Annotated[int, Quantity("-", "rows of a run", 1, 100)] = 1
    pause: Annotated[float, Quantity("s", "time of a run", 0.0, 10.0)] = 0.0
    flag: str = ""
    tags: tuple[str, ...] = ()


name = "shifted"
settings = Settings
data = ("motors",)


def score(settings, rng):
    x = settings.size + rng.standard_normal(settings.many)
    time.sleep(settings.pause)
    if settings.flag and Path(settings.flag).exists():
        what = Path(settings.flag).read_text()
        if what == "error" and x[0] > 1.0:
            raise ValueError("the bench is on fire")
        if what == "die" and x[0] > 1.0:
            os._exit(9)
    rows = [
        {"x": float(v), "hit": bool(v > 1.0), "delay": float(v) if v > 1.0 else None, "word": "a,b" if v > 0 else "c"}
        for v in x
    ]
    return rows[0] if settings.many == 1 else rows
"""


@pytest.fixture
def scheme(tmp_path: Path, monkeypatch) -> Path:
    """A scheme in a module that worker processes can import too; returns its folder."""
    folder = tmp_path / "scheme"
    folder.mkdir()
    (folder / "shifted_scheme.py").write_text(textwrap.dedent(SOURCE))
    monkeypatch.syspath_prepend(str(folder))
    monkeypatch.setitem(SCHEMES, "shifted", "shifted_scheme")
    yield folder
    sys.modules.pop("shifted_scheme", None)
    schemes.loaded_digest.cache_clear()


def content(**changes):
    """A campaign file as plain data."""
    return {
        "title": "Shifts", "section": "2.1.4", "class": "beyond", "seed": 7, "scheme": "shifted",
        "settings": {"kind": "step"},
        "cells": [
            {"name": "healthy", "role": "healthy", "runs": 40},
            {"name": "shift", "role": "fault", "runs": 25, "settings": {"many": 3}, "each": {"size": [1.0, 2.5]}},
        ],
        **changes,
    }  # fmt: skip


@pytest.fixture
def raw(scheme: Path):
    return content


@pytest.fixture
def campaign(raw):
    return campaign_from(raw(), "shifts")


@pytest.fixture
def threads():
    with local_pool(2, threads=True) as pool:
        yield pool
