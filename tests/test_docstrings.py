"""Every public function says what it takes, returns and raises; every module says which sections it covers."""

import ast
import re
from pathlib import Path

import pytest

from pumplib.paths import ROOT
from pumplib.workbook.layout import Layout
from pumplib.workbook.thesis_map import contents, module_sections

PACKAGE = ROOT / "pumplib"
MODULES = sorted(PACKAGE.rglob("*.py"))
SECTIONS = {
    *("Parameters", "Returns", "Yields", "Raises", "Attributes", "Other Parameters", "Warns"),
    *("See Also", "Notes", "References", "Examples"),
}
Function = ast.FunctionDef | ast.AsyncFunctionDef


def decorators(node: Function) -> set[str]:
    return {ast.unparse(item).split("(")[0].split(".")[-1] for item in node.decorator_list}


def public_functions(tree: ast.Module) -> list[tuple[str, Function]]:
    """Functions at the top level and methods of public classes, without properties."""
    found: list[tuple[str, Function]] = []
    for node in tree.body:
        members = node.body if isinstance(node, ast.ClassDef) and not node.name.startswith("_") else [node]
        owner = f"{node.name}." if isinstance(node, ast.ClassDef) else ""
        found += [
            (owner + member.name, member)
            for member in members
            if isinstance(member, Function) and not member.name.startswith("_")
        ]
    return found


def own_nodes(node: Function) -> list[ast.AST]:
    """All nodes of a function that are not in a function inside it."""
    found: list[ast.AST] = []
    waiting: list[ast.AST] = list(node.body)
    while waiting:
        item = waiting.pop()
        found.append(item)
        if not isinstance(item, Function | ast.Lambda | ast.ClassDef):
            waiting += ast.iter_child_nodes(item)
    return found


def raised(node: Function) -> set[str]:
    names = set()
    for item in own_nodes(node):
        if isinstance(item, ast.Raise) and isinstance(item.exc, ast.Call):
            names.add(ast.unparse(item.exc.func).split(".")[-1])
    return names


def split(docstring: str) -> dict[str, list[str]]:
    lines = docstring.splitlines()
    sections: dict[str, list[str]] = {"": []}
    name = ""
    for line, below in zip(lines, [*lines[1:], ""], strict=True):
        if below and set(below) == {"-"} and len(below) == len(line):
            name = line
            sections[name] = []
        elif set(line) != {"-"}:
            sections[name].append(line)
    return sections


def described(section: list[str]) -> list[str]:
    """Names before the colon of each entry; `a, b : float` describes two."""
    heads = [line.split(" : ")[0] for line in section if line and not line.startswith(" ")]
    return [name.strip().lstrip("*") for head in heads for name in head.split(",")]


def faults(node: Function, method: bool = False) -> list[str]:
    docstring = ast.get_docstring(node)
    if not docstring:
        return ["no docstring"]
    if decorators(node) & {"property", "cached_property"}:
        return []
    sections = split(docstring)
    found = []
    if unknown := set(sections) - SECTIONS - {""}:
        found.append(f"unknown sections {sorted(unknown)}")
    if re.search(r"^(Args|Arguments|Params|Return|Raise|Throws)\b:?\s*$", docstring, re.MULTILINE):
        found.append("a section that is not numpydoc")
    arguments = node.args
    every = [*arguments.posonlyargs, *arguments.args, arguments.vararg, *arguments.kwonlyargs, arguments.kwarg]
    names = [item.arg for item in every if item is not None]
    if method and "staticmethod" not in decorators(node):
        names = names[1:]
    told = described(sections.get("Parameters", []))
    if told != names:
        found.append(f"describes parameters {told}, has {names}")
    gives = any(isinstance(item, ast.Return) and item.value is not None for item in own_nodes(node))
    # Compiled functions carry no annotation; there the body tells.
    returns = ast.unparse(node.returns) if node.returns else ("a value" if gives else "None")
    yields = any(isinstance(item, ast.Yield | ast.YieldFrom) for item in own_nodes(node))
    if returns not in ("None", "NoReturn") and not ({"Returns", "Yields"} & set(sections)):
        found.append("no Returns")
    if returns in ("None", "NoReturn") and "Returns" in sections:
        found.append("describes a return value, has none")
    if yields and "Yields" not in sections:
        found.append("no Yields")
    missing = raised(node) - set(described(sections.get("Raises", [])))
    if missing:
        found.append(f"does not describe {sorted(missing)}")
    # The summary of a short function may say what it returns; what goes in and wrong is described each time.
    for name in ("Parameters", "Raises"):
        body = sections.get(name)
        if body is not None and not any(line.startswith("    ") and line.strip() for line in body):
            found.append(f"{name} without a description")
    return found


@pytest.mark.parametrize("path", MODULES, ids=lambda path: path.relative_to(PACKAGE).as_posix())
def test_public_functions_are_documented(path: Path):
    tree = ast.parse(path.read_text(encoding="utf-8"))
    wrong = {name: found for name, node in public_functions(tree) if (found := faults(node, "." in name))}
    assert not wrong


@pytest.mark.parametrize("path", MODULES, ids=lambda path: path.relative_to(PACKAGE).as_posix())
def test_modules_name_their_sections(path: Path):
    module_sections(path, contents(Layout()))


@pytest.mark.parametrize(
    ("source", "fault"),
    [
        ("def f() -> None:\n    pass", "no docstring"),
        ('def f(a):\n    """Do."""', "describes parameters"),
        ('def f() -> int:\n    """Do."""\n    return 1', "no Returns"),
        ('def f() -> None:\n    """Do."""\n    raise ValueError("x")', "ValueError"),
        ('def f(a):\n    """Do.\n\n    Parameters\n    ----------\n    a : int\n    """', "without a description"),
        ('def f(a):\n    """Do.\n\n    Args:\n        a: x\n    """', "numpydoc"),
        ('def f() -> None:\n    """Do.\n\n    Hints\n    -----\n    x\n    """', "unknown sections"),
    ],
)
def test_the_check_finds_faults(source, fault):
    (node,) = ast.parse(source).body
    assert fault in "; ".join(faults(node))
