"""The channels of a trial: their messages, their codecs, and how they reach the logger.

State and command are what the loop waits for: each goes out alone, at once, to the one process that needs it. For the
record every sender keeps a copy of each payload and hands the copies to the logger many at a time: a message of its own
for each would wake the logger four times a tick and cost the loop more than the control law.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from hilrig.messages.codec import Codec, Definition, definition, extended
from hilrig.recording.recorder import Channel
from hilrig.rig.bus import Outbox
from hilrig.signals import Array, Measurement, Truth
from hilrig.trial import Trial

if TYPE_CHECKING:
    from hilrig.compiled.tick import Block
    from hilrig.loop import Answer

BATCH = 256
"""Ticks in one timing message"""
PARCEL = 32
"""Ticks of payloads in one message to the logger: what a killed sender takes with it, at most"""
NAMES = ("state", "truth", "command", "internals", "driver_timing", "controller_timing")
DRIVER = ("state", "truth", "driver_timing")
CONTROLLER = ("command", "internals", "controller_timing")


def channels(memory: Mapping[str, int]) -> list[Channel]:
    """Return the channels of a trial whose law remembers these fields (name -> length)."""
    definitions = {
        "state": definition("State"),
        "truth": definition("Truth"),
        "command": definition("Command"),
        "internals": internals_definition(memory),
        "driver_timing": definition("DriverTiming"),
        "controller_timing": definition("ControllerTiming"),
    }
    return [Channel(name, definitions[name], not name.endswith("timing")) for name in NAMES]


def internals_definition(memory: Mapping[str, int]) -> Definition:
    """Return the definition of a law's internals: the common part, then its memory."""
    return extended(definition("Internals"), memory)


class Codecs:
    """Packs and unpacks the per-tick messages of one trial."""

    def __init__(self, trial: Trial, memory: Mapping[str, int]) -> None:
        n, m = trial.driver.robot.joints, len(trial.axes)
        self._period = trial.period
        joint = {"joint_position": n, "joint_velocity": n, "applied_torque": n, "torque": n}
        self._state = Codec(definition("State"), {**joint, "wrench": 6})
        self._truth = Codec(definition("Truth"), {**joint, "position": m, "velocity": m, "wrench": 6})
        self._command = Codec(definition("Command"), {**joint, "position": n})
        internals = internals_definition(memory)
        self._memory = list(memory.values())
        self._internals = Codec(internals, {field.name: m for field in internals.fields if field.size == 0})

    def state(self, tick: int, measurement: Measurement) -> bytes:
        """Pack a State."""
        return self._state.pack((tick, tick * self._period, *measurement))

    def read_state(self, payload: bytes) -> tuple[int, Measurement]:
        """Return the tick and the measurement of a State."""
        tick, _, *fields = self._state.unpack(payload)
        return tick, Measurement(*fields)

    def truth(self, tick: int, truth: Truth) -> bytes:
        """Pack a Truth."""
        return self._truth.pack((tick, tick * self._period, *truth))

    def command(self, tick: int, answer: Answer) -> bytes:
        """Pack a Command."""
        return self._command.pack((tick, tick * self._period, *answer.command))

    def read_command(self, payload: bytes) -> tuple[int, Any]:
        """Return the tick and the (torque, position) of a Command."""
        tick, _, *fields = self._command.unpack(payload)
        return tick, fields

    def internals(self, tick: int, answer: Answer) -> bytes:
        """Pack the Internals."""
        state = answer.state
        memory = (np.ravel(value) for value in answer.memory)
        values = (state.position, state.velocity, state.force, *answer.reference, *memory)
        return self._internals.pack((tick, tick * self._period, *values))

    def rows(self, block: Block) -> Iterator[tuple[str, NDArray[np.int64], NDArray[np.uint8]]]:
        """Yield (channel, ticks (N,), payloads (N, bytes)) of a block of ticks."""
        track = block.track
        sensed, acted = (block.first + np.arange(count) for count in track.done)
        truth = (*track.truth[:5], track.surface)
        for name, codec, signals in (("state", self._state, track.state), ("truth", self._truth, truth)):
            yield name, sensed, self._packed(codec, sensed, signals)
        yield "command", acted, self._packed(self._command, acted, track.command)
        memory = np.split(track.memory, np.cumsum(self._memory)[:-1], axis=1) if self._memory else ()
        own = (track.position, track.velocity, track.force, *track.reference, *memory)
        yield "internals", acted, self._packed(self._internals, acted, own)

    def _packed(self, codec: Codec, ticks: NDArray[np.int64], signals: Sequence[Any]) -> NDArray[np.uint8]:
        return codec.pack_rows([ticks, ticks * self._period, *(signal[: ticks.size] for signal in signals)])


class Stamps:
    """Time stamps of many ticks, handed on in batches."""

    def __init__(self, name: str, columns: int) -> None:
        self._definition = definition(name)
        self._rows = np.zeros((BATCH, columns), dtype=np.int64)
        self._count = 0
        self._first = 0

    def note(self, tick: int, *values: int) -> bytes | None:
        """Note one tick's stamps; return a message when a batch is full."""
        if self._count == 0:
            self._first = tick
        self._rows[self._count] = values
        self._count += 1
        return self.flush() if self._count == BATCH else None

    def flush(self) -> bytes | None:
        """Return a message of what has been noted since the last one, or None if that is nothing."""
        if self._count == 0:
            return None
        sizes = {field.name: self._count for field in self._definition.fields if field.size == 0}
        columns: list[Array] = list(self._rows[: self._count].T)
        self._count = 0
        return Codec(self._definition, sizes).pack((self._first, *columns))


_FRAME = struct.Struct("<BI")
_COUNT = 0x80
"""Marks a frame that holds the number of payloads sent on its channel"""


class Record:
    """Collects a sender's payloads and hands them to the logger in parcels."""

    def __init__(self, outbox: Outbox, names: tuple[str, ...]) -> None:
        self._outbox = outbox
        self._frames: list[bytes] = []
        self._counts = dict.fromkeys(names, 0)
        self._numbers = {name: NAMES.index(name) for name in names}

    def add(self, name: str, payload: bytes | None) -> None:
        """Keep one payload of the channel `name`; None is nothing to keep."""
        if payload is not None:
            self._frames += (_FRAME.pack(self._numbers[name], len(payload)), payload)
            self._counts[name] += 1

    def ship(self) -> None:
        """Hand over what has been collected."""
        if self._frames:
            self._outbox.put(b"".join(self._frames))
            self._frames.clear()

    def end(self) -> None:
        """Hand over the rest, and how many payloads there were on each channel."""
        for name, count in self._counts.items():
            content = count.to_bytes(8, "little")
            self._frames += (_FRAME.pack(self._numbers[name] | _COUNT, len(content)), content)
        self.ship()


def unpack_parcel(parcel: bytes) -> Iterator[tuple[str, bytes, int | None]]:
    """Yield (channel, payload, None) for each payload in a parcel, and (channel, b"", count) where a channel ends."""
    offset = 0
    while offset < len(parcel):
        number, size = _FRAME.unpack_from(parcel, offset)
        offset += _FRAME.size
        content = parcel[offset : offset + size]
        offset += size
        if number & _COUNT:
            yield NAMES[number & ~_COUNT], b"", int.from_bytes(content, "little")
        else:
            yield NAMES[number], content, None
