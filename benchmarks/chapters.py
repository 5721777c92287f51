"""Thesis 4.2.1, 5.2.1, 6.1, 6.6, 7.3.1: the measurements behind the speed claims of chapters 4 to 7."""

from typing import Any

import numpy as np

from benchmarks import propagation, stator, steady, structure
from benchmarks.timing import interleaved
from pumplib.machines.profiles import profile_machine
from pumplib.observers.residual import ResidualObserver
from pumplib.observers.residual_model import believed

Result = dict[str, dict[str, Any]]
SAMPLES = 33_000


def _entry(value: float, note: str, **details: Any) -> dict[str, Any]:
    return {"value": float(f"{value:.4g}"), "note": note, "details": details}


def closure(rounds: int, seed: int) -> Result:
    """ch4.speed and its ratios: 1e4 events, 1e3 roots, layered."""
    time = propagation.speed(max(9, rounds))
    found = propagation.compare(propagation.case("layered", propagation.LARGE, seed), max(3, rounds // 2))
    growth = {name: propagation.growth(name, rounds=3) for name in ("random", "layered", "chain")}
    exponents = ", ".join(f"{name} {one['exponent']:.2f}" for name, one in growth.items())
    others = found["over_condensed"]
    words = ", ".join(f"{name} {value:.3g}" for name, value in others.items())
    return {
        "ch4.speed": _entry(time.median, f"{time}; growth exponents over the events: {exponents}", growth=growth),
        "ch4.speed_plain": _entry(others["plain"], f"times over ours: {words}", **found),
        "ch4.speed_networkx": _entry(found["networkx_over_condensed"], "one networkx search for each root, timed once"),
    }


def stator_observer(rounds: int, seed: int) -> Result:
    """ch5.speed: batch kernel of the stator observer with its decision."""
    found = stator.measure(max(30, 4 * rounds))
    ours, bare = found["us_per_sample"]["pumplib with alarm"], found["us_per_sample"]["pumplib"]
    note = (
        f"with its alarm {ours['median']:.3f} us, {ours['min']:.3f} - {ours['max']:.3f}; without {bare['median']:.3f}"
    )
    if "ratio_to_C" in found:
        note += f"; over the same loop in C ({found['compiler']}): {found['ratio_to_C']['median']:.2f}"
    return {"ch5.speed": _entry(ours["median"], note, **found)}


def enclosures(rounds: int, seed: int) -> Result:
    """ch7.speed: affine enclosures of all three residuals."""
    found = steady.measure(max(3, rounds))
    rates = found["samples_per_second"]
    note = "samples a second: " + ", ".join(f"{name} {rate:.3g}" for name, rate in rates.items())
    return {"ch7.speed": _entry(rates["affine"], note, **found)}


def residual_generators(rounds: int, seed: int) -> Result:
    """ch6.generator_speed: four residuals a sample, and the share of one."""
    machine = profile_machine("pump")
    belief = believed(machine, flow_lag=0.15, pressure_lag=0.05)
    rng = np.random.default_rng(seed)
    w, Q = rng.uniform(190.0, 300.0, SAMPLES), rng.uniform(8e-4, 1.8e-3, SAMPLES)
    T, H = belief.torque(Q, w) + belief.B * w, belief.head(Q, w)
    observer = ResidualObserver(belief, 1e-3)
    times = interleaved({"pumplib": lambda: observer.run(w, T, H, Q)}, max(15, rounds), block=0.05)["pumplib"]
    value = 1e9 * times.median / SAMPLES / 4
    return {
        "ch6.generator_speed": _entry(
            value, f"{4 * value:.0f} ns a sample for four residuals with lags and flags, whole call; {times}"
        )
    }


def mso(rounds: int, seed: int) -> Result:
    """ch6.mso_oracle and the time beside the compiled toolbox."""
    found = structure.mso_oracle(rounds, seed)
    details = found["ch6.mso_oracle"].get("details")
    if details is None:
        return found | {"ch6.mso_time": {"reason": found["ch6.mso_oracle"]["reason"]}}
    return found | {"ch6.mso_time": _entry(details["engine_ratio"], found["ch6.mso_oracle"]["note"])}
