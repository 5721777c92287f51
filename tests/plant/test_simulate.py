import dataclasses
import math
from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from pumplib.errors import ParameterError, SimulationError
from pumplib.machines import Profile, PumpSet
from pumplib.machines.profiles import profile_machine
from pumplib.motor.supply import Supply, grid, negative_sequence
from pumplib.plant import STATES, coefficients, simulate, simulate_many
from pumplib.plant.balance import energy_error, power_balance
from pumplib.plant.equations import derivatives

AMPLITUDE = 400 * math.sqrt(2 / 3)


def test_convergence_is_of_order_four(machine: PumpSet) -> None:
    """Halving the step divides the error by sixteen, also across steps of valve and load."""
    inputs = {
        "valve": Profile(((0.0, 1.9e11), (0.1, 6e11))),
        "load_torque": Profile(((0.0, 0.0), (0.15, 2.0))),
        "duration": 0.2,
    }
    runs = [simulate(machine, grid(400.0), step=h, every=round(1e-3 / h), **inputs) for h in (1e-4, 5e-5, 2.5e-5)]
    exact = simulate(machine, grid(400.0), step=2.5e-6, every=400, **inputs)
    scale = np.abs(exact.x).max(axis=0)
    errors = [float((np.abs(r.x - exact.x) / scale).max()) for r in runs]
    for coarse, fine in pairwise(errors):
        assert 3.8 < math.log2(coarse / fine) < 4.3


def test_an_adaptive_solver_finds_the_same_run(machine: PumpSet) -> None:
    supply, c = grid(400.0), coefficients(machine)

    def rhs(t: float, x: np.ndarray) -> tuple[float, ...]:
        angle = 2 * math.pi * 50 * t
        v = supply.amplitude
        return derivatives(*x, v * math.cos(angle), v * math.sin(angle), 1.9e11, 0.0, c)

    run = simulate(machine, supply, duration=0.3, step=1e-5, every=100)
    found = solve_ivp(rhs, (0, 0.3), np.zeros(7), "DOP853", t_eval=run.t, rtol=1e-11, atol=1e-14)
    scale = np.abs(run.x).max(axis=0)
    assert (np.abs(found.y.T - run.x) / scale).max() < 1e-8


@pytest.mark.parametrize("reciprocal", [False, True])
def test_power_balances_at_every_sample(machine: PumpSet, reciprocal: bool) -> None:
    supply = Supply(amplitude=AMPLITUDE, components=(negative_sequence(0.03, 1.0),))
    run = simulate(
        machine,
        supply,
        duration=0.5,
        load_torque=Profile(((0.0, 0.0), (0.4, 2.0))),
        reciprocal=reciprocal,
    )
    power = power_balance(run)
    assert np.abs(power.imbalance).max() < 1e-9 * np.abs(power.electrical).max()
    assert power.copper_stator.min() >= 0
    assert power.copper_rotor.min() >= 0
    assert power.application.min() >= -1e-12  # a difference of equal terms while the flow is still zero


@pytest.mark.parametrize("reciprocal", [False, True])
def test_energy_of_a_start_up_balances(machine: PumpSet, reciprocal: bool) -> None:
    run = simulate(machine, grid(400.0), duration=0.6, step=2e-5, reciprocal=reciprocal)
    assert energy_error(run) < 1e-8


def test_the_balance_notices_a_wrong_torque(machine: PumpSet) -> None:
    run = simulate(machine, grid(400.0), duration=0.3)
    spoilt = dataclasses.replace(run, c=run.c._replace(k_T=1.01 * run.c.k_T))
    power = power_balance(spoilt)
    assert np.abs(power.imbalance).max() > 1e-3 * np.abs(power.electrical).max()


def test_the_same_run_twice_is_the_same(machine: PumpSet) -> None:
    a, b = (simulate(machine, grid(400.0), duration=0.1) for _ in range(2))
    assert a.x.tobytes() == b.x.tobytes()


def test_recording_less_often_changes_nothing(machine: PumpSet) -> None:
    every = simulate(machine, grid(400.0), duration=0.1)
    some = simulate(machine, grid(400.0), duration=0.1, every=10)
    assert np.array_equal(every.x[::10], some.x)
    assert np.allclose(every.t[::10], some.t, rtol=1e-15, atol=0)
    assert np.array_equal(every.v_t[::10], some.v_t)


def test_a_run_can_be_continued(machine: PumpSet) -> None:
    whole = simulate(machine, grid(400.0), duration=0.2)
    half = simulate(machine, grid(400.0), duration=0.1)
    rest = simulate(machine, grid(400.0), duration=0.1, initial=half.x[-1])  # 0.1 s is five whole periods
    assert np.abs(rest.x - whole.x[1000:]).max() < 1e-9


def test_steps_take_effect_at_their_time_and_not_before(machine: PumpSet) -> None:
    plain = simulate(machine, grid(400.0), duration=0.5)
    stepped = simulate(machine, grid(400.0), duration=0.5, load_torque=Profile(((0.0, 0.0), (0.4, 2.0))))
    assert np.array_equal(plain.x[:4001], stepped.x[:4001])
    drop = (stepped.omega[4001] - plain.omega[4001]) / 1e-4
    assert drop == pytest.approx(-2.0 / machine.inertia, rel=0.02)
    assert stepped.T_load[4000] == 2.0
    assert stepped.T_load[3999] == 0.0


def test_liquid_only_adds_inertia(machine: PumpSet) -> None:
    """Thesis 1.4: moving J_Mv to the rotor changes nothing."""
    pump = machine.pump
    moved = dataclasses.replace(pump, J=pump.J + pump.stages * pump.J_Mv, J_Mv=0.0)
    a = simulate(machine, grid(400.0), duration=0.3)
    b = simulate(dataclasses.replace(machine, pump=moved), grid(400.0), duration=0.3)
    assert np.abs(a.omega - b.omega).max() < 1e-9 * np.abs(a.omega).max()


def test_closed_valve_and_dead_motor_stay_finite(machine: PumpSet) -> None:
    closed = simulate(machine, grid(400.0), duration=0.5, valve=1e15)
    assert 0 <= closed.Q_p[-1] < 3e-5
    assert closed.H_p[-1] == pytest.approx(6.9e5, rel=0.05)
    dead = simulate(machine, Supply(amplitude=0.0), duration=0.1)
    assert not dead.x.any()


def test_stalled_motor_stays_finite(machine: PumpSet) -> None:
    run = simulate(machine, grid(400.0), duration=0.5, load_torque=60.0)
    assert np.isfinite(run.x).all()
    assert run.omega[-1] < 0  # pulled backwards by the load: the pump's losses still brake
    power = power_balance(run)
    assert np.abs(power.imbalance).max() < 1e-9 * np.abs(power.electrical).max()


def test_batch_equals_single_runs(machine: PumpSet) -> None:
    machines = [
        dataclasses.replace(machine, motor=dataclasses.replace(machine.motor, r_s=4.0 + 0.01 * k)) for k in range(35)
    ]
    inputs = {"duration": 0.2, "valve": Profile(((0.0, 1.9e11), (0.1, 4e11)))}
    batch = simulate_many(machines, grid(400.0), every=100, **inputs)
    assert batch.x.shape == (21, 35, 7)
    for k in (0, 1, 31, 32, 34):
        assert np.allclose(batch.x[:, k], simulate(machines[k], grid(400.0), every=100, **inputs).x, rtol=1e-12)


def test_contraction_of_products_is_harmless(machine: PumpSet) -> None:
    """Fused multiply-add is the only fast-math flag; pure Python has none and agrees to rounding."""
    rng, c = np.random.default_rng(0), coefficients(machine)
    from pumplib.hydraulics import pressure
    from pumplib.motor import dq
    from pumplib.plant import equations

    names = {
        "current_derivatives": dq.current_derivatives,
        "torque": dq.torque,
        "impeller_pressure": pressure.impeller_pressure,
        "impeller_torque": pressure.impeller_torque,
        "leakage_derivative": pressure.leakage_derivative,
        "casing_pressure": pressure.casing_pressure,
        "flow_derivative": pressure.flow_derivative,
    }
    plain = equations.derivatives.py_func
    scope = {**plain.__globals__, **{name: f.py_func for name, f in names.items()}}
    python = type(plain)(plain.__code__, scope)
    for _ in range(200):
        x = rng.normal(size=7) * (30, 30, 5, 5, 300, 1e-5, 2e-3)
        u = (*rng.normal(size=2) * 300, 2e11, 1.0)
        exact, ours = np.array(python(*x, *u, c)), np.array(derivatives(*x, *u, c))
        # terms of each sum are at most about a thousand times the sum itself here
        assert np.abs(ours - exact).max() <= 1e-12 * np.abs(exact).max()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"duration": -1.0}, r"duration = -1\.0 s: must be a finite number > 0"),
        ({"duration": math.nan}, "duration = nan s"),
        ({"step": 0.0}, r"step = 0\.0 s: must be > 0"),
        (
            {"step": 3e-4, "duration": 1.0},
            r"duration = 1 s is not a multiple of the recorded step 0\.0003 s; move it to 0\.9999",
        ),
        ({"every": 0}, "every = 0"),
        ({"valve": -1.0}, r"valve = -1 Pa s2/m6: must be >= 0"),
        ({"valve": "open"}, "valve .* = 'open'"),
        ({"load_torque": math.inf}, r"load_torque \(N m\) = inf"),
        (
            {"load_torque": Profile(((0.0, 0.0), (0.05003, 1.0)))},
            r"t = 0\.05003 s is not a multiple.*move it to 0\.05 s",
        ),
        ({"initial": [0.0] * 5}, r"initial has shape \(5,\): must be 7 finite numbers \(i_sd in A"),
        ({"initial": [math.nan] * 7}, "7 finite numbers"),
    ],
)
def test_wrong_arguments(machine: PumpSet, change: dict, message: str) -> None:
    with pytest.raises(ParameterError, match=message):
        simulate(machine, grid(400.0), **{"duration": 0.1, **change})


def test_a_diverging_run_says_what_where_and_why(machine: PumpSet) -> None:
    with pytest.raises(SimulationError, match=r"left the finite numbers at t = .*step of 0\.02 s is probably too long"):
        simulate(machine, grid(400.0), duration=10.0, step=2e-2)


def test_batches_need_machines_of_one_connection(machine: PumpSet) -> None:
    delta = dataclasses.replace(machine, motor=dataclasses.replace(machine.motor, connection="delta"))
    with pytest.raises(ParameterError, match="mix Y and delta"):
        simulate_many([machine, delta], grid(400.0), duration=0.1, valve=1e11)
    with pytest.raises(ParameterError, match="machines is empty"):
        simulate_many([], grid(400.0), duration=0.1, valve=1e11)


def test_reciprocal_coupling_beyond_the_inertias_is_refused(machine: PumpSet) -> None:
    pump = dataclasses.replace(machine.pump, K_Q=1e3)
    with pytest.raises(ParameterError, match="kinetic energy would be negative"):
        coefficients(dataclasses.replace(machine, pump=pump), reciprocal=True)


def test_profile_machine_runs(machine: PumpSet) -> None:
    run = simulate(profile_machine("pump"), grid(400.0), duration=1.0)
    assert run.H_p[-1] == pytest.approx(5.0e5, rel=0.02)
    assert run.Q_p[-1] == pytest.approx(1.62e-3, rel=0.02)


def test_states_are_named() -> None:
    assert STATES == ("i_sd", "i_sq", "i_md", "i_mq", "omega", "q", "Q_p")
