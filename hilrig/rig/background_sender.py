"""Sends packets to the logger from its own thread, so that in real time the loop never waits for the bus."""

from __future__ import annotations

import traceback
from collections.abc import Callable
from contextlib import suppress
from queue import Empty, SimpleQueue
from threading import Event, Thread

MOST_WAITING = 1000
"""Packets that may wait, half a minute's worth; beyond that the oldest are dropped, and counted as lost"""
FLUSH_TIMEOUT_S = 60.0
"""How long the queued packets may take to be sent"""


class BackgroundSender:
    """Hands packets to `put` in order, from its own thread. Sending never blocks the caller."""

    def __init__(self, put: Callable[[bytes], None]) -> None:
        self._put = put
        self._queue: SimpleQueue[bytes | None] = SimpleQueue()
        self._idle = Event()
        self._thread = Thread(target=self._run, name="sender", daemon=True)
        self._thread.start()

    def send(self, packet: bytes) -> None:
        """Queue a packet; if the queue is full, drop the oldest.

        The newest is kept because the logger waits for the last one.
        """
        if self._queue.qsize() >= MOST_WAITING:
            with suppress(Empty):
                self._queue.get_nowait()
        self._queue.put(packet)

    def _run(self) -> None:
        while (packet := self._queue.get()) is not None:
            try:
                self._put(packet)
            except Exception:  # the bus is cut: what cannot be sent is lost, and will be counted as such
                traceback.print_exc()
            if self._queue.empty():
                self._idle.set()

    def flush(self) -> None:
        """Wait until the queue is empty, `FLUSH_TIMEOUT_S` at most. Sends an empty packet: use it before the loop."""
        self._idle.clear()
        self.send(b"")
        self._idle.wait(FLUSH_TIMEOUT_S)

    def finish(self) -> None:
        """Wait until everything is sent, `FLUSH_TIMEOUT_S` at most, and end the thread."""
        self._queue.put(None)
        self._thread.join(FLUSH_TIMEOUT_S)
