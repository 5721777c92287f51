"""The benchmark of campaigns compares the same runs; nothing here looks at a time."""

from benchmarks import campaign as benchmark
from pumplib.campaign import local_pool


def test_loop_and_campaign_do_the_same_runs() -> None:
    small = benchmark.compiled(6, 1)
    found = benchmark.as_campaign(small, 1, "threads")
    assert found["rows"] == 6 * 20
    assert found["parts"] >= 1
    assert found["seconds"] > 0
    assert benchmark.one_loop(small).cpu > 0
    assert benchmark.few(small, 2).runs == 2
    assert benchmark.bench(3, 1).runs == 3


def test_memory_is_that_of_a_fresh_process() -> None:
    with local_pool(1) as pool:
        found = pool.executor.submit(benchmark.peak_memory, 50, 1).result()
    assert 50 < found < 1000  # MB
