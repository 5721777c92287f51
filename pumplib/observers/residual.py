"""Thesis 6.4-6.6: residual observers of the pump: speed and torque from the motor's observer, pressure and flow in.

Three residuals, each blind to one fault by its structure, and a fourth that does without the speed:

    r1 = H - f_H(Q, w)                                       blind to friction
    r2 from z = J w - K_Q Q, z' = T_e - B w - f_T(Q, w)      blind to clogging; no derivative of the flow
    r3 as r2 with the flow that the pressure asks for        blind to leakage
    r4 = H - f_H(Q, w_hat), w_hat from torque and pressure   checks the speed of the motor's observer

Observer errors of r2 and r3 obey e' = -k e + (what the model does not explain): linear, exponentially stable for
every k > 0. r4 contracts for Q >= 0.
"""

import math
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pumplib.errors import DataError
from pumplib.machines.quantity import Parameters, Quantity
from pumplib.observers.residual_kernel import (
    ABOVE_MAP,
    COLUMNS,
    N_STATE,
    SETTLING,
    SHUT_OFF,
    UNTRUSTED,
    Generator,
    run_generator,
)
from pumplib.observers.residual_model import START, PumpBelief

Array = NDArray[Any]
RESIDUALS = ("r1", "r2", "r3", "r4")
FLAGS = {
    UNTRUSTED: "the motor's observer does not stand behind speed and torque",
    SETTLING: "settling after a start",
    ABOVE_MAP: "head above the map: no flow belongs to it",
    SHUT_OFF: "near shut-off: r3 says nothing and leakage does not show",
}


@dataclass(frozen=True, kw_only=True, slots=True)
class ResidualSettings(Parameters):
    """Gains of the residual observers.

    Parameters
    ----------
    k : float
        Output injection, about the bandwidth of the flow sensor.
    smooth : float
        Low-pass of r1.
    settle : float
        Time flagged after a start.
    shut_off : float
        r3 is off where the slope of the head map falls below this share of its largest value.
    """

    k: Annotated[float, Quantity("1/s", "output injection", 0.0, 1e3, True)] = 5.0
    smooth: Annotated[float, Quantity("s", "time constant of the low-pass of r1", 0.0, 10.0)] = 0.1
    settle: Annotated[float, Quantity("s", "time flagged after a start", 0.0, 100.0)] = START
    shut_off: Annotated[float, Quantity("-", "share of the largest head slope", 0.0, 1.0)] = 0.1


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Residuals:
    """Residuals of a record.

    Parameters
    ----------
    dt : float
        Sampling interval, s.
    start : float
        Time of the first row, s.
    rows : ndarray, shape (n, 9)
        `pumplib.observers.residual_kernel.COLUMNS`; NaN where the motor's observer is not to be relied on.
    """

    dt: float
    start: float
    rows: Array

    @property
    def t(self) -> Array:
        """Times, s."""
        return self.start + self.dt * np.arange(len(self.rows))

    @property
    def r(self) -> Array:
        """r1 (Pa), r2 (N m), r3 (N m), r4 (Pa), shape (n, 4)."""
        return np.asarray(self.rows[:, :4])

    def __getitem__(self, name: str) -> Array:
        """One column by its name: a residual, or omega, T_e, H, Q with the common lag."""
        if name not in COLUMNS:
            raise DataError(f"column {name!r}: must be one of {', '.join(COLUMNS)}.")
        return np.asarray(self.rows[:, COLUMNS.index(name)])

    @property
    def flag(self) -> Array:
        """Bits of `FLAGS`."""
        return self.rows[:, 8].astype(np.int64)

    @property
    def judged(self) -> Array:
        """True where residuals may be judged: observer trusted and settled."""
        return (self.flag & (UNTRUSTED | SETTLING)) == 0


def generator(belief: PumpBelief, dt: float, settings: ResidualSettings | None = None) -> Generator:
    """Constants of the compiled loop.

    Parameters
    ----------
    belief : PumpBelief
        The pump as commissioned.
    dt : float
        Sampling interval, s.
    settings : ResidualSettings, optional
        Gains.

    Returns
    -------
    Generator

    Raises
    ------
    DataError
        If the sampling interval is too long for the gains.
    """
    settings = settings or ResidualSettings()
    if not 0 < dt * settings.k <= 0.2:
        raise DataError(
            f"dt = {dt:g} s with k = {settings.k:g} 1/s: five samples or more are needed in 1/k; sample "
            "faster or lower k."
        )
    lag = max(belief.flow_lag, belief.pressure_lag)
    return Generator(
        a_h0=belief.a_h0, a_h1=belief.a_h1, a_h2=belief.a_h2,
        a_t0=belief.a_t0, a_t1=belief.a_t1, a_t2=belief.a_t2,
        B=belief.B, J=belief.J, K_Q=belief.K_Q, k=settings.k, keep=math.exp(-settings.k * dt), dt=dt,
        slow=_gain(dt, lag),
        direct_H=belief.pressure_lag / lag if lag > 0 else 1.0,
        direct_Q=belief.flow_lag / lag if lag > 0 else 1.0,
        smooth=_gain(dt, settings.smooth),
        settle=settings.settle / dt,
        shut_off=settings.shut_off,
        steepest=math.sqrt(belief.a_h1**2 + 4 * belief.a_h2 * belief.a_h0),
    )  # fmt: skip


def _gain(dt: float, time_constant: float) -> float:
    return -math.expm1(-dt / time_constant) if time_constant > 0 else 1.0


class ResidualObserver:
    """Residual observers that keep their state between calls; batch and sample by sample agree bit for bit.

    Parameters
    ----------
    belief : PumpBelief
        The pump as commissioned.
    dt : float
        Sampling interval, s.
    settings : ResidualSettings, optional
        Gains.

    Raises
    ------
    DataError
        If the sampling interval is too long for the gains.
    """

    def __init__(self, belief: PumpBelief, dt: float, settings: ResidualSettings | None = None) -> None:
        self.belief, self.dt = belief, float(dt)
        self._generator = generator(belief, self.dt, settings)
        self.reset()

    def reset(self) -> None:
        """Start anew."""
        self._state = np.zeros(N_STATE)
        self._seen = 0

    def run(
        self, omega: ArrayLike, T_e: ArrayLike, H: ArrayLike, Q: ArrayLike, trusted: ArrayLike | None = None
    ) -> Residuals:
        """Take a block of samples.

        Parameters
        ----------
        omega, T_e, H, Q : array_like, shape (n,)
            Speed (rad/s) and torque (N m) of the motor's observer, differential pressure (Pa), flow (m3/s).
        trusted : array_like of bool, shape (n,), optional
            Where speed and torque can be relied on; where they are finite if left out.

        Returns
        -------
        Residuals

        Raises
        ------
        DataError
            If shapes differ, or a trusted sample is not finite; the state stays as it was.
        """
        parts = [np.asarray(one, dtype=float).reshape(-1) for one in (omega, T_e, H, Q)]
        if len({len(one) for one in parts}) != 1:
            sizes = ", ".join(f"{name} {len(one)}" for name, one in zip(("omega", "T_e", "H", "Q"), parts, strict=True))
            raise DataError(f"ResidualObserver: records differ in length ({sizes}); give samples of the same instants.")
        x = np.stack(parts, axis=1)
        good = np.isfinite(x[:, :2]).all(axis=1) if trusted is None else np.asarray(trusted, dtype=bool).reshape(-1)
        if len(good) != len(x):
            raise DataError(f"ResidualObserver: trusted has {len(good)} entries, the records {len(x)}.")
        bad = good & ~np.isfinite(x).all(axis=1)
        if bad.any():
            k = int(np.argmax(bad))
            name = ("omega", "T_e", "H", "Q")[int(np.argmax(~np.isfinite(x[k])))]
            raise DataError(
                f"ResidualObserver: {name} at t = {(self._seen + k) * self.dt:g} s is not finite; mark it as not "
                "trusted or repair the record."
            )
        out = np.empty((len(x), len(COLUMNS)))
        run_generator(x, good, self._state, self._generator, out)
        found = Residuals(dt=self.dt, start=self._seen * self.dt, rows=out)
        self._seen += len(x)
        return found

    def update(self, omega: float, T_e: float, H: float, Q: float, trusted: bool = True) -> Array:
        """Take one sample.

        Parameters
        ----------
        omega, T_e, H, Q : float
            Speed (rad/s), torque (N m), differential pressure (Pa), flow (m3/s).
        trusted : bool
            Whether speed and torque can be relied on.

        Returns
        -------
        ndarray, shape (9,)
            `pumplib.observers.residual_kernel.COLUMNS`.

        Raises
        ------
        DataError
            If a trusted value is not finite.
        """
        return np.asarray(self.run([omega], [T_e], [H], [Q], [trusted]).rows[0])


def flag_words(flag: int) -> tuple[str, ...]:
    """What the bits of a flag mean.

    Parameters
    ----------
    flag : int
        A value of `Residuals.flag`.

    Returns
    -------
    tuple of str
    """
    return tuple(words for bit, words in FLAGS.items() if flag & bit)
