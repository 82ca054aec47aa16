"""Paces the ticks of a trial by CLOCK_MONOTONIC, or by the samples of the plant."""

from __future__ import annotations

import ctypes
import time
from collections.abc import Callable
from typing import NamedTuple

TIMER_ABSTIME = 1
NANOSECONDS = 1_000_000_000
PROGRESS_NS = 100_000_000
"""Time between two progress reports, and between two checks of whether to stop, ns"""
PULL = 0.15
"""Share of a sample's deviation by which the expected times of the next ones follow it"""
PATIENCE = 0.5
"""Fraction of a period after its expected time from which a sample counts as missing"""


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


class Begun(NamedTuple):
    """When a tick began."""

    tick: int
    due: int
    """When it was due, CLOCK_MONOTONIC in ns"""
    sampled: int
    """When the sample that began it arrived, CLOCK_MONOTONIC in ns; 0 if none did"""


class Timer:
    """Begins the ticks of a real-time trial by the rig's timer. A tick that is overdue by a period is left out."""

    def __init__(self, pacer: Pacer, period: float) -> None:
        self._pacer, self._period = pacer, round(period * NANOSECONDS)

    def wait(self, tick: int) -> Begun:
        """Wait for the tick, or for a later one if that is due already."""
        due = self._pacer.wait(tick)
        overdue = max((time.monotonic_ns() - due) // self._period, 0)
        return Begun(tick + overdue, due + overdue * self._period, 0)


class Samples:
    """Begins the ticks of a real-time trial by the plant's samples.

    A tick is due when its sample arrives. A sample that is late by half a period counts as missing, and the tick begins
    without it. The expected times follow the samples slowly, so neither jitter nor a clock that runs a little faster or
    slower moves a sample to another tick.
    """

    def __init__(self, await_sample: Callable[[float], float | None], period: float, first_s: float) -> None:
        """`await_sample(timeout_s)` returns when the next sample arrived, s; the first may take `first_s`."""
        self._await, self._period, self._first_s = await_sample, period * NANOSECONDS, first_s
        self._start = 0.0

    def wait(self, tick: int) -> Begun:
        """Wait for the sample of the tick; it may turn out to be that of a later one."""
        if tick == 0:
            arrived = self._await(self._first_s)
            self._start = time.monotonic_ns() if arrived is None else arrived * NANOSECONDS
            return Begun(0, round(self._start), 0 if arrived is None else round(self._start))
        expected = self._start + tick * self._period
        latest = expected + PATIENCE * self._period
        arrived = self._await(max(latest - time.monotonic_ns(), 0.0) / NANOSECONDS)
        if arrived is None:
            now = time.monotonic_ns()
            overdue = max(int((now - latest) // self._period), 0)
            return Begun(tick + overdue, round(latest + overdue * self._period), 0)
        moment = arrived * NANOSECONDS
        found = max(round((moment - self._start) / self._period), tick)
        self._start += PULL * (moment - self._start - found * self._period)
        return Begun(found, round(moment), round(moment))
