"""A process that stops itself whole and is continued by the kernel."""

from __future__ import annotations

import ctypes
import os
import signal
import time

from hilrig.errors import RigError

AGAIN = 10_000_000
"""ns: SIGCONT is sent again so often, for the case that the first one came before the stop"""
_SECOND = 1_000_000_000
_SIGEV_SIGNAL = 0
_libc = ctypes.CDLL(None, use_errno=True)


class _SignalEvent(ctypes.Structure):
    """struct sigevent, 64 bytes."""

    _fields_ = (
        ("value", ctypes.c_void_p), ("signal", ctypes.c_int), ("notify", ctypes.c_int), ("rest", ctypes.c_char * 48),
    )  # fmt: skip


class _TimerSpec(ctypes.Structure):
    """struct itimerspec: interval and first expiry, each in seconds and nanoseconds."""

    _fields_ = tuple((name, ctypes.c_long) for name in ("interval_s", "interval_ns", "value_s", "value_ns"))


class Stopper:
    """Stops this process with all its threads (SIGSTOP), for a given time.

    Nobody has to live for it to go on: a POSIX timer of the process itself sends SIGCONT, and timers run on while a
    process is stopped. Such a signal runs the process's handler for SIGCONT, if it has one. Raises RigError where there
    are no such timers.
    """

    def __init__(self) -> None:
        event, self._timer = _SignalEvent(None, signal.SIGCONT, _SIGEV_SIGNAL, b""), ctypes.c_void_p()
        create = getattr(_libc, "timer_create", None) or ctypes.CDLL("librt.so.1", use_errno=True).timer_create
        if create(time.CLOCK_MONOTONIC, ctypes.byref(event), ctypes.byref(self._timer)) != 0:
            raise RigError(f"no timer that could continue a stopped process: {os.strerror(ctypes.get_errno())}")

    def stop(self, duration: int) -> None:
        """Stop this process for `duration` ns, above 0, and return when it has been continued."""
        self._arm(duration, AGAIN)
        try:
            os.kill(os.getpid(), signal.SIGSTOP)
        finally:
            self._arm(0, 0)

    def _arm(self, first: int, interval: int) -> None:
        spec = _TimerSpec(*divmod(interval, _SECOND), *divmod(first, _SECOND))
        if _libc.timer_settime(self._timer, 0, ctypes.byref(spec), None) != 0:
            raise RigError(f"the timer that continues a stopped process: {os.strerror(ctypes.get_errno())}")
