"""Receives commands for the driver, each with its arrival time."""

from __future__ import annotations

import time
from collections import deque
from threading import Thread

from hilrig.rig.bus import Inbox


class BlockingCommandReceiver:
    """For lockstep: the driver waits for the next command itself."""

    def __init__(self, inbox: Inbox) -> None:
        self._inbox = inbox

    def take(self) -> tuple[int, bytes]:
        """Wait for the next message; return when it arrived, ns, and the message (empty at the end)."""
        message = self._inbox.take()
        return time.monotonic_ns(), message


class CommandReceiver:
    """For real time: a thread receives the commands while the driver sleeps, and stamps each when it arrives.

    If the driver only checked for them when it wakes, a delay in the bus and one in the controller would look the same.
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
            except Exception:  # the bus is closed: no more messages, as after an empty one
                message = b""
            self._arrived.append((time.monotonic_ns(), message))

    def take(self) -> tuple[int, bytes] | None:
        """Return when the next message arrived, ns, and the message (empty at the end); None if none has arrived."""
        return self._arrived.popleft() if self._arrived else None
