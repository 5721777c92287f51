"""Thesis 3.2.4, 3.3.2, 3.5: where the power goes; the balance of motor, shaft, pump and application."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pumplib.plant.simulate import Trajectory

Array = NDArray[Any]


@dataclass(frozen=True, kw_only=True, eq=False)
class PowerBalance:
    """Power terms over time, all in W and shape (n,); stored energy in J.

    Parameters
    ----------
    electrical : ndarray
        Into the stator.
    copper_stator, copper_rotor, friction, load : ndarray
        Losses in the windings and bearings, power to a further load.
    impeller : ndarray
        Difference of shaft and hydraulic power of the impellers (disc friction, slip, shock).
    leakage, casing, application : ndarray
        Lost in the leakage path, the casing, and valve and pipe; against static pressure.
    liquid : ndarray
        Taken by the torque K_Q dQ_i/dt; the thesis's model has no counterpart in the head.
    stored : ndarray
        Rate of change of the stored energy.
    energy : ndarray
        Stored energy: magnetic field, rotating parts with liquid, pipe, leakage path.
    """

    electrical: Array
    copper_stator: Array
    copper_rotor: Array
    friction: Array
    load: Array
    impeller: Array
    leakage: Array
    casing: Array
    application: Array
    liquid: Array
    stored: Array
    energy: Array

    @property
    def losses(self) -> Array:
        """Sum of everything that leaves the stores, W."""
        return (
            self.copper_stator
            + self.copper_rotor
            + self.friction
            + self.load
            + self.impeller
            + self.leakage
            + self.casing
            + self.application
            + self.liquid
        )

    @property
    def imbalance(self) -> Array:
        """Input minus losses minus rate of storage, W; zero for a correct model."""
        return self.electrical - self.losses - self.stored


def power_balance(run: Trajectory) -> PowerBalance:
    """Power terms of a trajectory, each from its own expression.

    Parameters
    ----------
    run : Trajectory
        Result of `simulate`.

    Returns
    -------
    PowerBalance

    References
    ----------
    Thesis (3.7), (3.11), (3.18)-(3.25); energy of the field 3/4 (L_s' |i_s|^2 + L_m' |i_m|^2).
    """
    c, machine = run.c, run.machine
    i_s, i_m, omega, q, Q, Q_i = run.i_s, run.i_m, run.omega, run.q, run.Q_p, run.Q_i
    dx = run.dx
    di_s, di_m = dx[:, 0] + 1j * dx[:, 1], dx[:, 2] + 1j * dx[:, 3]
    domega, dq, dQ = dx[:, 4], dx[:, 5], dx[:, 6]
    H_i, H_p = run.H_i, run.H_p
    J = machine.inertia
    K_p = 1 / c.inv_K_p if c.inv_K_p else 0.0
    # n equal stages in series: each has the leakage flow q and the n-th part of the pressure
    stages = machine.pump.stages
    K_J = stages / c.inv_K_J if c.inv_K_J else 0.0
    L_s, L_m = 1 / c.inv_L_s, c.L_m
    stored_liquid = -c.K_Q * (domega * Q_i + omega * (dq + dQ)) if c.c_H else np.zeros_like(omega)
    energy_liquid = -c.K_Q * omega * Q_i if c.c_H else np.zeros_like(omega)
    hold = (H_p - c.p_static - (run.K_v + c.K_pipe) * Q * np.abs(Q)) * Q - K_p * Q * dQ
    return PowerBalance(
        electrical=1.5 * (run.v_s * i_s.conj()).real,
        copper_stator=1.5 * c.r_s * np.abs(i_s) ** 2,
        copper_rotor=1.5 * c.R_r * np.abs(i_m - i_s) ** 2,
        friction=c.B * omega**2,
        load=run.T_load * omega,
        impeller=run.T_p * omega - (H_i - c.c_H * domega) * Q_i,
        leakage=H_i * q - K_J * q * dq,
        casing=c.K_c * np.abs(Q) ** 3,
        # `hold` is zero unless the flow is held, which takes power of its own
        application=c.p_static * Q + (run.K_v + c.K_pipe) * np.abs(Q) ** 3 + hold,
        liquid=np.zeros_like(omega) if c.c_H else -c.K_Q * omega * (dq + dQ),
        stored=1.5 * (L_s * i_s.conj() * di_s + L_m * i_m.conj() * di_m).real
        + J * omega * domega
        + K_p * Q * dQ
        + K_J * q * dq
        + stored_liquid,
        energy=0.75 * (L_s * np.abs(i_s) ** 2 + L_m * np.abs(i_m) ** 2)
        + 0.5 * (J * omega**2 + K_p * Q**2 + K_J * q**2)
        + energy_liquid,
    )


def energy_error(run: Trajectory) -> float:
    """Energy balance of a whole run without jumps in its inputs, by quadrature of the recorded samples.

    Parameters
    ----------
    run : Trajectory
        Recorded at every step, an even number of them.

    Returns
    -------
    float
        |input - losses - change of stored energy| over the run / input, dimensionless.
    """
    from scipy.integrate import simpson

    power = power_balance(run)
    supplied = simpson(power.electrical, x=run.t)
    spent = simpson(power.losses, x=run.t)
    return float(abs(supplied - spent - (power.energy[-1] - power.energy[0])) / abs(supplied))
