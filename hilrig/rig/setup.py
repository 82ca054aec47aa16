"""The real-time set-up of a process: applies every setting that is permitted, and reports those that were refused.

It has two steps. `prepare` runs before the process has threads, because threads inherit its cores, its scheduling and
its timer slack. `settle` runs when everything that the loop needs exists, just before the trial starts.
"""

from __future__ import annotations

import gc
import os
from collections.abc import Iterable

from hilrig.experiment.rig_settings import RigSettings
from hilrig.rig import memory
from hilrig.rig.cores import pin
from hilrig.rig.scheduling import schedule, set_timer_slack

LOOP = ("driver", "controller")
"""Roles in the control loop, which wait for each other at every tick"""
DMA_LATENCY = "/dev/cpu_dma_latency"

Report = dict[str, dict[str, str]]
"""Setting -> {"wanted", "applied", "reason"}, in words; the reason is empty if the setting was applied as wanted"""


def prepare(settings: RigSettings, role: str, cores: Iterable[int], realtime: bool) -> Report:
    """Set this process's cores and scheduling, and keep the cores out of deep sleep; return what was applied.

    In lockstep every role is pinned and gets SCHED_BATCH, whatever the settings say (decision 7). In real time the
    logger is only pinned. The driver holds cpu_dma_latency, because it lives exactly as long as the trial.
    """
    report: Report = {}
    if settings.pin or not realtime:
        report["pin"] = _account(_cores(cores), *pin(cores))
    else:
        report["pin"] = as_wanted("none")
    if not realtime:
        report["scheduler"] = _account("batch", *schedule("batch", 0))
    elif role in LOOP:
        # The driver keeps the clock, so it has priority: a controller that computes too long must not delay it.
        priority = settings.priority + (role == "driver")
        wanted = f"fifo {priority}" if settings.scheduler == "fifo" else settings.scheduler
        # Set the slack first: under SCHED_FIFO the kernel ignores it.
        report["timer_slack"] = _account(f"{settings.timer_slack * 1e9:.0f} ns", *set_timer_slack(settings.timer_slack))
        report["scheduler"] = _account(wanted, *schedule(settings.scheduler, priority))
    if realtime and role == "driver":
        report["cpu_dma_latency"] = _hold_awake(settings.cpu_dma_latency)
    return report


def settle(settings: RigSettings, role: str, realtime: bool) -> Report:
    """Lock this process's memory and switch off its garbage collector; everything that the loop needs exists by now.

    The collector is off in lockstep and in the logger too: a collection takes 50 ms, and the loop may wait for it.
    """
    report: Report = {}
    frozen = settings.freeze_garbage or not realtime
    if frozen:
        freeze()
    report["freeze_garbage"] = as_wanted("frozen" if frozen else "none")
    if realtime and role in LOOP:
        report["lock_memory"] = _account("locked", *memory.lock()) if settings.lock_memory else as_wanted("none")
    return report


def refusals(report: Report) -> list[str]:
    """Return a line for each setting that was not applied as wanted: what was applied instead, and why."""
    return [
        f"{name}: {item['applied']} instead of {item['wanted']}: {item['reason']}"
        for name, item in report.items()
        if item["reason"]
    ]


def freeze() -> None:
    """Collect garbage now, and switch the collector off."""
    gc.collect()
    gc.freeze()
    gc.disable()


def _account(wanted: str, applied: str, reason: str) -> dict[str, str]:
    return {"wanted": wanted, "applied": applied, "reason": reason}


def as_wanted(applied: str) -> dict[str, str]:
    """Return the report on a setting that was applied as wanted."""
    return _account(applied, applied, "")


def _cores(cores: Iterable[int]) -> str:
    return " ".join(map(str, sorted(cores)))


_held: list[int] = []
"""The open file of cpu_dma_latency: the kernel forgets the request when the process ends"""


def _hold_awake(latency: float | None) -> dict[str, str]:
    """Allow only idle states that a core leaves within `latency`, s, for as long as this process lives."""
    if latency is None:
        return as_wanted("as it is")
    wanted = f"{latency * 1e6:.0f} us"
    try:
        file = os.open(DMA_LATENCY, os.O_WRONLY | os.O_CLOEXEC)
    except OSError as error:
        return _account(wanted, "as it is", f"{DMA_LATENCY}: {error.strerror}")
    _held.append(file)
    try:
        os.write(file, round(latency * 1e6).to_bytes(4, "little", signed=True))
    except OSError as error:
        return _account(wanted, "as it is", f"{DMA_LATENCY}: {error.strerror}")
    return as_wanted(wanted)
