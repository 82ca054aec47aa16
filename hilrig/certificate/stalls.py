"""Where a process or the bus stood still: each step of the loop that took much longer than it usually does.

Every step is counted from the moment at which it could begin: what only follows from a stall is not counted again.
"""

from __future__ import annotations

import numpy as np

from hilrig.certificate.durations import Terms, median
from hilrig.certificate.processes import CONTROLLER, CULPRITS, DRIVER, TRANSPORT
from hilrig.certificate.shares import chains, typical, ways
from hilrig.certificate.table import ControllerStamps, DriverStamps, Flags, Stamps, Table, find

LEAST = 0.5
"""Part of the period from which on an excess is a stall"""
LOST = 0.1
"""Part of the period for which a message that never arrived had time to arrive, besides the usual one"""


def stalls(table: Table, terms: Terms, least: float | None = None) -> list[tuple[int, str]]:
    """Return (tick, culprit) of every stall, in order of the ticks.

    A stall is a step whose time is above its median by `least` (s, default half a period) or more, a stop of a process
    (SIGSTOP) that went on again, or a message that never arrived though its receiver was free. The tick is that of the
    measurement or command that was held, for a process the one at which it was at work.
    """
    limit = round((LEAST * terms.period if least is None else least) * 1e9)
    answers = table.answers
    found = {
        DRIVER: table.driver.tick[_driver(table.driver, limit)],
        CONTROLLER: answers.tick[_controller(answers, limit)],
        TRANSPORT: _held(table, terms, limit),
    }
    return sorted({(int(tick), CULPRITS[number]) for number, ticks in found.items() for tick in ticks})


def _driver(own: DriverStamps, limit: int) -> Flags:
    """Return the rows at which the driver stalled: waking, or from waking to having published and applied."""
    ended = np.maximum(own.published, own.applied)
    begun = np.maximum(own.due, np.concatenate([own.due[:1], ended[:-1]]))
    # In lockstep the command is applied after the measurement went out, and waiting for it is not the driver's.
    act = own.published - own.woke + np.maximum(own.applied - np.maximum(own.received, own.published), 0)
    return _long(own.woke - begun, limit) | _long(act, limit) | _went_on(own.continued)


def _controller(answers: ControllerStamps, limit: int) -> Flags:
    """Return the rows at which the controller stalled: before it was free, computing, or publishing."""
    free = np.concatenate([answers.waiting[:1], answers.published[:-1]])
    steps = (answers.waiting - free, answers.computed - answers.received, answers.published - answers.computed)
    return np.any([_long(step, limit) for step in steps], axis=0) | _went_on(answers.continued)


def _held(table: Table, terms: Terms, limit: int) -> Stamps:
    """Return the ticks whose measurement or command was held up on its way, or lost."""
    at, shares = ways(table, terms)
    usual = typical(shares)[TRANSPORT]
    held = table.driver.tick[at][shares[:, TRANSPORT] - usual >= limit]
    own = table.driver
    place, known = find(own.tick, own.tick - terms.actuation_delay)
    missed = known & (table.returned[place] == 0) & (own.command < own.tick - terms.actuation_delay)
    chain = chains(table, terms, np.flatnonzero(missed))
    never = chain.known & (chain.shares[:, TRANSPORT] - usual >= LOST * terms.period_ns)
    return np.concatenate([held, own.tick[place[missed]][never]])


def _long(step: Stamps, limit: int) -> Flags:
    return step - median(step) >= limit


def _went_on(continued: Stamps) -> Flags:
    """Return the rows by which the process had gone on after a stop since the row before."""
    return np.diff(continued, prepend=continued[:1]) > 0
