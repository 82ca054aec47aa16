"""Reads a trial's recording: an MCAP file of ROS 2 messages."""

from __future__ import annotations

import os
import struct
from collections import defaultdict
from collections.abc import Iterable, Iterator
from io import BytesIO
from pathlib import Path
from typing import IO

import lz4.frame
import numpy as np
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Channel as McapChannel
from mcap.records import Chunk, Schema

from hilrig.core.errors import RunDirectoryError
from hilrig.recording.messages.codec import Codec, Definition, parse_definition, sizes_in

MAGIC = b"\x89MCAP0\r\n"
_RECORD_HEAD = struct.Struct("<BQ")
"""Start of a record: opcode and length"""
_MESSAGE_HEAD = 22
"""Bytes of a message record before its payload: channel, sequence, log time, publish time"""


def read_bag(path: str | Path, topics: Iterable[str] | None = None) -> dict[str, dict[str, np.ndarray]]:
    """Return every field of every message: channel -> field -> array, (N,) or (N, k), in order of recording.

    `topics` selects channels (default all). From a bag that was cut off by a crash, everything that reached the disk is
    returned. Raises RunDirectoryError if the file is not a bag, or if its messages do not have the expected layout.
    """
    path = Path(path)
    wanted = None if topics is None else {topic.strip("/") for topic in topics}
    payloads: dict[str, list[bytes]] = defaultdict(list)
    definitions: dict[str, Definition] = {}
    try:
        for name, schema, payload in _messages(path, wanted):
            if name not in definitions:
                definitions[name] = parse_definition(schema.name.rsplit("/", 1)[-1], schema.data.decode())
            payloads[name].append(payload)
        return {name: _columns(definitions[name], payloads[name]) for name in payloads}
    except ValueError as error:
        raise RunDirectoryError(f"{path}: {error}") from error


def _messages(path: Path, wanted: set[str] | None) -> Iterator[tuple[str, Schema, bytes]]:
    """Yield (channel, schema, payload) of every message, up to where the file is cut off."""
    if not path.is_file():
        raise RunDirectoryError(f"{path}: there is no such bag")
    schemas: dict[int, Schema] = {}
    channels: dict[int, tuple[str, Schema] | None] = {}
    with path.open("rb") as file:
        for opcode, content in _records(file, path):
            if opcode == Opcode.MESSAGE:
                channel = channels[int.from_bytes(content[:2], "little")]
                if channel is not None:
                    yield *channel, content[_MESSAGE_HEAD:]
            elif opcode == Opcode.SCHEMA:
                schema = Schema.read(ReadDataStream(BytesIO(content)))
                schemas[schema.id] = schema
            elif opcode == Opcode.CHANNEL:
                found = McapChannel.read(ReadDataStream(BytesIO(content)))
                name = found.topic.lstrip("/")
                shown = wanted is None or name in wanted
                channels[found.id] = (name, schemas[found.schema_id]) if shown else None


def _records(file: IO[bytes], path: Path) -> Iterator[tuple[int, bytes]]:
    """Yield opcode and content of every record in the chunks.

    mcap's own readers create objects for all records, including the indexes, and are five times slower.
    """
    for chunk in _chunks(file, path):
        offset = 0
        while offset < len(chunk):
            opcode, size = _RECORD_HEAD.unpack_from(chunk, offset)
            offset += _RECORD_HEAD.size
            yield opcode, chunk[offset : offset + size]
            offset += size


def is_whole(path: Path) -> bool:
    """Return whether there is a finished bag at `path`: a finished bag ends with MAGIC."""
    if not path.is_file() or path.stat().st_size < len(MAGIC):
        return False
    with path.open("rb") as file:
        file.seek(-len(MAGIC), os.SEEK_END)
        return file.read() == MAGIC


def _chunks(file: IO[bytes], path: Path) -> Iterator[bytes]:
    """Yield every complete chunk, decompressed. A missing end, because the writer was killed, is not an error."""
    if not MAGIC.startswith(file.read(len(MAGIC))):
        raise RunDirectoryError(f"{path}: not an MCAP file: it does not start with the MCAP signature")
    while len(head := file.read(_RECORD_HEAD.size)) == _RECORD_HEAD.size:
        opcode, size = _RECORD_HEAD.unpack(head)
        if opcode == Opcode.DATA_END:
            return
        if opcode != Opcode.CHUNK:
            file.seek(size, os.SEEK_CUR)
            continue
        content = file.read(size)
        if len(content) < size:
            return
        chunk = Chunk.read(ReadDataStream(BytesIO(content)))
        yield lz4.frame.decompress(chunk.data) if chunk.compression == "lz4" else chunk.data


def _columns(definition: Definition, payloads: list[bytes]) -> dict[str, np.ndarray]:
    return Codec(definition, sizes_in(definition, payloads[0])).columns(payloads)
