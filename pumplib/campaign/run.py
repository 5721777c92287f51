"""Thesis, all chapters: run a campaign: hand out runs, keep what comes back, stop and go on at any time."""

import math
import time
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, CancelledError, Future, wait
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from pumplib import paths
from pumplib.campaign.executors import Pool
from pumplib.campaign.progress import Clock, Status
from pumplib.campaign.results import RESULTS, write_results
from pumplib.campaign.schemes import code_digest, code_state
from pumplib.campaign.spec import Campaign
from pumplib.campaign.store import Store
from pumplib.campaign.work import Chunk, Scored, score_chunk
from pumplib.errors import SimulationError

CHUNK_SECONDS = 1.0
"""Time a worker should be busy with what it is handed at once."""
_GROWTH = 8  # a chunk has at most so many times the runs of the one before, whose time may have been misleading
_LOOK = 0.5  # s between two looks at the number of workers


@dataclass(frozen=True, kw_only=True, slots=True)
class Finished:
    """What a call of `run_campaign` did.

    Parameters
    ----------
    table : Path
        The table of results.
    rows : int
        Its rows.
    runs, fresh : int
        Runs in the table; those that were scored by this call.
    seconds : float
        Time of the scoring, s.
    busy, cpu : float
        Time and processor time that the workers spent on runs, s.
    """

    table: Path
    rows: int
    runs: int
    fresh: int
    seconds: float
    busy: float
    cpu: float


@dataclass
class _Plan:
    """Cuts what is to be done into chunks of about the same time."""

    campaign: Campaign
    code: str
    gaps: list[list[tuple[int, int]]]
    left: int = field(init=False)
    _each: dict[int, float] = field(default_factory=dict)  # seconds of a run, by the last chunk of the cell
    _size: dict[int, int] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.left = sum(end - begin for gaps in self.gaps for begin, end in gaps)

    def learn(self, scored: Scored) -> None:
        if scored.count:
            self._each[scored.cell] = scored.seconds / scored.count

    def chunks(self, workers: Callable[[], int]) -> Iterator[Chunk]:
        for number, gaps in enumerate(self.gaps):
            cell = self.campaign.cells[number]
            for begin, end in gaps:
                first = begin
                while first < end:
                    count = min(end - first, self._count(number, max(1, workers())))
                    self.left -= count
                    yield Chunk(
                        campaign=self.campaign.name,
                        path=self.campaign.path,
                        code=self.code,
                        seed=self.campaign.seed,
                        cell=number,
                        name=cell.name,
                        role=cell.role,
                        settings=cell.settings,
                        swept=self.campaign.swept,
                        first=first,
                        count=count,
                    )
                    first += count

    def _count(self, cell: int, workers: int) -> int:
        each = self._each.get(cell)
        wanted = 1 if each is None else int(CHUNK_SECONDS / max(each, 1e-9))
        # smaller towards the end, so that the workers end together
        wanted = min(wanted, _GROWTH * self._size.get(cell, 1), math.ceil(self.left / (2 * workers)))
        if each is not None:
            self._size[cell] = max(1, wanted)
        return max(1, wanted)


@dataclass
class _Crew:
    """Number of workers, asked for now and then: on a cluster it is a message."""

    ask: Callable[[], int]
    _known: int = 0
    _asked: float = -math.inf

    def __call__(self) -> int:
        if time.monotonic() - self._asked >= _LOOK:
            self._known, self._asked = self.ask(), time.monotonic()
        return self._known


def run_campaign(
    campaign: Campaign,
    pool: Pool,
    *,
    runs_scale: float = 1.0,
    force: bool = False,
    progress: Callable[[Status], None] | None = None,
    facts: Mapping[str, Any] | None = None,
    build: Path | None = None,
    results: Path | None = None,
) -> Finished:
    """Run what is missing of a campaign and write its table.

    Scored runs are kept in the build folder as they come. A call that is interrupted, or ends in an error, is
    simply repeated: only what is missing is run again. The table has the same bytes whatever the workers.

    Parameters
    ----------
    campaign : Campaign
        What to run.
    pool : Pool
        Where to run it.
    runs_scale : float
        Share of the runs of each cell; the table of a share goes to the build folder.
    force : bool
        Whether runs of another state of the campaign or of the code are thrown away.
    progress : callable, optional
        Takes a `Status` after each chunk, and twice a second while there is none.
    facts : mapping, optional
        Goes into the provenance; machine and versions for example.
    build, results : Path, optional
        Folders; ``build/campaigns`` and ``data/campaigns/results`` by default.

    Returns
    -------
    Finished

    Raises
    ------
    ParameterError
        If scored runs are there that were made otherwise, or the share is wrong.
    SimulationError
        If a run ends in an error, or a worker process dies; what was scored is kept.
    """
    runs = campaign.scaled(runs_scale)
    state = code_state(campaign.path)
    store = Store((build or paths.BUILD / "campaigns") / campaign.name)
    target = (results or RESULTS) if runs_scale == 1.0 else store.folder / "share"
    with store.opened({"campaign": campaign.definition(), "code": state}, force):
        plan = _Plan(campaign, code_digest(state), store.gaps(runs))
        clock = Clock([sum(end - begin for begin, end in gaps) for gaps in plan.gaps])
        _work(plan, pool, store, clock, sum(runs), progress)
        spent = {
            "seconds": round(clock.elapsed, 3), "busy_s": round(clock.busy, 3), "cpu_s": round(clock.cpu, 3),
            "runs": clock.done, "workers": pool.kind,
        }  # fmt: skip
        table, rows = write_results(campaign, store, runs, target, code=state, spent=spent, facts=facts or {})
    return Finished(
        table=table, rows=rows, runs=sum(runs), fresh=clock.done, seconds=clock.elapsed, busy=clock.busy, cpu=clock.cpu
    )  # fmt: skip


def _work(
    plan: _Plan, pool: Pool, store: Store, clock: Clock, total: int, progress: Callable[[Status], None] | None
) -> None:
    """Hand out chunks until all runs are there; after an error or an interrupt keep what still comes."""
    crew = _Crew(pool.workers)
    pending: dict[Future[Scored], Chunk] = {}
    chunks = plan.chunks(crew)
    before = total - plan.left
    errors: list[str] = []
    cell = ""

    def collect(timeout: float | None) -> None:
        nonlocal cell
        done, _ = wait(pending, timeout=timeout, return_when=FIRST_COMPLETED)
        for future in done:
            chunk = pending.pop(future)
            try:
                scored = future.result()
            except CancelledError:
                continue
            except Exception as error:
                errors.append(_lost(chunk, error))
                continue
            store.add(scored)
            plan.learn(scored)
            clock.add(scored.cell, scored.count, scored.seconds, scored.cpu)
            cell = chunk.name
            if scored.error:
                errors.append(f"{chunk.where(scored.first + scored.count)}: {scored.error}")

    def drain() -> None:
        for future in list(pending):
            future.cancel()
        while pending:
            collect(None)

    try:
        while not errors:
            # a few more than there are workers, so that none waits for us; never all, so that memory stays flat
            while len(pending) < 2 * max(1, crew()) and (chunk := next(chunks, None)) is not None:
                try:
                    pending[pool.executor.submit(score_chunk, chunk)] = chunk
                except BrokenExecutor as error:
                    errors.append(_lost(chunk, error))
                    break
            if not pending:
                break
            collect(_LOOK)
            if progress is not None:
                progress(
                    Status(
                        campaign=plan.campaign.name,
                        cell=cell,
                        done=before + clock.done,
                        total=total,
                        rate=clock.rate,
                        left=clock.left,
                        workers=crew(),
                    )
                )
    except KeyboardInterrupt:
        drain()  # about a second; a second interrupt ends it at once
        raise
    if errors:
        drain()
        raise SimulationError(
            f"{errors[0]}. {before + clock.done} of {total} runs are kept; repeat the command to go on after the cause "
            "is removed."
        )


def _lost(chunk: Chunk, error: Exception) -> str:
    what = (
        f"{chunk.where(chunk.first)} and the {chunk.count - 1} after it"
        if chunk.count > 1
        else chunk.where(chunk.first)
    )
    if isinstance(error, BrokenExecutor):
        return f"{what}: a worker process ended while they were scored (killed, or out of memory?)"
    return f"{what}: {type(error).__name__}: {error}"
