"""Cores and priorities of what hilrig is compared with: those that the rig gives to driver and controller."""

from __future__ import annotations

import os
from typing import NamedTuple

from hilrig.experiment.rig_settings import RigSettings
from hilrig.rig.cores import cores_for


class Placement(NamedTuple):
    """Where the two processes of a pair run, and when they come first."""

    core: int
    policy: str
    """batch, fifo or other"""
    priority: int


def placement(realtime: bool, privileged: bool) -> Placement:
    """Return what the rig does: one core for both; SCHED_BATCH in lockstep, SCHED_FIFO in real time if permitted."""
    (core,) = cores_for(0, realtime)["driver"]
    if not realtime:
        return Placement(core, "batch", 0)
    return Placement(core, "fifo", RigSettings().priority) if privileged else Placement(core, "other", 0)


def fifo_permitted() -> bool:
    """Whether this process may use SCHED_FIFO; its own policy is as before afterwards."""
    before, parameter = os.sched_getscheduler(0), os.sched_getparam(0)
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(1))
    except PermissionError:
        return False
    os.sched_setscheduler(0, before, parameter)
    return True
