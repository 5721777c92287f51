"""Thesis 3.3.2, 3.3.3, 3.3.4, 3.3.5: impeller, head, torque and leakage."""
