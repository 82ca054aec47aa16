"""How a trial's messages reach the logger.

The loop waits for state and command: each is sent alone, at once, to the one process that needs it. For the record, a
sender keeps its messages in record batches, one row per tick, and sends the logger many ticks in one packet. Sent one
by one, they would wake the logger six times per tick and cost the loop more than the control law.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Callable, Iterator, Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hilrig.core.errors import RigError
from hilrig.recording.messages.codec import LEAD, Codec
from hilrig.recording.messages.layouts import CHANNELS
from hilrig.recording.messages.record_batch import RecordBatch

PACKET_TICKS = 32
"""Maximum ticks in one packet to the logger in real time; they are lost if the sender is killed"""
LOCKSTEP_PACKET_TICKS = 80
"""The same in lockstep, where a packet delays nothing, and what is lost can be computed again"""
PACKET_BYTES = 60_000
"""Maximum bytes in one packet; a low-latency link silently drops messages above 65,000"""
NAMES = tuple(CHANNELS)
DRIVER_CHANNELS = ("state", "truth", "applied", "stages", "driver_timing")
CONTROLLER_CHANNELS = ("command", "internals", "controller_timing")

_FRAME = struct.Struct("<BII")
"""Frame header before a channel's messages in a packet: the channel's number, how many messages, bytes of each"""
_PRACTICE = 0x40
"""Marks a frame whose content is ignored"""
_COUNT = 0x80
"""Marks a frame that gives the number of all messages on its channel"""
_REFUSED = 0x20
"""Marks a frame that says how many messages its sender received and refused, as JSON"""


class Part(NamedTuple):
    """One part of a packet: messages of a channel, or their number at its end, or what its sender refused."""

    channel: str
    payloads: NDArray[np.uint8]
    """(N, bytes)"""
    total: int | None = None
    """Number of all messages on the channel, which ends here"""
    refused: Mapping[str, Mapping[str, int]] | None = None
    """Channel -> reason -> number of messages"""


NO_PAYLOADS = np.zeros((0, 0), np.uint8)


class RecordBatches:
    """A sender's messages of the last ticks, one record batch for each of its channels."""

    def __init__(
        self, codecs: Mapping[str, Codec], names: tuple[str, ...], rows: int, leads: Mapping[str, bytes] | None = None
    ) -> None:
        """`leads` are the first bytes of the messages that also go out one by one, by channel."""
        self.rows = rows
        """Rows per batch: how many ticks are handed over together"""
        leads = leads or {}
        self.batches = {name: RecordBatch(codecs[name], rows, leads.get(name, LEAD)) for name in names}
        self.written = dict.fromkeys(names, 0)
        """Rows that are written but not yet handed over, by channel; the sender counts them"""
        self.counts = dict.fromkeys(names, 0)
        """Messages that were handed over, by channel"""

    def hand_over(self) -> Iterator[tuple[str, NDArray[np.uint8]]]:
        """Yield (channel, messages (N, bytes)) of the rows that are written; the next ticks overwrite them."""
        for name, rows in self.written.items():
            self.written[name] = 0
            self.counts[name] += rows
            if rows:
                yield name, self.batches[name].payloads[:rows]


class RecordSender(RecordBatches):
    """A sender's record batches, and how they go to the logger."""

    def __init__(
        self, put: Callable[[bytes], None], codecs: Mapping[str, Codec], names: tuple[str, ...],
        leads: Mapping[str, bytes] | None = None, realtime: bool = True,
    ) -> None:  # fmt: skip
        """`put` sends one packet; the last channel is that of the time stamps; `leads` as in `RecordBatches`.

        Raises RigError if the messages of one tick are too large for a packet.
        """
        ticks = PACKET_TICKS if realtime else LOCKSTEP_PACKET_TICKS
        tick = sum(codecs[name].size for name in names)
        if 2 * tick > PACKET_BYTES:
            raise RigError(
                f"the messages of one tick ({', '.join(names)}) take {tick} bytes, but the bus takes at most "
                f"{PACKET_BYTES // 2}: give the law a smaller memory, or run with --in-process, which has no limit"
            )
        super().__init__(codecs, names, min(ticks, PACKET_BYTES // tick), leads)
        self._put = put
        *self._signals, self._timing = names
        self.stamps: list[tuple[float, ...]] = []
        """Messages of the last channel, which holds the time stamps. They are all written into its batch when the batch
        is sent: code that runs once per tick has left the processor's caches by the next tick"""

    def wrote(self, row: int) -> None:
        """Note that all batches except that of the stamps are written up to `row`."""
        for name in self._signals:
            self.written[name] = row + 1

    def ship(self) -> None:
        """Send the logger everything that is written."""
        self.batches[self._timing].write(self.stamps)
        self.written[self._timing] = len(self.stamps)
        self.stamps.clear()
        frames: list[bytes] = []
        for name, payloads in self.hand_over():
            frames += (_FRAME.pack(NAMES.index(name), *payloads.shape), payloads.tobytes())
        if frames:
            self._put(b"".join(frames))

    def rehearse(self) -> None:
        """Send a packet as large as the later ones; the logger skips its content."""
        size = sum(batch.payloads.size for batch in self.batches.values())
        self._put(_FRAME.pack(_PRACTICE, 1, size) + bytes(size))

    def end(self, refused: Mapping[str, Mapping[str, int]] | None = None) -> None:
        """Send the rest, what this process refused (channel -> reason -> number), and the number of all messages."""
        self.ship()
        text = json.dumps(refused or {}).encode()
        counts = (_FRAME.pack(NAMES.index(name) | _COUNT, n, 0) for name, n in self.counts.items())
        self._put(b"".join((_FRAME.pack(_REFUSED, 1, len(text)), text, *counts)))


def unpack_batches(packet: bytes) -> list[Part]:
    """Return the parts of a packet. Raises ValueError if it is none."""
    try:
        return list(_parts(packet))
    except (struct.error, IndexError, TypeError, AttributeError, OverflowError) as error:
        raise ValueError(f"not a packet of messages: {error}") from error


def _parts(packet: bytes) -> Iterator[Part]:
    offset = 0
    while offset < len(packet):
        number, rows, size = _FRAME.unpack_from(packet, offset)
        offset += _FRAME.size
        if number & _COUNT:
            yield Part(NAMES[number & ~_COUNT], NO_PAYLOADS, rows)
            continue
        content = np.frombuffer(packet, np.uint8, rows * size, offset)
        offset += rows * size
        if number == _REFUSED:
            found = {str(name): {**reasons} for name, reasons in json.loads(content.tobytes()).items()}
            yield Part(NAMES[0], NO_PAYLOADS, refused=found)
        elif number != _PRACTICE:
            yield Part(NAMES[number], content.reshape(rows, size))
