"""How commands come to the driver, each with the moment at which it came in."""

from __future__ import annotations

import time
from collections import deque
from threading import Thread

from hilrig.rig.bus import Inbox


class Waiting:
    """In lockstep: the driver has nothing to do but wait for the next command."""

    def __init__(self, inbox: Inbox) -> None:
        self._inbox = inbox

    def take(self) -> tuple[int, bytes]:
        """Return when the next message came in, ns, and the message; empty: it was the last."""
        message = self._inbox.take()
        return time.monotonic_ns(), message


class CommandReceiver:
    """In real time: a thread takes the commands while the driver sleeps, so that each is stamped when it comes.

    A driver that looked for them when it wakes would not know whether the bus or the controller took long.
    """

    def __init__(self, inbox: Inbox) -> None:
        self._inbox = inbox
        self._arrived: deque[tuple[int, bytes]] = deque()
        Thread(target=self._listen, name="receiver", daemon=True).start()

    def _listen(self) -> None:
        message = b"?"
        while message:
            try:
                message = self._inbox.take()
            except Exception:  # the bus is closed: nothing comes any more, as if this had been said
                message = b""
            self._arrived.append((time.monotonic_ns(), message))

    def take(self) -> tuple[int, bytes] | None:
        """Return when the next message came in, ns, and the message, if there is one; empty: it was the last."""
        return self._arrived.popleft() if self._arrived else None
