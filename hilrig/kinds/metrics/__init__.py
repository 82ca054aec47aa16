"""Figures of merit, one kind a file. Each takes a `PhaseRecord`; of every one of them less is better."""
