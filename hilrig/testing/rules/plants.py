"""Rules for drivers: a simulated plant moves, holds, responds to disturbances and measures as its interface says."""

from __future__ import annotations

import numpy as np

from hilrig import Array, Command, Driver, Measurement, PlantDisturbance, Truth
from hilrig.testing.plants import CLEAR, DEPTH, begun, disturbed, force_index, pose, pushed, still, swing
from hilrig.testing.rule import NotApplicableError, require, rule
from hilrig.testing.subject import Subject

HELD = 1e-5
"""rad that a plant may move while it is held for 100 ms"""


@rule("drivers")
def advance_moves_the_plant(driver: Driver) -> None:
    """`advance` must move the plant under a command that does not hold it."""
    with begun(driver, CLEAR) as plant:
        moved = pushed(driver, plant, still(driver.robot))
        require(moved[0] > 1e-6, "a push of 4 N along {} moved the tip by {} m in 60 ms", driver.robot.axes[0], moved)


@rule("drivers")
def the_holding_command_keeps_the_plant(driver: Driver) -> None:
    """`holding_command` must return the command that keeps the plant in place, in the air and in contact."""
    for where, depth in (("in the air", CLEAR), ("in contact", DEPTH)):
        with begun(driver, depth) as plant:
            hold, before = plant.holding_command(), plant.measure(still(driver.robot)).joint_position.copy()
            for _ in range(100):
                plant.advance(hold, still(driver.robot))
            moved = np.abs(plant.measure(still(driver.robot)).joint_position - before).max()
            require(moved < HELD, f"{where} it moved by {moved:.3g} rad in 100 ms of being held")


@rule("drivers")
def applied_torque_is_what_the_motors_gave(driver: Driver) -> None:
    """The applied torque must be the torque of the last command, if the plant takes torques."""
    if driver.servo_gain is not None:
        return
    with begun(driver, CLEAR) as plant:
        torque = np.minimum(np.linspace(1.0, 2.0, driver.robot.joints), driver.robot.torque_limits())
        plant.advance(Command(torque, pose(driver, CLEAR)), still(driver.robot))
        applied = plant.measure(still(driver.robot)).applied_torque
        require(np.allclose(applied, torque), "it is {} N m after a command of {}", applied, torque)


@rule("drivers")
def the_torque_at_the_start_is_what_holds_the_plant(driver: Driver) -> None:
    """Before the first command, the applied torque must be the one that holds the plant."""
    if driver.servo_gain is not None:
        return
    with begun(driver) as plant:
        applied, hold = plant.measure(still(driver.robot)).applied_torque, plant.holding_command().torque
        require(np.allclose(applied, hold), "it is {} N m, and `holding_command` gives {}", applied, hold)


@rule("drivers")
def the_truth_agrees_with_the_measurement(driver: Driver) -> None:
    """The truth must agree with what is measured, and with the robot's kinematics, disturbed or not."""
    for disturbance in (still(driver.robot), _pushed_from_outside(driver)):
        with begun(driver) as plant:
            for _ in range(5):
                swing(driver, plant, 4)
                true = plant.truth(disturbance)
                if true is not None:
                    _compare_truth(driver, plant.measure(disturbance), true, disturbance)


@rule("drivers")
def a_surface_that_is_pressed_pushes_back(driver: Driver) -> None:
    """The wrench must be what the robot exerts: positive along the last axis in contact, and none in the air."""
    axis = force_index(driver.robot)[-1]
    for where, depth in (("in the air", CLEAR), (f"{DEPTH * 1e3:g} mm in the surface", DEPTH)):
        with begun(driver, depth) as plant:
            force = float(plant.measure(still(driver.robot)).wrench[axis])
            right = force > 1e-3 if depth > 0 else abs(force) < 1e-6
            require(right, f"{where} its force along {driver.robot.axes[-1]} is {force:.6g} N")


@rule("drivers", whole=True)
def every_disturbance_it_declares_acts(subject: Subject) -> None:
    """Each disturbance in the capabilities must move the plant in its direction.

    The robot yields to a tip force, which adds to F_e, to an approaching surface, and to a stiffer one; with more
    friction it moves less along the first axis. A scale has no effect if the defaults have no friction.
    """
    driver: Driver = subject.variants[0]
    with begun(driver) as plant:
        plain = pushed(driver, plant, still(driver.robot))
    silent: list[str] = []
    for name in driver.capabilities.disturbances:
        disturbance = disturbed(driver.robot, name)
        with begun(driver) as plant:
            moved = pushed(driver, plant, disturbance) - plain
        if not moved.any() and name.endswith("_scale") and not subject.given:
            silent.append(name)
            continue
        require(moved.any(), f"{name} changes nothing; give the test values that have an effect")
        wrong = moved @ _against(driver, name) >= 0
        require(not wrong, "{} moves the tip by {} m, which is the wrong way", name, moved)
    if silent:
        raise NotApplicableError(
            f"{', '.join(silent)}: with the defaults it changes nothing; give values such as friction"
        )


@rule("drivers")
def an_external_force_is_felt_by_the_sensor(driver: Driver) -> None:
    """A tip force must add to the measured wrench, if the driver can apply one."""
    if "plant_tip_force" not in driver.capabilities.disturbances:
        return
    push = disturbed(driver.robot, "plant_tip_force")
    with begun(driver) as plant:
        felt = plant.measure(push).wrench - plant.measure(still(driver.robot)).wrench
        expected = np.zeros(6)
        expected[force_index(driver.robot)] = push.tip_force
        require(np.allclose(felt, expected, atol=1e-9), "{} N added {}", expected, felt)


def _against(driver: Driver, name: str) -> Array:
    """Return a direction, (m,), against which the tip moves under a disturbance."""
    if name == "plant_tip_force":
        return disturbed(driver.robot, name).tip_force
    return np.eye(len(driver.robot.axes))[0 if name.endswith("friction_scale") else -1]


def _pushed_from_outside(driver: Driver) -> PlantDisturbance:
    """Return a tip force and a surface that moved closer, as far as the driver can apply them."""
    names = [name for name in ("plant_tip_force", "plant_surface_offset") if name in driver.capabilities.disturbances]
    fields = [name.removeprefix("plant_") for name in names]
    applied = {field: getattr(disturbed(driver.robot, f"plant_{field}"), field) for field in fields}
    return still(driver.robot)._replace(**applied)


def _compare_truth(driver: Driver, seen: Measurement, true: Truth, disturbance: PlantDisturbance) -> None:
    at = driver.robot.kinematics(true.joint_position, true.joint_velocity)
    pairs = {
        "joint_position": (true.joint_position, seen.joint_position), "wrench": (true.wrench, seen.wrench),
        "position": (true.position, at.position), "velocity": (true.velocity, at.velocity),
        "surface_position": (true.surface_position, driver.surface_position + disturbance.surface_offset),
    }  # fmt: skip
    for name, (one, other) in pairs.items():
        require(np.allclose(one, other, atol=1e-9), "its {} is {}, and not {}", name, one, other)
