"""A driver for tests whose plant is not simulated: it notes every call in a file, with the time, and can misbehave."""

from __future__ import annotations

import json
from pathlib import Path
from typing import NamedTuple

SOURCE = '''
"""A plant that stands still and notes what it is told."""
import os, time
from dataclasses import dataclass
from typing import ClassVar
import numpy as np
from hilrig import Capabilities, Command, Measurement, Progress, Robot

CALLS = {calls!r}


def note(what):
    with open(CALLS, "a") as file:
        file.write(f"{{what}} {{time.monotonic_ns()}} {{os.getpid()}}\\n")


@dataclass(frozen=True)
class Counting:
    """M q'' = 0"""

    capabilities: ClassVar[Capabilities] = Capabilities(("realtime",), (), simulated=False, stop_time=2.0)
    servo_gain: ClassVar[None] = None
    surface_position: ClassVar[float] = 0.35

    robot: Robot

    def connect(self, start) -> "Arm":
        note("connect")
        {connect}
        return Arm(start)


class Arm:
    def __init__(self, start):
        self.q, self.force, self.ticks = start.joint_position + {off}, start.force, 0

    def prepare(self):
        for k in range(3):
            note("prepare")
            {prepare}
            yield Progress("going to the start", k, 2, "rad")

    def approach(self):
        for k in range(3):
            note("approach")
            {approach}
            yield Progress("approaching", k * self.force[1] / 2, self.force[1], "N", self.holding_command())

    def retract(self):
        for k in range(3):
            note("retract")
            {retract}
            yield Progress("retracting")

    def measure(self, disturbance):
        {measure}
        return Measurement(self.q.copy(), np.zeros(6), np.zeros(2))

    def advance(self, command, disturbance):
        self.ticks += 1
        {advance}

    def holding_command(self):
        return Command(np.zeros(2), self.q.copy())

    def truth(self, disturbance):
        return None

    def hold(self):
        note("hold")
        {hold}

    def close(self):
        note("close")
        {close}
'''
PLACES = ("connect", "prepare", "approach", "retract", "measure", "advance", "hold", "close")


class Call(NamedTuple):
    """One call of the plant."""

    what: str
    moment: int
    """CLOCK_MONOTONIC, ns"""
    pid: int


def counting_driver(folder: Path, off: float = 0.0, **steps: str) -> str:
    """Write the driver; `steps` are statements for its methods, `off` how far its joints are from the start, rad.

    Return its kind, for the experiment.
    """
    filled = dict.fromkeys(PLACES, "pass") | steps
    (folder / "counting.py").write_text(SOURCE.format(calls=str(folder / "calls.txt"), off=off, **filled))
    return "./counting.py"


def calls(folder: Path) -> list[Call]:
    """Return the calls that the plant has noted so far."""
    path = folder / "calls.txt"
    lines = path.read_text().splitlines() if path.exists() else []
    return [Call(what, int(moment), int(pid)) for what, moment, pid in (line.split() for line in lines)]


def whats(folder: Path) -> list[str]:
    """Return the names of the calls, repeated ones once."""
    names = [call.what for call in calls(folder)]
    return [name for i, name in enumerate(names) if i == 0 or names[i - 1] != name]


def outcome_of(under: Path) -> dict:
    """Return the outcome of the one trial below `under`/runs."""
    return json.loads(next((under / "runs").glob("*/trials/*/outcome.json")).read_text())
