from __future__ import annotations

import io
import struct
import zlib
from pathlib import Path

import lz4.frame
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.opcode import Opcode
from mcap.reader import make_reader
from mcap.records import Chunk, MessageIndex
from mcap.stream_reader import StreamReader
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore

from hilrig.core.errors import RunDirectoryError
from hilrig.recording.bag import read_bag
from hilrig.recording.bag_writer import BagWriter
from hilrig.recording.messages.codec import Codec, definition, extended
from hilrig.recording.recorder import CHUNK_SIZE

PERIOD = 1e-3
TICKS = 1500
STATE = Codec(definition("State"), {"joint_position": 2, "wrench": 6, "applied_torque": 2})
COMMON = [field.name for field in definition("Internals").fields if field.size == 0]
INTERNALS = Codec(extended(definition("Internals"), {"gains": 3, "estimate": 2}), dict.fromkeys(COMMON, 2))


def numbers(tick: int, *sizes: int) -> list[np.ndarray]:
    rng = np.random.default_rng(tick)
    return [rng.normal(size=size) for size in sizes]


def state(tick: int) -> tuple:
    return (tick, tick * PERIOD, *numbers(tick, 2, 6, 2), tick * PERIOD, 1)


def internals(tick: int) -> tuple:
    return (tick, tick * PERIOD, *numbers(tick, *[2] * len(COMMON), 3, 2))


def write(path: Path, rows: int = 10) -> None:
    """Write so many ticks at a time, and end a chunk where it is large enough, as the rig does."""
    with BagWriter(path) as bag:
        bag.add_channel("state", STATE.definition)
        bag.add_channel("internals", INTERNALS.definition)
        for first in range(0, TICKS, rows):
            ticks = np.arange(first, first + rows)
            for name, codec, values in (("state", STATE, state), ("internals", INTERNALS, internals)):
                payloads = [np.frombuffer(codec.pack(values(tick)), np.uint8) for tick in ticks]
                bag.write(name, np.stack(payloads), ticks, PERIOD)
            if ticks[-1] % 100 == 99:
                bag.end_chunk()


@pytest.fixture(scope="module")
def bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("bag") / "bag.mcap"
    write(path)
    return path


def test_what_was_written_is_read_back(bag: Path) -> None:
    channels = read_bag(str(bag))
    assert set(channels) == {"state", "internals"}
    for tick in range(TICKS):
        for name, expected in zip(STATE.names, state(tick), strict=True):
            np.testing.assert_array_equal(channels["state"][name][tick], expected)
    assert channels["state"]["wrench"].shape == (TICKS, 6)
    assert channels["internals"]["gains"].shape == (TICKS, 3)
    np.testing.assert_array_equal(channels["internals"]["estimate"][7], internals(7)[-1])


@pytest.mark.parametrize("topic", ["state", "/state"])
def test_topics_select_channels(bag: Path, topic: str) -> None:
    assert set(read_bag(bag, [topic])) == {"state"}


def test_the_same_messages_make_the_same_file(bag: Path, tmp_path: Path) -> None:
    write(tmp_path / "again.mcap")
    assert (tmp_path / "again.mcap").read_bytes() == bag.read_bytes()


@settings(max_examples=150)
@given(data=st.data())
def test_a_bag_cut_anywhere_is_read_up_to_the_cut(
    bag: Path, tmp_path_factory: pytest.TempPathFactory, data: st.DataObject
) -> None:
    """Whatever byte a crash stopped at, what is read is a true beginning, and at most the last chunk is missing."""
    whole = bag.read_bytes()
    size = data.draw(st.integers(0, len(whole)))
    cut = tmp_path_factory.mktemp("cut") / "bag.mcap"
    cut.write_bytes(whole[:size])
    channels = read_bag(cut)
    count = channels["state"]["tick"].size if channels else 0
    message = STATE.size + INTERNALS.size + 100
    # Compressed chunks are smaller than CHUNK_SIZE: what is on disk holds at least as many bytes of messages.
    assert count * message >= size - 2 * CHUNK_SIZE or count == TICKS
    if count:
        np.testing.assert_array_equal(channels["state"]["tick"], np.arange(count))
        np.testing.assert_array_equal(channels["state"]["wrench"][-1], state(count - 1)[3])


def test_what_is_no_bag_is_refused(tmp_path: Path) -> None:
    with pytest.raises(RunDirectoryError, match="there is no such bag"):
        read_bag(tmp_path / "none.mcap")
    other = tmp_path / "other.mcap"
    other.write_bytes(b"name,value\n1,2\n" * 100)
    with pytest.raises(RunDirectoryError, match="not an MCAP file"):
        read_bag(other)


def test_messages_of_another_layout_are_refused_with_the_file(tmp_path: Path) -> None:
    """The first message of a channel gives its layout; 2 and 3 numbers take as many bytes as 3 and 2."""
    first, other = (Codec(definition("Applied"), {"torque": n, "position": 5 - n}) for n in (2, 3))
    path = tmp_path / "bag.mcap"
    with BagWriter(path) as bag:
        bag.add_channel("applied", first.definition)
        for tick, codec in enumerate((first, other)):
            payload = codec.pack((tick, tick * PERIOD, *(np.zeros(n) for n in codec_lengths(codec)), 0))
            bag.write("applied", np.frombuffer(payload, np.uint8)[None], np.array([tick]), PERIOD)
    with pytest.raises(RunDirectoryError, match=r"bag\.mcap: hilrig_msgs/msg/Applied: the length of torque is 3"):
        read_bag(path)


def codec_lengths(codec: Codec) -> list[int]:
    return [codec.dtype[name].shape[0] for name in ("torque", "position")]


def test_rosbags_opens_and_decodes_the_bag(bag: Path) -> None:
    """A reader that knows nothing of hilrig: topics, types and times from the file alone."""
    with AnyReader([bag], default_typestore=get_typestore(Stores.ROS2_HUMBLE)) as reader:
        assert {c.topic: c.msgtype for c in reader.connections} == {
            "/state": "hilrig_msgs/msg/State", "/internals": "hilrig_msgs/msg/Internals",
        }  # fmt: skip
        seen = 0
        for connection, time, payload in reader.messages():
            message = reader.deserialize(payload, connection.msgtype)
            tick = message.tick
            assert time == tick * 1_000_000
            if connection.topic == "/state":
                np.testing.assert_array_equal(message.wrench, state(tick)[3])
            else:
                np.testing.assert_array_equal(message.gains, internals(tick)[-2])
            seen += 1
    assert seen == 2 * TICKS


def test_mcaps_own_reader_finds_everything_by_the_index(bag: Path) -> None:
    with bag.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        summary = reader.get_summary()
        assert summary is not None
        assert summary.statistics is not None
        assert summary.statistics.message_count == 2 * TICKS
        assert len(summary.chunk_indexes) == summary.statistics.chunk_count > 3
        some = [
            message
            for _, _, message in reader.iter_messages(["/state"], starting_at=5_000_000, ending_before=9_000_000)
        ]
    assert [message.sequence for message in some] == [5, 6, 7, 8]
    assert some[0].data == STATE.pack(state(5))


def check_index(path: Path) -> None:
    """Check every chunk's checksum and span, and that each entry of its index leads to its message."""
    entries, chunk, content = 0, None, b""
    for record in StreamReader(io.BytesIO(path.read_bytes()), emit_chunks=True).records:
        if isinstance(record, Chunk):
            chunk, content = record, lz4.frame.decompress(record.data)
            assert chunk.uncompressed_crc == zlib.crc32(content) != 0
        elif isinstance(record, MessageIndex):
            assert chunk is not None
            for time, offset in record.records:
                opcode, _, channel, sequence, log, publish = struct.unpack_from("<BQHIQQ", content, offset)
                assert (opcode, channel, log, publish) == (Opcode.MESSAGE, record.channel_id, time, time)
                assert time == sequence * 1_000_000
            times = [time for time, _ in record.records]
            assert chunk.message_start_time <= min(times) <= max(times) <= chunk.message_end_time
            entries += len(times)
    assert entries == 2 * TICKS
    summary = make_reader(io.BytesIO(path.read_bytes())).get_summary()
    assert summary is not None
    assert summary.statistics is not None
    assert list(summary.statistics.channel_message_counts.values()) == [TICKS, TICKS]
    assert summary.statistics.message_start_time == 0
    assert summary.statistics.message_end_time == (TICKS - 1) * 1_000_000


@pytest.mark.parametrize("rows", [1, 500])
def test_any_number_of_rows_at_a_time_is_the_same_record(bag: Path, tmp_path: Path, rows: int) -> None:
    write(tmp_path / "rows.mcap", rows)
    expected, found = read_bag(bag), read_bag(tmp_path / "rows.mcap")
    for channel, fields in expected.items():
        for name, values in fields.items():
            np.testing.assert_array_equal(found[channel][name], values)
    check_index(bag)
    check_index(tmp_path / "rows.mcap")
    with (tmp_path / "rows.mcap").open("rb") as file:
        messages = make_reader(file, validate_crcs=True).iter_messages(["/internals"], starting_at=700_000_000)
        assert next(iter(messages))[2].data == INTERNALS.pack(internals(700))


def test_a_missed_tick_keeps_its_number_and_its_time(tmp_path: Path) -> None:
    ticks = np.array([0, 1, 4, 5, 9])
    with BagWriter(tmp_path / "bag.mcap") as bag:
        bag.add_channel("state", STATE.definition)
        bag.write("state", np.stack([np.frombuffer(STATE.pack(state(k)), np.uint8) for k in ticks]), ticks, PERIOD)
    with (tmp_path / "bag.mcap").open("rb") as file:
        found = [(message.sequence, message.log_time) for _, _, message in make_reader(file).iter_messages()]
    assert found == [(k, k * 1_000_000) for k in ticks]
