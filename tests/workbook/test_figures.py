"""The list of figures and the committed files agree."""

import pytest

from pumplib.errors import ParameterError
from pumplib.workbook.figures import index_problems, load_index
from pumplib.workbook.layout import Layout

GOOD = '[ch03_start_up]\ntitle = "Start-up"\nclass = "beyond"\nnotebook = "03_model"\n'


def test_good_index(tmp_path):
    path = tmp_path / "index.toml"
    path.write_text(GOOD + 'thesis = "3.4"\n')
    entry = load_index(path)["ch03_start_up"]
    assert (entry.thesis, entry.kind, entry.files) == ("3.4", "beyond", ("ch03_start_up.svg", "ch03_start_up.png"))
    assert load_index(tmp_path / "absent.toml") == {}


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("ch03_start_up", '"Start up"', "small letters"),
        ('title = "Start-up"', "", "missing.*title"),
        ('title = "Start-up"', 'title = "x"\nauthor = "y"', "unknown.*author"),
        ("beyond", "new", "class = 'new'; use one of replicated"),
        ('"03_model"', "3", "every field is a text"),
        ("class", 'thesis = "figure 3.4"\nclass', "such as"),
        ("[ch03_start_up]", "[", "cannot be read"),
    ],
)
def test_wrong_index(tmp_path, old, new, words):
    path = tmp_path / "index.toml"
    assert old in GOOD
    path.write_text(GOOD.replace(old, new))
    with pytest.raises(ParameterError, match=words):
        load_index(path)


def test_differences_are_named(tmp_path):
    path = tmp_path / "index.toml"
    path.write_text(GOOD)
    (tmp_path / "ch03_start_up.svg").write_text("")
    (tmp_path / "ch03_old.png").write_text("")
    index = load_index(path)
    assert index_problems(index, tmp_path, {"03_model"}) == [
        "ch03_start_up.png: listed in index.toml but not in the folder",
        "ch03_old.png: in the folder but not listed in index.toml",
    ]
    assert len(index_problems(index, tmp_path, set())) == 1


def test_committed_figures_match_the_index():
    layout = Layout()
    notebooks = {path.stem for path in layout.notebooks.glob("*.ipynb")}
    assert index_problems(load_index(layout.index), layout.figures, notebooks) == []
