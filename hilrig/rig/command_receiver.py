"""Receives commands for the driver, each with its arrival time, and passes over what cannot be a command."""

from __future__ import annotations

import time
from collections import deque
from threading import Thread
from typing import Protocol

from hilrig.rig.bus import Inbox
from hilrig.rig.frames import TickScreen

Arrival = tuple[int, int, bytes]
"""Tick of a command, when it arrived (ns), and its message; the message is END if no more will come"""
END = b""


class Interruptions(Protocol):
    """The signals of a process, as `rig/child.py` handles them."""

    raising: bool
    """Whether a signal raises Stopped wherever the main thread is"""
    told: str
    """Why the process must end; empty if it must not"""

    def check(self) -> None:
        """Raise Stopped if a signal has come, once."""
        ...


class BlockingCommandReceiver:
    """For lockstep: the driver waits for the next command itself."""

    def __init__(self, inbox: Inbox, screen: TickScreen, signals: Interruptions) -> None:
        """A signal can end the wait for a message."""
        self._inbox, self._screen, self._signals = inbox, screen, signals

    def take(self) -> Arrival:
        """Wait for the next command. Raises Stopped."""
        screen, signals = self._screen, self._signals
        signals.raising = True
        try:
            if signals.told:
                signals.check()
            message = self._inbox.take()
            while not screen.passes(message):
                if message == screen.end:
                    return screen.last, time.monotonic_ns(), END
                message = self._inbox.take()
            return screen.last, time.monotonic_ns(), message
        finally:
            signals.raising = False


class CommandReceiver:
    """For real time: a thread receives the commands while the driver sleeps, and stamps each when it arrives.

    If the driver only checked for them when it wakes, a delay in the bus and one in the controller would look the same.
    The thread also passes over what is no command, so that a flood of it does not delay the loop.
    """

    def __init__(self, inbox: Inbox, screen: TickScreen) -> None:
        self._inbox, self._screen = inbox, screen
        self._arrived: deque[Arrival] = deque()
        Thread(target=self._listen, name="receiver", daemon=True).start()

    def _listen(self) -> None:
        while True:
            try:
                message = self._inbox.take()
            except Exception:  # the bus is closed
                break
            if self._screen.passes(message):
                self._arrived.append((self._screen.last, time.monotonic_ns(), message))
            elif message == self._screen.end:
                break
        self._arrived.append((self._screen.last, time.monotonic_ns(), END))

    def take(self) -> Arrival | None:
        """Return the next command; None if none has arrived."""
        return self._arrived.popleft() if self._arrived else None
