"""A robot behind a bridge, for tests: its side, which notes every call and needs nothing installed, and a driver."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

ROBOT = '''
"""Two joints that follow their references exactly; 100 samples a second. It notes what it is told, and when."""
import json
import os
import sys
import time

print("the robot's software is there", flush=True)


class Robot:
    joints, period = 2, 0.01
    lowest, highest, fastest = (-3.0, -3.0), (3.0, 3.0), (5.0, 5.0)

    def __init__(self, calls, start="0.5 1.5"):
        self.calls, self.q = calls, [float(word) for word in start.split()]
        self.due = time.monotonic()
        with open(calls + ".at", "w") as file:
            file.write(sys.argv[sys.argv.index("--at") + 1])
        self.note("begin")

    def note(self, what):
        with open(self.calls, "a") as file:
            file.write(json.dumps([what, time.monotonic(), os.getpid(), self.q]) + "\\n")

    def has(self, what):
        return os.path.exists(self.calls + "." + what)

    def read(self, timeout):
        self.due = max(self.due + self.period, time.monotonic() - self.period)
        time.sleep(max(self.due - time.monotonic(), 0.0))
        if self.has("silent"):
            return None
        if self.has("broken"):
            raise OSError("the sensor is unplugged")
        q = [float("nan"), 0.0] if self.has("nan") else list(self.q)
        return time.monotonic(), q, [0.0, 0.0, 1.0, 0.0, 0.0, 0.0], [0.0, 0.0]

    def trouble(self):
        return "the runstop is pressed" if self.has("runstop") else ""

    def move(self, q):
        self.q = q
        self.note("move")

    def hold(self):
        self.note("hold")
        if self.has("stuck"):
            raise OSError("the brake does not answer")

    def close(self):
        while self.has("busy"):
            time.sleep(0.01)
        self.note("close")
'''

DRIVER = '''
"""An arm behind a bridge."""
from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np
from hilrig import Capabilities, Command, Measurement, Parameter, Robot
from hilrig_drivers.bridge_client import BridgeSettings, RobotBridge

CALLS, SIDE = {calls!r}, {side!r}


@dataclass(frozen=True)
class Bridged:
    """Joint references, through a bridge."""

    capabilities: ClassVar[Capabilities] = Capabilities(("realtime",), (), simulated=False, stop_time=2.0)
    servo_gain: ClassVar[float] = 60.0
    surface_position: ClassVar[float] = 0.35

    robot: Robot
    age: Annotated[float, Parameter("s", "the bridge's watchdog", 0.02, 10)] = 0.1
    python: Annotated[str, Parameter("", "the interpreter")] = {python!r}

    def connect(self, start) -> "Arm":
        words = {{"calls": CALLS, "start": " ".join(map(repr, start.joint_position.tolist()))}}
        settings = BridgeSettings(SIDE, self.python, words, order_age=self.age, sample_age=self.age)
        return Arm(RobotBridge(settings, 2))


class Arm:
    def __init__(self, robot):
        self.robot, self.reference, self.number = robot, robot.position, 0

    def await_sample(self, timeout_s):
        import time

        return time.monotonic() if self.robot.wait(timeout_s) else None

    def measure(self, disturbance):
        self.robot.wait(0.0)
        sample = self.robot.sample
        fresh, self.number = sample.number != self.number, sample.number
        return Measurement(self.robot.position, self.robot.wrench, self.robot.torque, sample.stamp, fresh)

    def advance(self, command, disturbance):
        self.reference = {reference}
        self.robot.move(self.reference)

    def holding_command(self):
        return Command(np.zeros(2), self.reference.copy())

    def truth(self, disturbance):
        return None

    def hold(self):
        self.robot.hold()

    def close(self):
        self.robot.close()
'''


def robot_side(folder: Path) -> Path:
    """Write the robot's side; return its file."""
    (folder / "robot_side.py").write_text(ROBOT)
    return folder / "robot_side.py"


def bridged_driver(folder: Path, python: str, reference: str = "command.position.copy()") -> str:
    """Write the driver and the robot's side; return the driver's kind, for the experiment."""
    words = {"calls": str(folder / "robot.txt"), "side": str(robot_side(folder)), "python": python}
    (folder / "bridged.py").write_text(DRIVER.format(**words, reference=reference))
    return "./bridged.py"


def robot_calls(folder: Path) -> list[tuple[str, float, int, list[float]]]:
    """Return what the robot was told: what, when (time.monotonic, s), the process, and where its joints were."""
    path = folder / "robot.txt"
    lines: list[Any] = []
    for line in path.read_text().splitlines(keepends=True) if path.exists() else []:
        if line.endswith("\n"):  # the last one may still be being written
            lines.append(json.loads(line))
    return [tuple(line) for line in lines]


def fault(folder: Path, what: str) -> Path:
    """Return the file that makes the robot silent, broken or stopped while it exists."""
    return folder / f"robot.txt.{what}"
