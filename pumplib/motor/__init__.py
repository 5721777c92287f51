"""Thesis 3.2.1, 3.2.2, 3.2.3, 3.2.4: the induction motor and its supplies."""
