"""Thesis 1.3, 3.2, 3.3: real measurements by name (beyond the thesis): shipped, in a local folder, or downloaded.

A set that is not shipped is looked for in the folder that the environment variable ``PUMPLIB_DATA`` names
(``PUMPLIB_DATA/itsc/*.csv``, ``PUMPLIB_DATA/skab/**/*.csv``), then in the package's cache. `fetch` fills the cache
from the set's public home, with the checksums of ``data/datasets/registry.toml``.
"""

from pumplib.datasets.access import FOLDER_VARIABLE, check, fetch, files, folder, status
from pumplib.datasets.registry import DatasetStatus, FileCheck, names

__all__ = ["FOLDER_VARIABLE", "DatasetStatus", "FileCheck", "check", "fetch", "files", "folder", "names", "status"]
