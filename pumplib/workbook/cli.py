"""Thesis, all chapters: the command line, `python -m pumplib`."""

import argparse
import ast
import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from pumplib.campaign import cli_part
from pumplib.errors import PumplibError
from pumplib.workbook.cells import read_defaults
from pumplib.workbook.layout import Layout
from pumplib.workbook.machine import machine, versions

OK, FAILED, USAGE, CLAIMS, INTERRUPTED = 0, 1, 2, 3, 130

_EPILOG = """exit codes:
  0    all notebooks ran (a failed claim is shown, but is a result, not an error)
  1    a notebook ended in error, or a claim was recorded wrongly
  2    the command was used wrongly
  3    only with --strict-claims: a required claim fails
  130  interrupted; what had finished is kept and is not run again

examples:
  python -m pumplib workbook --jobs 4
  python -m pumplib workbook --only 03_model --force
  python -m pumplib run 03_model -p load_torque_nm 3 -p motor im_2k2
"""


class _UsageError(PumplibError):
    """The command line asks for something that does not exist."""


def build_parser() -> argparse.ArgumentParser:
    """Return the parser of the command line.

    Returns
    -------
    argparse.ArgumentParser
        With one sub-command for each task.
    """
    parser = argparse.ArgumentParser(
        prog="python -m pumplib",
        description="Replication workbook of a thesis on fault detection in centrifugal pumps: runs the "
        "notebooks, draws the figures and checks every claim against its bound.",
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    commands = parser.add_subparsers(dest="command", metavar="COMMAND", required=True)

    def command(name: str, text: str) -> argparse.ArgumentParser:
        return commands.add_parser(name, help=text, description=text[0].upper() + text[1:] + ".")

    book = command("workbook", "run all notebooks, write figures and report, and judge the claims")
    book.add_argument("--jobs", type=int, metavar="N", help="notebooks at a time (default: JOBS, or 2)")
    book.add_argument("--force", action="store_true", help="run notebooks again whose inputs have not changed")
    book.add_argument("--only", nargs="+", default=[], metavar="NAME", help="run these notebooks only")
    book.add_argument("--strict-claims", action="store_true", help="exit with 3 if a required claim fails")

    run = command("run", "run one notebook with other parameters; results go to build/scratch")
    run.add_argument("notebook", metavar="NOTEBOOK", help="name such as 03_model, or a path in notebooks/")
    run.add_argument(
        *("-p", "--parameter"), nargs=2, action="append", default=[], metavar=("NAME", "VALUE"),
        help="set a parameter; may be given many times",
    )  # fmt: skip
    run.add_argument("-o", "--output", type=Path, metavar="FILE", help="where the executed notebook goes")
    run.add_argument("--list", action="store_true", help="list the parameters and their defaults, and stop")

    judged = command("claims", "show all claims as the last runs left them")
    judged.add_argument("--strict-claims", action="store_true", help="exit with 3 if a required claim fails")

    data = command("datasets", "show where the measured data sets are, or fetch one")
    data.add_argument("--fetch", metavar="NAME", help="download this data set and check its checksum")

    chart = command("map", "print the table thesis section -> modules -> notebooks -> claims")
    chart.add_argument("--write", action="store_true", help="bring the table in README.md up to date")

    cli_part.add_arguments(command("campaign", "run campaigns of many seeded runs, or check their tables"))

    command("lab", "open JupyterLab on the notebooks")
    return parser


def _colour() -> bool:
    return sys.stdout.isatty() and "NO_COLOR" not in os.environ


def _claims_code(rows: list[dict[str, Any]], strict: bool) -> int:
    failing = any(row["verdict"] == "fails" and row["level"] == "required" for row in rows)
    return CLAIMS if strict and failing else OK


def _relative(path: Path) -> str:
    try:
        return str(path.resolve().relative_to(Path.cwd()))
    except ValueError:
        return str(path)


def _workbook(layout: Layout, args: argparse.Namespace) -> int:
    from pumplib.workbook import runner
    from pumplib.workbook.report import write_report
    from pumplib.workbook.table import claims_table

    jobs = args.jobs if args.jobs is not None else runner.default_jobs()
    if jobs < 1:
        raise _UsageError(f"--jobs {jobs}: run at least one notebook at a time")
    runner.names(layout, args.only)
    result = runner.run_workbook(layout, jobs=jobs, force=args.force, only=args.only)
    known, current = runner.survey(layout)
    report = write_report(layout, known, current, result.rows)
    print()
    print(claims_table(result.rows, colour=_colour()))
    print()
    done = [f"{name}: {state.message}" for name, state in result.states.items() if state.status == "skipped"]
    for line in done:
        print(f"skipped {line}")
    for state in result.failed:
        print(f"ERROR in {state.message}")
    for line in result.problems:
        print(f"ERROR in claims: {line}")
    ran = len(result.states) - len(result.unchanged)
    memory = f", peak memory {result.peak_memory / 1e9:.2f} GB" if result.peak_memory else ""
    print(f"{ran} notebooks run, {len(result.unchanged)} unchanged, {result.seconds:.1f} s{memory}")
    print(f"report {_relative(report)}, claims {_relative(layout.claims)}, figures {_relative(layout.figures)}")
    if result.failed or result.problems:
        return FAILED
    return _claims_code(result.rows, args.strict_claims)


def _parse(text: str) -> Any:
    try:
        return ast.literal_eval(text)
    except (ValueError, SyntaxError):
        return text  # the notebook checks it and says what is allowed


def _run(layout: Layout, args: argparse.Namespace) -> int:
    from pumplib.workbook import runner

    (name,) = runner.names(layout, [args.notebook])
    defaults = read_defaults(layout.notebook(name))
    if args.list:
        for key, value in defaults.items():
            print(f"{key} = {value!r}")
        return OK
    given = {key: _parse(value) for key, value in args.parameter}
    unknown = [key for key in given if key not in defaults]
    if unknown:
        allowed = ", ".join(defaults) or "none"
        raise _UsageError(f"unknown parameter {', '.join(unknown)} of notebook {name}; allowed are {allowed}")
    changed = {key: value for key, value in given.items() if value != defaults[key]}
    if not changed:
        # The same as a run of the workbook, so its results count.
        result = runner.run_workbook(layout, jobs=1, force=True, only=[name])
        output = layout.executed / f"{name}.ipynb"
        if args.output and output.exists() and not result.failed:
            args.output.parent.mkdir(parents=True, exist_ok=True)
            output = Path(shutil.copy(output, args.output))
        print(f"executed notebook {_relative(output)}")
        return FAILED if result.failed else OK
    outcome, output = runner.run_one(layout, name, changed, args.output)
    if outcome.status != "completed":
        print(outcome.message)
        return FAILED if outcome.status == "error" else OK
    print(f"executed notebook {_relative(output)}, results in {_relative(layout.scratch / name)}")
    return OK


def _claims(layout: Layout, args: argparse.Namespace) -> int:
    from pumplib.workbook import runner
    from pumplib.workbook.collect import write_rows
    from pumplib.workbook.table import claims_table

    rows, problems = runner.judge_all(layout, *runner.survey(layout))
    for line in problems:
        print(f"ERROR in claims: {line}")
    if rows:
        write_rows(rows, layout.claims)
        print(claims_table(rows, everything=True, colour=_colour()))
    return FAILED if problems else _claims_code(rows, args.strict_claims)


def _datasets(args: argparse.Namespace) -> int:
    from pumplib import datasets

    if args.fetch:
        datasets.fetch(args.fetch)
    for item in datasets.status():
        print(f"{'present' if item.ok else 'absent':8} {item.name}: {item.where} {item.note}".rstrip())
    return OK


def _map(layout: Layout, args: argparse.Namespace) -> int:
    from pumplib.workbook import thesis_map

    if args.write:
        changed = thesis_map.update_readme(layout)
        print("README.md updated" if changed else "README.md is up to date")
    else:
        print(thesis_map.to_markdown(thesis_map.build(layout)))
    return OK


def _lab(layout: Layout) -> int:
    # Kernels of this environment come before those of the user.
    environment = {**os.environ, "JUPYTER_PREFER_ENV_PATH": "1"}
    return subprocess.call([sys.executable, "-m", "jupyter", "lab", str(layout.notebooks)], env=environment)


def _interrupt(*_: Any) -> None:
    raise KeyboardInterrupt


def main(arguments: Sequence[str] | None = None, layout: Layout | None = None) -> int:
    """Run a command.

    Parameters
    ----------
    arguments : sequence of str, optional
        Words of the command line; those of the process by default.
    layout : Layout, optional
        Folders; the repository's by default.

    Returns
    -------
    int
        Exit code.
    """
    layout = layout or Layout()
    args = build_parser().parse_args(arguments)
    signal.signal(signal.SIGTERM, _interrupt)
    try:
        match args.command:
            case "workbook":
                return _workbook(layout, args)
            case "run":
                return _run(layout, args)
            case "claims":
                return _claims(layout, args)
            case "datasets":
                return _datasets(args)
            case "map":
                return _map(layout, args)
            case "campaign":
                facts = {"machine": machine(), "versions": versions("numpy", "scipy", "numba", "distributed")}
                return cli_part.execute(args, facts)
            case _:
                return _lab(layout)
    except _UsageError as error:
        print(f"error: {error}", file=sys.stderr)
        return USAGE
    except PumplibError as error:
        from pumplib.errors import NotebookError

        print(f"error: {error}", file=sys.stderr)
        return USAGE if isinstance(error, NotebookError) else FAILED
    except KeyboardInterrupt:
        print("\ninterrupted; what had finished is kept and is not run again", file=sys.stderr)
        return INTERRUPTED
