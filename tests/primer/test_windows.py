"""What the monitor sees: speed and torque without a speed sensor, lags that match, truth that stays outside."""

import dataclasses
import inspect
import math

import numpy as np
import pytest

from pumplib import primer
from pumplib.errors import DataError, ParameterError
from pumplib.machines.profiles import profile_machine
from pumplib.primer import Example, Machine, delayed, steady_speed, windows
from pumplib.primer.windows import FLOW_LAG, STEP

MOTOR = profile_machine("pump").motor


def phasors(motor, slip_frequency: float, omega_e: float, I: float):
    """Terminal phasors of the T circuit of the model in steady state, from the rotor side."""
    I_m = I / (1 + 1j * slip_frequency * motor.L_m_prime / motor.R_r_prime)
    E = 1j * omega_e * motor.L_m_prime * I_m
    V = E + (motor.r_s + 1j * omega_e * motor.L_s_prime) * I
    torque = 1.5 * motor.z_p * motor.L_m_prime * (np.conj(I_m) * I).imag
    return abs(V) / math.sqrt(2), I / math.sqrt(2), np.angle(V), torque


@pytest.mark.parametrize("factor", [0.5, 1.0, 1.3])
def test_speed_and_torque_are_exact_in_steady_state_whatever_the_main_inductance(factor: float) -> None:
    other = dataclasses.replace(MOTOR, L_m=factor * MOTOR.L_m)
    # the same R_r' and L_s', so that only the main inductance differs
    scaled = [dataclasses.replace(MOTOR), other]
    for true in scaled:
        V, I, phi, torque = phasors(true, 9.0, 2 * math.pi * 45, 4.0)
        omega, found = steady_speed([V], [I], [2 * math.pi * 45], [phi], true)
        assert omega[0] == pytest.approx((2 * math.pi * 45 - 9.0) / true.z_p, rel=1e-12)
        assert found[0] == pytest.approx(torque, rel=1e-12)


def test_speed_error_on_healthy_runs(healthy: list[Example]) -> None:
    for one in healthy:
        true = delayed(np.interp(one.w.t, one.run.truth.t, one.run.truth["omega"]), FLOW_LAG)
        error = np.abs(one.w.omega - true)
        assert error.max() < 1.2  # rad/s, of 190 to 310, through all changes
        assert error[one.w.rest].mean() < 0.4


def test_torque_error_on_healthy_runs(healthy: list[Example]) -> None:
    for one in healthy:
        true = np.interp(one.w.t, one.run.truth.t, one.run.truth["T_e"])
        error = np.abs(one.w.torque - delayed(true, FLOW_LAG))[one.w.rest]
        assert error.mean() < 0.1  # N m, of 1.5 to 4.5: iron loss and temperature are not in the formula


def test_pressure_and_flow_keep_their_values_at_rest(healthy: list[Example]) -> None:
    w, truth = healthy[0].w, healthy[0].run.truth
    for ours, name, bound in ((w.H, "H_p", 2500.0), (w.Q, "Q", 2e-5)):
        error = np.abs(ours - delayed(np.interp(w.t, truth.t, truth[name]), FLOW_LAG))[w.rest]
        assert error.max() < bound


def test_the_lag_is_exact_on_a_ramp_and_keeps_a_level() -> None:
    t = STEP * np.arange(60)
    assert np.allclose(delayed(np.full(60, 7.0), 0.15), 7.0, rtol=1e-14)
    assert np.allclose(delayed(t, 0.15), t - 0.15 * (1 - np.exp(-t / 0.15)), atol=1e-13)


def test_the_truth_is_out_of_reach() -> None:
    """No function that decides takes a run or its truth."""
    for function in (windows, primer.train, primer.commission, primer.estimate, primer.Monitor.all):
        assert "Run" not in str(inspect.signature(function))
        assert "truth" not in inspect.getsource(function).replace("the truth is never used", "")


def test_same_generator_same_windows(machine: Machine, clogged: Example) -> None:
    again = primer.example_run(machine, "clogging", 1e10, "changes", np.random.default_rng([31, 8]))
    assert all(getattr(again.w, f.name).tobytes() == getattr(clogged.w, f.name).tobytes()
               for f in dataclasses.fields(again.w))  # fmt: skip


def test_bad_input(clogged: Example) -> None:
    fast = clogged.run.fast
    with pytest.raises(ParameterError, match="motors in Y"):
        windows(fast, dataclasses.replace(MOTOR, connection="delta"))
    with pytest.raises(DataError, match="pressure and flow"):
        windows(dataclasses.replace(fast, H=None), MOTOR)
    holes = fast.current.copy()
    holes[:4000] = np.nan
    with pytest.raises(DataError, match="missing"):
        windows(dataclasses.replace(fast, current=holes), MOTOR)
    with pytest.raises(DataError, match="omega_e"):
        steady_speed([230.0], [3.0], [0.0], [0.5], MOTOR)
    with pytest.raises(ParameterError, match="lag"):
        delayed([1.0], 0.0)
