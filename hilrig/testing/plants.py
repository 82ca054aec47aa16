"""Inputs for testing simulated drivers: a position near their surface, commands, and disturbances."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

from hilrig import WRENCH_AXES, Array, Command, Driver, OutOfReach, Plant, PlantDisturbance, Robot, TrialStart
from hilrig.testing.rule import Broken, NotApplicableError

PERIOD = 1e-3
DEPTH = 0.005
"""m into the surface: a few newtons on most surfaces"""
CLEAR = -0.02
"""m into the surface: negative, away from it"""
PUSH = 4.0
"""N along the first axis"""
TRIES = 60


def still(robot: Robot) -> PlantDisturbance:
    """Return a disturbance without effect."""
    return PlantDisturbance(np.zeros(len(robot.axes)), 0.0, 0.0, 1.0, 1.0, 1.0)


def disturbed(robot: Robot, name: str) -> PlantDisturbance:
    """Return a disturbance of only the plant's input `name`, a field of the DisturbanceSchedule."""
    m = len(robot.axes)
    values = {
        "tip_force": np.linspace(2.0, 3.0, m), "surface_offset": -0.002, "surface_velocity": -0.05,
        "stiffness_scale": 3.0, "surface_friction_scale": 3.0, "joint_friction_scale": 3.0,
    }  # fmt: skip
    field = name.removeprefix("plant_")
    return still(robot)._replace(**{field: values[field]})


@contextmanager
def begun(driver: Driver, depth: float = DEPTH) -> Iterator[Plant]:
    """Begin at rest, `depth` m into the surface, measure once as the rig does, and close the plant at the end.

    Raises NotApplicableError for a driver whose plant is not simulated: a test never moves a robot.
    """
    require_simulated(driver)
    plant = driver.connect(start_at(driver, pose(driver, depth)))
    try:
        plant.measure(still(driver.robot))
        yield plant
    finally:
        plant.close()


def start_at(driver: Driver, joint_position: Array) -> TrialStart:
    """Return the start of a trial at this joint position, (n,) rad, without a desired force."""
    return TrialStart(PERIOD, joint_position, np.zeros(len(driver.robot.axes)))


def require_simulated(driver: Driver) -> None:
    """Raise NotApplicableError for a driver whose plant is not simulated, or that lacks what it needs."""
    if not driver.capabilities.simulated:
        raise NotApplicableError("its plant is not simulated, and a test never moves a robot")
    if missing := getattr(driver, "missing", str)():
        raise NotApplicableError(missing)


def pose(driver: Driver, depth: float) -> Array:
    """Return joint positions (n,) rad with the tip `depth` m into the surface, far from a singularity."""
    robot, random = driver.robot, np.random.default_rng(11)
    low, high = robot.joint_limits()
    found: list[tuple[float, Array]] = []
    for _ in range(TRIES):
        place = robot.forward_kinematics(low + (high - low) * random.uniform(0.2, 0.8, low.size))
        place[-1] = driver.surface_position + depth
        try:
            q = robot.inverse_kinematics(place)
        except OutOfReach:
            continue
        if ((low < q) & (q < high)).all():
            found.append((float(np.linalg.cond(robot.kinematics(q, 0 * q).jacobian)), q))
    if not found:
        raise Broken(
            f"the robot reaches no point on its surface, at {driver.surface_position:g} m along {robot.axes[-1]}; "
            "give the test a surface that it reaches"
        )
    return min(found, key=lambda item: item[0])[1]


def pushed(driver: Driver, plant: Plant, disturbance: PlantDisturbance, ticks: int = 60) -> Array:
    """Return how far the tip moves, (m,) m, with a push of 4 N along the first axis added to the holding command."""
    robot, quiet = driver.robot, still(driver.robot)
    start, hold = plant.measure(quiet).joint_position.copy(), plant.holding_command()
    push = robot.kinematics(start, 0 * start).jacobian[0] * PUSH
    command = Command(hold.torque + push, hold.position + (push / driver.servo_gain if driver.servo_gain else 0.0))
    for _ in range(ticks):
        plant.advance(command, disturbance)
    end = plant.measure(quiet).joint_position
    return robot.forward_kinematics(end.copy()) - robot.forward_kinematics(start)


def force_index(robot: Robot) -> list[int]:
    """Return the indices in a wrench of the forces along the robot's axes."""
    return [WRENCH_AXES.index(axis) for axis in robot.axes]


def swinging(driver: Driver, plant: Plant, k: int) -> Command:
    """Return the command of tick k in a swing about the plant's position."""
    n = driver.robot.joints
    swing = 0.5 * np.sin(0.3 * k + np.arange(n))
    hold = plant.holding_command()
    return Command(hold.torque + swing, hold.position + (swing / driver.servo_gain if driver.servo_gain else 0.0))


def swing(driver: Driver, plant: Plant, ticks: int = 10) -> None:
    """Let the plant swing for this many periods."""
    for k in range(ticks):
        plant.advance(swinging(driver, plant, k), still(driver.robot))
