"""Thesis, all chapters: the frozen bench profiles under which claims are measured.

Chapter 3 needs the machine of a profile only; sensors, faults and disturbances belong to the test bench.
"""

import tomllib
from typing import Any

from pumplib.errors import ParameterError
from pumplib.machines.parameters import Application, Motor, Pump, PumpSet
from pumplib.paths import DATA

_NOMINAL_PRESSURE = 4.9e5  # Pa, at which the leakage lag of the profile is taken


def load_profile(name: str) -> dict[str, Any]:
    """Read a bench profile as it is written.

    Parameters
    ----------
    name : str
        "stator", "pump" or "pump_hot".

    Returns
    -------
    dict

    Raises
    ------
    ParameterError
        If there is no such profile.
    """
    files = {path.stem: path for path in sorted((DATA / "bench").glob("*.toml"))}
    if name not in files:
        raise ParameterError(f"profile {name!r}: must be one of {', '.join(files)}.")
    return tomllib.loads(files[name].read_text(encoding="utf-8"))


def profile_machine(name: str, valve: float = 1.9e11) -> PumpSet:
    """Motor, pump and application of a bench profile, healthy and without its disturbances.

    The profile's leakage q = K sqrt(H) with a lag is written in the thesis's form (3.25):
    K_l = 1/K^2 and K_J = 2 K_l q lag at nominal pressure. Its inertia contains motor and water.

    Parameters
    ----------
    name : str
        "pump" or "pump_hot".
    valve : float
        K_v, Pa s2/m6.

    Returns
    -------
    PumpSet

    Raises
    ------
    ParameterError
        If the profile has no pump.
    """
    profile = load_profile(name)
    if "pump" not in profile:
        raise ParameterError(f'profile {name!r} has no pump; use "pump" or "pump_hot".')
    pump, truth = profile["pump"], profile["truth"]
    gain, lag = truth["healthy_leakage"], truth["leakage_lag_s"]
    K_l = 1 / gain**2
    coefficients = {key: pump[key] for key in ("a_h0", "a_h1", "a_h2", "a_t0", "a_t1", "a_t2", "J", "B", "K_Q")}
    return PumpSet(
        motor=Motor(**profile["motor"], J=0.0, B=0.0),
        pump=Pump(
            **coefficients,
            J_Mv=0.0,
            K_c=truth["casing_loss"],
            K_l=K_l,
            K_J=2 * K_l * gain * _NOMINAL_PRESSURE**0.5 * lag,
            a=1.0,
        ),
        application=Application(K_p=truth["pipe_inertia"], K_v=valve),
    )
