"""The bench's plant: everything off is chapter 3, every feature conserves energy, limits stay finite."""

import dataclasses
import math

import numpy as np
import pytest

from pumplib.errors import ParameterError
from pumplib.machines import Profile, PumpSet, load_application, load_motor, load_pump
from pumplib.motor.supply import Supply, grid
from pumplib.plant import simulate
from pumplib.testbench.kernels import source_voltage
from pumplib.testbench.machine import BenchMachine, constants, source
from pumplib.testbench.plant import Slow, magnetising, rates
from pumplib.testbench.simulate import _NEUTRAL, simulate_bench, start_state

SET = PumpSet(
    motor=load_motor("reference_1k5"),
    pump=load_pump("multistage_1k5"),
    application=load_application("multistage_1k5"),
)
PLAIN = BenchMachine(base=SET)
RICH = BenchMachine(
    base=SET,
    saturation="main",
    sat_0=0.8,
    sat_6=0.2,
    sat_flux=1.0,
    asymmetry=(0.01, -0.02, 0.005),
    iron_loss=40.0,
    stray_loss=20.0,
    eccentricity=0.02,
    slot_permeance=0.01,
    kappa_c=0.5,
    head_cubic=3e12,
    leakage_gain=2e-8,
    leakage_lag=0.02,
    valve_lag=0.4,
    check_valve=True,
    npsh_0=3.0,
    npsh_2=1e6,
)


def with_connection(machine: BenchMachine, connection: str) -> BenchMachine:
    base = machine.base
    return dataclasses.replace(
        machine, base=dataclasses.replace(base, motor=dataclasses.replace(base.motor, connection=connection))
    )


@pytest.mark.parametrize("connection", ["Y", "delta"])
def test_every_feature_off_is_the_plant_of_chapter_3(connection: str) -> None:
    bench = with_connection(PLAIN, connection)
    valve = Profile(((0.0, 1.9e11), (0.3, 4e11)))
    load = Profile(((0.0, 0.0), (0.4, 1.0)))
    drive = Supply(amplitude=325.0, boost=3.0, frequency=Profile(((0.0, 20.0), (0.5, 50.0)), "lines"))
    for supply in (grid(400.0), drive):
        ours = simulate_bench(bench, supply, duration=0.6, slow={"valve": valve, "load": load})
        plain = simulate(bench.base, supply, duration=0.6, valve=valve, load_torque=load)
        i = plain.i_abc[:-1]
        tolerance = 1e-12 if supply.frequency is None else 2e-4  # ramps: the bench's frequency moves in ms steps
        for k, name in enumerate(("i_a", "i_b", "i_c")):
            assert np.abs(ours[name] - i[:, k]).max() < tolerance * np.abs(i).max()
        for name, values in (("omega", plain.omega), ("Q_p", plain.Q_p), ("H_p", plain.H_p), ("T_e", plain.T_e)):
            assert np.abs(ours[name] - values[:-1:10]).max() < tolerance * np.abs(values).max()


def test_main_flux_solves_its_equation() -> None:
    c = constants(RICH)
    leak = c.inv_L_ls + c.inv_L_lr
    for psi in (0.0, 0.1, 0.9, 1.2, 1.6):
        exact = c.inv_L_m * (c.sat_0 + c.sat_6 * psi**6)
        for psi_r in (psi, 0.9 * psi):  # the rotor's flux is only the start of the iteration
            g = magnetising((psi * (leak + exact)) ** 2, psi_r**2, 1.0, c)
            assert g == pytest.approx(exact, rel=1e-9 if psi < 1.5 else 1e-6)


def field_energy(x: np.ndarray, theta: float, c) -> float:
    """3/2 of leakage and main-flux energy, from the integral of the magnetisation curve."""
    psi_s, psi_r = complex(x[0], x[1]), complex(x[2], x[3])
    m = 1 + c.perm_1 * math.cos(theta) + c.perm_n * math.cos(c.slots * theta)
    w = psi_s * c.inv_L_ls + psi_r * c.inv_L_lr
    g = magnetising(abs(w) ** 2, abs(psi_r) ** 2, m, c)
    psi_m = w / (c.inv_L_ls + c.inv_L_lr + g)
    size = abs(psi_m)
    main = m * c.inv_L_m * (0.5 * c.sat_0 * size**2 + 0.125 * c.sat_6 * c.inv_sat_psi**6 * size**8)
    leak = 0.5 * c.inv_L_ls * abs(psi_s - psi_m) ** 2 + 0.5 * c.inv_L_lr * abs(psi_r - psi_m) ** 2
    return 1.5 * (leak + main)


def test_power_into_the_field_is_energy_and_torque() -> None:
    """With saturation and permeance waves: i dpsi = dW/dt + T_e omega, W by its own integral."""
    c, s, rng = constants(RICH), _NEUTRAL._replace(valve=2e11), np.random.default_rng(1)
    for _ in range(50):
        psi, theta, omega = rng.normal(size=4) * 0.8, rng.uniform(0, 6), rng.uniform(-300, 300)
        angle = (math.cos(theta), math.sin(theta), math.cos(c.slots * theta), math.sin(c.slots * theta))
        d, p = rates(*psi, omega, *angle, 1e-5, 1e-3, 2e11, 100.0, -200.0, c, s)
        speed, h = np.array(d[:4]), 1e-7
        energy = [field_energy(psi + k * h * speed, theta + k * h * omega, c) for k in (-1, 1)]
        change = (energy[1] - energy[0]) / (2 * h)
        scale = abs(p.field) + abs(p.T_e * omega) + 100.0
        assert abs(p.field - change - p.T_e * omega) < 1e-6 * scale


def test_power_and_mass_balance_with_every_feature_and_fault_on() -> None:
    c = constants(RICH)
    s = _NEUTRAL._replace(
        valve=2e11, K_f=1e10, dB=1e-3, K_l=6e-8, f_c=0.02, K_ext=1e-7, K_in=5e9, bearing=0.1, density=1.05, load=0.5
    )
    psi, omega, theta, q, Q_p = (0.4, -0.8, 0.35, -0.75), 290.0, 0.7, 2e-5, 1.4e-3
    angle = (math.cos(theta), math.sin(theta), math.cos(28 * theta), math.sin(28 * theta))
    d, p = rates(*psi, omega, *angle, q, Q_p, 2e11, 250.0, -180.0, c, s)
    # shaft: every torque once
    J = RICH.base.inertia
    torques = p.T_e - (c.B + s.dB) * omega - p.T_p - s.load - s.bearing * angle[0]
    assert d[4] * J == pytest.approx(torques + c.K_Q_J * J * (d[6] + d[7]), rel=1e-12)
    # electrical: input is copper, iron and what goes to field and shaft
    i, e, v = complex(p.i_d, p.i_q), complex(p.e_d, p.e_q), complex(250.0, -180.0)
    i_fe = c.G_fe * e
    supplied = 1.5 * (v * (i + i_fe).conjugate()).real
    copper = 1.5 * ((v - e) * (i + i_fe).conjugate()).real
    rotor = 1.5 * c.r_r * (p.ir_d**2 + p.ir_q**2)
    iron = 1.5 * c.G_fe * abs(e) ** 2
    assert supplied == pytest.approx(copper + rotor + iron + p.field, rel=1e-12)
    # the unequal phases take the sum of r_k i_k^2
    phases = [i.real, -0.5 * i.real + math.sqrt(0.75) * i.imag, -0.5 * i.real - math.sqrt(0.75) * i.imag]
    drop = sum(c.r_s * (1 + a) * k * k for a, k in zip(RICH.asymmetry, phases, strict=True))
    assert 1.5 * (p.drop_d * p.i_d + p.drop_q * p.i_q) == pytest.approx(drop, rel=1e-12)
    # pipe: all pressures once; what leaks outside does not reach the valve
    K_p = 1 / c.inv_K_p
    assert p.Q_ext == pytest.approx(1e-7 * math.sqrt(p.H_p), rel=1e-12)
    losses = s.K_in * Q_p**2 + 2e11 * (Q_p - p.Q_ext) ** 2
    assert K_p * d[7] == pytest.approx(p.H_p - losses, rel=1e-9)


def test_energy_of_a_run_with_short_and_features_balances() -> None:
    """The terminals' power over a run against losses and stores, through the recorded signals."""
    machine = dataclasses.replace(RICH, npsh_0=0.0, check_valve=False)
    start = start_state(machine, 325.0, 50.0, 2e11)
    run = simulate_bench(
        machine, grid(400.0), duration=1.0, slow={"valve": 2e11, "gamma_b": 0.05, "r_f": 0.1}, initial=start
    )
    v, i = np.stack([run[f"v_{k}"] for k in "abc"], 1), np.stack([run[f"i_{k}"] for k in "abc"], 1)
    power = (v * i).sum(1).reshape(-1, 10).mean(1)
    assert np.allclose(power, run["power"], rtol=1e-9)
    # periodic state: mean input is shaft power, loop, windings and iron
    late, last = run.t >= 0.6, run.t_fast >= 0.6
    shaft = (run["T_e"] * run["omega"])[late].mean()
    loop = (0.1 + 4.1 * (0.05 - 0.05**2 + 0.05**2 / 3)) * np.mean(run["i_f"][late] ** 2)
    rest = power[late].mean() - shaft - loop
    windings = 4.1 * np.mean((i**2).sum(1)[last])  # stator, with the loop's share of the current: an upper limit
    assert 0.5 * windings < rest < windings + 40.0 + 0.1 * shaft


@pytest.mark.parametrize("connection", ["Y", "delta"])
@pytest.mark.parametrize("kappa_c", [0.0, 0.5, 1.0])
def test_loop_current_is_the_phasor_solution(connection: str, kappa_c: float) -> None:
    """A linear machine at constant speed: L di/dt + R i = gamma v_s has a known sinusoid."""
    machine = with_connection(dataclasses.replace(PLAIN, kappa_c=kappa_c), connection)
    gamma, r_f, w = 0.04, 0.02, 100 * math.pi
    run = simulate_bench(machine, grid(400.0), duration=1.0, slow={"gamma_a": gamma, "r_f": r_f})
    motor = machine.base.motor
    sigma = gamma - gamma**2
    s_0 = gamma**2 / 3 if connection == "Y" else 0.0
    L, R = motor.L_ls * (kappa_c * sigma + s_0), r_f + motor.r_s * (sigma + s_0)
    v_s = 400 * math.sqrt(2 / 3) * (1.0 if connection == "Y" else math.sqrt(3) * np.exp(1j * math.pi / 6))
    phasor = gamma * v_s / (R + 1j * w * L)
    expected = np.real(phasor * np.exp(1j * w * run.t))
    assert np.abs(run["i_f"] - expected)[500:].max() < 1e-6 * abs(phasor)


def test_short_makes_negative_sequence_current_and_moves_the_star_point() -> None:
    healthy = simulate_bench(PLAIN, grid(400.0), duration=0.6)
    short = simulate_bench(PLAIN, grid(400.0), duration=0.6, slow={"gamma_a": 0.02})
    assert np.abs(healthy["v_0"]).max() < 1e-9
    assert np.abs(short["v_0"][-2000:]).max() > 0.1
    turn = np.exp(1j * 100 * np.pi * short.t_fast)
    vector = [
        2 / 3 * (r["i_a"] + r["i_b"] * np.exp(2j * np.pi / 3) + r["i_c"] * np.exp(-2j * np.pi / 3))
        for r in (healthy, short)
    ]
    negative = [abs(np.mean((x * turn)[-2000:])) for x in vector]
    assert negative[1] > 0.05 > 1e-3 > negative[0]


def test_terminal_currents_of_a_star_sum_to_zero_and_to_ground_if_there_is_a_fault() -> None:
    run = simulate_bench(RICH, grid(400.0), duration=0.2, slow={"gamma_c": 0.03, "G_ground": 1e-3})
    total = run["i_a"] + run["i_b"] + run["i_c"]
    assert np.allclose(total, 1e-3 * run["v_a"], atol=1e-12)


def test_harmonics_have_their_sequence() -> None:
    wave = source(third=0.05, fifth=0.02 * np.exp(1j), seventh=0.01 * np.exp(2j))
    for turns in (0.0, 0.13, 0.77):
        d, q, zero = source_voltage(turns, 100.0, 0.03 * math.cos(0.4), 0.03 * math.sin(0.4), wave)
        z = np.exp(2j * np.pi * turns)
        expected = z + 0.03 * np.conj(z * np.exp(0.4j)) + 0.02 * np.conj(z**5 * np.exp(1j)) + 0.01 * z**7 * np.exp(2j)
        assert complex(d, q) == pytest.approx(100 * expected, rel=1e-12)
        assert zero == pytest.approx(100 * 0.05 * (z**3).real, abs=1e-10)


def test_dead_time_takes_voltage_against_the_current() -> None:
    wave = source(dc_link=560.0, switching_hz=5000.0, dead_time_s=2e-6)
    clean = simulate_bench(PLAIN, grid(200.0), duration=0.5)
    dead = simulate_bench(PLAIN, grid(200.0), duration=0.5, wave=wave)
    lost = (clean["v_a"] - dead["v_a"])[-2000:]
    large = np.abs(dead["i_a"][-2000:]) > 1.0
    assert large.any()
    # two thirds of the own loss and a third of the others' remain after the zero sequence is gone
    assert np.all(np.sign(lost[large]) == np.sign(dead["i_a"][-2000:][large]))
    assert np.abs(lost).max() <= 4 / 3 * 560.0 * 5000.0 * 2e-6 + 1e-9


def test_winding_warms_as_its_thermal_model_says() -> None:
    machine = dataclasses.replace(PLAIN, thermal_capacity=50.0, thermal_resistance=0.5)
    start = start_state(machine, 400 * math.sqrt(2 / 3), 50.0, 1.9e11)
    run = simulate_bench(machine, grid(400.0), duration=2.0, initial=start)
    rise = run["temperature"][-1] - machine.ambient
    loss = 1.5 * 4.1 * (2 / 3) * np.mean((run["i_a"] ** 2 + run["i_b"] ** 2 + run["i_c"] ** 2)[5000:])
    assert rise == pytest.approx(loss * 0.5 * (1 - math.exp(-2.0 / 25.0)), rel=0.02)
    assert run["r_s"][-1] == pytest.approx(1 + machine.alpha * rise, rel=1e-3)


def test_check_valve_and_npsh_and_dry_running_and_stall_stay_finite() -> None:
    no_flow = {"valve": 1.9e11, "p_source": Profile(((0.0, 0.0), (0.5, -9e5)))}
    run = simulate_bench(dataclasses.replace(RICH, npsh_0=0.0), grid(400.0), duration=1.0, slow=no_flow)
    assert run["Q_p"].min() >= 0.0
    starved = simulate_bench(RICH, grid(400.0), duration=1.0, slow={"p_source": -7.5e4})
    assert 0.0 < starved["f_c"][-1] < 0.35
    assert starved["H_p"][-1] < run["H_p"][400]
    dry = simulate_bench(RICH, grid(400.0), duration=1.0, slow={"f_d": 1.0})
    assert abs(dry["H_p"][-1]) < 1e4
    for stop in ({"load": 40.0}, {"block": 300.0}, {"valve": 1e18}):
        assert np.isfinite(simulate_bench(RICH, grid(400.0), duration=0.5, slow=stop).tick).all()


def test_eccentricity_and_bearing_show_as_sidebands() -> None:
    machine = dataclasses.replace(PLAIN, eccentricity=0.05)
    for bench, slow in ((machine, {}), (PLAIN, {"bearing": 0.5})):
        runs = [simulate_bench(b, grid(400.0), duration=2.0, slow=s) for b, s in ((PLAIN, {}), (bench, slow))]
        tail = [r["i_a"][-10000:] * np.hanning(10000) for r in runs]
        spectra = [np.abs(np.fft.rfft(x)) for x in tail]
        shaft = runs[1]["omega"][-1] / (2 * math.pi)
        line = round(50 + shaft)
        assert spectra[1][line - 1 : line + 2].max() > 10 * spectra[0][line - 1 : line + 2].max()


def test_runs_continue_where_they_ended() -> None:
    whole = simulate_bench(RICH, grid(400.0), duration=0.4, slow={"gamma_a": 0.02})
    half = simulate_bench(RICH, grid(400.0), duration=0.2, slow={"gamma_a": 0.02})
    rest = simulate_bench(
        RICH, grid(400.0), duration=0.2, slow={"gamma_a": 0.02}, initial=half.state, extra=half.extra
    )  # 0.2 s are ten whole periods
    assert np.abs(rest["i_a"] - whole["i_a"][2000:]).max() < 1e-8


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"slow": {"K_x": 1.0}}, "quantity 'K_x': must be one of valve"),
        ({"slow": {"f_c": 0.5}}, r"f_c runs from 0.5 to 0.5: must stay within 0 to 0.35"),
        ({"slow": {"gamma_a": 1.0}}, "must stay below 1"),
        ({"slow": {"valve": np.zeros(3)}}, r"valve has shape \(3,\): one value a millisecond is \(100,\)"),
        ({"slow": {"valve": float("nan")}}, "valve = nan"),
        ({"duration": 0.10005}, "must be a positive multiple of 0.001 s"),
    ],
)
def test_wrong_arguments(change: dict, message: str) -> None:
    with pytest.raises(ParameterError, match=message):
        simulate_bench(PLAIN, grid(400.0), **{"duration": 0.1, **change})


def test_impossible_machines_and_inverters() -> None:
    with pytest.raises(ParameterError, match=r"one deviation a phase"):
        dataclasses.replace(PLAIN, asymmetry=(0.1, 0.1))
    with pytest.raises(ParameterError, match='saturation = "none"'):
        dataclasses.replace(PLAIN, sat_6=0.1)
    with pytest.raises(ParameterError, match="half a switching period"):
        source(dc_link=560.0, switching_hz=5000.0, dead_time_s=1e-3)


def test_slow_quantities_are_those_of_the_kernel() -> None:
    assert len(Slow._fields) == 20
