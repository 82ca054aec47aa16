from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hilrig.core.signals import Array
from hilrig.recording.bag import read_bag
from hilrig.recording.messages.codec import Codec, definition
from hilrig.recording.messages.record_batch import RecordBatch
from hilrig.recording.recorder import MOST_GAPS, Account, Recorder

COMMAND = Codec(definition("Command"), {"torque": 1, "position": 1, "asked": 1})
TIMING = Codec(definition("ControllerTiming"), {})
DEFINITIONS = {
    "command": COMMAND.definition, "driver_timing": definition("DriverTiming"), "controller_timing": TIMING.definition,
}  # fmt: skip


def commands(*ticks: int) -> Array:
    """Return the messages of these ticks, (N, bytes), with the tick as torque."""
    batch = RecordBatch(COMMAND, max(len(ticks), 1))
    for row, tick in enumerate(ticks):
        for field, value in zip(batch.fields, (tick, tick * 1e-3, float(tick), 0.0, float(tick), 0), strict=True):
            field[row] = value
    return batch.payloads[: len(ticks)]


def test_all_that_was_sent_and_stored_is_accounted_for(tmp_path: Path) -> None:
    with Recorder(tmp_path, 1e-3, DEFINITIONS) as recorder:
        for tick in range(5):
            recorder.store("command", commands(tick))
        recorder.sent("command", 5)
        assert recorder.summary()["command"] == {"sent": 5, "stored": 5, "lost": 0, "gap_count": 0, "gaps": []}
    np.testing.assert_array_equal(read_bag(tmp_path / "bag.mcap")["command"]["torque"][:, 0], np.arange(5.0))


def test_gaps_are_named_and_losses_counted(tmp_path: Path) -> None:
    """Ticks 0, 3 and 4 to 5 are missing of 0 to 6; of 8 sent, one was lost behind the last that came."""
    with Recorder(tmp_path, 1e-3, DEFINITIONS) as recorder:
        for tick in (1, 2, 6):
            recorder.store("command", commands(tick))
        recorder.sent("command", 8)
        account = recorder.summary()["command"]
    assert account["gaps"] == [[0, 0], [3, 5]]
    assert (account["stored"], account["lost"], account["gap_count"]) == (3, 5, 2)


def test_gaps_within_an_array_are_named_too(tmp_path: Path) -> None:
    """Ticks 1 to 3, none, 6, 7 and 9, and 10: 0, 4 to 5 and 8 are missing."""
    with Recorder(tmp_path, 1e-3, DEFINITIONS) as recorder:
        for ticks in ((1, 2, 3), (), (6, 7, 9), (10,)):
            recorder.store("command", commands(*ticks))
        recorder.sent("command", 8)
        account = recorder.summary()["command"]
    assert account == {"sent": 8, "stored": 7, "lost": 1, "gap_count": 3, "gaps": [[0, 0], [4, 5], [8, 8]]}
    table = read_bag(tmp_path / "bag.mcap")["command"]
    assert table["tick"].tolist() == table["torque"][:, 0].tolist() == [1, 2, 3, 6, 7, 9, 10]


def gaps_of(ticks: list[int]) -> list[list[int]]:
    """Return [first, last] of every run of ticks that is missing before or between these, one by one."""
    gaps, missing = [], None
    for tick in range(ticks[-1] + 1):
        if tick in ticks:
            missing = None
        elif missing is None:
            missing = [tick, tick]
            gaps.append(missing)
        else:
            missing[1] = tick
    return gaps


@given(ticks=st.sets(st.integers(0, 60), min_size=1).map(sorted), data=st.data())
def test_the_account_does_not_depend_on_how_many_come_at_a_time(ticks: list[int], data: st.DataObject) -> None:
    account, rest = Account(), list(ticks)
    while rest:
        count = data.draw(st.integers(1, len(rest)))
        account.note(np.array(rest[:count]))
        del rest[:count]
    expected = gaps_of(ticks)
    assert (account.stored, account.gap_count, account.gaps) == (len(ticks), len(expected), expected[:MOST_GAPS])


def test_without_the_senders_word_the_loss_is_unknown() -> None:
    account = Account()
    account.note(np.array([0]))
    assert account.summary()["lost"] is None


@pytest.mark.parametrize("at_once", [1, 7, 1000])
def test_every_gap_counts_though_not_every_one_is_listed(at_once: int) -> None:
    account, ticks = Account(), np.arange(0, 4 * MOST_GAPS, 2)
    for first in range(0, ticks.size, at_once):
        account.note(ticks[first : first + at_once])
    assert account.gap_count == 2 * MOST_GAPS - 1
    assert account.gaps == [[k, k] for k in range(1, 2 * MOST_GAPS, 2)]


def test_time_stamps_are_kept_for_the_summary(tmp_path: Path) -> None:
    batch = RecordBatch(TIMING, 2)
    with Recorder(tmp_path, 1e-3, DEFINITIONS) as recorder:
        for first in (0, 2):
            batch.write([(tick, tick * 1e-3, *range(10 * tick, 10 * tick + 5)) for tick in (first, first + 1)])
            recorder.store("controller_timing", batch.payloads.copy())
        timing = recorder.timing()
    assert timing["controller_timing"]["tick"].tolist() == [0, 1, 2, 3]
    assert timing["controller_timing"]["waiting"].tolist() == [0, 10, 20, 30]
    assert timing["controller_timing"]["continued"].tolist() == [4, 14, 24, 34]
    assert timing["driver_timing"]["due"].shape == (0,)
