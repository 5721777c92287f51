"""Thesis, all chapters: the measurements behind the claims perf.*; every function returns values with notes."""

import dataclasses
from collections.abc import Callable
from typing import Any

import numpy as np

from benchmarks import case, chapters, peer_c, peer_motulator, peer_scipy, process
from benchmarks.timing import Times, interleaved, ratio
from pumplib.plant import coefficients, simulate
from pumplib.testbench.run import draw_bench, run
from pumplib.testbench.scenario import load_scenario

Result = dict[str, dict[str, Any]]  # claim id -> value, note, details; or a reason why it was not run


def _claim(value: float, note: str, **details: Any) -> dict[str, Any]:
    return {"value": float(f"{value:.4g}"), "note": note, "details": details}


def _not_run(reason: str) -> dict[str, Any]:
    return {"reason": reason}


def _rows(times: dict[str, Times]) -> dict[str, Any]:
    return {name: found.row() for name, found in times.items()}


def scipy_peers(rounds: int, seed: int) -> Result:
    """perf.scipy, perf.scipy_jit: whole call of `simulate` against solve_ivp at equal or better current error."""
    machine, supply = case.reference_set(), case.supply()
    size: dict[str, Any] = {"duration": case.DURATION}
    reference = simulate(machine, supply, step=case.STEP / 50, every=50, **size).x
    error = peer_scipy.current_error(simulate(machine, supply, step=case.STEP, **size).x, reference)
    right_hand_sides = {
        "plain Python": peer_scipy.python_rhs(machine, supply),
        "numba": peer_scipy.compiled_rhs(machine, supply),
    }
    compiled = right_hand_sides["numba"]
    tight = peer_scipy.Setting("DOP853", 1e-12, 1e-12 * np.abs(reference).max(axis=0))
    doubt = peer_scipy.current_error(peer_scipy.solve(compiled, tight), reference)
    if doubt > error / 100:
        raise RuntimeError(f"the reference is uncertain by {doubt:.2g} A, our error is {error:.2g} A")
    settings = [
        peer_scipy.loosest(compiled, method, error, reference, per_state)
        for method in peer_scipy.METHODS
        for per_state in (True, False)
    ]
    contenders: dict[str, Callable[[], object]] = {"pumplib": lambda: simulate(machine, supply, step=case.STEP, **size)}
    for s in settings:
        kind = "atol per state" if s.per_state else "atol = rtol"
        for name, rhs in right_hand_sides.items():
            contenders[f"{s.method}, {kind}, {name}"] = lambda s=s, rhs=rhs: peer_scipy.solve(rhs, s)  # type: ignore[misc]
    times = interleaved(contenders, rounds, block=0.1)
    ours = times.pop("pumplib")
    found: Result = {}
    for claim, kind in (("perf.scipy", "plain Python"), ("perf.scipy_jit", "numba")):
        chosen = {name: t for name, t in times.items() if name.endswith(kind)}
        best = min(chosen, key=lambda name: chosen[name].median)
        plain = min((n for n in chosen if "atol = rtol" in n), key=lambda name: chosen[name].median)
        value, low, high = ratio(chosen[best], ours)
        found[claim] = _claim(
            value,
            f"fastest: {best}, {chosen[best]}; ours {ours}; ratio by round {low:.0f} - {high:.0f}; "
            f"with one absolute tolerance ({plain}): {ratio(chosen[plain], ours)[0]:.0f}",
            times=_rows({"pumplib": ours, **chosen}),
        )
    found["perf.scipy"]["details"]["accuracy"] = {
        "our_current_error_A": error,
        "reference_checked_to_A": doubt,
        "settings": [
            {"method": s.method, "rtol": s.rtol, "atol_per_state": s.per_state, "current_error_A": s.error}
            for s in settings
        ],
    }
    return found


def motulator_peer(rounds: int, seed: int) -> Result:
    """perf.motulator: the motor with a quadratic load, sampled at 10 kHz."""
    reason = peer_motulator.missing()
    if reason is not None:
        return {"perf.motulator": _not_run(reason)}
    machine, supply = case.reference_set(), case.supply()

    def ours(step: float, every: int) -> Any:
        return simulate(machine, supply, duration=case.DURATION, step=step, every=every, flow=False, leakage=False)

    reference = ours(case.STEP / 50, 50)
    current, speed = peer_motulator.samples(peer_motulator.simulate(machine, supply))
    theirs = float(np.abs(current - reference.i_s).max())
    if theirs > 0.01 * np.abs(reference.i_s).max() or np.abs(speed - reference.omega).max() > 0.1:
        raise RuntimeError(f"motulator simulates something else: currents differ by {theirs:.3g} A")
    # longest step that records at 10 kHz and is at least as accurate
    for every in range(1, 51):
        error = float(np.abs(ours(case.STEP / every, every).i_s - reference.i_s).max())
        if error <= theirs:
            break
    times = interleaved(
        {
            "pumplib": lambda: ours(case.STEP / every, every),
            "motulator": lambda: peer_motulator.simulate(machine, supply),
        },
        rounds,
        block=1.0,
    )
    value, low, high = ratio(times["motulator"], times["pumplib"])
    name = f"motulator {peer_motulator.installed()}"
    note = (
        f"{name}: {times['motulator']}, current error {theirs:.2g} A; ours {times['pumplib']}, step "
        f"{case.STEP / every:g} s (the longest that is as accurate), current error {error:.2g} A; "
        f"ratio by round {low:.0f} - {high:.0f}"
    )
    details = {"times": _rows(times), "our_current_error_A": error, "motulator_current_error_A": theirs}
    return {"perf.motulator": _claim(value, note, **details)}


def c_peer(rounds: int, seed: int) -> Result:
    """perf.c, perf.c_batch: kernel calls against the same step in C."""
    if peer_c.compiler() is None:
        return dict.fromkeys(("perf.c", "perf.c_batch"), _not_run("no C compiler on this machine"))
    machine = case.reference_set()
    u = case.inputs(machine)
    found: Result = {}

    one = peer_c.scalar_calls(u, coefficients(machine))
    times = interleaved({name: call for name, (call, _) in one.items()}, 10 * rounds, block=0.05)
    apart = max(peer_c.difference(states(), one["pumplib"][1]()) for _, states in one.values())
    found["perf.c"] = _against_c(times, apart, 1e9 / case.SAMPLES, "ns a step")

    sets = case.varied(machine, 1000, np.random.default_rng(seed))
    many = peer_c.batch_calls(u, sets, every=100)
    times = interleaved({name: call for name, (call, _) in many.items()}, rounds)
    apart = max(peer_c.difference(states(), many["pumplib"][1]()) for _, states in many.values())
    found["perf.c_batch"] = _against_c(times, apart, 1e9 / case.SAMPLES / len(sets), "ns a step and set")
    return found


def _against_c(times: dict[str, Times], apart: float, factor: float, unit: str) -> dict[str, Any]:
    if not apart <= 1e-12:
        raise RuntimeError(f"C and numba differ by {apart:.2g} relative to the largest value of a state")
    ours = times["pumplib"]
    best = min((name for name in times if name != "pumplib"), key=lambda name: times[name].median)
    value, low, high = ratio(ours, times[best])
    note = (
        f"ours {ours.median * factor:.3g} {unit}, {best} {times[best].median * factor:.3g}; minima "
        f"{ours.low * factor:.3g} and {times[best].low * factor:.3g}; ratio by round {low:.2f} - {high:.2f}; "
        f"results equal to {apart:.1g}"
    )
    return _claim(value, note, times=_rows(times), largest_relative_difference=apart)


def start(rounds: int, seed: int) -> Result:
    """perf.import: fresh processes."""
    cold, times, loaded = process.first_second(max(10, rounds))
    ours = times["pumplib"]
    note = (
        f"{ours}, whole process, byte code and kernels cached; a trivial cached numba function alone: "
        f"{times['numba alone']}; first run ever {cold:.1f} s; heavy libraries loaded: {', '.join(loaded) or 'none'}"
    )
    return {"perf.import": _claim(ours.median, note, times=_rows(times), cold_s=cold, loaded=loaded)}


def bench(rounds: int, seed: int) -> Result:
    """perf.bench: runs of the virtual bench with sensors, 30 s of pump life and a stator run."""
    found = {}
    for name, duration in (("pump_clogging", 30.0), ("stator_short_a", 1.5)):
        scenario = dataclasses.replace(load_scenario(name), duration=duration)
        machine = draw_bench(scenario.profile, np.random.default_rng(seed))
        found[name] = interleaved(
            {name: lambda s=scenario, m=machine: run(s, np.random.default_rng(seed), m)},  # type: ignore[misc]
            rounds,
            block=1.0,
        )[name]
    pump, stator = found["pump_clogging"], found["stator_short_a"]
    # a run begins with half a second that settles and is not recorded
    value = 1e6 * pump.median / ((30.0 + 0.5) * 1e4)
    note = (
        f"30 s of pump life {pump}; a stator run of 1.5 s with saturated main flux and harmonics {stator}, "
        f"{1e6 * stator.median / 2e4:.2f} us a step"
    )
    return {"perf.bench": _claim(value, note, times=_rows(found))}


def workbook(rounds: int, seed: int) -> Result:
    """perf.workbook_ch3 and perf.memory: the workbook through its runner."""
    found: Result = {}
    if not process.has_notebook("03_model"):
        return dict.fromkeys(("perf.workbook_ch3", "perf.memory"), _not_run("notebook 03_model does not exist"))
    process.workbook("--only", "03_model", "--force")  # compiles
    times = Times(tuple(process.workbook("--only", "03_model", "--force")[0] for _ in range(3)))
    found["perf.workbook_ch3"] = _claim(times.median, f"{times}, compiled code cached", times=times.row())
    seconds, peak = process.workbook("--force")
    note = f"largest sum of the resident memory of all processes in a run of {seconds:.0f} s of all notebooks"
    found["perf.memory"] = _claim(peak, note, seconds=seconds)
    return found


CHAPTERS = ("closure", "stator", "mso", "residual", "enclosures")
MEASUREMENTS: dict[str, tuple[Callable[[int, int], Result], tuple[str, ...]]] = {
    "bench": (bench, ("perf.bench",)),
    "scipy": (scipy_peers, ("perf.scipy", "perf.scipy_jit")),
    "motulator": (motulator_peer, ("perf.motulator",)),
    "c": (c_peer, ("perf.c", "perf.c_batch")),
    "closure": (chapters.closure, ("ch4.speed", "ch4.speed_plain", "ch4.speed_networkx")),
    "stator": (chapters.stator_observer, ("ch5.speed",)),
    "mso": (chapters.mso, ("ch6.mso_oracle", "ch6.mso_time")),
    "residual": (chapters.residual_generators, ("ch6.generator_speed",)),
    "enclosures": (chapters.enclosures, ("ch7.speed",)),
    "import": (start, ("perf.import",)),
    "workbook": (workbook, ("perf.workbook_ch3", "perf.memory")),
}
