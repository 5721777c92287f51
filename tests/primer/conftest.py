"""One machine on the bench with its monitor, shared by the tests: setting it up takes eleven runs."""

import numpy as np
import pytest

from pumplib.primer import Example, Machine, example_run, set_up


@pytest.fixture(scope="session")
def machine() -> Machine:
    return set_up(31)


@pytest.fixture(scope="session")
def healthy(machine: Machine) -> list[Example]:
    return [example_run(machine, "none", 0.0, "changes", np.random.default_rng([31, 7, k])) for k in range(4)]


@pytest.fixture(scope="session")
def clogged(machine: Machine) -> Example:
    return example_run(machine, "clogging", 1e10, "changes", np.random.default_rng([31, 8]))
