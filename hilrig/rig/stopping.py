"""A process that stops itself whole and is continued by the kernel."""

from __future__ import annotations

import ctypes
import os
import signal
import threading
import time

from hilrig.core.errors import RigError

EXTRA = (0, 10_000_000, 100_000_000, 1_000_000_000)
"""ns: SIGCONT is sent again so much later. A process that is held up before it stops would miss the first one"""
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
    """Stops this process with all its threads (SIGSTOP), for a given time.

    Nobody has to live for it to go on: POSIX timers of the process itself send SIGCONT, and timers run on while a
    process is stopped. Such a signal runs the process's handler for SIGCONT, if it has one. Raises RigError where there
    are no such timers.
    """

    def __init__(self) -> None:
        # One timer for each signal: a periodic one is not set off again while SIGCONT is ignored (Linux 6.13).
        self._timers = [_new_timer() for _ in EXTRA]

    def stop(self, duration: int) -> None:
        """Stop this process for `duration` ns, above 0, and return when it has been continued."""
        for timer, extra in zip(self._timers, EXTRA, strict=True):
            _set(timer, duration + extra)
        try:
            # To this thread: another one that took the signal could stop the process when the timers are off already.
            signal.pthread_kill(threading.get_ident(), signal.SIGSTOP)
        finally:
            for timer in self._timers:
                _set(timer, 0)


def _new_timer() -> ctypes.c_void_p:
    event, timer = _SignalEvent(None, signal.SIGCONT, _SIGEV_SIGNAL, b""), ctypes.c_void_p()
    create = getattr(_libc, "timer_create", None) or ctypes.CDLL("librt.so.1", use_errno=True).timer_create
    if create(time.CLOCK_MONOTONIC, ctypes.byref(event), ctypes.byref(timer)) != 0:
        raise RigError(f"no timer that could continue a stopped process: {os.strerror(ctypes.get_errno())}")
    return timer


def _set(timer: ctypes.c_void_p, after: int) -> None:
    """Set a timer to go off once, `after` ns from now; 0: not at all."""
    spec = _TimerSpec(0, 0, *divmod(after, _SECOND))
    if _libc.timer_settime(timer, 0, ctypes.byref(spec), None) != 0:
        raise RigError(f"the timer that continues a stopped process: {os.strerror(ctypes.get_errno())}")
