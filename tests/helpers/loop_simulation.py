"""A simulation of the two processes and the bus by events, with stalls where one wants them: the truth for timing.

It knows nothing of hilrig's certificate: it moves time on, notes stamps as the processes would, and remembers who was
made to stall and when.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

MS = 1_000_000
KINDS = {
    "driver_wake": "driver", "driver_apply": "driver", "driver_publish": "driver", "driver_stop": "driver",
    "controller_receive": "controller", "controller_compute": "controller", "controller_publish": "controller",
    "controller_stop": "controller", "state_hold": "transport", "command_hold": "transport",
    "state_loss": "transport", "command_loss": "transport",
}  # fmt: skip
"""What can be done to the loop -> who is to blame"""


class Stall(NamedTuple):
    """One disturbance of the loop."""

    kind: str
    tick: int
    length: int
    """ns; of a loss without meaning"""


@dataclass
class Loop:
    """A loop in real time."""

    stalls: list[Stall]
    ticks: int
    period: int = MS
    delay: int = 1
    latest_only: bool = True
    """Whether the controller takes the newest state that is there, else the oldest"""
    in_order: bool = True
    """Whether a message that is held holds those behind it"""
    compute: int = 120_000
    offset: int = 0
    """Of the controller's clock, ns"""
    seed: int = 0
    driver: dict[str, list[int]] = field(default_factory=dict)
    controller: dict[str, list[int]] = field(default_factory=dict)

    def run(self) -> Loop:
        """Do all ticks; the stamps are in `driver` and `controller` afterwards."""
        self.random = np.random.default_rng(self.seed)
        self.by = {(stall.kind, stall.tick): stall.length for stall in self.stalls}
        start = 10 * self.period
        # A process is stopped somewhere within the tick.
        self.stops = {
            name: [(start + s.tick * self.period + int(self.random.uniform(0, self.period)), s.length)
                   for s in self.stalls if s.kind == f"{name}_stop"]
            for name in ("driver", "controller")
        }  # fmt: skip
        self.states: list[tuple[int, int]] = []
        self.commands: list[tuple[int, int]] = []
        self.last_state = self.last_command = 0
        self.waiting = start - self.period
        self.driver = {name: [] for name in
                       ("tick", "due", "woke", "published", "command", "received", "applied", "continued")}  # fmt: skip
        self.controller = {name: [] for name in ("tick", "waiting", "received", "computed", "published", "continued")}
        free, held = 0, (-1, 0)
        for tick in range(self.ticks):
            due = start + tick * self.period
            woke = self.work("driver", max(due, free), self.about(8_000) + self.stalled("driver_wake", tick))
            taken = self.work("driver", woke, self.about(30_000))
            self.control(taken)
            there = [c for c in self.commands if c[1] <= taken and c[0] <= tick - self.delay]
            held = max([held, *there])
            applied = self.work("driver", taken, self.about(5_000) + self.stalled("driver_apply", tick))
            published = self.work("driver", applied, self.about(15_000) + self.stalled("driver_publish", tick))
            self.send_state(tick, published)
            row = (tick, due, woke, published, *held, applied, self.continued("driver", published))
            self.note(self.driver, row)
            free = published
        self.control(free + 20 * self.period)
        return self

    def columns(self) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
        """Return the stamps of driver and controller, as a bag has them."""
        driver = {name: np.array(values, dtype=np.int64) for name, values in self.driver.items()}
        controller = {name: np.array(values, dtype=np.int64) for name, values in self.controller.items()}
        for name in ("waiting", "received", "computed", "published"):
            controller[name] += self.offset
        controller["continued"] += np.where(controller["continued"] > 0, self.offset, 0)
        return driver, controller

    def about(self, typical: int) -> int:
        """Return a duration of about this length."""
        return int(typical * self.random.lognormal(0, 0.2))

    def stalled(self, kind: str, tick: int) -> int:
        return self.by.get((kind, tick), 0)

    def work(self, process: str, start: int, duration: int) -> int:
        """Return when work that begins at `start` is done, if the process is stopped meanwhile."""
        end = start + duration
        for stop, length in self.stops[process]:
            if stop < end and start < stop + length:
                end = max(stop, start) + length - max(start - stop, 0) + max(end - max(stop, start), 0)
        return end

    def continued(self, process: str, now: int) -> int:
        """Return when the process last went on."""
        return max((stop + length for stop, length in self.stops[process] if stop + length <= now), default=0)

    def send_state(self, tick: int, published: int) -> None:
        if ("state_loss", tick) in self.by:
            return
        arrival = published + self.about(60_000) + self.stalled("state_hold", tick)
        if self.in_order:
            arrival = self.last_state = max(arrival, self.last_state + 1)
        self.states.append((arrival, tick))

    def control(self, until: int) -> None:
        """Let the controller do all that it begins before `until`."""
        while self.states:
            self.states.sort()
            begin = self.work("controller", max(self.states[0][0], self.waiting), 0)
            if begin > until:
                return
            there = [state for state in self.states if state[0] <= begin]
            _, tick = there[-1] if self.latest_only else there[0]
            self.states = [s for s in self.states if s[0] > begin] if self.latest_only else self.states[1:]
            received = self.work("controller", begin, self.about(5_000))
            law = self.about(self.compute) + self.stalled("controller_compute", tick)
            computed = self.work("controller", received, law)
            answering = self.about(20_000) + self.stalled("controller_publish", tick)
            published = self.work("controller", computed, answering)
            row = (tick, self.waiting, received, computed, published, self.continued("controller", published))
            self.note(self.controller, row)
            self.send_command(tick, published)
            turn = self.about(10_000) + self.stalled("controller_receive", tick + 1)
            self.waiting = self.work("controller", published, turn)

    def send_command(self, tick: int, published: int) -> None:
        if ("command_loss", tick) in self.by:
            return
        arrival = published + self.about(60_000) + self.stalled("command_hold", tick)
        if self.in_order:
            arrival = self.last_command = max(arrival, self.last_command + 1)
        self.commands.append((tick, self.work("driver", arrival, 0)))

    @staticmethod
    def note(table: dict[str, list[int]], row: tuple[int, ...]) -> None:
        for name, value in zip(table, row, strict=True):
            table[name].append(int(value))
