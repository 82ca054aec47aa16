"""One tick of a trial in one process, as templates of kernels: the same tick as in `loop`, to the same bits.

`sense` and `act` are the two sides of a law within one tick. They are compiled with the kernels of the plant and the
robot in them. `run` is the loop around them and the law: compiled, too, if the law is a kernel; plain Python if not.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from hilrig.kernel import kernel_without_arrays
from hilrig.kernel_interfaces import Sight
from hilrig.loop import filter_velocity, limit
from hilrig.safety import extent
from hilrig.signals import Array, Command, Inputs, Kinematics, Measurement, Nudge, Reference, State, nudge


class Rig(NamedTuple):
    """What surrounds a law during a trial: limits, sensors, filters and delays. Arrays change in place."""

    inputs: Inputs
    references: Reference
    tip_force_limit: float
    """N"""
    joint_velocity_limit: float
    """rad/s"""
    period: float
    """s"""
    smoothing: float
    """a of the velocity filter"""
    k_ref: float
    """Of eq. (26), N m/rad; 0 for a plant that takes torques"""
    force_index: Array
    """Where the task axes are in a wrench, (m,) whole numbers"""
    torque_limit: Array
    last_exact: Array
    """Joint positions at the tick before, without sensor errors, (n,)"""
    seen: State
    """What the law is given. Between two ticks: joint position, filtered velocity and torque of the tick before"""
    at: Kinematics
    """The arrays in `seen` that follow from the kinematics"""
    wanted: Reference
    sight: Sight
    """What is to be seen of the plant now"""
    past: Measurement
    """The last exact measurements, by tick modulo their number D: arrays (D, n), (D, 6), (D, n)"""
    commands: Command
    """The last commands, by tick modulo their number: arrays (delay + 1, n)"""
    delay: int
    """Ticks from a measurement to its command's effect"""
    wished: Array
    """What the law asked for last, before limits, (n,)"""


class Track(NamedTuple):
    """What is recorded of a block of ticks, one row for each."""

    state: Measurement
    truth: Sight
    """But for the surface and the torque"""
    surface: Array
    """Where the surface is, (rows,) m"""
    command: Command
    position: Array
    velocity: Array
    force: Array
    reference: Reference
    memory: Array
    """All fields of the law's memory, one behind the other"""
    done: NDArray[np.int64]
    """(2,): rows of state and truth, rows of the rest"""


class Block(NamedTuple):
    """Ticks that were done at one call."""

    first: int
    """The first tick"""
    track: Track


# What `composed` puts in the place of these names.
plant_observe: Callable[[Any, Array, Nudge, Sight], float] = cast(Any, None)
plant_advance: Callable[[Any, Array, Nudge, Array, Array], None] = cast(Any, None)
robot_kinematics: Callable[[Any, Array, Array, Kinematics], None] = cast(Any, None)
sense: Callable[..., bool] = cast(Any, None)
act: Callable[..., bool] = cast(Any, None)
law_step: Callable[[Any, Any, State, Reference], Array] = cast(Any, None)


def sense_template(tick: int, plant: Any, state: Array, robot: Any, rig: Rig, track: Track) -> bool:
    """Measure at `tick`, fill in what the law is given, and return whether it is safe to go on."""
    row, exact, seen, wanted = track.done[0], rig.sight, rig.seen, rig.wanted
    track.surface[row] = plant_observe(plant, state, nudge(rig.inputs, tick), exact)
    finite, force, step = extent(exact.joint_position, rig.last_exact, exact.wrench)
    if not finite or force > rig.tip_force_limit or step / rig.period > rig.joint_velocity_limit:
        return False
    put(rig.last_exact, exact.joint_position)
    report(tick, row, rig, track)
    note_truth(row, exact, track.truth)
    track.done[0] = row + 1
    q, wrench = track.state.joint_position[row], track.state.wrench[row]
    filter_velocity(seen.joint_velocity, q, seen.joint_position, rig.period, rig.smoothing)
    put(seen.joint_position, q)
    robot_kinematics(robot, q, seen.joint_velocity, rig.at)
    for i in range(seen.force.size):
        seen.force[i] = wrench[rig.force_index[i]]
    put(wanted.position, rig.references.position[tick])
    put(wanted.velocity, rig.references.velocity[tick])
    put(wanted.acceleration, rig.references.acceleration[tick])
    put(wanted.force, rig.references.force[tick])
    return True


def act_template(
    tick: int, wished: Array, memory: tuple[Array, ...], plant: Any, state: Array, rig: Rig, track: Track
) -> bool:
    """Let the law's torque, limited, take effect after its delay; return whether it was finite."""
    row, slots = track.done[1], rig.commands.torque.shape[0]
    put(rig.wished, wished)
    if not limit(rig.seen.torque, wished, rig.torque_limit):
        return False
    slot, due = tick % slots, (tick - rig.delay) % slots
    command(rig, rig.commands.torque[slot], rig.commands.position[slot])
    put(track.command.torque[row], rig.commands.torque[slot])
    put(track.command.position[row], rig.commands.position[slot])
    note_law(row, rig, memory, track)
    track.done[1] = row + 1
    plant_advance(plant, state, nudge(rig.inputs, tick), rig.commands.torque[due], rig.commands.position[due])
    return True


@kernel_without_arrays
def put(row: Array, values: Array) -> None:
    """row[:] = values, element by element: a fraction of what numba makes of an assignment between arrays."""
    for i in range(values.size):
        row[i] = values[i]


@kernel_without_arrays
def report(tick: int, row: int, rig: Rig, track: Track) -> None:
    """Write what the sensors report into row `row` of the track: the measurement of some ticks ago, and errors."""
    past, depth = rig.past, rig.past.joint_position.shape[0]
    slot = tick % depth
    put(past.joint_position[slot], rig.sight.joint_position)
    put(past.wrench[slot], rig.sight.wrench)
    put(past.applied_torque[slot], rig.sight.applied_torque)
    slot = (tick - min(int(rig.inputs.measurement_delay[tick]), tick)) % depth
    for i in range(past.joint_position.shape[1]):
        track.state.joint_position[row, i] = past.joint_position[slot, i] + rig.inputs.joint_error[tick, i]
    for i in range(past.wrench.shape[1]):
        track.state.wrench[row, i] = past.wrench[slot, i] + rig.inputs.wrench_error[tick, i]
    put(track.state.applied_torque[row], past.applied_torque[slot])


@kernel_without_arrays
def note_truth(row: int, exact: Sight, truth: Sight) -> None:
    """Write the true state into row `row` of `truth`."""
    put(truth.joint_position[row], exact.joint_position)
    put(truth.joint_velocity[row], exact.joint_velocity)
    put(truth.position[row], exact.position)
    put(truth.velocity[row], exact.velocity)
    put(truth.wrench[row], exact.wrench)


@kernel_without_arrays
def command(rig: Rig, torque: Array, position: Array) -> None:
    """Write the command: the torque (n,) within its limits, and the joint reference (n,) of eq. (26)."""
    for i in range(torque.size):
        q = rig.seen.joint_position[i]
        torque[i] = rig.seen.torque[i]
        position[i] = q + torque[i] / rig.k_ref if rig.k_ref != 0.0 else q


@kernel_without_arrays
def note_law(row: int, rig: Rig, memory: tuple[Array, ...], track: Track) -> None:
    """Write what the law was given, and what it remembers now, into row `row` of the track."""
    put(track.position[row], rig.seen.position)
    put(track.velocity[row], rig.seen.velocity)
    put(track.force[row], rig.seen.force)
    put(track.reference.position[row], rig.wanted.position)
    put(track.reference.velocity[row], rig.wanted.velocity)
    put(track.reference.acceleration[row], rig.wanted.acceleration)
    put(track.reference.force[row], rig.wanted.force)
    column = 0
    for field in memory:
        put(track.memory[row, column:], field)
        column += field.size


def run_template(
    first: int, last: int, parameters: Any, memory: Any, fields: tuple[Array, ...], plant: Any, state: Array,
    robot: Any, rig: Rig, track: Track,
) -> int:  # fmt: skip
    """Do the ticks from `first` to `last` - 1; return how far it came: `last`, or the tick at which it had to stop."""
    seen, wanted = rig.seen, rig.wanted
    for tick in range(first, last):
        if not sense(tick, plant, state, robot, rig, track):
            return tick
        wished = law_step(parameters, memory, seen, wanted)
        if not act(tick, wished, fields, plant, state, rig, track):
            return tick
    return last
