"""Thesis, all chapters: the exceptions of the package.

Every message names the quantity, its value with unit, the place it came from and what to do about it.
"""


class PumplibError(Exception):
    """Base of every error that pumplib raises on purpose."""


class ParameterError(PumplibError, ValueError):
    """A parameter, argument or input file is wrong: field, value, unit and remedy are in the message."""


class DataError(PumplibError, ValueError):
    """A measurement or table cannot be used as it is (gap, unit, order, missing column)."""


class SimulationError(PumplibError, ArithmeticError):
    """A simulation left the finite numbers or the range its model is valid for."""


class ClaimError(PumplibError):
    """A claim was recorded wrongly: unknown id, not a number, missing or twice."""


class NotebookError(PumplibError):
    """A notebook did not run to its end."""


class NotebookSkipped(PumplibError):
    """A notebook stopped on purpose because something it needs is absent; the reason is shown."""
