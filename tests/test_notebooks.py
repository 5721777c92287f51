"""The committed notebooks: stripped, runnable anywhere, and free of program code."""

import ast
import json
from pathlib import Path

import pytest

from pumplib.paths import NOTEBOOKS
from pumplib.workbook.cells import read_defaults
from pumplib.workbook.layout import Layout
from pumplib.workbook.thesis_map import contents, notebook_sections

FILES = sorted(NOTEBOOKS.glob("*.ipynb"))
MAGIC_NAMES = {"load", "time", "run", "edit", "history", "save", "store", "reset", "who", "env", "cd", "pwd"}


def cells(path: Path, kind: str) -> list[dict]:
    return [cell for cell in json.loads(path.read_text(encoding="utf-8"))["cells"] if cell["cell_type"] == kind]


def source(cell: dict) -> str:
    return "".join(cell["source"])


def test_there_are_notebooks():
    assert FILES


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_form(path):
    content = json.loads(path.read_text(encoding="utf-8"))
    assert (content["nbformat"], content["nbformat_minor"]) >= (4, 5)
    assert content["metadata"]["kernelspec"]["name"] == "python3"
    assert set(content["metadata"]) <= {"kernelspec", "language_info"}
    ids = [cell["id"] for cell in content["cells"]]
    assert len(set(ids)) == len(ids)
    for cell in content["cells"]:
        assert set(cell["metadata"]) <= {"tags", "jupyter"}
        if cell["cell_type"] == "code":
            assert cell["outputs"] == []
            assert cell["execution_count"] is None


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_parameters_come_first_and_are_checked(path):
    code = cells(path, "code")
    assert code[0]["metadata"].get("tags") == ["parameters"]
    assert f'start("{path.stem}"' in source(code[1]).replace("\n    ", "").replace("(\n", "(")
    # IPython would read `load: float = 3` as its magic %load.
    assert not MAGIC_NAMES & set(read_defaults(path))


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_the_first_cell_names_the_sections(path):
    notebook_sections(path, contents(Layout()))


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_no_program_code(path):
    """Whatever needs a function, a class or a long cell belongs into the package."""
    banned = (ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef, ast.While, ast.Lambda)
    for number, cell in enumerate(cells(path, "code")):
        tree = ast.parse(source(cell))
        found = [type(node).__name__ for node in ast.walk(tree) if isinstance(node, banned)]
        assert not found, f"code cell {number + 1}: {found}"
        # The first two, parameters and their check, are as long as the list of parameters.
        assert number < 2 or len(source(cell).splitlines()) <= 30, f"code cell {number + 1} is long"
