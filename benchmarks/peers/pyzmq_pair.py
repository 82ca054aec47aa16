"""pyzmq: a PAIR of sockets over ipc."""

import zmq  # pyright: ignore[reportMissingImports]


def open_link(side, folder):
    """Open one side; the echoing side binds."""
    context = zmq.Context()
    link = context.socket(zmq.PAIR)
    address = f"ipc://{folder}/pair.sock"
    if side == "echo":
        link.bind(address)
    else:
        link.connect(address)
    return link.send, link.recv, lambda: context.destroy(linger=1000)
