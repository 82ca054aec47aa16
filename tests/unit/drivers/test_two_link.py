from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest
import scipy.integrate
from helpers import rods
from helpers.builders import FAR_AWAY, STILL, arm, begin, surface, torque_command, true_state
from hilrig_drivers.two_link import TwoLink

from hilrig.core.interfaces import TrialStart
from hilrig.core.signals import Array, Truth
from hilrig.kinds.actuation import Actuation

Q = (0.4, 1.3)
ARM = arm(gravity=(-3.0, -9.81))


def swing(driver: TwoLink, period: float, steps: int, torque: tuple[float, float] = (0.0, 0.0)) -> list[Truth]:
    """Return the truth at every tick under a constant torque."""
    plant = begin(driver, Q, period)
    seen = [true_state(plant)]
    for _ in range(steps):
        plant.advance(torque_command(torque), STILL)
        seen.append(true_state(plant))
    return seen


def end_of_swing(substep: float) -> Array:
    last = swing(TwoLink(ARM, FAR_AWAY, substep=substep), 0.2, 1)[-1]
    return np.concatenate([last.joint_position, last.joint_velocity])


def test_runge_kutta_is_of_fourth_order() -> None:
    exact = end_of_swing(1e-4)
    errors = [np.abs(end_of_swing(substep) - exact).max() for substep in (5e-3, 2.5e-3, 1.25e-3)]
    for coarse, fine in itertools.pairwise(errors):
        assert 13.0 < coarse / fine < 19.0


def test_free_fall_keeps_its_energy() -> None:
    seen = swing(TwoLink(ARM, FAR_AWAY), 1e-2, 100)
    energies = [rods.energy(ARM, now.joint_position, now.joint_velocity) for now in seen]
    assert max(np.abs(now.joint_velocity).max() for now in seen) > 3.0, "it does swing"
    np.testing.assert_allclose(energies, energies[0], atol=1e-7)


def test_an_arm_left_to_itself_keeps_its_energy() -> None:
    """q'^T (M' - 2C) q' = 0, in free space, without gravity or friction."""
    weightless = arm(gravity=(0.0, 0.0))
    plant = begin(TwoLink(weightless, FAR_AWAY), (0.2, 1.0), 1e-3)
    for _ in range(100):
        plant.advance(torque_command((3.0, 0.0)), STILL)
    energies = []
    for _ in range(1000):
        now = true_state(plant)
        energies.append(rods.energy(weightless, now.joint_position, now.joint_velocity))
        plant.advance(torque_command((0.0, 0.0)), STILL)
    assert energies[0] > 0.1, "it does spin"
    np.testing.assert_allclose(energies, energies[0], rtol=1e-7)


def test_work_done_is_energy_stored_and_lost() -> None:
    """Motors' work = energy of arm and surface's spring + what friction and the surface's damper take."""
    touched = surface(position=-0.02, pulls=True, friction=0.3)
    coulomb, viscous = np.array([0.2, 0.1]), np.array([0.05, 0.02])
    torque, dt = np.array([2.0, 0.5]), 1e-4
    seen = swing(TwoLink(ARM, touched, coulomb=(0.2, 0.1), viscous=(0.05, 0.02), substep=dt), dt, 4000, (2.0, 0.5))

    def stored(now: Truth) -> float:
        return rods.energy(ARM, now.joint_position, now.joint_velocity) + 400.0 * (now.position[1] + 0.02) ** 2

    def lost(now: Truth) -> float:
        rate, speed = now.joint_velocity, now.velocity
        joints = rate @ (coulomb * np.tanh(rate / 5e-3) + viscous * rate)
        return joints + 20.0 * speed[1] ** 2 + now.wrench[0] * speed[0]

    work = np.trapezoid([torque @ now.joint_velocity for now in seen], dx=dt)
    loss = np.trapezoid([lost(now) for now in seen], dx=dt)
    assert loss > 0.1, "there is a loss to account for"
    assert work == pytest.approx(stored(seen[-1]) - stored(seen[0]) + loss, abs=2e-3 * loss)


NUDGED = STILL._replace(
    tip_force=np.array([2.0, -3.0]), surface_offset=0.01, surface_velocity=0.4, stiffness_scale=1.5,
    surface_friction_scale=0.7, joint_friction_scale=1.8,
)  # fmt: skip
SERVO = Actuation("position_servo", stiffness=40.0, damping=0.7)


@pytest.mark.parametrize("actuation", [Actuation(), SERVO, replace(SERVO, gravity_compensation=True)])
def test_a_period_under_every_disturbance_is_what_another_integrator_finds(actuation: Actuation) -> None:
    """M q'' = tau - C q' - G - F - J^T F_e by the mechanics of `rods` and SciPy; the surface moves."""
    coulomb, viscous, period = np.array([0.2, 0.1]), np.array([0.05, 0.02]), 5e-3
    driver = TwoLink(ARM, surface(position=0.32, pulls=True), actuation, (0.2, 0.1), (0.05, 0.02), substep=1e-3)
    plant = driver.connect(TrialStart(period, np.array(Q), np.zeros(2)))
    plant.measure(STILL)
    command = torque_command((2.0, 0.5), np.array(Q) + np.array([0.1, 0.02]))
    plant.kernels().state[2:4] = 1.0, -1.5
    start = true_state(plant)

    def motors(q: Array, rate: Array) -> Array:
        if actuation.mode == "torque":
            return command.torque
        given = 40.0 * (command.position - q) - 0.7 * rate
        return given + rods.gravity_torque(ARM, q) if actuation.gravity_compensation else given

    def rates(t: float, s: Array) -> Array:
        q, rate = s[:2], s[2:]
        at = ARM.kinematics(q, rate)
        speed = at.jacobian @ rate
        normal = 1.5 * 800.0 * (at.position[1] - (0.32 + 0.01 + 0.4 * t)) + 20.0 * (speed[1] - 0.4)
        force = np.array([0.7 * 0.2 * abs(normal) * np.clip(speed[0] / 5e-3, -1, 1) + 2.0, normal - 3.0])
        net = motors(q, rate) - rods.inverse_dynamics(ARM, q, rate, np.zeros(2)) - at.jacobian.T @ force
        net -= 1.8 * (coulomb * np.tanh(rate / 5e-3) + viscous * rate)
        return np.concatenate([rate, np.linalg.solve(rods.mass_matrix(ARM, q), net)])

    initial = np.concatenate([start.joint_position, start.joint_velocity])
    found = scipy.integrate.solve_ivp(rates, (0.0, period), initial, rtol=1e-10, atol=1e-12, dense_output=True)
    plant.advance(command, NUDGED)
    end = true_state(plant)
    np.testing.assert_allclose([*end.joint_position, *end.joint_velocity], found.y[:, -1], rtol=2e-4)
    before_last = found.sol(period - 1e-3)
    applied = plant.measure(NUDGED).applied_torque
    np.testing.assert_allclose(applied, motors(before_last[:2], before_last[2:]), rtol=2e-4)


def test_what_holds_the_arm_is_found_once() -> None:
    """Later measurements leave the motors' torque as it is, and the command to hold does not change behind its back."""
    plant = begin(TwoLink(arm(), surface()), Q)
    hold = plant.holding_command()
    first = hold.torque.copy()
    plant.advance(torque_command((1.0, 2.0)), STILL)
    np.testing.assert_array_equal(plant.measure(STILL).applied_torque, [1.0, 2.0])
    np.testing.assert_array_equal(hold.torque, first)


def test_a_pendulum_and_its_mirror_image_swing_alike() -> None:
    hanging, period = arm(gravity=(0.0, -9.81)), 1e-3
    left, right = (
        begin(TwoLink(hanging, FAR_AWAY), q, period) for q in ((-np.pi / 2 - 0.4, -0.3), (-np.pi / 2 + 0.4, 0.3))
    )
    for _ in range(300):
        for plant in (left, right):
            plant.advance(torque_command((0.0, 0.0)), STILL)
    a, b = true_state(left), true_state(right)
    np.testing.assert_allclose(
        a.joint_position + np.pi / 2 * np.array([1, 0]), -(b.joint_position + np.pi / 2 * np.array([1, 0])), atol=1e-9
    )
    assert a.joint_velocity == pytest.approx(-b.joint_velocity, abs=1e-9)


def test_small_swings_have_the_pendulums_period() -> None:
    """A rod with next to nothing behind it swings with T = 2 pi sqrt(2 l / (3 g))."""
    hanging = arm(gravity=(0.0, -9.81), lengths=(0.345, 0.001), masses=(1.8, 0.001))
    plant = begin(TwoLink(hanging, FAR_AWAY), (-np.pi / 2 + 0.01, 0.0))
    quarter = np.pi / 2 * np.sqrt(2 * 0.345 / (3 * 9.81))
    for _ in range(round(quarter / 1e-3)):
        plant.advance(torque_command((0.0, 0.0)), STILL)
    late = round(quarter / 1e-3) * 1e-3 - quarter
    speed = 0.01 * np.pi / 2 / quarter
    assert true_state(plant).joint_position[0] == pytest.approx(-np.pi / 2 - speed * late, abs=1e-5)
    assert true_state(plant).joint_velocity[0] == pytest.approx(-speed, rel=2e-3)


@pytest.mark.parametrize(
    "actuation", [Actuation(), Actuation("position_servo"), Actuation("position_servo", gravity_compensation=True)]
)
def test_held_at_rest_in_contact_nothing_moves(actuation: Actuation) -> None:
    plant = begin(TwoLink(arm(), surface(), actuation), arm().inverse_kinematics(np.array([0.1, 0.36])))
    assert true_state(plant).wrench[2] == pytest.approx(8.0)
    hold, before = plant.holding_command(), true_state(plant)
    for _ in range(500):
        plant.advance(hold, STILL)
    after = true_state(plant)
    np.testing.assert_allclose(after.joint_position, before.joint_position, atol=1e-9)
    np.testing.assert_allclose(after.wrench, before.wrench, atol=1e-6)


def test_a_servo_as_stiff_as_k_ref_follows_the_torque() -> None:
    """With q_ref = q + tau/k_ref made anew at every short period the servo's arm moves as the torque's does."""
    servo = Actuation("position_servo", k_ref=15.0, stiffness=15.0, damping=0.0)
    direct, through = begin(TwoLink(ARM, FAR_AWAY), Q, 1e-4), begin(TwoLink(ARM, FAR_AWAY, servo), Q, 1e-4)
    torque = np.array([4.0, 1.0])
    for _ in range(1000):
        direct.advance(torque_command(torque), STILL)
        now = true_state(through).joint_position
        through.advance(torque_command(torque, now + torque / 15.0), STILL)
    moved = true_state(direct).joint_position - np.array(Q)
    assert np.abs(moved).max() > 0.05
    np.testing.assert_allclose(
        true_state(through).joint_position, true_state(direct).joint_position, atol=0.01 * np.abs(moved).max()
    )


def test_a_moving_surface_pushes_and_drags() -> None:
    """At rest against a surface that comes nearer at 0.1 m/s the force is K depth + B 0.1."""
    plant = begin(TwoLink(arm(), surface()), arm().inverse_kinematics(np.array([0.1, 0.36])))
    nearer = STILL._replace(surface_offset=-0.005, surface_velocity=-0.1)
    assert true_state(plant, nearer).wrench[2] == pytest.approx(800 * 0.015 + 20 * 0.1)
    assert true_state(plant, nearer).surface_position == pytest.approx(0.345)
