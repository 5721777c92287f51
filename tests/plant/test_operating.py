import dataclasses
import math

import numpy as np
import pytest

from pumplib.errors import ParameterError
from pumplib.machines import PumpSet, read_sheet, shipped
from pumplib.machines.profiles import profile_machine
from pumplib.motor.supply import grid
from pumplib.plant import simulate
from pumplib.plant.operating import check_leakage, flows, operating_point
from pumplib.plant.verify import (
    affinity_spread,
    compare_simplified,
    momentum_speed_error,
    speed_ramps,
    stages_error,
    theoretical_power_error,
)

AMPLITUDE = 400 * math.sqrt(2 / 3)


@pytest.mark.parametrize("connection", ["Y", "delta"])
def test_a_run_started_at_the_operating_point_stays_there(machine: PumpSet, connection: str) -> None:
    motor = dataclasses.replace(machine.motor, connection=connection)
    amplitude = AMPLITUDE if connection == "Y" else AMPLITUDE / math.sqrt(3)
    here = dataclasses.replace(machine, motor=motor)
    point = operating_point(here, amplitude, 50.0)
    assert point.torque == pytest.approx(4.1705, abs=1e-3)
    supply = grid(amplitude * math.sqrt(1.5))
    if connection == "delta":  # the stator voltage leads the terminal voltage by 30 degrees
        supply = dataclasses.replace(supply, phase=-math.pi / 6)
    run = simulate(here, supply, duration=0.5, initial=point.state())
    assert np.abs(run.omega - point.omega).max() < 1e-5
    assert np.abs(run.Q_p / point.Q_p - 1).max() < 1e-7
    assert run.H_p[-1] == pytest.approx(point.H_p, rel=1e-7)


def test_a_start_up_ends_at_the_operating_point(machine: PumpSet) -> None:
    point = operating_point(machine, AMPLITUDE, 50.0, valve=4e11)
    run = simulate(machine, grid(400.0), duration=1.5, valve=4e11)
    assert run.omega[-1] == pytest.approx(point.omega, rel=1e-7)
    assert run.Q_p[-1] == pytest.approx(point.Q_p, rel=1e-6)
    assert run.q[-1] == pytest.approx(point.q, rel=1e-6)


def test_closing_the_valve_lowers_the_flow(machine: PumpSet) -> None:
    found = [flows(machine, 306.0, valve)[0] for valve in (1e11, 2e11, 4e11, 8e11, 1e16)]
    assert found == sorted(found, reverse=True)
    assert found[-1] < 1e-5


def test_without_leakage_the_flow_is_the_root_of_a_quadratic(machine: PumpSet) -> None:
    pump, K_v, omega = machine.pump, 1.9e11, 300.0
    n = pump.stages
    a, b, c = n * pump.a_h2 + pump.K_c + K_v, n * pump.a_h1 * omega, n * pump.a_h0 * omega**2
    root = (b + math.sqrt(b * b + 4 * a * c)) / (2 * a)
    assert flows(machine, omega, K_v, leakage=False) == (pytest.approx(root, rel=1e-12), 0.0)


def test_impossible_operating_points(machine: PumpSet) -> None:
    with pytest.raises(ParameterError, match="cannot carry the pump"):
        operating_point(machine, 60.0, 50.0)
    high = dataclasses.replace(machine, application=dataclasses.replace(machine.application, p_static=9e5))
    with pytest.raises(ParameterError, match="above the shut-off pressure"):
        operating_point(high, AMPLITUDE, 50.0)
    free = dataclasses.replace(machine, pump=dataclasses.replace(machine.pump, K_c=0.0))
    with pytest.raises(ParameterError, match="no single operating point"):
        flows(free, 300.0, 0.0)


def test_assumption_3_3_1_holds_for_a_neck_ring_and_not_for_the_profile(machine: PumpSet) -> None:
    shipped_pump = check_leakage(machine, AMPLITUDE, 50.0)
    profile = check_leakage(profile_machine("pump"), 325.0, 50.0)
    assert shipped_pump.holds
    assert not profile.holds  # its leakage lags by 20 ms, as slow as speed and flow
    assert shipped_pump.share == pytest.approx(0.0088, abs=2e-4)


def test_leakage_rate_is_the_one_of_the_simulation(machine: PumpSet) -> None:
    """Disturb the leakage alone and watch it decay."""
    point = operating_point(machine, AMPLITUDE, 50.0)
    check = check_leakage(machine, AMPLITUDE, 50.0)
    state = point.state()
    state[5] *= 1.02
    run = simulate(machine, grid(400.0), duration=1e-3, step=1e-5, initial=state)
    decay = np.log((run.q[0] - point.q) / (run.q[50] - point.q)) / run.t[50]
    assert decay == pytest.approx(check.leakage_rate, rel=0.1)


def test_comparisons_of_the_notebook(machine: PumpSet) -> None:
    sheet = read_sheet(shipped()["pumps/stage_geometry"])
    impeller, liquid = sheet.parts["impeller"], sheet.parts["liquid"]
    assert momentum_speed_error(machine, impeller, liquid, grid(400.0)) < 1e-9
    assert theoretical_power_error(impeller, liquid, 305.0, np.linspace(0, 3e-3, 20)) < 1e-12
    assert stages_error(machine, grid(400.0)) < 1e-12
    assert affinity_spread(machine.pump, np.array([150.0, 305.0]), np.linspace(0, 9e-6, 20)) < 1e-12


def test_simplified_model_follows_speed_ramps() -> None:
    supply, duration = speed_ramps(325.0, 3.0, 50.0, 20.0)
    result = compare_simplified(profile_machine("pump"), supply, duration)
    assert np.ptp(result.full.omega) > 100.0  # there is a transient
    assert result.error.max() < 0.02
    assert result.error_reciprocal.max() > result.error.max()  # what the thesis's model leaves out
