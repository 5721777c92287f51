"""Data sets by name: where they are looked for, checksums, download from a local server, and the refusals."""

import functools
import hashlib
import http.server
import os
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

from pumplib import datasets
from pumplib.datasets import access, registry
from pumplib.datasets.registry import Dataset, KnownFile, load_registry
from pumplib.errors import DataError


@pytest.fixture
def nowhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A machine without local data and with an empty cache."""
    monkeypatch.delenv(datasets.FOLDER_VARIABLE, raising=False)
    monkeypatch.setenv("PUMPLIB_CACHE", str(tmp_path / "cache"))
    return tmp_path


CONTENT = {"a.csv": b"1,2,3\n", "run/b.csv": b"4,5,6\n"}


def made_up(url: str = "") -> Dataset:
    files = {
        name: KnownFile(sha256=hashlib.sha256(data).hexdigest(), bytes=len(data), commit="abc", path=f"deep/{name}")
        for name, data in CONTENT.items()
    }
    return Dataset(
        name="toy", title="Toy", home="example home", licence="MIT", note="n", files=files, layout="toy/*.csv", url=url
    )


@pytest.fixture
def toy(nowhere: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A registry with one set and a folder for it; returns the folder."""
    item = made_up()
    monkeypatch.setattr(registry, "load_registry", lambda: {"toy": item})
    monkeypatch.setattr(access, "load_registry", lambda: {"toy": item})
    monkeypatch.setenv(datasets.FOLDER_VARIABLE, str(nowhere / "data"))
    where = nowhere / "data" / "toy"
    for name, data in CONTENT.items():
        (where / name).parent.mkdir(parents=True, exist_ok=True)
        (where / name).write_bytes(data)
    return where


def test_shipped_tables_are_here_and_unchanged(nowhere: Path) -> None:
    for name in ("pump_curves", "load_points"):
        assert [c.verdict for c in datasets.check(name)] == ["ok"]
        assert datasets.files(name)[0].suffix == ".csv"
        assert datasets.fetch(name) == datasets.folder(name)


def test_registry_is_complete() -> None:
    known = load_registry()
    assert datasets.names() == tuple(known) == ("itsc", "skab", "pump_curves", "load_points")
    assert len(known["itsc"].files) == 26
    assert len(known["skab"].files) == 13
    for item in known.values():
        assert item.licence
        assert item.home
        assert bool(item.shipped) != bool(item.layout)
        for name, file in item.files.items():
            assert len(bytes.fromhex(file.sha256)) == 32
            assert file.bytes > 0
            assert not Path(name).is_absolute()
            assert ".." not in Path(name).parts
            if item.url:
                assert len(bytes.fromhex(file.commit)) == 20
                address = item.url.format(commit=file.commit, path=file.path)
                assert address.endswith("/" + Path(name).name)


def test_absent_sets_are_named_with_the_remedy(nowhere: Path) -> None:
    with pytest.raises(DataError) as error:
        datasets.folder("itsc")
    words = ("'itsc' is not here", "PUMPLIB_DATA is not set", "datasets --fetch itsc", "github.com/ibarram/ITSC", "MIT")
    for word in words:
        assert word in str(error.value)
    by_name = {item.name: item for item in datasets.status()}
    assert not by_name["itsc"].available
    assert not by_name["itsc"].ok
    assert by_name["itsc"].where == ""
    assert "--fetch itsc" in by_name["itsc"].note
    assert by_name["pump_curves"].available


def test_folder_without_the_set_is_named(nowhere: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(datasets.FOLDER_VARIABLE, str(nowhere))
    (nowhere / "skab").mkdir()
    with pytest.raises(DataError, match="skab has no CSV file"):
        datasets.folder("skab")


def test_unknown_name() -> None:
    for function in (datasets.folder, datasets.fetch, datasets.check, datasets.files):
        with pytest.raises(DataError, match="'skba' is unknown; there are itsc, skab"):
            function("skba")


def test_local_folder_with_further_changed_and_missing_files(toy: Path) -> None:
    assert datasets.folder("toy") == toy
    assert [c.verdict for c in datasets.check("toy")] == ["ok", "ok"]
    (toy / "run" / "c.csv").write_text("new\n")
    (toy / "a.csv").write_text("1,2,4\n")
    (toy / "run" / "b.csv").unlink()
    assert {c.path: c.verdict for c in datasets.check("toy")} == {
        "a.csv": "differs", "run/b.csv": "missing", "run/c.csv": "not in the registry"
    }  # fmt: skip
    assert [path.name for path in datasets.files("toy")] == ["a.csv", "c.csv"]
    (item,) = datasets.status()
    assert item.where == str(toy)
    assert "2 files, 1 of them not in the registry, 1 of 2 registered files are missing" in item.note


def test_set_without_address_is_fetched_by_hand(toy: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(datasets.FOLDER_VARIABLE)
    with pytest.raises(DataError, match=r"cannot be downloaded.*get the files from example home"):
        datasets.fetch("toy")


class _Quiet(http.server.SimpleHTTPRequestHandler):
    def log_message(self, *args: object) -> None:
        pass


@pytest.fixture
def server(toy: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A public home on this machine; returns its folder. The local copy is hidden."""
    pytest.importorskip("pooch")
    root = toy.parent.parent / "home"
    for name, data in CONTENT.items():
        (root / "abc" / "deep" / name).parent.mkdir(parents=True, exist_ok=True)
        (root / "abc" / "deep" / name).write_bytes(data)
    monkeypatch.delenv(datasets.FOLDER_VARIABLE)
    for variable in ("http_proxy", "HTTP_PROXY", "all_proxy", "ALL_PROXY"):
        monkeypatch.delenv(variable, raising=False)
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), functools.partial(_Quiet, directory=str(root))) as httpd:
        thread = threading.Thread(target=httpd.serve_forever, daemon=True)
        thread.start()
        item = made_up(f"http://127.0.0.1:{httpd.server_port}/{{commit}}/{{path}}")
        monkeypatch.setattr(registry, "load_registry", lambda: {"toy": item})
        yield root
        httpd.shutdown()
        thread.join()


def test_fetch_downloads_once_and_checks(server: Path) -> None:
    with pytest.raises(DataError, match="datasets --fetch toy"):
        datasets.folder("toy")
    where = datasets.fetch("toy")
    assert where == Path(os.environ["PUMPLIB_CACHE"]) / "datasets" / "toy"
    assert {path.relative_to(where).as_posix(): path.read_bytes() for path in datasets.files("toy")} == CONTENT
    assert [c.verdict for c in datasets.check("toy")] == ["ok", "ok"]
    # a second call needs no server
    (server / "abc" / "deep" / "a.csv").unlink()
    assert datasets.fetch("toy") == where


def test_fetch_refuses_other_bytes_and_keeps_nothing_of_them(server: Path) -> None:
    (server / "abc" / "deep" / "run" / "b.csv").write_bytes(b"forged\n")
    with pytest.raises(DataError, match=r"run/b.csv could not be downloaded.*hash"):
        datasets.fetch("toy")
    with pytest.raises(DataError, match="is not here"):
        datasets.folder("toy")
    assert not (Path(os.environ["PUMPLIB_CACHE"]) / "datasets" / "toy" / "run" / "b.csv").exists()


def test_fetch_names_a_file_that_is_not_at_its_address(server: Path) -> None:
    (server / "abc" / "deep" / "a.csv").unlink()
    with pytest.raises(DataError, match=r"a.csv could not be downloaded.*get the files from example home"):
        datasets.fetch("toy")


@pytest.mark.parametrize("text", ["[a", "a = 1", "[a]\ntitle = 't'\n", "[a]\nfiles = { x = { sha = '1' } }\n"])
def test_broken_registry(tmp_path: Path, text: str) -> None:
    path = tmp_path / "registry.toml"
    path.write_text(text)
    with pytest.raises(DataError, match=r"registry\.toml: not a registry"):
        load_registry(path)
    with pytest.raises(DataError, match="absent"):
        load_registry(tmp_path / "none.toml")


@pytest.mark.parametrize("name", ["itsc", "skab"])
def test_real_files_match_the_registry(name: str) -> None:
    if not os.environ.get(datasets.FOLDER_VARIABLE):
        pytest.skip(f"{datasets.FOLDER_VARIABLE} is not set: the real {name} files are not on this machine")
    verdicts = [c.verdict for c in datasets.check(name)]
    assert "ok" in verdicts
    assert "differs" not in verdicts
