"""Thesis 8.1: the schemes of chapters 5-7 used together, and their scores on labelled measurements."""
