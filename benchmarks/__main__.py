"""Thesis, all chapters: `python -m benchmarks` measures the claims perf.* and prints them with their bounds."""

import argparse
import datetime
import json
import os
import platform
import sys
import textwrap
from collections.abc import Mapping, Sequence
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from benchmarks import peer_c
from benchmarks.measure import CHAPTERS, MEASUREMENTS, Result
from pumplib.paths import DATA
from pumplib.workbook.claims import Claim, judge, load_claims

FOLDER = DATA / "measured"
GROUPS = {"chapters": tuple(CHAPTERS), "benchmarks": tuple(name for name in MEASUREMENTS if name not in CHAPTERS)}
"""What belongs into one file, measured in one run: the tools of chapters 4 to 7, and everything of chapter 3."""
PACKAGES = (
    "numpy", "numba", "llvmlite", "scipy", "networkx", "motulator", "faultdiagnosistoolbox", "python-flint", "psutil",
)  # fmt: skip


def machine() -> dict[str, Any]:
    """What was measured on; nothing that names the machine."""
    cpu = platform.processor() or platform.machine()
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
        cpu = next(line.split(":", 1)[1].strip() for line in lines if line.startswith("model name"))
    except (OSError, StopIteration):
        pass
    return {
        "cpu": cpu,
        "architecture": platform.machine(),
        "cores": os.cpu_count(),
        "os": f"{platform.system()} {platform.release()}",
    }


def versions() -> dict[str, str]:
    """Versions of Python, the compiler and the packages that take part."""
    found = {"python": platform.python_version(), "c_compiler": peer_c.compiler_version()}
    for name in PACKAGES:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            found[name] = "not installed"
    return found


def report(date: str, seed: int, found: Mapping[str, Mapping[str, Any]]) -> dict[str, Any]:
    """The content of the dated file that the ledger reads; claims that were not run are only in the details."""
    return {
        "date": date,
        "machine": machine(),
        "versions": versions(),
        "seed": seed,
        "claims": {
            name: {"value": entry["value"], "note": entry["note"]} for name, entry in found.items() if "value" in entry
        },
        "details": {name: entry.get("details", entry) for name, entry in found.items()},
    }


def table(ledger: Mapping[str, Claim], found: Mapping[str, Mapping[str, Any]]) -> str:
    """One line a claim, its note below."""
    lines = [f"{'claim':<20}{'value':>10}   {'bound':<12}verdict", "-" * 60]
    for name, entry in found.items():
        claim = ledger[name]
        if "value" in entry:
            value, word, note = f"{entry['value']:.4g}", judge(claim, entry["value"]), entry["note"]
        else:
            value, word, note = "-", "not run", entry["reason"]
        lines.append(f"{name:<20}{value:>10}   {f'{claim.op} {claim.bound} {claim.unit}'.rstrip(' -'):<12}{word}")
        lines += textwrap.wrap(note, 106, initial_indent="    ", subsequent_indent="    ")
    return "\n".join(lines)


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    parser.add_argument("--only", nargs="+", choices=MEASUREMENTS, metavar="NAME", help=", ".join(MEASUREMENTS))
    parser.add_argument("--rounds", type=int, default=7, help="rounds of each comparison (default 7)")
    parser.add_argument("--seed", type=int, default=20051, help="seed of the 1000 parameter sets")
    parser.add_argument("--date", help="YYYY-MM-DD of the result (default: today)")
    parser.add_argument("--group", choices=GROUPS, help="measure one group only")
    parser.add_argument("--write", action="store_true", help="write data/measured, a file for each group")
    chosen = parser.parse_args(arguments)
    if chosen.only and (chosen.write or chosen.group):
        parser.error("--write needs all measurements of a group in one run; leave --only out")
    if chosen.rounds < 1:
        parser.error("--rounds must be at least 1")
    date = datetime.date.fromisoformat(chosen.date) if chosen.date else datetime.date.today()

    found: Result = {}
    failed = False
    for name in chosen.only or GROUPS.get(chosen.group, tuple(MEASUREMENTS)):
        measurement, claims = MEASUREMENTS[name]
        print(f"measuring {name} ({', '.join(claims)}) ...", file=sys.stderr, flush=True)
        try:
            found |= measurement(chosen.rounds, chosen.seed)
        except RuntimeError as error:
            failed = True
            found |= {claim: {"reason": f"error: {error}"} for claim in claims}
    content = report(date.isoformat(), chosen.seed, found)
    print(table(load_claims(), found))
    facts = {**content["machine"], **content["versions"]}
    print("\n" + textwrap.fill(", ".join(f"{key} {value}" for key, value in facts.items()), 106))
    if chosen.write and failed:
        print("nothing was written: a measurement ended in error", file=sys.stderr)
    elif chosen.write:
        for group in (chosen.group,) if chosen.group else GROUPS:
            ids = {claim for name in GROUPS[group] for claim in MEASUREMENTS[name][1]}
            part = report(date.isoformat(), chosen.seed, {name: found[name] for name in found if name in ids})
            (FOLDER / f"{group}.json").write_text(json.dumps(part, indent=1) + "\n", encoding="utf-8")
            print(f"written: data/measured/{group}.json")
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
