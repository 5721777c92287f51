"""Generated code: against the symbolic expressions, record against stream, C against Python."""

import ctypes
import shutil
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sympy as sp

from pumplib.errors import DataError, ParameterError, SimulationError
from pumplib.structure import examples, pump, realization_examples
from pumplib.structure.codegen import straight_line
from pumplib.structure.codegen_c import c_source, identifier
from pumplib.structure.codegen_generator import ResidualGenerator, residual_generator
from pumplib.structure.elimination import largest_at
from pumplib.structure.realization import realize
from pumplib.structure.realization_gain import identity_gain, linearized_gain, rate_gain, with_linear_error
from pumplib.structure.realization_report import Realization

PUMP = {"J": 0.006, "B": 3.3e-4, "K_Q": 40.0, "a_h0": 7.2, "a_h1": 1e5, "a_h2": 8.1e10, "a_t0": 1.67e-5, "a_t1": 6.04,
        "a_t2": 2e5}  # fmt: skip
POINT = PUMP | {"omega": 306.0, "Q_i": 1.6e-3, "y_w": 306.0, "y_H": 4.9e5, "y_Q": 1.6e-3}
SETS = {
    "r1": "c2 c4 m_w m_H m_Q",
    "r2": "c1 c3 c4 m_w m_T m_H m_Q d1 d2",
    "r3": "c1 c2 c3 m_w m_T m_H d1 d2",
    "r4": "c1 c2 c3 c4 m_T m_H m_Q d1 d2",
}


def pump_generator(name: str, **settings: Any) -> tuple[ResidualGenerator, Realization]:
    model = pump.pump_part(flow_acceleration=True)
    form = realize(model, SETS[name].split(), prefer=largest_at(POINT), name=name).require()
    if name in ("r2", "r3"):
        return residual_generator(form, gain=identity_gain(form, 5.0), **settings), form
    return residual_generator(form, gain=rate_gain(form, 5.0) if name == "r4" else None, **settings), form


def record(n: int) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    rng = np.random.default_rng(1)
    t = np.cumsum(rng.uniform(0.5e-3, 1.5e-3, n))
    return t, {
        "y_w": 306 + rng.normal(size=n),
        "y_Q": 1.6e-3 + 1e-5 * rng.normal(size=n),
        "y_H": 4.9e5 + 1e3 * rng.normal(size=n),
        "y_T": 4.2 + 0.01 * rng.normal(size=n),
    }


def begin(form: Realization) -> tuple[float, ...]:
    return form.start(POINT) if form.states else ()


@pytest.mark.parametrize("name", list(SETS))
@pytest.mark.parametrize("scheme", ["heun", "euler"])
def test_stream_and_record_are_identical(name: str, scheme: str) -> None:
    generator, form = pump_generator(name, scheme=scheme)
    t, signals = record(500)
    run = generator.run(t, signals, POINT, begin(form))
    stream = generator.stream(POINT, begin(form))
    rows = np.stack([signals[s] for s in generator.signals], axis=1)
    streamed = [stream.step(list(row), dt) for row, dt in zip(rows, np.diff(t, prepend=t[0]), strict=True)]
    assert np.array_equal(np.array(streamed), run.residual)
    assert np.array_equal(stream.states, run.states[-1])


@pytest.mark.parametrize("name", list(SETS))
def test_one_step_equals_the_symbolic_rule(name: str) -> None:
    generator, form = pump_generator(name)
    t, signals = record(2)
    run = generator.run(t, signals, POINT, begin(form))
    numbers = {p: sp.Float(PUMP[p.name], 40) for p in form.parameters}

    def at(expression: sp.Expr, z: list[Any], k: int) -> Any:
        values = {s: sp.Float(float(signals[s.name][k]), 40) for s in form.signals}
        return sp.sympify(expression).subs({**numbers, **values, **dict(zip(form.states, z, strict=True))}).evalf(40)

    if form.states:
        gain = identity_gain(form, 5.0) if name in ("r2", "r3") else rate_gain(form, 5.0)
        rate = form.rates[0] + gain[0][0] * form.residuals[0]
        z = [sp.Float(begin(form)[0], 40)]
        dt = sp.Float(float(t[1] - t[0]), 40)
        a = at(rate, z, 0)
        b = at(rate, [z[0] + dt * a], 1)
        z = [z[0] + dt * (a + b) / 2]
        assert run.states[1, 0] == pytest.approx(float(z[0]), rel=1e-13)
    else:
        z = []
    assert run.residual[1, 0] == pytest.approx(float(at(form.residuals[0], z, 1)), rel=1e-9)  # differences of 5e5 Pa


def compiled_c(source: str, folder: Path, name: str) -> Any:
    compiler = shutil.which("gcc") or shutil.which("cc")
    if compiler is None:
        pytest.skip("no C compiler (gcc or cc) on this machine: the C source was not tested")
    (folder / f"{name}.c").write_text(source)
    command = [compiler, "-std=c99", "-Wall", "-Wextra", "-pedantic", "-Werror", "-O2", "-fPIC", "-shared"]
    subprocess.run([*command, str(folder / f"{name}.c"), "-o", str(folder / f"{name}.so"), "-lm"], check=True)
    function = getattr(ctypes.CDLL(str(folder / f"{name}.so")), f"{name}_step")
    pointer = ctypes.POINTER(ctypes.c_double)
    function.argtypes = [pointer, pointer, pointer, ctypes.c_double]
    function.restype = ctypes.c_int
    return function


def run_c(function: Any, generator: ResidualGenerator, t: np.ndarray, signals: dict, values: dict, start: Any) -> Any:
    rows = generator.record(signals)
    state = np.concatenate([start, np.zeros(len(generator.signals) + generator.outputs)])
    parameters = generator.values(values)
    pointer = ctypes.POINTER(ctypes.c_double)
    found, flags = np.empty((len(t), generator.outputs)), np.empty(len(t), dtype=int)
    for k, dt in enumerate(np.diff(t, prepend=t[0])):
        flags[k] = function(*(v.ctypes.data_as(pointer) for v in (state, rows[k], parameters)), dt)
        found[k] = state[len(state) - generator.outputs :]
    return found, flags


@pytest.mark.parametrize("name", list(SETS))
def test_c_source_of_the_pump_reproduces_python(name: str, tmp_path: Path) -> None:
    generator, form = pump_generator(name)
    t, signals = record(3000)
    signals["y_H"] = signals["y_H"] + 4e5 * (t > t[1500])  # beyond the map: the flag is compared, too
    run = generator.run(t, signals, POINT, begin(form))
    found, flags = run_c(
        compiled_c(c_source(generator, name), tmp_path, name), generator, t, signals, POINT, begin(form)
    )
    assert np.abs(found - run.residual).max() <= 1e-12 * np.abs(run.residual).max()
    assert np.array_equal(flags, run.flags)
    assert run.flags.any() == (name == "r3")


def test_c_source_with_several_states_and_functions(tmp_path: Path) -> None:
    model = realization_examples.robot_arm()
    form = realize(model).require()
    generator = residual_generator(form, gain=identity_gain(form, 2.0))
    t = np.linspace(0, 3, 1000)
    signals = {"tau_2": np.sin(t), "y_q": 0.3 * np.cos(t), "y_1": t, "y_2": t**2 / 3}
    values = {"a": 3.0, "b": 0.5, "d": 0.6}
    run = generator.run(t, signals, values, (0.3, 0.1))
    found, _ = run_c(compiled_c(c_source(generator, "arm"), tmp_path, "arm"), generator, t, signals, values, (0.3, 0.1))
    assert np.abs(found - run.residual).max() <= 1e-12 * np.abs(run.residual).max()


def test_c_source_is_deterministic_and_names_are_identifiers() -> None:
    assert c_source(pump_generator("r3")[0]) == c_source(pump_generator("r3")[0])
    assert identifier("motor, r 2") == "motor_r_2"
    assert identifier("2x") == "x2x"


def test_every_function_and_power_that_can_be_written(tmp_path: Path) -> None:
    x, y, p = sp.symbols("x y p")
    expressions = [
        sp.sqrt(x) + 1 / sp.sqrt(y) + x ** sp.Rational(3, 2),
        x**7 / (3 * y**2) - sp.Rational(2, 3) * x + (x - y) / (x + y) ** 3,
        sp.exp(-x) * sp.log(y) + sp.tan(x) - sp.atan(y) + sp.asin(x / 9) - sp.acos(x / 9),
        sp.sinh(x) + sp.cosh(y) - sp.tanh(x * y) + sp.Abs(x - y) - sp.sin(x) * sp.cos(y) + sp.pi * sp.E,
        sp.Max(x, y, p) - sp.Min(x, 2 * y) + x**p - x ** sp.Rational(-1, 3),
        -x - y - 2.5 * p - (x + 1) * (-3),
    ]
    form = Realization(name="all", constraints=(), states=(), definitions=(), rates=(), residuals=tuple(expressions),
                       signals=(x, y), parameters=(p,), values={}, singular=(), radicands=(),
                       equivalent=True)  # fmt: skip
    generator = residual_generator(form)
    signals = {"x": np.array([0.7, 2.3]), "y": np.array([1.9, 0.4])}
    t = np.array([0.0, 1.0])
    run = generator.run(t, signals, {"p": 1.3})
    for k in range(2):
        numbers = {x: signals["x"][k], y: signals["y"][k], p: 1.3}
        exact = [float(e.subs(numbers).evalf(30)) for e in expressions]
        assert run.residual[k] == pytest.approx(exact, rel=1e-12)
    found, _ = run_c(compiled_c(c_source(generator), tmp_path, "all"), generator, t, signals, {"p": 1.3}, ())
    assert np.abs(found / run.residual - 1).max() <= 1e-12


def test_a_negative_radicand_is_flagged_and_not_silent() -> None:
    generator, form = pump_generator("r3")
    t, signals = record(100)
    signals["y_H"] = np.where(np.arange(100) < 50, 4.9e5, 9e5)
    run = generator.run(t, signals, POINT, begin(form))
    assert not run.flags[:50].any()
    assert run.flags[50:].all()
    assert len(generator.radicands) == 1
    stream = generator.stream(POINT, begin(form))
    stream.step([306.0, 4.2, 9e5], 0.0)
    assert stream.flag == 1


def test_wrong_records_are_refused() -> None:
    generator, form = pump_generator("r2")
    t, signals = record(50)
    start = begin(form)
    with pytest.raises(DataError, match="y_Q is missing"):
        generator.run(t, {s: v for s, v in signals.items() if s != "y_Q"}, POINT, start)
    with pytest.raises(DataError, match="nan at sample 7"):
        generator.run(t, signals | {"y_w": np.where(np.arange(50) == 7, np.nan, 306.0)}, POINT, start)
    with pytest.raises(DataError, match="increasing"):
        generator.run(t[::-1], signals, POINT, start)
    with pytest.raises(DataError, match="one length"):
        generator.run(t, signals | {"y_T": signals["y_T"][:-1]}, POINT, start)
    with pytest.raises(ParameterError, match="J is missing"):
        generator.run(t, signals, {n: v for n, v in POINT.items() if n != "J"}, start)
    with pytest.raises(ParameterError, match="must be finite"):
        generator.run(t, signals, POINT | {"B": np.inf}, start)
    with pytest.raises(ParameterError, match="start"):
        generator.run(t, signals, POINT, ())
    stream = generator.stream(POINT, start)
    with pytest.raises(DataError, match="zero for the first"):
        stream.step([306.0, 4.2, 1.6e-3], 0.01)
    with pytest.raises(DataError, match="sample"):
        stream.step([306.0, 4.2], 0.0)
    stream.step([306.0, 4.2, 1.6e-3], 0.0)
    with pytest.raises(DataError, match="positive"):
        stream.step([306.0, 4.2, 1.6e-3], 0.0)


def test_divergence_is_an_error() -> None:
    generator, _form = pump_generator("r4")
    t = np.arange(400) * 5.0  # far beyond what the gain allows
    signals = {"y_T": np.full(400, 4.2), "y_H": np.full(400, 4.9e5), "y_Q": np.full(400, 1.6e-3)}
    with pytest.raises(SimulationError, match=r"not finite.*gain"):
        generator.run(t, signals, POINT, (3.0,))


def test_wrong_settings_are_refused() -> None:
    form = realize(examples.satellite()).require()
    with pytest.raises(ParameterError, match="scheme"):
        residual_generator(form, scheme="exact")  # type: ignore[arg-type]
    with pytest.raises(ParameterError, match="shape"):
        residual_generator(form, gain=[[1.0, 2.0]])
    with pytest.raises(ParameterError, match="correction"):
        residual_generator(form, output="correction")
    with pytest.raises(ParameterError, match="k = "):
        rate_gain(form, -1.0)
    with pytest.raises(ParameterError, match="lacks"):
        linearized_gain(form, {}, 1.0)
    three = realize(examples.three_tanks(), ["e1", "e4", "e5", "e7", "e8", "e9", "e10", "e11"]).require()
    with pytest.raises(ParameterError, match="residuals"):
        identity_gain(three, 1.0)
    with pytest.raises(ParameterError, match="residuals"):
        rate_gain(three, 1.0)
    with pytest.raises(ParameterError, match="do not"):
        with_linear_error(three)
    x = sp.Symbol("x")
    with pytest.raises(ParameterError, match="neither state"):
        straight_line([x], {}, prefix="t", what="r")
    with pytest.raises(ParameterError, match="cannot be written"):
        straight_line([sp.gamma(x)], {x: "x"}, prefix="t", what="r")
