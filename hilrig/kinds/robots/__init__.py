"""Robots: geometry and nominal dynamics, one kind a file."""
