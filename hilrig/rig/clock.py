"""Paces the ticks of a trial by CLOCK_MONOTONIC."""

from __future__ import annotations

import ctypes
import time

TIMER_ABSTIME = 1
NANOSECONDS = 1_000_000_000
PROGRESS_NS = 100_000_000
"""Time between two progress reports, and between two checks of whether to stop, ns"""


class _Timespec(ctypes.Structure):
    _fields_ = (("seconds", ctypes.c_long), ("nanoseconds", ctypes.c_long))


_libc = ctypes.CDLL(None, use_errno=True)


def sleep_until(moment: int) -> None:
    """Sleep until `moment`, CLOCK_MONOTONIC in ns; return at once if it has passed. A signal does not end the sleep."""
    spec = _Timespec(moment // NANOSECONDS, moment % NANOSECONDS)
    while _libc.clock_nanosleep(time.CLOCK_MONOTONIC, TIMER_ABSTIME, ctypes.byref(spec), None) != 0:
        if time.monotonic_ns() >= moment:
            return


class Pacer:
    """Waits until a tick may begin: at once in lockstep, at its due time in real time."""

    def __init__(self, period: float, realtime: bool, spin: float) -> None:
        """`spin`, s, is the last part of every wait, spent awake: the kernel wakes a sleeper some microseconds late."""
        self._period = round(period * NANOSECONDS)
        self._realtime = realtime
        self._start = 0
        self._spin = round(spin * NANOSECONDS)

    def wait(self, tick: int) -> int:
        """Wait for the tick; return when it was due, CLOCK_MONOTONIC in ns. In lockstep that is now."""
        if tick == 0:
            self._start = time.monotonic_ns() + (self._period if self._realtime else 0)
        if not self._realtime:
            return time.monotonic_ns()
        due = self._start + tick * self._period
        sleep_until(due - self._spin)
        while time.monotonic_ns() < due:
            pass
        return due
