"""Many messages of one kind as a table: written in place by field, sent by row, recorded as a whole.

A message that lies ready costs the loop neither a list of its numbers nor a call of `struct`; kernels write into it.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from hilrig.recording.messages.codec import CDR_HEADER, Codec

WORD = 8
"""Bytes. Every field of a message begins at a whole number of words behind the header."""
_PAD = WORD - len(CDR_HEADER)
"""Bytes before each row in memory, so that its fields are aligned"""


class RecordBatch:
    """Room for `rows` messages; headers and the lengths of sequences are written, all values are zero."""

    def __init__(self, codec: Codec, rows: int) -> None:
        self._codec = codec
        memory = np.zeros((rows, -(-(_PAD + codec.size) // WORD)), np.uint64)
        self.payloads: NDArray[np.uint8] = memory.view(np.uint8)[:, _PAD : _PAD + codec.size]
        """The messages, (rows, bytes)"""
        self.payloads[:] = np.frombuffer(codec.zero(), np.uint8)
        self.fields = codec.views(memory, 1)
        """One array for each field of the definition, in its order: (rows,) or (rows, length)"""
        self._memory = memory
        self._bytes = memory.reshape(-1).view(np.uint8).data
        self._stride = memory.shape[1] * WORD

    def words(self, first: int) -> NDArray[np.float64]:
        """Return all that stands from the field with index `first` on as one array (rows, words), if fields lie so."""
        return self._memory.view(np.float64)[:, self._codec.word_of(first) + 1 :]

    def message(self, row: int) -> bytes:
        """Return the message in a row."""
        start = row * self._stride + _PAD
        return bytes(self._bytes[start : start + self._codec.size])

    def read(self, row: int, payload: bytes) -> None:
        """Put a message into a row. Raises ValueError if it has another length."""
        start = row * self._stride + _PAD
        try:
            self._bytes[start : start + self._codec.size] = payload
        except ValueError:
            name, size = self._codec.definition.name, self._codec.size
            raise ValueError(f"{name}: a message of {len(payload)} bytes, expected {size}") from None

    def write(self, rows: Iterable[tuple[float, ...]]) -> None:
        """Write messages of numbers into the first rows; raises struct.error if the definition has arrays."""
        pack_into, memory, stride = self._codec.layout.pack_into, self._bytes, self._stride
        for row, values in enumerate(rows):
            pack_into(memory, row * stride + _PAD, CDR_HEADER, *values)
