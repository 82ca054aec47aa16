from __future__ import annotations

import itertools
from typing import Any

import numpy as np
import pytest
from helpers import rods
from helpers.builders import FAR_AWAY, PERIOD, STILL, arm, begin, surface, torque_command, true_state
from hilrig_drivers.pybullet_arm import PybulletArm
from hilrig_drivers.two_link import TwoLink

from hilrig.core.interfaces import Driver
from hilrig.core.signals import Array
from hilrig.kinds.actuation import Actuation
from hilrig.kinds.robots.planar_2r import Planar2r

pytestmark = pytest.mark.needs_pybullet
ARMS = {
    "rods": arm(gravity=(-3.0, -9.81)),
    "shifted": arm(centers_of_mass=(0.2, 0.05), inertias=(0.03, 0.002), gravity=(-3.0, -9.81)),
}


def empty_world(robot: Planar2r) -> Any:
    from hilrig_drivers._bullet_world import World  # needs PyBullet, and may be skipped without

    return World(robot, 1e-3)


def touching(robot: Planar2r, depth: float) -> Array:
    """Return q with the tip at x = 0.1 m, `depth` below the plain surface."""
    return robot.inverse_kinematics(np.array([0.1, 0.35 + depth]))


@pytest.mark.parametrize("robot", ARMS.values(), ids=list(ARMS))
def test_the_urdf_has_the_arms_mass_matrix(robot: Planar2r) -> None:
    world = empty_world(robot)
    for q in np.random.default_rng(0).uniform(-3, 3, (20, 2)):
        world.place(q)
        matrix = world.engine.calculateMassMatrix(world.arm, q.tolist())
        np.testing.assert_allclose(matrix, rods.mass_matrix(robot, q), atol=1e-9)
    world.close()


@pytest.mark.parametrize("robot", ARMS.values(), ids=list(ARMS))
def test_the_urdf_has_the_arms_gravity_and_geometry(robot: Planar2r) -> None:
    world = empty_world(robot)
    for q in np.random.default_rng(0).uniform(-3, 3, (20, 2)):
        world.place(q)
        torque = world.engine.calculateInverseDynamics(world.arm, q.tolist(), [0.0, 0.0], [0.0, 0.0])
        np.testing.assert_allclose(torque, rods.gravity_torque(robot, q), atol=1e-8)
        tip = world.engine.getLinkState(world.arm, 2, computeForwardKinematics=1)[4]
        np.testing.assert_allclose(tip, np.insert(robot.forward_kinematics(q), 1, 0.0), atol=1e-7)
    world.close()


def driven(driver: Driver, ticks: int = 300) -> Array:
    """Return q after a torque that swings the arm against the surface: its hold plus a sine."""
    plant = begin(driver, touching(arm(), 0.002))
    hold = plant.holding_command().torque
    for k in range(ticks):
        swing = np.array([0.3, -0.2]) * np.sin(2 * np.pi * 4 * k * PERIOD)
        plant.advance(torque_command(hold + swing), STILL)
    q = true_state(plant).joint_position
    plant.close()
    return q


VISCOUS, COULOMB = {"viscous": (0.05, 0.02)}, {"coulomb": (0.03, 0.01)}


@pytest.mark.parametrize(
    ("friction", "rough"),
    [({}, 0.0), (VISCOUS, 0.0), (COULOMB, 0.0), (COULOMB, 0.2)],
    ids=["none", "viscous", "coulomb", "coulomb and rough"],
)
def test_it_moves_as_the_two_link_arm_does(friction: dict[str, Any], rough: float) -> None:
    """In contact, with and without friction; the difference is the engine's step, of first order."""
    touched = surface(friction=rough)
    exact = driven(TwoLink(arm(), touched, substep=5e-5, **friction))
    moved = np.abs(exact - touching(arm(), 0.002)).max()
    errors = [
        np.abs(driven(PybulletArm(arm(), touched, substep=h, **friction)) - exact).max()
        for h in (1e-3, 5e-4, 2.5e-4, 1.25e-4)
    ]
    assert moved > 0.005
    assert errors[0] < 0.05 * moved
    for coarse, fine in itertools.pairwise(errors):
        assert 1.6 < coarse / fine < 2.4


def pushed(driver: Driver, force: tuple[float, float]) -> Array:
    """Return how far the tip of an arm that holds its weight comes in 60 ms under an external force."""
    plant = begin(driver, (0.4, 1.3))
    hold, start = plant.holding_command(), true_state(plant).position
    for _ in range(60):
        plant.advance(hold, STILL._replace(tip_force=np.array(force)))
    moved = true_state(plant).position - start
    plant.close()
    return moved


@pytest.mark.parametrize("contact", ["explicit", "engine"])
@pytest.mark.parametrize("force", [(0.0, 3.0), (2.0, -1.0)])
def test_an_external_force_moves_it_as_the_two_link_arm(contact: str, force: tuple[float, float]) -> None:
    """F_e is what the robot exerts: the tip gives way against it."""
    exact = pushed(TwoLink(arm(), FAR_AWAY), force)
    assert exact @ force < -1e-3
    found = pushed(PybulletArm(arm(), FAR_AWAY, contact=contact), force)  # pyright: ignore[reportArgumentType]
    np.testing.assert_allclose(found, exact, atol=0.02 * np.abs(exact).max())


@pytest.mark.parametrize("contact", ["explicit", "engine"])
def test_the_same_trial_twice_gives_the_same_bits(contact: str) -> None:
    driver = PybulletArm(arm(), surface(), contact=contact)  # pyright: ignore[reportArgumentType]
    np.testing.assert_array_equal(driven(driver), driven(driver))


def test_explicit_contact_has_the_exact_static_force() -> None:
    plant = begin(PybulletArm(arm(), surface()), touching(arm(), 0.01))
    hold, at_first = plant.holding_command(), plant.measure(STILL)
    assert at_first.wrench[2] == pytest.approx(8.0, abs=1e-9)
    for _ in range(300):
        plant.advance(hold, STILL)
    np.testing.assert_allclose(plant.measure(STILL).joint_position, at_first.joint_position, atol=1e-7)
    assert plant.measure(STILL).wrench[2] == pytest.approx(8.0, abs=1e-4)
    plant.close()


def pressed(contact: str, force: float, **disturbance: float) -> tuple[float, float, float]:
    """Press with a task force behind damping, as a hybrid controller would; return mean force, spread and depth."""
    robot = arm()
    plant = begin(PybulletArm(robot, surface(friction=0.0), contact=contact), touching(robot, 0.0))  # pyright: ignore[reportArgumentType]
    forces, nudged = [], STILL._replace(**disturbance)
    for k in range(1500):
        true = true_state(plant, nudged)
        at = robot.kinematics(true.joint_position, true.joint_velocity)
        wished = np.array([300.0 * (0.1 - at.position[0]), force]) - 40.0 * at.velocity
        weight = at.regressor[0] @ robot.dynamic_parameters()
        plant.advance(torque_command(weight + at.jacobian.T @ wished), nudged)
        if k >= 1000:
            forces.append(plant.measure(nudged).wrench[2])
    depth = true_state(plant, nudged).position[1] - true_state(plant, nudged).surface_position
    plant.close()
    return float(np.mean(forces)), float(np.std(forces)), float(depth)


@pytest.mark.parametrize("contact", ["explicit", "engine"])
@pytest.mark.parametrize("force", [3.5, 20.0])
def test_pressing_reads_the_force_that_presses(contact: str, force: float) -> None:
    mean, spread, depth = pressed(contact, force)
    assert mean == pytest.approx(force, rel=0.02)
    assert spread < 0.02 * force
    assert depth == pytest.approx(force / 800.0, abs=5e-4), "Bullet's own contact has some 10 um of slop"


def test_both_contacts_see_a_stiffer_surface() -> None:
    for contact in ("explicit", "engine"):
        force, _, depth = pressed(contact, 20.0, stiffness_scale=4.0)
        assert force == pytest.approx(20.0, rel=0.02)
        assert depth == pytest.approx(20.0 / 3200.0, abs=2e-4)


def held_against_a_coming_wall(contact: str) -> Array:
    """Return the force at every tick while the wall comes at 0.02 m/s towards an arm that stiff joints hold."""
    robot, q = arm(), touching(arm(), 0.0)
    plant = begin(PybulletArm(robot, surface(friction=0.0), contact=contact), q)  # pyright: ignore[reportArgumentType]
    forces = []
    for k in range(400):
        comes = STILL._replace(surface_offset=-0.02 * k * PERIOD, surface_velocity=-0.02)
        true = true_state(plant, comes)
        weight = robot.kinematics(true.joint_position, true.joint_velocity).regressor[0] @ robot.dynamic_parameters()
        torque = weight + 3000 * (q - true.joint_position) - 20 * true.joint_velocity
        plant.advance(torque_command(torque), comes)
        forces.append(plant.measure(comes).wrench[2])
    plant.close()
    return np.array(forces)


def test_the_engines_wall_moves_as_the_explicit_one() -> None:
    explicit, engine = (held_against_a_coming_wall(contact) for contact in ("explicit", "engine"))
    assert explicit[-1] > 5.0
    np.testing.assert_allclose(engine[50:], explicit[50:], atol=0.05)


@pytest.mark.parametrize("friction", [0.2, 0.6])
def test_the_engines_friction_is_coulombs(friction: float) -> None:
    robot = arm()
    plant = begin(PybulletArm(robot, surface(friction=friction), contact="engine"), touching(robot, 0.005))
    wrench = np.zeros(6)
    for k in range(600):
        true = true_state(plant)
        at = robot.kinematics(true.joint_position, true.joint_velocity)
        pull = 2000 * (0.1 + 0.05 * k * PERIOD - at.position[0]) + 60 * (0.05 - at.velocity[0])
        wished = np.array([pull, 5.0 - 60 * at.velocity[1]])
        plant.advance(torque_command(at.regressor[0] @ robot.dynamic_parameters() + at.jacobian.T @ wished), STILL)
        wrench = plant.measure(STILL).wrench
    plant.close()
    assert wrench[0] / wrench[2] == pytest.approx(friction, rel=1e-3)
    assert wrench[2] == pytest.approx(5.0, rel=0.05)


def test_servo_and_torque_actuation_agree_at_rest() -> None:
    plant = begin(PybulletArm(arm(), FAR_AWAY, Actuation("position_servo", stiffness=200.0)), (0.4, 1.3))
    hold, before = plant.holding_command(), plant.measure(STILL).joint_position
    for _ in range(200):
        plant.advance(hold, STILL)
    np.testing.assert_allclose(plant.measure(STILL).joint_position, before, atol=1e-7)
    plant.close()


def test_what_the_engine_cannot_do_is_refused() -> None:
    with pytest.raises(ValueError, match="dynamic_lengths"):
        PybulletArm(arm(dynamic_lengths=(0.1, 0.1)), surface())
    with pytest.raises(ValueError, match="pulls"):
        PybulletArm(arm(), surface(pulls=True), contact="engine")


def test_pictures_show_the_arm_where_it_is() -> None:
    driver = PybulletArm(arm(), surface())
    first, same, other = driver.render(np.array([[0.4, 1.3], [0.4, 1.3], [1.2, 0.4]]), 64, 48)
    assert first.shape == (48, 64, 3)
    assert first.dtype == np.uint8
    np.testing.assert_array_equal(first, same)
    assert np.count_nonzero(first != other) > 50
