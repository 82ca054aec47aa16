"""How fast and how punctual hilrig's loop is, beside a bare exchange, other transports and cyclictest.

A program of its own, for a checkout: `uv run python -m benchmarks`. Users who install hilrig do not get it; whether a
machine can keep 1 ms is what `hilrig doctor` tells.
"""
