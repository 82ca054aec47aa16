"""Receives the measurements for the controller. What cannot be one that comes now is passed over."""

from __future__ import annotations

import time
from collections.abc import Callable

from hilrig.rig.bus import DEPTH, Inbox
from hilrig.rig.frames import TickScreen

END = b""
"""In place of a message: no more will come"""
SLACK = 3
"""Ticks that a measurement may be ahead of its time: the two processes do not start counting together"""
HURRY = 2
"""How many times as fast as the period the ticks may come: a plant's own clock may run faster"""


class StateReceiver:
    """Gives every measurement in lockstep; in real time the newest one that has arrived."""

    def __init__(self, inbox: Inbox, screen: TickScreen, ticks: int, period: float, realtime: bool) -> None:
        self._inbox, self._last = inbox, ticks - 1
        self.screen = screen
        """Judges the measurements; its `last` is the tick of the one that was taken"""
        self._period_ns = round(period * 1e9)
        # Of the first measurement it is only known that the trial began later than this.
        self._heard = time.monotonic_ns()
        self._ended = False
        self.take: Callable[[], bytes] = self._take_newest if realtime else self._take_next
        """Wait for the next measurement and return it, or END"""

    def _take_next(self) -> bytes:
        screen = self.screen
        if screen.newest < self._last:
            screen.newest += 1
        while not self._ended:
            message = self._inbox.take()
            if screen.passes(message):
                return message
            self._ended = message == screen.end
        return END

    def _take_newest(self) -> bytes:
        newest = END
        while not newest and not self._ended:
            message: bytes | None = self._inbox.take()
            self._permit()
            for _ in range(DEPTH):
                if self.screen.passes(message):
                    newest = message
                elif message == self.screen.end:
                    self._ended = True
                message = None if self._ended else self._inbox.poll()
                if message is None:
                    break
        return newest

    def _permit(self) -> None:
        """Set the newest tick that can come by now."""
        screen, now = self.screen, time.monotonic_ns()
        ahead = SLACK + HURRY * (now - self._heard) // self._period_ns
        screen.newest = min(max(screen.last + ahead, screen.newest), self._last)
        self._heard = now if screen.last >= 0 else self._heard
