"""Determines which process caused a late tick.

Tick k is late because the command of tick w = k - d was not there in time. The time from when w was due until that
command came in, or until it was needed if it never came, is split into the shares of driver, transport and controller
(`shares.py`). A share's excess is the part above its median over the trial. The process with the largest excess is the
cause if the command would have been in time without it, or if it makes up nearly all of the total excess. If no excess
explains the lateness, the cause is the one process whose share takes most of the available time, such as a controller
that is always too slow. Otherwise the cause is unknown.

Where the controller answered nothing any more, there is no chain: then its record tells whether it fell silent, or was
not reached.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from hilrig.recording.certificate.causes import CAUSES, CONTROLLER, DRIVER, LEAST_EXCESS, TRANSPORT, UNKNOWN
from hilrig.recording.certificate.durations import Terms, late_ticks
from hilrig.recording.certificate.late import overran
from hilrig.recording.certificate.shares import Chain, chains, typical, ways
from hilrig.recording.certificate.table import Flags, Stamps, StampTable, find

DOMINANT = 0.75
"""Fraction of the total excess that counts as nearly all, and of the available time that counts as most"""


class Attribution(NamedTuple):
    """The late ticks of a table, and the cause of each."""

    late: Flags
    """(N,)"""
    cause: Stamps
    """Number of the cause in CAUSES, (N,); -1 where the tick was not late"""

    def counts(self) -> dict[str, int]:
        """Return the number of late ticks by cause."""
        return {name: int(np.count_nonzero(self.cause == number)) for number, name in enumerate(CAUSES)}


def attribute(table: StampTable, terms: Terms, answered_to_the_end: bool | None = None) -> Attribution:
    """Return which ticks were late, and what caused each.

    `answered_to_the_end` says whether the controller's record is complete, None if this is not known.
    """
    late = late_ticks(table, terms)
    cause = np.full(late.size, -1, dtype=np.int64)
    if not np.any(late):
        return Attribution(late, cause)
    rows = np.flatnonzero(late)
    chain = chains(table, terms, rows)
    cause[rows] = _causes(chain, typical(ways(table, terms)[1]), terms.period_ns)
    silent = (cause == UNKNOWN) & ~answers_follow(table, terms)
    if answered_to_the_end is not None:
        cause[silent] = _silenced_by(table, terms, answered_to_the_end, np.flatnonzero(silent))
    # A measurement that was never made, because the driver left its tick out, is the driver's doing.
    cause[
        late & ~find(table.driver.tick, table.driver.tick - terms.actuation_delay)[1] & _after_first(table, terms)
    ] = DRIVER
    # A driver that applies a command a period late is the cause, whichever command it is.
    cause[late & overran(table.driver.due, table.driver.applied, terms.period_ns)] = DRIVER
    return Attribution(late, cause)


def answers_follow(table: StampTable, terms: Terms) -> Flags:
    """Return at which ticks the controller answered the measurement in question, or a later one, (N,)."""
    wanted = table.driver.tick - terms.actuation_delay
    return wanted <= (table.answers.tick.max() if table.answers.tick.size else -1)


def _silenced_by(table: StampTable, terms: Terms, complete: bool, rows: Stamps) -> Stamps:
    """Return what kept the controller from answering any more, for these rows (L,).

    It was the controller if its record breaks off, or if it was still at its last measurement when the command was
    needed. Otherwise it was waiting, and the measurements did not reach it.
    """
    if not complete:
        return np.full(rows.size, CONTROLLER)
    until = table.answers.published.max() if table.answers.tick.size else 0
    return np.where(table.driver.woke[rows] <= until, CONTROLLER, TRANSPORT)


def _after_first(table: StampTable, terms: Terms) -> Flags:
    """Return which ticks wait for a measurement after the first one, (N,)."""
    return table.driver.tick - terms.actuation_delay > table.driver.tick[0]


def _causes(chain: Chain, usual: Stamps, period_ns: int) -> Stamps:
    """Return the number of each cause, (L,)."""
    excess = chain.shares - usual
    most = np.argmax(excess, axis=1)
    largest = np.take_along_axis(excess, most[:, None], axis=1)[:, 0]
    nearly_all = largest >= DOMINANT * np.sum(np.maximum(excess, 0), axis=1)
    explained = (largest >= LEAST_EXCESS * period_ns) & ((chain.end - largest <= chain.needed) | nearly_all)
    most_of_it = DOMINANT * (chain.needed - chain.due)
    alone = chain.shares >= most_of_it[:, None]
    always = np.where(np.count_nonzero(alone, axis=1) == 1, np.argmax(alone, axis=1), UNKNOWN)
    # Where one process always takes most of the time, a small excess of another is not the cause.
    explained &= (always == UNKNOWN) | (largest >= most_of_it)
    return np.where(chain.known, np.where(explained, most, always), UNKNOWN)
