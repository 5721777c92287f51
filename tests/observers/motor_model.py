"""Thesis (3.7) as a complex system in the states (i', i_m), for tests of the gains of chapter 5."""

import numpy as np
from scipy.linalg import expm

from pumplib.machines import load_motor

MOTOR = load_motor("reference_1k5")
C = np.array([[1.0, 0.0]])
STEP = 1e-4


def system(omega, motor=MOTOR):
    r, L_s, L_m = motor.R_r_prime, motor.L_s_prime, motor.L_m_prime
    e = r - 1j * omega * L_m
    return np.array([[-(motor.r_s + r) / L_s, e / L_s], [r / L_m, -e / L_m]])


def delta(omega, h=STEP):
    return (expm(system(omega) * h) - np.eye(2)) / h


def grid(points):
    omega = np.linspace(150.0, 340.0, points)
    return (omega - 245.0) / 95.0, np.stack([delta(one) for one in omega])
