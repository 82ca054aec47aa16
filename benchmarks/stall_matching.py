"""Matches injected faults with detected stalls: which faults were found, and which got the right cause."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from typing import Any

from benchmarks.stall_plan import CAUSES
from hilrig.recording.fault_log import InjectedFault

Found = tuple[int, str]
"""(tick, cause) of a stall that the certificate found"""


def reach(fault: InjectedFault, period: float, delay: int) -> int:
    """Return the last tick that a fault can make late: its own tick, plus its duration, plus the command's delay.

    One more because a fault may end between two ticks, and another because the next message may queue behind it.
    """
    return fault.tick + math.ceil((fault.end - fault.begin) / (period * 1e9)) + delay + 2


def compare(injected: Sequence[InjectedFault], found: Sequence[Found], period: float, delay: int) -> dict[str, Any]:
    """Return the result for each fault, and the stalls that belong to none.

    A fault is detected if there is a stall between its tick and its reach. The first such stall says what the fault was
    attributed to; later ones are consequences. All other stalls are `unexplained`: the machine's own, or false alarms.
    """
    confusion: dict[str, Counter[str]] = {}
    missed: list[InjectedFault] = []
    explained: set[Found] = set()
    ordered = sorted(found)
    for fault in injected:
        last = reach(fault, period, delay)
        own = [stall for stall in ordered if fault.tick <= stall[0] <= last]
        explained.update(own)
        confusion.setdefault(fault.kind, Counter())[own[0][1] if own else "missed"] += 1
        if not own:
            missed.append(fault)
    right = sum(row[CAUSES[kind]] for kind, row in confusion.items())
    return {
        "injected": len(injected),
        "detected": len(injected) - len(missed),
        "rightly_attributed": right,
        "confusion": {kind: dict(confusion[kind]) for kind in CAUSES if kind in confusion},
        "missed": [fault._asdict() for fault in missed],
        "unexplained": [list(stall) for stall in ordered if stall not in explained],
    }
