"""A UDP port that nobody uses."""

from __future__ import annotations

import socket


def free_port() -> int:
    """Return a port of the loopback interface on which nobody listened a moment ago."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        return free.getsockname()[1]
