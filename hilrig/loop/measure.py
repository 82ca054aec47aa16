"""The driver's part of a tick: measure, check the safety limits, add the sensors' errors, record; then advance.

Written once, over arrays that are filled in place. If the plant offers kernels it is compiled with them, many ticks
per call (`whole_trial`) or one part of a tick at a time (`driver_ticks`); if it is plain Python it is interpreted.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from hilrig.core.compiler import assembled, kernel_without_arrays
from hilrig.core.kernel_interfaces import Observation, PlantKernels
from hilrig.core.signals import (
    Array,
    Command,
    DisturbanceSchedule,
    Measurement,
    PlantDisturbance,
    Truth,
    plant_disturbance,
)
from hilrig.experiment.trial import Trial, disturbance_schedule
from hilrig.loop.envelope import Envelope, bound, envelope
from hilrig.loop.rows import DriverRows, put
from hilrig.loop.safety import extremes


class DriverArrays(NamedTuple):
    """The data around a plant during a trial. The arrays change in place."""

    schedule: DisturbanceSchedule
    within: Envelope
    """Of the commands"""
    applied: Command
    """What the plant received last; the command that holds it, before the first tick"""
    limited: NDArray[np.int64]
    """Bits of `Limited` of the last command, (1,)"""
    joint_range: Array
    """Lowest and highest joint positions, (2, n) rad"""
    tip_range: Array
    """Lowest and highest position of the tip, (2, m) m"""
    tip_force_limit: float
    """N"""
    joint_velocity_limit: float
    """rad/s"""
    period: float
    """s"""
    clock: NDArray[np.int64]
    """The tick that comes next, and the number of ticks left out before it, (2,)"""
    last_position: Array
    """The plant's joint positions at the previous tick, without sensor errors, (n,) rad"""
    last_sample: Array
    """Tick and stamp (s) of the last fresh sample, (2,); nan if it had no stamp"""
    observation: Observation
    """What the plant reports now"""
    past: Measurement
    """The last D measurements, without sensor errors, indexed by tick modulo D: arrays (D, n), (D, 6), (D, n)"""
    past_samples: Array
    """Their stamps, s, and whether they were fresh, (D, 2)"""


# `assembled` replaces these names.
plant_observe: Callable[[Any, Array, PlantDisturbance, Observation], float] = cast(Any, None)
plant_advance: Callable[[Any, Array, PlantDisturbance, Array, Array], None] = cast(Any, None)
measure: Callable[..., bool] = cast(Any, None)
drive: Callable[..., bool] = cast(Any, None)
coast: Callable[..., None] = cast(Any, None)


def measure_template(tick: int, plant: Any, state: Array, arrays: DriverArrays, rows: DriverRows) -> bool:
    """Measure at `tick` and record the result in the next row; return whether it is safe to continue."""
    surface = plant_observe(plant, state, plant_disturbance(arrays.schedule, tick), arrays.observation)
    return note_measurement(tick, surface, arrays, rows)


@kernel_without_arrays
def note_measurement(tick: int, surface: float, arrays: DriverArrays, rows: DriverRows) -> bool:
    """Check the observation of `tick` and record it in the next row; return whether it is safe to continue."""
    exact, row = arrays.observation.measurement, rows.written[0]
    finite, force, step = extremes(exact.joint_position, arrays.last_position, exact.wrench)
    if not finite or force > arrays.tip_force_limit or step / since_sample(tick, arrays) > arrays.joint_velocity_limit:
        return False
    if outside(exact.joint_position, arrays.joint_range) or outside(
        arrays.observation.truth.position, arrays.tip_range
    ):
        return False
    put(arrays.last_position, exact.joint_position)
    if arrays.observation.sample[1] != 0.0:
        arrays.last_sample[0], arrays.last_sample[1] = tick, arrays.observation.sample[0]
    rows.state.tick[row] = rows.truth.tick[row] = tick
    rows.state.time[row] = rows.truth.time[row] = tick * arrays.period
    note_state(tick, row, arrays, rows)
    note_truth(row, surface, arrays.observation.truth, rows)
    rows.written[0] = row + 1
    return True


@kernel_without_arrays
def since_sample(tick: int, arrays: DriverArrays) -> float:
    """Return the time since the last fresh sample, s: by the stamps if there are any, else by the ticks."""
    stamp, last = arrays.observation.sample[0], arrays.last_sample[1]
    return stamp - last if stamp > last else max(tick - arrays.last_sample[0], 1.0) * arrays.period


@kernel_without_arrays
def outside(values: Array, ends: Array) -> bool:
    """Return whether any of the values (k,) is outside its range (2, k). nan, an unknown value, never is."""
    found = False
    for i in range(values.size):
        found = found or values[i] < ends[0, i] or values[i] > ends[1, i]
    return found


@kernel_without_arrays
def note_bounded(tick: int, bits: int, arrays: DriverArrays, rows: DriverRows) -> bool:
    """Record that the envelope changed the command of a tick, and why. Returns False if that ends the trial."""
    arrays.limited[0] = bits
    if bits & arrays.within.trips:
        return False
    applied, row = rows.applied, rows.changed[0]
    row = min(row, applied.tick.size - 1)  # a kernel does not check an index
    applied.tick[row], applied.time[row] = tick, tick * arrays.period
    put(applied.torque[row], arrays.applied.torque)
    put(applied.position[row], arrays.applied.position)
    applied.limited[row] = bits
    rows.changed[0] = row + 1
    return True


@kernel_without_arrays
def note_state(tick: int, row: int, arrays: DriverArrays, rows: DriverRows) -> None:
    """Write what the sensors report: the delayed measurement, with the current sensor errors."""
    past, depth = arrays.past, arrays.past.joint_position.shape[0]
    exact, state, schedule = arrays.observation.measurement, rows.state, arrays.schedule
    slot = tick % depth
    put(past.joint_position[slot], exact.joint_position)
    put(past.wrench[slot], exact.wrench)
    put(past.applied_torque[slot], exact.applied_torque)
    put(arrays.past_samples[slot], arrays.observation.sample)
    # There was no measurement before the first tick: until the delay has passed, use the oldest one.
    slot = (tick - min(int(schedule.measurement_delay[tick]), tick)) % depth
    for i in range(exact.joint_position.size):
        state.joint_position[row, i] = past.joint_position[slot, i] + schedule.joint_error[tick, i]
    for i in range(exact.wrench.size):
        state.wrench[row, i] = past.wrench[slot, i] + schedule.wrench_error[tick, i]
    put(state.applied_torque[row], past.applied_torque[slot])
    state.stamp[row] = arrays.past_samples[slot, 0]
    # Nothing came before the first tick, so its sample is new, even if it was also read to begin.
    state.fresh[row] = np.uint64(1 if tick == 0 else arrays.past_samples[slot, 1])


@kernel_without_arrays
def note_truth(row: int, surface: float, exact: Truth, rows: DriverRows) -> None:
    """Write the plant's true state."""
    truth = rows.truth
    put(truth.joint_position[row], exact.joint_position)
    put(truth.joint_velocity[row], exact.joint_velocity)
    put(truth.position[row], exact.position)
    put(truth.velocity[row], exact.velocity)
    put(truth.wrench[row], exact.wrench)
    truth.surface_position[row] = surface


def drive_template(tick: int, asked: Command, plant: Any, state: Array, arrays: DriverArrays, rows: DriverRows) -> bool:
    """Advance the plant for a period under `asked`, brought within the envelope.

    Returns False if the command ends the trial.
    """
    bits = bound(asked.torque, asked.position, arrays.within, arrays.applied)
    if bits != 0 and not note_bounded(tick, bits, arrays, rows):
        return False
    now = plant_disturbance(arrays.schedule, tick)
    plant_advance(plant, state, now, arrays.applied.torque, arrays.applied.position)
    return True


def coast_template(first: int, tick: int, plant: Any, state: Array, arrays: DriverArrays) -> None:
    """Advance the plant from tick `first` to `tick` under the command in effect."""
    for left_out in range(first, tick):
        now = plant_disturbance(arrays.schedule, left_out)
        plant_advance(plant, state, now, arrays.applied.torque, arrays.applied.position)


def driver_template(
    plant: Any, state: Array, arrays: DriverArrays, rows: DriverRows, acting: Command
) -> Iterator[bool]:
    """Do one tick after the other, each in two parts: measure at the tick of `clock`, then advance under `acting`,
    brought within the envelope.

    Yields after each part whether it is safe to continue. Each tick is in the next row; after the last row comes the
    first again. A simulated plant goes on under the command that was in effect while ticks were left out.
    """
    row, count = 0, rows.state.tick.size
    while True:
        tick = arrays.clock[0]
        coast(tick - arrays.clock[1], tick, plant, state, arrays)
        rows.written[0] = row
        yield measure(tick, plant, state, arrays, rows)
        yield drive(tick, acting, plant, state, arrays, rows)
        row = (row + 1) % count


def measuring(kernels: PlantKernels) -> Callable[..., bool]:
    """Return `measure_template` with this plant filled in."""
    return assembled(measure_template, makes_arrays=False, plant_observe=kernels.observe)


def driving(kernels: PlantKernels) -> Callable[..., bool]:
    """Return `drive_template` with this plant filled in."""
    return assembled(drive_template, makes_arrays=False, plant_advance=kernels.advance)


def driver_ticks(kernels: PlantKernels, arrays: DriverArrays, rows: DriverRows, acting: Command) -> Iterator[bool]:
    """Return the generator of `driver_template`: one call of `next` for each part of a tick.

    A generator keeps its arguments; passing this many arrays at every call would cost several times the work itself.
    """
    coast = assembled(coast_template, makes_arrays=False, plant_advance=kernels.advance)
    ticks = assembled(driver_template, measure=measuring(kernels), drive=driving(kernels), coast=coast)
    return ticks(kernels.constants, kernels.state, arrays, rows, acting)


def driver_arrays(trial: Trial) -> DriverArrays:
    """Return the data around the plant of a trial, before the first measurement."""
    schedule = disturbance_schedule(trial)
    n, m, depth = trial.driver.robot.joints, len(trial.axes), int(schedule.measurement_delay.max(initial=0)) + 1
    observation = Observation.empty(n, m)
    past = Measurement(np.zeros((depth, n)), np.zeros((depth, 6)), np.zeros((depth, n)))
    limits = trial.limits
    return DriverArrays(
        schedule,
        envelope(trial),
        Command(np.zeros(n), np.zeros(n)),
        np.zeros(1, np.int64),
        np.array(limits.joint_range(trial.driver.robot)),
        limits.tip_range(trial.axes),
        limits.tip_force,
        limits.joint_velocity,
        trial.period,
        np.zeros(2, np.int64),
        np.zeros(n),
        np.array([0.0, np.nan]),
        observation,
        past,
        np.zeros((depth, 2)),
    )
