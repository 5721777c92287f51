"""Settings of all tests."""

import sys
from collections.abc import Iterator

import pytest
from hypothesis import settings

# The first example of a test may compile a kernel; its time says nothing about the code.
settings.register_profile("pumplib", deadline=None, derandomize=True)
settings.load_profile("pumplib")


@pytest.fixture(autouse=True)
def _no_open_figures() -> Iterator[None]:
    """Figures of one test do not pile up in the next ones."""
    yield
    pyplot = sys.modules.get("matplotlib.pyplot")
    if pyplot is not None:
        pyplot.close("all")
