"""Sends what the loop has recorded, from a thread of its own: in real time the loop waits for nobody."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from queue import Empty, SimpleQueue
from threading import Event, Thread

MOST = 1000
"""Parcels that may wait, half a minute of them; the logger then misses the oldest, and the trial says so"""


class BackgroundSender:
    """Hands messages to `put`, in order, and never makes the one who sends wait."""

    def __init__(self, put: Callable[[bytes], None]) -> None:
        self._put = put
        self._queue: SimpleQueue[bytes | None] = SimpleQueue()
        self._idle = Event()
        self._thread = Thread(target=self._carry, name="sender", daemon=True)
        self._thread.start()

    def send(self, message: bytes) -> None:
        """Send a message soon; if too many wait already, drop the one that waits longest.

        Not this one: the last message is what the logger waits for.
        """
        if self._queue.qsize() >= MOST:
            with suppress(Empty):
                self._queue.get_nowait()
        self._queue.put(message)

    def _carry(self) -> None:
        while (message := self._queue.get()) is not None:
            self._put(message)
            if self._queue.empty():
                self._idle.set()

    def rest(self) -> None:
        """Wait until what was sent has gone out; for use before the loop."""
        self._idle.clear()
        self.send(b"")
        self._idle.wait()

    def finish(self) -> None:
        """Wait until all has been sent."""
        self._queue.put(None)
        self._thread.join()
