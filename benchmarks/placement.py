"""Core and priority of the processes that hilrig is compared with: those of the rig's driver and controller."""

from __future__ import annotations

from typing import NamedTuple

from hilrig.experiment.rig_settings import RigSettings
from hilrig.rig.cores import cores_for


class Placement(NamedTuple):
    """Which core the two processes of a pair run on, and how they are scheduled."""

    core: int
    policy: str
    """batch, fifo or other"""
    priority: int


def placement(realtime: bool, privileged: bool) -> Placement:
    """Return the rig's placement: one core for both; SCHED_BATCH in lockstep, SCHED_FIFO in real time if permitted."""
    (core,) = cores_for(0, realtime)["driver"]
    if not realtime:
        return Placement(core, "batch", 0)
    return Placement(core, "fifo", RigSettings().priority) if privileged else Placement(core, "other", 0)
