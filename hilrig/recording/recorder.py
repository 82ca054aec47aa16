"""Stores a trial's messages and keeps account: what was sent, what was stored, what is missing."""

from __future__ import annotations

from collections import defaultdict
from pathlib import Path
from types import TracebackType
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hilrig.messages.codec import Definition
from hilrig.recording.bag_writer import BagWriter

MOST_GAPS = 20
"""Gaps listed per channel; all of them are counted."""


class Account:
    """What is known of one channel."""

    def __init__(self) -> None:
        self.stored = 0
        self.sent: int | None = None
        self.gaps: list[list[int]] = []
        self.gap_count = 0
        self._next = 0

    def note(self, tick: int, count: int = 1) -> None:
        """Count `count` stored messages from `tick` on, and any ticks missing before it."""
        if tick > self._next:
            self.gap_count += 1
            if len(self.gaps) < MOST_GAPS:
                self.gaps.append([self._next, tick - 1])
        self._next = tick + count
        self.stored += count

    def summary(self) -> dict[str, Any]:
        """Return sent, stored, lost (None where the sender never said) and the gaps, [first, last] tick each."""
        lost = None if self.sent is None else self.sent - self.stored
        return {
            "sent": self.sent, "stored": self.stored, "lost": lost, "gap_count": self.gap_count, "gaps": self.gaps,
        }  # fmt: skip


class Channel(NamedTuple):
    """A channel of the bag."""

    name: str
    definition: Definition
    per_tick: bool
    """One message per tick; otherwise one message holds many ticks"""


class Recorder:
    """Writes bag.mcap in a trial's directory."""

    def __init__(self, directory: Path, period: float, channels: list[Channel]) -> None:
        self._period = period
        self._bag = BagWriter(directory / "bag.mcap")
        self._accounts: dict[str, Account] = {}
        self._per_tick = {channel.name: channel.per_tick for channel in channels}
        self.timing: dict[str, list[bytes]] = defaultdict(list)
        """Payloads of the channels that are not per tick, kept for the timing summary"""
        for channel in channels:
            self._bag.add_channel(channel.name, channel.definition)
            self._accounts[channel.name] = Account()

    def store(self, name: str, payload: bytes) -> None:
        """Record one message."""
        tick = int.from_bytes(payload[4:12], "little")
        account = self._accounts[name]
        if self._per_tick[name]:
            account.note(tick)
        else:
            account.stored += 1
            self.timing[name].append(payload)
        self._bag.write(name, payload, tick, self._period)

    def store_rows(self, name: str, payloads: NDArray[np.uint8], ticks: NDArray[np.int64]) -> None:
        """Record the messages of ticks that follow one another, (N, bytes)."""
        if ticks.size:
            self._accounts[name].note(int(ticks[0]), ticks.size)
            self._bag.write_rows(name, payloads, ticks, self._period)

    def end_block(self) -> None:
        """Write what has been stored to the disk."""
        self._bag.end_chunk()

    def sent(self, name: str, count: int) -> None:
        """Note how many messages the sender says it sent."""
        self._accounts[name].sent = count

    def summary(self) -> dict[str, dict[str, Any]]:
        """Return the account of every channel."""
        return {name: account.summary() for name, account in self._accounts.items()}

    def close(self) -> None:
        """Finish the bag."""
        self._bag.close()

    def __enter__(self) -> Recorder:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
