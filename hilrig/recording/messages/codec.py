"""From ROS 2 message definitions to bytes and back: CDR, little-endian, by `struct`.

A definition fixes the fields and their types; the lengths of its sequences are fixed for a trial, so that the whole
message is one `struct` layout. The bytes are those that any ROS 2 serialiser writes.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Mapping, Sequence
from functools import cache
from importlib import resources
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hilrig.core.signals import Array

PACKAGE = "hilrig_msgs"
CDR_HEADER = b"\x00\x01\x00\x00"
TYPES = {"float64": ("d", "<f8", 8), "int64": ("q", "<i8", 8), "uint64": ("Q", "<u8", 8)}
"""ROS type -> (struct letter, numpy type, bytes). All of eight bytes: no field needs padding but behind a length."""

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


def parse(name: str, text: str) -> Definition:
    """Return the definition with this text. Raises ValueError for a type that the codec does not know."""
    fields: list[Field] = []
    for line in text.splitlines():
        if not line.strip() or line.lstrip().startswith("#"):
            continue
        match = _FIELD.match(line.strip())
        if match is None or match["type"] not in TYPES:
            raise ValueError(f"{name}: cannot read the line {line!r}; known types are {', '.join(TYPES)}")
        size = int(match["size"] or 0) if match["array"] else None
        fields.append(Field(match["name"], match["type"], size))
    return Definition(f"{PACKAGE}/msg/{name}", text, tuple(fields))


@cache
def definition(name: str) -> Definition:
    """Return the definition in messages/<name>.msg."""
    return parse(name, (resources.files("hilrig.recording.messages") / f"{name}.msg").read_text(encoding="utf-8"))


def extended(base: Definition, arrays: Mapping[str, int]) -> Definition:
    """Return `base` with float64 arrays of these lengths behind its own fields."""
    lines = "".join(f"float64[{size}] {name}\n" for name, size in arrays.items())
    return parse(base.name.rsplit("/", 1)[1], base.text + lines)


class Codec:
    """Packs and unpacks one message type whose sequences have fixed lengths."""

    def __init__(self, definition: Definition, sizes: Mapping[str, int]) -> None:
        """`sizes` gives the length of every sequence (a field `type[]`). Raises KeyError if one is missing."""
        self.definition = definition
        layout, self._plan, offset = "<4s", [], 4
        for field in definition.fields:
            letter, dtype, width = TYPES[field.type]
            count = 1 if field.size is None else field.size or sizes[field.name]
            is_sequence = field.size == 0
            if is_sequence:
                layout, offset = layout + "I", offset + 4
            if count:
                gap = -(offset - len(CDR_HEADER)) % width
                layout, offset = layout + f"{gap}x" * bool(gap), offset + gap
            self._plan.append((field.name, count, is_sequence, field.size is None, offset, dtype))
            layout, offset = layout + f"{count}{letter}" * bool(count), offset + count * width
        self.layout = struct.Struct(layout)
        """Of the whole message: the header, then lengths and values in the order of the fields"""
        self._words = [
            (count, is_scalar, (at - len(CDR_HEADER)) // 8, np.dtype(dtype))
            for _, count, _, is_scalar, at, dtype in self._plan
        ]
        self.size = offset

    def pack(self, values: Sequence[Any]) -> bytes:
        """Return the message with these values, one per field in order: a number, or an array of the field's length.

        Raises struct.error if a length does not fit.
        """
        flat: list[Any] = [CDR_HEADER]
        for (_, count, is_sequence, is_scalar, _, _), value in zip(self._plan, values, strict=True):
            if is_sequence:
                flat.append(count)
            if is_scalar:
                flat.append(value)
            else:
                flat.extend(value.tolist())
        return self.layout.pack(*flat)

    def zero(self) -> bytes:
        """Return the message in which every value is zero."""
        fields = ((count, is_scalar, dtype) for _, count, _, is_scalar, _, dtype in self._plan)
        return self.pack([0 if is_scalar else np.zeros(count, dtype) for count, is_scalar, dtype in fields])

    def unpack(self, payload: bytes) -> list[Any]:
        """Return the values in order: numbers, and arrays (of a copy) for everything else.

        Raises ValueError if the payload has another length or encoding.
        """
        self._check(payload)
        # Every field begins at a multiple of eight bytes behind the header: one copy serves all of them.
        words = np.frombuffer(payload, np.uint64, (self.size - len(CDR_HEADER)) // 8, len(CDR_HEADER)).copy()
        return [
            words[at].view(dtype).item() if is_scalar else words[at : at + count].view(dtype)
            for count, is_scalar, at, dtype in self._words
        ]

    def columns(self, payloads: Sequence[bytes]) -> dict[str, Array]:
        """Return each field of many messages at once: (N,) for scalars, (N, k) for arrays.

        Raises ValueError if a payload has another length or encoding.
        """
        for payload in payloads:
            self._check(payload)
        return self.table(np.frombuffer(b"".join(payloads), np.uint8).reshape(-1, self.size))

    def table(self, payloads: NDArray[np.uint8]) -> dict[str, Array]:
        """Return each field of messages (N, size): (N,) for scalars, (N, k) for arrays."""
        table = np.ascontiguousarray(payloads).view(self._dtype())[:, 0]
        return {name: np.ascontiguousarray(table[name]) for name, *_ in self._plan}

    def views(self, words: NDArray[np.uint64], first: int) -> list[NDArray[Any]]:
        """Return each field in many messages that lie in `words`, (N, ...), from word `first` behind their headers.

        (N,) for numbers, (N, k) for arrays; what is written into them is in the messages.
        """
        return [
            words.view(dtype)[:, first + at] if is_scalar else words.view(dtype)[:, first + at : first + at + count]
            for count, is_scalar, at, dtype in self._words
        ]

    def word_of(self, field: int) -> int:
        """Return where the field with this index begins, in words behind the header; one behind the last: the end."""
        return self._words[field][2] if field < len(self._words) else -(-(self.size - len(CDR_HEADER)) // 8)

    def _dtype(self) -> np.dtype[Any]:
        names, formats, offsets = [], [], []
        for name, count, _, is_scalar, offset, dtype in self._plan:
            names.append(name)
            formats.append(dtype if is_scalar else (dtype, (count,)))
            offsets.append(offset)
        return np.dtype({"names": names, "formats": formats, "offsets": offsets, "itemsize": self.size})

    def _check(self, payload: bytes) -> None:
        if len(payload) != self.size or payload[:4] != CDR_HEADER:
            raise ValueError(
                f"{self.definition.name}: {len(payload)} bytes that begin with {payload[:4].hex()}, "
                f"expected {self.size} that begin with {CDR_HEADER.hex()}"
            )


def sizes_in(definition: Definition, payload: bytes) -> dict[str, int]:
    """Return the lengths of the sequences in one message, read from its own length fields."""
    sizes, offset = {}, 4
    for field in definition.fields:
        width = TYPES[field.type][2]
        count = 1 if field.size is None else field.size
        if field.size == 0:
            (count,) = struct.unpack_from("<I", payload, offset)
            sizes[field.name], offset = count, offset + 4
        if count:
            offset += -(offset - 4) % width + count * width
    return sizes
