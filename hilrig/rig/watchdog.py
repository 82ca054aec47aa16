"""The watchdogs of a real-time trial: on the age of the command and of the sample, and on the driver's own loop."""

from __future__ import annotations

import time
from collections.abc import Callable
from threading import Event, Thread

from hilrig.core.errors import Tripped
from hilrig.experiment.trial import Trial
from hilrig.loop.driver_node import DriverNode

REMEMBERED = 1024
"""Ticks whose time is kept until a command answers them"""


class CommandAge:
    """The age of the command in effect, and of the newest sample, against their limits."""

    def __init__(self, trial: Trial) -> None:
        limits, delay = trial.limits, trial.actuation_delay
        self._period, self._period_ns = trial.period, trial.period * 1e9
        self.limit_s = limits.command_age_limit(trial.period, delay)
        self.sample_limit_s = limits.sample_age_limit(trial.period, delay)
        self._limit_ns, self._sample_limit_ns = round(self.limit_s * 1e9), round(self.sample_limit_s * 1e9)
        self._began = [0] * REMEMBERED
        self._first = self._sampled = self._measured = 0
        self._acting = -1

    def begin(self, tick: int, left_out: int, now: int) -> None:
        """Note that a tick begins, after `left_out` ticks that were not done. Raises Tripped after a standstill."""
        self._began[tick % REMEMBERED] = now
        if not self._first:
            self._first = self._sampled = now
        if left_out * self._period > self.limit_s:
            raise Tripped(
                f"the machine or the driver stood still for {left_out * self._period:.4g} s before {self._at(tick)}: "
                f"longer than a command may act, {self.limit_s:g} s (safety.command_age)"
            )

    def check(self, tick: int, acting: int, now: int, fresh: bool) -> None:
        """Raise Tripped if the command of tick `acting` or the newest sample is too old."""
        if acting != self._acting:
            self._acting = acting
            known = tick - acting < REMEMBERED
            self._measured = (
                self._began[acting % REMEMBERED] if known else now - round((tick - acting) * self._period_ns)
            )
        age = self.age(now)
        if age > self._limit_ns:
            what = "no command has come" if acting < 0 else f"the last command, of tick {acting}, is too old"
            raise Tripped(
                f"{what}: {age * 1e-9:.4g} s at {self._at(tick)}, over the limit of {self.limit_s:g} s "
                "(safety.command_age)"
            )
        if fresh:
            self._sampled = now
        elif now - self._sampled > self._sample_limit_ns:
            raise Tripped(
                f"the plant has given no new sample for {(now - self._sampled) * 1e-9:.4g} s at {self._at(tick)}, over "
                f"the limit of {self.sample_limit_s:g} s (safety.sample_age)"
            )

    def age(self, now: int) -> int:
        """Return the age of the command in effect, ns: the time since the tick that it answers began."""
        return now - (self._measured or self._first or now)

    def _at(self, tick: int) -> str:
        return f"t = {tick * self._period:.4g} s (tick {tick})"


class Watchdog:
    """A thread that holds the plant once the driver's loop has not come round for `limit_s`.

    The loop checks the age of its command at every tick; this thread is for the case that no next tick comes, because
    the loop waits for something that was not to make it wait. It cannot help while the plant's own code is running.
    """

    def __init__(self, node: DriverNode, limit_s: float, tell: Callable[[str], None]) -> None:
        """`tell` is told why the plant was held."""
        self._node, self._limit_s, self._tell = node, limit_s, tell
        self._over, self._seen, self._watching = Event(), 0, False
        self.bitten_ns = 0
        """How long the loop had been away when the plant was held, ns; 0 if it was not. Latched"""

    def start(self) -> None:
        """Watch from now on, if it does not yet."""
        self._seen = time.monotonic_ns()
        if not self._watching:
            self._watching = True
            Thread(target=self._watch, name="watchdog", daemon=True).start()

    def stroke(self, now: int) -> None:
        """Note that the loop has come round, at `now` ns."""
        self._seen = now

    def stop(self) -> None:
        """Watch no longer."""
        self._over.set()

    def check(self) -> None:
        """Raise Tripped if the plant was held."""
        if self.bitten_ns:
            raise Tripped(self.why())

    def why(self) -> str:
        """Return why the plant was held."""
        return (
            f"the driver's loop did not come round for {self.bitten_ns * 1e-9:.4g} s, longer than a command may act, "
            f"{self._limit_s:g} s (safety.command_age)"
        )

    def _watch(self) -> None:
        while not self._over.wait(self._limit_s / 4):
            away = time.monotonic_ns() - self._seen
            if away > self._limit_s * 1e9 and not self._node.busy:
                self.bitten_ns = away
                self._node.hold()
                self._tell(self.why())
                return
