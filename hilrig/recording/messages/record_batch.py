"""Many messages of one channel in one array: written by field, sent by row, recorded together.

Compiled kernels write directly into the messages, so no tick has to pack anything.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from hilrig.recording.messages.codec import LEAD, Codec

WORD = 8
"""Bytes of a number. Each row is a whole number of words, so that the numbers in every row are aligned."""


class RecordBatch:
    """Room for `rows` messages. Headers and the lengths of sequences are set, all values are zero."""

    def __init__(self, codec: Codec, rows: int, lead: bytes = LEAD) -> None:
        """`lead` are the bytes before every message: 4, or 4 more than a whole number of words."""
        self._codec, start = codec, len(lead)
        self._words = np.zeros((rows, -(-(start + codec.size) // WORD)), np.float64)
        stride = self._words.shape[1] * WORD
        self._ends = range(start + codec.size, rows * stride + 1, stride)
        self._framed_size = start + codec.size
        self._words.view(np.uint8)[:, :start] = np.frombuffer(lead, np.uint8)
        self.payloads: NDArray[np.uint8] = self._words.view(np.uint8)[:, start : self._framed_size]
        """The messages, (rows, bytes)"""
        self.payloads[:] = np.frombuffer(codec.zero(), np.uint8)
        messages = np.ndarray((rows,), codec.dtype, self._words, start, (stride,))
        self.fields = [messages[name] for name in codec.names]
        """One array for each field of the definition, in its order: (rows,) or (rows, length)"""
        self._values = messages[codec.names]

    def words(self, first: int) -> NDArray[np.float64]:
        """Return all fields from index `first` on as one float64 array, (rows, words).

        These fields must be float64 arrays of fixed length without gaps between them.
        """
        count = sum(math.prod(field.shape[1:]) for field in self.fields[first:])
        return self._words[:, self._words.shape[1] - count :]

    def message(self, row: int) -> bytes:
        """Return the message in a row."""
        return self._messages[row].tobytes()

    def framed(self, row: int) -> bytes:
        """Return the message in a row with the lead before it."""
        return self._framed[row].tobytes()

    def read(self, row: int, framed: bytes) -> None:
        """Put a message with the lead before it into a row. Raises ValueError if it has another size."""
        try:
            self._framed[row][:] = framed
        except ValueError:
            raise self._codec.wrong_size(len(framed)) from None

    def write(self, rows: Sequence[tuple[float, ...]]) -> None:
        """Write messages into the first rows, each given as a tuple of numbers.

        Raises ValueError or OverflowError if one does not fit.
        """
        self._values[: len(rows)] = rows

    @cached_property
    def _messages(self) -> list[memoryview]:
        """The bytes of each row, created at first use because a compiled loop does not need them."""
        return self._ending_with(self._codec.size)

    @cached_property
    def _framed(self) -> list[memoryview]:
        return self._ending_with(self._framed_size)

    def _ending_with(self, size: int) -> list[memoryview]:
        memory = self._words.reshape(-1).view(np.uint8).data
        return [memory[end - size : end] for end in self._ends]
