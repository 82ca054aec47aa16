"""Measurements that waited for a busy controller, and which process made them wait. Needs one common clock."""

from __future__ import annotations

import numpy as np

from hilrig.recording.certificate.causes import CONTROLLER, DRIVER, LEAST_EXCESS, RESUME_MARGIN, stopped
from hilrig.recording.certificate.durations import Terms, median
from hilrig.recording.certificate.table import ControllerStamps, Flags, Stamps, StampTable, find


def busy_between(answers: ControllerStamps, start: Stamps, end: Stamps) -> Stamps:
    """Return how long the controller was busy between `start` and `end`, (L,) ns."""
    if answers.tick.size == 0:
        return np.zeros(start.size, dtype=np.int64)
    knots = np.maximum.accumulate(np.stack([answers.waiting, answers.received], axis=1).ravel())
    origin = knots[0]
    lengths = np.diff(knots, prepend=origin)
    lengths[::2] = 0  # from received to the next waiting it is busy
    free = np.cumsum(lengths)
    freely = np.interp(end - origin, knots - origin, free) - np.interp(start - origin, knots - origin, free)
    return np.maximum(end - start - freely.astype(np.int64), 0)


def who_made_wait(table: StampTable, terms: Terms) -> Stamps:
    """Return for each answer, in order of reception, which process kept the controller busy until then, (M,).

    That is the controller if its previous answer took longer than usual. Otherwise it is whatever delayed the previous
    measurement: a driver that published it late, its transport, or another wait. If nothing did, the controller is too
    slow.
    """
    answers, least = table.answers, round(LEAST_EXCESS * terms.period_ns)
    count = answers.tick.size
    if count == 0:
        return np.zeros(0, dtype=np.int64)
    excess, wait = _before(table, terms)
    occupied = np.concatenate([answers.waiting[1:], answers.published[-1:]]) - answers.received
    own = occupied - median(occupied) >= least
    cause = np.full(count, CONTROLLER)
    cause[1:] = _largest(excess[:-1], own[:-1], least)
    for j in np.flatnonzero((wait[:-1] >= least) & ~own[:-1]) + 1:
        row = excess[j - 1 : j].copy()
        row[0, cause[j - 1]] += wait[j - 1]
        cause[j] = _largest(row, own[j - 1 : j], least)[0]
    return cause


def _before(table: StampTable, terms: Terms) -> tuple[Stamps, Stamps]:
    """Return how much each answer's measurement was delayed before it was received, (M, 3), and its wait, (M,)."""
    answers, own = table.answers, table.driver
    place, known = find(own.tick, answers.tick)
    excess = np.zeros((answers.tick.size, 3), dtype=np.int64)
    if own.tick.size == 0:
        return excess, excess[:, 0]
    published = np.where(known, own.published[place], answers.received)
    wait = np.maximum(answers.waiting - published, 0)
    sent = published - np.where(known, own.due[place], published)
    way = answers.received - np.maximum(published, answers.waiting)
    excess[:, DRIVER] = sent - median(sent)
    end = answers.received + round(RESUME_MARGIN * terms.period_ns)
    process = stopped(table, published, end, (CONTROLLER, DRIVER))
    np.add.at(excess, (np.arange(way.size), process), way - median(way))
    return excess, wait


def _largest(excess: Stamps, own: Flags, least: int) -> Stamps:
    """Return the process with the largest excess (K, 3); the controller where `own` (K,), or where none is large."""
    most = np.argmax(excess, axis=1)
    return np.where(own | (np.max(excess, axis=1) < least), CONTROLLER, most)
