"""Thesis 3.2.1, 3.3.2, 3.3.4: the machines as data: units, parameter classes, parameter files."""

from pumplib.machines.parameters import Application, Impeller, Liquid, Motor, MotorLosses, Pump, PumpSet
from pumplib.machines.profile import Profile, as_profile
from pumplib.machines.sheets import (
    Sheet,
    from_inverse_gamma,
    load_application,
    load_losses,
    load_motor,
    load_pump,
    read_sheet,
    shipped,
)
from pumplib.machines.units import from_si, to_si

__all__ = [
    "Application",
    "Impeller",
    "Liquid",
    "Motor",
    "MotorLosses",
    "Profile",
    "Pump",
    "PumpSet",
    "Sheet",
    "as_profile",
    "from_inverse_gamma",
    "from_si",
    "load_application",
    "load_losses",
    "load_motor",
    "load_pump",
    "read_sheet",
    "shipped",
    "to_si",
]
