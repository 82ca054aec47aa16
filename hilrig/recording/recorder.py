"""Stores a trial's messages and counts them: how many were sent, how many stored, and which are missing."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hilrig.recording.bag_writer import BagWriter
from hilrig.recording.messages.codec import TICK, Codec, Definition

CHUNK_SIZE = 128 * 1024
"""Minimum bytes of a chunk, about a tenth of a second at 1 ms: a crash loses the chunk that is not yet written"""
MOST_GAPS = 20
"""Maximum number of gaps listed per channel; all are counted."""
TIMING = ("driver_timing", "controller_timing")
"""The channels of time stamps"""


class Account:
    """The messages of one channel: how many were sent and stored, and which ticks are missing."""

    def __init__(self) -> None:
        self.stored = 0
        self.sent: int | None = None
        self.gaps: list[list[int]] = []
        self.gap_count = 0
        self._next = 0

    def note(self, ticks: NDArray[np.int64]) -> None:
        """Count the stored messages of these ticks, (N,) ascending, and the gaps before and between them."""
        before = np.concatenate([[self._next], ticks[:-1] + 1])
        missing = np.flatnonzero(ticks > before)
        self.gap_count += missing.size
        for i in missing[: MOST_GAPS - len(self.gaps)]:
            self.gaps.append([int(before[i]), int(ticks[i]) - 1])
        self._next = int(ticks[-1]) + 1
        self.stored += ticks.size

    def summary(self) -> dict[str, Any]:
        """Return sent, stored, lost (None if the sender never gave its count) and the gaps, [first, last] tick each."""
        lost = None if self.sent is None else self.sent - self.stored
        return {
            "sent": self.sent, "stored": self.stored, "lost": lost, "gap_count": self.gap_count, "gaps": self.gaps,
        }  # fmt: skip


def added(one: Mapping[str, int], other: Mapping[str, int]) -> dict[str, int]:
    """Return the sums of two counts."""
    return {key: one.get(key, 0) + other.get(key, 0) for key in sorted({*one, *other})}


class Recorder:
    """Writes bag.mcap in a trial's directory."""

    def __init__(self, directory: Path, period: float, definitions: Mapping[str, Definition]) -> None:
        self._period = period
        self._definitions = definitions
        self._bag = BagWriter(directory / "bag.mcap")
        self._accounts = {name: Account() for name in definitions}
        self._pending: dict[str, list[NDArray[np.uint8]]] = {}
        self._size = 0
        self._timing: dict[str, list[NDArray[np.uint8]]] = {name: [] for name in TIMING}
        self.refused: dict[str, dict[str, int]] = {}
        """Messages that driver and controller refused: channel -> reason -> number"""
        for name, definition in definitions.items():
            self._bag.add_channel(name, definition)

    def store(self, name: str, payloads: NDArray[np.uint8]) -> None:
        """Record messages (N, bytes) in tick order; they must not change until `write`."""
        if payloads.shape[0]:
            self._pending.setdefault(name, []).append(payloads)
            self._size += payloads.size

    def write(self, least: int = CHUNK_SIZE) -> None:
        """Write stored messages to disk if they have at least this many bytes: large writes cost less per message."""
        if self._size < least:
            return
        for name, parts in self._pending.items():
            payloads = np.concatenate(parts)
            ticks = np.ascontiguousarray(payloads[:, TICK]).view(np.int64)[:, 0]
            self._accounts[name].note(ticks)
            self._bag.write(name, payloads, ticks, self._period)
            if name in self._timing:
                self._timing[name].append(payloads)
        self._pending, self._size = {}, 0
        self._bag.end_chunk()

    def sent(self, name: str, count: int) -> None:
        """Note how many messages the sender has sent."""
        self._accounts[name].sent = count

    def ended(self, name: str) -> bool:
        """Return whether the sender of a channel gave its count, which it does at its proper end."""
        return self._accounts[name].sent is not None

    def note_refused(self, refused: Mapping[str, Mapping[str, int]]) -> None:
        """Add messages that a sender received and refused, channel -> reason -> number."""
        for channel, reasons in refused.items():
            self.refused[channel] = added(self.refused.get(channel, {}), reasons)

    def timing(self) -> dict[str, dict[str, NDArray[Any]]]:
        """Return all time stamps: channel -> field -> array (N,)."""
        self.write(0)
        return {name: self._columns(name, parts) for name, parts in self._timing.items()}

    def _columns(self, name: str, parts: list[NDArray[np.uint8]]) -> dict[str, NDArray[Any]]:
        codec = Codec(self._definitions[name], {})
        return codec.table(np.concatenate([np.zeros((0, codec.size), np.uint8), *parts]))

    def summary(self) -> dict[str, dict[str, Any]]:
        """Return the counts of every channel (`Account.summary`)."""
        self.write(0)
        return {name: account.summary() for name, account in self._accounts.items()}

    def close(self) -> None:
        """Finish the bag."""
        self.write(0)
        self._bag.close()

    def __enter__(self) -> Recorder:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
