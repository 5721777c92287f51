"""Thesis, all chapters: where the workbook's folders are, whatever the working directory is.

papermill runs a notebook in the caller's directory and JupyterLab in the notebook's, so every
path starts from the package.
"""

from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
DATA = ROOT / "data"
FIGURES = ROOT / "figures"
NOTEBOOKS = ROOT / "notebooks"
BUILD = ROOT / "build"
SCRATCH = BUILD / "scratch"
