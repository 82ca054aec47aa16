"""LCM: UDP multicast that does not leave this host (ttl 0)."""

import os
import zlib

import lcm  # pyright: ignore[reportMissingImports]


def open_link(side, folder):
    """Open one side, on a port that belongs to this pair."""
    port = 20000 + zlib.crc32(os.fsencode(folder)) % 20000
    bus = lcm.LCM(f"udpm://239.255.76.67:{port}?ttl=0")
    incoming, outgoing = ("request", "reply") if side == "echo" else ("reply", "request")
    received = []
    bus.subscribe(incoming, lambda _channel, payload: received.append(payload))

    def receive():
        while not received:
            bus.handle()
        return received.pop(0)

    return lambda payload: bus.publish(outgoing, payload), receive, lambda: None
