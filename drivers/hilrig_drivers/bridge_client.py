"""A driver's end of a bridge: finds or starts the process that owns the robot (`bridge.py`), and talks to it."""

from __future__ import annotations

import os
import secrets
import shutil
import socket
import subprocess
import sys
import tempfile
import time
import zlib
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import BinaryIO

import numpy as np

from hilrig import Array, HilrigError, Tripped
from hilrig_drivers import bridge
from hilrig_drivers.bridge import ALIVE, ATTACH, DETACH, END, FOLLOWING, HELD, HOLD, MOVE, REFUSED, TRIPPED, Sample

ANSWER_S = 1.0
"""Time the bridge may take to answer"""
AGAIN_S = 0.02
"""Time after which an order is sent again, if it was not answered"""
SOCKET, LOG = "bridge.sock", "bridge.log"


@dataclass(frozen=True)
class BridgeSettings:
    """What a bridge is started with. One that has other settings is ended, and another one started."""

    robot_file: str
    """The file with the class `Robot`"""
    python: str = sys.executable
    """The interpreter that has the robot's software"""
    settings: Mapping[str, str] = field(default_factory=dict)
    """Arguments of `Robot`"""
    order_age: float = 0.1
    """s; without an order for so long the bridge holds the robot"""
    sample_age: float = 0.1
    """s; the same without a sample"""
    at: str = ""
    """HOST:PORT of a bridge that somebody has started; empty: the run's own, which is started when there is none"""
    start_time: float = 15.0
    """Longest time until a bridge that is started answers with a sample, s"""


class RobotBridge:
    """The robot during one trial, through its bridge."""

    def __init__(self, settings: BridgeSettings, joints: int) -> None:
        """Attach to the robot, which goes on being held. Raises HilrigError if that is not possible."""
        self._settings, self._joints = settings, joints
        self._session, self._sent = secrets.randbits(63) + 1, 0
        self._process: subprocess.Popen[bytes] | None = None
        self._own = not settings.at
        self._folder = _folder()
        self._at = settings.at or str(self._folder / SOCKET)
        self._socket: socket.socket | None = None
        self.sample = Sample(0, 0, 0, HELD, 0, 0, joints, np.nan, (), (), (), "")
        self._log: BinaryIO | None = None
        self._attach()
        self._open_log(os.SEEK_END)

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
        if self.sample.state in (TRIPPED, REFUSED):
            raise Tripped(f"the bridge holds the robot: {self.sample.text}")
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
            self._show_log()
            if self._own and not self._connect():  # it was killed
                shutil.rmtree(self._folder, ignore_errors=True)
            if self.sample.refused:
                print(f"the bridge has refused {self.sample.refused} datagrams so far", flush=True)

    def _attach(self) -> None:
        deadline = time.monotonic() + self._settings.start_time
        if self._own and not self._connect():
            self._start()
        while True:
            if self._connect():
                with suppress(TimeoutError):
                    self._try(ATTACH, 10 * AGAIN_S)
                    if not self._own or self.sample.setup == self._setup():
                        break
                    self._replace()
            self._require_process()
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
        link = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        try:
            link.connect(self._at)
            link.bind(self._mine)
        except OSError:
            link.close()
            return False
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
        return str(self._folder / f"{self._session:x}")

    def _words(self) -> list[str]:
        """Return the command line of the bridge, after its own file."""
        given = self._settings
        sets = [word for name, value in given.settings.items() for word in ("--set", f"{name}={value}")]
        ages = ["--order-age", str(given.order_age), "--sample-age", str(given.sample_age)]
        return [given.robot_file, "--at", self._at, "--owner", str(_program()), *ages, *sets]

    def _setup(self) -> int:
        return zlib.crc32("\0".join(self._words()).encode())

    def _start(self) -> None:
        """Start the bridge in a session of its own: it outlives this process."""
        self._folder.mkdir(mode=0o700, exist_ok=True)
        with suppress(FileNotFoundError):
            os.unlink(self._at)  # of one that was killed
        try:
            with (self._folder / LOG).open("wb") as log:
                self._open_log()
                self._process = subprocess.Popen(
                    [self._settings.python, bridge.__file__, *self._words()],
                    stdin=subprocess.DEVNULL, stdout=log, stderr=log, start_new_session=True,
                )  # fmt: skip
        except OSError as error:
            shutil.rmtree(self._folder, ignore_errors=True)
            raise HilrigError(f"the bridge cannot be started with {self._settings.python}: {error.strerror}") from None

    def _replace(self) -> None:
        """End a bridge with other settings, and start another one."""
        self._try(END, ANSWER_S)
        self._disconnect()
        deadline = time.monotonic() + ANSWER_S
        while os.path.exists(self._at) and time.monotonic() < deadline:
            time.sleep(AGAIN_S)
        self._session, self._sent, self.sample = secrets.randbits(63) + 1, 0, self.sample._replace(number=0, done=0)
        self._start()

    def _require_process(self) -> None:
        """Raise HilrigError if the bridge that was started has ended."""
        if self._process is None or self._process.poll() is None:
            return
        lines = [line for line in self._show_log().splitlines() if line.strip()]
        self._disconnect()
        raise HilrigError(
            f"the bridge ended with exit code {self._process.returncode}: {lines[-1] if lines else 'it said nothing'} "
            f"(started with {self._settings.python} for {self._settings.robot_file})"
        )

    def _open_log(self, whence: int = os.SEEK_SET) -> None:
        """Open what the bridge prints, which it removes when it ends."""
        with suppress(OSError):
            self._log = self._log or (self._folder / LOG).open("rb")
            self._log.seek(0, whence)

    def _show_log(self) -> str:
        """Print what the bridge has printed in this trial, which makes it a part of the trial's log; return it."""
        text = self._log.read().decode(errors="replace") if self._log else ""
        print(text, end="", flush=True)
        return text

    def _why_silent(self, limit_s: float) -> str:
        return f"the bridge at {self._at} does not answer within {limit_s:g} s"


def _program() -> int:
    """Return the process id of the program that runs the trials; this one, where there is no other."""
    return int(os.environ.get("HILRIG_PROGRAM", os.getpid()))


def _folder() -> Path:
    """Return the folder of a program's bridge, which only the user may enter. Names are short: it holds sockets."""
    program = _program()
    return Path(tempfile.gettempdir()) / f"hilrig-bridge-{program}-{bridge.birth(program)}"
