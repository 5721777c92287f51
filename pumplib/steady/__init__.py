"""Thesis 7: steady-state set-valued fault detection."""
