"""Small workbooks in temporary folders: the runner takes its folders as arguments."""

import shutil
from collections.abc import Callable
from pathlib import Path

import nbformat
import pytest
from nbformat import v4

from pumplib.paths import DATA
from pumplib.workbook.layout import Layout

CLAIM = """
[[claim]]
id = "{id}"
chapter = 1
class = "beyond"
statement = "s"
metric = "m"
op = "{op}"
bound = {bound}
unit = "-"
level = "{level}"
section = "1.1"
thesis = "t"
why = "w"
source = "{source}"
"""


def claim_text(
    name: str = "ch1.a",
    op: str = "<=",
    bound: str = "1.0",
    source: str = "notebook:01_one",
    level: str = "required",
    extra: str = "",
) -> str:
    return CLAIM.format(id=name, op=op, bound=bound, source=source, level=level) + extra


class Workbook:
    """A workbook that a test fills."""

    def __init__(self, root: Path) -> None:
        self.layout = Layout(root, root / "package")
        for folder in (self.layout.notebooks, self.layout.data, self.layout.figures, self.layout.package):
            folder.mkdir(parents=True)
        (self.layout.package / "model.py").write_text('"""Thesis 3.2: a model."""\n')
        shutil.copy(DATA / "thesis_contents.toml", self.layout.data)
        self.ledger("")

    def ledger(self, *claims: str) -> None:
        self.layout.ledger.write_text("\n".join(claims))

    def add(self, name: str, *code: str, parameters: str = "", specs: str = "") -> Path:
        """Add a notebook: title, parameters cell, first call, then one cell for each given source."""
        notebook = v4.new_notebook()
        notebook.metadata["kernelspec"] = {"name": "python3", "display_name": "Python 3", "language": "python"}
        first = f"from pumplib import workbook\nnb = workbook.start('{name}'{', ' + specs if specs else ''})"
        notebook.cells = [v4.new_markdown_cell("Thesis 3.2"), v4.new_code_cell(parameters or "# none")]
        notebook.cells[1].metadata["tags"] = ["parameters"]
        notebook.cells += [v4.new_code_cell(source) for source in (first, *code)]
        for number, cell in enumerate(notebook.cells):
            cell["id"] = f"cell-{number}"
        path = self.layout.notebook(name)
        nbformat.write(notebook, path)
        return path


@pytest.fixture
def book(tmp_path: Path) -> Workbook:
    return Workbook(tmp_path / "book")


@pytest.fixture
def claim() -> Callable[..., str]:
    return claim_text
