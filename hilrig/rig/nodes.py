"""The two halves of a trial as the bus has them: messages in, messages out.

Each begins with the halves in `loop`, which start plant and law at the first tick. From then on kernels do the same to
the same bits where plant, robot and law offer them; one call of `next` for a part of a tick costs a fraction of what it
costs to pass all their arrays to a function.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import suppress
from typing import Any, cast

import numpy as np

from hilrig.core.compiler import can_be_composed
from hilrig.core.errors import Tripped
from hilrig.core.signals import Command, Measurement
from hilrig.experiment.trial import Trial, start_joint_position
from hilrig.loop.compiled.control import control_answers, control_rig, control_track
from hilrig.loop.compiled.plant import PlantRig, plant_rig, plant_ticks, plant_track
from hilrig.loop.compiled.rows import StateRows
from hilrig.loop.compiled.trial import in_one_piece, why_unsafe
from hilrig.loop.tick import Answer, ControlSide, PlantSide, not_finite
from hilrig.loop.tick import warm_up_control as first_answer
from hilrig.recording.messages.codec import Codec
from hilrig.recording.messages.layouts import layouts
from hilrig.recording.messages.record_batch import RecordBatch


def write(batch: RecordBatch, row: int, tick: int, trial: Trial, values: tuple[Any, ...]) -> None:
    """Write a message of a tick into a row of a batch."""
    for field, value in zip(batch.fields, (tick, tick * trial.period, *values), strict=True):
        field[row] = value


def internals(answer: Answer) -> tuple[Any, ...]:
    """Return what Internals.msg says of an answer."""
    state = answer.state
    return (state.position, state.velocity, state.force, *answer.reference, *map(np.ravel, answer.memory))


class DriverNode:
    """The driver's half: what it measures is on the batches of state and, for a simulated plant, truth."""

    def __init__(
        self, trial: Trial, codecs: Mapping[str, Codec], batches: Mapping[str, RecordBatch], rows: int
    ) -> None:
        self.trial, self._sheets, self._rows = trial, batches, rows
        self._side = PlantSide(trial)
        self.plant = self._side.plant
        self._codec = codecs["command"]
        # Two rows: an array with one row is of another type to numba.
        self._heard = RecordBatch(self._codec, 2)
        self._rig: PlantRig | None = None
        self._parts: Iterator[bool] | None = None
        self.truthful = False
        """Whether the plant knows the truth about itself"""

    def measure(self, tick: int) -> tuple[()]:
        """Measure at `tick` into the batches' row `tick` modulo their length. Raises Tripped."""
        if self._parts is None:
            self._measure(tick)
        elif not next(self._parts):
            assert self._rig is not None
            raise Tripped(why_unsafe(self._side, self._rig, tick))
        return ()

    def _measure(self, tick: int) -> None:
        measurement, truth = self._side.measure(tick)
        write(self._sheets["state"], tick % self._rows, tick, self.trial, measurement)
        if truth is not None:
            self.truthful = True
            write(self._sheets["truth"], tick % self._rows, tick, self.trial, truth)

    def advance(self, tick: int, command: bytes | None) -> None:
        """Let the period that begins at `tick` pass under a command message (None: the holding one)."""
        if self._parts is not None:
            if command is not None:
                self._heard.read(0, command)
            next(self._parts)
            return
        self._side.advance(tick, None if command is None else self._command(command))
        if hasattr(self.plant, "kernels"):
            self._compile(tick + 1, command)

    def _command(self, message: bytes) -> Command:
        return Command(*self._codec.unpack(message)[2:])

    def _compile(self, first: int, command: bytes | None) -> None:
        """Let kernels do the ticks from `first` on."""
        hold = self._side.hold
        assert hold is not None, "measure() comes first"
        write(self._heard, 0, 0, self.trial, hold)
        if command is not None:
            self._heard.read(0, command)
        torque, position = (field[0] for field in self._heard.fields[2:])
        self._rig = plant_rig(self._side)
        self._parts = plant_ticks(
            cast(Any, self.plant).kernels(), first, self.trial.ticks, self._rig, plant_track(self._sheets),
            Command(torque, position),
        )  # fmt: skip

    def close(self) -> None:
        """Release the plant."""
        self._side.close()


class ControllerNode:
    """The controller's half: its answers are on the batches of command and internals, row by row."""

    def __init__(
        self, trial: Trial, codecs: Mapping[str, Codec], batches: Mapping[str, RecordBatch], rows: int
    ) -> None:
        self._trial, self._sheets, self._rows = trial, batches, rows
        self._side = ControlSide(trial)
        self._codec = codecs["state"]
        self._heard = RecordBatch(self._codec, 2)
        self._next_row = 0
        self._answers: Iterator[bool] | None = None
        self._wished = np.zeros(trial.driver.robot.joints)

    def answer(self, message: bytes) -> int:
        """Answer a state message; return the row of the answer. Raises Tripped, PluginError."""
        row = self._next_row
        self._next_row = (row + 1) % self._rows
        if self._answers is None:
            self._answer(row, message)
            return row
        self._heard.read(0, message)
        if not next(self._answers):
            tick = int.from_bytes(message[4:12], "little")
            raise Tripped(not_finite(tick, self._trial.controller_name, self._wished))
        return row

    def _answer(self, row: int, message: bytes) -> None:
        tick, _, *fields = self._codec.unpack(message)
        answer = self._side.control(tick, Measurement(*fields))
        write(self._sheets["command"], row, tick, self._trial, answer.command)
        write(self._sheets["internals"], row, tick, self._trial, internals(answer))
        law = self._side.law
        assert law is not None, "the first answer starts the law"
        if in_one_piece(self._side) and can_be_composed(law.step):
            rig = control_rig(self._side, answer)
            self._wished = rig.wished
            robot = cast(Any, self._trial.driver.robot).kernels()
            heard = StateRows(*self._heard.fields)
            self._answers = control_answers(robot, law, self._next_row, rig, control_track(self._sheets), heard)


def warm_up_plant(trial: Trial, codecs: Mapping[str, Codec]) -> None:
    """Do the first tick of the driver's half beside the trial: kernels are loaded or compiled before time counts."""
    half = DriverNode(trial, codecs, {name: RecordBatch(codecs[name], 2) for name in ("state", "truth")}, 2)
    try:
        for tick in range(min(2, trial.ticks) if hasattr(half.plant, "kernels") else 1):
            half.measure(tick)
            half.advance(tick, None)
    except Tripped:
        pass  # so will the trial itself, and tell
    finally:
        half.close()


def warm_up_control(trial: Trial) -> dict[str, int]:
    """Answer as the controller's half beside the trial; return the length of every field of the law's memory."""
    memory = first_answer(trial)
    codecs = layouts(trial.driver.robot.joints, len(trial.axes), memory)
    half = ControllerNode(trial, codecs, {name: RecordBatch(codecs[name], 2) for name in ("command", "internals")}, 2)
    at_rest = (start_joint_position(trial), np.zeros(6), np.zeros(trial.driver.robot.joints))
    with suppress(Tripped):  # so will the trial itself, and tell
        for tick in range(min(2, trial.ticks)):
            half.answer(codecs["state"].pack((tick, tick * trial.period, *at_rest)))
    return memory
