from __future__ import annotations

import numpy as np
import pytest
from helpers.messages import MESSAGES, messages
from hypothesis import given
from hypothesis import strategies as st
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from hilrig.recording.messages.codec import HEADER, TICK, Codec, definition, parse_definition, sizes_in


def same(got: list, expected: list) -> None:
    for a, b in zip(got, expected, strict=True):
        np.testing.assert_array_equal(a, b, strict=isinstance(b, np.ndarray))


@pytest.mark.parametrize("name", MESSAGES)
@given(data=st.data())
def test_what_is_packed_is_unpacked(name: str, data: st.DataObject) -> None:
    codec, values = data.draw(messages(name))
    payload = codec.pack(values)
    assert len(payload) == codec.size
    same(codec.unpack(payload), values)
    assert sizes_in(codec.definition, payload) == {
        field.name: len(value) for field, value in zip(codec.definition.fields, values, strict=True) if field.size == 0
    }


@pytest.mark.parametrize("name", MESSAGES)
@given(data=st.data())
def test_the_bytes_are_those_of_ros_2(name: str, data: st.DataObject) -> None:
    codec, values = data.draw(messages(name))
    store = get_typestore(Stores.ROS2_HUMBLE)
    store.register(get_types_from_msg(codec.definition.text, codec.definition.name))
    fields = dict(zip((field.name for field in codec.definition.fields), values, strict=True))
    assert bytes(
        store.serialize_cdr(store.types[codec.definition.name](**fields), codec.definition.name)
    ) == codec.pack(values)


@pytest.mark.parametrize("name", MESSAGES)
@given(data=st.data())
def test_a_payload_of_another_length_or_encoding_is_refused(name: str, data: st.DataObject) -> None:
    codec, values = data.draw(messages(name))
    payload = codec.pack(values)
    cut = data.draw(st.integers(0, len(payload) - 1))
    for wrong in (payload[:cut], payload + b"\0"):
        both = f"{codec.definition.name}: a message of {len(wrong)} bytes, expected {codec.size}"
        for reading in (
            lambda wrong=wrong: codec.unpack(wrong),
            lambda wrong=wrong: codec.columns([payload, wrong]),
            lambda wrong=wrong: codec.table(np.frombuffer(wrong, np.uint8)[None]),
        ):
            with pytest.raises(ValueError, match=both):
                reading()
    big_endian = b"\x00\x00" + payload[2:]
    with pytest.raises(ValueError, match=f"{codec.definition.name}: a message that begins with 00000000"):
        codec.unpack(big_endian)
    with pytest.raises(ValueError, match=f"{codec.definition.name}: the {HEADER} is 0, expected 256"):
        codec.columns([payload, big_endian])


def test_a_table_of_messages_with_other_lengths_of_the_same_size_is_refused() -> None:
    """Two sequences of 2 and 3 numbers take as many bytes as those of 3 and 2."""
    mine, other = (Codec(definition("Applied"), {"torque": n, "position": 5 - n}) for n in (2, 3))
    assert mine.size == other.size
    with pytest.raises(ValueError, match="hilrig_msgs/msg/Applied: the length of torque is 3, expected 2"):
        mine.columns([mine.zero(), other.zero()])


@pytest.mark.parametrize("name", MESSAGES)
@given(data=st.data())
def test_the_dtype_covers_every_byte_but_those_that_align(name: str, data: st.DataObject) -> None:
    """Fields do not overlap; between them there are less than eight bytes, which are zero."""
    codec, values = data.draw(messages(name))
    end, payload = 0, codec.pack(values)
    for form, offset, *_ in (codec.dtype.fields or {}).values():
        assert 0 <= offset - end < 8
        assert not any(payload[end:offset])
        end = offset + form.itemsize
    assert end == codec.size == len(payload)


def test_columns_stack_the_fields_of_many_messages() -> None:
    codec = Codec(definition("Applied"), {"torque": 2, "position": 3})
    rows = [(k, 0.5 * k, np.array([k, -k], float), np.full(3, 2.0 * k), k) for k in range(4)]
    table = codec.columns([codec.pack(row) for row in rows])
    np.testing.assert_array_equal(table["tick"], [0, 1, 2, 3])
    np.testing.assert_array_equal(table["time"], [0, 0.5, 1, 1.5])
    np.testing.assert_array_equal(table["torque"], [[0, 0], [1, -1], [2, -2], [3, -3]])
    assert table["position"].shape == (4, 3)


@pytest.mark.parametrize("name", MESSAGES)
@given(data=st.data())
def test_a_table_has_the_fields_of_each_message(name: str, data: st.DataObject) -> None:
    """Of rows that lie apart, too, as those of a batch do."""
    codec, values = data.draw(messages(name))
    rows = np.zeros((3, codec.size + 5), np.uint8)
    rows[:, 3:-2] = np.frombuffer(codec.zero(), np.uint8)
    rows[1, 3:-2] = np.frombuffer(codec.pack(values), np.uint8)
    table = codec.table(rows[:, 3:-2])
    assert list(table) == [field.name for field in codec.definition.fields]
    for column, value in zip(table.values(), values, strict=True):
        np.testing.assert_array_equal(column[1], value)
        assert not column[[0, 2]].any()


@pytest.mark.parametrize("name", MESSAGES)
@given(data=st.data())
def test_a_message_of_zeros_has_its_lengths(name: str, data: st.DataObject) -> None:
    codec, values = data.draw(messages(name))
    zeros = [np.zeros_like(value) if isinstance(value, np.ndarray) else 0 for value in values]
    assert codec.zero() == codec.pack(zeros)


def test_unpacked_arrays_are_the_readers_own() -> None:
    codec = Codec(definition("Applied"), {"torque": 2, "position": 2})
    payload = codec.pack((1, 0.0, np.ones(2), np.ones(2), 1))
    codec.unpack(payload)[2][:] = 7.0
    np.testing.assert_array_equal(codec.unpack(payload)[2], [1.0, 1.0])


def test_a_wrong_length_is_not_packed() -> None:
    codec = Codec(definition("Applied"), {"torque": 2, "position": 2})
    for wrong in (np.ones(3), np.ones(1), 1.0):
        with pytest.raises(ValueError, match=r"Applied: torque has the shape \(.*\), expected \(2,\)"):
            codec.pack((1, 0.0, wrong, np.ones(2), 1))
    with pytest.raises(ValueError, match="shorter"):
        codec.pack((1, 0.0, np.ones(2)))


def test_unpacked_numbers_are_pythons_and_arrays_are_aligned() -> None:
    """A tick is subtracted from, which numpy's unsigned numbers do not survive; kernels take aligned arrays only."""
    codec = Codec(definition("Applied"), {"torque": 2, "position": 2})
    tick, time, torque, _, _ = codec.unpack(codec.pack((1, 0.5, np.ones(2), np.ones(2), 1)))
    assert (type(tick), type(time)) == (int, float)
    assert torque.flags.aligned
    assert torque.flags.writeable
    assert torque.dtype == np.float64


@pytest.mark.parametrize(
    "line", ["string name", "float64 ", "float64[<=3] x", "geometry_msgs/Vector3 v", "float64 x 3"]
)
def test_a_definition_that_the_codec_cannot_pack_is_refused(line: str) -> None:
    with pytest.raises(ValueError, match="Mine: cannot read the line"):
        parse_definition("Mine", f"uint64 tick\n{line}\n")


def test_every_message_begins_with_its_tick() -> None:
    """The recorder reads the tick of any payload without knowing its type."""
    for name in MESSAGES:
        form = definition(name)
        assert form.fields[0] == ("tick", "uint64", None)
        codec = Codec(form, {field.name: 1 for field in form.fields if field.size == 0})
        layout, offset, *_ = (codec.dtype.fields or {})["tick"]
        assert (offset, offset + layout.itemsize) == (TICK.start, TICK.stop)
