"""Which measurements reach the controller: in lockstep each, in real time the newest that can have come by now."""

from __future__ import annotations

from collections import deque
from typing import Any

import pytest

from hilrig.recording.messages.codec import CDR_HEADER
from hilrig.rig import state_receiver
from hilrig.rig.frames import FUTURE, LEAD_BYTES, OLD, TickScreen, tick_of
from hilrig.rig.state_receiver import END, StateReceiver

LEAD = bytes(range(LEAD_BYTES))
PERIOD = 1e-3


class Box:
    """An inbox with messages in it."""

    def __init__(self, *messages: bytes) -> None:
        self.messages = deque(messages)

    def take(self) -> bytes:
        return self.messages.popleft()

    def poll(self) -> bytes | None:
        return self.messages.popleft() if self.messages else None


def state(tick: int) -> bytes:
    return LEAD + CDR_HEADER + tick.to_bytes(8, "little")


class Clock:
    """A clock that others set, s."""

    now = 100.0

    def monotonic_ns(self) -> int:
        return round(self.now * 1e9)


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    made = Clock()
    monkeypatch.setattr(state_receiver, "time", made)
    return made


def receiver(box: Any, realtime: bool, ticks: int = 1000) -> tuple[StateReceiver, TickScreen]:
    screen = TickScreen(LEAD, 12)
    return StateReceiver(box, screen, ticks, PERIOD, realtime), screen


def test_in_lockstep_each_one_in_turn_and_no_other(clock: Clock) -> None:
    messages = [state(0), state(2), state(0), b"", state(1), LEAD]
    made, screen = receiver(Box(*messages), realtime=False)
    assert [made.take() for _ in range(4)] == [state(0), state(1), END, END]
    assert (screen.refused[FUTURE], screen.refused[OLD]) == (1, 1)


def test_in_real_time_the_newest(clock: Clock) -> None:
    made, _ = receiver(Box(state(0), state(1), state(1), state(2)), realtime=True)
    assert made.take() == state(2)


def test_the_last_measurement_comes_before_the_end(clock: Clock) -> None:
    made, _ = receiver(Box(state(0), LEAD), realtime=True)
    assert [made.take(), made.take()] == [state(0), END]


def test_a_tick_ahead_of_its_time_is_refused_and_the_loop_goes_on(clock: Clock) -> None:
    box = Box(state(0))
    made, screen = receiver(box, realtime=True)
    made.take()
    for tick in range(1, 50):
        clock.now += PERIOD
        box.messages += [state(500), state(tick), state(1000)]
        assert tick_of(made.take()) == tick
    assert screen.refused == {FUTURE: 98}


def test_after_a_standstill_of_the_controller_the_newest_tick_is_taken(clock: Clock) -> None:
    """It may have been stopped for as long as it likes, also before the first measurement."""
    box = Box(*(state(tick) for tick in range(300)))
    made, _ = receiver(box, realtime=True)
    clock.now += 0.3
    assert tick_of(made.take()) == 299
    clock.now += 0.5
    box.messages += [state(tick) for tick in range(300, 800)]
    assert tick_of(made.take()) == 799


def test_no_tick_beyond_the_end_reaches_the_kernels(clock: Clock) -> None:
    box = Box(state(0))
    made, screen = receiver(box, realtime=True, ticks=10)
    made.take()
    clock.now += 100.0
    box.messages += [state(10), state(2**64 - 1), state(9)]
    assert tick_of(made.take()) == 9
    assert screen.refused == {FUTURE: 2}
