"""Figures of merit, one kind per file. Each takes a `PhaseRecord`; for all of them, lower is better."""
