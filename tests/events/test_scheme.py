"""The scheme on one machine of the bench: quiet when healthy, the right group when not; features, thresholds, rows."""

from dataclasses import replace

import numpy as np
import pytest

from pumplib.campaign import events
from pumplib.errors import DataError, ParameterError
from pumplib.events.features import SIGNALS, _load, _mean, _since, features
from pumplib.events.scheme import EventSettings, pump_table, teach_events


@pytest.fixture(scope="module")
def machine():
    return events.set_up("pump", np.random.default_rng([4, 4, 2]))


def test_moving_averages_are_a_convolution():
    x = np.random.default_rng(0).standard_normal(200) + 1j
    box = np.ones(7) / 7
    for stages in (1, 2, 4):
        kernel = np.ones(1)
        for _ in range(stages):
            kernel = np.convolve(kernel, box)
        assert np.allclose(_mean(x, 7, stages), np.convolve(x, kernel)[:200])


def test_quiet_time_after_an_event():
    event = np.zeros(20, bool)
    event[5] = True
    assert np.flatnonzero(_since(event, 4)).tolist() == [4, *range(10, 20)]


def test_load_torque_takes_the_inertia_off():
    dt, J = 1e-3, 0.006
    t = dt * np.arange(4000)
    omega = 200.0 + 60.0 * np.clip(t - 1.0, 0.0, 1.0)
    load = 2.0 + 0.001 * omega
    T_e = load + J * np.gradient(omega, dt)
    found = _load(omega, T_e, J, dt)
    assert found[900] == pytest.approx(load[900], rel=1e-6)
    # in the middle of the ramp the motor gives 0.36 N m for the inertia, the load does not show it
    assert T_e[1800] - load[1800] == pytest.approx(0.36, rel=1e-6)
    assert abs(found[1800] - load[1800]) < 0.02


def test_table_has_the_signals(machine):
    table = pump_table()
    assert set(SIGNALS) <= set(table.signals)
    assert table.covered == tuple(f"G{k}" for k in range(1, 7))


@pytest.mark.parametrize("disturbance", ["none", "unbalance drift", "supply step"])
def test_healthy_machine_is_not_accused(machine, disturbance):
    row = events.score_one(machine, "", disturbance, np.random.default_rng(7))
    assert row["false_alarm"] == row["detected"] == 0
    assert row["acted"] == row["final"] == row["group"] == "none"
    assert row["correct"] == 1
    assert row["delay"] is row["group_delay"] is None


@pytest.mark.parametrize(
    ("text", "group"),
    [("inter_turn:0.02", "G1"), ("rub:1e-3", "G2"), ("bearing:0.3", "G2"), ("clogging:4e10", "G3"),
     ("leakage:4e-7", "G4"), ("outlet_leak:4e-7", "G4"), ("cavitation:0.15", "G5"), ("dry_running:0.9", "G6")],
)  # fmt: skip
def test_clear_faults_are_named(machine, text, group):
    row = events.score_one(machine, text, "none", np.random.default_rng(11))
    assert row["group"] == row["acted"] == group
    assert row["correct"] == 1
    assert row["false_alarm"] == 0
    assert 0 < row["delay"] <= row["group_delay"] < 8.0


def test_dry_running_is_latched_at_once(machine):
    _, fault = events.parse_fault("dry_running:0.9")
    told, onset = events.judge_one(machine, fault, "none", np.random.default_rng(3))
    certain = np.array([one.certain("G6") for one in told.decisions.verdicts])
    first = np.flatnonzero(told.decisions.latched)[0]
    assert 0 < told.t[first] - onset < 2.0
    assert certain[told.decisions.verdict[first]]
    assert not certain[told.decisions.verdict[:first]].any()
    assert told.decisions.latched[first:].all()


def test_head_threshold_belongs_to_the_torque_threshold(machine):
    # a leakage or clogging that moves the torque by its threshold moves the head by `balance` shares of its own
    scheme = machine.scheme
    bench = events.run(events.load_scenario("pump_healthy"), np.random.default_rng(0), machine.bench)
    f = features(*events._seen(bench), scheme.monitor)
    kappa = scheme.thresholds(f)
    still = f.rest[:, 4] & (f.activity < 0.01)
    learned = scheme.monitor.threshold.at(f.activity)
    assert still.any()
    expected = np.maximum(scheme.settings.balance * scheme.monitor.threshold.k0[1] * f.exchange, learned[:, 0])
    assert np.allclose(kappa[still, 4], expected[still])
    belief = scheme.monitor.belief
    # exchange is dH/dT along the map: by differences
    k = np.flatnonzero(still)[0]
    w, Q, dQ = 250.0, 1e-3, 1e-7
    slope = (belief.head(np.array(Q + dQ), np.array(w)) - belief.head(np.array(Q - dQ), np.array(w))) / (
        belief.torque(np.array(Q + dQ), np.array(w)) - belief.torque(np.array(Q - dQ), np.array(w))
    )
    s_H, s_T = 2 * belief.a_h2 * Q - belief.a_h1 * w, belief.a_t1 * w - 2 * belief.a_t2 * Q
    assert -float(slope) == pytest.approx(s_H / s_T, rel=1e-4)
    assert np.isfinite(f.exchange[k])
    assert (kappa[np.isfinite(kappa)] > 0).all()


def test_row_depends_on_the_generator_only(machine):
    one, again = (events.score_one(machine, "clogging:2e10", "none", np.random.default_rng(5)) for _ in range(2))
    assert one == again


def test_teaching_needs_thresholds_and_rest(machine):
    bare = replace(machine.scheme.monitor, threshold=None)
    with pytest.raises(DataError, match="no thresholds"):
        teach_events(bare, [])
    with pytest.raises(DataError, match="fewer than"):
        teach_events(machine.scheme.monitor, [])
    with pytest.raises(ParameterError, match="margin"):
        EventSettings(margin=0.5)


def test_campaign_refusals():
    with pytest.raises(ParameterError, match="kind:size"):
        events.EventCampaign(faults=("clogging",))
    with pytest.raises(ParameterError, match="must be one of inter_turn"):
        events.EventCampaign(faults=("gremlin:1",))
    with pytest.raises(ParameterError, match="disturbance"):
        events.EventCampaign(disturbances=("moon",))
    with pytest.raises(ParameterError, match="nothing to score"):
        events.EventCampaign(healthy=0)
    assert events.parse_fault("bearing:0.2")[1].drag == pytest.approx(5e-4)
    assert events.parse_fault("rub:1e-3")[1].ripple == pytest.approx(0.1)
    assert events.parse_fault("inter_turn:0.01", "c")[1].phase == "c"
