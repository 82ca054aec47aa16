"""Receives commands for the driver, each with its arrival time, and passes over what cannot be a command."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable
from threading import Thread

from hilrig.rig.bus import Inbox
from hilrig.rig.frames import TickScreen

END = b""
"""In place of a message: no more will come"""


class BlockingCommandReceiver:
    """For lockstep: the driver waits for the next command itself."""

    def __init__(self, inbox: Inbox, screen: TickScreen, wait: Callable[[Callable[[], bytes]], bytes]) -> None:
        """`wait` calls what waits for a message, so that a signal can end the wait."""
        self._inbox, self._screen, self._wait = inbox, screen, wait

    def take(self) -> tuple[int, bytes]:
        """Wait for the next message; return when it arrived, ns, and the message, or END."""
        while True:
            message = self._wait(self._inbox.take)
            if self._screen.passes(message):
                return time.monotonic_ns(), message
            if message == self._screen.end:
                return time.monotonic_ns(), END


class CommandReceiver:
    """For real time: a thread receives the commands while the driver sleeps, and stamps each when it arrives.

    If the driver only checked for them when it wakes, a delay in the bus and one in the controller would look the same.
    The thread also passes over what is no command, so that a flood of it does not delay the loop.
    """

    def __init__(self, inbox: Inbox, screen: TickScreen) -> None:
        self._inbox, self._screen = inbox, screen
        self._arrived: deque[tuple[int, bytes]] = deque()
        Thread(target=self._listen, name="receiver", daemon=True).start()

    def _listen(self) -> None:
        while True:
            try:
                message = self._inbox.take()
            except Exception:  # the bus is closed
                break
            if self._screen.passes(message):
                self._arrived.append((time.monotonic_ns(), message))
            elif message == self._screen.end:
                break
        self._arrived.append((time.monotonic_ns(), END))

    def take(self) -> tuple[int, bytes] | None:
        """Return when the next message arrived, ns, and the message, or END; None if none has arrived."""
        return self._arrived.popleft() if self._arrived else None
