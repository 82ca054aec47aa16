"""How much of the time from a measurement to the effect of its command each process took.

The time from due to published is the driver's, from received to published the controller's, and the rest is transport.
The time that a measurement waits for a busy controller counts for the process that made it wait (`waits.py`). If a
process was stopped (SIGSTOP) and resumed in between, the time counts for that process, wherever it shows up.

With one clock all of this is measured. With two, the driver's clock gives the driver's share and the round trip, and
the controller's clock gives its own time. A measurement then counts as having waited if the controller was busy for
longer than the tick spacing, and transport is the rest of the round trip.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from hilrig.recording.certificate.causes import CONTROLLER, DRIVER, RESUME_MARGIN, any_between, stopped
from hilrig.recording.certificate.durations import Terms, median
from hilrig.recording.certificate.table import Flags, Stamps, StampTable, find, resume_times
from hilrig.recording.certificate.waits import busy_between, who_made_wait


class Chain(NamedTuple):
    """The chains of L commands, from measurement to effect, in ns."""

    known: Flags
    """Whether enough of the chain is recorded, (L,)"""
    due: Stamps
    """When the tick of the measurement was due, (L,)"""
    needed: Stamps
    """When the driver took the newest command it had, (L,)"""
    end: Stamps
    """When the command came in, if known; not before `needed`, (L,)"""
    shares: Stamps
    """Shares of driver, transport and controller, (L, 3)"""


def chains(table: StampTable, terms: Terms, rows: Stamps) -> Chain:
    """Return the chains of the commands that were due at the ticks in `rows` (L,) of the table."""
    own = table.driver
    at, known = find(own.tick, own.tick[rows] - terms.actuation_delay)
    usual = median(own.applied - own.woke)
    needed = np.minimum(own.applied[rows], own.woke[rows] + usual)
    end, returned = needed, table.returned[at]
    if table.one_clock:
        # A command that was sent too late to arrive in time: assume the usual time from then on.
        sent = table.answer.published[at] + _usual_return(table)
        end = np.where(table.answered[at] & (returned == 0), np.maximum(end, sent), end)
    end = np.maximum(end, returned)
    return _split(table, terms, at, known, needed, end)


def ways(table: StampTable, terms: Terms) -> tuple[Stamps, Stamps]:
    """Return the rows of the measurements whose command took effect, (W,), and the shares in them, (W, 3) ns."""
    at = np.flatnonzero(table.answered & (table.returned > 0))
    end = table.returned[at]
    return at, _split(table, terms, at, np.ones(at.size, dtype=bool), end, end).shares


def typical(shares: Stamps) -> Stamps:
    """Return the median share (W, 3) of driver, transport and controller, (3,) ns; 0 if there is none."""
    return np.median(shares, axis=0).astype(np.int64) if shares.size else np.zeros(3, dtype=np.int64)


def _usual_return(table: StampTable) -> int:
    home = table.answered & (table.returned > 0)
    return median((table.returned - table.answer.published)[home])


def _split(table: StampTable, terms: Terms, at: Stamps, known: Flags, needed: Stamps, end: Stamps) -> Chain:
    own = table.driver
    driver = own.published[at] - own.due[at]
    split = _by_one_clock if table.one_clock else _by_two_clocks
    shares, told = split(table, terms, at, end)
    shares[:, DRIVER] += driver
    return Chain(known & told, own.due[at], needed, end, np.maximum(shares, 0))


def _by_one_clock(table: StampTable, terms: Terms, at: Stamps, end: Stamps) -> tuple[Stamps, Flags]:
    """Return the shares from published to `end`, (L, 3), and whether they are known."""
    soon = round(RESUME_MARGIN * terms.period_ns)
    published, answer, answered = table.driver.published[at], table.answer, table.answered[at]
    reached, told = _reached(table, at)
    until = np.where(answered, reached, np.clip(reached, published, np.maximum(end, published)))
    busy = np.minimum(busy_between(table.answers, published, until), until - published)
    shares = np.zeros((at.size, 3), dtype=np.int64)
    shares[:, CONTROLLER] = np.where(answered, answer.published[at] - answer.received[at], 0)
    np.add.at(shares, (np.arange(at.size), _behind(table, terms, at)), busy)
    halted = stopped(table, published, reached + soon, (CONTROLLER, DRIVER))
    np.add.at(shares, (np.arange(at.size), halted), until - published - busy)
    back = np.where(answered, end - answer.published[at], 0)
    halted = stopped(table, answer.published[at], end + soon, (DRIVER, CONTROLLER))
    np.add.at(shares, (np.arange(at.size), halted), back)
    return shares, told


def _by_two_clocks(table: StampTable, terms: Terms, at: Stamps, end: Stamps) -> tuple[Stamps, Flags]:
    """Return the same, without comparing the two clocks."""
    soon = round(RESUME_MARGIN * terms.period_ns)
    published, answer, answers = table.driver.published[at], table.answer, table.answers
    trip = np.maximum(end - published, 0)
    shares = np.zeros((at.size, 3), dtype=np.int64)
    if answers.tick.size == 0:
        return shares, np.zeros(at.size, dtype=bool)
    after, told = _next_answer(table, at)
    before = np.maximum(after - 1, 0)
    passed = (table.driver.tick[at] - answers.tick[before]) * terms.period_ns
    waited = np.where(after > 0, np.maximum(answers.waiting[after] - answers.received[before] - passed, 0), 0)
    worked = np.where(table.answered[at], answer.published[at] - answer.received[at], 0)
    shares[:, CONTROLLER] = np.minimum(waited + worked, trip)
    resumes = resume_times(answers)
    resumed = any_between(resumes, answers.waiting[after], answers.received[after] + soon)
    halted = np.where(resumed, CONTROLLER, stopped(table, published, end + soon, (DRIVER,)))
    np.add.at(shares, (np.arange(at.size), halted), trip - shares[:, CONTROLLER])
    return shares, told


def _next_answer(table: StampTable, at: Stamps) -> tuple[Stamps, Flags]:
    """Return the index of the answer to these ticks, or of the next one, (L,), and whether there is one."""
    ticks = np.maximum.accumulate(table.answers.tick)
    place = np.searchsorted(ticks, table.driver.tick[at])
    return np.minimum(place, ticks.size - 1), place < ticks.size


def _reached(table: StampTable, at: Stamps) -> tuple[Stamps, Flags]:
    """Return when each measurement, or else the next one, was received, (L,), and whether that is known."""
    if table.answers.tick.size == 0:
        return table.driver.published[at], np.zeros(at.size, dtype=bool)
    place, told = _next_answer(table, at)
    answered = table.answered[at]
    received = np.where(answered, table.answer.received[at], table.answers.received[place])
    return np.where(answered | told, received, table.driver.published[at]), answered | told


def _behind(table: StampTable, terms: Terms, at: Stamps) -> Stamps:
    """Return which process made these measurements wait for the controller, (L,)."""
    if table.answers.tick.size == 0:
        return np.full(at.size, CONTROLLER)
    order = np.argsort(table.answers.tick, kind="stable")
    place, _ = find(table.answers.tick[order], table.driver.tick[at])
    rows = np.where(table.answered[at], order[place], _next_answer(table, at)[0])
    return who_made_wait(table, terms)[rows]
