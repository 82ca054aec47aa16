"""Parcels to the logger: what goes in comes out, in order, with the counts."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from builders import PERIOD, arm, state, trial
from hypothesis import given
from hypothesis import strategies as st

from hilrig.loop import Answer
from hilrig.messages.codec import Codec, Definition, definition, sizes_in
from hilrig.rig.channels import BATCH, DRIVER, Codecs, Record, Stamps, internals_definition, unpack_parcel
from hilrig.signals import Array, Command, Measurement, Reference, Truth

MEMORY = {"gains": 3, "estimate": 2}


class Memory(NamedTuple):
    gains: Array
    estimate: Array


def fields(form: Definition, payload: bytes) -> dict[str, Any]:
    """Return what a message says, by the names of its definition."""
    values = Codec(form, sizes_in(form, payload)).unpack(payload)
    return {field.name: value for field, value in zip(form.fields, values, strict=True)}


def assert_says(form: Definition, payload: bytes, **wanted: Any) -> None:
    """Check that a message of tick 7 holds these fields and no other."""
    found = fields(form, payload)
    assert found.keys() == {"tick", "time", *wanted}
    assert (found["tick"], found["time"]) == (7, 7 * PERIOD)
    for name, value in wanted.items():
        np.testing.assert_array_equal(found[name], value, err_msg=name)


def test_every_signal_stands_under_its_name() -> None:
    random, codecs = np.random.default_rng(1), Codecs(trial(), MEMORY)
    measurement = Measurement(*(random.normal(size=size) for size in (2, 6, 2)))
    truth = Truth(*(random.normal(size=size) for size in (2, 2, 2, 2, 6)), 0.35)
    assert_says(definition("State"), codecs.state(7, measurement), **measurement._asdict())
    assert_says(definition("Truth"), codecs.truth(7, truth), **truth._asdict())

    seen = state(arm(), *random.normal(size=(4, 2)))
    command, wanted = Command(*random.normal(size=(2, 2))), Reference(*random.normal(size=(4, 2)))
    answer = Answer(command, seen, wanted, Memory(random.normal(size=3), random.normal(size=2)))
    assert_says(definition("Command"), codecs.command(7, answer), **command._asdict())
    assert_says(
        internals_definition(MEMORY), codecs.internals(7, answer),
        position=seen.position, velocity=seen.velocity, force=seen.force, **answer.memory._asdict(),
        **{f"reference_{name}": value for name, value in wanted._asdict().items()},
    )  # fmt: skip


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
