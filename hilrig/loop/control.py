"""The controller's part of a tick: observe, call the law, limit its torque, record.

Written once, over arrays that are filled in place. If robot and law offer kernels it is compiled with them, many ticks
per call (`whole_trial`) or one at a time (`controller_template`); if they are plain Python it is interpreted.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from hilrig.core.compiler import assembled, jitable, kernel, kernel_without_arrays
from hilrig.core.kernel_interfaces import RobotKernels
from hilrig.core.signals import WRENCH_AXES, Array, Kinematics, Reference, State
from hilrig.experiment.trial import Trial, references, start_joint_position
from hilrig.kinds.actuation import position_reference
from hilrig.loop.envelope import NOT_FINITE, Envelope, bound_torque, envelope
from hilrig.loop.rows import ControllerRows, StateRows, put


class ControllerArrays(NamedTuple):
    """The data around a law during a trial. The arrays change in place."""

    references: Reference
    """References of all ticks, arrays (N, m)"""
    period: float
    """s"""
    smoothing: float
    """a of the velocity filter"""
    k_ref: float
    """k_ref of eq. (26), N m/rad; 0 for a plant that takes torques"""
    force_index: NDArray[np.int64]
    """Indices of the task axes in a wrench, (m,)"""
    within: Envelope
    """Of the commands"""
    call_when_stale: bool
    """Whether the law is also called where the sample is not fresh"""
    last_tick: NDArray[np.int64]
    """Ticks of the last fresh sample and of the law's last call, (2,)"""
    last_stamp: Array
    """Stamp of the last fresh sample, (1,) s; nan if it had none"""
    position: Array
    """Last measured q, (n,) rad"""
    velocity: Array
    """q', filtered, (n,) rad/s"""
    force: Array
    """Last measured F_e, (m,) N"""
    torque: Array
    """Last commanded torque, after limits, (n,) N m"""
    seen: State
    """What the law receives. Rewritten before every call, so that what a law writes into it reaches nobody else"""
    at: Kinematics
    """The arrays in `seen` that follow from the kinematics"""
    wanted: Reference
    """The law's reference, rewritten at every tick"""
    asked: Array
    """Last torque that the law returned, before limits, (n,) N m"""
    asked_size: NDArray[np.int64]
    """Number of torques that it returned, (1,)"""


# `assembled` replaces these names.
robot_kinematics: Callable[[Any, Array, Array, Kinematics], None] = cast(Any, None)
observe: Callable[..., float] = cast(Any, None)
hear: Callable[..., float] = cast(Any, None)
law_step: Callable[[Any, Any, State, Reference], Array] = cast(Any, None)


def observe_template(
    tick: int, q: Array, wrench: Array, stamp: float, fresh: bool, robot: Any, arrays: ControllerArrays,
    rows: ControllerRows,
) -> float:  # fmt: skip
    """Compute what the law receives from joint positions (n,) and wrench (6,), and record it in the next row.

    Where the sample is not `fresh`, that is the last one again. Returns the time since the law's last call, s.
    """
    elapsed = follow(tick, q, wrench, stamp, arrays) if fresh else repeat(tick, arrays)
    show(tick, arrays)
    robot_kinematics(robot, arrays.position, arrays.velocity, arrays.at)
    # Before the answer, because a law that is a kernel may write into its arguments.
    note_given(tick, arrays, rows)
    return elapsed


@kernel_without_arrays
def follow(tick: int, q: Array, wrench: Array, stamp: float, arrays: ControllerArrays) -> float:
    """Take in a fresh sample; return the time since the law's last call, s."""
    # A sample can be missed: a difference over two periods must not be divided by one.
    gap = float(max(tick - arrays.last_tick[0], 1))
    called, elapsed = (tick - arrays.last_tick[1]) * arrays.period, gap * arrays.period
    if stamp > arrays.last_stamp[0]:  # false where there is no stamp
        elapsed = stamp - arrays.last_stamp[0]
        gap = elapsed / arrays.period
    arrays.last_tick[:] = tick
    arrays.last_stamp[0] = stamp
    smoothing = arrays.smoothing if gap == 1.0 else 1.0 - (1.0 - arrays.smoothing) ** gap
    filter_velocity(arrays.velocity, q, arrays.position, elapsed, smoothing)
    put(arrays.position, q)
    for i in range(arrays.force.size):
        arrays.force[i] = wrench[arrays.force_index[i]]
    return called if arrays.call_when_stale and called > 0.0 else elapsed


@kernel_without_arrays
def repeat(tick: int, arrays: ControllerArrays) -> float:
    """Keep the last fresh sample; return the time since the law's last call, s."""
    elapsed = (tick - arrays.last_tick[1]) * arrays.period
    arrays.last_tick[1] = tick
    return elapsed


@kernel_without_arrays
def show(tick: int, arrays: ControllerArrays) -> None:
    """Write the last sample and the reference of a tick into what the law receives."""
    seen, wanted = arrays.seen, arrays.wanted
    put(seen.joint_position, arrays.position)
    put(seen.joint_velocity, arrays.velocity)
    put(seen.torque, arrays.torque)
    put(seen.force, arrays.force)
    put(wanted.position, arrays.references.position[tick])
    put(wanted.velocity, arrays.references.velocity[tick])
    put(wanted.acceleration, arrays.references.acceleration[tick])
    put(wanted.force, arrays.references.force[tick])


@kernel
def filter_velocity(velocity: Array, q: Array, last_q: Array, period: float, smoothing: float) -> None:
    """Advance q' by one sample, in place: q' += a ((q - q_prev)/l - q'), a = 1 - exp(-2 pi f_c l)."""
    for i in range(velocity.size):
        velocity[i] += smoothing * ((q[i] - last_q[i]) / period - velocity[i])


@jitable
def since(elapsed: float, seen: State) -> State:
    """Return the state with another elapsed time, s, because a number in a tuple cannot be written in place."""
    return State(
        seen.joint_position, seen.joint_velocity, seen.position, seen.velocity, seen.jacobian, seen.jacobian_rate,
        seen.regressor, seen.force, seen.torque, elapsed,
    )  # fmt: skip


@kernel_without_arrays
def note_given(tick: int, arrays: ControllerArrays, rows: ControllerRows) -> None:
    """Write what the law receives into the next row."""
    internals, row = rows.internals, rows.written[0]
    internals.tick[row] = tick
    internals.time[row] = tick * arrays.period
    put(internals.position[row], arrays.seen.position)
    put(internals.velocity[row], arrays.seen.velocity)
    put(internals.force[row], arrays.seen.force)
    put(internals.reference_position[row], arrays.wanted.position)
    put(internals.reference_velocity[row], arrays.wanted.velocity)
    put(internals.reference_acceleration[row], arrays.wanted.acceleration)
    put(internals.reference_force[row], arrays.wanted.force)


@kernel_without_arrays
def answer(tick: int, asked: Array, memory: tuple[Array, ...], arrays: ControllerArrays, rows: ControllerRows) -> bool:
    """Limit the law's torque; write command and memory into the next row. Returns False if it cannot be commanded."""
    row = rows.written[0]
    arrays.asked_size[0] = asked.size
    if asked.size != arrays.asked.size:
        return False
    put(arrays.asked, asked)
    limited = bound_torque(arrays.torque, asked, arrays.within.torque)
    if limited & (arrays.within.trips | NOT_FINITE):
        return False
    rows.command.limited[row] = limited
    rows.command.tick[row] = tick
    rows.command.time[row] = tick * arrays.period
    for i in range(arrays.torque.size):
        q, torque = arrays.position[i], arrays.torque[i]
        rows.command.torque[row, i] = torque
        rows.command.position[row, i] = position_reference(torque, q, arrays.k_ref)
        rows.command.asked[row, i] = arrays.asked[i]
    column = 0
    for field in memory:
        put(rows.internals.memory[row, column:], field)
        column += field.size
    rows.written[0] = row + 1
    return True


def hear_template(heard: StateRows, robot: Any, arrays: ControllerArrays, rows: ControllerRows) -> float:
    """Compute what the law receives from the measurement in the first row of `heard`; return what `observe` does."""
    return observe(
        int(heard.tick[0]), heard.joint_position[0], heard.wrench[0], heard.stamp[0], heard.fresh[0] != 0, robot,
        arrays, rows,
    )  # fmt: skip


def controller_template(
    parameters: Any, memory: Any, fields: tuple[Array, ...], robot: Any, arrays: ControllerArrays,
    rows: ControllerRows, heard: StateRows,
) -> Iterator[bool]:  # fmt: skip
    """Answer the measurement in the first row of `heard` at every step; yield whether the answer can be commanded.

    Each answer is written into the next row; after the last row comes the first again. Where the sample is not fresh
    nothing is differentiated, and the last command is repeated unless the law is to be called all the same.
    """
    row, count = 0, rows.command.tick.size
    while True:
        tick = int(heard.tick[0])
        rows.written[0] = row
        elapsed = hear(heard, robot, arrays, rows)
        if heard.fresh[0] != 0 or arrays.call_when_stale:
            asked = law_step(parameters, memory, since(elapsed, arrays.seen), arrays.wanted)
            yield answer(tick, asked, fields, arrays, rows)
        else:
            yield answer(tick, arrays.asked, fields, arrays, rows)
        row = (row + 1) % count


def observing(kernels: RobotKernels) -> Callable[..., float]:
    """Return `observe_template` with this robot filled in."""
    return assembled(observe_template, makes_arrays=False, robot_kinematics=kernels.kinematics)


def controller_arrays(trial: Trial) -> ControllerArrays:
    """Return the data around the law of a trial, before the first measurement."""
    robot = trial.driver.robot
    n, m, start = robot.joints, len(trial.axes), start_joint_position(trial)
    at = Kinematics(*(np.array(part) for part in robot.kinematics(start, np.zeros(n))))
    seen = State(
        np.zeros(n), np.zeros(n), at.position, at.velocity, at.jacobian, at.jacobian_rate, at.regressor,
        np.zeros(m), np.zeros(n), trial.period,
    )  # fmt: skip
    force_index = np.array([WRENCH_AXES.index(axis) for axis in robot.axes])
    return ControllerArrays(
        references(trial), trial.period, trial.velocity_smoothing, trial.driver.servo_gain or 0.0, force_index,
        envelope(trial), trial.task.on_stale_sample == "call", np.zeros(2, np.int64),
        np.full(1, np.nan), start.copy(), np.zeros(n), np.zeros(m), np.zeros(n), seen, at,
        Reference(*(np.zeros(m) for _ in Reference._fields)), np.zeros(n), np.zeros(1, np.int64),
    )  # fmt: skip
