"""Rules for drivers: what they declare, and how they are called. Tests move only simulated plants, never a robot."""

from __future__ import annotations

import time
from typing import Any

import numpy as np

from hilrig import Array, Command, DisturbanceSchedule, Driver, Measurement, Observation, Plant, Truth
from hilrig.core.errors import PluginError
from hilrig.kinds.hardware import lacks
from hilrig.kinds.registry import name_of
from hilrig.testing.plants import (
    CLEAR,
    DEPTH,
    begun,
    disturbed,
    pose,
    require_simulated,
    start_at,
    still,
    swing,
    swinging,
)
from hilrig.testing.rule import Broken, noting, require, rule, same
from hilrig.testing.scenario import arrays

INPUTS = tuple(name for name in DisturbanceSchedule._fields if name.startswith("plant_"))
CLOCKS = ("lockstep", "realtime")
REST = 0.05
"""s without a call to the plant"""


@rule("drivers")
def capabilities_are_of_the_known_words(driver: Driver) -> None:
    """The capabilities must name existing clocks and plant disturbances."""
    clocks, disturbances, simulated, stop_time = driver.capabilities
    require(clocks and set(clocks) <= set(CLOCKS), f"its clocks are {clocks!r} (known: {', '.join(CLOCKS)})")
    unknown = sorted(set(disturbances) - set(INPUTS))
    require(not unknown, f"it names {', '.join(unknown)} (known: {', '.join(INPUTS)})")
    require(isinstance(simulated, bool), f"`simulated` is {simulated!r}")
    require(isinstance(stop_time, (int, float)) and 0 <= stop_time < np.inf, f"`stop_time` is {stop_time!r}")


@rule("drivers")
def hardware_can_be_held(driver: Driver) -> None:
    """A plant that is not simulated must offer `hold`, say how long it takes, and yield in its stages."""
    problems = lacks(driver)
    require(not problems, "; ".join(problems))


@rule("drivers")
def it_says_what_it_drives(driver: Driver) -> None:
    """A driver must have a robot that is a kind, the position of its surface in m, and a servo gain or None."""
    try:
        group, _ = name_of(type(driver.robot))
    except PluginError as error:
        raise Broken(f"of its robot: {error}") from error
    require(group == "robots", f"its robot is of {group}")
    place, gain = driver.surface_position, driver.servo_gain
    require(isinstance(place, (int, float)) and np.isfinite(place), f"its surface is at {place!r}")
    require(gain is None or gain > 0, f"its servo gain is {gain!r}")


@rule("drivers", first=True)
def a_plant_begins_and_runs(driver: Driver) -> None:
    """A plant must begin, be measured, tell its truth, give a holding command, advance and be closed."""
    with begun(driver) as plant:
        swing(driver, plant)
        plant.measure(still(driver.robot))
        plant.truth(still(driver.robot))


@rule("drivers")
def measurements_have_their_shapes(driver: Driver) -> None:
    """`measure` must return q (n,), the wrench (6,) and the applied torque (n,) as finite float64 arrays."""
    n = driver.robot.joints
    with begun(driver) as plant:
        for _ in range(3):
            measured = plant.measure(still(driver.robot))
            require(isinstance(measured, Measurement), f"it returned a {type(measured).__name__}")
            for name, array, shape in zip(Measurement._fields, measured, ((n,), (6,), (n,)), strict=False):
                _check_array(name, array, shape)
            plant.advance(plant.holding_command(), still(driver.robot))


@rule("drivers")
def it_begins_at_rest_where_it_is_told(driver: Driver) -> None:
    """A trial must begin at rest at the joint position that `connect` is given, even if that array changes later."""
    wanted = pose(driver, CLEAR)
    require_simulated(driver)
    start = start_at(driver, wanted.copy())
    plant = driver.connect(start)
    try:
        start.joint_position[...] = np.nan
        q = plant.measure(still(driver.robot)).joint_position
        require(np.allclose(q, wanted, atol=1e-6), "it began at {} rad instead of {}", q, wanted)
        truth = plant.truth(still(driver.robot))
        rate = truth.joint_velocity if truth else np.zeros(1)
        require(np.abs(rate).max() < 1e-9, "it began with q' = {} rad/s", rate)
    finally:
        plant.close()


@rule("drivers")
def only_advance_moves_the_plant(driver: Driver) -> None:
    """Only `advance` may move the plant or change what is measured: not measuring, holding or waiting."""
    with begun(driver) as plant:
        swing(driver, plant)
        before = _seen(driver, plant)
        plant.holding_command()
        _require_equal(before, _seen(driver, plant), "after `measure`, `truth` and `holding_command`")
        time.sleep(REST)
        _require_equal(before, _seen(driver, plant), f"{REST:g} s later")


@rule("drivers")
def what_was_measured_stays_as_it_was(driver: Driver) -> None:
    """The arrays of a measurement, of the truth and of the holding command must not change when the plant moves on."""
    with begun(driver) as plant:
        parts = _seen(driver, plant) | {
            f"holding_command.{name}": array for name, array in arrays(plant.holding_command())
        }
        copies = {name: np.copy(part) for name, part in parts.items()}
        swing(driver, plant)
        _seen(driver, plant)
        for name, part in parts.items():
            require(same(part, copies[name]), "{} went from {} to {}", name, copies[name], part)


@rule("drivers")
def commands_and_disturbances_are_only_read(driver: Driver) -> None:
    """A plant must only read commands and disturbances, and copy what it keeps."""
    robot, n = driver.robot, driver.robot.joints
    with begun(driver) as plant:
        torque, position = np.linspace(1.0, 2.0, n), pose(driver, DEPTH)
        command, disturbance = Command(torque.copy(), position.copy()), disturbed(robot, "plant_tip_force")
        push = disturbance.tip_force.copy()
        plant.advance(command, disturbance)
        plant.measure(disturbance)
        unchanged = same(command.torque, torque) and same(command.position, position)
        require(unchanged and same(disturbance.tip_force, push), "it wrote into one")
        before = {name: np.copy(part) for name, part in _seen(driver, plant).items()}
        for array in (*command, disturbance.tip_force):
            array[...] = np.nan
        _require_equal(before, _seen(driver, plant), "when the arrays of the last command were used again")


@rule("drivers")
def a_command_does_not_act_after_its_period(driver: Driver) -> None:
    """What is written into the arrays of a command after `advance` must not reach the plant."""
    found: list[dict[str, Array]] = []
    for used_again in (False, True):
        with begun(driver) as plant:
            for k in range(3):
                command = Command(*(part.copy() for part in swinging(driver, plant, k)))
                plant.advance(command, still(driver.robot))
                for part in command if used_again else ():
                    part[...] = np.nan
            found.append(_seen(driver, plant))
    _require_equal(found[0], found[1], "when the arrays of earlier commands were used again")


@rule("drivers")
def the_same_commands_give_the_same_bits(driver: Driver) -> None:
    """The same commands must give the same measurements, to the last bit, also next to another plant."""
    with begun(driver) as first:
        alone = _trace(driver, first)
    with begun(driver) as second, begun(driver, CLEAR) as other:
        beside = _trace(driver, second, other)
    for k, (one, two) in enumerate(zip(alone, beside, strict=True)):
        require(same(one, two), "after {} periods q was {} once and {} the second time", k + 1, one, two)


@rule("drivers")
def close_may_come_at_any_time(driver: Driver) -> None:
    """`close` must do no harm right after `connect`, or when it is called again."""
    require_simulated(driver)
    start = start_at(driver, pose(driver, CLEAR))
    for begun_only in (True, False):
        plant = driver.connect(start)
        if not begun_only:
            plant.measure(still(driver.robot))
            swing(driver, plant)
        for when in ("right after `connect`" if begun_only else "after some ticks", "a second time"):
            with noting(f"called {when}"):
                plant.close()


@rule("drivers")
def kernels_do_the_same(driver: Driver) -> None:
    """The kernels of a plant, if it offers any, must do what its methods do, to the last bit."""
    with begun(driver) as plain, begun(driver) as compiled:
        if not hasattr(compiled, "kernels"):
            return
        kernels: Any = compiled.kernels()  # pyright: ignore[reportAttributeAccessIssue]
        disturbance = disturbed(driver.robot, "plant_tip_force")
        room = Observation.empty(driver.robot.joints, len(driver.robot.axes))
        for k in range(20):
            seen, true = plain.measure(disturbance), plain.truth(disturbance)
            surface = kernels.observe(kernels.constants, kernels.state, disturbance, room)
            for got, expected in ((room.measurement, seen), (room.truth, true)):
                for name, wanted in arrays(expected) if expected else ():
                    array = getattr(got, name)
                    require(same(array, wanted), "at tick {} {} is {} instead of {}", k, name, array, wanted)
            require(true is None or surface == true.surface_position, f"the surface is at {surface:g} m")
            command = swinging(driver, plain, k)
            plain.advance(command, disturbance)
            kernels.advance(kernels.constants, kernels.state, disturbance, *command)


@rule("drivers")
def pictures_are_of_the_size_asked_for(driver: Any) -> None:
    """`render`, if a driver offers it, must return one picture (height, width, 3) uint8 for each row."""
    if not hasattr(driver, "render"):
        return
    require_simulated(driver)
    pictures = driver.render(np.stack([pose(driver, CLEAR)] * 2), 64, 48)
    shapes = [(picture.shape, str(picture.dtype)) for picture in pictures]
    require(shapes == [((48, 64, 3), "uint8")] * 2, f"for two rows at 64 x 48 it returned {shapes}")


def _trace(driver: Driver, plant: Plant, other: Plant | None = None, ticks: int = 60) -> list[Array]:
    """Return q after each period of a swing, while another plant swings too."""
    seen: list[Array] = []
    for k in range(ticks):
        plant.advance(swinging(driver, plant, k), still(driver.robot))
        if other is not None:
            other.advance(swinging(driver, other, 2 * k), still(driver.robot))
        seen.append(plant.measure(still(driver.robot)).joint_position.copy())
    return seen


def _seen(driver: Driver, plant: Plant) -> dict[str, Array]:
    """Return the arrays of the measurement and, if known, of the truth, by name."""
    quiet = still(driver.robot)
    seen, true = plant.measure(quiet), plant.truth(quiet)
    named = {f"measure().{name}": array for name, array in arrays(seen)}
    require(true is None or isinstance(true, Truth), f"`truth` returned a {type(true).__name__}")
    return named | ({f"truth().{name}": array for name, array in arrays(true)} if true else {})


def _require_equal(before: dict[str, Array], now: dict[str, Array], when: str) -> None:
    for name, array in now.items():
        require(same(array, before[name]), "{} {} was {} instead of {}", when, name, array, before[name])


def _check_array(name: str, array: Any, shape: tuple[int, ...]) -> None:
    require(isinstance(array, np.ndarray), f"its {name} is a {type(array).__name__}")
    require(array.shape == shape, f"its {name} is an array {array.shape} instead of {shape}")
    require(array.dtype == np.float64, f"its {name} is an array of {array.dtype}")
    require(np.isfinite(array).all(), "its {} is {}", name, array)
