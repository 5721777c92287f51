"""The steady-state monitor on the bench: points, commissioning, what it says about healthy and faulty runs."""

from dataclasses import replace

import numpy as np
import pytest

from pumplib.errors import DataError, ParameterError
from pumplib.machines.profiles import load_profile, profile_machine
from pumplib.steady.bench_monitor import MonitorSettings, commission, points_of, pump_statement, teach
from pumplib.testbench.data_sheets import sensor_spreads
from pumplib.testbench.faults import Fault
from pumplib.testbench.run import draw_bench, run
from pumplib.testbench.scenario import load_scenario
from pumplib.testbench.slow import SlowSignals

STATEMENT = pump_statement(profile_machine("pump").motor, sensor_spreads(load_profile("pump")))
FAULTS = {"leakage": 2.4e-7, "friction": 5e-4, "dry_running": 1.0}


@pytest.fixture(scope="module")
def bench():
    return draw_bench("pump", np.random.default_rng([70, 1]))


@pytest.fixture(scope="module")
def runs(bench):
    healthy, found = load_scenario("pump_healthy"), {}
    for k, name in enumerate(("first", "second", *FAULTS)):
        fault = Fault(kind=name, size=FAULTS[name]) if name in FAULTS else None
        found[name] = run(replace(healthy, fault=fault), np.random.default_rng([70, 2, k]), bench)
    return found


@pytest.fixture(scope="module")
def slow(runs):
    return {name: one.slow(0.2, 0.2) for name, one in runs.items()}


@pytest.fixture(scope="module")
def monitor(slow):
    return commission(slow["first"], STATEMENT)


def made(t, **channels):
    n = len(t)
    base = {"V_rms": 230.0, "I_rms": 2.5, "omega_e": 314.0, "phi": 0.6, "H": 4e5, "Q": 1e-3} | channels
    full = {name: np.broadcast_to(np.asarray(x, dtype=float), (n,)).copy() for name, x in base.items()}
    zero = np.zeros(n)
    return SlowSignals(t=t, **full, missing_electrical=zero, missing_H=zero, missing_Q=zero, max_missing=0.1)


def test_statement_takes_biases_and_lags_from_the_sheets():
    absolute, relative, share = STATEMENT.errors.bounds(("H", "Q", "I_rms", "phi"))
    assert (absolute * share)[:2] == pytest.approx([1500.0, 8e-6])
    assert (relative * share)[2] == pytest.approx(0.003)
    assert share[3] == 0.0
    assert STATEMENT.lags == {"H": 0.05, "Q": 0.15}
    with pytest.raises(ParameterError, match="no sheet of pressure, flow, current"):
        pump_statement(profile_machine("pump").motor, {})


def test_points_do_not_overlap_and_undo_the_lag_of_a_ramp():
    t = 0.1 + 0.2 * np.arange(60)
    true = 1e-3 + 1e-5 * t  # the sensor shows it late by its lag
    points = points_of(made(t, Q=true - 1e-5 * 0.15), STATEMENT.lags)
    assert len(points) == 12
    assert points.t - points.start == pytest.approx(np.full(12, 1.0))
    assert (np.diff(points.t) >= 1.0 - 1e-9).all()
    # the first of five windows is left out of the mean
    assert points.signals["Q"] == pytest.approx(1e-3 + 1e-5 * (points.t - 0.4), rel=1e-9)


def test_points_leave_changes_and_gaps_out_unless_told():
    t = 0.1 + 0.2 * np.arange(40)
    step = made(t, H=np.where(t < 4.0, 4e5, 3e5))
    settled = points_of(step, STATEMENT.lags)
    inside = (settled.start < 4.0) & (settled.t > 4.0)
    assert len(settled) == 8 or not inside.any()
    assert not inside.any()
    every = points_of(step, STATEMENT.lags, steady=False)
    assert len(every) == 8
    hole = made(t, H=np.where(np.abs(t - 4.0) < 0.15, np.nan, 4e5))
    for steady in (True, False):
        found = points_of(hole, STATEMENT.lags, steady=steady)
        assert np.isfinite(found.signals["H"]).all()
        assert not ((found.start < 3.95) & (found.t > 4.05)).any()


def test_points_need_all_channels_and_settings_that_fit():
    t = 0.1 + 0.2 * np.arange(20)
    with pytest.raises(DataError, match="Q missing"):
        points_of(replace(made(t), Q=None), STATEMENT.lags)
    with pytest.raises(ParameterError, match="fewer than two"):
        MonitorSettings(samples=5, settle=4)


def test_commissioning_needs_no_margin_and_holds_the_true_pump(monitor, bench):
    assert monitor.margin == (0.0, 0.0)
    assert monitor.identified.factor <= 1.0
    # strict and not strict are the same then
    center = dict(zip(monitor.identified.guaranteed.names, monitor.identified.guaranteed.center, strict=True))
    radius = dict(zip(monitor.identified.guaranteed.names, monitor.identified.guaranteed.radius, strict=True))
    pump = bench.machine.base.pump
    # the casing loss belongs to the map that the sensors see
    assert abs(pump.a_h0 * pump.stages - center["a_h0"]) <= radius["a_h0"]
    assert abs(pump.a_t1 * pump.stages - center["a_t1"]) <= radius["a_t1"]


def test_a_healthy_run_has_no_alarm_but_has_without_the_detector(monitor, slow):
    said = monitor.judge(slow["second"])
    assert len(said.points) >= 8
    for method in ("plain", "single", "window"):
        assert not len(said.alarms(method))
    assert said.possible == ()
    assert said.signs == ""
    assert monitor.moving_alarm(slow["second"])
    with pytest.raises(ParameterError, match="method"):
        said.alarms("moving")


@pytest.mark.parametrize(("kind", "name"), [("leakage", "K_l"), ("friction", "dB")])
def test_a_large_fault_is_found_named_and_sized(monitor, slow, runs, kind, name):
    said, onset = monitor.judge(slow[kind]), runs[kind].course.fault.onset
    for method in ("single", "window"):
        times = said.alarms(method)
        assert onset <= times[0] <= onset + 6.0
    # what a point alone shows, a window shows too
    assert set(said.alarms("single")) <= set(said.alarms("window"))
    assert said.signs == name
    assert said.possible == (name,)
    low, high = said.verdicts[name].size
    assert low <= FAULTS[kind] <= high
    assert high - low < FAULTS[kind]
    assert said.single_at >= said.alarms("window")[0]
    # points on which the hypotheses stand begin after the first alarm
    assert said.tested <= (said.points.start >= said.alarms("window")[0] - 1e-9).sum()


def test_a_pump_run_dry_is_named_although_there_is_no_head(monitor, slow, runs):
    said = monitor.judge(slow["dry_running"])
    assert said.alarms("single")[0] >= runs["dry_running"].course.fault.onset
    assert said.signs == "f_d"


def test_teaching_changes_nothing_if_all_is_explained_and_else_explains(monitor, slow):
    assert teach(monitor, [slow["second"]]) is monitor
    # a transmitter that reads 3 kPa more than its sheet allows to change
    other = replace(slow["second"], H=slow["second"].H + 3000.0)
    points = monitor.points(other).signals
    assert monitor.unexplained(points)
    taught = teach(monitor, [other])
    assert taught.margin[0] > 0
    assert not taught.unexplained(points)
    assert not taught.unexplained(monitor.points(slow["second"]).signals)


def test_a_commissioning_run_that_contradicts_itself_is_refused(slow):
    rng = np.random.default_rng(2)
    # each operating point with another error of several per cent
    held = np.repeat(rng.uniform(-0.06, 0.06, len(slow["first"].t) // 13 + 1), 13)[: len(slow["first"].t)]
    wrong = replace(slow["first"], H=slow["first"].H * (1 + held))
    with pytest.raises(DataError, match="explain"):
        commission(wrong, STATEMENT, strict=True)
    assert commission(wrong, STATEMENT).margin[0] > 1000.0
