"""Robots: geometry and nominal dynamics, one kind per file."""
