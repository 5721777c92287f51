"""Thesis 2.1.4: `python -m benchmarks.primer_study` measures claim ch2.constant_threshold_fails.

The size of the fault is fixed by a rule on development machines: the smallest of the ladder that the adaptive
threshold detects in 90 % of the runs. Other machines with other seeds are scored.
"""

import argparse
import datetime
import json
import multiprocessing
import sys
import time
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict
from typing import Any

from benchmarks.__main__ import machine, versions
from pumplib.primer.study import (
    APPROACHES,
    LADDER,
    RESULT,
    alarm_counts,
    compare,
    smallest_detected,
    stored,
    threshold_study,
)
from pumplib.workbook.claims import judge, load_claims

CLAIM = "ch2.constant_threshold_fails"
MACHINES, HEALTHY, FAULTY = 10, 20, 5  # 200 healthy runs, 50 of each size
DEVELOPMENT, DEVELOPMENT_FAULTY = 3, 7


def study(seed: int, processes: int) -> dict[str, Any]:
    """Claim and details of a full study."""
    with ProcessPoolExecutor(processes, mp_context=multiprocessing.get_context("spawn")) as pool:
        development = threshold_study(
            seed=seed, machines=DEVELOPMENT, healthy=1, faulty=DEVELOPMENT_FAULTY, sizes=LADDER, mapper=pool.map
        )
        scored = threshold_study(
            seed=seed + 1, machines=MACHINES, healthy=HEALTHY, faulty=FAULTY, sizes=LADDER, mapper=pool.map
        )
    size = smallest_detected(development)
    comparisons = [compare(scored, one) for one in LADDER]
    chosen = next(one for one in comparisons if one.size == size)
    others = ", ".join(f"{one.size:.2g}: {one.constant}/{one.adaptive}" for one in comparisons if one is not chosen)
    note = (
        f"K_f {size:.2g} Pa s2/m6, the smallest that the adaptive threshold detects in 90 % of the development runs; "
        f"false-alarm runs of {chosen.healthy}: constant {chosen.constant}, adaptive {chosen.adaptive}"
        f"{' (counted as 1)' if chosen.adaptive == 0 else ''}; "
        f"both detect {chosen.detected} of {chosen.faulty}; at other sizes constant/adaptive {others}"
    )
    return {
        "claims": {CLAIM: {"value": float(f"{chosen.ratio:.4g}"), "n": chosen.healthy, "note": note}},
        "details": {
            "size": size,
            "plan": {"seed": seed + 1, "machines": MACHINES, "healthy": HEALTHY, "faulty": FAULTY, "sizes": LADDER},
            "comparisons": [{**asdict(one), "factor": round(one.factor, 5)} for one in comparisons],
            "approaches": APPROACHES,
            "development": alarm_counts(development),
            "alarms": alarm_counts(scored),
            "columns": ["K_f", "critical factor, adaptive", "critical factor, constant", "alarms"],
            "runs": stored(scored),
        },
    }


def _text(content: dict[str, Any]) -> str:
    """JSON with one line for each entry of the details and each run."""
    lines = []
    for key, value in content["details"].items():
        rows = ",\n   ".join(json.dumps(row) for row in value) if key in ("runs", "comparisons") else ""
        lines.append(f'  "{key}": ' + (f"[\n   {rows}\n  ]" if rows else json.dumps(value)))
    head = json.dumps({**content, "details": {}}, indent=1).removesuffix("{}\n}")
    return head + "{\n" + ",\n".join(lines) + "\n }\n}\n"


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.primer_study", description=__doc__)
    parser.add_argument("--seed", type=int, default=20052, help="seed of the development machines; scored: + 1")
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--date", help="YYYY-MM-DD of the result (default: today)")
    parser.add_argument("--write", action="store_true", help=f"write data/measured/{RESULT.name}")
    chosen = parser.parse_args(arguments)
    date = datetime.date.fromisoformat(chosen.date) if chosen.date else datetime.date.today()
    begun = time.perf_counter()
    found = study(chosen.seed, chosen.processes)
    claim = found["claims"][CLAIM]
    print(f"{CLAIM}: {claim['value']} ({judge(load_claims()[CLAIM], claim['value'])}); {claim['note']}")
    for row in found["details"]["alarms"]:
        print(row)
    print(f"{time.perf_counter() - begun:.0f} s", file=sys.stderr)
    if chosen.write:
        facts = {"date": date.isoformat(), "machine": machine(), "versions": versions(), "seed": chosen.seed}
        RESULT.write_text(_text({**facts, **found}), encoding="utf-8")
        print(f"written: data/measured/{RESULT.name}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
