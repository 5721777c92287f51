"""Thesis, all chapters: what a notebook needs from the workbook, and nothing that is slow to import."""

from pumplib.workbook.notebook import Notebook, start
from pumplib.workbook.parameters import choice, file, flag, integer, names, number, numbers, text

__all__ = ["Notebook", "choice", "file", "flag", "integer", "names", "number", "numbers", "start", "text"]
