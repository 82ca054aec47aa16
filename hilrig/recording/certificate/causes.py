"""What can cause a late tick, and which process was resumed from a stop at a given time."""

from __future__ import annotations

import numpy as np

from hilrig.recording.certificate.table import Flags, Stamps, StampTable, resume_times

CAUSES = ("driver", "transport", "controller", "unknown")
"""In the order of the cause numbers"""
DRIVER, TRANSPORT, CONTROLLER, UNKNOWN = range(len(CAUSES))
LEAST_EXCESS = 0.05
"""Fraction of the period; an excess below it is never a cause"""
RESUME_MARGIN = 0.25
"""Fraction of the period within which a resumed process notes that it was resumed"""


def stopped(table: StampTable, start: Stamps, end: Stamps, processes: tuple[int, ...]) -> Stamps:
    """Return which process was resumed between `start` and `end`, the first of `processes`; TRANSPORT if none was."""
    found = np.full(start.size, TRANSPORT, dtype=np.int64)
    stamps = {DRIVER: table.driver, CONTROLLER: table.answers}
    for process in reversed(processes):
        found[any_between(resume_times(stamps[process]), start, end)] = process
    return found


def any_between(times: Stamps, start: Stamps, end: Stamps) -> Flags:
    """Return where one of `times`, sorted, is after `start` and not after `end`."""
    return np.searchsorted(times, end, side="right") > np.searchsorted(times, start, side="right")
