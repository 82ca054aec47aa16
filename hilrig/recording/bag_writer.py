"""Writes a trial's recording: an MCAP file of ROS 2 messages, many ticks at a time.

The records are mcap's own; only the chunks are built here, from arrays. mcap's writer creates Python objects for every
message, which takes ten times as long as computing a compiled trial (decision 16).
"""

from __future__ import annotations

import struct
import zlib
from pathlib import Path
from types import TracebackType
from typing import Any

import lz4.frame
import numpy as np
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, ChunkIndex, DataEnd, Footer, Header, McapRecord, Schema, Statistics

from hilrig import __version__
from hilrig.recording.bag import MAGIC
from hilrig.recording.messages.codec import Definition

_HEAD = [
    ("opcode", "u1"), ("length", "<u8"), ("channel", "<u2"), ("sequence", "<u4"), ("log", "<u8"), ("publish", "<u8"),
]  # fmt: skip
"""Fields of a message record before its payload"""
_NO_SPAN = (2**63, 0)
"""First and last log time of a chunk without messages, ns"""


class BagWriter:
    """Writes payloads of known definitions, in the order given. Log time is trial time."""

    def __init__(self, path: Path) -> None:
        self._file = path.open("wb")
        self._file.write(MAGIC)
        self._put(Header("ros2", f"hilrig {__version__}"))
        self._schemas: list[Schema] = []
        self._channels: dict[str, Channel] = {}
        self._counts: dict[int, int] = {}
        self._chunks: list[ChunkIndex] = []
        self._content = bytearray()
        self._entries: dict[int, list[bytes]] = {}
        self._span = _NO_SPAN

    def add_channel(self, name: str, definition: Definition) -> None:
        """Open the channel `name` (topic /<name>) for messages of this definition."""
        number = len(self._channels) + 1
        schema = Schema(id=number, name=definition.name, encoding="ros2msg", data=definition.text.encode())
        channel = Channel(id=number, topic=f"/{name}", message_encoding="cdr", metadata={}, schema_id=number)
        self._schemas.append(schema)
        self._channels[name] = channel
        self._counts[number] = 0
        self._content += _bytes(schema, channel)

    def write(self, name: str, payloads: np.ndarray, ticks: np.ndarray, period: float) -> None:
        """Record payloads (N, bytes) as of `ticks` (N,); their log time is tick * period, s."""
        count, size = payloads.shape
        times = np.rint(ticks * period * 1e9).astype(np.uint64)
        rows = np.empty(count, np.dtype([*_HEAD, ("payload", "u1", (size,))]))
        rows["opcode"], rows["length"] = Opcode.MESSAGE, rows.itemsize - 9
        rows["channel"] = number = self._channels[name].id
        rows["sequence"] = ticks & 0xFFFFFFFF
        rows["log"] = rows["publish"] = times
        rows["payload"] = payloads
        entries = np.stack([times, (len(self._content) + rows.itemsize * np.arange(count)).astype(np.uint64)], axis=1)
        self._note(number, count, entries.tobytes(), int(times.min()), int(times.max()))
        self._content += rows.data.cast("B")

    def _note(self, channel: int, count: int, entries: bytes, first: int, last: int) -> None:
        self._entries.setdefault(channel, []).append(entries)
        self._counts[channel] += count
        start, end = self._span
        self._span = (min(first, start), max(last, end))

    def end_chunk(self) -> None:
        """Write the collected messages to disk as a chunk with its index; write nothing if there are none."""
        if not self._entries:
            return
        data = lz4.frame.compress(self._content)
        span = dict(zip(("message_start_time", "message_end_time"), self._span, strict=True))
        sizes = {"compression": "lz4", "uncompressed_size": len(self._content)}
        start = self._file.tell()
        self._put(Chunk(data=data, uncompressed_crc=zlib.crc32(self._content), **span, **sizes))
        length, offsets = self._file.tell() - start, {}
        for number, entries in self._entries.items():
            offsets[number] = self._file.tell()
            self._file.write(_message_index(number, b"".join(entries)))
        self._chunks.append(
            ChunkIndex(
                chunk_start_offset=start, chunk_length=length, message_index_offsets=offsets,
                message_index_length=self._file.tell() - start - length, compressed_size=len(data), **span, **sizes,
            )
        )  # fmt: skip
        self._content, self._entries, self._span = bytearray(), {}, _NO_SPAN

    def close(self) -> None:
        """Write the index and close the file."""
        self.end_chunk()
        self._put(DataEnd(0))
        start = self._file.tell()
        summary = _bytes(*self._schemas, *self._channels.values(), self._statistics(), *self._chunks)
        self._file.write(summary)
        # The checksum covers the footer up to the checksum.
        crc = zlib.crc32(struct.pack("<BQQQ", Opcode.FOOTER, 20, start, 0), zlib.crc32(summary))
        self._put(Footer(summary_start=start, summary_offset_start=0, summary_crc=crc))
        self._file.write(MAGIC)
        self._file.close()

    def _statistics(self) -> Statistics:
        spans = [(chunk.message_start_time, chunk.message_end_time) for chunk in self._chunks] or [(0, 0)]
        return Statistics(
            attachment_count=0, metadata_count=0, schema_count=len(self._schemas), channel_count=len(self._channels),
            chunk_count=len(self._chunks), channel_message_counts=self._counts,
            message_count=sum(self._counts.values()),
            message_start_time=min(start for start, _ in spans), message_end_time=max(end for _, end in spans),
        )  # fmt: skip

    def _put(self, record: McapRecord) -> None:
        self._file.write(_bytes(record))

    def __enter__(self) -> BagWriter:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def _bytes(*records: Any) -> bytes:
    stream = RecordBuilder()
    for record in records:
        record.write(stream)
    return stream.end()


def _message_index(channel: int, entries: bytes) -> bytes:
    """Return a message index record: where each message of a channel begins in the preceding chunk."""
    stream = RecordBuilder()
    stream.start_record(Opcode.MESSAGE_INDEX)
    stream.write2(channel)
    stream.write4(len(entries))
    stream.write(entries)
    stream.finish_record()
    return stream.end()
