"""A real scheduler with two real workers on this machine, one of which is killed while it works."""

import contextlib
import os
import re
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from pumplib.campaign import Status, campaign_from, dask_pool, local_pool, run_campaign, store
from pumplib.errors import ParameterError, SimulationError

distributed = pytest.importorskip("distributed", reason="Dask is not installed (extra `cluster`)")
DASK = [sys.executable, "-m", "dask"]


@contextlib.contextmanager
def started(words: list[str], log: Path, scheme: Path) -> Iterator[subprocess.Popen]:
    """A process with its output in a file; it and what it started are ended with the block."""
    environment = {**os.environ, "PYTHONPATH": str(scheme)}
    with (
        log.open("wb") as out,
        subprocess.Popen(words, stdout=out, stderr=out, env=environment, start_new_session=True) as process,
    ):
        try:
            yield process
        finally:
            process.kill()
            process.wait()


def wait_for(what, log: Path, seconds: float = 20.0):
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        if found := what():
            return found
        time.sleep(0.05)
    raise AssertionError(f"nothing after {seconds} s; its output:\n{log.read_text()}")


@pytest.fixture
def cluster(scheme: Path, tmp_path: Path):
    """Address of a scheduler and two workers of one thread."""
    log = tmp_path / "scheduler.log"
    words = [*DASK, "scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard"]
    with contextlib.ExitStack() as stack:
        stack.enter_context(started(words, log, scheme))
        address = wait_for(lambda: re.search(r"tcp://127\.0\.0\.1:\d+", log.read_text()), log).group()
        crew = []
        for k in range(2):
            words = [*DASK, "worker", address, "--nthreads", "1", "--no-nanny", "--no-dashboard", "--host", "127.0.0.1"]
            folder = tmp_path / f"worker{k}"
            folder.mkdir()
            words += ["--local-directory", str(folder)]
            crew.append(stack.enter_context(started(words, tmp_path / f"worker{k}.log", scheme)))
        with distributed.Client(address, set_as_default=False) as client:
            wait_for(lambda: len(client.nthreads()) == 2, log)
        yield address, crew


def test_one_worker_is_killed(cluster, raw, tmp_path) -> None:
    address, crew = cluster
    content = raw()
    content["settings"]["pause"] = 0.02
    seen: list[Status] = []
    killed: list[int] = []
    log = tmp_path / "worker0.log"
    first = wait_for(lambda: re.search(r"Start worker at: *(tcp://\S+)", log.read_text()), log).group(1)

    def watch(status: Status) -> None:
        seen.append(status)
        # while it has work, so that there is something to lose
        if status.done >= 15 and not killed and client.processing()[first]:
            killed.append(status.done)
            crew[0].kill()

    with dask_pool(address) as pool, distributed.Client(address, set_as_default=False) as client:
        assert pool.workers() == 2
        done = run_campaign(
            campaign_from(content, "shifts"), pool, progress=watch, build=tmp_path / "build", results=tmp_path / "a"
        )  # fmt: skip
        wait_for(lambda: pool.workers() == 1, tmp_path / "scheduler.log")
    assert killed
    assert killed[0] < 90
    assert done.fresh == done.runs == 90
    parts = store.Store(tmp_path / "build" / "shifts").parts()
    assert sum(part.count for part in parts) == 90  # nothing lost, and Store refuses what is there twice
    assert [s.done for s in seen] == sorted(s.done for s in seen)
    assert seen[-1].done == 90
    with local_pool(2, threads=True) as pool:
        run_campaign(campaign_from(raw(), "shifts"), pool, build=tmp_path / "build_b", results=tmp_path / "b")
    assert (tmp_path / "a" / "shifts.csv.gz").read_bytes() == (tmp_path / "b" / "shifts.csv.gz").read_bytes()


def test_worker_with_other_sources_is_refused(cluster, raw, scheme, tmp_path) -> None:
    """A cluster is set up once and forgotten; its results must not be those of last month's code."""
    address, _ = cluster
    campaign = campaign_from(raw(), "shifts")
    with dask_pool(address) as pool:
        run_campaign(campaign, pool, build=tmp_path / "build", results=tmp_path / "a", runs_scale=0.1)
        source = scheme / "shifted_scheme.py"
        source.write_text(source.read_text() + "\nOTHER = 1\n")
        with pytest.raises(SimulationError, match="other sources, data or library versions; update and restart"):
            run_campaign(campaign, pool, build=tmp_path / "build_b", results=tmp_path / "a")


def test_no_scheduler(monkeypatch) -> None:
    monkeypatch.setattr("pumplib.campaign.executors._CONNECT", 0.3)
    with pytest.raises(ParameterError, match=r"does not answer within 0\.3 s"), dask_pool("tcp://127.0.0.1:9"):
        pass
    with pytest.raises(ParameterError, match="does not answer"), dask_pool("nonsense://x"):
        pass


def test_without_dask(monkeypatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(ParameterError, match="extra `cluster`"), dask_pool("tcp://127.0.0.1:9"):
        pass
