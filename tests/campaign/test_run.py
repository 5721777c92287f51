"""The table is the same whoever makes it and however often it is interrupted; what goes wrong is named."""

import csv
import gzip
import io
import json
import os
import random
import signal
import subprocess
import sys
import threading
import time
from concurrent.futures import Executor, Future
from dataclasses import replace
from pathlib import Path

import numpy as np
import psutil
import pytest

from pumplib.campaign import Console, Pool, Status, campaign_from, local_pool, read, run_campaign, store
from pumplib.campaign.run import CHUNK_SECONDS
from pumplib.errors import DataError, ParameterError, SimulationError


class Shuffled(Executor):
    """Does what it is given in another order, one after the other."""

    def __init__(self, seed: int) -> None:
        self.waiting: list = []
        self.most = 0
        self.random = random.Random(seed)
        self.open = True
        self.thread = threading.Thread(target=self._work, daemon=True)
        self.thread.start()

    def submit(self, fn, /, *args, **kwargs):
        future: Future = Future()
        self.waiting.append((future, fn, args))
        self.most = max(self.most, len(self.waiting))
        return future

    def _work(self) -> None:
        while self.open:
            time.sleep(0.001)  # lets several come together
            if self.waiting:
                future, fn, args = self.waiting.pop(self.random.randrange(len(self.waiting)))
                if future.set_running_or_notify_cancel():
                    future.set_result(fn(*args))


def bytes_of(folder: Path, name: str = "shifts") -> bytes:
    return (folder / f"{name}.csv.gz").read_bytes()


def run(campaign, pool, tmp_path: Path, where: str = "a", **options):
    return run_campaign(campaign, pool, build=tmp_path / f"build_{where}", results=tmp_path / where, **options)


@pytest.fixture
def expected(campaign) -> bytes:
    """The table by other means: one generator a run, the csv module, nothing of the campaign's own code."""
    from shifted_scheme import score

    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(["cell", "role", "run", "row", "size", "many", "x", "hit", "delay", "word"])
    for c, cell in enumerate(campaign.cells):
        for k in range(cell.runs):
            found = score(cell.settings, np.random.default_rng([7, c, k]))
            for number, row in enumerate([found] if isinstance(found, dict) else found):
                values = [row["x"], int(row["hit"]), "" if row["delay"] is None else row["delay"], row["word"]]
                place = [cell.name, cell.role, k, number, cell.settings.size, cell.settings.many]
                writer.writerow([*place, *values])
    return out.getvalue().encode()


def test_table_is_what_one_loop_makes(campaign, threads, tmp_path, expected) -> None:
    done = run(campaign, threads, tmp_path)
    assert gzip.decompress(bytes_of(tmp_path / "a")) == expected
    assert (done.runs, done.fresh, done.rows) == (90, 90, 40 + 3 * 50)


def test_same_bytes_for_any_workers_and_order(campaign, threads, tmp_path) -> None:
    run(campaign, threads, tmp_path, "threads")
    for workers in (1, 2):
        with local_pool(workers) as pool:
            run(campaign, pool, tmp_path, f"processes{workers}")
    for seed in (1, 2):
        executor = Shuffled(seed)
        run(campaign, Pool(executor=executor, workers=lambda: 3, kind="shuffled"), tmp_path, f"shuffled{seed}")
        executor.open = False
        assert 1 < executor.most <= 6  # never all at once: 90 runs begin in chunks of one
    folders = ["threads", "processes1", "processes2", "shuffled1", "shuffled2"]
    assert len({bytes_of(tmp_path / folder) for folder in folders}) == 1


def test_second_call_runs_nothing(campaign, threads, tmp_path) -> None:
    run(campaign, threads, tmp_path)
    before = bytes_of(tmp_path / "a")
    assert run(campaign, threads, tmp_path).fresh == 0
    assert bytes_of(tmp_path / "a") == before


def test_a_share_is_the_beginning_of_the_whole(campaign, threads, tmp_path) -> None:
    part = run(campaign, threads, tmp_path, runs_scale=0.2)
    assert part.table.parent == tmp_path / "build_a" / "shifts" / "share"
    assert not (tmp_path / "a").exists()
    assert part.runs == 8 + 5 + 5
    share = read("shifts", part.table.parent).table
    whole = run(campaign, threads, tmp_path)
    assert whole.fresh == 90 - 18
    every = read("shifts", tmp_path / "a").table
    kept = every[every["run"] < every["cell"].map({"healthy": 8, "shift size=1": 5, "shift size=2.5": 5})]
    assert kept.reset_index(drop=True).equals(share)
    # fewer runs than there are: parts that reach beyond are cut
    again = run(campaign, threads, tmp_path, runs_scale=0.2)
    assert again.fresh == 0
    assert read("shifts", part.table.parent).table.equals(share)


def test_more_runs_are_added(raw, threads, tmp_path) -> None:
    small = raw()
    small["cells"] = [{"name": "healthy", "role": "healthy", "runs": 10, "settings": {"size": 0.5}}]
    run(campaign_from(small, "shifts"), threads, tmp_path)
    small["cells"][0]["runs"] = 30
    assert run(campaign_from(small, "shifts"), threads, tmp_path).fresh == 20
    run(campaign_from(small, "shifts"), threads, tmp_path, "fresh")
    assert bytes_of(tmp_path / "a") == bytes_of(tmp_path / "fresh")


def test_changed_campaign_is_refused(campaign, raw, threads, tmp_path) -> None:
    run(campaign, threads, tmp_path)
    other = campaign_from(raw(seed=8), "shifts")
    with pytest.raises(ParameterError, match=r"campaign\.seed was 7, is 8.*--force"):
        run(other, threads, tmp_path)
    changed = raw()
    changed["cells"][1]["each"] = {"size": [1.0, 3.0]}
    with pytest.raises(ParameterError, match=r"cells\[2\]\.settings\.size was 2\.5, is 3\.0"):
        run(campaign_from(changed, "shifts"), threads, tmp_path)
    assert run(campaign, threads, tmp_path).fresh == 0  # the refusal has touched nothing
    assert run(other, threads, tmp_path, force=True).fresh == 90
    run(other, threads, tmp_path, "fresh")
    assert bytes_of(tmp_path / "a") == bytes_of(tmp_path / "fresh")


def test_changed_source_is_refused(campaign, scheme, threads, tmp_path) -> None:
    run(campaign, threads, tmp_path)
    source = scheme / "shifted_scheme.py"
    source.write_text(source.read_text() + "\nOTHER = 1\n")
    with pytest.raises(ParameterError, match=r"shifted_scheme\.py has changed"):
        run(campaign, threads, tmp_path)
    # the process that has the old code loaded may not make new rows under the name of the new code
    with pytest.raises(SimulationError, match="other sources"):
        run(campaign, threads, tmp_path, force=True)


def flagged(campaign, flag: Path):
    cells = tuple(replace(cell, settings=replace(cell.settings, flag=str(flag))) for cell in campaign.cells)
    return replace(campaign, cells=cells)


def test_error_names_the_run_and_keeps_the_others(campaign, tmp_path) -> None:
    flag = tmp_path / "flag"
    flag.write_text("error")
    one = flagged(campaign, flag)
    first = next(k for k in range(40) if np.random.default_rng([7, 0, k]).standard_normal() > 1.0)
    with local_pool(1, threads=True) as pool:
        with pytest.raises(SimulationError) as caught:
            run(one, pool, tmp_path)
        text = str(caught.value)
        assert f"cell 'healthy', run {first} (default_rng([7, 0, {first}]))" in text
        assert "ValueError in score" in text
        assert "the bench is on fire" in text
        assert not (tmp_path / "a").exists()
        flag.unlink()
        done = run(one, pool, tmp_path)
        assert done.fresh <= 90 - first
        run(one, pool, tmp_path, "fresh")
    assert bytes_of(tmp_path / "a") == bytes_of(tmp_path / "fresh")


def test_worker_that_dies_is_reported(campaign, tmp_path) -> None:
    flag = tmp_path / "flag"
    flag.write_text("die")
    one = flagged(campaign, flag)
    with local_pool(2) as pool, pytest.raises(SimulationError, match=r"run \d+ .*a worker process ended"):
        run(one, pool, tmp_path)
    flag.unlink()
    with local_pool(2) as pool:
        run(one, pool, tmp_path)
        run(one, pool, tmp_path, "fresh")
    assert bytes_of(tmp_path / "a") == bytes_of(tmp_path / "fresh")


SCRIPT = """
import sys
from pathlib import Path
from pumplib.campaign import SCHEMES, campaign_from, local_pool, run_campaign
SCHEMES["shifted"] = "shifted_scheme"

def main():
    import json
    content, build, results = json.loads(sys.argv[1]), Path(sys.argv[2]), Path(sys.argv[3])
    with local_pool(2) as pool:
        run_campaign(campaign_from(content, "shifts"), pool, build=build, results=results)

if __name__ == "__main__":
    main()
"""


@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGINT], ids=lambda s: s.name)
def test_interrupted_and_resumed(raw, scheme, threads, tmp_path, how) -> None:
    content = raw()
    content["settings"]["pause"] = 0.05
    script = tmp_path / "script.py"
    script.write_text(SCRIPT)
    words = [sys.executable, str(script), json.dumps(content), str(tmp_path / "build_a"), str(tmp_path / "a")]
    environment = {**os.environ, "PYTHONPATH": str(scheme)}
    with subprocess.Popen(words, env=environment, stderr=subprocess.PIPE, start_new_session=True) as process:
        parts = tmp_path / "build_a" / "shifts" / "parts"
        end = time.monotonic() + 20
        while len(list(parts.glob("*.part"))) < 5 and time.monotonic() < end:
            time.sleep(0.01)
        workers = psutil.Process(process.pid).children(recursive=True)
        if how == signal.SIGINT:
            os.killpg(process.pid, how)  # as a terminal does
        else:
            process.send_signal(how)
        _, error = process.communicate(timeout=20)
    assert process.returncode not in (0, None)
    assert error.count(b"Traceback") == (how == signal.SIGINT)  # of the parent; the workers are quiet
    _, alive = psutil.wait_procs(workers, timeout=10)
    assert not alive
    kept = len(list(parts.glob("*.part")))
    assert kept >= 5
    assert not (tmp_path / "a").exists()
    content["cells"][0]["runs"] = 40
    done = run(campaign_from(content, "shifts"), threads, tmp_path)
    assert 0 < done.fresh <= 85
    assert done.rows == 190
    quick = raw()
    run(campaign_from(quick, "shifts"), threads, tmp_path, "fresh")
    assert bytes_of(tmp_path / "a") == bytes_of(tmp_path / "fresh")


def test_interrupt_keeps_what_is_running(campaign, threads, tmp_path) -> None:
    def stop(status: Status) -> None:
        if status.done >= 10:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run(campaign, threads, tmp_path, progress=stop)
    kept = sum(part.count for part in store.Store(tmp_path / "build_a" / "shifts").parts())
    assert kept >= 10
    assert run(campaign, threads, tmp_path).fresh == 90 - kept


def test_a_file_is_whole_or_absent(tmp_path, monkeypatch) -> None:
    path = tmp_path / "new" / "x.bin"
    store.write_bytes(path, b"old")

    def broken(*_: object) -> None:
        raise OSError("disk full")

    monkeypatch.setattr(os, "fsync", broken)
    with pytest.raises(OSError, match="disk full"):
        store.write_bytes(path, b"new")
    assert path.read_bytes() == b"old"
    assert [p.name for p in path.parent.iterdir()] == ["x.bin"]


def test_unfinished_files_of_a_killed_process_are_removed(campaign, threads, tmp_path) -> None:
    run(campaign, threads, tmp_path, runs_scale=0.1)
    parts = tmp_path / "build_a" / "shifts" / "parts"
    (parts / ".0000-0000000030-5.part.77").write_bytes(b"half")
    run(campaign, threads, tmp_path)
    assert not list(parts.glob(".*"))
    run(campaign, threads, tmp_path, "fresh")
    assert bytes_of(tmp_path / "a") == bytes_of(tmp_path / "fresh")


def test_damaged_and_double_parts_are_refused(campaign, threads, tmp_path) -> None:
    run(campaign, threads, tmp_path)
    parts = sorted((tmp_path / "build_a" / "shifts" / "parts").glob("*.part"))
    content = parts[0].read_bytes()
    parts[0].write_bytes(content[:-3])
    with pytest.raises(DataError, match=f"{parts[0].name}: is damaged"):
        run(campaign, threads, tmp_path)
    parts[0].write_bytes(content)
    double = parts[0].with_name("0000-0000000000-2.part")
    double.write_bytes(content)
    with pytest.raises(DataError, match="hold the same run"):
        run(campaign, threads, tmp_path)


@pytest.mark.skipif(sys.platform == "win32", reason="no file locks of this kind")
def test_one_process_at_a_time(campaign, threads, tmp_path) -> None:
    with (
        store.Store(tmp_path / "build_a" / "shifts").opened({"x": 1}),
        pytest.raises(ParameterError, match="another process"),
    ):
        run(campaign, threads, tmp_path)


@pytest.mark.parametrize(
    ("body", "message"),
    [
        ('return {"x": float("nan")}', "column 'x' is NaN"),
        ('return {"x": ""}', "column 'x' is an empty text"),
        ('return {"x": [1]}', "column 'x' is list"),
        ("return []", "no row"),
        ('return {"cell": 1}', "column 'cell', which every table has"),
        ('return {"size": 9.0}', "column 'size' = 9.0, but the setting is 0.0"),
        ('return {"x": 1} if rng.random() < 0.5 else {"y": 1}', "returned columns"),
        ('return {"x": 1} if rng.random() < 0.5 else {"x": "one"}', "numbers and texts"),
        ('return {"x": 1} if settings.size == 0 else {"y": 1}', "same columns in the same order for every cell"),
    ],
)
def test_bad_rows_are_refused(campaign, scheme, threads, tmp_path, monkeypatch, body, message) -> None:
    import shifted_scheme

    space: dict = {}
    exec(f"def score(settings, rng):\n    {body}", space)
    monkeypatch.setattr(shifted_scheme, "score", space["score"])
    with pytest.raises((SimulationError, DataError), match=message):
        run(campaign, threads, tmp_path)


def test_progress(campaign, threads, tmp_path) -> None:
    seen: list[Status] = []
    run(campaign, threads, tmp_path, progress=seen.append)
    assert [s.done for s in seen] == sorted(s.done for s in seen)
    assert (seen[-1].done, seen[-1].total, seen[-1].left, seen[-1].workers) == (90, 90, 0.0, 2)
    assert seen[-1].rate > 0
    out = io.StringIO()
    console = Console(stream=out, interval=1e9)
    for status in seen:
        console(status)
    assert out.getvalue().startswith("shifts: 90/90 runs, ")
    lost = Status(campaign="c", cell="", done=1, total=2, rate=0.0, left=4000.0, workers=0)
    assert str(lost) == "c: 1/2 runs, 67 min left, no worker is connected: waiting"


def test_chunks_grow_until_they_last(raw, tmp_path) -> None:
    """Handing out costs the same for a chunk of one run and for one of thousands."""
    content = raw(cells=[{"name": "many", "role": "healthy", "runs": 20_000, "settings": {"size": 1.0}}])
    with local_pool(2, threads=True) as pool:
        run(campaign_from(content, "shifts"), pool, tmp_path)
    parts = store.Store(tmp_path / "build_a" / "shifts").parts()
    assert len(parts) < 100
    assert max(part.count for part in parts) > 1000
    assert sum(part.read()[0]["seconds"] > 3 * CHUNK_SECONDS for part in parts) == 0


@pytest.mark.parametrize("workers", [0, -1, 1.5, True])
def test_number_of_workers(workers) -> None:
    with pytest.raises(ParameterError, match="positive whole number"), local_pool(workers):
        pass


def test_pool_leaves_the_environment_alone(monkeypatch) -> None:
    monkeypatch.delenv("OMP_NUM_THREADS", raising=False)
    monkeypatch.setenv("OPENBLAS_NUM_THREADS", "5")
    with local_pool(1) as pool:
        assert pool.executor.submit(os.getenv, "OMP_NUM_THREADS").result() == "1"
    assert "OMP_NUM_THREADS" not in os.environ
    assert os.environ["OPENBLAS_NUM_THREADS"] == "5"
