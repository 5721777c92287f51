"""Parameters: what papermill mangles is repaired, and everything else that is wrong is an error."""

import json
import math
from pathlib import Path

import numpy as np
import pytest

from pumplib import workbook
from pumplib.errors import ParameterError
from pumplib.paths import ROOT
from pumplib.workbook.cells import read_defaults, unknown_names
from pumplib.workbook.parameters import Parameters

NUMBER = workbook.number(0, 20, "N m")
SENSORS = workbook.names("I", "V", "Q", "dp")
EDGES = workbook.names(*(f"Q+ -> x{k}" for k in range(98)), "a", "b")


@pytest.mark.parametrize(
    ("spec", "raw", "value"),
    [
        (NUMBER, 3, 3.0),
        (NUMBER, "1e-3", 1e-3),
        (NUMBER, " 20 ", 20.0),
        (NUMBER, np.float32(0.5), 0.5),
        (workbook.number(optional=True), "null", None),
        (workbook.number(optional=True), None, None),
        (workbook.integer(0), "7", 7),
        (workbook.integer(0), np.int64(7), 7),
        (workbook.integer(optional=True), "None", None),
        (workbook.numbers(length=2), "[1,2]", (1.0, 2.0)),
        (workbook.numbers(), [1, "2.5"], (1.0, 2.5)),
        (SENSORS, "I, V,dp", ("I", "V", "dp")),
        (SENSORS, ["Q"], ("Q",)),
        (SENSORS, "['Q', 'I']", ("Q", "I")),
        (SENSORS, "", ()),
        (SENSORS, [], ()),
        (SENSORS, None, ()),
        (workbook.names("none", "all"), "all", ("all",)),
        (workbook.flag(), "true", True),
        (workbook.flag(), "False", False),
        (workbook.flag(), True, True),
        (workbook.choice("Y", "delta"), "delta", "delta"),
        (workbook.text(), "a pump", "a pump"),
        (workbook.text(optional=True), "", None),
        (workbook.file(), "pyproject.toml", ROOT / "pyproject.toml"),
        (workbook.file(optional=True), "", None),
    ],
)
def test_accepted(spec, raw, value):
    found = spec.check("x", raw)
    assert found == value
    assert type(found) is type(value)


@pytest.mark.parametrize(
    ("spec", "raw", "words"),
    [
        (NUMBER, -1, ["-1 N m", "too small", "from 0 to 20 N m"]),
        (NUMBER, 21.5, ["21.5 N m", "too large"]),
        (NUMBER, True, ["True", "bool"]),
        (NUMBER, "abc", ["'abc'", "a number from 0 to 20 N m"]),
        (NUMBER, math.nan, ["nan", "finite"]),
        (NUMBER, "inf", ["inf", "finite"]),
        (NUMBER, None, ["None"]),
        (NUMBER, [1], ["[1]", "list"]),
        (workbook.number(1, None, "s"), 0, ["at least 1 s"]),
        (workbook.number(None, 1, "s"), 2, ["at most 1 s"]),
        (workbook.integer(0), 1.0, ["1.0", "whole"]),
        (workbook.integer(0), "1e3", ["'1e3'", "whole"]),
        (workbook.integer(0), -1, ["at least 0"]),
        (workbook.integer(0), False, ["False"]),
        (workbook.numbers(length=3), "[1,2]", ["2 elements", "3 numbers"]),
        (workbook.numbers(0, 1), "[0.5, 7]", ["too large"]),
        (workbook.numbers(), "1", ["list"]),
        (workbook.numbers(), "[1", ["not a list"]),
        (workbook.numbers(), [], ["at least one"]),
        (SENSORS, "I, U", ["'U' is not one of them", "any of I, V, Q, dp"]),
        (SENSORS, "I, I", ["'I' is there twice"]),
        (SENSORS, "I, ", ["'' is not one of them"]),
        (SENSORS, 3, ["not a list of names"]),
        (SENSORS, [1], ["not a list of names"]),
        (SENSORS, "[I", ["not a list"]),
        (workbook.names("I", empty=False), "", ["no name is given", "at least one of I"]),
        (EDGES, "Q+ -> x98", ["did you mean 'Q+ -> x9'", "and 80 more"]),
        (workbook.flag(), 1, ["1", "True or False"]),
        (workbook.flag(), "yes", ["'yes'", "True or False"]),
        (workbook.choice("Y", "delta"), "y", ["'y'", "'Y', 'delta'"]),
        (workbook.text(), "  ", ["not empty"]),
        (workbook.file(), "no/such.csv", ["no such file"]),
        (workbook.file(), "", ["not a path"]),
        (workbook.file(), "tests", ["no such file"]),
    ],
)
def test_refused(spec, raw, words):
    with pytest.raises(ParameterError) as error:
        spec.check("load", raw)
    for word in ["parameter load", *words]:
        assert word in str(error.value)


def test_parameters_are_frozen():
    parameters = Parameters({"seed": 1})
    assert (parameters.seed, dict(parameters)) == (1, {"seed": 1})
    with pytest.raises(AttributeError, match="fixed"):
        parameters.seed = 2
    with pytest.raises(AttributeError, match="no parameter 'sed'; there are seed"):
        _ = parameters.sed


@pytest.mark.parametrize(
    ("history", "unknown"),
    [
        (["seed = 1\nload: float = 2"], []),
        (["seed = 1\nload = 2", "# Parameters\nlaod = 3\n"], ["laod"]),
        (["seed = 1\nload = 2", "# Parameters\nload = 3\nx = 4"], ["x"]),
        (["seed = 1\nlaod = 2"], ["laod"]),
        (["seed = 1\nload = 2", "import numpy as np\ntau = 3", "%matplotlib inline"], []),
        # The first call failed; the corrected cell was run again.
        (["seed = 1\nlaod = 2", 'nb = workbook.start("x")', "seed = 1\nload = 2"], []),
        # The first call failed; nothing was corrected.
        (["seed = 1\nlaod = 2", 'nb = workbook.start("x")', 'nb = workbook.start("x")'], ["laod"]),
    ],
)
def test_unknown_names(history, unknown):
    assert unknown_names(history, ["seed", "load"]) == unknown


def notebook(path: Path, source: str) -> Path:
    cell = {"cell_type": "code", "metadata": {"tags": ["parameters"]}, "source": source.splitlines(True)}
    path.write_text(json.dumps({"cells": [cell]}))
    return path


def test_defaults_are_read_from_the_notebook(tmp_path):
    path = notebook(tmp_path / "x.ipynb", "a: float = -1e-3  # N m\nb = [1, 2]\nc: str\n")
    assert read_defaults(path) == {"a": -1e-3, "b": [1, 2]}


def test_a_default_must_be_a_literal(tmp_path):
    with pytest.raises(ParameterError, match="default of a must be a plain value"):
        read_defaults(notebook(tmp_path / "x.ipynb", "a = 2 * 3 + len('x')"))
