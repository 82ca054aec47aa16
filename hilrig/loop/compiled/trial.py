"""A whole trial in one process, many ticks at a call: both halves, the law between them, and the loop around them.

The loop is compiled, too, if the law is a kernel; it is plain Python if not.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from hilrig.core.compiler import can_be_composed, composed, filled
from hilrig.core.errors import Tripped
from hilrig.core.interfaces import Law
from hilrig.core.kernel_interfaces import PlantKernels, RobotKernels
from hilrig.core.signals import Array, Command, PlantDisturbance, Reference, State, plant_disturbance
from hilrig.experiment.trial import Trial
from hilrig.loop.compiled.control import (
    ControlRig,
    ControlTrack,
    answer,
    control_rig,
    control_track,
    copied,
    memory_fields,
    observing,
    since,
)
from hilrig.loop.compiled.plant import PlantRig, PlantTrack, measuring, plant_rig, plant_track, put
from hilrig.loop.law_memory import memory_sizes
from hilrig.loop.safety import Monitor
from hilrig.loop.tick import Answer, ControlSide, Ending, PlantSide, checked, not_finite
from hilrig.recording.messages.layouts import layouts
from hilrig.recording.messages.record_batch import RecordBatch


class Rig(NamedTuple):
    """What surrounds plant and law, and the commands on their way between them."""

    plant: PlantRig
    control: ControlRig
    commands: Command
    """The last commands, by tick modulo their number: arrays (delay + 1, n)"""
    delay: int
    """Ticks from a measurement to its command's effect"""


class Track(NamedTuple):
    """What is recorded of a block of ticks, one row for each."""

    plant: PlantTrack
    control: ControlTrack


class Block(NamedTuple):
    """Ticks that were done at one call."""

    first: int
    """The first tick"""
    track: Track
    batches: dict[str, RecordBatch]
    """What the track was written into, by channel"""

    def messages(self) -> Iterator[tuple[str, NDArray[np.uint8]]]:
        """Yield (channel, messages (N, bytes)) of the block."""
        for name, batch in self.batches.items():
            yield name, batch.payloads[: self.written(name)]

    def written(self, channel: str) -> int:
        """Return how many rows of a channel's batch are written."""
        track = self.track.plant if channel in ("state", "truth") else self.track.control
        return int(track.done[0])


# What `composed` puts in the place of these names.
measure: Callable[..., bool] = cast(Any, None)
observe: Callable[..., float] = cast(Any, None)
plant_advance: Callable[[Any, Array, PlantDisturbance, Array, Array], None] = cast(Any, None)
sense: Callable[..., tuple[bool, float]] = cast(Any, None)
act: Callable[..., bool] = cast(Any, None)
law_step: Callable[[Any, Any, State, Reference], Array] = cast(Any, None)


def sense_template(tick: int, plant: Any, state: Array, robot: Any, rig: Rig, track: Track) -> tuple[bool, float]:
    """Measure at `tick`; return whether it is safe to go on, and the time since the law's last step, s."""
    row, reported = track.plant.done[0], track.plant.state
    if not measure(tick, plant, state, rig.plant, track.plant):
        return False, 0.0
    return True, observe(tick, reported.joint_position[row], reported.wrench[row], robot, rig.control)


def act_template(
    tick: int, wished: Array, memory: tuple[Array, ...], plant: Any, state: Array, rig: Rig, track: Track
) -> bool:
    """Let the law's torque, limited, take effect after its delay; return whether it was finite."""
    row, slots = track.control.done[0], rig.commands.torque.shape[0]
    if not answer(tick, wished, memory, rig.control, track.control):
        return False
    slot, due = tick % slots, (tick - rig.delay) % slots
    put(rig.commands.torque[slot], track.control.command.torque[row])
    put(rig.commands.position[slot], track.control.command.position[row])
    now = plant_disturbance(rig.plant.schedule, tick)
    plant_advance(plant, state, now, rig.commands.torque[due], rig.commands.position[due])
    return True


def run_template(
    first: int, last: int, parameters: Any, memory: Any, fields: tuple[Array, ...], plant: Any, state: Array,
    robot: Any, rig: Rig, track: Track,
) -> int:  # fmt: skip
    """Do the ticks from `first` to `last` - 1; return how far it came: `last`, or the tick at which it had to stop."""
    for tick in range(first, last):
        safe, elapsed = sense(tick, plant, state, robot, rig, track)
        if not safe:
            return tick
        wished = law_step(parameters, memory, since(elapsed, rig.control.seen), rig.control.wanted)
        if not act(tick, wished, fields, plant, state, rig, track):
            return tick
    return last


class CompiledTrial:
    """A trial whose first tick has been done by the halves of `loop`, which start plant and law; here come the rest."""

    def __init__(self, plant: PlantSide, control: ControlSide, first: Answer) -> None:
        law, trial = control.law, plant.trial
        assert law is not None, "the first tick starts the law"
        self._side, self._law, self._trial = plant, law, trial
        self.tick = 1
        self._plant: PlantKernels = cast(Any, plant.plant).kernels()
        self._robot: RobotKernels = cast(Any, trial.driver.robot).kernels()
        self._rig = _rig(plant, control, first)
        self._fields = memory_fields(law)
        memory = memory_sizes(law.memory, trial.controller_name)
        self._layouts = layouts(trial.driver.robot.joints, len(trial.axes), memory)
        self._run = _bound(trial, self._plant, self._robot, law)
        self.in_python = not can_be_composed(law.step)
        """Whether the law needs the interpreter at every tick; else other threads have it during a block"""
        self.recent = self._block(1, 0)

    def do(self, ticks: int) -> Ending | None:
        """Do up to so many ticks, which are then in `recent`; return how the trial ended, if it did."""
        first, last = self.tick, min(self.tick + ticks, self._trial.ticks)
        self.recent = self._block(first, last - first)
        law, plant = self._law, self._plant
        self.tick = self._run(
            first, last, law.parameters, law.memory, self._fields, plant.constants, plant.state,
            self._robot.constants, self._rig, self.recent.track,
        )  # fmt: skip
        if self.tick < last:
            return Ending("tripped", self._reason(), self.tick)
        return Ending("completed", "", last) if last == self._trial.ticks else None

    def _block(self, first: int, ticks: int) -> Block:
        # Two rows at least: an array with one row is of another type to numba.
        names = ("state", "truth", "command", "internals")
        batches = {name: RecordBatch(self._layouts[name], max(ticks, 2)) for name in names}
        return Block(first, Track(plant_track(batches), control_track(batches)), batches)

    def _reason(self) -> str:
        """Return why `run` stopped before the end of a block."""
        if self.recent.written("state") > self.recent.written("command"):
            return not_finite(self.tick, self._trial.controller_name, self._rig.control.wished)
        return why_unsafe(self._side, self._rig.plant, self.tick)


def why_unsafe(side: PlantSide, rig: PlantRig, tick: int) -> str:
    """Return why the measurement of `tick` ends the trial."""
    exact = side.plant.measure(plant_disturbance(rig.schedule, tick))
    try:
        Monitor(side.trial.limits, rig.period, rig.last_exact).check(tick, exact)
    except Tripped as trip:
        return str(trip)
    raise AssertionError("the compiled loop and the monitor disagree about the limits")


def warm_up(trial: Trial) -> None:
    """Compile or load the loop of a trial that can be compiled, beside the trial, before time counts."""
    plant, control = PlantSide(trial), ControlSide(trial)
    try:
        first = control.control(0, plant.measure(0)[0])
        if can_compile(plant, control):
            CompiledTrial(plant, control, first).do(0)
    except Tripped:
        pass  # so will the trial itself, and tell
    finally:
        plant.close()


def can_compile(plant: PlantSide, control: ControlSide) -> bool:
    """Return whether plant and robot offer kernels, and the law's memory can be recorded from where it lies."""
    return hasattr(plant.plant, "kernels") and in_one_piece(control)


def in_one_piece(control: ControlSide) -> bool:
    """Return whether the robot offers kernels, and the law's memory can be recorded from where it lies."""
    law = control.law
    offered = hasattr(control.trial.driver.robot, "kernels")
    return offered and law is not None and all(field.flags.c_contiguous for field in law.memory)


def _bound(trial: Trial, plant: PlantKernels, robot: RobotKernels, law: Law) -> Callable[..., int]:
    """Return `run_template` with the kernels of this plant and robot, and the law's step, in it."""
    sense = composed(sense_template, makes_arrays=False, measure=measuring(plant), observe=observing(robot))
    act = composed(act_template, makes_arrays=False, plant_advance=plant.advance)
    if can_be_composed(law.step):
        return composed(run_template, sense=sense, act=act, law_step=law.step)

    def step(parameters: Any, memory: Any, state: State, reference: Reference) -> Array:
        # A law in Python may keep what it is given; here the arrays change at the next tick.
        given = copied(state)
        return checked(law.step(parameters, memory, given, Reference(*(part.copy() for part in reference))), trial)

    return filled(run_template, sense=sense, act=act, law_step=step)


def _rig(plant: PlantSide, control: ControlSide, first: Answer) -> Rig:
    delay, hold = plant.trial.actuation_delay, plant.hold
    assert hold is not None, "measure() comes first"
    commands = Command(*(np.repeat(value[None, :], delay + 1, axis=0) for value in hold))
    for ring, value in zip(commands, first.command, strict=True):
        ring[0] = value
    return Rig(plant_rig(plant), control_rig(control, first), commands, delay)
