"""Residuals by differentiation: exact derivatives, and the noise beside that of the realization."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sympy as sp

from pumplib.errors import DataError, ParameterError
from pumplib.structure import examples
from pumplib.structure.derivative import NoiseRow, derivative_residual, low_pass, noise_rows
from pumplib.structure.mso import mso_sets
from pumplib.structure.realization import realize
from pumplib.structure.realization_noise import noise_study, pump_case, satellite_case

PUMP = {"J": 0.006, "B": 3.3e-4, "K_Q": 40.0, "a_t0": 1.67e-5, "a_t1": 6.04, "a_t2": 2e5}


def by_method(rows: tuple[NoiseRow, ...]) -> dict[str, NoiseRow]:
    return {row.method: row for row in rows}


def test_derivative_residual_of_the_satellite() -> None:
    model = examples.satellite()
    found = derivative_residual(model)
    y1, y2, u_2, theta = (model.symbol(n) for n in ("y1", "y2", "u_2", "theta_2"))
    rate = {s: r for r, s in found.rates.items()}
    expected = rate[y2] + 2 * rate[y1] * y2 / y1 - theta * u_2 / y1
    assert sp.simplify(found.expression - expected) == 0


@pytest.mark.parametrize("difference", ["backward", "central"])
def test_difference_quotients_converge_with_their_order_on_clean_signals(difference: str) -> None:
    errors = []
    for dt in (0.01, 0.005):
        case = satellite_case()
        t = np.arange(0.0, 10.0, dt)
        residual = case.derivative.evaluate(t, case.signals(t), case.parameters, difference)  # type: ignore[arg-type]
        errors.append(np.abs(residual[2:-2]).max())
    order = np.log2(errors[0] / errors[1])
    assert order == pytest.approx(1.0 if difference == "backward" else 2.0, abs=0.1)


def test_the_realization_is_quiet_on_clean_signals_also_with_irregular_steps() -> None:
    for case in (satellite_case(), pump_case(PUMP)):
        rows = by_method(noise_rows(case, 0.01, 0.0, np.random.default_rng(1), duration=30.0, jitter=0.5))
        assert rows["realization"].std < 2e-3
        assert rows["backward, nominal step, filtered"].std > 20 * rows["realization"].std


def test_low_pass_is_exact_for_a_step_between_irregular_samples() -> None:
    t = np.cumsum(np.random.default_rng(2).uniform(0.01, 0.3, 200))
    expected = 1 - np.exp(-2.0 * (t - t[0]))
    assert low_pass(t, np.ones_like(t), 2.0) == pytest.approx(expected, abs=1e-12)


def test_noise_and_bias_of_the_satellite_follow_their_formulas() -> None:
    case, dt, sigma = satellite_case(), 1e-3, 1e-2
    rows = by_method(noise_rows(case, dt, sigma, np.random.default_rng(3)))
    # n_k enters 2 omega / rho as itself and through 1/rho: mean of the product -2 omega sigma^2 / (rho^2 dt).
    t = np.arange(10.0, 200.0, 0.01)
    clean = case.signals(t)
    expected = np.mean(-2 * clean["y2"] / clean["y1"] ** 2) * sigma**2 / dt
    biased = rows["backward, filtered"]
    assert biased.bias == pytest.approx(expected, rel=0.05)
    assert abs(biased.bias) > 5 * rows["realization"].std
    assert abs(rows["realization"].bias) < 4 * rows["realization"].bias_error
    # Raw differences: white noise over the step; the realization passes it with its own rate only.
    assert rows["backward, raw"].ratio == pytest.approx(np.sqrt(2) / (case.rate * dt), rel=0.05)
    # Central differences average two samples before the filter: less noise by the root of two, and no bias.
    assert rows["central, filtered"].ratio == pytest.approx(np.sqrt(0.5), rel=0.05)
    assert abs(rows["central, filtered"].bias) < 4 * rows["central, filtered"].bias_error


def test_constant_coefficients_leave_no_noise_advantage_but_irregular_sampling_does() -> None:
    case = pump_case(PUMP, noisy="y_w")
    regular = by_method(noise_rows(case, 1e-3, 0.1, np.random.default_rng(4), duration=100.0))
    assert regular["backward, filtered"].ratio == pytest.approx(1.0, abs=0.02)
    assert regular["central, filtered"].ratio == pytest.approx(np.sqrt(0.5), rel=0.05)
    uneven = by_method(noise_rows(case, 1e-3, 0.1, np.random.default_rng(5), duration=100.0, jitter=0.5))
    assert uneven["backward, filtered"].ratio == pytest.approx(1.0, abs=0.02)
    assert uneven["backward, nominal step, filtered"].ratio > 2.0
    assert uneven["central, filtered"].ratio > 1.2


def test_the_table_has_every_case_and_is_reproducible() -> None:
    def table() -> tuple[NoiseRow, ...]:
        return noise_study(PUMP, np.random.default_rng(6), steps=(0.02,), duration=30.0)

    rows = table()
    assert len(rows) == 4 * 2 * 7
    assert rows == table()
    assert {row.sampling for row in rows} == {"regular", "irregular"}


def test_wrong_input_is_refused() -> None:
    case = satellite_case()
    t = np.arange(0.0, 1.0, 0.1)
    signals = case.signals(t)
    with pytest.raises(ParameterError, match="difference"):
        case.derivative.evaluate(t, signals, case.parameters, "forward")  # type: ignore[arg-type]
    with pytest.raises(DataError, match="three increasing"):
        case.derivative.evaluate(t[::-1], signals, case.parameters)
    with pytest.raises(DataError, match="y1"):
        case.derivative.evaluate(t, signals | {"y1": signals["y1"] * np.nan}, case.parameters)
    with pytest.raises(ParameterError, match="theta_2"):
        case.derivative.evaluate(t, signals, {})
    with pytest.raises(ParameterError, match="jitter"):
        noise_rows(case, 0.01, 1e-3, np.random.default_rng(0), jitter=1.0)
    with pytest.raises(ParameterError, match="rate"):
        low_pass(t, t, 0.0)
    with pytest.raises(DataError, match="one length"):
        low_pass(t, t[:-1], 1.0)
    with pytest.raises(ParameterError, match="K_Q"):
        pump_case({name: v for name, v in PUMP.items() if name != "K_Q"})
    model = examples.three_tanks()
    hidden = next(c for c in mso_sets(model.structure()) if realize(model, c).ok and len(c) == 11)
    with pytest.raises(ParameterError, match="without a derivative"):
        derivative_residual(model, hidden)


@pytest.mark.filterwarnings("ignore")  # of the oracle's own imports
def test_backward_differences_are_what_the_published_toolbox_generates(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    toolbox = pytest.importorskip("faultdiagnosistoolbox")
    monkeypatch.chdir(tmp_path)  # the code is written to the current folder
    names = {"x": ["rho", "omega", "v", "drho", "domega"], "f": ["f1"], "z": ["u_2", "y1", "y2"]}
    rho, omega, v, drho, domega = sp.symbols(names["x"])
    u_2, y1, y2, f1, theta = sp.symbols("u_2 y1 y2 f1 theta_2")
    relations = [
        drho - v,
        domega + 2 * v * omega / rho - theta * u_2 / rho + f1,
        -y1 + rho,
        -y2 + omega,
        toolbox.DiffConstraint("drho", "rho"),
        toolbox.DiffConstraint("domega", "omega"),
    ]
    model = toolbox.DiagnosisModel(
        {"type": "Symbolic", **names, "parameters": ["theta_2"], "rels": relations}, name="satellite"
    )
    model.SeqResGen(model.Matching([0, 2, 3, 4, 5]), 1, "oracle", batch=False)
    written: dict[str, Any] = {}
    exec((tmp_path / "oracle.py").read_text(), written)
    case = satellite_case()
    t = np.arange(500) * 0.02
    signals = case.signals(t)
    signals["y1"] = signals["y1"] + 1e-3 * np.random.default_rng(7).standard_normal(len(t))
    state, theirs = {"rho": signals["y1"][0], "omega": signals["y2"][0]}, np.empty(len(t))
    for k in range(len(t)):
        sample = [signals[s][k] for s in names["z"]]
        theirs[k], state = written["oracle"](sample, state, {"theta_2": 1.0}, 0.02)
    ours = case.derivative.evaluate(t, signals, case.parameters, "backward")
    assert ours[1:] == pytest.approx(theirs[1:], abs=1e-10)
