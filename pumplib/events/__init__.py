"""Thesis 4.4: signal events from the bench: what the FMEA tables predict, confronted with physics and measurements."""
