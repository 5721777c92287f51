"""Replication workbook of C. S. Kallesøe, *Fault Detection and Isolation in Centrifugal Pumps* (2005).

Covers the whole thesis; each module's docstring opens with the sections that it covers.
"""

from importlib.metadata import version

__version__ = version("pumplib")
