"""The PyBullet arm during one trial: its measurements, and the steps of one period."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from hilrig import (
    Array,
    Command,
    Measurement,
    PlantDisturbance,
    SurfaceState,
    TrialStart,
    Truth,
    holding_position,
    kernel,
    motor_torque,
)
from hilrig.kinds.robots.planar_2r import Geometry, kinematics
from hilrig_drivers._bullet_world import EngineContact, ExplicitContact, World
from hilrig_drivers._planar import Constants, PlanarArm, friction, planar_wrench, surface_now


class ArmState(NamedTuple):
    """The arm between two steps of the engine."""

    joint_position: Array
    joint_velocity: Array
    position: Array
    velocity: Array
    gravity: Array
    """G(q), (2,) N m"""
    jacobian: Array


class BulletPlant:
    """The arm in one trial."""

    def __init__(self, arm: PlanarArm, engine_contact: bool, substep: float, start: TrialStart) -> None:
        self._constants, self._dynamics = arm.constants(), arm.robot.dynamic_parameters()
        # Direct drive without friction is common, and skipping the call into a kernel saves time.
        self._direct = arm.servo_gain is None and not any((*arm.coulomb, *arm.viscous))
        self._steps = max(1, int(np.ceil(start.period / substep - 1e-9)))
        self._world = World(arm.robot, start.period / self._steps)
        self._world.place(start.joint_position)
        self._contact = EngineContact(self._world, arm.surface) if engine_contact else ExplicitContact(self._world)
        self._sight = self._look()
        self._torque: Array | None = None

    def measure(self, disturbance: PlantDisturbance) -> Measurement:
        """Return joint positions and the wrench that the robot exerts."""
        force = self._force(disturbance)
        if self._torque is None:
            self._torque = self._sight.gravity + self._sight.jacobian.T @ force
        return Measurement(self._sight.joint_position, planar_wrench(*force), self._torque)

    def advance(self, command: Command, disturbance: PlantDisturbance) -> None:
        """Step the engine through one period with the command held."""
        surface = surface_now(self._constants.surface, disturbance)
        for i in range(self._steps):
            now = moved(surface, i * self._world.step_size)
            observation = self._sight
            motor, net = self._drive(command, disturbance.joint_friction_scale)
            self._contact.apply(now, observation.position, observation.velocity, disturbance.tip_force)
            self._world.step(net)
            self._sight, self._torque = self._look(), motor

    def _drive(self, command: Command, friction_scale: float) -> tuple[Array, Array]:
        """Return the motors' torque, and what is left of it after joint friction."""
        if self._direct:
            # A copy, because it is reported later and the caller may write its next command into the same array.
            return command.torque.copy(), command.torque
        return motor_torques(self._constants, self._sight, friction_scale, command.torque, command.position)

    def holding_command(self) -> Command:
        """Return the command that holds the arm where it is."""
        torque = self._torque
        assert torque is not None, "measure() comes first"
        observation = self._sight
        return Command(
            torque, holding_position(torque, observation.joint_position, self._constants.servo, observation.gravity)
        )

    def truth(self, disturbance: PlantDisturbance) -> Truth:
        """Return the true state."""
        observation = self._sight
        place = self._constants.surface.position + disturbance.surface_offset
        wrench = planar_wrench(*self._force(disturbance))
        return Truth(
            observation.joint_position,
            observation.joint_velocity,
            observation.position,
            observation.velocity,
            wrench,
            place,
        )

    def _look(self) -> ArmState:
        return look(self._constants.geometry, self._dynamics, *self._world.joints())

    def _force(self, disturbance: PlantDisturbance) -> Array:
        surface = surface_now(self._constants.surface, disturbance)
        return self._contact.force(surface, self._sight.position, self._sight.velocity) + disturbance.tip_force

    def close(self) -> None:
        """Disconnect from the engine."""
        self._world.close()


def moved(surface: SurfaceState, after: float) -> SurfaceState:
    """Return the surface `after` seconds into the period, moving at its constant rate."""
    return surface._replace(position=surface.position + after * surface.velocity) if surface.velocity else surface


@kernel
def look(geometry: Geometry, dynamics: Array, q: Array, rate: Array) -> ArmState:
    """Return the arm's state that follows from the joints' positions (2,) rad and velocities (2,) rad/s."""
    at = kinematics(geometry, q, rate)
    # The nominal parameters have no friction, so the regressor's constant part is gravity alone.
    return ArmState(q, rate, at.position, at.velocity, np.dot(at.regressor[0], dynamics), at.jacobian)


@kernel
def motor_torques(
    c: Constants, observation: ArmState, friction_scale: float, torque: Array, reference: Array
) -> tuple[Array, Array]:
    """Return the motors' torque (2,) N m, and what is left of it after joint friction."""
    q, rate, gravity = observation.joint_position, observation.joint_velocity, observation.gravity
    motor, net = np.empty(2), np.empty(2)
    for i in range(2):
        motor[i] = motor_torque(c.servo, torque[i], reference[i], q[i], rate[i], gravity[i])
        net[i] = motor[i] - friction(c, friction_scale, i, rate[i])
    return motor, net
