"""A process that owns a robot whose software lives in another interpreter than hilrig's, or on another host.

    python3 bridge.py ROBOT.py --at SOCKET [--owner PID] [--order-age 0.1] [--sample-age 0.1] [--set NAME=VALUE ...]

One file, Python 3.8 or newer, the standard library and whatever ROBOT.py imports. It owns the robot for a whole run,
and holds it when orders or samples stay away, between trials, and when everything else has died. A driver of hilrig
attaches to it by datagrams (`bridge_client.py`); docs/drivers.md has the table of their bytes and what ROBOT.py offers.
"""

from __future__ import annotations

import argparse
import importlib.util
import math
import os
import select
import signal
import socket
import stat
import struct
import sys
import threading
import time
import zlib
from collections import deque
from collections.abc import Sequence
from contextlib import suppress
from typing import Any, NamedTuple

MAGIC = b"HRB1"
ATTACH, MOVE, HOLD, DETACH, END, ALIVE = range(1, 7)
HELD, FOLLOWING, TRIPPED, REFUSED, UNHELD = range(5)
"""TRIPPED: held by the bridge itself, until a new session attaches; REFUSED: not attached; UNHELD: `hold` raised"""
WRENCH, TEXT = 6, 160
LOOK = 0.05  # s between two looks at the owner
REMEMBERED = 1024  # samples whose time is kept until an order answers them
ROUNDING = 1e-9  # rad

_ORDER, _SAMPLE = "<4sQIIII", "<4sQIIIIIId"


class Order(NamedTuple):
    """What a driver sends."""

    session: int
    number: int
    """Higher than that of the last order of the session"""
    answers: int
    """Number of the newest sample that the driver had"""
    what: int
    joints: int
    position: tuple[float, ...]


class Sample(NamedTuple):
    """What the bridge sends: with each sample of the robot, and at once in answer to all orders but a move."""

    session: int
    number: int
    """0: the robot has given none yet"""
    done: int
    """Number of the last order of the session that was carried out"""
    state: int
    refused: int
    """Datagrams so far that were of nobody, old, or damaged"""
    setup: int
    """Checksum of the bridge's command line"""
    joints: int
    stamp: float
    position: tuple[float, ...]
    wrench: tuple[float, ...]
    torque: tuple[float, ...]
    text: str
    """Why the bridge holds the robot"""


def pack_order(order: Order) -> bytes:
    """Return an order as a datagram."""
    head = struct.pack(_ORDER, MAGIC, order.session, order.number, order.answers, order.what, order.joints)
    return head + struct.pack(f"<{order.joints}d", *order.position)


def unpack_order(data: bytes) -> Order | None:
    """Return a datagram as an order; None if it is none."""
    if len(data) < struct.calcsize(_ORDER):
        return None
    magic, session, number, answers, what, joints = struct.unpack_from(_ORDER, data)
    if magic != MAGIC or len(data) != struct.calcsize(_ORDER) + 8 * joints:
        return None
    position = struct.unpack_from(f"<{joints}d", data, struct.calcsize(_ORDER))
    return Order(session, number, answers, what, joints, position)


def pack_sample(sample: Sample) -> bytes:
    """Return a sample as a datagram."""
    values = (*sample.position, *sample.wrench, *sample.torque)
    text = sample.text.encode("ascii", "replace")[:TEXT]
    return struct.pack(_SAMPLE, MAGIC, *sample[:8]) + struct.pack(f"<{len(values)}d{TEXT}s", *values, text)


def unpack_sample(data: bytes) -> Sample | None:
    """Return a datagram as a sample; None if it is none."""
    start = struct.calcsize(_SAMPLE)
    if len(data) < start:
        return None
    magic, session, number, done, state, refused, setup, n, stamp = struct.unpack_from(_SAMPLE, data)
    if magic != MAGIC or len(data) != start + 8 * (2 * n + WRENCH) + TEXT:
        return None
    position, wrench, torque = (
        struct.unpack_from(f"<{length}d", data, start + 8 * first)
        for length, first in ((n, 0), (WRENCH, n), (n, n + WRENCH))
    )
    text = data[-TEXT:].rstrip(b"\0").decode("ascii", "replace")
    return Sample(session, number, done, state, refused, setup, n, stamp, position, wrench, torque, text)


def why_beyond(
    asked: Sequence[float], last: Sequence[float], elapsed: float,
    lowest: Sequence[float], highest: Sequence[float], fastest: Sequence[float],
) -> str:  # fmt: skip
    """Return why a joint reference, `elapsed` s after the last one, is beyond the robot's limits; empty if it is not.

    All are of length n, in rad and rad/s: lowest <= q <= highest and |q - last| <= fastest elapsed.
    """
    for j, (q, before, low, high, rate) in enumerate(zip(asked, last, lowest, highest, fastest), 1):  # noqa: B905
        if not math.isfinite(q):
            return f"joint {j} was asked for {q}"
        if not low - ROUNDING <= q <= high + ROUNDING:
            return f"joint {j} was asked for {q:.4g} rad, beyond {low:.4g} to {high:.4g} rad"
        if abs(q - before) > rate * elapsed + ROUNDING:
            return f"joint {j} was asked for a step of {q - before:.4g} rad in {elapsed:.3g} s, over {rate:.4g} rad/s"
    return ""


class Bridge:
    """Who has the robot, and whether it follows or is held. Times are in s, on any one clock."""

    def __init__(self, robot: Any, order_age: float, sample_age: float, setup: int = 0) -> None:
        self.robot, self.order_age, self.sample_age = robot, order_age, sample_age
        self.state, self.text = HELD, ""
        self.session = self.done = self.refused = self.number = 0
        self.setup = setup
        self.ending = False
        """Whether the bridge is to end as soon as nobody is attached"""
        unknown = (math.nan,)
        self._newest = math.nan, unknown * robot.joints, unknown * WRENCH, unknown * robot.joints
        self._sampled = self._heard = self._moved = -math.inf
        self._reference: list[float] = []
        self._sent: deque[tuple[int, float]] = deque(maxlen=REMEMBERED)
        self._unheld = False

    def attached(self, now: float) -> bool:
        """Return whether a driver has the robot and is still there."""
        return bool(self.session) and now - self._heard <= self.order_age

    def sample(self, newest: tuple[float, Sequence[float], Sequence[float], Sequence[float]], now: float) -> None:
        """Take a sample of the robot: stamp, joint positions (n,), wrench (6,), joint torques (n,)."""
        try:
            stamp, *parts = newest
            position, wrench, torque = (tuple(map(float, part)) for part in parts)
            newest = float(stamp), position, wrench, torque
        except (TypeError, ValueError) as error:
            self.trip(f"read returned no sample: {in_words(error)}")
            return
        n = self.robot.joints
        if (len(position), len(wrench), len(torque)) != (n, WRENCH, n):
            sizes = f"{len(position)}, {len(wrench)} and {len(torque)} values"
            self.trip(f"read returned {sizes} for joints, wrench and torques, not {n}, {WRENCH} and {n}")
        elif not all(map(math.isfinite, (*position, *wrench, *torque))):
            self.trip("the robot gave a sample that is not finite")
        else:
            self._newest, self._sampled = newest, now
            self.number += 1
            self._sent.append((self.number, now))

    def take(self, order: Order | None, now: float) -> bytes:
        """Carry out an order; return the answer, empty if there is none."""
        if order is None or order.session == 0 or not ATTACH <= order.what <= ALIVE:
            self.refused += 1
            return b""
        if order.what == ATTACH and order.session != self.session:
            why = self._attach(order, now)
            return self._pack(order.session, REFUSED, why) if why else self.answer()
        if order.session != self.session or order.number <= self.done or order.joints != self.robot.joints:
            self.refused += 1
            return b""
        if order.what == MOVE:
            self._move(order, now)
            return b""
        self.done = order.number
        if order.what == ALIVE:
            if self.state != FOLLOWING:
                self._heard = now
            return b""
        self._heard = now
        self._stand(TRIPPED if self.state == TRIPPED else HELD)
        answer = self.answer()
        if order.what in (DETACH, END):
            self.session = 0
            self.ending = self.ending or order.what == END
        return answer

    def _attach(self, order: Order, now: float) -> str:
        """Give the robot to a new session; return why not, empty if it has it."""
        if self.attached(now):
            return "another program has the robot"
        if self.ending:
            return "the bridge is about to end"
        if order.joints != self.robot.joints:
            return f"the robot has {self.robot.joints} joints, not {order.joints}"
        trouble = self.trouble()
        if trouble:
            return trouble
        self._stand(HELD)
        if self.state != HELD:
            return self.text
        self.session, self.done, self._heard, self.text = order.session, order.number, now, ""
        self._reference = []
        return ""

    def _move(self, order: Order, now: float) -> None:
        answered = self._time_of(order.answers)
        if now - answered > self.order_age:  # it was on its way for long, or answers nothing
            self.refused += 1
            return
        self.done, self._heard = order.number, max(self._heard, answered)
        if self.state == TRIPPED:
            return
        if not self._reference:
            self._reference, self._moved = list(self._newest[1]), now - self.robot.period
        elapsed = min(max(now - self._moved, self.robot.period), self.order_age)
        limits = self.robot.lowest, self.robot.highest, self.robot.fastest
        why = self.trouble() or why_beyond(order.position, self._reference, elapsed, *limits)
        if why:
            self.trip(why)
            return
        self.state, self._reference, self._moved = FOLLOWING, list(order.position), now
        try:
            self.robot.move(list(order.position))
        except Exception as error:  # it may have begun to move
            self.trip(f"move raised {in_words(error)}")

    def _time_of(self, number: int) -> float:
        """Return when a sample was sent; long ago if it is not known."""
        first = self._sent[0][0] if self._sent else 0
        known = self._sent and first <= number <= self._sent[-1][0]
        return self._sent[number - first][1] if known else -math.inf

    def look(self, now: float) -> None:
        """Hold the robot if the orders or the samples stay away, or if the robot itself is in trouble."""
        if self._unheld:
            self._stand(TRIPPED)
        if self.state != FOLLOWING:
            return
        trouble = self.trouble()
        if trouble:
            self.trip(trouble)
        elif now - self._sampled > self.sample_age:
            self.trip(f"no sample of the robot for {now - self._sampled:.3g} s, over {self.sample_age:g} s")
        elif now - self._heard > self.order_age:
            # An order's age counts from the sample that it answers; where all were answered, the samples are missing.
            what = "no sample of the robot" if self._heard >= self._sampled else "no order"
            self.trip(f"{what} for {now - self._heard:.3g} s, over {self.order_age:g} s")

    def due(self, now: float) -> float:
        """Return in how many seconds to look again."""
        if self.state != FOLLOWING:
            return LOOK
        left = min(self._heard + self.order_age, self._sampled + self.sample_age) - now
        return min(max(left, 0.0) + 1e-4, LOOK)

    def trouble(self) -> str:
        """Return why the robot may not be moved now, in its own words; empty if it may."""
        try:
            return str(self.robot.trouble()) if hasattr(self.robot, "trouble") else ""
        except Exception as error:
            return f"trouble raised {in_words(error)}"

    def trip(self, why: str) -> None:
        """Hold the robot until a new session attaches. The first reason stays."""
        if self.state != TRIPPED:
            self.text = why
            self._stand(TRIPPED)

    def rest(self) -> str:
        """Hold the robot, if it may still follow; return why that was not possible, empty if it was."""
        self._stand(HELD)
        return self.text if self._unheld else ""

    def _stand(self, state: int) -> None:
        """Pass into a state in which the robot is held."""
        if self.state == FOLLOWING or self._unheld:
            try:
                self.robot.hold()
                self._unheld = False
            except Exception as error:
                state, self._unheld = TRIPPED, True
                self.text = f"hold raised {in_words(error)}: look at the arm"
        self.state = state

    def answer(self) -> bytes:
        """Return the newest sample and the state, as a datagram for the session."""
        return self._pack(self.session, UNHELD if self._unheld else self.state, self.text)

    def _pack(self, session: int, state: int, text: str) -> bytes:
        head = session, self.number, self.done, state, self.refused, self.setup, self.robot.joints
        return pack_sample(Sample(*head, *self._newest, text))


def in_words(error: BaseException) -> str:
    """Return an exception in one line."""
    return " ".join(f"{type(error).__name__}: {error}".split())


class Sampler(threading.Thread):
    """Waits for the robot's samples, and keeps the newest."""

    def __init__(self, robot: Any, wake: int) -> None:
        super().__init__(daemon=True)
        self._robot, self._wake = robot, wake
        self._newest: deque[Any] = deque(maxlen=1)
        self.why = ""
        """What `read` raised"""
        self.enough = False

    def run(self) -> None:
        """Read until it is enough."""
        while not self.enough:
            try:
                sample = self._robot.read(LOOK)
            except Exception as error:
                self.why = f"read raised {in_words(error)}"
                time.sleep(LOOK)
                continue
            if sample is not None:
                self._newest.append(sample)
                with suppress(BlockingIOError):  # it has been woken often enough
                    os.write(self._wake, b"s")

    def take(self) -> Any:
        """Return the newest sample that was not taken yet, or None."""
        try:
            return self._newest.popleft()
        except IndexError:
            return None


def open_link(at: str) -> socket.socket:
    """Listen at a path, in a folder that only its user may enter, or at HOST:PORT."""
    if "/" not in at:
        host, _, port = at.rpartition(":")
        link = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        link.bind((host, int(port)))
    else:
        folder = os.stat(os.path.dirname(at))
        if folder.st_uid != os.getuid() or stat.S_IMODE(folder.st_mode) & 0o077:
            raise SystemExit(f"{os.path.dirname(at)}: only its user may enter the folder of a bridge's socket")
        link = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        link.bind(at)
    link.setblocking(False)
    return link


def birth(pid: int) -> str:
    """Return when a process was started, in clock ticks since boot; empty if there is no such process."""
    try:
        with open(f"/proc/{pid}/stat", "rb") as file:
            words = file.read().rsplit(b")", 1)[1].split()
    except OSError:
        return ""
    return "" if words[0] == b"Z" else words[19].decode()


def serve(bridge: Bridge, link: socket.socket, owner: int) -> None:
    """Live until the owner has gone, or until the bridge is told to end and nobody is attached."""
    ears, mouth = os.pipe()
    os.set_blocking(ears, False)
    os.set_blocking(mouth, False)
    told = _listen_to_signals(mouth)
    sampler = Sampler(bridge.robot, mouth)
    sampler.start()
    try:
        _attend(bridge, link, owner, sampler, ears, told)
    finally:
        stuck = bridge.rest()
        sampler.enough = True
        sampler.join(1.0)
    if stuck:
        raise SystemExit(stuck)


def _attend(bridge: Bridge, link: socket.socket, owner: int, sampler: Sampler, ears: int, told: Sequence[str]) -> None:
    born, driver = birth(owner) if owner else "", None
    while True:
        select.select([link, ears], [], [], bridge.due(time.monotonic()))
        before = bridge.state
        bridge.look(time.monotonic())  # first of all: it may have stood still
        _drain(ears)
        if sampler.why:
            bridge.trip(sampler.why)
            sampler.why = ""
        newest = sampler.take()
        if newest is not None:
            bridge.sample(newest, time.monotonic())
        if told and not bridge.ending:
            bridge.ending = True
            bridge.trip(told[0])
        if driver is not None and (newest is not None or bridge.state != before):
            _send(link, bridge.answer(), driver)
        driver = _take_orders(bridge, link, driver)
        gone = owner and (not born or birth(owner) != born)
        if gone or (bridge.ending and not bridge.attached(time.monotonic())):
            return


def _take_orders(bridge: Bridge, link: socket.socket, driver: Any) -> Any:
    """Carry out the orders that have come; return where the driver that has the robot can be reached."""
    while True:
        try:
            data, sender = link.recvfrom(4096)
        except BlockingIOError:
            return driver
        except OSError:  # a driver that has gone
            continue
        before, answer = bridge.session, bridge.take(unpack_order(data), time.monotonic())
        if bridge.session != before:
            driver = sender if bridge.session else None
        if answer:
            _send(link, answer, sender)


def _send(link: socket.socket, data: bytes, to: Any) -> None:
    with suppress(OSError):  # it is gone, or does not read
        link.sendto(data, to)


def _drain(ears: int) -> None:
    with suppress(BlockingIOError):
        while os.read(ears, 4096):
            pass


def _listen_to_signals(mouth: int) -> list[str]:
    """Return a list that gets the reason to end, at the first signal."""
    told: list[str] = []

    def note(number: int, _frame: Any) -> None:
        name = signal.Signals(number).name
        told.append("halted by hilrig halt" if number == signal.SIGUSR1 else f"the bridge was told to end ({name})")

    for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP, signal.SIGUSR1):
        signal.signal(number, note)
    signal.set_wakeup_fd(mouth, warn_on_full_buffer=False)
    return told


def load_robot(path: str, settings: dict[str, str]) -> Any:
    """Return the `Robot` of a file, made with its settings."""
    sys.path.insert(0, os.path.dirname(os.path.abspath(path)))
    spec = importlib.util.spec_from_file_location("bridged_robot", path)
    if spec is None or spec.loader is None:
        raise SystemExit(f"{path} is no Python file")
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    robot = module.Robot(**settings)
    for name in ("joints", "period", "lowest", "highest", "fastest", "read", "move", "hold", "close"):
        if not hasattr(robot, name):
            raise SystemExit(f"{path}: Robot lacks {name}")
    for name in ("lowest", "highest", "fastest"):
        if len(getattr(robot, name)) != robot.joints:
            raise SystemExit(f"{path}: {name} has {len(getattr(robot, name))} values, for {robot.joints} joints")
    return robot


def main(words: Sequence[str]) -> int:
    """Run the bridge; return its exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("robot", help="the file with the class Robot")
    parser.add_argument("--at", required=True, help="where it listens: the path of a socket, or HOST:PORT")
    parser.add_argument("--owner", type=int, default=0, help="process id; the bridge ends when this one has gone")
    parser.add_argument("--order-age", type=float, default=0.1, help="hold after so many seconds without an order")
    parser.add_argument("--sample-age", type=float, default=0.1, help="hold after so many seconds without a sample")
    parser.add_argument("--set", action="append", default=[], metavar="NAME=VALUE", help="an argument of Robot")
    options = parser.parse_args(words)
    _leave_the_drivers_core()
    link = open_link(options.at)
    try:
        robot = load_robot(options.robot, dict(item.split("=", 1) for item in options.set))
        setup = zlib.crc32("\0".join(words).encode())
        if options.order_age < 2 * robot.period:
            parser.error(f"--order-age must be at least two periods of the robot, {2 * robot.period:g} s")
        try:
            serve(Bridge(robot, options.order_age, options.sample_age, setup), link, options.owner)
        finally:
            robot.close()
    finally:
        if "/" in options.at:
            _remove_folder(os.path.dirname(options.at), link)
    return 0


def _leave_the_drivers_core() -> None:
    """Undo what a real-time driver that starts the bridge passes on: its core, its priority."""
    try:
        os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
        os.sched_setaffinity(0, range(os.cpu_count() or 1))
    except OSError as error:
        print(f"the bridge keeps the driver's core or priority: {error}", flush=True)


def _remove_folder(folder: str, link: socket.socket) -> None:
    """Remove what lies beside the socket and is a socket or the log, and then the folder, if it is empty."""
    link.close()
    for name in os.listdir(folder):
        path = os.path.join(folder, name)
        if name == "bridge.log" or stat.S_ISSOCK(os.lstat(path).st_mode):
            os.unlink(path)
    with suppress(OSError):  # the user's own, with other files
        os.rmdir(folder)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
