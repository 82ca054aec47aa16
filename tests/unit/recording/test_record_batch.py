"""RecordBatches: a row is the message that the codec makes, whoever wrote it and however."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from helpers.messages import MESSAGES, messages
from hypothesis import given
from hypothesis import strategies as st

from hilrig.loop.rows import AppliedRows, CommandRows, InternalsRows, StateRows, TruthRows
from hilrig.recording.messages.codec import Codec, definition
from hilrig.recording.messages.layouts import CHANNELS, definitions, layouts
from hilrig.recording.messages.record_batch import WORD, RecordBatch
from hilrig.rig.rows import controller_rows

MEMORY = {"gains": 3, "estimate": 2}


@pytest.mark.parametrize("name", MESSAGES)
@given(data=st.data(), rows=st.integers(1, 5))
def test_what_is_written_by_field_is_the_message(name: str, data: st.DataObject, rows: int) -> None:
    """And the rows beside it stay as they were."""
    codec, values = data.draw(messages(name))
    batch, row = RecordBatch(codec, rows), data.draw(st.integers(0, rows - 1))
    for field, value in zip(batch.fields, values, strict=True):
        field[row] = value
    assert batch.payloads.shape == (rows, codec.size)
    for k in range(rows):
        expected = codec.pack(values) if k == row else codec.zero()
        assert batch.message(k) == batch.payloads[k].tobytes() == expected


@pytest.mark.parametrize("name", MESSAGES)
@given(data=st.data())
def test_a_message_that_is_read_is_in_the_fields(name: str, data: st.DataObject) -> None:
    codec, values = data.draw(messages(name))
    batch = RecordBatch(codec, 3, b"lead" * 3)
    batch.read(1, b"LEAD" * 3 + codec.pack(values))
    assert batch.framed(1) == b"LEAD" * 3 + codec.pack(values)
    assert batch.framed(0) == b"lead" * 3 + codec.zero()
    for field, value in zip(batch.fields, values, strict=True):
        np.testing.assert_array_equal(field[1], value)
        assert not field[[0, 2]].any()
    for wrong in (codec.pack(values), b"lead" * 3 + codec.pack(values) + b"\0"):
        with pytest.raises(ValueError, match=f"{name}: a message of {len(wrong)} bytes, expected {codec.size}"):
            batch.read(1, wrong)
    assert batch.message(1) == codec.pack(values)


@pytest.mark.parametrize("name", MESSAGES)
@given(data=st.data())
def test_every_field_is_aligned(name: str, data: st.DataObject) -> None:
    codec, _ = data.draw(messages(name))
    batch = RecordBatch(codec, 3, bytes(data.draw(st.sampled_from([4, 12]))))
    for field in batch.fields:
        assert field.flags.aligned
        assert field.strides[0] % WORD == 0
        if field.size:  # an empty sequence lies nowhere
            assert field.ctypes.data % WORD == 0
            assert np.shares_memory(field, batch.payloads)


@given(values=st.lists(st.integers(-(2**63), 2**63 - 1), min_size=5, max_size=5), tick=st.integers(0, 2**64 - 1))
def test_messages_of_numbers_are_written_from_the_first_row_on(values: list[int], tick: int) -> None:
    codec = Codec(definition("ControllerTiming"), {})
    batch = RecordBatch(codec, 2)
    batch.write([(tick, 0.5, *values)])
    assert batch.message(0) == codec.pack((tick, 0.5, *values))
    assert batch.message(1) == codec.zero()


@pytest.mark.parametrize("wrong", [(1, 0.5, 2), (1, 0.5, 2, 3, 4, 5, 2**63), (-1, 0.5, 2, 3, 4, 5, 6)])
def test_numbers_that_do_not_fit_are_not_written(wrong: tuple[int, ...]) -> None:
    batch = RecordBatch(Codec(definition("ControllerTiming"), {}), 2)
    with pytest.raises((ValueError, OverflowError)):
        batch.write([wrong])


def test_more_messages_than_rows_are_not_written() -> None:
    batch = RecordBatch(Codec(definition("ControllerTiming"), {}), 2)
    with pytest.raises(ValueError, match="shape"):
        batch.write([(0,) * 7] * 3)
    batch.write([])
    assert batch.message(0) == batch.message(1)


@given(sizes=st.lists(st.integers(1, 5), max_size=3))
def test_a_laws_memory_is_one_array(sizes: list[int]) -> None:
    """Its fields are arrays of fixed length, which follow each other without a gap."""
    memory = {f"field_{i}": size for i, size in enumerate(sizes)}
    codec = layouts(2, 2, memory)["internals"]
    batch = RecordBatch(codec, 2)
    command = RecordBatch(layouts(2, 2, memory)["command"], 2)
    rows = controller_rows({"internals": batch, "command": command}).internals
    assert rows.memory.shape == (2, sum(sizes))
    rows.memory[1] = np.arange(sum(sizes)) + 1.0
    own = codec.unpack(batch.message(1))[len(InternalsRows._fields) - 1 :]
    np.testing.assert_array_equal(np.concatenate([np.zeros(0), *own]), rows.memory[1])
    assert batch.message(0) == codec.zero()


@pytest.mark.parametrize(
    ("rows", "message"),
    [(StateRows, "State"), (TruthRows, "Truth"), (CommandRows, "Command"), (AppliedRows, "Applied")],
)
def test_the_rows_of_kernels_have_the_fields_of_the_message(rows: Any, message: str) -> None:
    """Kernels take them in order: another order in the .msg would put one signal in another's place."""
    assert rows._fields == tuple(field.name for field in definition(message).fields)


def test_the_rows_of_internals_are_its_fields_and_the_memory() -> None:
    assert InternalsRows._fields == (*(field.name for field in definition("Internals").fields), "memory")


@given(joints=st.integers(1, 7), axes=st.integers(1, 6), sizes=st.lists(st.integers(1, 9), max_size=3))
def test_every_channel_has_a_layout_of_one_size(joints: int, axes: int, sizes: list[int]) -> None:
    """For any robot and memory. Bytes by hand: each number 8, each sequence 4 and what aligns it to 8."""
    memory = {f"field_{i}": size for i, size in enumerate(sizes)}
    found = layouts(joints, axes, memory)
    assert list(found) == list(CHANNELS) == list(definitions(memory))

    def size(numbers: int, *sequences: int) -> int:
        total = 8 * numbers
        for length in sequences:
            total = total + 4 + -(total + 4) % 8 + 8 * length
        return 4 + total

    assert found["state"].size == size(2, joints, 6, joints) + 16
    assert found["truth"].size == size(2, joints, joints, axes, axes, 6) + 8
    assert found["command"].size == size(2, joints, joints, joints) + 8
    assert found["applied"].size == size(2, joints, joints) + 8
    assert found["internals"].size == size(2, *[axes] * 7) + 8 * sum(sizes)
    assert found["stages"].size == size(3, joints, 6, joints, joints) + 16
    assert found["driver_timing"].size == size(11)
    assert found["controller_timing"].size == size(7)
