"""Thesis 7.3: speed of the affine enclosure beside a verified interval library and plain NumPy, in one run.

Run as `python -m benchmarks.steady`. All contenders enclose the same three residuals for the same parameter box and
measurement errors. The plain NumPy intervals round nowhere, so they give no guarantee; the interval library (arb,
through python-flint) does, and so does the affine kernel.
"""

import time
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.timing import interleaved
from pumplib.machines import load_motor, load_pump
from pumplib.steady.enclose import SetModel, set_model
from pumplib.steady.operating import steady_points, v_f_voltage
from pumplib.steady.relations import CHANNELS, parameter_values, pump_relations, stack
from pumplib.steady.sets import MeasurementErrors, box

Array = NDArray[Any]
RELATIVE = {
    "r_s": 0.08, "L_s_prime": 0.1, "R_r_prime": 0.05, "B": 0.1,
    "a_h0": 0.01, "a_h1": 0.03, "a_h2": 0.02, "a_t0": 0.03, "a_t1": 0.03, "a_t2": 0.03,
}  # fmt: skip
ERRORS = MeasurementErrors(
    relative={"V_rms": 0.005, "I_rms": 0.005, "omega_e": 0.0005}, absolute={"phi": 0.0087, "H": 2000.0, "Q": 1e-5}
)


def case(samples: int, seed: int = 7) -> tuple[SetModel, dict[str, Array]]:
    """The reference motor with the ten-stage pump at drawn operating points."""
    motor, pump = load_motor("reference_1k5"), load_pump("multistage_1k5")
    values = parameter_values(motor, pump)
    rng = np.random.default_rng(seed)
    hertz, valve = rng.uniform(30, 50, samples), np.exp(rng.uniform(np.log(1.25e11), np.log(6e11), samples))
    points = steady_points(motor, values, V_rms=v_f_voltage(hertz), frequency_hz=hertz, valve=valve)
    return set_model(pump_relations(motor), box(values, relative=RELATIVE), ERRORS), points.signals


class Plain:
    """Interval arithmetic of NumPy arrays without any rounding."""

    def __init__(self, lo: Any, hi: Any) -> None:
        self.lo, self.hi = lo, hi

    __array_ufunc__ = None

    @staticmethod
    def of(x: Any) -> "Plain":
        return x if isinstance(x, Plain) else Plain(x, x)

    def __neg__(self) -> "Plain":
        return Plain(-self.hi, -self.lo)

    def __add__(self, other: Any) -> "Plain":
        b = Plain.of(other)
        return Plain(self.lo + b.lo, self.hi + b.hi)

    __radd__ = __add__

    def __sub__(self, other: Any) -> "Plain":
        return self + (-Plain.of(other))

    def __rsub__(self, other: Any) -> "Plain":
        return (-self) + other

    def __mul__(self, other: Any) -> "Plain":
        b = Plain.of(other)
        p = (self.lo * b.lo, self.lo * b.hi, self.hi * b.lo, self.hi * b.hi)
        return Plain(np.minimum.reduce(p), np.maximum.reduce(p))

    __rmul__ = __mul__

    def __truediv__(self, other: Any) -> "Plain":
        b = Plain.of(other)
        return self * Plain(1.0 / b.hi, 1.0 / b.lo)

    def __pow__(self, exponent: int) -> "Plain":
        return Plain(np.minimum(self.lo**2, self.hi**2), np.maximum(self.lo**2, self.hi**2))

    def sqrt(self) -> "Plain":
        return Plain(np.sqrt(self.lo), np.sqrt(self.hi))

    def cos(self) -> "Plain":
        return Plain(np.cos(self.hi), np.cos(self.lo))

    def sin(self) -> "Plain":
        return Plain(np.sin(self.lo), np.sin(self.hi))


def numpy_intervals(model: SetModel, x: Array) -> tuple[Array, Array]:
    """Plain intervals of the residuals."""
    r, p = model.radii(x), model.parameters
    channels = [Plain(a - b, a + b) for a, b in zip(x.T, r.T, strict=True)]
    parameters = [Plain(c - d, c + d) for c, d in zip(p.center, p.radius, strict=True)]
    found = model.relations(channels, parameters)
    return np.stack([f.lo for f in found], 1), np.stack([f.hi for f in found], 1)


def flint_intervals(model: SetModel, x: Array) -> tuple[Array, Array]:
    """Residuals in the ball arithmetic of arb at 53 bits."""
    import flint

    flint.ctx.prec = 53
    r, p = model.radii(x), model.parameters
    parameters = [flint.arb(float(c), float(d)) for c, d in zip(p.center, p.radius, strict=True)]
    low, high = np.empty((len(x), 3)), np.empty((len(x), 3))
    for k in range(len(x)):
        balls = [flint.arb(float(a), float(b)) for a, b in zip(x[k], r[k], strict=True)]
        for o, ball in enumerate(model.relations(balls, parameters)):
            low[k, o], high[k, o] = float(ball.lower()), float(ball.upper())
    return low, high


def measure(rounds: int = 5, samples: int = 100_000, few: int = 200) -> dict[str, Any]:
    """Numbers for the benchmark report; `few` samples for the interval library, which is slow."""
    model, signals = case(samples)
    x = stack(model.relations, signals)
    part = {name: signals[name][:few] for name in CHANNELS}
    contenders: dict[str, Callable[[], object]] = {
        "affine": lambda: model.enclose(signals),
        "numpy intervals": lambda: numpy_intervals(model, x),
        "flint": lambda: flint_intervals(model, x[:few]),
        "taylor": lambda: model.enclose(part, "taylor"),
    }
    size = {"affine": samples, "numpy intervals": samples, "flint": few, "taylor": few}
    times = interleaved(contenders, rounds)
    affine = model.enclose(part).width
    plain_low, plain_high = numpy_intervals(model, x[:few])
    ball_low, ball_high = flint_intervals(model, x[:few])
    start = time.process_time()
    model.enclose(signals)
    used = time.process_time() - start
    return {
        "samples": samples,
        "operations": len(model.tape.code),
        "times": {name: value.row() for name, value in times.items()},
        "samples_per_second": {name: size[name] / value.median for name, value in times.items()},
        "affine_samples_per_second_of_cpu": samples / used,
        "ratio": {
            name: (times[name].median / size[name]) / (times["affine"].median / samples)
            for name in ("numpy intervals", "flint", "taylor")
        },
        "median_width_over_affine": {
            "numpy intervals": np.median((plain_high - plain_low) / affine, axis=0).tolist(),
            "flint": np.median((ball_high - ball_low) / affine, axis=0).tolist(),
            "taylor": np.median(model.enclose(part, "taylor").width / affine, axis=0).tolist(),
        },
    }


def main() -> None:
    """Print the numbers."""
    import json

    print(json.dumps(measure(), indent=2))


if __name__ == "__main__":
    main()
