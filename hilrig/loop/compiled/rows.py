"""The messages of many ticks as kernels write them: one array for each field, one row for each tick."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hilrig.core.signals import Array
from hilrig.recording.messages.record_batch import RecordBatch

Ticks = NDArray[np.uint64]


class StateRows(NamedTuple):
    """State.msg."""

    tick: Ticks
    time: Array
    joint_position: Array
    wrench: Array
    applied_torque: Array


class TruthRows(NamedTuple):
    """Truth.msg."""

    tick: Ticks
    time: Array
    joint_position: Array
    joint_velocity: Array
    position: Array
    velocity: Array
    wrench: Array
    surface_position: Array


class CommandRows(NamedTuple):
    """Command.msg."""

    tick: Ticks
    time: Array
    torque: Array
    position: Array


class InternalsRows(NamedTuple):
    """Internals.msg."""

    tick: Ticks
    time: Array
    position: Array
    velocity: Array
    force: Array
    reference_position: Array
    reference_velocity: Array
    reference_acceleration: Array
    reference_force: Array
    memory: Array
    """All fields of the law's memory, one behind the other"""

    @classmethod
    def of(cls, batch: RecordBatch) -> InternalsRows:
        """Return the rows of a batch of internals."""
        own = len(cls._fields) - 1
        tick, time, *fields = batch.fields[:own]
        return cls(tick, time, *fields, memory=batch.words(own))
