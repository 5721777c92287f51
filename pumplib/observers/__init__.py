"""Thesis 5.2.2, B.2: observers: gains from matrix inequalities, with certificates verified outside the solver."""

from pumplib.observers.certificate import (
    Certificate,
    Gain,
    InaccurateError,
    InfeasibleError,
    LmiError,
    NotVerifiedError,
    verify_decay,
)
from pumplib.observers.lmi import lyapunov_certificate, observer_gain
from pumplib.observers.lmi_forms import complex_form, real_form
from pumplib.observers.lmi_problem import HiddenMode, Scaling
from pumplib.observers.lmi_search import Bracket, bisect, largest_decay_rate, refute_decay_rate
from pumplib.observers.lmi_solver import Refutation
from pumplib.observers.lmi_structural import Structure, structural_gain

__all__ = [
    "Bracket",
    "Certificate",
    "Gain",
    "HiddenMode",
    "InaccurateError",
    "InfeasibleError",
    "LmiError",
    "NotVerifiedError",
    "Refutation",
    "Scaling",
    "Structure",
    "bisect",
    "complex_form",
    "largest_decay_rate",
    "lyapunov_certificate",
    "observer_gain",
    "real_form",
    "refute_decay_rate",
    "structural_gain",
    "verify_decay",
]
