"""Which cores the processes of a trial run on, and who comes first there."""

from __future__ import annotations

import os

REALTIME_PRIORITY = 50
"""Of 1 to 99: below the kernel's own threads that matter"""


def cores_for(slot: int) -> dict[str, tuple[int, ...]]:
    """Return the cores of each role: one for driver and controller (the fastest hand-over), another for the logger."""
    cores = sorted(os.sched_getaffinity(0))
    own, other = cores[slot % len(cores)], cores[(slot + 1) % len(cores)]
    return {"driver": (own,), "controller": (own,), "logger": (other,)}


def pin(cores: list[int]) -> None:
    """Keep this process on `cores`, as far as this machine has them."""
    allowed = set(cores) & os.sched_getaffinity(0)
    if allowed:
        os.sched_setaffinity(0, allowed)


def finish_before_yielding() -> None:
    """Let this process go on when it wakes another one on its core, until it waits itself.

    In lockstep the halves of the loop take turns: whoever is interrupted by the other's wake-up loses its caches twice.
    """
    os.sched_setscheduler(0, os.SCHED_BATCH, os.sched_param(0))


def come_first() -> bool:
    """Run before every ordinary process (SCHED_FIFO); return whether that is permitted."""
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(REALTIME_PRIORITY))
    except PermissionError:
        return False
    return True
