"""Disturbances: what a condition adds to the plant and its measurements."""
