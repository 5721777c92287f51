"""Inverter pulses against an exact switched circuit, disturbances of the supply and of the liquid."""

import dataclasses
import itertools
import math

import numpy as np
import pytest
from scipy.linalg import expm

from pumplib.errors import ParameterError
from pumplib.machines import PumpSet, load_application, load_motor, load_pump
from pumplib.machines.profile import Profile
from pumplib.motor.supply import Supply
from pumplib.testbench.kernels import pulse_flux, ripple
from pumplib.testbench.machine import BenchMachine, source
from pumplib.testbench.nuisances import LIMITS, Nuisance
from pumplib.testbench.run import Bench, draw_bench, play, run
from pumplib.testbench.scenario import Course, Scenario, draw_course, load_scenario, scenarios
from pumplib.testbench.simulate import simulate_bench, start_state

LINK, CARRIER = 650.0, 4300.0
A = np.exp(2j * math.pi / 3)


def draw_bench_course(scenario: Scenario, rng: np.random.Generator) -> tuple[Bench, Course]:
    return draw_bench(scenario.profile, rng), draw_course(scenario, rng)


def heavy(connection: str) -> BenchMachine:
    """A machine whose speed does not move within a test."""
    motor = dataclasses.replace(load_motor("reference_1k5"), connection=connection, J=1000.0)
    return BenchMachine(
        base=PumpSet(motor=motor, pump=load_pump("multistage_1k5"), application=load_application("multistage_1k5"))
    )


def edges(duties: np.ndarray) -> list[tuple[float, tuple[int, int, int]]]:
    """Switching instants of one period with the state of the three legs that holds until then."""
    instants = sorted({0.0, 1.0, *(0.5 - 0.5 * duties), *(0.5 + 0.5 * duties)})
    return [
        (b - a, tuple(int(abs(0.5 * (a + b) - 0.5) < 0.5 * d) for d in duties)) for a, b in itertools.pairwise(instants)
    ]


def exact_currents(machine: BenchMachine, amplitude: float, omega: float, state: np.ndarray, n: int) -> np.ndarray:
    """Terminal space vector at the switching periods' starts, quarters ..., by the circuit's exponentials.

    The electrical part is linear at constant speed; pulses and their mean are both solved exactly and the
    difference is the ripple.
    """
    m = machine.base.motor
    turn = math.sqrt(3) * np.exp(1j * math.pi / 6) if m.connection == "delta" else 1.0
    rotor = m.R_r_prime - 1j * m.z_p * omega * m.L_m_prime
    F = np.array([[-(m.r_s + m.R_r_prime), rotor], [m.R_r_prime, -rotor]]) / np.array([[m.L_s_prime], [m.L_m_prime]])
    G = np.array([[1 / m.L_s_prime], [0.0]])
    augmented = np.zeros((3, 3), dtype=complex)
    augmented[:2, :2], augmented[:2, 2:] = F, G
    pulsed, mean = state.copy(), state.copy()
    found = []
    for k in range(n):
        v = amplitude * np.exp(2j * math.pi * 50 * (k + 0.5) / CARRIER)
        phases = np.array([v.real, (v * np.conj(A)).real, (v * np.conj(A**2)).real])
        duties = 0.5 + (phases - 0.5 * (phases.max() + phases.min())) / LINK
        position = 0.0
        for length, legs in edges(duties):
            u = 2 / 3 * (legs[0] + A * legs[1] + A**2 * legs[2]) * LINK * turn
            step = expm(augmented * (length / CARRIER))
            pulsed = step[:2, :2] @ pulsed + step[:2, 2] * u
            mean = step[:2, :2] @ mean + step[:2, 2] * (v * turn)
            position += length
            found.append((k + position, np.conj(turn) * (pulsed[0] - mean[0]), *duties))
    return np.array(found)


@pytest.mark.parametrize("connection", ["Y", "delta"])
def test_current_ripple_is_that_of_the_switched_circuit(connection: str) -> None:
    machine = heavy(connection)
    m = machine.base.motor
    exact = exact_currents(machine, 280.0, 290.0, np.zeros(2, dtype=complex), 86)
    wave = source(dc_link=LINK, switching_hz=CARRIER)
    factor = 3.0 if connection == "delta" else 1.0
    leakage = m.L_ls + m.L_m * m.L_lr / (m.L_m + m.L_lr)
    ours = []
    for position, _, a, b, c in exact:
        x = float(position.real) % 1.0
        phases = [(float(d.real) - 0.5) * LINK for d in (a, b, c)]
        d, q = ripple(*phases, x, wave)
        ours.append(factor * (d + 1j * q) / leakage)
    gap = np.abs(np.array(ours) - exact[:, 1])
    assert gap.max() < 0.03 * np.abs(exact[:, 1]).max()  # the resistances damp the rest
    assert np.abs(exact[:, 1]).max() > 0.1  # A: large enough to matter


def test_pulse_flux_has_no_mean_and_ends_where_it_began() -> None:
    x = (np.arange(20000) + 0.5) / 20000
    for duty in (0.0, 0.1, 0.5, 0.83, 1.0):
        flux = np.array([pulse_flux.py_func(duty, s) for s in x])
        assert abs(flux.mean()) < 1e-6
        assert pulse_flux.py_func(duty, 1.0) == pytest.approx(0.0, abs=1e-15)
        assert flux.max() == pytest.approx(0.5 * duty * (1 - duty), abs=1e-4)


def test_bench_adds_the_ripple_to_its_currents_only() -> None:
    machine = heavy("Y")
    supply = Supply(amplitude=280.0, frequency=Profile(((0.0, 50.0),), "lines"))
    initial = start_state(machine, 280.0, 50.0, 2e11)
    runs = [
        simulate_bench(machine, supply, duration=0.2, wave=wave, initial=initial)
        for wave in (source(), source(dc_link=LINK, switching_hz=CARRIER))
    ]
    assert np.array_equal(runs[0].fast[:, :3], runs[1].fast[:, :3])
    assert np.array_equal(runs[0].tick, runs[1].tick)
    ripple = runs[1].fast[:, 3:6] - runs[0].fast[:, 3:6]
    assert np.abs(ripple.sum(axis=1)).max() < 1e-12  # no way back in a star
    assert 0.02 < np.sqrt(np.mean(ripple**2)) < 0.6
    spectrum = np.abs(np.fft.rfft(ripple[:, 0] * np.hanning(len(ripple))))
    peak = np.fft.rfftfreq(len(ripple), 1e-4)[spectrum.argmax()]
    # sidebands lie at the carrier +- multiples of the supply, its double is folded at half the sampling rate
    folded = [abs(10000 - 2 * CARRIER), CARRIER]
    assert min(abs(peak - f) for f in folded) <= 200.0


def test_inverter_needs_its_link_and_enough_of_it() -> None:
    with pytest.raises(ParameterError, match=r"dc_link = 0 V with switching_hz = 4000"):
        source(switching_hz=4000.0)
    machine = heavy("Y")
    supply = Supply(amplitude=325.0, frequency=Profile(((0.0, 50.0),), "lines"))
    with pytest.raises(ParameterError, match=r"supply reaches 325 V .* 500 V link end at 289 V"):
        simulate_bench(machine, supply, duration=0.1, wave=source(dc_link=500.0, switching_hz=4000.0))


@pytest.mark.parametrize(
    ("kind", "size", "signal", "change"),
    [
        ("voltage", -0.1, "v_a", -0.1),
        ("density", -0.05, "H_p", -0.05),
        ("load", 0.2, "T_e", None),
        ("temperature", 0.2, "r_s", 0.2),
    ],
)
def test_disturbances_act_after_their_onset(kind: str, size: float, signal: str, change: float | None) -> None:
    scenario = dataclasses.replace(
        load_scenario("pump_healthy"),
        test="steady",
        duration=3.0,
        nuisances=(Nuisance(kind=kind, size=size, onset=1.0),),
    )
    bench, course = draw_bench_course(scenario, np.random.default_rng(3))
    truth = play(bench.machine, course)
    calm = play(bench.machine, dataclasses.replace(course, nuisances=()))
    early = slice(0, 9990) if signal == "v_a" else slice(0, 999)
    assert np.array_equal(truth[signal][early], calm[signal][early])
    late = slice(-5000, None) if signal == "v_a" else slice(-500, None)
    level = [np.sqrt(np.mean(one[signal][late] ** 2)) for one in (truth, calm)]
    if change is None:
        assert level[0] - level[1] == pytest.approx(size, rel=0.1)
    else:
        assert level[0] / level[1] - 1 == pytest.approx(change, rel=0.12)


def test_unbalance_drifts_to_its_size_and_source_pressure_lifts_the_flow() -> None:
    scenario = load_scenario("pump_unbalance_drift")
    bench, course = draw_bench_course(dataclasses.replace(scenario, duration=6.0, changes=2), np.random.default_rng(1))
    truth = play(bench.machine, course)
    v = 2 / 3 * (truth["v_a"] + A * truth["v_b"] + A**2 * truth["v_c"])

    def share(part: slice) -> float:
        turn = 2j * math.pi * truth.frequency[part.start // 10] * truth.t_fast[part]
        both = np.linalg.lstsq(np.stack((np.exp(turn), np.exp(-turn)), 1), v[part], rcond=None)[0]
        return float(abs(both[1]) / abs(both[0]))

    assert share(slice(0, 2000)) < 1e-9
    assert share(slice(58000, 60000)) == pytest.approx(0.02, rel=0.05)  # mean over the last 0.2 s of the drift
    pressed = dataclasses.replace(load_scenario("pump_source_pressure"), test="steady", duration=4.0)
    bench, course = draw_bench_course(pressed, np.random.default_rng(1))
    with_pressure = play(bench.machine, course)
    without = play(bench.machine, dataclasses.replace(course, nuisances=()))
    assert with_pressure["Q"][-1] > 1.01 * without["Q"][-1]


def test_same_seed_same_run_with_and_without_room_for_disturbances() -> None:
    base = dataclasses.replace(load_scenario("pump_healthy"), duration=3.0, changes=1)
    first = run(base, np.random.default_rng(5))
    late = dataclasses.replace(base, nuisances=(Nuisance(kind="voltage", size=0.1, onset=2.0),))
    second = run(late, np.random.default_rng(5))
    assert np.array_equal(first.truth.fast[:19990], second.truth.fast[:19990])
    assert not np.array_equal(first.truth.fast[-10:], second.truth.fast[-10:])


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"kind": "voltage", "size": -0.9}, r"Nuisance.size = -0.9 for voltage .*must be -0.5 to 0.5"),
        ({"kind": "rain", "size": 0.1}, r"Nuisance.kind.*rain"),
        ({"kind": "unbalance", "size": 0.1, "angle": math.inf}, r"Nuisance.angle = inf"),
        ({"kind": "voltage", "size": math.nan}, r"Nuisance.size"),
    ],
)
def test_impossible_disturbances(fields: dict, message: str) -> None:
    with pytest.raises(ParameterError, match=message):
        Nuisance(**fields)


def test_every_disturbance_has_a_scenario() -> None:
    used = {one.kind for name in scenarios() for one in load_scenario(name).nuisances}
    assert used == set(LIMITS)
