"""How fast and how punctual hilrig's loop is, compared with a bare exchange, other transports and cyclictest.

A separate program, for a checkout: `uv run python -m benchmarks`. It is not part of the installed package; use `hilrig
doctor` to see whether a machine can keep 1 ms.
"""
