"""Thesis, all chapters: replication workbook of C. S. Kallesøe's thesis.

*Fault Detection and Isolation in Centrifugal Pumps*, Aalborg University, 2005. Each module's
docstring opens with the sections that it covers.
"""

from importlib.metadata import version

__version__ = version("pumplib")
