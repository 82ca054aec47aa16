"""The stamps of driver and controller, joined by tick: the chain from a measurement to its command's effect.

Stamps are CLOCK_MONOTONIC nanoseconds of the host that made them. Durations between stamps of both processes mean
something on one host alone (`one_clock`).
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
Columns = Mapping[str, NDArray[np.generic]]
"""The fields of a timing channel by name, (N,) each, as `read_bag` gives them"""

NS = 1_000_000_000


class DriverStamps(NamedTuple):
    """One row for each tick, in their order; see DriverTiming.msg."""

    tick: Stamps
    due: Stamps
    woke: Stamps
    published: Stamps
    command: Stamps
    received: Stamps
    applied: Stamps
    continued: Stamps


class ControllerStamps(NamedTuple):
    """One row for each measurement that the controller received; see ControllerTiming.msg."""

    tick: Stamps
    waiting: Stamps
    received: Stamps
    computed: Stamps
    published: Stamps
    continued: Stamps


class Table(NamedTuple):
    """The chain that begins with the measurement of each of N ticks."""

    driver: DriverStamps
    """(N,)"""
    answer: ControllerStamps
    """What the controller did with the measurement of this tick, (N,); zeros where not `answered`"""
    answered: Flags
    """Whether the controller received the measurement of this tick"""
    returned: Stamps
    """When the command that answers this tick came in at the driver; 0 where it is not known: it never took effect"""
    effective: Stamps
    """When it was given to the plant for the first time; 0 where it never took effect"""
    answers: ControllerStamps
    """Every row of the controller in order of reception, (M,)"""
    one_clock: bool
    """Whether both processes read the same clock"""


def join(driver: Columns | None, controller: Columns | None, one_clock: bool = True) -> Table:
    """Return the stamps of both processes by tick.

    Rows may be missing on either side, in any pattern: a tick without a driver's row is not in the table, one that the
    controller never saw is not `answered`.
    """
    own = DriverStamps(*_rows(driver, DriverStamps._fields))
    other = ControllerStamps(*_rows(controller, ControllerStamps._fields))
    place, answered = find(other.tick, own.tick)
    answer = ControllerStamps(*(_picked(column, place, answered) for column in other))
    # A command may stay in effect for several ticks: the first of them is when it came.
    commands, first = np.unique(own.command, return_index=True)
    place, took_effect = find(commands, own.tick)
    rows = _picked(first, place, took_effect)
    order = np.argsort(other.received, kind="stable")
    return Table(
        own, answer._replace(tick=own.tick), answered,
        np.where(took_effect, own.received[rows], 0) if own.tick.size else own.received,
        np.where(took_effect, own.applied[rows], 0) if own.tick.size else own.applied,
        ControllerStamps(*(column[order] for column in other)), one_clock,
    )  # fmt: skip


def find(ordered: Stamps, wanted: Stamps) -> tuple[Stamps, Flags]:
    """Return where each of `wanted` stands among `ordered`, and whether it is there; the place of others is 0."""
    if ordered.size == 0:
        return np.zeros(wanted.size, dtype=np.int64), np.zeros(wanted.size, dtype=bool)
    place = np.minimum(np.searchsorted(ordered, wanted), ordered.size - 1)
    found = ordered[place] == wanted
    return np.where(found, place, 0), found


def after_continuing(stamps: DriverStamps | ControllerStamps) -> Stamps:
    """Return each moment at which the process went on after it had been stopped, in order, (K,) ns."""
    moments = np.unique(stamps.continued)
    return moments[moments > 0]


def _rows(columns: Columns | None, names: tuple[str, ...]) -> list[Stamps]:
    """Return the columns in order of tick, each tick once."""
    if columns is None or len(columns["tick"]) == 0:
        return [np.zeros(0, dtype=np.int64) for _ in names]
    ticks, rows = np.unique(np.asarray(columns["tick"]).astype(np.int64), return_index=True)
    return [ticks, *(np.asarray(columns[name]).astype(np.int64)[rows] for name in names[1:])]


def _picked(column: Stamps, place: Stamps, there: Flags) -> Stamps:
    return np.where(there, column[place], 0) if column.size else np.zeros(place.size, dtype=np.int64)
