"""A skipped browser test says so at the end of the run, where it is seen."""

import shutil
from pathlib import Path
from typing import Any

import pytest


def pytest_terminal_summary(terminalreporter: Any) -> None:
    for report in terminalreporter.stats.get("skipped", []):
        if report.nodeid.startswith("tests/browser") and isinstance(report.longrepr, tuple):
            terminalreporter.write_line(f"NOTICE {report.nodeid}: {report.longrepr[2]}", yellow=True)


@pytest.fixture(scope="session")
def chromium() -> str:
    """Path of a Chromium; without one the test is skipped."""
    names = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome")
    found = next(filter(None, map(shutil.which, names)), "/usr/bin/chromium")
    if not Path(found).exists():
        pytest.skip("no Chromium is installed; sliders are not tested in a browser (apt-get install chromium)")
    return found
