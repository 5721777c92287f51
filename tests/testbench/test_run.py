"""Scenarios as data, draws that follow the frozen profiles, runs that are reproducible and keep the truth apart."""

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pumplib.errors import ParameterError
from pumplib.machines.profiles import load_profile
from pumplib.testbench.faults import KINDS, PHASES, SIZES, Fault
from pumplib.testbench.plant import Slow
from pumplib.testbench.run import Extras, draw_bench, play, read, run
from pumplib.testbench.scenario import draw_course, draw_machine, load_scenario, scenario_from, scenarios
from pumplib.testbench.sensors import SensorFault

STATOR = load_scenario("stator_healthy")
PUMP = load_scenario("pump_healthy")
SHORT_PUMP = dataclasses.replace(PUMP, duration=4.0, changes=1, fault_segment=2)


@pytest.mark.parametrize("name", scenarios())
def test_shipped_scenarios_are_read(name: str) -> None:
    scenario = load_scenario(name)
    assert scenario.description
    assert scenario.seeds[0] != scenario.seeds[1]  # held-out seeds for scoring


def test_every_fault_has_a_scenario() -> None:
    faults = {load_scenario(name).fault for name in scenarios()} - {None}
    assert {fault.kind for fault in faults} == set(KINDS)


def test_the_same_generator_gives_the_same_run() -> None:
    a, b = (run(dataclasses.replace(STATOR, duration=0.3), np.random.default_rng([7, 1])) for _ in range(2))
    assert a.fast.current.tobytes() == b.fast.current.tobytes()
    other = run(dataclasses.replace(STATOR, duration=0.3), np.random.default_rng([7, 2]))
    assert a.fast.current.tobytes() != other.fast.current.tobytes()


def test_machine_stays_and_supply_is_drawn_anew() -> None:
    bench = draw_bench("stator", np.random.default_rng(1))
    runs = [run(dataclasses.replace(STATOR, duration=0.2), np.random.default_rng(k), bench) for k in (2, 3)]
    assert runs[0].course.negative != runs[1].course.negative
    assert runs[0].course.slow["r_s"] != runs[1].course.slow["r_s"]
    gains = [sensor.gain_error for sensor in bench.sensors.electrical]
    assert len(set(gains)) == 6  # each channel its own, and they belong to the bench


def test_stator_machines_follow_the_profile() -> None:
    believed = load_profile("stator")["motor"]
    machines = [draw_machine("stator", np.random.default_rng(k)) for k in range(200)]
    for name in ("r_s", "r_r", "L_m", "L_ls", "L_lr"):
        ratio = np.array([getattr(m.base.motor, name) for m in machines]) / believed[name]
        assert 0.95 <= ratio.min() < 0.955
        assert 1.045 < ratio.max() <= 1.05
    assert {m.kappa_c for m in machines} == {0.0, 0.5, 1.0}
    share = np.array([m.sat_6 for m in machines])
    assert 0.1 <= share.min() < 0.12
    assert 0.28 < share.max() <= 0.3
    assert all(abs(m.sat_0 + m.sat_6 - 1) < 1e-12 and m.sat_flux == 1.0 for m in machines)
    assert max(max(map(abs, m.asymmetry)) for m in machines) <= 0.002
    # 5 N m at 300 rad/s
    pump = machines[0].base.pump
    assert pump.stages * pump.a_t0 * 300.0**2 == pytest.approx(5.0)
    assert (pump.a_t1, pump.a_t2) == (0.0, 0.0)


def test_stator_runs_follow_the_profile() -> None:
    courses = [draw_course(STATOR, np.random.default_rng(k)) for k in range(300)]
    ratio = np.array([abs(c.negative) for c in courses])
    fifth = np.array([abs(complex(c.wave.h5_re, c.wave.h5_im)) for c in courses])
    seventh = np.array([abs(complex(c.wave.h7_re, c.wave.h7_im)) for c in courses])
    hot = np.array([c.slow["r_s"] for c in courses])
    for values, low, high in ((ratio, 0.01, 0.03), (fifth, 0.005, 0.02), (seventh, 0.003, 0.015), (hot, 1.0, 1.2)):
        span = high - low
        assert low <= values.min() < low + 0.03 * span
        assert high - 0.03 * span < values.max() <= high
    kinds = ["ramp" if c.supply.frequency.breaks().size > 1 else "step" if c.changes else "steady" for c in courses]
    assert all(70 <= kinds.count(kind) <= 130 for kind in ("ramp", "step", "steady"))
    for course in courses:
        hertz = course.supply.frequency.values
        assert 30.0 <= hertz.min() <= hertz.max() <= 50.0
        times = course.supply.frequency.times
        slopes = np.abs(np.diff(hertz) / np.diff(times)) if len(times) > 1 else np.zeros(1)
        assert slopes.max() <= 10.0 * 1.02  # times lie on milliseconds


def test_pump_machine_and_runs_follow_the_profile() -> None:
    profile = load_profile("pump")
    machine = draw_machine("pump", np.random.default_rng(0))
    assert machine.saturation == "rotor"
    assert (machine.sat_0, machine.sat_6, machine.sat_flux) == (1.0, 1.0, 1.6)
    assert machine.base.pump.K_c == profile["truth"]["casing_loss"]
    assert machine.leakage_gain == 2e-8
    assert machine.leakage_lag == 0.02
    assert machine.valve_lag == 0.4
    assert machine.head_cubic == 3e12
    assert machine.base.application.K_p == 6e6
    courses = [draw_course(PUMP, np.random.default_rng(k)) for k in range(100)]
    valve = np.concatenate([c.slow["valve"].values for c in courses])
    assert 1.25e11 <= valve.min() < 1.3e11
    assert 5.8e11 < valve.max() <= 6e11
    # log-uniform: the median is the geometric mean of the limits
    assert np.median(valve) == pytest.approx(math.sqrt(1.25e11 * 6e11), rel=0.1)
    drift = np.array([c.slow["r_s"] for c in courses]) - 1
    assert -0.04 <= drift.min() < -0.03
    assert 0.07 < drift.max() <= 0.08
    for course in courses:
        assert len(course.changes) == 12
        times, hertz = course.supply.frequency.times, course.supply.frequency.values
        assert 30.0 <= hertz.min() <= hertz.max() <= 50.0
        assert np.abs(np.diff(hertz) / np.diff(times)).max() <= 20.0 * 1.05


def test_hot_winding_ends_at_twenty_per_cent() -> None:
    course = draw_course(load_scenario("pump_hot_healthy"), np.random.default_rng(0))
    values = course.slow["r_s"].values
    assert (values[0], values[-1]) == (1.0, pytest.approx(1.2))
    assert course.slow["r_r"] == course.slow["r_s"]


def test_fault_falls_into_segment_seven() -> None:
    for k in range(20):
        course = draw_course(load_scenario("pump_clogging"), np.random.default_rng(k))
        assert course.changes[5] < course.fault.onset < course.changes[6]


@given(st.sampled_from(KINDS), st.floats(0, 1), st.sampled_from(["step", "ramp", "intermittent"]))
def test_faults_act_on_the_physics_after_their_onset(kind: str, share: float, shape: str) -> None:
    _, _, low, high = SIZES[kind]
    size = low + share * (high - low)
    fault = Fault(kind=kind, size=size, onset=0.5, shape=shape, ramp=0.2, period=0.1, share=0.5)
    t = 1e-3 * np.arange(1000)
    columns = fault.columns(t)
    assert set(columns) <= set(Slow._fields)
    quantity = SIZES[kind][0]
    course = columns["gamma_a" if quantity == "gamma" else quantity]
    assert not course[:500].any()
    assert course.max() == pytest.approx(size, abs=1e-12)
    if shape == "step":
        assert (course[500:] == size).all()
    if shape == "ramp" and size:
        assert course[600] == pytest.approx(size / 2, rel=1e-9)
    if shape == "intermittent":
        assert (course[500:] > 0).mean() == pytest.approx(0.5 if size else 0.0, abs=0.01)


def test_rub_and_bearing_bring_ripple_and_friction() -> None:
    t = np.array([0.0, 1.0, 2.0])
    rub = Fault(kind="friction", size=5e-4, onset=1.0, ripple=0.1).columns(t)
    worn = Fault(kind="bearing", size=0.1, onset=1.0, drag=5e-4).columns(t)
    for name, size in (("dB", 5e-4), ("bearing", 0.1)):
        assert np.array_equal(rub[name], [0.0, size, size])
        assert np.array_equal(worn[name], [0.0, size, size])
    with pytest.raises(ParameterError, match=r"Fault.drag = 0.1: belongs to bearing, not to friction"):
        Fault(kind="friction", size=5e-4, drag=0.1)


def test_phases_of_a_short() -> None:
    t = np.array([1.0])
    assert Fault(kind="inter_turn", size=0.02, phase="b").columns(t)["gamma_b"] == 0.02
    two = Fault(kind="inter_turn", size=0.02, phase="ca").columns(t)
    assert (two["gamma_c"], two["gamma_a"]) == (0.02, -0.02)
    assert all(abs(sum(signs)) == (len(name) == 1) for name, signs in PHASES.items())


@pytest.mark.parametrize(
    ("kind", "size", "sign_H", "sign_Q"),
    [
        ("clogging", 3e10, -1, -1), ("leakage", 2e-7, -1, -1), ("cavitation", 0.2, -1, -1),
        ("dry_running", 0.9, -1, -1),
        ("inlet_obstruction", 2e11, 1, -1), ("outlet_leak", 4e-7, -1, -1),
    ],
)  # fmt: skip
def test_faults_move_pressure_and_flow_as_physics_says(kind: str, size: float, sign_H: int, sign_Q: int) -> None:
    """At the same operating point: closing an inlet raises the pressure and lowers the flow, and so on."""
    machine = draw_machine("pump", np.random.default_rng(0))
    steady = dataclasses.replace(SHORT_PUMP, test="steady", duration=2.0)
    course = draw_course(steady, np.random.default_rng(1))
    healthy = play(machine, course)
    faulty = play(machine, dataclasses.replace(course, fault=Fault(kind=kind, size=size, onset=0.5)))
    assert np.array_equal(healthy["H_p"][:500], faulty["H_p"][:500])
    assert sign_H * (faulty["H_p"][-1] - healthy["H_p"][-1]) > 500.0
    assert sign_Q * (faulty["Q"][-1] - healthy["Q"][-1]) > 1e-6


def test_friction_slows_and_heats() -> None:
    machine = draw_machine("pump", np.random.default_rng(0))
    course = draw_course(dataclasses.replace(SHORT_PUMP, test="steady", duration=2.0), np.random.default_rng(1))
    healthy = play(machine, course)
    rub = play(machine, dataclasses.replace(course, fault=Fault(kind="friction", size=1e-3, onset=0.5)))
    assert rub["omega"][-1] < healthy["omega"][-1]
    assert rub["T_e"][-1] - healthy["T_e"][-1] == pytest.approx(1e-3 * rub["omega"][-1], rel=0.1)


def test_measurements_follow_the_truth_and_only_the_truth_knows() -> None:
    bench = draw_bench("pump", np.random.default_rng(0))
    result = run(SHORT_PUMP, np.random.default_rng(1), bench)
    fast, truth = result.fast, result.truth
    assert fast.voltage.shape == (40_000, 3)
    assert fast.H is not None
    assert fast.H.shape == (4000,)
    late = slice(3500, None)
    assert abs(np.mean(fast.H[late] - truth["H_p"][late])) < 1500 + 200 + 800
    assert abs(np.mean(fast.Q[late] - truth["Q"][late])) < 8e-6 + 2e-6 + 4e-6
    current = np.sqrt(np.mean(fast.current[-2000:, 0] ** 2)) / np.sqrt(np.mean(truth["i_a"][-2000:] ** 2))
    assert current == pytest.approx(1.0, abs=0.004)
    slow = result.slow()
    assert slow.H is not None
    assert len(slow.t) == 4


def test_cavitation_noise_and_sensor_faults_are_extras() -> None:
    bench = draw_bench("pump", np.random.default_rng(0))
    course = draw_course(dataclasses.replace(SHORT_PUMP, test="steady", duration=2.0), np.random.default_rng(1))
    truth = play(bench.machine, dataclasses.replace(course, fault=Fault(kind="cavitation", size=0.1, onset=1.0)))
    plain = read(bench.sensors, truth, np.random.default_rng(2))
    noisy = read(bench.sensors, truth, np.random.default_rng(2), Extras(cavitation_noise=1e6))
    assert plain.H is not None
    assert noisy.H is not None
    assert np.std(noisy.H[1500:]) > 2 * np.std(plain.H[1500:])
    stuck = read(bench.sensors, truth, np.random.default_rng(2), faults={"i_b": SensorFault(kind="stuck", onset=1.0)})
    assert np.ptp(stuck.current[12_000:, 1]) == 0.0
    assert np.array_equal(stuck.current[:, 0], plain.current[:, 0])
    drift = read(
        bench.sensors, truth, np.random.default_rng(2), faults={"Q": SensorFault(kind="drift", onset=1.0, size=1e-4)}
    )
    assert drift.Q is not None
    assert plain.Q is not None
    assert np.mean((drift.Q - plain.Q)[-100:]) == pytest.approx(1e-4 * 0.95, rel=0.02)
    with pytest.raises(ParameterError, match="sensor fault on 'p': this bench has the channels v_a"):
        read(bench.sensors, truth, np.random.default_rng(2), faults={"p": SensorFault(kind="stuck", onset=1.0)})


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"profile": "fan"}, "Scenario.profile = 'fan': must be one of stator, pump, pump_hot"),
        ({"duration": -1.0}, r"Scenario.duration = -1 s: must be > 0 s"),
        ({"profile": "pump", "test": "ramp"}, "belongs to the profile stator"),
        ({"test": "changes"}, "belongs to the pump profiles"),
        ({"profile": "pump", "test": "changes", "duration": 3.0}, "12 changes in 3 s leave 0.23 s each"),
        ({"speed": 3}, "unexpected keyword argument 'speed'"),
        ({"fault": {"kind": "rust", "size": 1.0}}, "Fault.kind = 'rust': must be one of inter_turn"),
        ({"fault": {"kind": "cavitation", "size": 0.5}}, r"Fault.size = 0.5 for cavitation \(f_c, share of head\)"),
        ({"fault": {"kind": "inter_turn", "size": 0.02, "phase": "d"}}, "Fault.phase = 'd': must be one of a, b, c"),
        ({"fault": {"kind": "clogging"}}, "missing 1 required keyword-only argument: 'size'"),
    ],
)
def test_wrong_scenarios(change: dict, message: str) -> None:
    with pytest.raises(ParameterError, match=message):
        scenario_from({"profile": "stator", "duration": 1.5, **change}, "mine")


def test_absent_scenario_and_wrong_bench() -> None:
    with pytest.raises(ParameterError, match="scenario 'pump_rust': not found; shipped are"):
        load_scenario("pump_rust")
    with pytest.raises(ParameterError, match="needs profile 'pump', the bench was drawn from 'stator'"):
        run(SHORT_PUMP, np.random.default_rng(0), draw_bench("stator", np.random.default_rng(0)))
