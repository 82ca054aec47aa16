"""Which process made a tick late.

A tick k is late because the command of tick w = k - d was not there. The time from when w was due until that command
came in, or until it was needed where it never came, is split into the shares of driver, transport and controller
(`shares.py`). From each share what is typical of the trial, its median, is taken away: the process with the largest
excess caused the lateness, if without that excess the command would have come in time, or if it is nearly all of the
excess. Where nothing is excessive, a process caused it if its share alone is most of the time that there was: a
controller that is always too slow. Else nobody can tell.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from hilrig.recording.certificate.durations import Terms, late_ticks, overran
from hilrig.recording.certificate.processes import CULPRITS, DRIVER, LEAST, UNKNOWN
from hilrig.recording.certificate.shares import Chain, chains, typical, ways
from hilrig.recording.certificate.table import Flags, Stamps, Table

MOST = 0.75
"""Part of all excess that is nearly all; part of the time there was from which on a typical share is the cause"""


class Attribution(NamedTuple):
    """Which ticks of a table were late, and who caused it."""

    late: Flags
    """(N,)"""
    cause: Stamps
    """Number of the cause in CULPRITS, (N,); -1 where the tick was not late"""

    def counts(self) -> dict[str, int]:
        """Return the number of late ticks by cause."""
        return {name: int(np.count_nonzero(self.cause == number)) for number, name in enumerate(CULPRITS)}


def attribute(table: Table, terms: Terms) -> Attribution:
    """Return which ticks were late, and who caused each."""
    late = late_ticks(table, terms)
    cause = np.full(late.size, -1, dtype=np.int64)
    if not np.any(late):
        return Attribution(late, cause)
    rows = np.flatnonzero(late)
    chain = chains(table, terms, rows)
    cause[rows] = _culprits(chain, typical(ways(table, terms)[1]), terms.period_ns)
    # A driver that applied the command a period after its time is late whatever command it was.
    cause[overran(table, terms)] = DRIVER
    return Attribution(late, cause)


def _culprits(chain: Chain, usual: Stamps, period: int) -> Stamps:
    """Return the number of each cause, (L,)."""
    excess = chain.shares - usual
    most = np.argmax(excess, axis=1)
    largest = np.take_along_axis(excess, most[:, None], axis=1)[:, 0]
    nearly_all = largest >= MOST * np.sum(np.maximum(excess, 0), axis=1)
    explained = (largest >= LEAST * period) & ((chain.end - largest <= chain.needed) | nearly_all)
    most_of_it = MOST * (chain.needed - chain.due)
    alone = chain.shares >= most_of_it[:, None]
    always = np.where(np.count_nonzero(alone, axis=1) == 1, np.argmax(alone, axis=1), UNKNOWN)
    # Beside a process that takes most of the time anyway, a small excess of another is no cause.
    explained &= (always == UNKNOWN) | (largest >= most_of_it)
    return np.where(chain.known, np.where(explained, most, always), UNKNOWN)
