"""Packets to the logger: what goes in comes out, in order, with the counts."""

from __future__ import annotations

from contextlib import suppress

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hilrig.core.errors import RigError
from hilrig.recording.messages.layouts import layouts
from hilrig.rig.channels import (
    CONTROLLER_CHANNELS,
    DRIVER_CHANNELS,
    LOCKSTEP_PACKET_TICKS,
    NAMES,
    PACKET_BYTES,
    PACKET_TICKS,
    RecordBatches,
    RecordSender,
    unpack_batches,
)

MEMORY = {"gains": 3, "estimate": 2}
CODECS = layouts(2, 2, MEMORY)


def unpacked(packets: list[bytes]) -> tuple[dict[str, bytes], dict[str, int]]:
    """Return the messages of each channel, one behind the other, and what the sender said of their number."""
    messages, counts = dict.fromkeys(NAMES, b""), {}
    for packet in packets:
        for part in unpack_batches(packet):
            if part.refused is not None:
                continue
            if part.total is None:
                assert part.channel not in counts, "a message behind the end of its channel"
                messages[part.channel] += part.payloads.tobytes()
            else:
                counts[part.channel] = part.total
    return messages, counts


@given(ticks=st.integers(0, 3 * PACKET_TICKS), every=st.integers(1, PACKET_TICKS), truthful=st.booleans())
def test_what_was_written_arrives_in_order_with_its_counts(ticks: int, every: int, truthful: bool) -> None:
    """However often it is handed over, and though every row is written over again."""
    packets: list[bytes] = []
    record = RecordSender(packets.append, CODECS, DRIVER_CHANNELS)
    sent = dict.fromkeys(NAMES, b"")
    written = [name for name in DRIVER_CHANNELS if truthful or name != "truth"]
    row = 0
    for tick in range(ticks):
        stamps = (tick, *range(tick, tick + 10))
        record.stamps.append(stamps)
        sent["driver_timing"] += CODECS["driver_timing"].pack(stamps)
        for name in written[:-1]:
            fields = record.batches[name].fields
            for i, field in enumerate(fields):
                field[row] = tick if i == 0 else tick + i
            record.written[name] = row + 1
            sent[name] += record.batches[name].message(row)
        row += 1
        if row == every:
            record.ship()
            row = 0
    record.end()
    messages, counts = unpacked(packets)
    assert messages == sent
    assert counts == {name: ticks * (name in written) for name in DRIVER_CHANNELS}
    assert all(len(packet) <= PACKET_BYTES + 100 for packet in packets)


def test_nothing_is_sent_of_nothing() -> None:
    packets: list[bytes] = []
    record = RecordSender(packets.append, CODECS, CONTROLLER_CHANNELS)
    record.ship()
    assert packets == []
    record.end()
    assert unpacked(packets) == (dict.fromkeys(NAMES, b""), dict.fromkeys(CONTROLLER_CHANNELS, 0))


@given(st.integers(1, 4000))
def test_no_packet_is_larger_than_the_bus_takes(size: int) -> None:
    """Whatever a law remembers: fewer ticks at a time, or it is refused before the trial begins."""
    codecs = layouts(2, 2, {"table": size})
    tick = sum(codecs[name].size for name in CONTROLLER_CHANNELS)
    if 2 * tick > PACKET_BYTES:
        with pytest.raises(RigError, match=f"take {tick} bytes"):
            RecordSender(lambda packet: None, codecs, CONTROLLER_CHANNELS)
        return
    packets: list[bytes] = []
    record = RecordSender(packets.append, codecs, CONTROLLER_CHANNELS)
    assert 2 <= record.rows <= PACKET_TICKS
    record.wrote(record.rows - 1)
    record.stamps += [(0,) * 7] * record.rows
    record.ship()
    assert len(packets[0]) < 65_000
    assert unpacked(packets)[0]["internals"] == record.batches["internals"].payloads.tobytes()


def test_the_end_says_what_was_refused() -> None:
    packets: list[bytes] = []
    RecordSender(packets.append, CODECS, DRIVER_CHANNELS).end({"command": {"old": 3}})
    refused = [part.refused for packet in packets for part in unpack_batches(packet) if part.refused is not None]
    assert refused == [{"command": {"old": 3}}]


@given(st.binary(max_size=200))
def test_what_is_no_packet_is_refused_or_read_as_one(packet: bytes) -> None:
    """Nothing but ValueError comes of it."""
    with suppress(ValueError):
        unpack_batches(packet)


def test_a_law_that_remembers_too_much_is_told_the_limit() -> None:
    with pytest.raises(RigError) as caught:
        RecordSender(lambda packet: None, layouts(2, 2, {"table": 4000}), CONTROLLER_CHANNELS)
    assert str(caught.value) == (
        "the messages of one tick (command, internals, controller_timing) take 32348 bytes, but the bus takes at most "
        "30000: give the law a smaller memory, or run with --in-process, which has no limit"
    )


def test_channels_may_have_different_numbers_of_rows() -> None:
    """Where a trial ends within a tick: the state is there, its command is not."""
    batches = RecordBatches(CODECS, NAMES, 4)
    batches.written |= {**dict.fromkeys(NAMES, 3), "command": 2}
    rows = {name: payloads.shape for name, payloads in batches.hand_over()}
    assert rows["state"] == (3, CODECS["state"].size)
    assert rows["command"] == (2, CODECS["command"].size)
    assert list(batches.hand_over()) == []
    assert (batches.counts["state"], batches.counts["command"]) == (3, 2)
    assert np.count_nonzero(list(batches.written.values())) == 0


def test_a_rehearsal_is_as_large_as_what_comes_and_says_nothing() -> None:
    packets: list[bytes] = []
    record = RecordSender(packets.append, CODECS, CONTROLLER_CHANNELS)
    record.rehearse()
    record.wrote(record.rows - 1)
    record.stamps += [(0,) * 7] * record.rows
    record.ship()
    *practice, first = packets
    assert practice
    assert all(abs(len(packet) - len(first)) < 50 for packet in practice)
    assert unpacked(practice) == (dict.fromkeys(NAMES, b""), {})


@pytest.mark.parametrize(("realtime", "ticks"), [(True, PACKET_TICKS), (False, LOCKSTEP_PACKET_TICKS)])
def test_a_packet_holds_fewer_ticks_in_real_time(realtime: bool, ticks: int) -> None:
    assert RecordSender(lambda packet: None, CODECS, DRIVER_CHANNELS, realtime=realtime).rows == ticks
