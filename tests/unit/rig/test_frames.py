"""What a receiver lets through, and what it refuses and counts."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from hilrig.recording.messages.layouts import layouts
from hilrig.recording.messages.record_batch import RecordBatch
from hilrig.rig.frames import (
    FOREIGN,
    FUTURE,
    LEAD_BYTES,
    MALFORMED,
    OLD,
    NumberScreen,
    TickScreen,
    lead,
    new_epoch,
    numbered,
    tick_of,
)

EPOCH = b"\x01epoch!\xff"
LEAD = lead(EPOCH, "command", "controller")
COMMAND = layouts(2, 2, {})["command"]


def command(tick: int, lead: bytes = LEAD) -> bytes:
    """Return a framed command as the controller's process sends it."""
    batch = RecordBatch(COMMAND, 2, lead)
    batch.fields[0][1] = tick
    return batch.framed(1)


def screen(newest: int = 10) -> TickScreen:
    made = TickScreen(LEAD, COMMAND.size)
    made.newest = newest
    return made


def test_a_command_of_the_trial_passes_once() -> None:
    judge = screen()
    assert [judge.passes(command(tick)) for tick in (0, 1, 5, 5, 3, 10, 11)] == [
        True, True, True, False, False, True, False,
    ]  # fmt: skip
    assert judge.refused == {OLD: 2, FUTURE: 1}
    assert tick_of(command(5)) == 5


def test_every_other_trial_channel_and_sender_is_foreign() -> None:
    judge = screen()
    others = [
        lead(new_epoch(), "command", "controller"),
        lead(EPOCH, "state", "controller"),
        lead(EPOCH, "command", "driver"),
    ]
    assert not any(judge.passes(command(0, other)) for other in others)
    assert judge.refused == {FOREIGN: 3}
    assert not judge.passes(LEAD)
    assert judge.refused.total() == 3, "the end of the channel is no refused message"


@given(st.binary(max_size=100), st.booleans())
def test_garbage_never_passes_and_is_always_counted(garbage: bytes, framed: bool) -> None:
    judge = screen()
    message = LEAD + garbage if framed else garbage
    if message != LEAD:
        assert not judge.passes(message)
        assert judge.refused == {MALFORMED if framed else FOREIGN: 1}


@given(st.integers(0, 2**64 - 1), st.integers(-1, 2**62), st.integers(0, 2**62))
def test_a_tick_passes_if_it_can_come_now(tick: int, last: int, more: int) -> None:
    judge = screen(last + more)
    judge.last = last
    assert judge.passes(command(tick)) == (last < tick <= last + more)


@given(st.lists(st.tuples(st.integers(0, 1), st.integers(0, 9)), max_size=30))
def test_of_each_sender_the_next_number_passes(sent: list[tuple[int, int]]) -> None:
    leads = [lead(EPOCH, "status", sender) for sender in ("driver", "logger")]
    judge, last, refused = NumberScreen(leads, complete=True), [0, 0], 0
    for sender, number in sent:
        body = judge.body(numbered(leads[sender], number, b"words"))
        if number == last[sender] + 1:
            last[sender] = number
            assert body == b"words"
        else:
            refused += 1
            assert body is None
    assert judge.refused.total() == refused


def test_numbers_that_only_grow_may_leave_gaps() -> None:
    head = lead(EPOCH, "view", "logger")
    judge = NumberScreen([head], complete=False)
    bodies = [judge.body(numbered(head, number, b"view")) for number in (7, 9, 9, 8)]
    assert bodies == [b"view", b"view", None, None]
    assert judge.refused == {OLD: 2}


@given(st.binary(max_size=LEAD_BYTES + 20))
def test_garbage_has_no_body(garbage: bytes) -> None:
    judge = NumberScreen([lead(EPOCH, "order", "supervisor")], complete=True)
    assert judge.body(garbage) is None
    assert judge.refused.total() == 1
