"""Thesis 2.1.1-2.1.4: plain limits, constant and adaptive threshold, CUSUM and estimation, scored on the pump bench.

One unit of work is one machine: it is drawn, commissioned and taught on healthy runs, then scored on others.
"""

from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np

from pumplib.campaign.schemes import Row
from pumplib.errors import ParameterError
from pumplib.machines.quantity import Choice, Parameters, Quantity
from pumplib.primer.study import APPROACHES, score_run, set_up


@dataclass(frozen=True, kw_only=True, slots=True)
class LimitSettings(Parameters):
    """Runs that one machine is scored on.

    Parameters
    ----------
    profile : {"pump"}
        Bench profile.
    healthy, faulty : int
        Scored healthy runs, and runs of each size.
    sizes : tuple of float
        Sizes of the clogging, K_f.
    """

    profile: Annotated[Literal["pump"], Choice("bench profile", ("pump",))] = "pump"
    healthy: Annotated[int, Quantity("-", "scored healthy runs of a machine", 0, 10_000)] = 4
    faulty: Annotated[int, Quantity("-", "scored runs of a machine and size", 1, 10_000)] = 1
    sizes: Annotated[tuple[float, ...], Quantity("Pa s2/m6", "clogging K_f", 0.0, 1e13, True)] = ()

    def _check_together(self) -> None:
        if self.healthy == 0 and not self.sizes:
            raise ParameterError("LimitSettings: healthy = 0 and no sizes: nothing would be scored; give one of them.")


name = "limits"
settings = LimitSettings
groups = ("size",)


def score(settings: LimitSettings, rng: np.random.Generator) -> list[Row]:
    """Set up a machine and score its runs.

    Parameters
    ----------
    settings : LimitSettings
        Which runs.
    rng : numpy.random.Generator
        Source of randomness.

    Returns
    -------
    list of dict
        For each run its size (K_f in Pa s2/m6, 0 is healthy), whether each approach is in alarm at some time from
        the fault on, and the factors on the two thresholds up to which they are.
    """
    machine = set_up(int(rng.integers(2**31)))
    sizes = [0.0] * settings.healthy + [float(size) for size in settings.sizes for _ in range(settings.faulty)]
    rows: list[Row] = []
    for size in sizes:
        one = score_run(machine, size, rng)
        alarms = {approach: int(alarm) for approach, alarm in zip(APPROACHES, one.alarms, strict=True)}
        rows.append({"size": size, **alarms, "adaptive_factor": one.adaptive, "constant_factor": one.constant})
    return rows
