"""The stamps of driver and controller joined by tick: the chain from a measurement to the effect of its command.

Stamps are in CLOCK_MONOTONIC nanoseconds of the host that made them. A duration between stamps of two processes is
meaningful only if both ran on one host (`one_clock`).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Stamps = NDArray[np.int64]
"""ns, (N,)"""
Flags = NDArray[np.bool_]
"""(N,)"""
StampColumns = Mapping[str, NDArray[np.generic]]
"""The fields of a timing channel by name, (N,) each, as `read_bag` gives them"""

NS = 1_000_000_000


class DriverStamps(NamedTuple):
    """One row per tick that was done, in order; see DriverTiming.msg. Overdue ticks are left out."""

    tick: Stamps
    due: Stamps
    woke: Stamps
    published: Stamps
    command: Stamps
    received: Stamps
    applied: Stamps
    continued: Stamps


class ControllerStamps(NamedTuple):
    """One row per measurement that the controller received; see ControllerTiming.msg."""

    tick: Stamps
    waiting: Stamps
    received: Stamps
    computed: Stamps
    published: Stamps
    continued: Stamps


class StampTable(NamedTuple):
    """The chains that begin with the measurements of N ticks."""

    driver: DriverStamps
    """(N,)"""
    answer: ControllerStamps
    """The controller's stamps for the measurement of this tick, (N,); zeros where not `answered`"""
    answered: Flags
    """Whether the controller received the measurement of this tick"""
    returned: Stamps
    """When the command that answers this tick came in at the driver; 0, unknown, for one that never took effect"""
    effective: Stamps
    """When that command was first applied to the plant; 0 if it never took effect"""
    answers: ControllerStamps
    """Every row of the controller, in order of reception, (M,)"""
    one_clock: bool
    """Whether both processes read the same clock"""


def join(driver: StampColumns | None, controller: StampColumns | None, one_clock: bool = True) -> StampTable:
    """Return the stamps of both processes by tick.

    Rows may be missing on either side, in any pattern: a tick without a driver row is not in the table, and one that
    the controller never saw is not `answered`.
    """
    own = DriverStamps(*_rows(driver, DriverStamps._fields))
    other = ControllerStamps(*_rows(controller, ControllerStamps._fields))
    place, answered = find(other.tick, own.tick)
    answer = ControllerStamps(*(_picked(column, place, answered) for column in other))
    # A command may stay in effect for several ticks; it came in before the first of them.
    commands, first = np.unique(own.command, return_index=True)
    place, took_effect = find(commands, own.tick)
    rows = _picked(first, place, took_effect)
    order = np.argsort(other.received, kind="stable")
    return StampTable(
        own, answer._replace(tick=own.tick), answered,
        np.where(took_effect, own.received[rows], 0) if own.tick.size else own.received,
        np.where(took_effect, own.applied[rows], 0) if own.tick.size else own.applied,
        ControllerStamps(*(column[order] for column in other)), one_clock,
    )  # fmt: skip


def left_out(driver: DriverStamps) -> int:
    """Return how many ticks between the first and the last row have no row: in real time they were overdue."""
    ticks = driver.tick
    return int(ticks[-1] - ticks[0]) + 1 - ticks.size if ticks.size else 0


def find(ordered: Stamps, wanted: Stamps) -> tuple[Stamps, Flags]:
    """Return the index of each of `wanted` in `ordered`, 0 where it is missing, and whether it is there."""
    if ordered.size == 0:
        return np.zeros(wanted.size, dtype=np.int64), np.zeros(wanted.size, dtype=bool)
    place = np.minimum(np.searchsorted(ordered, wanted), ordered.size - 1)
    found = ordered[place] == wanted
    return np.where(found, place, 0), found


def resume_times(stamps: DriverStamps | ControllerStamps) -> Stamps:
    """Return when the process was resumed after a stop, sorted, (K,) ns."""
    times = np.unique(stamps.continued)
    return times[times > 0]


def _rows(columns: StampColumns | None, names: tuple[str, ...]) -> list[Stamps]:
    """Return the columns sorted by tick, each tick once."""
    if columns is None or len(columns["tick"]) == 0:
        return [np.zeros(0, dtype=np.int64) for _ in names]
    ticks, rows = np.unique(np.asarray(columns["tick"]).astype(np.int64), return_index=True)
    return [ticks, *(np.asarray(columns[name]).astype(np.int64)[rows] for name in names[1:])]


def _picked(column: Stamps, place: Stamps, there: Flags) -> Stamps:
    return np.where(there, column[place], 0) if column.size else np.zeros(place.size, dtype=np.int64)
