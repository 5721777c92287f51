"""Thesis 1.3, 6.2: noise study on satellite and pump, with trajectories that solve the equations exactly."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pumplib.errors import ParameterError
from pumplib.structure.codegen_generator import residual_generator
from pumplib.structure.derivative import NoiseCase, NoiseRow, derivative_residual, noise_rows
from pumplib.structure.examples import satellite
from pumplib.structure.pump import pump_part
from pumplib.structure.realization import realize
from pumplib.structure.realization_gain import identity_gain, rate_gain, with_linear_error

Array = NDArray[Any]
R2 = ("c1", "c3", "c4", "m_w", "m_T", "m_H", "m_Q", "d1", "d2")
PUMP_PARAMETERS = ("J", "B", "K_Q", "a_t0", "a_t1", "a_t2")


def satellite_case(*, rate: float = 1.0) -> NoiseCase:
    """Satellite with an unknown radial velocity, noise on the radius.

    The radius is a sine, the tangential thrust constant, so the angular momentum is known in closed form.

    Parameters
    ----------
    rate : float
        1/s.

    Returns
    -------
    NoiseCase
        Residuals in rad/s2.
    """
    model = satellite()
    realization = realize(model).require()
    radius, swing, frequency, momentum, thrust = 1.2, 0.2, 0.3, 1.0, 0.02

    def signals(t: Array) -> dict[str, Array]:
        rho = radius + swing * np.sin(frequency * t)
        grown = radius * t - swing / frequency * (np.cos(frequency * t) - 1.0)
        return {"u_2": np.full_like(t, thrust), "y1": rho, "y2": (momentum + thrust * grown) / rho**2}

    return NoiseCase(
        name="satellite",
        generator=residual_generator(realization, gain=rate_gain(realization, rate), output="correction"),
        derivative=derivative_residual(model),
        signals=signals,
        start=lambda t: signals(t[:1])["y1"] ** 2 * signals(t[:1])["y2"],
        parameters={"theta_2": 1.0},
        rate=rate,
        noisy="y1",
        scale=lambda s: np.asarray(s["y1"]) ** 2,
    )


def pump_case(parameters: Mapping[str, float], *, noisy: str = "y_w", rate: float = 5.0) -> NoiseCase:
    """Second residual of the pump with the acceleration of the liquid; speed and flow are sines.

    Parameters
    ----------
    parameters : mapping of str to float
        J, B, K_Q, a_t0, a_t1, a_t2, SI.
    noisy : {"y_w", "y_Q", "y_T"}
        Signal with noise: speed in rad/s, flow in m3/s or torque in N m.
    rate : float
        1/s.

    Returns
    -------
    NoiseCase
        Residuals in rad/s2 (torque over inertia).

    Raises
    ------
    ParameterError
        If a parameter is missing or the signal is another one.
    """
    missing = [name for name in PUMP_PARAMETERS if name not in parameters]
    if missing or noisy not in ("y_w", "y_Q", "y_T"):
        raise ParameterError(f"pump_case: parameters lack {missing}, noisy = {noisy!r} (y_w, y_Q or y_T).")
    model = pump_part(flow_acceleration=True)
    realization = with_linear_error(realize(model, R2, name="r2").require())
    J, B, K_Q, t0, t1, t2 = (float(parameters[name]) for name in PUMP_PARAMETERS)

    def signals(t: Array) -> dict[str, Array]:
        w, dw = 306.0 + 2.0 * np.sin(2.0 * t), 4.0 * np.cos(2.0 * t)
        Q, dQ = 1.6e-3 + 2e-4 * np.sin(1.3 * t), 2.6e-4 * np.cos(1.3 * t)
        torque = J * dw - K_Q * dQ + B * w + t0 * w**2 + t1 * w * Q - t2 * Q**2
        return {"y_w": w, "y_Q": Q, "y_T": torque, "y_H": np.zeros_like(t)}

    def start(t: Array) -> Array:
        first = signals(t[:1])
        return np.asarray(J * first["y_w"] - K_Q * first["y_Q"])

    return NoiseCase(
        name=f"pump r2, noise on {noisy}",
        generator=residual_generator(realization, gain=identity_gain(realization, rate), output="correction"),
        derivative=derivative_residual(model, R2),
        signals=signals,
        start=start,
        parameters=dict(parameters),
        rate=rate,
        noisy=noisy,
        scale=lambda s: np.full_like(np.asarray(s["y_w"]), J),
    )


def noise_study(
    parameters: Mapping[str, float],
    rng: np.random.Generator,
    *,
    steps: Sequence[float] = (0.02, 0.001),
    satellite_sigmas: Sequence[float] = (1e-3, 1e-2),
    speed_sigma: float = 0.1,
    flow_sigma: float = 4e-6,
    jitter: float = 0.5,
    duration: float = 200.0,
) -> tuple[NoiseRow, ...]:
    """Table of the study: both systems, regular and irregular sampling.

    Parameters
    ----------
    parameters : mapping of str to float
        Of the pump.
    rng : numpy.random.Generator
        Source of the noise.
    steps : sequence of float
        Mean sampling intervals, s.
    satellite_sigmas : sequence of float
        Noise of the radius, relative to its unit.
    speed_sigma : float
        rad/s.
    flow_sigma : float
        m3/s.
    jitter : float
        Of the irregular sampling.
    duration : float
        Length of each record, s.

    Returns
    -------
    tuple of NoiseRow
    """
    cases = [(satellite_case(), sigma) for sigma in satellite_sigmas]
    cases += [(pump_case(parameters, noisy="y_w"), speed_sigma), (pump_case(parameters, noisy="y_Q"), flow_sigma)]
    rows: list[NoiseRow] = []
    for case, sigma in cases:
        for dt in steps:
            for shake in (0.0, jitter):
                rows += noise_rows(case, dt, sigma, rng, duration=duration, jitter=shake)
    return tuple(rows)
