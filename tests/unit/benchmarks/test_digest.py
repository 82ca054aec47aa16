"""Digests of bags that mcap's own writer made."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from mcap.writer import Writer

from benchmarks.digest import LENGTH, TOPICS, UnreadableBagError, digest_of, digests, line

Message = tuple[str, int, bytes]
"""Topic, log time and bytes"""


def write_bag(path: Path, messages: Sequence[Message]) -> Path:
    """Write a bag with these messages, in small chunks."""
    with path.open("wb") as file:
        writer = Writer(file, chunk_size=64)
        writer.start()
        schema = writer.register_schema("anything", "ros2msg", b"")
        channels = {
            topic: writer.register_channel(topic, "cdr", schema)
            for topic in dict.fromkeys(item[0] for item in messages)
        }
        for topic, time, data in messages:
            writer.add_message(channels[topic], time, data, time)
        writer.finish()
    return path


messages = st.lists(st.tuples(st.sampled_from([*TOPICS, "/driver_timing"]), st.integers(0, 5), st.binary(max_size=40)))


@given(messages)
def test_a_digest_is_of_the_messages_in_the_order_of_the_file(
    tmp_path_factory: pytest.TempPathFactory, written: list[Message]
) -> None:
    bag = write_bag(tmp_path_factory.mktemp("bag") / "bag.mcap", written)
    expected = {
        topic: hashlib.sha256(b"".join(data for name, _, data in written if name == topic)).hexdigest()[:LENGTH]
        for topic in TOPICS
        if any(name == topic for name, _, _ in written)
    }
    assert digest_of(bag) == expected
    assert list(digest_of(bag)) == sorted(expected)


def test_a_run_has_a_line_for_each_trial_in_order(tmp_path: Path) -> None:
    for trial, data in (("pd.noisy.1", b"b"), ("pd.noisy.0", b"a")):
        folder = tmp_path / "trials" / trial
        folder.mkdir(parents=True)
        write_bag(folder / "bag.mcap", [("/state", 0, data), ("/command", 0, data)])
    lines = [line(trial, topics) for trial, topics in digests(tmp_path).items()]
    first, second = (hashlib.sha256(data).hexdigest()[:LENGTH] for data in (b"a", b"b"))
    assert lines == [f"pd.noisy.0 /command={first} /state={first}", f"pd.noisy.1 /command={second} /state={second}"]


@pytest.mark.parametrize("content", [b"", b"junk" * 99, None], ids=["empty", "junk", "cut"])
def test_a_bag_that_is_not_whole_is_named(tmp_path: Path, content: bytes | None) -> None:
    bag = write_bag(tmp_path / "bag.mcap", [("/state", 0, b"data" * 500)])
    bag.write_bytes(bag.read_bytes()[:200] if content is None else content)
    with pytest.raises(UnreadableBagError, match=r"bag\.mcap: not a whole bag"):
        digest_of(bag)
