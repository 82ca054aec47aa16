"""The record of a tick: rows that it fills in place, one array per field, one row per tick.

The caller of the loop supplies the arrays. On the bus they are views of messages that are ready to be sent.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hilrig.core.compiler import kernel_without_arrays
from hilrig.core.signals import Array

Ticks = NDArray[np.uint64]


class StateRows(NamedTuple):
    """What the sensors report; the fields of State.msg."""

    tick: Ticks
    time: Array
    joint_position: Array
    wrench: Array
    applied_torque: Array
    stamp: Array
    fresh: NDArray[np.uint64]


class TruthRows(NamedTuple):
    """A simulated plant's true state; the fields of Truth.msg."""

    tick: Ticks
    time: Array
    joint_position: Array
    joint_velocity: Array
    position: Array
    velocity: Array
    wrench: Array
    surface_position: Array


class CommandRows(NamedTuple):
    """What the controller commands; the fields of Command.msg."""

    tick: Ticks
    time: Array
    torque: Array
    position: Array
    asked: Array
    limited: NDArray[np.uint64]


class AppliedRows(NamedTuple):
    """The commands that the driver's envelope changed; the fields of Applied.msg."""

    tick: Ticks
    time: Array
    torque: Array
    position: Array
    limited: NDArray[np.uint64]


class InternalsRows(NamedTuple):
    """The law's inputs and memory; the fields of Internals.msg."""

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
    """All fields of the law's memory, one after the other"""


class DriverRows(NamedTuple):
    """The rows of the driver node."""

    state: StateRows
    truth: TruthRows
    applied: AppliedRows
    written: NDArray[np.int64]
    """(1,): rows of state and truth that are complete"""
    changed: NDArray[np.int64]
    """(1,): rows of `applied` that are complete"""


class ControllerRows(NamedTuple):
    """The rows of the controller node."""

    command: CommandRows
    internals: InternalsRows
    written: NDArray[np.int64]
    """(1,): rows that are complete"""


@kernel_without_arrays
def put(row: Array, values: Array) -> None:
    """Set row[:] = values, element by element: numba's array assignment costs several times as much."""
    for i in range(values.size):
        row[i] = values[i]
