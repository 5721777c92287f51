"""Thesis 5.3: from records of voltages and currents to a verdict, in two calls: learn the healthy machine, diagnose.

Every record is looked at before it is used (`pumplib.observers.stator_check`), so a dead channel or a wrong sampling
rate ends in an error and not in a short that is not there.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pumplib.errors import DataError
from pumplib.machines.parameters import Motor
from pumplib.observers.certificate import Gain
from pumplib.observers.stator import observe
from pumplib.observers.stator_check import require_usable
from pumplib.observers.stator_commission import Commissioning, Tolerances, commission
from pumplib.observers.stator_decision import THRESHOLD, TURNS, Verdict, decide
from pumplib.observers.stator_design import ObserverSettings
from pumplib.observers.stator_kernel import BAND, INNOVATION, SETTLING, WAITING
from pumplib.observers.stator_sequences import Sequences, sequences

Array = NDArray[Any]
_WINDOW = 0.5  # s


def window_of_record(
    v: ArrayLike, i: ArrayLike, rate: float, motor: Motor, gain: Gain | None = None, *,
    settings: ObserverSettings | None = None, window: float = _WINDOW,
) -> Sequences:  # fmt: skip
    """Check a record, observe it, and return the sequences of its last part.

    Parameters
    ----------
    v, i : array_like, shape (n, 3)
        Terminal voltages, V, and line currents, A.
    rate : float
        Sampling rate, Hz.
    motor : Motor
        What is believed about the motor.
    gain : Gain, optional
        Of `pumplib.observers.stator_design.design_gain`; designed here if left out.
    settings : ObserverSettings, optional
        Time constants and limits of the observer.
    window : float
        Length of the last part, s.

    Returns
    -------
    Sequences

    Raises
    ------
    DataError
        If the record is not usable, too short, or the observer does not come to rest in it.
    """
    require_usable(v, i, rate, motor)
    estimates = observe(v, i, motor, rate, gain, settings=settings, every=max(1, round(rate / 1000)))
    end = len(np.asarray(v)) / rate
    found = sequences(estimates, end - window, end)
    flag = int(found.flag)
    if flag & (WAITING | SETTLING | BAND | INNOVATION):
        reasons = "; ".join(estimates.reasons())
        raise DataError(
            f"the observer does not settle before the last {window:g} s of the record ({reasons}): give a longer "
            "record of the running machine, and check the motor's data."
        )
    return found


def learn_machine(
    records: Sequence[tuple[ArrayLike, ArrayLike]], rate: float, motor: Motor, gain: Gain | None = None, *,
    tolerances: Tolerances | None = None,
) -> Commissioning:  # fmt: skip
    """Learn the healthy machine from cold records.

    Parameters
    ----------
    records : sequence of (v, i)
        Voltages and currents of each record, both of shape (n, 3), V and A.
    rate : float
        Sampling rate of all records, Hz.
    motor : Motor
        What is believed about the motor.
    gain : Gain, optional
        Of `pumplib.observers.stator_design.design_gain`; designed here if left out.
    tolerances : Tolerances, optional
        Of machine and sensors.

    Returns
    -------
    Commissioning

    Raises
    ------
    DataError
        If there is no record or one is not usable.
    """
    windows = [window_of_record(v, i, rate, motor, gain, window=_WINDOW) for v, i in records]
    return commission(windows, motor, tolerances)


def diagnose(
    healthy: Commissioning, v: ArrayLike, i: ArrayLike, rate: float, gain: Gain | None = None, *,
    threshold: float = THRESHOLD, r_s: float | None = None, turns: int = TURNS,
) -> Verdict:  # fmt: skip
    """Decide about a record.

    Parameters
    ----------
    healthy : Commissioning
        What is known about the machine.
    v, i : array_like, shape (n, 3)
        Terminal voltages, V, and line currents, A; 1.2 s or more.
    rate : float
        Sampling rate, Hz.
    gain : Gain, optional
        Of `pumplib.observers.stator_design.design_gain`; designed here if left out.
    threshold : float
        Of the statistic, standard deviations.
    r_s : float, optional
        Present stator resistance, ohm, where it is known.
    turns : int
        Turns of a phase.

    Returns
    -------
    Verdict

    Raises
    ------
    DataError
        If the record is not usable.
    ParameterError
        If an argument is wrong.
    """
    s = window_of_record(v, i, rate, healthy.motor, gain)
    return decide(healthy, s, threshold=threshold, r_s=r_s, turns=turns)
