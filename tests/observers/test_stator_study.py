"""Thesis 5.3: the tests on one machine return what was there, decide from measurements only, and repeat."""

from dataclasses import replace

import numpy as np
import pytest

from pumplib.errors import ParameterError
from pumplib.motor.short_identify import g_of_gamma
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


@pytest.fixture(scope="module")
def machine() -> StatorMachine:
    return set_up(Conditions(), np.random.default_rng([7, 3]))


def rng(k: int) -> np.random.Generator:
    return np.random.default_rng([7, 4, k])


def test_gain_is_certified_and_alarm_is_tuned_above_the_healthy_mean(machine: StatorMachine) -> None:
    assert machine.certificate.decay >= 60.0
    assert machine.healthy.records == 1
    assert machine.fast_alarm.mean < 0.01


@pytest.mark.parametrize(("phase", "test"), [("a", "steady"), ("b", "ramp"), ("c", "torque_step")])
def test_a_short_is_found_after_its_onset_in_its_phase(machine: StatorMachine, phase: str, test: str) -> None:
    done = run_test(machine, rng(1), gamma=0.05, phase=phase, test=test)
    assert done.onset == 1.0
    assert done.verdict.alarm
    assert done.verdict.phase == phase
    assert done.alarm is not None
    assert done.fast_alarm is not None
    assert 1.0 < done.fast_alarm < done.alarm < 1.5
    assert done.verdict.interval[0] < 0.06
    assert done.verdict.interval[1] > 0.04
    late = done.estimates.t > 1.0
    assert (done.g_true[~late] == 0).all()
    # the wide line of the figure is near what the observer finds, less the healthy machine's share
    d = np.mean(done.estimates.g_c[-500:]) - machine.healthy.predict(done.window)[0]
    assert abs(d - done.g_true[-1]) < 0.2 * abs(done.g_true[-1])


def test_true_coefficient_of_the_believed_machine_is_the_closed_form(machine: StatorMachine) -> None:
    plant = machine.bench.machine
    ideal = replace(plant, base=replace(plant.base, motor=machine.motor), kappa_c=1.0, asymmetry=(0.0, 0.0, 0.0))
    done = run_test(replace(machine, bench=replace(machine.bench, machine=ideal)), rng(2), gamma=0.02, phase="a")
    warm = done.truth["r_s"][-1]
    expected = float(g_of_gamma(0.02, "Y")) / 3
    w_s, motor = 2 * np.pi * done.truth.frequency[-1], machine.motor
    ratio = np.conj((motor.r_s + 1j * w_s * motor.L_ls) / (warm * motor.r_s + 1j * w_s * motor.L_ls))
    assert done.g_true[-1] == pytest.approx(expected * ratio, rel=1e-6)


def test_healthy_run_is_silent_and_has_no_onset(machine: StatorMachine) -> None:
    done = run_test(machine, rng(3))
    assert done.onset is None
    assert not done.verdict.alarm
    assert done.alarm is None
    assert done.fast_alarm is None
    assert (done.g_true == 0).all()


def test_same_generator_same_bits(machine: StatorMachine) -> None:
    first, second = (run_test(machine, rng(4), gamma=0.02) for _ in range(2))
    np.testing.assert_array_equal(first.estimates.rows, second.estimates.rows)
    assert first.verdict == second.verdict


def test_identification_has_healthy_phases_and_pairs(machine: StatorMachine) -> None:
    tests = identification_test(machine, rng(5), gamma=0.05, repeats=1)
    there = [one.course.fault.phase if one.course.fault else "none" for one in tests]
    assert there == ["none", "a", "b", "c", "ab", "bc", "ca"]
    assert [one.verdict.phase for one in tests[1:]] == there[1:]
    assert not tests[0].verdict.alarm


def test_estimates_grow_with_the_size_and_fall_with_contact_resistance(machine: StatorMachine) -> None:
    bolted = [one.verdict.gamma for one in estimation_test(machine, rng(6), (0.02, 0.05, 0.1), phase="b")]
    assert np.all(np.diff(bolted) > 0)
    np.testing.assert_allclose(bolted, (0.02, 0.05, 0.1), rtol=0.35)
    (resistive,) = estimation_test(machine, rng(6), (0.1,), phase="b", r_f=0.5)
    r_s = machine.motor.r_s
    assert resistive.verdict.gamma == pytest.approx(0.1 / (1 + 0.5 / (0.1 * r_s)), rel=0.3)


def test_unbalance_is_what_was_asked_for_and_moves_only_the_raw_current(machine: StatorMachine) -> None:
    pairs = unbalance_test(machine, rng(7), (0.0, 0.03), gamma=0.03)
    assert [abs(one.course.negative) for one, _ in pairs] == pytest.approx([0.0, 0.03])
    (calm, _), (rough, _) = pairs
    assert rough.raw_I2 > 10 * calm.raw_I2
    assert not calm.verdict.alarm
    assert not rough.verdict.alarm
    assert all(short.verdict.alarm for _, short in pairs)


def test_delta_inverter_slow_sampling_and_class_B() -> None:
    conditions = Conditions(connection="delta", supply="inverter", rate=2000.0, accuracy="B", records=2)
    machine = set_up(conditions, rng(8))
    done = run_test(machine, rng(9), gamma=0.05, phase="c")
    assert done.verdict.phase == "c"
    assert done.signals.rate == 2000.0
    assert machine.healthy.records == 2
    # the winding keeps its voltage: that of the line is smaller by the square root of three
    assert done.course.supply.amplitude == pytest.approx(325.0 / np.sqrt(3))


def test_run_up_trusts_only_what_is_right(machine: StatorMachine) -> None:
    for start in run_up_test(machine, rng(10)):
        assert start.estimates.trusted[-1]
        assert start.omega[0] < 50.0
        assert start.trusted_error < 5.0
        assert abs(start.estimates.omega[-1] - start.omega[-1]) < 2.0


def test_nominal_accuracy() -> None:
    g, speed = nominal_test(Conditions(), phase="b", duration=4.0).worst()
    assert g < 1e-5
    assert speed < 1e-4


@pytest.mark.parametrize(
    ("words", "match"),
    [
        ({"phase": "d"}, "must be one of a, b, c"),
        ({"gamma": -0.1}, "gamma"),
        ({"gamma": 0.02, "onset": 1.8}, "must leave 0.5 s"),
    ],
)
def test_bad_arguments(machine: StatorMachine, words: dict[str, object], match: str) -> None:
    with pytest.raises(ParameterError, match=match):
        run_test(machine, rng(11), **words)  # type: ignore[arg-type]


def test_more_bad_arguments(machine: StatorMachine) -> None:
    with pytest.raises(ParameterError, match="gamma"):
        identification_test(machine, rng(12), gamma=0.0)
    with pytest.raises(ParameterError, match="repeats"):
        identification_test(machine, rng(12), gamma=0.02, repeats=0)
    with pytest.raises(ParameterError, match="phase"):
        nominal_test(Conditions(), phase="ab")
    with pytest.raises(ParameterError, match="rate"):
        Conditions(rate=100.0)
