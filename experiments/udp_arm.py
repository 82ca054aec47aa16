"""The driver of an arm that speaks UDP. docs/drivers.md explains it part by part, with the bytes of the messages."""

import secrets
import socket
import struct
import time
from contextlib import suppress
from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np

from hilrig import Capabilities, Command, HilrigError, Measurement, Parameter, Progress, Robot

ORDER, SAMPLE = struct.Struct("<4sIII2d"), struct.Struct("<4sIIIId2d6d2d")
MAGIC = b"ARM1"
ATTACH, MOVE, HOLD, DETACH = range(1, 5)
HELD = 0  # the state of a robot that holds itself; 1: it follows
ANSWER = 0.5  # s that the robot may take to answer
SLOW = 0.3  # rad/s on the way to the start
APPROACH, CLEAR = 0.02, 0.03  # m/s along the normal, and m that the tip moves away at the end
TARED = 20  # samples


@dataclass(frozen=True)
class UdpArm:
    """q_ref of eq. (26), sent to a position servo once for each sample of the robot's own clock."""

    capabilities: ClassVar[Capabilities] = Capabilities(("realtime",), (), simulated=False, stop_time=2.0)

    robot: Robot
    surface_position: Annotated[float, Parameter("m", "where the surface is expected", -10, 10)] = 0.35
    servo_gain: Annotated[float, Parameter("N*m/rad", "k_ref of eq. (26)", 1e-3, 1e6)] = 60.0
    host: Annotated[str, Parameter("", "where the robot listens")] = "127.0.0.1"
    port: Annotated[int, Parameter("", "its UDP port", 1, 65535)] = 47200

    def connect(self, start) -> "UdpPlant":
        """Attach to the robot, which goes on holding itself. Raises HilrigError if it does not answer."""
        return UdpPlant(self, start)


class UdpPlant:
    """The arm during one trial."""

    def __init__(self, driver, start):
        self.driver, self.start, self.robot = driver, start, driver.robot
        self.session, self.sent = secrets.randbits(32), 0
        self.number = self.measured = -1  # of the newest sample, and of the last one that was measured
        self.bias = np.zeros(6)
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.connect((driver.host, driver.port))
        self._ask(ATTACH)
        self.reference = self.q.copy()

    def _receive(self, timeout):
        """Take in the newest sample; return whether one came. Whatever is not the robot's next is left out."""
        new, deadline = False, time.monotonic() + timeout
        while True:
            self.socket.settimeout(0.0 if new else max(deadline - time.monotonic(), 0.0))
            try:
                data = self.socket.recv(1024)
            except ConnectionRefusedError:  # nobody listens there
                continue
            except (TimeoutError, BlockingIOError):
                return new
            if len(data) == SAMPLE.size:
                magic, session, number, state, done, stamp, *values = SAMPLE.unpack(data)
                if (magic, session) == (MAGIC, self.session) and number > self.number and np.isfinite(values).all():
                    self.number, self.state, self.done, self.stamp, new = number, state, done, stamp, True
                    self.q, self.wrench, self.torque = np.split(np.array(values), [2, 8])

    def _send(self, what, position=(0.0, 0.0)):
        self.sent += 1
        with suppress(OSError):  # a robot that is gone is noticed by its samples, which stay away
            self.socket.send(ORDER.pack(MAGIC, self.session, self.sent, what, *position))

    def _ask(self, what):
        """Send an order until a sample says that the robot has done it, and holds. Raises HilrigError."""
        first, deadline = self.sent + 1, time.monotonic() + ANSWER
        while time.monotonic() < deadline:
            self._send(what)
            if self._receive(0.02) and self.done >= first and self.state == HELD:
                return
        raise HilrigError(
            f"no robot at {self.driver.host}:{self.driver.port} answers within {ANSWER:g} s, or another program has "
            "it; start the simulated one with: python experiments/udp_robot.py"
        )

    def await_sample(self, timeout_s):
        """Wait for a sample that was not measured yet."""
        return time.monotonic() if self._receive(timeout_s) else None

    def measure(self, disturbance):
        """Return the newest sample, without waiting."""
        self._receive(0.0)
        fresh, self.measured = self.number != self.measured, self.number
        return Measurement(self.q.copy(), self.wrench - self.bias, self.torque.copy(), self.stamp, fresh)

    def advance(self, command, disturbance):
        """Send the joint reference."""
        self.reference = command.position.copy()
        self._send(MOVE, self.reference)

    def holding_command(self):
        """Return the reference that the robot holds."""
        return Command(np.zeros(2), self.reference.copy())

    def truth(self, disturbance):
        """Return None: a robot does not know the truth."""

    def hold(self):
        """Let the robot hold itself, and wait until it says so. Raises HilrigError."""
        self._ask(HOLD)

    def close(self):
        """Let go of the robot, which goes on holding itself."""
        self._send(DETACH)
        self.socket.close()

    def prepare(self):
        """Go to the start slowly, then tare the force sensor in the air."""
        goal, step, readings = self.start.joint_position, SLOW * self.start.period, []
        while (left := np.abs(goal - self.q).max()) > 0.01:
            reference = self.reference + np.clip(goal - self.reference, -step, step)
            yield Progress("going to the start", left, 0.0, "rad", Command(np.zeros(2), reference))
        for k in range(TARED):
            readings.append(self.wrench)
            yield Progress("taring the force sensor", k + 1, TARED, "samples", self.holding_command())
        self.bias = np.mean(readings, axis=0)

    def approach(self):
        """Move along the normal until half of the desired force is felt."""
        goal = self.start.force[-1] / 2
        yield from self._along(APPROACH, lambda: ("approaching", self.wrench[2] - self.bias[2], goal, "N"))

    def retract(self):
        """Move away from the surface."""
        goal = self._tip()[-1] - CLEAR
        yield from self._along(-APPROACH, lambda: ("retracting", -self._tip()[-1], -goal, "m"))

    def _along(self, speed, progress):
        """Move the reference along the normal until what `progress` tells reaches its target."""
        place = self.robot.forward_kinematics(self.reference.copy())
        while (now := progress())[1] < now[2]:
            place[-1] += speed * self.start.period
            yield Progress(*now, Command(np.zeros(2), self.robot.inverse_kinematics(place.copy())))

    def _tip(self):
        return self.robot.forward_kinematics(self.q.copy())
