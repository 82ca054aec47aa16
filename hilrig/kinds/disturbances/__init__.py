"""Disturbances: what a condition adds to the plant and to what is measured of it."""
