"""Parcels to the logger: what goes in comes out, in order, with the counts."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from hilrig.messages.codec import Codec, definition, sizes_in
from hilrig.rig.channels import BATCH, DRIVER, Record, Stamps, unpack_parcel


class Post:
    """Keeps what an outbox would send."""

    def __init__(self) -> None:
        self.parcels: list[bytes] = []

    def put(self, payload: bytes) -> None:
        self.parcels.append(payload)


@given(
    items=st.lists(st.tuples(st.sampled_from(DRIVER), st.binary(max_size=300)), max_size=80),
    every=st.integers(1, 10),
)
def test_what_was_added_arrives_in_order_with_its_counts(items: list[tuple[str, bytes]], every: int) -> None:
    post = Post()
    record = Record(post, DRIVER)  # pyright: ignore[reportArgumentType]
    for i, (name, payload) in enumerate(items):
        record.add(name, payload)
        if i % every == 0:
            record.ship()
    record.end()
    frames = [frame for parcel in post.parcels for frame in unpack_parcel(parcel)]
    assert [(name, payload) for name, payload, count in frames if count is None] == items
    counts = {name: count for name, _, count in frames if count is not None}
    assert counts == {name: sum(item[0] == name for item in items) for name in DRIVER}


def test_nothing_to_keep_is_not_counted() -> None:
    post = Post()
    record = Record(post, DRIVER)  # pyright: ignore[reportArgumentType]
    record.add("driver_timing", None)
    record.end()
    assert all(count == 0 for _, _, count in unpack_parcel(post.parcels[0]))


def test_stamps_come_in_batches_and_the_rest_at_the_end() -> None:
    stamps = Stamps("DriverTiming", 5)
    messages = [stamps.note(tick, *(tick * 10 + i for i in range(5))) for tick in range(BATCH + 3)]
    full = [message for message in messages if message is not None]
    rest = stamps.flush()
    assert len(full) == 1
    assert rest is not None
    assert stamps.flush() is None
    form = definition("DriverTiming")
    first, *columns = Codec(form, sizes_in(form, rest)).unpack(rest)
    assert first == BATCH
    np.testing.assert_array_equal(columns[0], [2560, 2570, 2580])
    np.testing.assert_array_equal(columns[4], [2564, 2574, 2584])
