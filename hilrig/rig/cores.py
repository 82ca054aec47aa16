"""Chooses the cores on which the processes of a trial run."""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path

ISOLATED = Path("/sys/devices/system/cpu/isolated")


def cores_for(slot: int, realtime: bool = False) -> dict[str, tuple[int, ...]]:
    """Return the cores of each role: one for driver and controller together, another for the logger.

    Driver and controller hand over to each other fastest on one core. In real time they get an isolated core
    (isolcpus), if there is one.
    """
    cores = sorted(os.sched_getaffinity(0))
    own, other = cores[slot % len(cores)], cores[(slot + 1) % len(cores)]
    if realtime and (isolated := isolated_cores()):
        own, other = isolated[slot % len(isolated)], cores[slot % len(cores)]
    return {"driver": (own,), "controller": (own,), "logger": (other,)}


def isolated_cores() -> list[int]:
    """Return the isolated cores: only processes that are pinned to them run there."""
    try:
        return listed(ISOLATED.read_text())
    except OSError:
        return []


def listed(text: str) -> list[int]:
    """Return the numbers in a list as the kernel writes it, such as "0,2-4"."""
    result: list[int] = []
    for part in filter(None, text.strip().split(",")):
        first, _, last = part.partition("-")
        result += range(int(first), int(last or first) + 1)
    return result


def pin(cores: Iterable[int]) -> tuple[str, str]:
    """Pin this process to `cores`; return (the cores it now runs on, why they differ from those wanted)."""
    wanted, reason = set(cores), ""
    try:
        os.sched_setaffinity(0, wanted)
    except OSError as error:
        reason = f"{error.strerror}: this process may not run there"
    now = os.sched_getaffinity(0)
    if not reason and now != wanted:
        reason = "this process may not run on all of them"
    return " ".join(map(str, sorted(now))), reason
