"""Thesis 3.2: the same motor with motulator: its machine, mechanics, source and simulation loop."""

import math
from importlib.metadata import PackageNotFoundError, version
from typing import Any

import numpy as np

from benchmarks.case import DURATION, SAMPLES, Array
from pumplib.machines import PumpSet
from pumplib.motor.supply import Supply

SAMPLE_TIME = DURATION / SAMPLES


def installed() -> str | None:
    """Version of motulator, or None."""
    try:
        return version("motulator")
    except PackageNotFoundError:
        return None


def missing() -> str | None:
    """Why this peer cannot be run, or None."""
    found = installed()
    if found is None:
        return "motulator is not installed"
    if not found.startswith("0.5."):
        return f"motulator {found} is installed; this benchmark is written for the interface of 0.5"
    return None


def load_factor(machine: PumpSet) -> float:
    """Torque of the pump at closed flow over the square of the speed, N m s2."""
    return machine.pump.stages * machine.pump.a_t0


def simulate(machine: PumpSet, supply: Supply) -> Any:
    """Direct-on-line start with the load torque B omega + a_t0 omega^2; returns motulator's model with its data.

    motulator calls its solver once a sampling period of its (here idle) controller, with its own settings.
    """
    from motulator.common.model import Model
    from motulator.drive.model import InductionMachine, Simulation, StiffMechanicalSystem
    from motulator.drive.utils import InductionMachineInvGammaPars, InductionMachinePars
    from motulator.grid.model import ThreePhaseVoltageSource, VoltageSourceConverter

    motor, k, friction = machine.motor, load_factor(machine), machine.friction

    class DirectOnLine(Model):
        def __init__(self) -> None:
            super().__init__()
            pars = InductionMachineInvGammaPars(
                n_p=motor.z_p, R_s=motor.r_s, R_R=motor.R_r_prime, L_sgm=motor.L_s_prime, L_M=motor.L_m_prime
            )
            self.machine = InductionMachine(InductionMachinePars.from_inv_gamma_model_pars(pars))
            self.mechanics = StiffMechanicalSystem(J=machine.inertia, B_L=lambda w: friction + k * w)
            self.source = ThreePhaseVoltageSource(w_g=2 * math.pi * supply.rated_frequency, abs_e_g=supply.amplitude)
            self.converter = VoltageSourceConverter(u_dc=0.0)  # not connected; the loop writes its duty ratios
            self.subsystems = [self.source, self.machine, self.mechanics]

        def interconnect(self, _: float) -> None:
            self.machine.inp.u_ss = self.source.out.e_gs
            self.machine.inp.w_M = self.mechanics.out.w_M
            self.mechanics.inp.tau_M = self.machine.out.tau_M

        def post_process(self) -> None:
            self.post_process_states()

    class Idle:
        def __call__(self, _: Model) -> tuple[float, list[float]]:
            return SAMPLE_TIME, [0.0, 0.0, 0.0]

        def post_process(self) -> None:
            pass

    model = DirectOnLine()
    Simulation(model, Idle()).simulate(t_stop=DURATION)
    return model


def samples(model: Any) -> tuple[Array, Array]:
    """Stator current (complex, A) and speed (rad/s) at 10 kHz, starting at t = 0."""
    data = model.machine.data
    # every sampling period starts again at the end of the one before: take the first of the equal times
    index = np.searchsorted(data.t, SAMPLE_TIME * np.arange(SAMPLES + 1) - SAMPLE_TIME / 1000)
    return data.i_ss[index], model.mechanics.data.w_M[index]
