"""Thesis 3.2, 3.3: the same start with scipy.integrate.solve_ivp, right-hand side in plain Python or compiled."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numba
import numpy as np
from scipy.integrate import solve_ivp

from benchmarks.case import DURATION, SAMPLES, Array
from pumplib.machines import PumpSet
from pumplib.motor.supply import Supply

METHODS = ("RK45", "DOP853", "LSODA")
Rhs = Callable[[float, Array], Any]
_T_EVAL = np.linspace(0.0, DURATION, SAMPLES + 1)


def python_rhs(machine: PumpSet, supply: Supply) -> Rhs:
    """Right-hand side as one writes it for solve_ivp: numbers by name, `math`, one expression an equation."""
    motor, pump, application, n = machine.motor, machine.pump, machine.application, machine.pump.stages
    r_s, R_r, z_p = motor.r_s, motor.R_r_prime, motor.z_p
    L_s, L_m = motor.L_s_prime, motor.L_m_prime
    a_h0, a_h1, a_h2 = n * pump.a_h0, n * pump.a_h1, n * pump.a_h2
    a_t0, a_t1, a_t2 = n * pump.a_t0, n * pump.a_t1, n * pump.a_t2
    a, K_l, K_J, K_c, K_Q = pump.a / n, pump.K_l, pump.K_J, pump.K_c, n * pump.K_Q
    K_p, K, p_static = application.K_p, application.K_v + application.K_pipe, application.p_static
    J, B = machine.inertia, machine.friction
    V, w = supply.amplitude, 2 * math.pi * supply.rated_frequency

    def rhs(t: float, x: Array) -> list[float]:
        # plain numbers: arithmetic with NumPy's scalars is slower
        i_sd, i_sq, i_md, i_mq, omega, q, Q = x.tolist()
        v_d = V * math.cos(w * t)
        v_q = V * math.sin(w * t)
        e_d = R_r * i_md + z_p * omega * L_m * i_mq
        e_q = R_r * i_mq - z_p * omega * L_m * i_md
        Q_i = Q + q
        H = a_h0 * omega**2 + a_h1 * omega * Q_i - a_h2 * Q_i * abs(Q_i)
        dq = (a * H - K_l * q * abs(q)) / K_J
        dQ = (H - p_static - (K_c + K) * Q * abs(Q)) / K_p
        T_e = 1.5 * z_p * L_m * (i_md * i_sq - i_mq * i_sd)
        T_p = a_t0 * omega * abs(omega) + a_t1 * omega * Q_i - a_t2 * Q_i**2
        return [
            (v_d - (r_s + R_r) * i_sd + e_d) / L_s,
            (v_q - (r_s + R_r) * i_sq + e_q) / L_s,
            (R_r * i_sd - e_d) / L_m,
            (R_r * i_sq - e_q) / L_m,
            (T_e - B * omega - T_p + K_Q * (dQ + dq)) / J,
            dq,
            dQ,
        ]

    return rhs


def compiled_rhs(machine: PumpSet, supply: Supply) -> Rhs:
    """The same, compiled; the parameters are constants of the compiled code, the solver calls it directly."""
    motor, pump, application, n = machine.motor, machine.pump, machine.application, machine.pump.stages
    r_s, R_r, z_p = motor.r_s, motor.R_r_prime, float(motor.z_p)
    L_m, inv_L_s, inv_L_m = motor.L_m_prime, 1 / motor.L_s_prime, 1 / motor.L_m_prime
    a_h0, a_h1, a_h2 = n * pump.a_h0, n * pump.a_h1, n * pump.a_h2
    a_t0, a_t1, a_t2 = n * pump.a_t0, n * pump.a_t1, n * pump.a_t2
    a, K_l, inv_K_J, K_Q = pump.a / n, pump.K_l, 1 / pump.K_J, n * pump.K_Q
    inv_K_p, p_static = 1 / application.K_p, application.p_static
    K = application.K_v + application.K_pipe + pump.K_c
    inv_J, B = 1 / machine.inertia, machine.friction
    V, w = supply.amplitude, 2 * math.pi * supply.rated_frequency

    @numba.njit("f8[::1](f8, f8[::1])", fastmath={"contract"}, error_model="numpy")
    def rhs(t: float, x: Array) -> Array:
        i_sd, i_sq, i_md, i_mq, omega, q, Q = x[0], x[1], x[2], x[3], x[4], x[5], x[6]
        e_d = R_r * i_md + z_p * omega * L_m * i_mq
        e_q = R_r * i_mq - z_p * omega * L_m * i_md
        Q_i = Q + q
        H = a_h0 * omega * omega + a_h1 * omega * Q_i - a_h2 * Q_i * abs(Q_i)
        dq = (a * H - K_l * q * abs(q)) * inv_K_J
        dQ = (H - p_static - K * Q * abs(Q)) * inv_K_p
        T_e = 1.5 * z_p * L_m * (i_md * i_sq - i_mq * i_sd)
        T_p = a_t0 * omega * abs(omega) + a_t1 * omega * Q_i - a_t2 * Q_i * Q_i
        d = np.empty(7)
        d[0] = (V * math.cos(w * t) - (r_s + R_r) * i_sd + e_d) * inv_L_s
        d[1] = (V * math.sin(w * t) - (r_s + R_r) * i_sq + e_q) * inv_L_s
        d[2] = (R_r * i_sd - e_d) * inv_L_m
        d[3] = (R_r * i_sq - e_q) * inv_L_m
        d[4] = (T_e - B * omega - T_p + K_Q * (dQ + dq)) * inv_J
        d[5] = dq
        d[6] = dQ
        return d

    return rhs


@dataclass(frozen=True)
class Setting:
    """A method with its tolerances; `atol` is one number, or one for each state in proportion to its size."""

    method: str
    rtol: float
    atol: float | Array
    error: float = math.inf  # of the stator current, A

    @property
    def per_state(self) -> bool:
        return isinstance(self.atol, np.ndarray)


def solve(rhs: Rhs, setting: Setting) -> Array:
    """States at 10 kHz, shape (samples + 1, 7)."""
    found = solve_ivp(
        rhs,
        (0.0, DURATION),
        np.zeros(7),
        method=setting.method,
        t_eval=_T_EVAL,
        rtol=setting.rtol,
        atol=setting.atol,
    )
    if not found.success:
        raise RuntimeError(f"{setting}: {found.message}")
    return found.y.T


def current_error(x: Array, reference: Array) -> float:
    """Largest error of the stator current's space vector, A."""
    return float(np.hypot(x[:, 0] - reference[:, 0], x[:, 1] - reference[:, 1]).max())


def loosest(rhs: Rhs, method: str, limit: float, reference: Array, per_state: bool) -> Setting:
    """Loosest tolerance, eight a decade, whose current error is at most `limit`.

    `per_state`: absolute tolerances in proportion to the size of each state, which is quicker than one
    number for amperes and cubic metres a second alike, but needs the sizes; else atol = rtol.
    """
    size = np.abs(reference).max(axis=0)
    for k in range(8 * 2, 8 * 12):
        rtol = 10 ** (-k / 8)
        setting = Setting(method, rtol, rtol * size if per_state else rtol)
        with np.errstate(all="ignore"):  # a tolerance that is far too loose lets the states grow
            try:
                error = current_error(solve(rhs, setting), reference)
            except RuntimeError:
                continue
        if error <= limit:
            return replace(setting, error=error)
    raise RuntimeError(f"{method} reaches no error of {limit:g} A")
