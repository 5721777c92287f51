"""The thesis map: built from the sources, current in the README."""

import json

import pytest

from pumplib.errors import DataError
from pumplib.workbook import thesis_map
from pumplib.workbook.layout import Layout
from pumplib.workbook.thesis_map import build, embed, expand, module_sections, notebook_sections

TITLES = thesis_map.contents(Layout())


@pytest.mark.parametrize(
    ("text", "sections"),
    [
        ("3.2.1", ["3.2.1"]),
        ("3.2.1, 3.3.3", ["3.2.1", "3.3.3"]),
        ("3.3.2-3.3.4", ["3.3.2", "3.3.3", "3.3.4"]),
        ("3.1-3.3, 3.5", ["3.1", "3.2", "3.3", "3.5"]),
        ("2 and 3", ["2", "3"]),
        ("summary", ["summary"]),
    ],
)
def test_expand(text, sections):
    assert expand(text, TITLES) == sections


def test_a_section_that_does_not_exist_is_refused():
    with pytest.raises(DataError, match=r"3\.9"):
        expand("3.2, 3.9", TITLES)


def test_sources_of_the_map(book, claim):
    book.ledger(claim("ch3.a").replace('section = "1.1"', 'section = "3.2"'))
    book.add("03_model")
    (entry,) = build(book.layout)
    assert (entry.section, entry.modules, entry.notebooks, entry.claims) == ("3.2", ["model"], ["03_model"], ["ch3.a"])
    row = "| 3.2 Model of the Electrical Motors | `model` | [03_model](notebooks/03_model.ipynb) | `ch3.a` |"
    assert thesis_map.to_markdown([entry]).splitlines()[-1] == row


def test_sources_without_sections_are_refused(book, tmp_path):
    module = tmp_path / "m.py"
    module.write_text('"""A module."""\n')
    with pytest.raises(DataError, match=r"m\.py"):
        module_sections(module, TITLES)
    module.write_text('"""Thesis, all chapters: infrastructure."""\n')
    assert module_sections(module, TITLES) == []
    path = book.add("03_model")
    notebook = json.loads(path.read_text())
    notebook["cells"][0]["source"] = "# A notebook"
    path.write_text(json.dumps(notebook))
    with pytest.raises(DataError, match="must name its sections"):
        notebook_sections(path, TITLES)


def test_the_readme_is_brought_up_to_date(book):
    readme = book.layout.root / "README.md"
    readme.write_text(f"before\n{thesis_map.OPEN}\nold\n{thesis_map.CLOSE}\nafter\n")
    assert thesis_map.update_readme(book.layout)
    text = readme.read_text()
    assert text.startswith("before\n")
    assert text.endswith("\nafter\n")
    assert "old" not in text
    assert "| `model` |" in text
    assert not thesis_map.update_readme(book.layout)
    with pytest.raises(DataError, match="lacks the markers"):
        embed("no markers", "table")


def test_the_committed_readme_is_current():
    layout = Layout()
    text = (layout.root / "README.md").read_text(encoding="utf-8")
    assert embed(text, thesis_map.to_markdown(build(layout))) == text, "run: python -m pumplib map --write"
