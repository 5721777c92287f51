"""Thesis 5.1-5.3: the figures of the stator chapter show what they are given, with units, and save the same bytes."""

import warnings
from collections.abc import Iterator
from typing import Any

import matplotlib
import numpy as np
import pytest
from matplotlib import pyplot as plt
from matplotlib.figure import Figure
from matplotlib.text import Text

from pumplib.errors import ParameterError
from pumplib.motor.short import Short
from pumplib.motor.short_identify import sector_centres
from pumplib.motor.short_verify import check_trajectory
from pumplib.motor.supply import grid
from pumplib.observers import stator_study
from pumplib.observers.adaptive import FilteredRegressorObserver, simulate_system
from pumplib.observers.adaptive_compare import Row
from pumplib.observers.adaptive_design import direct_gain, motor_structure, polytopic_gain
from pumplib.observers.adaptive_examples import HeatExchanger, heat_exchanger
from pumplib.observers.adaptive_study import lyapunov_run
from pumplib.observers.stator_decision import THRESHOLD
from pumplib.observers.stator_design import speed_range
from pumplib.observers.stator_score import belief
from pumplib.observers.stator_starts import nominal_test, run_up_test
from pumplib.observers.stator_study import (
    Conditions,
    StatorMachine,
    estimation_test,
    identification_test,
    run_test,
    set_up,
    unbalance_test,
)
from pumplib.plots import ch05, ch05_bench, ch05_campaign, style
from pumplib.plots.style import PAGE, save_figure

matplotlib.use("Agg")
MOTOR = belief()


@pytest.fixture(autouse=True)
def _styled() -> Iterator[None]:
    with style():
        yield
    plt.close("all")


def drawn(figure: Figure) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        figure.canvas.draw()
    assert figure.get_size_inches()[0] == PAGE


def words(figure: Figure) -> str:
    return " | ".join(text.get_text() for text in figure.findobj(Text))


def with_units(figure: Figure) -> None:
    for ax in figure.axes:
        if ax.name != "polar" and ax.get_visible() and ax.get_ylabel():
            assert "/" in ax.get_ylabel()
    assert any("/" in ax.get_xlabel() for ax in figure.axes)


@pytest.fixture(scope="module")
def machine() -> StatorMachine:
    return set_up(Conditions(), np.random.default_rng([5, 1]))


@pytest.fixture(scope="module")
def tested(machine: StatorMachine) -> stator_study.Tested:
    return run_test(machine, np.random.default_rng([5, 2]), gamma=0.05, phase="b", test="ramp")


def test_trajectories() -> None:
    shorts = (Short(gamma=(0.0, 0.1, 0.0)),)
    check = check_trajectory(MOTOR, grid(400.0), shorts=shorts, duration=0.02, points=21, rtol=1e-8)
    figure = ch05.trajectories(check, ["star", "triangle"], shown=1)
    drawn(figure)
    with_units(figure)
    np.testing.assert_allclose(figure.axes[1].lines[1].get_ydata(), check.i_f[:, 1])
    assert "triangle" in figure.axes[0].get_title(loc="left")
    with pytest.raises(ParameterError, match="1 names"):
        ch05.trajectories(check, ["star"])


def test_sectors_hold_every_short_of_their_phase() -> None:
    figure = ch05.sectors(MOTOR, 100 * np.pi, gamma=0.05)
    drawn(figure)
    left = figure.axes[0]
    centres = sector_centres(MOTOR.r_s, MOTOR.L_ls, 100 * np.pi)
    lines = [line for line in left.lines if len(line.get_xdata()) > 10]
    assert len(lines) == 9  # three phases, three leakages
    for k, line in enumerate(lines):
        away = np.angle(np.exp(1j * (np.asarray(line.get_xdata()) - centres[k // 3])))
        assert np.abs(away).max() < np.pi / 3
    for word in ("one phase", "tap to tap", r"$\kappa_c$ = 0.5", "ab"):
        assert word in words(figure)


def test_gain_over_speed(machine: StatorMachine) -> None:
    structure = motor_structure(MOTOR, 150.0, 340.0, points=31)
    speeds = np.linspace(*speed_range(MOTOR), machine.certificate.points)
    figure = ch05.gain_over_speed(structure, machine.certificate, MOTOR, speeds)
    drawn(figure)
    with_units(figure)
    shown = {str(line.get_label()): np.asarray(line.get_ydata()) for line in figure.axes[1].lines}
    np.testing.assert_allclose(shown["certified contraction"], machine.certificate.rates)
    assert (shown["slowest mode, with gain"] >= shown["certified contraction"] - 1e-6).all()
    assert shown["slowest mode, $K=0$"].min() < 60.0
    with pytest.raises(ParameterError, match="speeds for"):
        ch05.gain_over_speed(structure, machine.certificate, MOTOR, speeds[1:])


def row(settling: float) -> Row:
    return Row(
        method="x", h=1e-4, slowest=1.0, certified=1.0, speed_settling=settling, short_settling=0.2, speed_noise=0.1,
        short_noise=0.1, speed_error=0.3, short_error=0.1, outcome="settled",
    )  # fmt: skip


def test_gain_value() -> None:
    figure = ch05.gain_value([(row(0.05), row(0.1)), (row(0.07), row(np.inf))], ["none", "some"])
    drawn(figure)
    assert figure.axes[0].lines[0].get_xdata() == pytest.approx([50.0, 70.0])
    assert [text.get_text() for text in figure.axes[0].get_yticklabels()] == ["none", "some"]
    with pytest.raises(ParameterError, match="names"):
        ch05.gain_value([], [])


def test_unobservable() -> None:
    system = heat_exchanger(HeatExchanger())
    u, slow = np.tile([60.0, 15.0], (2000, 1)), np.tile([60.0, 15.0], (40, 1))
    run = lyapunov_run(
        system, direct_gain(system, [50.0], [400.0]), theta=[250.0], rates=[0.5], u=u, h=0.02, x0=[40, 30],
        x_guess=[20, 20], theta_guess=[100.0],
    )  # fmt: skip
    x, y = simulate_system(system, [250.0], slow, 1.0, [40, 30])
    gain = polytopic_gain(system, [50.0], [400.0], h=1.0, decay_rate=0.1)
    observer = FilteredRegressorObserver(system=system, K=gain.K, noise=1.0, lags=[20.0], spread=[50.0])  # type: ignore[arg-type]
    figure = ch05.unobservable(run, observer.run(slow, y, 1.0, x0=[20, 20], theta0=[100.0]), x, 250.0)
    drawn(figure)
    with_units(figure)
    np.testing.assert_allclose(figure.axes[0].lines[0].get_ydata(), x[:, 0].real)


def test_traces_mark_fault_and_alarms(machine: StatorMachine, tested: stator_study.Tested) -> None:
    figure = ch05_bench.traces(tested, machine)
    drawn(figure)
    with_units(figure)
    assert tested.alarm is not None
    assert f"alarm, {1e3 * (tested.alarm - 1.0):.0f} ms" in words(figure)
    assert "fast alarm" in words(figure)
    for ax in figure.axes:  # the fault is marked in every panel
        assert any(np.allclose(line.get_xdata(), 1.0) for line in ax.lines)


def test_traces_of_a_healthy_run_have_no_marks(machine: StatorMachine) -> None:
    figure = ch05_bench.traces(run_test(machine, np.random.default_rng([5, 3])), machine)
    drawn(figure)
    assert "alarm" not in words(figure)
    assert "| fault |" not in words(figure)


def test_traces_are_byte_stable(machine: StatorMachine, tested: stator_study.Tested, tmp_path: Any) -> None:
    first, second = (
        [path.read_bytes() for path in save_figure(ch05_bench.traces(tested, machine), tmp_path / name, "ch05_traces")]
        for name in "ab"
    )
    assert first == second


def test_identification_counts_what_was_said(machine: StatorMachine) -> None:
    tests = identification_test(machine, np.random.default_rng([5, 4]), gamma=0.05, repeats=2)
    figure = ch05_bench.identification(tests, MOTOR)
    drawn(figure)
    for word in ("healthy, no alarm: 2 of 2", "short in a, so said: 2 of 2", "short in c and a, so said: 2 of 2"):
        assert word in words(figure)
    with pytest.raises(ParameterError, match="no test"):
        ch05_bench.identification([], MOTOR)


def test_estimation_shows_intervals_and_turns(machine: StatorMachine) -> None:
    tests = estimation_test(machine, np.random.default_rng([5, 5]), (0.03, 0.06), phase="c")
    figure = ch05_bench.estimation(tests, tests[:1])
    drawn(figure)
    with_units(figure)
    line = next(one for one in figure.axes[0].lines if one.get_marker() == "x")
    np.testing.assert_allclose(line.get_ydata(), [100 * one.known.gamma for one in tests])
    assert "turns / -" in words(figure)
    with pytest.raises(ParameterError, match="no test found a size"):
        ch05_bench.estimation(estimation_test(machine, np.random.default_rng([5, 6]), (0.0,)))


def test_unbalance(machine: StatorMachine) -> None:
    pairs = unbalance_test(machine, np.random.default_rng([5, 7]), (0.0, 0.02), gamma=0.05)
    figure = ch05_bench.unbalance(pairs)
    drawn(figure)
    with_units(figure)
    left, right = figure.axes
    np.testing.assert_allclose(left.lines[0].get_xdata(), [0.0, 2.0], atol=1e-9)
    np.testing.assert_allclose(left.lines[1].get_ydata(), [one.raw_I2 for _, one in pairs])
    assert np.allclose(right.lines[2].get_ydata(), THRESHOLD)
    with pytest.raises(ParameterError, match="pair"):
        ch05_bench.unbalance([])


def test_run_up_and_accuracy(machine: StatorMachine) -> None:
    figure = ch05_bench.run_up(run_up_test(machine, np.random.default_rng([5, 8]), duration=2.0))
    drawn(figure)
    assert "restart" in words(figure)
    nominal = nominal_test(Conditions(), duration=2.0)
    figure = ch05_bench.accuracy([nominal], ["10 kHz"])
    drawn(figure)
    with_units(figure)
    with pytest.raises(ParameterError, match="names"):
        ch05_bench.accuracy([nominal], [])
    with pytest.raises(ParameterError, match="no start"):
        ch05_bench.run_up([])


def campaign_row(**words_: Any) -> dict[str, Any]:
    main = {"records": 1, "accuracy": "A", "connection": "Y", "rate": 1e4, "supply": "grid"}
    fault = {"gamma": 0.02, "r_f": 0.0, "loop": "phase", "test": "drawn", "detector": "decision"}
    return {**main, **fault, "runs": 4, "hits": 3, "share": 0.75, "low": 0.2, "high": 0.99, **words_}


def test_detection() -> None:
    rows = [
        campaign_row(), campaign_row(gamma=0.01, share=0.2, low=0.1, high=0.5), campaign_row(detector="raw I2"),
        campaign_row(connection="delta"), campaign_row(r_f=0.1, share=0.1, low=0.0, high=0.3),
    ]  # fmt: skip
    figure = ch05_campaign.detection(rows)
    drawn(figure)
    with_units(figure)
    assert "raw I2" in words(figure)
    assert "delta" in words(figure)
    assert figure.axes[0].lines[0].get_ydata() == pytest.approx([20.0, 75.0])  # neither delta nor contact resistance
    with pytest.raises(ParameterError, match="bolted"):
        ch05_campaign.detection(rows[-1:])


def test_size_error() -> None:
    size = {"resistance": "known", "median": 0.01, "low": -0.05, "high": 0.06}
    rows = [campaign_row(**size), campaign_row(**{**size, "resistance": "not known"}, r_f=0.1)]
    figure = ch05_campaign.size_error(rows)
    drawn(figure)
    with_units(figure)
    assert "contact resistance" in words(figure)
    with pytest.raises(ParameterError, match="bolted"):
        ch05_campaign.size_error(rows[1:])
