"""The machine, sets and operating points that the tests of the steady-state room share."""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pumplib.machines import load_motor, load_pump
from pumplib.steady.operating import SteadyPoints, steady_points, v_f_voltage
from pumplib.steady.relations import CHANNELS, PARAMETERS, parameter_values, pump_relations
from pumplib.steady.sets import MeasurementErrors, ParameterSet, box, join

MOTOR, PUMP = load_motor("reference_1k5"), load_pump("multistage_1k5")
VALUES = parameter_values(MOTOR, PUMP)
RELATIONS = pump_relations(MOTOR)
RELATIVE = {
    "r_s": 0.08, "L_s_prime": 0.1, "R_r_prime": 0.05, "B": 0.1,
    "a_h0": 0.01, "a_h1": 0.03, "a_h2": 0.02, "a_t0": 0.03, "a_t1": 0.03, "a_t2": 0.03,
}  # fmt: skip
BOX = box(VALUES, relative=RELATIVE)
ERRORS = MeasurementErrors(
    relative={"V_rms": 0.005, "I_rms": 0.005, "omega_e": 0.0005},
    absolute={"phi": math.radians(0.5), "H": 2000.0, "Q": 1e-5},
    bias_share=dict.fromkeys(CHANNELS, 0.88),
)


def grid(n: int = 5, **faults: Any) -> SteadyPoints:
    """Speeds 60-100 % and the valve range of the bench, every pair."""
    hertz, valve = (a.ravel() for a in np.meshgrid(np.linspace(30, 50, n), np.geomspace(1.25e11, 6e11, n)))
    return steady_points(MOTOR, VALUES, V_rms=v_f_voltage(hertz), frequency_hz=hertz, valve=valve, faults=faults)


def correlated() -> ParameterSet:
    """Parallelotopes of a regression on the grid: 300 Pa and 5 mN m, three standard deviations, motor box beside."""
    points = grid()
    w, Q = points.omega, points.signals["Q"]
    head = np.column_stack((w**2, w * Q, -(Q**2)))
    parts = [box({k: VALUES[k] for k in (*PARAMETERS[:4], "stray")}, relative={k: RELATIVE[k] for k in PARAMETERS[:3]})]
    for names, matrix, sigma in (
        (PARAMETERS[6:9], head, 300.0),
        (("B", *PARAMETERS[9:]), np.column_stack((w, head)), 5e-3),
    ):
        scale = np.linalg.norm(matrix, axis=0)
        _, S, Vt = np.linalg.svd(matrix / scale, full_matrices=False)
        center = np.array([VALUES[k] for k in names])
        parts.append(ParameterSet(names=names, center=center, generators=(Vt.T / scale[:, None]) * (3 * sigma / S)))
    return join(*parts)


def measured(
    rng: np.random.Generator, count: int, truth: dict[str, float], bias: NDArray[Any], **faults: float
) -> dict[str, NDArray[Any]]:
    """Points of a machine as its sensors show them, errors inside 98 % of the bounds."""
    hertz, valve = rng.uniform(30, 50, count), np.exp(rng.uniform(np.log(1.25e11), np.log(6e11), count))
    points = steady_points(
        MOTOR, truth, V_rms=v_f_voltage(hertz), frequency_hz=hertz, valve=valve, faults=faults
    )  # fmt: skip
    absolute, relative, share = ERRORS.bounds(CHANNELS)
    out = {}
    for i, name in enumerate(CHANNELS):
        x = points.signals[name]
        radius = 0.98 * (absolute[i] + relative[i] * np.abs(x))
        out[name] = x - radius * (share[i] * bias[i] + (1 - share[i]) * rng.uniform(-1, 1, count))
    return out


def machine(rng: np.random.Generator) -> tuple[dict[str, float], NDArray[Any]]:
    """Parameters and biases of one machine, inside 98 % of the box."""
    zeta = rng.uniform(-0.98, 0.98, BOX.generators.shape[1])
    return dict(zip(BOX.names, BOX.values(zeta).tolist(), strict=True)), rng.uniform(-1, 1, 6)
