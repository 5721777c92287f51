"""The tree as a whole: commands exist, nothing names a machine, the lock covers the project."""

import re
import subprocess
import tomllib

import pytest

from pumplib.paths import ROOT

TEXT = {".py", ".toml", ".md", ".txt", ".yml", ".ipynb", ".cfg", ".csv", ".json", ".svg", ".cff", ""}


def tracked() -> list[str]:
    command = ["git", "ls-files", "--cached", "--others", "--exclude-standard"]
    listed = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True)
    return [name for name in listed.stdout.splitlines() if (ROOT / name).is_file()]


@pytest.mark.parametrize("target", ["workbook", "test", "lab", "clean"])
def test_makefile_targets(target):
    assert re.search(rf"^{target}:", (ROOT / "Makefile").read_text(), re.MULTILINE)


def test_ci_runs_the_two_commands_of_the_readme():
    lines = (ROOT / ".ci/run").read_text().splitlines()
    assert [line for line in lines if line.startswith("make ")] == ["make workbook", "make test"]
    assert (ROOT / ".ci/run").stat().st_mode & 0o111
    assert ".ci/run" in (ROOT / ".github/workflows/ci.yml").read_text()


def test_no_machine_paths_and_no_open_ends():
    # Written in parts, so that this file does not find itself.
    words = ["/" + "work/", "/" + "root/", "/" + "tmp/", "/" + "home/", "TO" + "DO", "FIX" + "ME"]
    found = []
    for name in tracked():
        path = ROOT / name
        if path.suffix not in TEXT or name == "environment.txt":
            continue
        text = path.read_text(encoding="utf-8")
        found += [f"{name}: {word}" for word in words if word in text]
    assert found == []


def test_the_lock_has_hashes_and_covers_the_project():
    lock = (ROOT / "environment.txt").read_text()
    pinned = dict(re.findall(r"^([A-Za-z0-9._-]+)==(\S+)", lock, re.MULTILINE))
    blocks = re.split(r"\n(?=[A-Za-z0-9._-]+==)", lock)
    assert all("--hash=sha256:" in block for block in blocks if "==" in block.split("\n")[0])
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    wanted = [*project["dependencies"], *project["optional-dependencies"]["test"]]
    names = {re.match(r"[A-Za-z0-9._-]+", text)[0].lower() for text in wanted}
    assert names <= {name.lower() for name in pinned}


def test_binder_installs_the_same_lock():
    assert (ROOT / "binder/requirements.txt").read_text() == "-r ../environment.txt\n"
    assert (ROOT / "binder/runtime.txt").read_text().startswith("python-3.")
