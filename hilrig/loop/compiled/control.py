"""The controller's half of a tick as kernels: the same as `ControlSide` in `loop`, to the same bits."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Any, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from hilrig.core.compiler import composed, jitable, kernel_without_arrays
from hilrig.core.interfaces import Law
from hilrig.core.kernel_interfaces import RobotKernels
from hilrig.core.signals import Array, Kinematics, Reference, State
from hilrig.loop.compiled.plant import put
from hilrig.loop.compiled.rows import CommandRows, InternalsRows, StateRows
from hilrig.loop.tick import Answer, ControlSide, filter_velocity, limit
from hilrig.recording.messages.record_batch import RecordBatch


class ControlRig(NamedTuple):
    """What surrounds a law during a trial. Arrays change in place."""

    references: Reference
    period: float
    """s"""
    smoothing: float
    """a of the velocity filter"""
    k_ref: float
    """Of eq. (26), N m/rad; 0 for a plant that takes torques"""
    force_index: Array
    """Where the task axes are in a wrench, (m,) whole numbers"""
    torque_limit: Array
    seen: State
    """What the law is given. Between two ticks: joint position, filtered velocity and torque of the tick before"""
    at: Kinematics
    """The arrays in `seen` that follow from the kinematics"""
    wanted: Reference
    wished: Array
    """What the law asked for last, before limits, (n,)"""
    last_tick: NDArray[np.int64]
    """(1,): of the measurement before"""


class ControlTrack(NamedTuple):
    """What is recorded of the controller, one row for each answer."""

    command: CommandRows
    internals: InternalsRows
    done: NDArray[np.int64]
    """(1,): rows that are written"""


# What `composed` puts in the place of these names.
robot_kinematics: Callable[[Any, Array, Array, Kinematics], None] = cast(Any, None)
observe: Callable[..., float] = cast(Any, None)
law_step: Callable[[Any, Any, State, Reference], Array] = cast(Any, None)


def observe_template(tick: int, q: Array, wrench: Array, robot: Any, rig: ControlRig) -> float:
    """Fill in what the law is given, from joint positions (n,) and wrench (6,); return the elapsed time, s."""
    seen, wanted = rig.seen, rig.wanted
    # In real time a tick can be missed: a difference over two periods is no rate over one.
    gap = max(tick - rig.last_tick[0], 1)
    rig.last_tick[0] = tick
    elapsed = gap * rig.period
    smoothing = rig.smoothing if gap == 1 else 1.0 - (1.0 - rig.smoothing) ** float(gap)
    filter_velocity(seen.joint_velocity, q, seen.joint_position, elapsed, smoothing)
    put(seen.joint_position, q)
    robot_kinematics(robot, q, seen.joint_velocity, rig.at)
    for i in range(seen.force.size):
        seen.force[i] = wrench[rig.force_index[i]]
    put(wanted.position, rig.references.position[tick])
    put(wanted.velocity, rig.references.velocity[tick])
    put(wanted.acceleration, rig.references.acceleration[tick])
    put(wanted.force, rig.references.force[tick])
    return elapsed


@jitable
def since(elapsed: float, seen: State) -> State:
    """Return the state with another elapsed time, s."""
    return State(
        seen.joint_position, seen.joint_velocity, seen.position, seen.velocity, seen.jacobian, seen.jacobian_rate,
        seen.regressor, seen.force, seen.torque, elapsed,
    )  # fmt: skip


@kernel_without_arrays
def answer(tick: int, wished: Array, memory: tuple[Array, ...], rig: ControlRig, track: ControlTrack) -> bool:
    """Write command and internals into the track's next row; return whether the law's torque is finite."""
    row = track.done[0]
    put(rig.wished, wished)
    if not limit(rig.seen.torque, wished, rig.torque_limit):
        return False
    track.command.tick[row] = track.internals.tick[row] = tick
    track.command.time[row] = track.internals.time[row] = tick * rig.period
    for i in range(rig.seen.torque.size):
        q, torque = rig.seen.joint_position[i], rig.seen.torque[i]
        track.command.torque[row, i] = torque
        track.command.position[row, i] = q + torque / rig.k_ref if rig.k_ref != 0.0 else q
    note_law(row, rig, memory, track.internals)
    track.done[0] = row + 1
    return True


@kernel_without_arrays
def note_law(row: int, rig: ControlRig, memory: tuple[Array, ...], internals: InternalsRows) -> None:
    """Write what the law was given, and what it remembers now, into a row."""
    put(internals.position[row], rig.seen.position)
    put(internals.velocity[row], rig.seen.velocity)
    put(internals.force[row], rig.seen.force)
    put(internals.reference_position[row], rig.wanted.position)
    put(internals.reference_velocity[row], rig.wanted.velocity)
    put(internals.reference_acceleration[row], rig.wanted.acceleration)
    put(internals.reference_force[row], rig.wanted.force)
    column = 0
    for field in memory:
        put(internals.memory[row, column:], field)
        column += field.size


def control_template(
    row: int, parameters: Any, memory: Any, fields: tuple[Array, ...], robot: Any, rig: ControlRig,
    track: ControlTrack, heard: StateRows,
) -> Iterator[bool]:  # fmt: skip
    """Answer the measurement in the first row of `heard` at every turn; yield whether the torque is finite.

    Row by row the track is written, beginning with `row`, from its first row again after its last.
    """
    rows = track.command.tick.size
    while True:
        tick = int(heard.tick[0])
        track.done[0] = row
        elapsed = observe(tick, heard.joint_position[0], heard.wrench[0], robot, rig)
        wished = law_step(parameters, memory, since(elapsed, rig.seen), rig.wanted)
        yield answer(tick, wished, fields, rig, track)
        row = (row + 1) % rows


def observing(kernels: RobotKernels) -> Callable[..., float]:
    """Return `observe_template` with this robot in it."""
    return composed(observe_template, makes_arrays=False, robot_kinematics=kernels.kinematics)


def control_answers(
    kernels: RobotKernels, law: Law, row: int, rig: ControlRig, track: ControlTrack, heard: StateRows
) -> Iterator[bool]:
    """Return `control_template` at work: one call of `next` for each measurement."""
    answers = composed(control_template, observe=observing(kernels), law_step=law.step)
    return answers(row, law.parameters, law.memory, memory_fields(law), kernels.constants, rig, track, heard)


def memory_fields(law: Law) -> tuple[Array, ...]:
    """Return views of the law's memory, all of one type, so that a kernel can go through them."""
    return tuple(field.reshape(-1) for field in law.memory) or (np.zeros(0),)


def control_rig(control: ControlSide, first: Answer) -> ControlRig:
    """Return what surrounds the law of a trial whose first measurement has been answered by `control`."""
    trial = control.trial
    # What the halves of `loop` made may be read by others still; here the arrays change at the next tick.
    seen = copied(first.state)._replace(torque=first.command.torque.copy(), elapsed=trial.period)
    at = Kinematics(seen.position, seen.velocity, seen.jacobian, seen.jacobian_rate, seen.regressor)
    return ControlRig(
        control.references, trial.period, control.smoothing, trial.driver.servo_gain or 0.0, control.force_index,
        control.task.torque_limit, seen, at, Reference(*(part.copy() for part in first.reference)),
        np.zeros(seen.torque.size), np.array([control.last_tick]),
    )  # fmt: skip


def copied(state: State) -> State:
    """Return the state with arrays of its own."""
    return State._make(part.copy() if isinstance(part, np.ndarray) else part for part in state)


def control_track(batches: Mapping[str, RecordBatch]) -> ControlTrack:
    """Return the track that is written into the batches of command and internals."""
    command, internals = CommandRows(*batches["command"].fields), InternalsRows.of(batches["internals"])
    return ControlTrack(command, internals, np.zeros(1, dtype=np.int64))
