"""A trial's recording: an MCAP file of ROS 2 messages, as they came off the bus."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator
from pathlib import Path
from types import TracebackType
from typing import IO, Any, cast

import numpy as np
from mcap.exceptions import EndOfFile, McapError
from mcap.reader import NonSeekingReader
from mcap.writer import CompressionType, Writer

from hilrig import __version__
from hilrig.errors import RunDirectoryError
from hilrig.messages.codec import Codec, Definition, parse, sizes_in

CHUNK_SIZE = 64 * 1024
"""Bytes. After a crash at most the last chunk is lost."""


class BagWriter:
    """Writes payloads of known definitions, in the order given. Log time is trial time."""

    def __init__(self, path: Path) -> None:
        self._file = path.open("wb")
        self._writer = Writer(self._file, chunk_size=CHUNK_SIZE, compression=CompressionType.LZ4)
        self._writer.start(profile="ros2", library=f"hilrig {__version__}")
        self._channels: dict[str, int] = {}

    def add_channel(self, name: str, definition: Definition) -> None:
        """Open the channel `name` (topic /<name>) for messages of this definition."""
        schema = self._writer.register_schema(definition.name, "ros2msg", definition.text.encode())
        self._channels[name] = self._writer.register_channel(f"/{name}", "cdr", schema)

    def write(self, name: str, payload: bytes, tick: int, period: float) -> None:
        """Record one payload as of `tick` (time = tick * period, s)."""
        time = round(tick * period * 1e9)
        self._writer.add_message(self._channels[name], time, payload, time, tick & 0xFFFFFFFF)

    def close(self) -> None:
        """Write the index and close the file."""
        self._writer.finish()
        self._file.close()

    def __enter__(self) -> BagWriter:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def read_bag(path: Path, topics: Iterable[str] | None = None) -> dict[str, dict[str, np.ndarray]]:
    """Return every field of every message: channel -> field -> array, (N,) or (N, k), in order of recording.

    `topics` selects channels (default all). A bag that was cut off by a crash gives all that reached the disk. Timing
    channels, which carry many ticks a message, come out one row per tick. Raises RunDirectoryError if it is no bag.
    """
    wanted = None if topics is None else {topic.strip("/") for topic in topics}
    payloads: dict[str, list[bytes]] = defaultdict(list)
    definitions: dict[str, Definition] = {}
    for name, schema, payload in _messages(path, wanted):
        if name not in definitions:
            definitions[name] = parse(schema.name.rsplit("/", 1)[1], schema.data.decode())
        payloads[name].append(payload)
    return {name: _columns(definitions[name], payloads[name]) for name in payloads}


class _WholeReads:
    """A file that ends with EndOfFile also in the middle of a record, where mcap itself would take what there is."""

    def __init__(self, file: IO[bytes]) -> None:
        self._file = file

    def read(self, size: int) -> bytes:
        """Return `size` bytes. Raises EndOfFile if there are fewer."""
        data = self._file.read(size)
        if len(data) < size:
            raise EndOfFile
        return data


def _messages(path: Path, wanted: set[str] | None) -> Iterator[tuple[str, Any, bytes]]:
    if not path.is_file():
        raise RunDirectoryError(f"{path}: there is no such bag")
    topics = None if wanted is None else [f"/{name}" for name in wanted]
    with path.open("rb") as file:
        try:
            reader = NonSeekingReader(cast(IO[bytes], _WholeReads(file)))
            for schema, channel, message in reader.iter_messages(topics=topics, log_time_order=False):
                yield channel.topic.lstrip("/"), schema, message.data
        except EndOfFile:
            return  # the end is missing: the writer was killed
        except McapError as error:
            raise RunDirectoryError(f"{path}: not a readable MCAP file ({error})") from error


def _columns(definition: Definition, payloads: list[bytes]) -> dict[str, np.ndarray]:
    batched = definition.name.endswith("Timing")
    if not batched:
        return Codec(definition, sizes_in(definition, payloads[0])).columns(payloads)
    rows: dict[str, list[np.ndarray]] = defaultdict(list)
    for payload in payloads:
        codec = Codec(definition, sizes_in(definition, payload))
        names = (field.name for field in definition.fields)
        for name, value in _rows(dict(zip(names, codec.unpack(payload), strict=True))).items():
            rows[name].append(value)
    return {name: np.concatenate(parts) for name, parts in rows.items()}


def _rows(batch: dict[str, Any]) -> dict[str, np.ndarray]:
    """Return one message of many ticks with a `tick` for each: its `ticks` if it names them, else counted on."""
    first = int(batch.pop("tick"))
    ticks = batch.pop("ticks", None)
    count = len(next(iter(batch.values())))
    return {"tick": first + np.arange(count) if ticks is None else ticks, **batch}
