"""Thesis 5.2.3, 5.3: the stator observer: voltages and currents in, speed, torque and fault coefficient out.

`observe` takes a record, `StatorObserver` takes it in pieces of any size down to one sample and gives the same
bits. The observer knows what is believed about the motor, never the plant. A result carries flags: an estimate
whose flags are not zero is not to be relied on.
"""

from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pumplib.errors import DataError, ParameterError
from pumplib.machines.parameters import Motor
from pumplib.observers.certificate import Gain
from pumplib.observers.stator_design import ObserverSettings, design_gain, kernel_design
from pumplib.observers.stator_kernel import (
    BAND,
    COLUMNS,
    EXCITATION,
    INNOVATION,
    N_COLUMNS,
    N_STATE,
    RESTARTS,
    REVERSED,
    SETTLING,
    SUM,
    UNBALANCE,
    WAITING,
    run_observer,
)

Array = NDArray[Any]
FLAGS = {
    WAITING: "waits for voltage",
    SETTLING: "settling after a start",
    INNOVATION: "innovation too large: belief, scaling or sampling rate do not fit the record",
    BAND: "speed outside the band of synchronism",
    EXCITATION: "supply at or near standstill: speed and fault cannot be identified",
    REVERSED: "voltage rotates backwards: two phases are swapped",
    UNBALANCE: "voltage far from balanced: a phase is lost or a channel is dead",
    SUM: "line currents do not sum to zero: a channel is dead or current leaves to ground",
}


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Estimates:
    """What the observer says, a row for every `every` samples.

    Parameters
    ----------
    rate : float
        Rows a second, Hz.
    start : float
        Time of the first row, s: of the last sample it stands for.
    rows : ndarray, shape (m, 17)
        See `pumplib.observers.stator_kernel.COLUMNS`; NaN while the observer does not run.
    pole_pairs : int
        Of the believed motor.
    """

    rate: float
    start: float
    rows: Array
    pole_pairs: int

    def column(self, name: str) -> Array:
        """One column by its name.

        Parameters
        ----------
        name : str
            Of `COLUMNS`.

        Returns
        -------
        ndarray, shape (m,)

        Raises
        ------
        ParameterError
            If there is no such column.
        """
        if name not in COLUMNS:
            raise ParameterError(f"column {name!r}: must be one of {', '.join(COLUMNS)}.")
        return np.asarray(self.rows[:, COLUMNS.index(name)])

    @property
    def t(self) -> Array:
        """Times, s."""
        return self.start + np.arange(len(self.rows)) / self.rate

    @property
    def omega(self) -> Array:
        """Shaft speed, rad/s."""
        return self.column("omega") / self.pole_pairs

    @property
    def T_e(self) -> Array:
        """Electromagnetic torque, N m."""
        return self.column("T_e")

    @property
    def g_c(self) -> Array:
        """Fault coefficient, complex."""
        return self.column("g_re") + 1j * self.column("g_im")

    @property
    def e(self) -> Array:
        """What the corrected estimate leaves of the winding current, complex, A."""
        return self.column("e_re") + 1j * self.column("e_im")

    @property
    def innovation(self) -> Array:
        """Root mean square of the innovation within the row, A."""
        return np.sqrt(self.column("e2"))

    @property
    def omega_s(self) -> Array:
        """Angular frequency of the supply, rad/s; negative where it rotates backwards."""
        return self.column("omega_s")

    @property
    def flag(self) -> Array:
        """Sum of the flags of `FLAGS` that were up within the row; 0 is a trusted estimate."""
        return self.column("flag").astype(np.int64)

    @property
    def trusted(self) -> Array:
        """Rows without any flag, bool."""
        return self.flag == 0

    def reasons(self) -> tuple[str, ...]:
        """All flags that were up at any time, in words.

        Returns
        -------
        tuple of str
        """
        seen = int(np.bitwise_or.reduce(self.flag)) if len(self.rows) else 0
        return tuple(text for bit, text in FLAGS.items() if seen & bit)


@dataclass(frozen=True, kw_only=True, slots=True)
class Estimate:
    """One row of `Estimates`.

    Parameters
    ----------
    t : float
        Time of the last sample it stands for, s.
    omega : float
        Shaft speed, rad/s.
    T_e : float
        Electromagnetic torque, N m.
    g_c : complex
        Fault coefficient.
    e : complex
        What the corrected estimate leaves of the winding current, A.
    omega_s : float
        Angular frequency of the supply, rad/s.
    flag : int
        Sum of the flags of `FLAGS`; 0 is a trusted estimate.
    """

    t: float
    omega: float
    T_e: float
    g_c: complex
    e: complex
    omega_s: float
    flag: int


def check_samples(v: ArrayLike, i: ArrayLike, first: int = 0) -> tuple[Array, Array]:
    """Check voltages and currents.

    Parameters
    ----------
    v, i : array_like, shape (n, 3) or (3,)
        Terminal voltages, V, and line currents, A.
    first : int
        Index of the first sample, for errors.

    Returns
    -------
    v, i : ndarray, shape (n, 3)

    Raises
    ------
    DataError
        If a shape is wrong, the two differ in length, or a value is not finite.
    """
    found = []
    for name, values, unit in (("v", v, "V"), ("i", i, "A")):
        try:
            x = np.ascontiguousarray(values, dtype=float)
        except (TypeError, ValueError) as error:
            raise DataError(f"{name} is not an array of numbers ({error}).") from error
        if x.ndim == 1 and x.shape == (3,):
            x = x[None]
        if x.ndim != 2 or x.shape[1] != 3:
            raise DataError(
                f"{name} has shape {x.shape}: must be (n, 3), time first, columns a, b, c; a phase missing?"
            )
        if not np.isfinite(x).all():
            k, c = (int(j) for j in np.argwhere(~np.isfinite(x))[0])
            raise DataError(
                f"{name}_{'abc'[c]} at sample {first + k} is {x[k, c]} {unit}: must be finite; repair or cut the "
                "record."
            )
        found.append(x)
    if len(found[0]) != len(found[1]):
        raise DataError(f"v has {len(found[0])} samples, i {len(found[1])}: must agree; cut both to the same span.")
    return found[0], found[1]


class StatorObserver:
    """Adaptive observer of speed, torque and inter-turn short, sample by sample.

    Parameters
    ----------
    motor : Motor
        What is believed about the motor; never the plant's own parameters.
    rate : float
        Sampling rate, Hz, 1 kHz to 50 kHz.
    gain : Gain, optional
        Of `pumplib.observers.stator_design.design_gain`; designed here if left out.
    settings : ObserverSettings, optional
        Time constants and limits.
    every : int
        Samples a row of the output stands for.
    reference : complex
        Fault coefficient that the healthy machine shows, from commissioning.

    Raises
    ------
    ParameterError
        If an argument is wrong.
    InfeasibleError
        If no gain reaches the default decay rate.

    References
    ----------
    Thesis 5.2.2, 5.2.3 (reconstructed).
    """

    def __init__(
        self, motor: Motor, rate: float, gain: Gain | None = None, *, settings: ObserverSettings | None = None,
        every: int = 1, reference: complex = 0.0,
    ) -> None:  # fmt: skip
        if isinstance(every, bool) or not isinstance(every, int | np.integer) or every < 1:
            raise ParameterError(f"StatorObserver.every = {every!r}: must be a whole number of samples >= 1.")
        if not np.isfinite(reference):
            raise ParameterError(f"StatorObserver.reference = {reference!r}: must be finite; commission again.")
        self.motor, self.rate, self.every = motor, float(rate), int(every)
        self.gain = design_gain(motor, rate)[0] if gain is None else gain
        self.settings = settings or ObserverSettings()
        self.reference = complex(reference)
        self._design, self._polynomials = kernel_design(motor, rate, self.gain, self.settings, self.reference)
        self._state = np.zeros(N_STATE)
        self._samples = 0

    @property
    def samples(self) -> int:
        """Samples seen."""
        return self._samples

    @property
    def restarts(self) -> int:
        """Restarts from a wrong solution."""
        return int(self._state[RESTARTS])

    def reset(self) -> None:
        """Forget everything, as before the first sample."""
        self._state[:] = 0.0
        self._samples = 0

    def copy(self) -> Self:
        """Return an independent observer in the same state.

        Returns
        -------
        StatorObserver
        """
        other = object.__new__(type(self))
        other.__dict__.update(self.__dict__)
        other._state = self._state.copy()
        return other

    def run(self, v: ArrayLike, i: ArrayLike) -> Estimates:
        """Take a piece of a record.

        Parameters
        ----------
        v, i : array_like, shape (n, 3)
            Terminal voltages, V, and line currents, A.

        Returns
        -------
        Estimates
            The rows that were completed.

        Raises
        ------
        DataError
            If a shape is wrong or a value not finite; the observer's state is then as before.
        """
        v, i = check_samples(v, i, self._samples)
        done = self._samples // self.every
        out = np.empty(((self._samples + len(v)) // self.every - done, N_COLUMNS))
        run_observer(v, i, self._state, self._design, self._polynomials, self.every, out)
        self._samples += len(v)
        return Estimates(
            rate=self.rate / self.every,
            start=((done + 1) * self.every - 1) / self.rate,
            rows=out,
            pole_pairs=self.motor.z_p,
        )

    def update(self, v_abc: ArrayLike, i_abc: ArrayLike) -> Estimate | None:
        """Take one sample.

        Parameters
        ----------
        v_abc, i_abc : array_like, shape (3,)
            Terminal voltages, V, and line currents, A.

        Returns
        -------
        Estimate or None
            None where the sample does not complete a row.

        Raises
        ------
        DataError
            If a shape is wrong or a value not finite.
        """
        found = self.run(v_abc, i_abc)
        if not len(found.rows):
            return None
        row = found.rows[-1]
        return Estimate(
            t=float(found.t[-1]),
            omega=float(row[0]) / self.motor.z_p,
            T_e=float(row[1]),
            g_c=complex(row[2], row[3]),
            e=complex(row[4], row[5]),
            omega_s=float(row[8]),
            flag=int(row[7]),
        )


def observe(
    v: ArrayLike, i: ArrayLike, motor: Motor, rate: float, gain: Gain | None = None, *,
    settings: ObserverSettings | None = None, every: int = 1, reference: complex = 0.0, start: float = 0.0,
) -> Estimates:  # fmt: skip
    """Observe a whole record.

    Parameters
    ----------
    v, i : array_like, shape (n, 3)
        Terminal voltages, V, and line currents, A.
    motor : Motor
        What is believed about the motor.
    rate : float
        Sampling rate, Hz.
    gain : Gain, optional
        Of `pumplib.observers.stator_design.design_gain`; designed here if left out.
    settings : ObserverSettings, optional
        Time constants and limits.
    every : int
        Samples a row of the output stands for.
    reference : complex
        Fault coefficient that the healthy machine shows.
    start : float
        Time of the first sample, s.

    Returns
    -------
    Estimates

    Raises
    ------
    ParameterError
        If an argument is wrong.
    DataError
        If a shape is wrong or a value not finite.

    References
    ----------
    Thesis 5.2.2, 5.2.3, 5.3 (reconstructed).
    """
    observer = StatorObserver(motor, rate, gain, settings=settings, every=every, reference=reference)
    found = observer.run(v, i)
    return replace(found, start=found.start + start)
