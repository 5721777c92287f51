"""Realizations on simulated systems whose unknown input explodes: the residual must not see it.

The systems are simulated from the model's own equations before the state transformation; measurements follow from its
outputs. What is left in the residual is the error of the integration, which must fall with the square of the step.
"""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import pytest
import sympy as sp

from pumplib.structure import examples, pump, realization_examples
from pumplib.structure.codegen_generator import residual_generator
from pumplib.structure.elimination import eliminate, largest_at
from pumplib.structure.model import StructuralModel
from pumplib.structure.mso import mso_sets
from pumplib.structure.realization import realize
from pumplib.structure.realization_gain import identity_gain, linearized_gain, rate_gain, with_linear_error
from pumplib.structure.realization_report import Report

PUMP = {"J": 0.006, "B": 3.3e-4, "K_Q": 40.0, "a_h0": 7.2, "a_h1": 1e5, "a_h2": 8.1e10, "a_t0": 1.67e-5, "a_t1": 6.04,
        "a_t2": 2e5}  # fmt: skip
POINT = PUMP | {"omega": 306.0, "Q_i": 1.6e-3, "y_w": 306.0, "y_H": 4.9e5, "y_Q": 1.6e-3}
R2 = ["c1", "c3", "c4", "m_w", "m_T", "m_H", "m_Q", "d1", "d2"]
R3 = ["c1", "c2", "c3", "m_w", "m_T", "m_H", "d1", "d2"]
R4 = ["c1", "c2", "c3", "c4", "m_T", "m_H", "m_Q", "d1", "d2"]


def simulate(
    report: Report,
    values: Mapping[str, float],
    start: Mapping[str, float],
    free: Mapping[str, Callable[[Any], Any]],
    unknown: Callable[[Any], Any],
    t: np.ndarray,
) -> dict[str, np.ndarray]:
    """Known signals of a subsystem, by Runge and Kutta's rule on the system before the state transformation."""
    system = report.explicit
    assert system is not None
    used = set().union(*(e.free_symbols for e in (*system.rates, *(e for _, e in system.outputs))))
    numbers = {s: sp.Float(values[s.name], 17) for s in used if s.name in values and s not in system.states}
    time = sp.Symbol("time")
    signals = sorted(used - set(numbers) - set(system.states) - set(system.inputs), key=str)
    solved = eliminate(system.outputs, [s for s in signals if s.name not in free])
    measured = {s: v.subs(numbers) for s, v in solved.values.items()}
    rates = [f.subs(solved.values).subs(numbers) for f in system.rates]
    prescribed = [s for s in signals if s.name in free]
    assert set(signals) == set(prescribed) | set(measured)
    arguments = [time, *system.states, *system.inputs, *prescribed]
    rhs = sp.lambdify(arguments, rates, modules="numpy")

    def f(at: float, x: np.ndarray) -> np.ndarray:
        return np.array(rhs(at, *x, *(unknown(at) for _ in system.inputs), *(free[s.name](at) for s in prescribed)))

    x = np.array([start[s.name] for s in system.states], dtype=float)
    states = np.empty((len(t), len(x)))
    for k in range(len(t)):
        states[k] = x
        if k + 1 < len(t):
            h = t[k + 1] - t[k]
            a = f(t[k], x)
            b = f(t[k] + h / 2, x + h / 2 * a)
            c = f(t[k] + h / 2, x + h / 2 * b)
            d = f(t[k] + h, x + h * c)
            x = x + h / 6 * (a + 2 * b + 2 * c + d)
    inputs = {s.name: np.broadcast_to(free[s.name](t), t.shape) for s in prescribed}
    shown = sp.lambdify([*system.states, *prescribed], list(measured.values()), modules="numpy")(
        *states.T, *inputs.values()
    )
    return inputs | {s.name: np.broadcast_to(v, t.shape) for s, v in zip(measured, shown, strict=True)}


def wave(mean: float, swing: float, frequency: float) -> Callable[[Any], Any]:
    return lambda t: mean + swing * np.sin(frequency * t)


def flat(mean: float) -> Callable[[Any], Any]:
    return lambda t: mean + 0 * t


TANKS = {"Rv1": 1.0, "Rv2": 1.3, "Rv3": 0.8, "CT1": 1.0, "CT2": 1.5, "CT3": 0.7}
INDUCTION = {"a": 3.0, "b": 1.2, "c": 0.9, "d": 2.0, "L_M": 0.5, "k": 1.0, "c_f": 0.1, "c_t": 0.4}
TANK_MSO = ["e2", "e3", "e4", "e5", "e6", "e7", "e8", "e9", "e10", "e11", "e12"]
SPEED_FREE = ["e1", "e2", "e3", "e4", "e5", "e6", "e13", "e14", "e8", "e9", "e10", "e11"]

# model, constraints, parameters, start, prescribed signals, size of the unknown input at the start
CASES: dict[str, tuple[StructuralModel, list[str] | None, dict, dict, dict, float]] = {
    "satellite, velocity": (examples.satellite(), None, {"theta_2": 1.0}, {"rho": 1.0, "omega": 1.0},
                            {"u_2": wave(0.1, 0.05, 2.0)}, 0.02),
    "satellite, force": (examples.satellite("force"), None, {"theta_1": 1.0, "theta_2": 1.0},
                         {"rho": 1.0, "omega": 1.0, "v": 0.0}, {"u_1": flat(0.0), "u_2": wave(0.1, 0.05, 2.0)}, 0.02),
    "pump r2": (pump.pump_part(flow_acceleration=True), R2, PUMP, {"omega": 306.0, "Q_i": 1e-3},
                {"y_T": wave(4.2, 0.3, 3.0)}, 1e-6),
    "pump r3": (pump.pump_part(flow_acceleration=True), R3, PUMP, {"omega": 306.0, "Q_i": 1e-3},
                {"y_T": wave(4.2, 0.3, 3.0)}, 1e-6),
    "pump r4": (pump.pump_part(flow_acceleration=True), R4, PUMP, {"omega": 306.0, "Q_i": 1e-3},
                {"y_T": wave(4.2, 0.3, 3.0)}, 1e-6),
    "bioreactor": (realization_examples.bioreactor(), None, {"k": 2.0}, {"X": 1.0, "S": 50.0},
                   {"D": wave(0.2, 0.05, 1.0), "S_in": flat(60.0)}, 0.02),
    "stirred tank": (realization_examples.stirred_tank(), None, {"h": 5.0, "U": 0.3}, {"c": 30.0, "Theta": 300.0},
                     {"D": flat(0.2), "c_in": flat(40.0), "T_in": wave(300.0, 5.0, 1.0), "T_c": flat(290.0)}, 0.02),
    "robot arm": (realization_examples.robot_arm(), None, {"a": 3.0, "b": 0.5, "d": 0.6},
                  {"q": 0.3, "w_1": 0.0, "w_2": 0.1}, {"tau_2": wave(0.0, 0.2, 2.0)}, 0.01),
    "aircraft": (realization_examples.aircraft(), None, {"eps": 0.3, "g": 9.81, "lam": 1.0},
                 {"theta": 0.4, "w": 0.0, "v_x": 0.0, "v_z": 0.0}, {"u_2": wave(0.0, 0.3, 2.0)}, 0.1),
    "three tanks": (examples.three_tanks(), TANK_MSO, TANKS, {"p1": 2.0, "p2": 1.5, "p3": 1.0},
                    {"y3": wave(1.0, 0.2, 1.0)}, 0.01),
    "induction motor, speed free": (examples.induction_motor(signs="physical"), SPEED_FREE, INDUCTION,
                                    {"i_a": 1.0, "i_b": 0.2, "lambda_a": 0.5, "lambda_b": 0.1},
                                    {"u_a": wave(2.0, 1.0, 3.0), "u_b": wave(1.0, 1.0, 2.0)}, 0.05),
}  # fmt: skip


def residual_of(name: str, steps: int, explosion: float) -> tuple[np.ndarray, dict[str, np.ndarray], Report]:
    model, chosen, values, start, free, size = CASES[name]
    report = realize(model, chosen, prefer=largest_at(POINT), name=name)
    t = np.linspace(0.0, 4.0, steps + 1)
    signals = simulate(report, values, start, free, lambda at: explosion * size * np.exp(1.5 * at), t)
    realization = report.require()
    generator = residual_generator(realization)
    initial = realization.start(values | start) if realization.states else ()
    return generator.run(t, signals, values, initial).residual, signals, report


@pytest.mark.parametrize("name", list(CASES))
def test_residual_is_blind_to_an_exploding_unknown_input(name: str) -> None:
    coarse, signals, report = residual_of(name, 1000, 1.0)
    fine, _, _ = residual_of(name, 2000, 1.0)
    _, quiet, _ = residual_of(name, 1000, 0.0)
    assert report.transformations  # there is an unknown input
    moved = max(np.abs(signals[s] - quiet[s]).max() / (np.abs(quiet[s]).max() + 1e-12) for s in signals)
    assert moved > 0.05  # the unknown input is felt in the measurements
    size = max(np.abs(v).max() for s, v in signals.items() if s.startswith("y"))
    assert np.abs(coarse).max() < 2e-4 * size
    order = np.log2(np.abs(coarse).max() / np.abs(fine).max())
    assert order > 1.8 or np.abs(coarse).max() < 1e-9 * size


@pytest.mark.parametrize("model", [examples.three_tanks(), examples.dc_motor(), examples.induction_motor()],
                         ids=lambda m: m.name)  # fmt: skip
def test_every_realized_subsystem_of_the_published_models_is_consistent(model: StructuralModel) -> None:
    values = TANKS | INDUCTION | {"Ka": 0.8, "b": 1.2, "R": 1.1, "J": 0.9, "L": 0.7}
    start = {s.name: 0.3 + 0.2 * k for k, s in enumerate(model.states)}
    free = {s.name: wave(1.0 + 0.3 * k, 0.2, 1.0 + 0.5 * k) for k, s in enumerate(model.known)}
    checked = 0
    for chosen in mso_sets(model.structure()):
        report = realize(model, chosen)
        if not report.ok:
            continue
        system = report.explicit
        assert system is not None
        # One signal a left-over equation follows from the states; the others are prescribed.
        signals = [s for s in model.known if any(s in e.free_symbols for _, e in system.outputs)]
        followed = {s.name for s in eliminate(system.outputs, signals).values}
        prescribed = {name: f for name, f in free.items() if name not in followed}
        t = np.linspace(0.0, 1.0, 401)
        record = simulate(report, values, start, prescribed, lambda at: 0.3 * np.exp(2.0 * at), t)
        realization = report.require()
        run = residual_generator(realization).run(t, record, values, realization.start(values | start))
        scale = max(np.abs(v).max() for v in record.values())
        assert np.abs(run.residual).max() < 1e-4 * scale
        checked += 1
    assert checked == {"three tanks": 6, "DC motor": 3}.get(model.name, 7)


def test_linear_error_form_decays_with_exactly_the_rate_from_any_start() -> None:
    _, signals, report = residual_of("pump r2", 4000, 1.0)
    form = with_linear_error(report.require())
    generator = residual_generator(form, gain=identity_gain(form, 5.0))
    t = np.linspace(0.0, 4.0, 4001)
    true = form.start(PUMP | {"omega": 306.0, "Q_i": 1e-3})[0]
    error = generator.run(t, signals, PUMP, (true + 100.0,)).residual[:, 0]
    assert error[0] == pytest.approx(-100.0)
    assert error[t == 1.0] == pytest.approx(-100.0 * np.exp(-5.0), rel=1e-4)


def test_a_fault_in_the_equation_is_seen_with_its_size() -> None:
    # A drop of the torque by 0.2 N m is a constant in dz/dt, which the correction L h gives back.
    _, signals, report = residual_of("pump r2", 4000, 1.0)
    form = with_linear_error(report.require())
    generator = residual_generator(form, gain=identity_gain(form, 5.0), output="correction")
    t = np.linspace(0.0, 4.0, 4001)
    faulty = signals | {"y_T": signals["y_T"] + 0.2 * (t > 1.0)}
    run = generator.run(t, faulty, PUMP, form.start(PUMP | {"omega": 306.0, "Q_i": 1e-3}))
    assert run.residual[-1, 0] == pytest.approx(-0.2, rel=1e-3)
    assert abs(run.residual[t < 1.0]).max() < 1e-4


def test_speed_free_residual_converges_from_a_wrong_start() -> None:
    _, signals, report = residual_of("pump r4", 4000, 1.0)
    form = report.require()
    t = np.linspace(0.0, 4.0, 4001)
    run = residual_generator(form, gain=rate_gain(form, 5.0)).run(t, signals, PUMP, (0.006 * 250.0,))
    assert abs(run.residual[0, 0]) > 5e4  # Pa
    assert abs(run.residual[t > 3.0]).max() < 2.0


def test_linearized_gain_makes_several_states_converge() -> None:
    _, signals, report = residual_of("three tanks", 4000, 0.0)
    form = report.require()
    names = {z.name: 1.0 for z in form.states}
    gain = linearized_gain(form, TANKS | names | {s: 1.0 for s in signals}, rate=1.0)
    t = np.linspace(0.0, 4.0, 4001)
    start = np.array(form.start(TANKS | {"p1": 2.0, "p2": 1.5, "p3": 1.0})) + 0.5
    run = residual_generator(form, gain=gain).run(t, signals, TANKS, start)
    assert abs(run.residual[t > 3.5]).max() < 0.1 * abs(run.residual[t < 0.2]).max()
