"""Physics against the tables: agreement, a falsified entry is found and named, thresholds, refusals."""

from dataclasses import replace

import numpy as np
import pytest

from pumplib.errors import DataError, ParameterError
from pumplib.events.confront import NONE, ambiguous_cells, confront
from pumplib.events.physics import DISTURBANCES, FAULTS, Disturbance, draw_points, steady_state
from pumplib.events.signals import Maps, _vector, circuit_speed_and_torque, fit_maps, regressors, residuals, sideband
from pumplib.fmea.load import shipped
from pumplib.machines.profiles import profile_machine
from pumplib.motor.frames import to_space_vector
from pumplib.observers.stator_sequences import admittance
from pumplib.propagation import propagate
from pumplib.propagation.symbols import PLUS
from pumplib.testbench.scenario import draw_machine
from pumplib.testbench.simulate import STEP

EVENTS = ("d_load+", "d_unb")
SOME = ("EM1", "HY1", "HY2")


def against(system, **how):
    effects = propagate(system, signs="simple")
    return confront(effects, EVENTS, np.random.default_rng(4), points=1, faults=SOME, training=16, **how)


@pytest.fixture(scope="module")
def found():
    return against(shipped("pump"))


def test_tables_and_physics_agree(found):
    assert found.contradictions == ()
    assert found.cases == (1 + len(SOME)) * (1 + len(EVENTS))
    sign = {s: found.sign[..., k] for k, s in enumerate(found.signals)}
    # what the groups are told apart by, in every condition
    of = {name: k for k, name in enumerate(found.faults)}
    assert (sign["yZn"][of["EM1"]] == 1).all()
    assert (sign["yrH"][[of["HY1"], of["HY2"]]] == -1).all()
    assert (sign["yrTH"][of["HY1"]] == -1).all()
    assert (sign["yrT"][of["HY2"]] == 1).all()
    assert not any(sign[name][of[NONE]].any() for name in ("yZn", "ymc", "yLT", "yrT", "yrH", "yrTH"))
    assert np.allclose(found.shares().sum(axis=2), 1.0)
    assert not (found.shares()[~found.predicted()] > 0).any()
    assert found.largest("HY1", "yrH") < -1.0


def test_healthy_point_moves_nothing(found):
    # no fault, no event: only the winding differs between the two states
    assert not found.sign[0, 0].any()
    assert np.abs(found.deviation[0, 0]).max() < 1.0


@pytest.mark.parametrize(
    ("old", "new", "fault", "signal"),
    [("kh- -> yrH-", "yrH+", "HY1", "yrH"), ("ql+ -> yrT+", "yrT-", "HY2", "yrT"), ("Zn+ -> yZn+", None, "EM1", "yZn")],
)
def test_a_false_entry_is_named(old, new, fault, signal):
    pump = shipped("pump")
    assert any(edge.id == old for edge in pump.edges)
    edges = [
        replace(edge, effect=new) if edge.id == old and new else edge
        for edge in pump.edges
        if edge.id != old or new is not None
    ]
    wrong = against(replace(pump, edges=tuple(edges)))
    named = [one for one in wrong.contradictions if one.fault == fault and one.signal == signal]
    assert named
    if new is not None:
        assert any(new in entry for one in named for entry in one.entries)
    assert signal in str(named[0])
    assert fault in str(named[0])


def test_plain_circuit_takes_a_short_for_load(found):
    # the current of the shorted loop looks like slip: the speed comes out too low, the head too high for it
    plain = against(shipped("pump"), speed="circuit")
    named = {(one.fault, one.signal, one.sign) for one in plain.contradictions}
    assert named == {("EM1", "yrH", "+")}
    assert abs(found.largest("EM1", "yrH")) < 0.5
    assert plain.largest("EM1", "yrH") > 3.0


def test_circuit_inverts_its_own_power():
    motor = profile_machine("pump").motor
    omega_s, omega = 2 * np.pi * 40.0, 2 * np.pi * 40.0 * 0.97
    v = 260.0 + 0.0j
    i = complex(v * admittance(motor, np.array(omega_s), np.array(omega)))
    found_omega, T_e = circuit_speed_and_torque(v, i, 40.0, motor)
    assert found_omega == pytest.approx(omega / motor.z_p, rel=1e-9)
    # power balance: what crosses the gap is shaft power and rotor copper, slip to one
    assert T_e * omega_s / motor.z_p == pytest.approx(1.5 * ((v * np.conj(i)).real - motor.r_s * abs(i) ** 2))
    with pytest.raises(DataError, match="no slip"):
        circuit_speed_and_torque(v, 10 * i, 40.0, motor)


def test_ambiguous_cells_are_those_of_the_simple_paths():
    pump = shipped("pump")
    assert ambiguous_cells(propagate(pump, signs="simple")) == (18, 88)
    assert ambiguous_cells(propagate(pump)) == (48, 88)


def test_every_fault_and_event_of_the_bench_is_in_the_tables():
    pump = shipped("pump")
    effects = propagate(pump)
    assert set(FAULTS) <= set(effects.faults)
    assert set(DISTURBANCES) <= set(effects.disturbances)
    # all members of the groups can be acted out
    members = {fault for k in range(1, 7) for fault in pump.group(f"G{k}").faults}
    assert members <= set(FAULTS)


def test_refusals():
    effects = propagate(shipped("pump"), signs="simple")
    rng = np.random.default_rng(0)
    with pytest.raises(ParameterError, match="EM5"):
        confront(effects, EVENTS, rng, faults=("EM5",))
    with pytest.raises(ParameterError, match="d_moon"):
        confront(effects, ("d_moon",), rng)
    with pytest.raises(ParameterError, match="guess"):
        confront(effects, EVENTS, rng, speed="guess")
    with pytest.raises(ParameterError, match="training"):
        confront(effects, EVENTS, rng, training=2)
    machine = draw_machine("pump", rng)
    with pytest.raises(ParameterError, match="operating conditions"):
        steady_state(machine, draw_points(1, rng)[0], Disturbance(), {"valve": 2e11})


def test_state_is_steady_and_reproducible():
    machine = draw_machine("pump", np.random.default_rng(0))
    point = draw_points(3, np.random.default_rng(1))[2]
    state = steady_state(machine, point, Disturbance(), {})
    H, Q = state.truth["H_p"], state.truth["Q"]
    assert np.ptp(H) < 0.002 * H.mean()
    assert np.ptp(Q) < 0.002 * Q.mean()
    again = steady_state(machine, point, Disturbance(), {})
    assert np.array_equal(again.truth.fast, state.truth.fast)
    assert point.valve * Q.mean() ** 2 == pytest.approx(H.mean(), rel=0.02)


def test_maps_are_found_and_residuals_have_the_physical_signs():
    rng = np.random.default_rng(0)
    w, Q = rng.uniform(180, 300, 30), rng.uniform(5e-4, 1.5e-3, 30)
    head, torque = np.array([7.2, 1e5, 8.1e10]), np.array([3.3e-4, 1.67e-5, 6.0, 2e5])
    X = regressors(w, Q)
    H, T = X[:, 1:] @ head, X @ torque
    rows = [dict(zip(("yw", "yQ", "ydp", "T_e"), map(float, row), strict=True)) for row in zip(w, Q, H, T, strict=True)]
    motor = profile_machine("pump").motor
    maps = fit_maps(rows, motor)
    assert maps.head == pytest.approx(head, rel=1e-6)
    assert maps.torque == pytest.approx(torque, rel=1e-6)
    exact = Maps(motor=motor, head=head, torque=torque)
    at = rows[0] | {"ypin": 0.0}
    zero = residuals(at, exact)
    assert abs(zero["yrH"]) < 1e-6
    assert abs(zero["yrT"]) < 1e-9
    assert abs(zero["yrTH"]) < 1e-6
    assert zero["yLT"] < 0
    # flow that leaves before the meter: torque and head belong to more flow than is measured
    leak = residuals(at | {"yQ": 0.9 * at["yQ"]}, exact)
    assert leak["yrT"] > 0
    assert leak["yrH"] < 0
    assert abs(leak["yrTH"]) < 1e-6
    rub = residuals(at | {"T_e": 1.1 * at["T_e"]}, exact)
    assert rub["yrT"] == pytest.approx(0.1 * at["T_e"])
    assert rub["yrTH"] == pytest.approx(0.1 * at["T_e"], rel=1e-4)
    clogged = residuals(at | {"ydp": 0.9 * at["ydp"]}, exact)
    assert clogged["yrH"] < 0
    assert clogged["yrTH"] < 0
    assert clogged["yrT"] == zero["yrT"]


def test_sideband_is_read_at_the_shaft_frequency():
    class Fake:
        pass

    t = STEP * np.arange(9000)
    i = 4.0 * np.exp(2j * np.pi * 40 * t) + 0.01 * np.exp(1j * (2 * np.pi * 40 + 240.0) * t)
    abc = np.stack([np.real(i * np.exp(-2j * np.pi * k / 3)) for k in range(3)], axis=1)
    assert np.allclose(_vector(abc), i)
    assert np.allclose(_vector(abc), to_space_vector(abc))
    state = Fake()
    state.truth, state.hertz = Fake(), 40.0
    state.truth.fast = np.hstack((abc, abc))
    assert sideband(state, 4.0, 240.0) == pytest.approx(0.01 / 4, rel=1e-3)
    assert sideband(state, 4.0, 215.0) < 0.01 * 0.01 / 4  # a hundredth, 4 Hz away


def test_symbols_of_an_undisturbed_healthy_state(found):
    assert (found.allowed[0, 0] == 1).all()
    raw = found.signals.index("yQ")
    assert not found.allowed[0, 1 + EVENTS.index("d_load+"), raw] & PLUS
