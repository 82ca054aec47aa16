"""Receives the supervisor's orders for a process of the rig."""

from __future__ import annotations

import json
from queue import Empty, SimpleQueue
from threading import Thread
from typing import Any

from hilrig.rig.bus import NumberedInbox


class OrderReceiver:
    """Gives the orders one by one; what is none is counted and passed over.

    A thread receives them. A process that looks for orders twenty times a second, or no more at all, would let a flood
    of other messages fill its inbox; that blocks a thread of the bus, and in the end the bus.
    """

    def __init__(self, inbox: NumberedInbox) -> None:
        self._inbox = inbox
        self._orders: SimpleQueue[dict[str, Any]] = SimpleQueue()
        Thread(target=self._listen, name="orders", daemon=True).start()

    def _listen(self) -> None:
        while True:
            try:
                payload = self._inbox.take()
            except Exception:  # the bus is closed
                return
            if order := self._read(payload):
                self._orders.put(order)

    def _read(self, payload: bytes) -> dict[str, Any]:
        """Return an order; empty, and counted as refused, if it cannot be read."""
        try:
            order = json.loads(payload)
            if isinstance(order, dict) and "order" in order:
                return order
        except (ValueError, RecursionError):
            pass
        self._inbox.refuse()
        return {}

    def take(self) -> dict[str, Any]:
        """Wait for the next order; a signal that raises ends the wait."""
        return self._orders.get()

    def poll(self) -> dict[str, Any]:
        """Return the next order, empty if there is none yet."""
        try:
            return self._orders.get_nowait()
        except Empty:
            return {}

    @property
    def refused(self) -> dict[str, int]:
        """Number of messages that were refused, by reason"""
        return self._inbox.refused
