"""Thesis, all chapters: the command `python -m pumplib campaign`."""

import argparse
import contextlib
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from pumplib.campaign.executors import dask_pool, local_pool
from pumplib.campaign.progress import Console
from pumplib.campaign.results import RESULTS, recheck
from pumplib.campaign.run import run_campaign
from pumplib.campaign.spec import campaigns, load_campaign
from pumplib.campaign.summary import summarise, to_text, write_summary
from pumplib.errors import DataError, ParameterError


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the command to its parser.

    Parameters
    ----------
    parser : argparse.ArgumentParser
        Of the command.
    """
    parser.add_argument("names", nargs="*", metavar="NAME", help="campaigns in data/campaigns (default: all)")
    parser.add_argument("--workers", type=int, metavar="N", help="processes (default: one for each processor)")
    parser.add_argument("--threads", action="store_true", help="threads of one process instead of processes")
    parser.add_argument(
        "--scheduler", metavar="ADDR", help="run on the Dask cluster of this scheduler, tcp://host:port"
    )
    parser.add_argument("--runs-scale", type=float, default=1.0, metavar="X", help="share of the runs, such as 0.01")
    parser.add_argument("--force", action="store_true", help="throw away runs of another state of campaign or code")
    parser.add_argument("--check", action="store_true", help="only repeat some runs and compare them with the table")
    parser.add_argument("--check-runs", type=int, default=3, metavar="N", help="runs that --check repeats (default 3)")
    parser.add_argument(
        "--check-seed", type=int, metavar="N", help="seed that chooses them (default: others each time)"
    )
    parser.add_argument("--list", action="store_true", help="list the campaigns and stop")


def execute(
    args: argparse.Namespace, facts: Mapping[str, Any] | None = None, say: Callable[[str], None] = print
) -> int:
    """Run the command.

    Parameters
    ----------
    args : argparse.Namespace
        From a parser with the options of `add_arguments`.
    facts : mapping, optional
        Goes into the provenance: machine and versions.
    say : callable
        Takes the lines to show.

    Returns
    -------
    int
        0; 1 if a check found a difference.

    Raises
    ------
    ParameterError
        If the command or a campaign file is wrong.
    """
    chosen = [load_campaign(name) for name in args.names or campaigns()]
    if args.scheduler and (args.threads or args.workers is not None):
        raise ParameterError("--scheduler: the cluster has its own workers; leave --workers and --threads out.")
    if args.list:
        for one in chosen:
            say(f"{one.name}: {one.title} ({len(one.cells)} cells, {one.runs} runs, scheme {one.scheme})")
        return 0
    if args.check:
        return _check(chosen, args, say)
    for one in chosen:  # before hours of work
        one.scaled(args.runs_scale)
    pool: Any = dask_pool(args.scheduler) if args.scheduler else local_pool(args.workers, args.threads)
    with contextlib.ExitStack() as stack:
        crew = stack.enter_context(pool)
        for one in chosen:
            done = run_campaign(
                one, crew, runs_scale=args.runs_scale, force=args.force, progress=Console(), facts=facts
            )  # fmt: skip
            folder = done.table.parent
            write_summary(one, folder)
            say(f"\n{one.title}")
            for title, rows in summarise(one, folder).items():
                say(f"{title}\n{to_text(rows)}")
            where = "data/campaigns/results" if folder == RESULTS else f"build/campaigns/{one.name}/share"
            say(
                f"{done.runs} runs ({done.fresh} of them now, {done.seconds:.1f} s), {done.rows} rows: "
                f"{where}/{done.table.name}"
            )
    return 0


def _check(chosen: list[Any], args: argparse.Namespace, say: Callable[[str], None]) -> int:
    failed = 0
    for one in chosen:
        try:
            say(f"{one.name}: {recheck(one, np.random.default_rng(args.check_seed), args.check_runs)}")
        except DataError as error:
            failed = 1
            say(f"{one.name}: DIFFERS: {error}")
    return failed
