"""How a trial's messages reach the logger.

State and command are what the loop waits for: each goes out alone, at once, to the one process that needs it. For the
record every sender keeps its messages in batches, one row a tick, and hands many to the logger at a time: a message
of its own for each would wake the logger six times a tick and cost the loop more than the control law.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterator, Mapping

import numpy as np
from numpy.typing import NDArray

from hilrig.core.errors import RigError
from hilrig.recording.messages.codec import Codec
from hilrig.recording.messages.layouts import CHANNELS
from hilrig.recording.messages.record_batch import RecordBatch

PARCEL = 32
"""Ticks in one message to the logger, at most: what a killed sender takes with it"""
LARGEST = 60_000
"""Bytes in one message; a low-latency link drops in silence what is larger than 65,000"""
NAMES = tuple(CHANNELS)
DRIVER = ("state", "truth", "driver_timing")
CONTROLLER = ("command", "internals", "controller_timing")

_FRAME = struct.Struct("<BII")
"""Before the messages of a channel: its number, how many there are, bytes of each"""
_PRACTICE = 0x40
"""Marks a frame whose content means nothing"""
_COUNT = 0x80
"""Marks a frame that tells how many messages there were on its channel in all"""


class RecordBatches:
    """A sender's messages of the last ticks, one batch for each of its channels."""

    def __init__(self, codecs: Mapping[str, Codec], names: tuple[str, ...], rows: int) -> None:
        self.rows = rows
        """Rows of each batch: ticks that are handed over at a time"""
        self.batches = {name: RecordBatch(codecs[name], rows) for name in names}
        self.written = dict.fromkeys(names, 0)
        """Rows that are written and not handed over, by channel; the sender counts them"""
        self.counts = dict.fromkeys(names, 0)
        """Messages that were handed over, by channel"""

    def hand_over(self) -> Iterator[tuple[str, NDArray[np.uint8]]]:
        """Yield (channel, messages (N, bytes)) that are written; they are overwritten from now on."""
        for name, rows in self.written.items():
            self.written[name] = 0
            self.counts[name] += rows
            if rows:
                yield name, self.batches[name].payloads[:rows]


class Record(RecordBatches):
    """A sender's batches, and the way of their messages to the logger."""

    def __init__(self, put: Callable[[bytes], None], codecs: Mapping[str, Codec], names: tuple[str, ...]) -> None:
        """`put` sends one packet. Raises RigError if the messages of one tick are too large for one."""
        tick = sum(codecs[name].size for name in names)
        if 2 * tick > LARGEST:
            raise RigError(
                f"the record of a tick ({', '.join(names)}) takes {tick} bytes; the bus takes {LARGEST // 2} at most, "
                "--in-process any number"
            )
        super().__init__(codecs, names, min(PARCEL, LARGEST // tick))
        self._put = put
        *self._signals, self._timing = names
        self.stamps: list[tuple[float, ...]] = []
        """Messages of the last channel, which holds time stamps: they go onto its batch when they are shipped, all at a
        time, for what is done once in the loop finds nothing in the processor's caches"""

    def wrote(self, row: int) -> None:
        """Note that all batches but that of the stamps are written as far as `row`."""
        for name in self._signals:
            self.written[name] = row + 1

    def ship(self) -> None:
        """Hand over to the logger."""
        self.batches[self._timing].write(self.stamps)
        self.written[self._timing] = len(self.stamps)
        self.stamps.clear()
        frames: list[bytes] = []
        for name, payloads in self.hand_over():
            frames += (_FRAME.pack(NAMES.index(name), *payloads.shape), payloads.tobytes())
        if frames:
            self._put(b"".join(frames))

    def rehearse(self) -> None:
        """Send a packet as large as those to come, which nobody reads."""
        size = sum(batch.payloads.size for batch in self.batches.values())
        self._put(_FRAME.pack(_PRACTICE, 1, size) + bytes(size))

    def end(self) -> None:
        """Hand over the rest, and how many messages there were on each channel."""
        self.ship()
        self._put(b"".join(_FRAME.pack(NAMES.index(name) | _COUNT, n, 0) for name, n in self.counts.items()))


def unpack_batches(packet: bytes) -> Iterator[tuple[str, NDArray[np.uint8], int | None]]:
    """Yield (channel, messages (N, bytes), None) for the messages in a packet, (channel, none, count) at the end."""
    offset = 0
    while offset < len(packet):
        number, rows, size = _FRAME.unpack_from(packet, offset)
        offset += _FRAME.size
        if number & _COUNT:
            yield NAMES[number & ~_COUNT], np.zeros((0, 0), np.uint8), rows
            continue
        if number == _PRACTICE:
            offset += rows * size
            continue
        yield NAMES[number], np.frombuffer(packet, np.uint8, rows * size, offset).reshape(rows, size), None
        offset += rows * size
