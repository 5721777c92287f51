"""Thesis 4.1.1, 4.2.1: tables of a machine that is no pump, held against the equations of that machine."""

from collections.abc import Mapping
from itertools import pairwise

import numpy as np
import pytest

from pumplib.fmea.load import shipped

SHIP = shipped("ship")
RESIDUALS = ("rshaft", "rhull", "rpitch", "rengine", "rprop", "rspeed")
ROOTS = [*SHIP.faults, *SHIP.disturbances]


def propeller(n: float, theta: float, u: float) -> tuple[float, float]:
    """Torque and thrust ahead, in scaled units: quadratic in the speed, less with more advance."""
    return n**2 * (0.1 + 0.9 * theta) - 0.25 * n * u, n**2 * 1.1 * theta - 0.3 * n * u


def residuals(n_ref: float, theta_ref: float, at: Mapping[str, float]) -> dict[str, float]:
    """Signals in steady state: the governor holds the measured speed, the pitch controller is proportional."""
    engine = 1.0 + at.get("ky", 0.0)
    n = n_ref - at.get("nb", 0.0)
    theta_m = theta_ref - at.get("leak", 0.0)
    theta = theta_m - at.get("thb", 0.0)
    drag = 0.5 * (1.0 + at.get("R", 0.0))
    # thrust = drag u^2 is a quadratic in the ship speed
    u = (-0.3 * n + np.sqrt(0.09 * n**2 + 4.4 * drag * theta * n**2)) / (2 * drag)
    torque, thrust = propeller(n, theta, u)
    assert torque > 0
    assert np.isclose(thrust, drag * u**2)
    index = torque / engine
    model_torque, model_thrust = propeller(n_ref, theta_m, u)
    return {
        "rshaft": index - model_torque,
        "rhull": model_thrust - 0.5 * u**2,
        "rpitch": theta_m - theta_ref,
        "rengine": torque - index,
        "rprop": torque - model_torque,
        "rspeed": n_ref - n,
    }


@pytest.mark.parametrize("root", [item.id for item in ROOTS])
def test_residuals_have_the_signs_of_the_tables(root: str) -> None:
    effects = next(item for item in ROOTS if item.id == root).effects
    raised = {edge.effect for edge in SHIP.edges if edge.cause in {effect.event for effect in effects}}
    rng = np.random.default_rng(4)
    for _ in range(200):
        size = rng.uniform(0.01, 0.15)
        change = {e.event[:-1]: size if e.event[-1] == "+" else -size for e in effects}
        # a new reference is known to the diagnosis
        n_ref = rng.uniform(0.6, 1.0) + change.pop("nref", 0.0)
        theta_ref = rng.uniform(0.4, 0.8) + change.pop("thref", 0.0)
        found = residuals(n_ref, theta_ref, change)
        seen = {name + ("+" if value > 0 else "-") for name, value in found.items() if abs(value) > 1e-9}
        assert seen == {name for name in raised if name[:-1] in RESIDUALS}


def test_the_ship_has_loops_disturbances_and_a_source() -> None:
    assert len(SHIP.disturbances) == 6
    assert "Izadi-Zamanabadi" in SHIP.source
    assert "1999" in SHIP.source
    home = {event.id: event.component for event in SHIP.events}
    blocks = {(home[edge.cause], edge.component) for edge in SHIP.edges}
    # speed governor, propeller on shaft, propeller and hull, pitch
    loops = [("GO", "DE", "SH", "GO"), ("SH", "PR", "SH"), ("PR", "HU", "PR"), ("PC", "PA", "PC")]
    assert all({*pairwise(loop)} <= blocks for loop in loops)


def test_no_entry_claims_to_be_of_the_thesis() -> None:
    entries = [*SHIP.faults, *SHIP.disturbances, *SHIP.edges, *SHIP.signals, *SHIP.groups, *SHIP.scenarios]
    assert not any("text" in entry.provenance for entry in entries)
