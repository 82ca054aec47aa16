"""What was injected against what was found: which stalls were detected, and which attributed rightly."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from typing import Any

from benchmarks.stall_plan import CULPRITS
from hilrig.recording.fault_log import InjectedFault

Found = tuple[int, str]
"""(tick, cause) of a stall that the certificate found"""


def reach(fault: InjectedFault, period: float, delay: int) -> int:
    """Return the last tick that a fault can make late: its own, and as long as it lasts, and the command's delay.

    One tick more, because a fault may end between two, and one because the next message may wait behind it.
    """
    return fault.tick + math.ceil((fault.end - fault.begin) / (period * 1e9)) + delay + 2


def compare(injected: Sequence[InjectedFault], found: Sequence[Found], period: float, delay: int) -> dict[str, Any]:
    """Return what became of every fault, and which of the stalls found belong to none.

    A fault is detected if a stall is found from its tick on to its reach; the first one there is its attribution.
    Later ones there are its consequences. Neither is a false alarm, and all others are `unexplained`: stalls of the
    machine itself, or false alarms.
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
    right = sum(row[CULPRITS[kind]] for kind, row in confusion.items())
    return {
        "injected": len(injected),
        "detected": len(injected) - len(missed),
        "rightly_attributed": right,
        "confusion": {kind: dict(confusion[kind]) for kind in CULPRITS if kind in confusion},
        "missed": [fault._asdict() for fault in missed],
        "unexplained": [list(stall) for stall in ordered if stall not in explained],
    }
