"""Thesis 4.4.2, 5.3, 6.7, 7.4: the virtual test bench."""
