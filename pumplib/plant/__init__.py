"""Thesis 3.4, 3.5: the motor-pump set as one system, its simulation and its power balance."""

from pumplib.plant.equations import STATES, Coefficients, coefficients
from pumplib.plant.simulate import Batch, Trajectory, simulate, simulate_many

__all__ = ["STATES", "Batch", "Coefficients", "Trajectory", "coefficients", "simulate", "simulate_many"]
