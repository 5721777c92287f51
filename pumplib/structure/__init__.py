"""Thesis 6.1-6.3: structural analysis: models of named constraints, their redundancy and what can be tested."""
