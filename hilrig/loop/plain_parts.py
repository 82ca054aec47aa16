"""Plants, robots and laws in plain Python, in the form in which the code of a tick calls kernels."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple, cast

import numpy as np

from hilrig.core.compiler import can_be_composed
from hilrig.core.errors import PluginError
from hilrig.core.interfaces import Law, Plant, Robot
from hilrig.core.kernel_interfaces import Observation, PlantKernels, RobotKernels
from hilrig.core.signals import Array, Command, Kinematics, PlantDisturbance, Reference, State
from hilrig.experiment.trial import Trial


def plant_kernels(plant: Plant) -> PlantKernels:
    """Return the plant's kernels, or equivalent functions that call its methods."""
    if hasattr(plant, "kernels"):
        return cast(Any, plant).kernels()
    return PlantKernels(_observe, _advance, plant, np.zeros(0))


def _observe(plant: Plant, _state: Array, disturbance: PlantDisturbance, room: Observation) -> float:
    for place, value in zip(room.measurement, plant.measure(disturbance), strict=True):
        place[:] = value
    truth = plant.truth(disturbance)
    if truth is None:
        return np.nan
    for place, value in zip(room.truth[:-1], truth[:-1], strict=True):
        place[:] = value
    return truth.surface_position


def _advance(plant: Plant, _state: Array, disturbance: PlantDisturbance, torque: Array, position: Array) -> None:
    # Copies, because a plant may keep its arguments and these arrays change at the next tick.
    plant.advance(Command(torque.copy(), position.copy()), disturbance)


def robot_kernels(robot: Robot) -> RobotKernels:
    """Return the robot's kernels, or an equivalent function that calls its method."""
    return cast(Any, robot).kernels() if hasattr(robot, "kernels") else RobotKernels(_kinematics, robot)


def _kinematics(robot: Robot, q: Array, rate: Array, room: Kinematics) -> None:
    for place, value in zip(room, robot.kinematics(q.copy(), rate.copy()), strict=True):
        place[...] = value


class LawParts(NamedTuple):
    """A law in the form in which the code of a tick calls it."""

    step: Callable[[Any, Any, State, Reference], Array]
    fields: tuple[Array, ...]
    """The law's memory, one flat array per field; up to date when `step` returns"""


def law_parts(law: Law, trial: Trial) -> LawParts:
    """Return the law's own step if it is a kernel that can be composed, else a wrapper that guards a plain one."""
    fields = tuple(field.reshape(-1) for field in law.memory) or (np.zeros(0),)
    in_place = all(np.shares_memory(flat, field) for flat, field in zip(fields, law.memory, strict=False))
    if can_be_composed(law.step) and in_place:
        return LawParts(law.step, fields)
    return LawParts(_guarded(law, None if in_place else fields, trial), fields)


def _guarded(law: Law, copies: tuple[Array, ...] | None, trial: Trial) -> Callable[..., Array]:
    def step(parameters: Any, memory: Any, state: State, reference: Reference) -> Array:
        # A law may keep its arguments and write into them, so it gets copies of the loop's arrays.
        torque = law.step(parameters, memory, copied(state), Reference(*(part.copy() for part in reference)))
        if copies is not None:  # non-contiguous memory has no flat view
            for flat, field in zip(copies, memory, strict=True):
                flat[:] = field.reshape(-1)
        return checked(torque, trial)

    return step


def copied(state: State) -> State:
    """Return a copy of the state with its own arrays."""
    return State._make(part.copy() if isinstance(part, np.ndarray) else part for part in state)


def checked(torque: Any, trial: Trial) -> Array:
    """Return a law's torque as an array. Raises PluginError if it is not one number for each joint."""
    if torque is None:
        raise wrong_torque("None, not an array", trial)
    array, joints = np.asarray(torque, dtype=np.float64), trial.driver.robot.joints
    if array.shape != (joints,):
        raise wrong_torque(f"an array of shape {array.shape}", trial)
    return array


def wrong_torque(returned: str, trial: Trial) -> PluginError:
    """Return the error for a law that returned something else than a torque (n,)."""
    wanted = f"the robot needs one of shape {(trial.driver.robot.joints,)}"
    return PluginError(f"controller '{trial.controller_name}': step returned {returned}; {wanted}")
