"""The driver's half of a tick as kernels: the same as `PlantSide` in `loop`, to the same bits."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Any, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from hilrig.core.compiler import composed, kernel_without_arrays
from hilrig.core.kernel_interfaces import Observation, PlantKernels
from hilrig.core.signals import Array, Command, DisturbanceSchedule, Measurement, PlantDisturbance, plant_disturbance
from hilrig.loop.compiled.rows import StateRows, TruthRows
from hilrig.loop.safety import extent
from hilrig.loop.tick import PlantSide
from hilrig.recording.messages.record_batch import RecordBatch


class PlantRig(NamedTuple):
    """What surrounds a plant during a trial. Arrays change in place."""

    schedule: DisturbanceSchedule
    tip_force_limit: float
    """N"""
    joint_velocity_limit: float
    """rad/s"""
    period: float
    """s"""
    last_exact: Array
    """Joint positions at the tick before, without sensor errors, (n,)"""
    observation: Observation
    """What is to be seen of the plant now"""
    past: Measurement
    """The last exact measurements, by tick modulo their number D: arrays (D, n), (D, 6), (D, n)"""


class PlantTrack(NamedTuple):
    """What is recorded of the plant, one row a tick."""

    state: StateRows
    truth: TruthRows
    done: NDArray[np.int64]
    """(1,): rows that are written"""


# What `composed` puts in the place of these names.
plant_observe: Callable[[Any, Array, PlantDisturbance, Observation], float] = cast(Any, None)
plant_advance: Callable[[Any, Array, PlantDisturbance, Array, Array], None] = cast(Any, None)
measure: Callable[..., bool] = cast(Any, None)


def measure_template(tick: int, plant: Any, state: Array, rig: PlantRig, track: PlantTrack) -> bool:
    """Measure at `tick`, write it into the track's next row, and return whether it is safe to go on."""
    row, exact = track.done[0], rig.observation
    surface = plant_observe(plant, state, plant_disturbance(rig.schedule, tick), exact)
    finite, force, step = extent(exact.joint_position, rig.last_exact, exact.wrench)
    if not finite or force > rig.tip_force_limit or step / rig.period > rig.joint_velocity_limit:
        return False
    put(rig.last_exact, exact.joint_position)
    track.state.tick[row] = track.truth.tick[row] = tick
    track.state.time[row] = track.truth.time[row] = tick * rig.period
    report(tick, row, rig, track.state)
    note_truth(row, exact, track.truth)
    track.truth.surface_position[row] = surface
    track.done[0] = row + 1
    return True


def plant_template(
    first: int, last: int, plant: Any, state: Array, rig: PlantRig, track: PlantTrack, command: Command
) -> Iterator[bool]:
    """Do the ticks from `first` to `last` - 1, in two parts each: measure, then advance under `command`.

    Yields after each part whether to go on. Row by row the track is written, from its first row again after its last.
    """
    rows = track.state.tick.size
    for tick in range(first, last):
        track.done[0] = tick % rows
        yield measure(tick, plant, state, rig, track)
        plant_advance(plant, state, plant_disturbance(rig.schedule, tick), command.torque, command.position)
        yield True


@kernel_without_arrays
def put(row: Array, values: Array) -> None:
    """row[:] = values, element by element: a fraction of what numba makes of an assignment between arrays."""
    for i in range(values.size):
        row[i] = values[i]


@kernel_without_arrays
def report(tick: int, row: int, rig: PlantRig, state: StateRows) -> None:
    """Write what the sensors report into a row: the measurement of some ticks ago, and errors."""
    past, depth = rig.past, rig.past.joint_position.shape[0]
    slot = tick % depth
    put(past.joint_position[slot], rig.observation.joint_position)
    put(past.wrench[slot], rig.observation.wrench)
    put(past.applied_torque[slot], rig.observation.applied_torque)
    slot = (tick - min(int(rig.schedule.measurement_delay[tick]), tick)) % depth
    for i in range(past.joint_position.shape[1]):
        state.joint_position[row, i] = past.joint_position[slot, i] + rig.schedule.joint_error[tick, i]
    for i in range(past.wrench.shape[1]):
        state.wrench[row, i] = past.wrench[slot, i] + rig.schedule.wrench_error[tick, i]
    put(state.applied_torque[row], past.applied_torque[slot])


@kernel_without_arrays
def note_truth(row: int, exact: Observation, truth: TruthRows) -> None:
    """Write the true state into a row."""
    put(truth.joint_position[row], exact.joint_position)
    put(truth.joint_velocity[row], exact.joint_velocity)
    put(truth.position[row], exact.position)
    put(truth.velocity[row], exact.velocity)
    put(truth.wrench[row], exact.wrench)


def measuring(kernels: PlantKernels) -> Callable[..., bool]:
    """Return `measure_template` with this plant in it."""
    return composed(measure_template, makes_arrays=False, plant_observe=kernels.observe)


def plant_ticks(
    kernels: PlantKernels, first: int, last: int, rig: PlantRig, track: PlantTrack, command: Command
) -> Iterator[bool]:
    """Return `plant_template` at work: one call of `next` for each part of a tick."""
    ticks = composed(plant_template, measure=measuring(kernels), plant_advance=kernels.advance)
    return ticks(first, last, kernels.constants, kernels.state, rig, track, command)


def plant_rig(side: PlantSide) -> PlantRig:
    """Return what surrounds the plant of a trial whose first tick has been measured by `side`."""
    trial, exact = side.trial, side.past[-1]
    depth = int(side.schedule.measurement_delay.max(initial=0)) + 1
    n, m = trial.driver.robot.joints, len(trial.axes)
    observation = Observation(*(np.empty(size) for size in (n, n, m, m, 6, n)))
    past = Measurement(*(np.repeat(value[None, :], depth, axis=0) for value in exact))
    limits = trial.limits
    return PlantRig(
        side.schedule,
        limits.tip_force,
        limits.joint_velocity,
        trial.period,
        exact.joint_position.copy(),
        observation,
        past,
    )


def plant_track(batches: Mapping[str, RecordBatch]) -> PlantTrack:
    """Return the track that is written into the batches of state and truth."""
    state, truth = StateRows(*batches["state"].fields), TruthRows(*batches["truth"].fields)
    return PlantTrack(state, truth, np.zeros(1, dtype=np.int64))
