"""The threads beside the loop: commands are stamped as they arrive, sending never blocks, and a stop is noticed."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from queue import SimpleQueue
from threading import Event
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hilrig.core.errors import Stopped
from hilrig.recording.messages.codec import CDR_HEADER
from hilrig.rig import background_sender
from hilrig.rig.background_sender import BackgroundSender
from hilrig.rig.child import Signals
from hilrig.rig.command_receiver import BlockingCommandReceiver, CommandReceiver
from hilrig.rig.frames import LEAD_BYTES, TickScreen

LEAD = bytes(range(LEAD_BYTES))
STOPPED = """
import sys, time
from hilrig.rig.resume_monitor import ResumeMonitor

noted = ResumeMonitor()
noted.listen()
print(noted.last, flush=True)
for line in sys.stdin:
    deadline, before = time.monotonic() + 20.0, int(line)
    while noted.last <= before and time.monotonic() < deadline:
        time.sleep(0.001)
    print(noted.last, time.monotonic_ns(), flush=True)
"""


class Box:
    """An inbox that others fill."""

    def __init__(self) -> None:
        self.messages: SimpleQueue[bytes] = SimpleQueue()

    def take(self) -> bytes:
        return self.messages.get()


def within(seconds: float, wanted: Any) -> bool:
    """Wait until `wanted()` holds, `seconds` at most; return whether it does."""
    deadline = time.monotonic() + seconds
    while not wanted() and time.monotonic() < deadline:
        time.sleep(0.001)
    return wanted()


def screen() -> TickScreen:
    """Return a screen that lets the commands of all ticks through, in order."""
    made = TickScreen(LEAD, 12)
    made.newest = 1000
    return made


def command(tick: int) -> bytes:
    return LEAD + CDR_HEADER + tick.to_bytes(8, "little")


def test_in_lockstep_commands_are_taken_in_order() -> None:
    """What is none is passed over."""
    box: Any = Box()
    for message in (command(0), b"", command(0), command(1), LEAD):
        box.messages.put(message)
    waiting, before = BlockingCommandReceiver(box, screen(), Signals()), time.monotonic_ns()
    taken = [waiting.take() for _ in range(3)]
    assert [(tick, message) for tick, _, message in taken] == [(0, command(0)), (1, command(1)), (1, b"")]
    stamps = [before, *(moment for _, moment, _ in taken), time.monotonic_ns()]
    assert stamps == sorted(stamps)


def test_a_signal_that_came_before_the_wait_ends_it() -> None:
    signals: Any = Signals()
    signals.raising, signals.told = False, "terminated"
    box: Any = Box()
    with pytest.raises(Stopped, match="terminated"):
        BlockingCommandReceiver(box, screen(), signals).take()
    assert not signals.raising, "nothing else may be interrupted"


def test_commands_are_stamped_when_they_arrive_not_when_they_are_taken() -> None:
    box: Any = Box()
    receiver, taken, spans = CommandReceiver(box, screen()), [], []
    assert receiver.take() is None, "nothing has arrived, and the call does not wait"
    for message in (command(0), command(1), LEAD):
        before = time.monotonic_ns()
        box.messages.put(b"no command")
        box.messages.put(message)
        assert within(20.0, lambda: len(receiver._arrived) > len(spans))  # pyright: ignore[reportPrivateUsage]
        spans.append((before, time.monotonic_ns()))
    while (arrival := receiver.take()) is not None:
        taken.append(arrival)
    assert [(tick, message) for tick, _, message in taken] == [(0, command(0)), (1, command(1)), (1, b"")]
    for (_, moment, _), (before, after) in zip(taken, spans, strict=True):
        assert before <= moment <= after


def test_a_closed_bus_ends_the_commands() -> None:
    """The thread that listens ends, and prints nothing into the trial's log."""

    class Closed:
        def take(self) -> bytes:
            raise RuntimeError("channel is empty and closed")

    box: Any = Closed()
    receiver = CommandReceiver(box, screen())
    assert within(20.0, lambda: bool(receiver._arrived))  # pyright: ignore[reportPrivateUsage]
    arrival = receiver.take()
    assert arrival is not None
    assert arrival[2] == b""
    assert receiver.take() is None


@given(st.lists(st.binary(max_size=20), max_size=50))
def test_a_background_sender_sends_everything_in_order(messages: list[bytes]) -> None:
    sent: list[bytes] = []
    sender = BackgroundSender(sent.append)
    for message in messages:
        sender.send(message)
    sender.finish()
    assert sent == messages


def test_a_background_sender_that_is_blocked_blocks_nobody(monkeypatch: pytest.MonkeyPatch) -> None:
    """It keeps the newest packets, because the logger waits for the last one."""
    monkeypatch.setattr(background_sender, "MOST_WAITING", 5)
    sent: list[bytes] = []
    blocked, go = Event(), Event()

    def put(message: bytes) -> None:
        blocked.set()
        go.wait(20.0)
        sent.append(message)

    sender = BackgroundSender(put)
    sender.send(b"0")
    assert blocked.wait(20.0)
    for k in range(1, 100):
        sender.send(b"%d" % k)
    assert sent == [], "nothing went out while the first packet was blocked"
    go.set()
    sender.finish()
    assert sent == [b"0", *(b"%d" % k for k in range(95, 100))]


def test_each_resumption_of_a_stopped_process_is_noted() -> None:
    """In a process of its own; CLOCK_MONOTONIC is the same in all processes."""
    child = subprocess.Popen([sys.executable, "-c", STOPPED], stdin=-1, stdout=-1, text=True)
    assert child.stdin is not None
    assert child.stdout is not None
    with child:
        last = int(child.stdout.readline())
        assert last == 0, "never"
        for _ in range(5):
            child.send_signal(signal.SIGSTOP)
            assert within(20.0, lambda: state_of(child.pid) == "T")
            before = time.monotonic_ns()
            child.send_signal(signal.SIGCONT)
            child.stdin.write(f"{last}\n")
            child.stdin.flush()
            last, after = map(int, child.stdout.readline().split())
            assert before <= last <= after
        child.stdin.close()
    assert child.returncode == 0


def state_of(pid: int) -> str:
    """Return the state of a process as /proc has it."""
    with open(f"/proc/{pid}/stat", encoding="ascii") as file:
        return file.read().rsplit(")", 1)[1].split()[0]


def test_after_a_flush_everything_has_been_sent() -> None:
    sent: list[bytes] = []

    def put(message: bytes) -> None:
        time.sleep(0.002)
        sent.append(message)

    sender = BackgroundSender(put)
    for number in range(5):
        sender.send(bytes([number]))
    sender.flush()
    assert sent[:5] == [bytes([number]) for number in range(5)]
    sender.finish()
