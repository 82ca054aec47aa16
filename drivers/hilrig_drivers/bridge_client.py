"""A driver's end of a bridge: finds or starts the process that owns the robot (`bridge.py`), and talks to it."""

from __future__ import annotations

import os
import secrets
import socket
import time
from contextlib import suppress

import numpy as np

from hilrig import Array, HilrigError, Tripped
from hilrig_drivers import bridge
from hilrig_drivers._bridge_process import BridgeProcess
from hilrig_drivers._bridge_process import BridgeSettings as BridgeSettings
from hilrig_drivers.bridge import (
    ALIVE,
    ATTACH,
    DETACH,
    END,
    FOLLOWING,
    HELD,
    HOLD,
    MOVE,
    REFUSED,
    TRIPPED,
    UNHELD,
    Sample,
)

ANSWER_S = 1.0
"""Time the bridge may take to answer"""
AGAIN_S = 0.02
"""Time after which an order is sent again, if it was not answered"""


class RobotBridge:
    """The robot during one trial, through its bridge."""

    def __init__(self, settings: BridgeSettings, joints: int) -> None:
        """Attach to the robot, which goes on being held. Raises HilrigError if that is not possible."""
        self._settings, self._joints = settings, joints
        self._session, self._sent = secrets.randbits(63) + 1, 0
        self._process = BridgeProcess(settings)
        self._own = not settings.at
        self._at = settings.at or self._process.at
        self._socket: socket.socket | None = None
        self.sample = Sample(0, 0, 0, HELD, 0, 0, joints, np.nan, (), (), (), "")
        self._attach()
        self._process.open_log(os.SEEK_END)

    @property
    def position(self) -> Array:
        """Joint positions of the newest sample, (n,) rad"""
        return np.array(self.sample.position)

    @property
    def wrench(self) -> Array:
        """Its wrench, (6,) N, N m"""
        return np.array(self.sample.wrench)

    @property
    def torque(self) -> Array:
        """Its joint torques, (n,) N m"""
        return np.array(self.sample.torque)

    def wait(self, timeout_s: float) -> bool:
        """Wait for a new sample; return whether one came. Raises Tripped if the bridge has taken the robot away."""
        new = self._receive(timeout_s)
        if self.sample.state not in (HELD, FOLLOWING):
            what = "cannot hold" if self.sample.state == UNHELD else "holds"
            raise Tripped(f"the bridge {what} the robot: {self.sample.text}")
        if self.sample.state != FOLLOWING:
            self._send(ALIVE)
        return new

    def move(self, position: Array) -> None:
        """Send a joint reference, (n,) rad; do not wait."""
        self._send(MOVE, tuple(position))

    def hold(self) -> None:
        """Let the bridge hold the robot, and wait until it does. Raises HilrigError if it does not answer."""
        self._ask(HOLD, ANSWER_S)

    def close(self) -> None:
        """Let go of the robot, which the bridge holds. Raises HilrigError if it does not answer."""
        try:
            self._ask(DETACH, ANSWER_S)
        finally:
            self._disconnect()
            self._process.show_log()
            if self._own and not self._connect():  # it was killed
                self._process.remove()
            self._disconnect()
            if self.sample.refused:
                print(f"the bridge has refused {self.sample.refused} datagrams so far", flush=True)

    def _attach(self) -> None:
        deadline = time.monotonic() + self._settings.start_time
        if self._own and not self._connect():
            self._process.start()
        while True:
            if self._connect():
                with suppress(TimeoutError):
                    self._try(ATTACH, 10 * AGAIN_S)
                    if not self._own or self.sample.setup == self._process.setup:
                        break
                    self._replace()
            if why := self._process.why_ended():
                self._disconnect()
                raise HilrigError(why)
            if time.monotonic() > deadline:
                self._disconnect()
                raise HilrigError(self._why_silent(self._settings.start_time))
            time.sleep(AGAIN_S)
        before = self.sample.number
        while self.sample.number <= before:
            if self.sample.state == TRIPPED or time.monotonic() > deadline:
                words = self.sample.text or "the robot gives no sample"
                self._disconnect()
                raise HilrigError(f"the bridge at {self._at} cannot use the robot: {words}")
            self._receive(AGAIN_S)
            self._send(ALIVE)

    def _ask(self, what: int, limit_s: float) -> None:
        """Have an order carried out. Raises HilrigError if the bridge does not answer."""
        try:
            self._try(what, limit_s)
        except TimeoutError:
            raise HilrigError(self._why_silent(limit_s)) from None

    def _try(self, what: int, limit_s: float) -> None:
        """Send an order until the bridge says that it is done, and that the robot is held. Raises TimeoutError."""
        first, deadline = self._sent + 1, time.monotonic() + limit_s
        while time.monotonic() < deadline:
            self._send(what)
            self._receive(AGAIN_S, first)
            if self.sample.state == REFUSED:
                self._refused(deadline)
            elif self.sample.done >= first and self.sample.state in (HELD, TRIPPED):
                return
        if self.sample.state == UNHELD:
            raise HilrigError(f"the bridge cannot hold the robot: {self.sample.text}")
        raise TimeoutError

    def _refused(self, deadline: float) -> None:
        """The robot was not given to us: the last driver may have died a moment ago, so ask for a while."""
        joints = self.sample.joints != self._joints
        if joints or time.monotonic() + AGAIN_S > deadline:
            self._disconnect()
            raise HilrigError(f"the bridge at {self._at} refuses: {self.sample.text}")
        time.sleep(AGAIN_S)

    def _receive(self, timeout_s: float, done: int = 0) -> bool:
        """Take in what has come, until a sample is new or an order with number `done` has been answered."""
        if self._socket is None:
            return False
        new, deadline = False, time.monotonic() + timeout_s
        while True:
            ended = new or (done and self.sample.done >= done)
            self._socket.settimeout(0.0 if ended else max(deadline - time.monotonic(), 0.0))
            try:
                found = bridge.unpack_sample(self._socket.recv(4096))
            except (TimeoutError, BlockingIOError):
                return new
            except OSError:  # nobody listens there, for now
                time.sleep(min(AGAIN_S, max(deadline - time.monotonic(), 0.0)))
                if time.monotonic() >= deadline:
                    return new
                continue
            if found is None or found.session != self._session:
                continue
            if found.state == REFUSED:
                self.sample = found
                return new
            if found.number >= self.sample.number and found.done >= self.sample.done:
                new = new or found.number > self.sample.number
                self.sample = found

    def _send(self, what: int, position: tuple[float, ...] | None = None) -> None:
        self._sent += 1
        values = (0.0,) * self._joints if position is None else position
        order = bridge.Order(self._session, self._sent, self.sample.number, what, self._joints, values)
        if self._socket is not None:
            with suppress(OSError):  # a bridge that is gone is noticed by its samples, which stay away
                self._socket.send(bridge.pack_order(order))

    def _connect(self) -> bool:
        """Return whether there is a bridge to talk to."""
        if self._socket is not None:
            return True
        if not self._own:
            host, _, port = self._at.rpartition(":")
            self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
            self._socket.connect((host, int(port)))
            return True
        with suppress(OSError):
            if os.stat(self._process.folder).st_uid != os.getuid():
                raise HilrigError(f"{self._process.folder} belongs to another user, so nothing in it is trusted")
        link = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        try:
            link.connect(self._at)
            link.bind(self._mine)
        except (FileNotFoundError, ConnectionRefusedError):
            link.close()
            return False
        except OSError as error:  # a bridge may be there: another one would be a second owner of the robot
            link.close()
            raise HilrigError(f"the bridge at {self._at} cannot be reached: {error}") from None
        self._socket = link
        return True

    def _disconnect(self) -> None:
        if self._socket is not None:
            self._socket.close()
            self._socket = None
        with suppress(OSError):
            os.unlink(self._mine)

    @property
    def _mine(self) -> str:
        return str(self._process.folder / f"{self._session:x}")

    def _replace(self) -> None:
        """End a bridge with other settings, and start another one. Raises HilrigError if it does not end."""
        self._ask(END, ANSWER_S)
        self._disconnect()
        limit_s = self._settings.start_time
        deadline = time.monotonic() + limit_s
        while os.path.exists(self._at):
            if time.monotonic() > deadline:  # two may not have one robot
                raise HilrigError(f"the bridge at {self._at} has other settings and does not end within {limit_s:g} s")
            time.sleep(AGAIN_S)
        self._session, self._sent, self.sample = secrets.randbits(63) + 1, 0, self.sample._replace(number=0, done=0)
        self._process.start()

    def _why_silent(self, limit_s: float) -> str:
        return f"the bridge at {self._at} does not answer within {limit_s:g} s"
