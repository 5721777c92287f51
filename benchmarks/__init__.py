"""Thesis, all chapters: speed of the package against other tools; `python -m benchmarks`."""
