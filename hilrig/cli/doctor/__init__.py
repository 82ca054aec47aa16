"""Checks whether this machine can run the loop at 1 ms: properties of the host, a probe, and a verdict."""
