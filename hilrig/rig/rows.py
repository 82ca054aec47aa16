"""The rows of the loop as views of record batches: a tick writes directly into a message that is ready to be sent."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from hilrig.core.signals import Command
from hilrig.loop.rows import AppliedRows, CommandRows, ControllerRows, DriverRows, InternalsRows, StateRows, TruthRows
from hilrig.recording.messages.codec import LEAD, Codec
from hilrig.recording.messages.record_batch import RecordBatch

FEWEST = 2
"""Minimum rows of a batch: numba gives an array with one row another type, and would compile another kernel"""


def driver_rows(batches: Mapping[str, RecordBatch]) -> DriverRows:
    """Return the rows of the batches "state", "truth" and "applied"."""
    state, truth = StateRows(*batches["state"].fields), TruthRows(*batches["truth"].fields)
    applied = AppliedRows(*batches["applied"].fields)
    return DriverRows(state, truth, applied, np.zeros(1, dtype=np.int64), np.zeros(1, dtype=np.int64))


def controller_rows(batches: Mapping[str, RecordBatch]) -> ControllerRows:
    """Return the rows of the batches "command" and "internals"."""
    own = len(InternalsRows._fields) - 1
    internals = batches["internals"]
    rows = InternalsRows(*internals.fields[:own], memory=internals.words(own))
    return ControllerRows(CommandRows(*batches["command"].fields), rows, np.zeros(1, dtype=np.int64))


class HeardState:
    """The state message that the controller node answers."""

    def __init__(self, codecs: Mapping[str, Codec], lead: bytes = LEAD) -> None:
        """`lead` are the first bytes of a framed message."""
        self._batch = RecordBatch(codecs["state"], FEWEST, lead)
        self.rows = StateRows(*self._batch.fields)

    def read(self, framed: bytes) -> None:
        """Copy a message into the row. Raises ValueError if it has another length."""
        self._batch.read(0, framed)


class HeardCommand:
    """The command message that acts on the plant."""

    def __init__(self, codecs: Mapping[str, Codec], lead: bytes = LEAD) -> None:
        """`lead` are the first bytes of a framed message."""
        self._batch = RecordBatch(codecs["command"], FEWEST, lead)
        rows = CommandRows(*self._batch.fields)
        self.acting = Command(rows.torque[0], rows.position[0])

    def read(self, framed: bytes) -> None:
        """Copy a message into the row. Raises ValueError if it has another length."""
        self._batch.read(0, framed)
