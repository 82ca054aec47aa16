"""Plants, robots and laws in plain Python, in the form in which the code of a tick calls kernels."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, cast

import numpy as np

from hilrig.core.compiler import can_be_composed
from hilrig.core.errors import PluginError, raised
from hilrig.core.interfaces import Law, Plant, Robot
from hilrig.core.kernel_interfaces import Observation, PlantKernels, RobotKernels
from hilrig.core.signals import Array, Command, Kinematics, Measurement, PlantDisturbance, Reference, State, Truth
from hilrig.experiment.trial import Trial

FLOAT = np.dtype(np.float64)


class PlainPlant(NamedTuple):
    """A plant in plain Python."""

    plant: Plant
    measure: str
    """Names of its methods, for messages"""
    truth: str


def plant_kernels(plant: Plant, driver: str) -> PlantKernels:
    """Return the plant's kernels, or equivalent functions that call its methods."""
    if hasattr(plant, "kernels"):
        return cast(Any, plant).kernels()
    plain = PlainPlant(plant, f"driver {driver}: measure", f"driver {driver}: truth")
    return PlantKernels(_observe, _advance, plain, np.zeros(0))


def _observe(plain: PlainPlant, _state: Array, disturbance: PlantDisturbance, room: Observation) -> float:
    take_measurement(room, plain.plant.measure(disturbance), plain.measure)
    truth = plain.plant.truth(disturbance)
    if truth is None:
        for place in room.truth[:-1]:
            place.fill(np.nan)
        return np.nan
    take(room.truth[:-1], truth[:-1] if isinstance(truth, tuple) else truth, Truth, plain.truth)
    if isinstance(truth[-1], float):
        return truth[-1]
    surface = np.empty(())
    _convert(surface, truth[-1], f"{plain.truth} returned surface_position as")
    return float(surface)


def _advance(plain: PlainPlant, _state: Array, disturbance: PlantDisturbance, torque: Array, position: Array) -> None:
    # Copies, because a plant may keep its arguments and these arrays change at the next tick.
    plain.plant.advance(Command(torque.copy(), position.copy()), disturbance)


def take(places: Sequence[Array], found: Any, form: type, who: str) -> None:
    """Copy the arrays that a plug-in returned, a NamedTuple of the type `form`, into `places`.

    Raises PluginError, which begins with `who`, unless each holds real numbers and has the shape of its place.
    """
    if not isinstance(found, tuple) or len(found) != len(places):
        raise PluginError(f"{who} returned {_described(found)}; it must return a {form.__name__}")
    for i, (place, value) in enumerate(zip(places, found, strict=True)):
        if is_plain(value, place.shape):
            place[...] = value
        else:
            _convert(place, value, f"{who} returned {cast(Any, form)._fields[i]} as")


def take_measurement(room: Observation, found: Any, who: str) -> None:
    """Copy a measurement into `room`. Raises PluginError, which begins with `who`, if it is none."""
    if isinstance(found, tuple) and len(found) == len(Measurement._fields):
        found, sample = found[:3], found[3:]
        if not isinstance(sample[0], (int, float)) or not isinstance(sample[1], (bool, np.bool_)):
            raise PluginError(f"{who} returned stamp {sample[0]!r}, fresh {sample[1]!r}: they must be s and a bool")
        room.sample[0], room.sample[1] = sample
    take(room.measurement[:3], found, Measurement, who)


def is_plain(value: Any, shape: tuple[int, ...]) -> bool:
    """Return whether a value needs no conversion: this is asked of several arrays at every tick, so it is quick."""
    return type(value) is np.ndarray and value.dtype is FLOAT and value.shape == shape


def _convert(place: Array, value: Any, who: str) -> None:
    array = numbers(value, who)
    if array.shape != place.shape:
        raise PluginError(f"{who} an array of shape {array.shape}; for this robot it must be {place.shape}")
    place[...] = array


def numbers(value: Any, who: str) -> Array:
    """Return what a plug-in returned as an array. Raises PluginError, which begins with `who`, if it is none."""
    try:
        array = np.asarray(value)
    except Exception as error:
        raise PluginError(f"{who} {_described(value)}, which is no array ({raised(error)})") from error
    if array.dtype.kind not in "fiu":
        raise PluginError(f"{who} {_described(value)}; it must be an array of real numbers")
    return array


def _described(value: Any) -> str:
    if isinstance(value, np.ndarray):
        return f"an array of {value.dtype}"
    return "None" if value is None else f"a {type(value).__name__}"


def robot_kernels(robot: Robot) -> RobotKernels:
    """Return the robot's kernels, or an equivalent function that calls its method."""
    return cast(Any, robot).kernels() if hasattr(robot, "kernels") else RobotKernels(_kinematics, robot)


def _kinematics(robot: Robot, q: Array, rate: Array, room: Kinematics) -> None:
    found = robot.kinematics(q.copy(), rate.copy())
    take(room, found, Kinematics, f"robot {type(robot).__name__}: kinematics")


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
    shape = (trial.driver.robot.joints,)
    if is_plain(torque, shape):
        return torque
    array = numbers(torque, f"controller '{trial.controller_name}': step returned")
    if array.shape != shape:
        raise wrong_torque(array.shape, trial)
    return np.asarray(array, dtype=np.float64)


def wrong_torque(shape: tuple[int, ...], trial: Trial) -> PluginError:
    """Return the error for a law whose torque does not have the shape (n,)."""
    return PluginError(
        f"controller '{trial.controller_name}': step returned an array of shape {shape}; "
        f"the robot needs one of shape {(trial.driver.robot.joints,)}"
    )
