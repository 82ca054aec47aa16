"""Who can be the cause of a lateness, and which process had been stopped meanwhile."""

from __future__ import annotations

import numpy as np

from hilrig.recording.certificate.table import Flags, Stamps, Table, after_continuing

CULPRITS = ("driver", "transport", "controller", "unknown")
"""In the order of their numbers"""
DRIVER, TRANSPORT, CONTROLLER, UNKNOWN = range(4)
LEAST = 0.05
"""Part of the period below which an excess is no cause"""
SOON = 0.25
"""Part of the period within which a process that goes on has noted so, besides what it was stopped in"""


def stopped(table: Table, start: Stamps, end: Stamps, processes: tuple[int, ...]) -> Stamps:
    """Return which process went on after a stop between `start` and `end`, the first of `processes`; else TRANSPORT."""
    found = np.full(start.size, TRANSPORT, dtype=np.int64)
    stamps = {DRIVER: table.driver, CONTROLLER: table.answers}
    for process in reversed(processes):
        found[any_between(after_continuing(stamps[process]), start, end)] = process
    return found


def any_between(moments: Stamps, start: Stamps, end: Stamps) -> Flags:
    """Return where one of `moments`, in order, lies after `start` and not after `end`."""
    return np.searchsorted(moments, end, side="right") > np.searchsorted(moments, start, side="right")
