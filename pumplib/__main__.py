"""Thesis, all chapters: `python -m pumplib`."""

import sys

from pumplib.workbook.cli import main

if __name__ == "__main__":
    sys.exit(main())
