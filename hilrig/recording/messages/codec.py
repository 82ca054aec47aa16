"""ROS 2 message definitions and their byte layout: one numpy dtype for each message.

A definition fixes the fields and their types. The lengths of its sequences are fixed for a trial, so all messages of a
channel have the same size and layout. That layout is a structured dtype over the whole message: the CDR header, the
length of each sequence, and the values. The bytes are what any ROS 2 serialiser writes (little-endian CDR).
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from importlib import resources
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

PACKAGE = "hilrig_msgs"
ROS_TYPES = {name: np.dtype(name).newbyteorder("<") for name in ("float64", "int64", "uint64")}
"""ROS type -> numpy type. All take eight bytes: the length of a sequence never needs padding before it."""
HEADER = "CDR header"
"""Name of the first four bytes in a message's dtype; no field of a definition can contain a space"""
CDR_HEADER = b"\x00\x01\x00\x00"
"""Little-endian CDR"""
LEAD = bytes(4)
"""Bytes to put before a message in memory, so that all its values are aligned, as compiled kernels require"""
TICK = slice(4, 12)
"""Bytes of a message's first field, which is always the tick: uint64, little-endian"""

_UINT32 = np.dtype("<u4")
_FIELD = re.compile(r"^(?P<type>\w+)(?P<array>\[(?P<size>\d*)\])?\s+(?P<name>\w+)\s*(?:#.*)?$")


class Field(NamedTuple):
    """One field of a definition; `size` is None for a scalar, 0 for a sequence, else the array's length."""

    name: str
    type: str
    size: int | None


class Definition(NamedTuple):
    """A message definition: its ROS name ("hilrig_msgs/msg/State"), its text and its fields."""

    name: str
    text: str
    fields: tuple[Field, ...]


def parse_definition(name: str, text: str) -> Definition:
    """Return the definition with this text. Raises ValueError with the line for a type that is not in TYPES."""
    fields: list[Field] = []
    for line in text.splitlines():
        if not line.strip() or line.lstrip().startswith("#"):
            continue
        match = _FIELD.match(line.strip())
        if match is None or match["type"] not in ROS_TYPES:
            raise ValueError(f"{name}: cannot read the line {line!r}; known types are {', '.join(ROS_TYPES)}")
        size = int(match["size"] or 0) if match["array"] else None
        fields.append(Field(match["name"], match["type"], size))
    return Definition(f"{PACKAGE}/msg/{name}", text, tuple(fields))


@cache
def definition(name: str) -> Definition:
    """Return the definition in messages/<name>.msg."""
    text = (resources.files("hilrig.recording.messages") / f"{name}.msg").read_text(encoding="utf-8")
    return parse_definition(name, text)


def extended(base: Definition, arrays: Mapping[str, int]) -> Definition:
    """Return `base` with float64 arrays of these lengths appended to its fields."""
    lines = "".join(f"float64[{size}] {name}\n" for name, size in arrays.items())
    return parse_definition(base.name.rsplit("/", 1)[1], base.text + lines)


def message_dtype(definition: Definition, length: Callable[[str, int], int]) -> np.dtype[Any]:
    """Return the layout of a message: the header and the fields, each sequence preceded by its length.

    `length` takes a sequence's name and the offset of its length in the message, and returns that length. CDR aligns a
    number to its own size, counted from the end of the header; an empty sequence has no number to align.
    """
    layout: dict[str, tuple[np.dtype[Any], int]] = {HEADER: (_UINT32, 0)}
    end = _UINT32.itemsize
    for field in definition.fields:
        number, shape = ROS_TYPES[field.type], () if field.size is None else (field.size,)
        if field.size == 0:
            shape = (length(field.name, end),)
            layout[_length_of(field.name)] = (_UINT32, end)
            end += _UINT32.itemsize
        form = np.dtype((number, shape))
        if form.itemsize:
            end += -(end - len(CDR_HEADER)) % number.itemsize
        layout[field.name] = (form, end)
        end += form.itemsize
    formats, offsets = zip(*layout.values(), strict=True)
    return np.dtype({"names": list(layout), "formats": formats, "offsets": offsets, "itemsize": end})


def sizes_in(definition: Definition, payload: bytes) -> dict[str, int]:
    """Return the lengths of the sequences in one message, as stored in the message."""
    sizes: dict[str, int] = {}

    def read(name: str, offset: int) -> int:
        sizes[name] = int.from_bytes(payload[offset : offset + _UINT32.itemsize], "little")
        return sizes[name]

    message_dtype(definition, read)
    return sizes


def _length_of(sequence: str) -> str:
    """Return the name of a sequence's length in a message's dtype."""
    return f"length of {sequence}"


class Codec:
    """Packs and unpacks the messages of one definition whose sequences have fixed lengths."""

    def __init__(self, definition: Definition, sizes: Mapping[str, int]) -> None:
        """`sizes` gives the length of every sequence (a field `type[]`). Raises KeyError if one is missing."""
        self.definition = definition
        self.dtype = message_dtype(definition, lambda name, _: sizes[name])
        """The layout of a whole message"""
        self.size = self.dtype.itemsize
        """Bytes of a message"""
        self.names = [field.name for field in definition.fields]
        """The fields of the definition, in its order"""
        self._shapes = [self.dtype[name].shape for name in self.names]
        self._places = [(self.dtype.names or ()).index(name) for name in self.names]
        self._constants = {HEADER: int.from_bytes(CDR_HEADER, "little")}
        self._constants |= {_length_of(field.name): sizes[field.name] for field in definition.fields if field.size == 0}
        zero = np.zeros((), self.dtype)
        for name, value in self._constants.items():
            zero[name] = value
        self._zero = zero.tobytes()

    def pack(self, values: Sequence[Any]) -> bytes:
        """Return the message with these values, one for each field in order: a number, or an array of its length.

        Raises ValueError if a length does not fit.
        """
        # Copy the bytes: numpy copies a structure by field and leaves the bytes between fields unset.
        memory = bytearray(self._zero)
        message = np.ndarray((), self.dtype, memory)
        for name, shape, value in zip(self.names, self._shapes, values, strict=True):
            # numpy would fill an array with a single number.
            if (found := getattr(value, "shape", ())) != shape:
                raise ValueError(f"{self.definition.name}: {name} has the shape {found}, expected {shape}")
            message[name] = value
        return bytes(memory)

    def zero(self) -> bytes:
        """Return the message in which every value is zero."""
        return self._zero

    def unpack(self, payload: bytes) -> list[Any]:
        """Return the values in order: Python numbers, and arrays that belong to the caller.

        Raises ValueError if the payload has another size or encoding.
        """
        if len(payload) != self.size:
            raise self.wrong_size(len(payload))
        if payload[: len(CDR_HEADER)] != CDR_HEADER:
            found, expected = payload[: len(CDR_HEADER)].hex(), CDR_HEADER.hex()
            raise ValueError(f"{self.definition.name}: a message that begins with {found}, expected {expected}")
        items = np.ndarray((), self.dtype, bytearray(LEAD + payload), len(LEAD)).item()
        return [items[place] for place in self._places]

    def columns(self, payloads: Sequence[bytes]) -> dict[str, NDArray[Any]]:
        """Return each field of N messages at once: (N,) for scalars, (N, k) for arrays.

        Raises ValueError if a payload has another size, encoding or length of a sequence.
        """
        for payload in payloads:
            if len(payload) != self.size:
                raise self.wrong_size(len(payload))
        return self.table(np.frombuffer(b"".join(payloads), np.uint8).reshape(-1, self.size))

    def table(self, payloads: NDArray[np.uint8]) -> dict[str, NDArray[Any]]:
        """Return each field of messages (N, size): (N,) for scalars, (N, k) for arrays.

        Raises ValueError if they have another size, encoding or length of a sequence.
        """
        if payloads.shape[1] != self.size:
            raise self.wrong_size(payloads.shape[1])
        table = np.ascontiguousarray(payloads).view(self.dtype)[:, 0]
        for name, expected in self._constants.items():
            if (wrong := table[name] != expected).any():
                found = table[name][np.argmax(wrong)]
                raise ValueError(f"{self.definition.name}: the {name} is {found}, expected {expected}")
        return {name: np.ascontiguousarray(table[name]) for name in self.names}

    def wrong_size(self, size: int) -> ValueError:
        """Return the error to raise for a message of this many bytes."""
        return ValueError(f"{self.definition.name}: a message of {size} bytes, expected {self.size}")
