"""A sender that delays and loses messages as specified by the faults of a trial."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from queue import SimpleQueue
from threading import Thread

from hilrig.rig.bus import Outbox
from hilrig.rig.frames import tick_of

Note = Callable[[int, str, int, int], None]
"""Called with (tick, "delay" or "loss", begin, end), times in ns of CLOCK_MONOTONIC"""


class FaultyOutbox(Outbox):
    """Sends on the key of another outbox. `delays` (tick -> ns) and `losses` (tick -> any) give the messages concerned.

    `put` returns at once. A thread sends the delayed messages, in order: a message put while another is delayed waits
    behind it, as on a stalled link.
    """

    def __init__(self, outbox: Outbox, delays: Mapping[int, int], losses: Mapping[int, int], note: Note) -> None:
        self._outbox, self._delays, self._losses, self._note = outbox, delays, losses, note
        self.lead = outbox.lead
        self._held: SimpleQueue[tuple[int, int, int, bytes] | None] = SimpleQueue()
        # Each is written by one thread only. If they are equal, no message is held.
        self._taken, self._sent = 0, 0
        self.put = self._put
        self._thread = Thread(target=self._send_held, name="held messages", daemon=True)
        self._thread.start()

    def _put(self, payload: bytes) -> None:
        tick, now = tick_of(payload), time.monotonic_ns()
        if tick in self._losses:
            self._note(tick, "loss", now, now)
            return
        delay = self._delays.get(tick, 0)
        if not delay and self._taken == self._sent:
            self._outbox.put(payload)
            return
        self._taken += 1
        self._held.put((tick, now, delay, bytes(payload)))

    def _send_held(self) -> None:
        while (item := self._held.get()) is not None:
            tick, begin, delay, payload = item
            if (left := begin + delay - time.monotonic_ns()) > 0:
                time.sleep(left / 1e9)
            self._outbox.put(payload)
            if delay:
                self._note(tick, "delay", begin, time.monotonic_ns())
            self._sent += 1

    def end(self) -> None:
        """Send the held messages, each at its time, then the empty message that ends the channel."""
        self._held.put(None)
        self._thread.join()
        self._outbox.end()
