"""Stops a whole process for a given time; the kernel resumes it."""

from __future__ import annotations

import ctypes
import os
import signal
import threading
import time

from hilrig.core.errors import RigError

RETRIES_NS = (0, 10_000_000, 100_000_000, 1_000_000_000)
"""Times of SIGCONT after the resume time, ns: a process that is delayed before it stops misses the first one"""
_SECOND = 1_000_000_000
_SIGEV_SIGNAL = 0
_libc = ctypes.CDLL(None, use_errno=True)


class _SignalEvent(ctypes.Structure):
    """struct sigevent, 64 bytes."""

    _fields_ = (
        ("value", ctypes.c_void_p), ("signal", ctypes.c_int), ("notify", ctypes.c_int), ("rest", ctypes.c_char * 48),
    )  # fmt: skip


class _TimerSpec(ctypes.Structure):
    """struct itimerspec: interval and expiry, each in seconds and nanoseconds."""

    _fields_ = tuple((name, ctypes.c_long) for name in ("interval_s", "interval_ns", "value_s", "value_ns"))


class Stopper:
    """Stops this process with all its threads (SIGSTOP) for a given time.

    No other process is needed to resume it: its own POSIX timers send SIGCONT, and they keep running while it is
    stopped. The process's handler for SIGCONT runs, if it has one. Raises RigError if such timers are not available.
    """

    def __init__(self) -> None:
        # One timer for each SIGCONT: a periodic timer does not fire again while the signal is ignored (Linux 6.13).
        self._timers = [_new_timer() for _ in RETRIES_NS]

    def stop(self, duration_ns: int) -> None:
        """Stop this process for `duration_ns`, above 0, and return when it has resumed."""
        for timer, extra in zip(self._timers, RETRIES_NS, strict=True):
            _set(timer, duration_ns + extra)
        try:
            # To this thread: if another thread received the signal, it might stop the process after the timers are off.
            signal.pthread_kill(threading.get_ident(), signal.SIGSTOP)
        finally:
            for timer in self._timers:
                _set(timer, 0)


def _new_timer() -> ctypes.c_void_p:
    event, timer = _SignalEvent(None, signal.SIGCONT, _SIGEV_SIGNAL, b""), ctypes.c_void_p()
    create = getattr(_libc, "timer_create", None) or ctypes.CDLL("librt.so.1", use_errno=True).timer_create
    if create(time.CLOCK_MONOTONIC, ctypes.byref(event), ctypes.byref(timer)) != 0:
        raise RigError(f"cannot make a timer that resumes a stopped process: {os.strerror(ctypes.get_errno())}")
    return timer


def _set(timer: ctypes.c_void_p, after_ns: int) -> None:
    """Set a timer to fire once, `after_ns` from now; 0 disarms it."""
    spec = _TimerSpec(0, 0, *divmod(after_ns, _SECOND))
    if _libc.timer_settime(timer, 0, ctypes.byref(spec), None) != 0:
        raise RigError(f"cannot set the timer that resumes a stopped process: {os.strerror(ctypes.get_errno())}")
