"""Bare zenoh with the rig's configuration: same link, session, publisher and queue, without hilrig's code on top."""

import zenoh

from hilrig.rig.bus import DEPTH, configuration


def open_link(side, folder):
    """Open one side; the echoing side listens, as the driver does, and the other connects."""
    endpoint = [f"unixsock-stream/{folder}/pair.sock"]
    listen, connect = (endpoint, []) if side == "echo" else ([], endpoint)
    session = zenoh.open(configuration(listen, connect))
    incoming, outgoing = ("request", "reply") if side == "echo" else ("reply", "request")
    subscriber = session.declare_subscriber(f"pair/{incoming}", zenoh.handlers.FifoChannel(DEPTH))
    blocking = zenoh.CongestionControl.BLOCK
    publisher = session.declare_publisher(f"pair/{outgoing}", express=True, congestion_control=blocking)
    receive = subscriber.recv
    return publisher.put, lambda: receive().payload.to_bytes(), session.close
