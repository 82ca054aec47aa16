from __future__ import annotations

from pathlib import Path

import numpy as np

from hilrig.messages.codec import Codec, definition
from hilrig.recording.bag import read_bag
from hilrig.recording.recorder import MOST_GAPS, Account, Channel, Recorder

COMMAND = Codec(definition("Command"), {"torque": 1, "position": 1})
TIMING = Codec(definition("ControllerTiming"), dict.fromkeys(("ticks", "received", "computed", "published"), 2))
CHANNELS = [Channel("command", COMMAND.definition, True), Channel("controller_timing", TIMING.definition, False)]


def command(tick: int) -> bytes:
    return COMMAND.pack((tick, tick * 1e-3, np.array([float(tick)]), np.zeros(1)))


def test_all_that_was_sent_and_stored_is_accounted_for(tmp_path: Path) -> None:
    with Recorder(tmp_path, 1e-3, CHANNELS) as recorder:
        for tick in range(5):
            recorder.store("command", command(tick))
        recorder.sent("command", 5)
        assert recorder.summary()["command"] == {"sent": 5, "stored": 5, "lost": 0, "gap_count": 0, "gaps": []}
    np.testing.assert_array_equal(read_bag(tmp_path / "bag.mcap")["command"]["torque"][:, 0], np.arange(5.0))


def test_gaps_are_named_and_losses_counted(tmp_path: Path) -> None:
    """Ticks 0, 3 and 4 to 5 are missing of 0 to 6; of 8 sent, one was lost behind the last that came."""
    with Recorder(tmp_path, 1e-3, CHANNELS) as recorder:
        for tick in (1, 2, 6):
            recorder.store("command", command(tick))
        recorder.sent("command", 8)
        account = recorder.summary()["command"]
    assert account["gaps"] == [[0, 0], [3, 5]]
    assert (account["stored"], account["lost"], account["gap_count"]) == (3, 5, 2)


def test_rows_are_counted_and_their_gaps_named(tmp_path: Path) -> None:
    """Blocks of ticks 1 to 3, none, and 6 to 7: 0 and 4 to 5 are missing; single messages count on from there."""
    with Recorder(tmp_path, 1e-3, CHANNELS) as recorder:
        for ticks in (np.arange(1, 4), np.arange(0), np.arange(6, 8)):
            payloads = COMMAND.pack_rows([ticks, ticks * 1e-3, ticks[:, None] * 1.0, ticks[:, None] * 0.0])
            recorder.store_rows("command", payloads, ticks)
        recorder.store("command", command(8))
        recorder.sent("command", 7)
        account = recorder.summary()["command"]
    assert account == {"sent": 7, "stored": 6, "lost": 1, "gap_count": 2, "gaps": [[0, 0], [4, 5]]}
    table = read_bag(tmp_path / "bag.mcap")["command"]
    assert table["tick"].tolist() == table["torque"][:, 0].tolist() == [1, 2, 3, 6, 7, 8]


def test_without_the_senders_word_the_loss_is_unknown() -> None:
    account = Account()
    account.note(0)
    assert account.summary()["lost"] is None


def test_every_gap_counts_though_not_every_one_is_listed() -> None:
    account = Account()
    for tick in range(0, 4 * MOST_GAPS, 2):
        account.note(tick)
    assert account.gap_count == 2 * MOST_GAPS - 1
    assert len(account.gaps) == MOST_GAPS


def test_timing_messages_hold_many_ticks_and_make_no_gaps(tmp_path: Path) -> None:
    batches = [TIMING.pack((first, *[np.array([first, first + 1])] * 4)) for first in (0, 2, 4)]
    with Recorder(tmp_path, 1e-3, CHANNELS) as recorder:
        for batch in batches:
            recorder.store("controller_timing", batch)
        recorder.sent("controller_timing", 3)
        assert recorder.timing["controller_timing"] == batches
        account = recorder.summary()["controller_timing"]
    assert (account["stored"], account["lost"], account["gap_count"]) == (3, 0, 0)
