"""A simulated robot for udp_arm.py: a process of its own, with its own clock, that speaks UDP and holds itself.

    python experiments/udp_robot.py                  until Ctrl-C
    python experiments/udp_robot.py --dropouts 0.05  one sample in twenty is lost

Two links in a horizontal plane press a spring. A position servo, once per millisecond, follows the reference of whoever
is attached; without orders for 0.1 s it holds its reference. Every 10 ms, with jitter, it sends what its sensors read.
"""

from __future__ import annotations

import argparse
import os
import socket
import struct
import time
from contextlib import suppress

import numpy as np
from hilrig_drivers.two_link import TwoLink

from hilrig import Actuation, Command, PlantDisturbance, Surface, TrialStart
from hilrig.kinds.robots.planar_2r import Planar2r

ORDER, SAMPLE = struct.Struct("<4sIII2d"), struct.Struct("<4sIIIId2d6d2d")
MAGIC = b"ARM1"
ATTACH, MOVE, HOLD, DETACH = range(1, 5)
HELD, FOLLOWING = 0, 1
PERIOD, STEP = 0.01, 1e-3  # s: of its samples, and of its servo
JITTER = 5e-4  # s, standard deviation
ALONE = 0.1  # s without an order, after which it holds itself
FASTEST = 5.0  # rad/s: it follows no reference faster than this
BIAS, NOISE, RESOLUTION = 0.8, 0.03, 2e-5  # N, N, rad: of its force sensor and its encoders
STILL = PlantDisturbance(np.zeros(2), 0.0, 0.0, 1.0, 1.0, 1.0)
PARKED = (0.2, 1.2)  # rad, where it is switched on


class Robot:
    """The arm, its servo, and who has it."""

    def __init__(self) -> None:
        arm = Planar2r(lengths=(0.345, 0.2), masses=(1.8, 1.1), gravity=(0.0, 0.0))
        servo = Actuation("position_servo", k_ref=60.0, stiffness=60.0, damping=3.0)
        driver = TwoLink(arm, Surface(position=0.35, stiffness=800.0, damping=20.0, friction=0.2), servo)
        self.plant = driver.connect(TrialStart(STEP, np.array(PARKED), np.zeros(2)))
        self.plant.measure(STILL)
        self.reference = self.wanted = np.array(PARKED)
        self.state, self.session, self.done, self.heard = HELD, 0, 0, -1e9

    def step(self, now: float) -> None:
        """Run the servo for a millisecond."""
        if self.state == FOLLOWING and now - self.heard > ALONE:
            self.state = HELD
        if self.state == FOLLOWING:
            self.reference = self.reference + np.clip(self.wanted - self.reference, -FASTEST * STEP, FASTEST * STEP)
        self.plant.advance(Command(np.zeros(2), self.reference.copy()), STILL)

    def take(self, data: bytes, now: float) -> bool:
        """Do an order; return whether it was one of whoever has the robot, or may have it now."""
        if len(data) != ORDER.size:
            return False
        magic, session, number, what, *position = ORDER.unpack(data)
        if magic != MAGIC or not np.isfinite(position).all():
            return False
        free = self.session in (0, session) or now - self.heard > ALONE
        if what == ATTACH and free and session != self.session:
            self.session, self.done, self.state = session, 0, HELD
        if session != self.session or number <= self.done:
            return False
        self.done, self.heard = number, now
        if what == MOVE:
            self.state, self.wanted = FOLLOWING, np.array(position)
        elif what in (HOLD, ATTACH, DETACH):
            self.state = HELD
        if what == DETACH:
            self.session = 0
        return True

    def sample(self, number: int, stamp: float, random: np.random.Generator) -> bytes:
        """Return what the sensors read, as a message."""
        seen = self.plant.measure(STILL)
        q = np.round(seen.joint_position / RESOLUTION) * RESOLUTION
        wrench = seen.wrench + np.array([0.0, 0.0, BIAS, 0.0, 0.0, 0.0]) + NOISE * random.standard_normal(6)
        return SAMPLE.pack(MAGIC, self.session, number, self.state, self.done, stamp, *q, *wrench, *seen.applied_torque)


def main() -> None:
    """Live until Ctrl-C."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--port", type=int, default=47200)
    parser.add_argument("--dropouts", type=float, default=0.0, help="share of the samples that are lost")
    parser.add_argument("--seed", type=int, default=1, help="of jitter, noise and dropouts")
    options = parser.parse_args()
    with suppress(OSError):  # a robot has a computer of its own: here, what else runs is not to delay it
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(60))
    random, robot = np.random.default_rng(options.seed), Robot()
    robot.step(0.0)  # loads what is compiled
    link = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    link.bind(("127.0.0.1", options.port))
    link.setblocking(False)
    owner: tuple[str, int] | None = None
    began, number, done = time.monotonic(), 0, 0
    print(f"the robot is on, at 127.0.0.1:{options.port}", flush=True)
    while True:
        due = began + (number + 1) * PERIOD + abs(JITTER * random.standard_normal())
        while (now := time.monotonic()) < due:
            while begins_order := _order(link):
                data, sender = begins_order
                owner = sender if robot.take(data, now) else owner
            while done < (now - began) / STEP:
                robot.step(now)
                done += 1
            time.sleep(min(STEP / 2, max(due - time.monotonic(), 0.0)))
        number += 1
        if owner and random.random() >= options.dropouts:
            try:
                link.sendto(robot.sample(number, now - began, random), owner)
            except OSError:  # its owner is gone
                owner = None


def _order(link: socket.socket) -> tuple[bytes, tuple[str, int]] | None:
    """Return the next datagram that has come, and from where; None if there is none."""
    try:
        return link.recvfrom(1024)
    except OSError:
        return None


if __name__ == "__main__":
    try:
        main()
    except KeyboardInterrupt:
        print("the robot is off")
