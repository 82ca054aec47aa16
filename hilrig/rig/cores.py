"""Which cores the processes of a trial run on."""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path

ISOLATED = Path("/sys/devices/system/cpu/isolated")


def cores_for(slot: int, realtime: bool = False) -> dict[str, tuple[int, ...]]:
    """Return the cores of each role: one for driver and controller (the fastest hand-over), another for the logger.

    In real time cores that the machine was booted to keep free (isolcpus) come first for driver and controller.
    """
    cores = sorted(os.sched_getaffinity(0))
    own, other = cores[slot % len(cores)], cores[(slot + 1) % len(cores)]
    if realtime and (isolated := isolated_cores()):
        own, other = isolated[slot % len(isolated)], cores[slot % len(cores)]
    return {"driver": (own,), "controller": (own,), "logger": (other,)}


def isolated_cores() -> list[int]:
    """Return the cores that the scheduler leaves alone; a process comes there only if it is pinned to them."""
    try:
        return listed(ISOLATED.read_text())
    except OSError:
        return []


def listed(text: str) -> list[int]:
    """Return the numbers of a kernel's list, such as "0,2-4"."""
    result: list[int] = []
    for part in filter(None, text.strip().split(",")):
        first, _, last = part.partition("-")
        result += range(int(first), int(last or first) + 1)
    return result


def pin(cores: Iterable[int]) -> tuple[str, str]:
    """Keep this process on `cores`, as far as it may; return (where it runs now, why that is not as wanted)."""
    wanted, reason = set(cores), ""
    try:
        os.sched_setaffinity(0, wanted)
    except OSError as error:
        reason = f"{error.strerror}: this process may not run there"
    now = os.sched_getaffinity(0)
    if not reason and now != wanted:
        reason = "this process may not run on all of them"
    return " ".join(map(str, sorted(now))), reason
