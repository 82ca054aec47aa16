"""One tick of a trial in one process, as templates of kernels: the same tick as in `loop`, to the same bits.

`sense` and `act` are the two sides of a law within one tick. They are compiled with the kernels of the plant and the
robot in them. `run` is the loop around them and the law: compiled, too, if the law is a kernel; plain Python if not.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from hilrig.kernel import jitable
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
    row, now = track.done[0], nudge(rig.inputs, tick)
    exact = rig.sight
    track.surface[row] = plant_observe(plant, state, now, exact)
    finite, force, step = extent(exact.joint_position, rig.last_exact, exact.wrench)
    if not finite or force > rig.tip_force_limit or step / rig.period > rig.joint_velocity_limit:
        return False
    put(rig.last_exact, exact.joint_position)
    slot = tick % rig.past.joint_position.shape[0]
    put(rig.past.joint_position[slot], exact.joint_position)
    put(rig.past.wrench[slot], exact.wrench)
    put(rig.past.applied_torque[slot], exact.applied_torque)
    slot = (tick - min(int(rig.inputs.measurement_delay[tick]), tick)) % rig.past.joint_position.shape[0]
    seen, q, wrench = rig.seen, track.state.joint_position[row], track.state.wrench[row]
    for i in range(q.size):
        q[i] = rig.past.joint_position[slot, i] + rig.inputs.joint_error[tick, i]
    for i in range(wrench.size):
        wrench[i] = rig.past.wrench[slot, i] + rig.inputs.wrench_error[tick, i]
    put(track.state.applied_torque[row], rig.past.applied_torque[slot])
    put(track.truth.joint_position[row], exact.joint_position)
    put(track.truth.joint_velocity[row], exact.joint_velocity)
    put(track.truth.position[row], exact.position)
    put(track.truth.velocity[row], exact.velocity)
    put(track.truth.wrench[row], exact.wrench)
    track.done[0] = row + 1
    filter_velocity(rig.seen.joint_velocity, q, seen.joint_position, rig.period, rig.smoothing)
    put(seen.joint_position, q)
    robot_kinematics(robot, q, seen.joint_velocity, rig.at)
    for i in range(seen.force.size):
        seen.force[i] = wrench[rig.force_index[i]]
    put(rig.wanted.position, rig.references.position[tick])
    put(rig.wanted.velocity, rig.references.velocity[tick])
    put(rig.wanted.acceleration, rig.references.acceleration[tick])
    put(rig.wanted.force, rig.references.force[tick])
    return True


def act_template(
    tick: int, wished: Array, memory: tuple[Array, ...], plant: Any, state: Array, rig: Rig, track: Track
) -> bool:
    """Let the law's torque, limited, take effect after its delay; return whether it was finite."""
    row, seen, torque = track.done[1], rig.seen, rig.seen.torque
    put(rig.wished, wished)
    if not limit(torque, wished, rig.torque_limit):
        return False
    slots = rig.commands.torque.shape[0]
    slot = tick % slots
    position = rig.commands.position[slot]
    put(rig.commands.torque[slot], torque)
    for i in range(torque.size):
        position[i] = seen.joint_position[i] + torque[i] / rig.k_ref if rig.k_ref != 0.0 else seen.joint_position[i]
    put(track.command.torque[row], torque)
    put(track.command.position[row], position)
    put(track.position[row], seen.position)
    put(track.velocity[row], seen.velocity)
    put(track.force[row], seen.force)
    put(track.reference.position[row], rig.wanted.position)
    put(track.reference.velocity[row], rig.wanted.velocity)
    put(track.reference.acceleration[row], rig.wanted.acceleration)
    put(track.reference.force[row], rig.wanted.force)
    column = 0
    for field in memory:
        put(track.memory[row, column:], field)
        column += field.size
    track.done[1] = row + 1
    due = (tick - rig.delay) % slots
    plant_advance(plant, state, nudge(rig.inputs, tick), rig.commands.torque[due], rig.commands.position[due])
    return True


@jitable
def put(row: Array, values: Array) -> None:
    """row[:] = values, element by element: a fraction of what numba makes of an assignment between arrays."""
    for i in range(values.size):
        row[i] = values[i]


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
