"""Thesis, all chapters: where a campaign runs: processes or threads of this machine, or a Dask cluster."""

import contextlib
import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, ProcessPoolExecutor, ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

from pumplib.errors import ParameterError

# One thread for each worker: more would compete with the other workers, and sums of the linear algebra libraries
# depend in their last bits on how many threads share them.
_ONE_THREAD = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS")
_CONNECT = 10.0  # s


@dataclass(frozen=True, kw_only=True, slots=True)
class Pool:
    """An executor and how many of its workers there are.

    Parameters
    ----------
    executor : concurrent.futures.Executor
        Runs functions of modules that its workers can import.
    workers : callable
        Number of workers now; on a cluster it may change.
    kind : str
        For people and for the provenance.
    """

    executor: Executor
    workers: Callable[[], int]
    kind: str


def default_workers() -> int:
    """Number of processors that this process may use.

    Returns
    -------
    int
    """
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


def _begin_worker() -> None:
    # Ctrl-C reaches all processes of a terminal; the parent decides what happens.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    # A worker waits for work at a pipe of which it holds both ends: it would outlive a parent that is killed.
    threading.Thread(target=_end_with_parent, daemon=True).start()


@contextlib.contextmanager
def _one_thread() -> Iterator[None]:
    before = {name: os.environ.get(name) for name in _ONE_THREAD}
    os.environ.update(dict.fromkeys(_ONE_THREAD, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


@contextlib.contextmanager
def local_pool(workers: int | None = None, threads: bool = False) -> Iterator[Pool]:
    """Workers on this machine, ended when the block is left; at once if it is left by an error.

    Parameters
    ----------
    workers : int, optional
        Number; all processors by default.
    threads : bool
        Threads of this process instead of processes: quicker to start, but only compiled kernels run side by side.

    Yields
    ------
    Pool

    Raises
    ------
    ParameterError
        If the number is not positive.
    """
    count = default_workers() if workers is None else workers
    if isinstance(count, bool) or not isinstance(count, int) or count < 1:
        raise ParameterError(f"workers = {workers!r}: must be a positive whole number.")
    if threads:
        with ThreadPoolExecutor(count) as pool:
            yield Pool(executor=pool, workers=lambda: count, kind=f"{count} threads")
        return
    with _one_thread():
        context = multiprocessing.get_context("spawn")  # the same on every platform, and safe beside threads
        executor = ProcessPoolExecutor(count, mp_context=context, initializer=_begin_worker)
        try:
            yield Pool(executor=executor, workers=lambda: count, kind=f"{count} processes")
        except BaseException:
            crew: dict[int, Any] = dict(getattr(executor, "_processes", None) or {})
            executor.shutdown(wait=False, cancel_futures=True)
            for process in crew.values():
                process.kill()
            raise
        executor.shutdown()


@contextlib.contextmanager
def dask_pool(address: str) -> Iterator[Pool]:
    """Workers of a Dask cluster that is running already.

    Runs of a worker that is lost are given to another one by the scheduler.

    Parameters
    ----------
    address : str
        Of the scheduler, such as ``tcp://host:8786``.

    Yields
    ------
    Pool

    Raises
    ------
    ParameterError
        If Dask is not installed or the scheduler does not answer.
    """
    try:
        from distributed import Client
    except ImportError:
        raise ParameterError(
            f"--scheduler {address}: Dask is not installed here; install the extra `cluster` of this package."
        ) from None
    try:
        client = Client(address, timeout=_CONNECT, set_as_default=False)
    except (OSError, TimeoutError, ValueError) as error:
        raise ParameterError(
            f"--scheduler {address}: does not answer within {_CONNECT:g} s ({error}); start it by `dask scheduler` "
            "and give the address that it prints."
        ) from None
    with client:

        def crew() -> int:
            return sum(client.nthreads().values())

        yield Pool(executor=client.get_executor(pure=False), workers=crew, kind=f"Dask, {crew()} threads of workers")
