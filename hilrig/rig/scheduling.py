"""The scheduling of a process, and how punctually the kernel wakes it."""

from __future__ import annotations

import ctypes
import os
import resource

PR_SET_TIMERSLACK = 29
PR_GET_TIMERSLACK = 30
_POLICIES = {"fifo": os.SCHED_FIFO, "batch": os.SCHED_BATCH, "other": os.SCHED_OTHER}
_libc = ctypes.CDLL(None, use_errno=True)


def schedule(scheduler: str, priority: int) -> tuple[str, str]:
    """Set the scheduling policy of this process; return (the policy it now has, why it differs from the one wanted).

    "fifo": it runs before every ordinary process, at `priority` (1 to 99) or, without the privilege, at the highest one
    that RLIMIT_RTPRIO permits. "batch": a process that wakes another one on its core keeps running until it waits
    itself. In lockstep driver and controller take turns; a process that is interrupted by the other's wake-up loses its
    caches twice. "other": the default policy.
    """
    try:
        os.sched_setscheduler(0, _POLICIES[scheduler], os.sched_param(priority if scheduler == "fifo" else 0))
    except PermissionError as error:
        permitted = resource.getrlimit(resource.RLIMIT_RTPRIO)[0]
        if scheduler == "fifo" and 0 < permitted < priority:
            return schedule("fifo", permitted)[0], f"the limit of real-time priority (ulimit -r) is {permitted}"
        return scheduler_now(), f"{error.strerror}; the limit of real-time priority (ulimit -r) is {permitted}"
    except OSError as error:
        return scheduler_now(), str(error.strerror)
    return scheduler_now(), ""


def scheduler_now() -> str:
    """Return the scheduling policy of this process in the terms of the settings: "fifo 50", "batch", "other"."""
    policy = os.sched_getscheduler(0) & ~os.SCHED_RESET_ON_FORK
    name = next((name for name, number in _POLICIES.items() if number == policy), f"policy {policy}")
    return f"{name} {os.sched_getparam(0).sched_priority}" if name == "fifo" else name


def set_timer_slack(slack: float) -> tuple[str, str]:
    """Allow the kernel to wake this thread, and threads that it starts, at most `slack` s late.

    Return (the slack it now has, why it differs from the one wanted). Needs no privilege. The kernel's default is 50
    us; a thread under SCHED_FIFO has no slack.
    """
    wanted = max(round(slack * 1e9), 1)  # 0 would mean the default
    if _libc.prctl(PR_SET_TIMERSLACK, ctypes.c_ulong(wanted), 0, 0, 0) != 0:
        return f"{_libc.prctl(PR_GET_TIMERSLACK, 0, 0, 0, 0)} ns", os.strerror(ctypes.get_errno())
    return f"{_libc.prctl(PR_GET_TIMERSLACK, 0, 0, 0, 0)} ns", ""
