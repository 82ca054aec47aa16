"""A planar arm in contact with a surface, simulated by PyBullet."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated, ClassVar, Literal

import numpy as np

from hilrig.actuation import Actuation, holding_position, motor_torque
from hilrig.contact import Surface
from hilrig.interfaces import Abilities, Begin, Parameter
from hilrig.robots.planar_2r import Planar2r, kinematics
from hilrig.signals import Array, Command, Kinematics, Measurement, Nudge, Truth
from hilrig_drivers._bullet_world import ARM_JOINTS, EngineContact, ExplicitContact, World
from hilrig_drivers._planar import PLANT_INPUTS, joint_friction, moved, planar_wrench, surface_now

Pair = tuple[float, float]


@dataclass(frozen=True)
class PybulletArm:
    """The arm as a URDF made from the robot's parameters, stepped by Bullet's articulated-body algorithm.

    contact = explicit: the spring-damper of `surface` applied at the tip as an external force (exact stiffness);
    contact = engine:   a box that Bullet's own solver keeps the tip out of, with the surface's stiffness and damping as
                        contact parameters (a spring-damper only approximately: the solver is implicit).
    Friction of the joints: f tanh(q'/5e-3) + b q'.
    """

    abilities: ClassVar[Abilities] = Abilities(("lockstep", "realtime"), PLANT_INPUTS, simulated=True)

    robot: Planar2r
    surface: Surface
    actuation: Actuation = field(default_factory=Actuation)
    coulomb: Annotated[Pair, Parameter("N*m", "Coulomb friction of the joints", 0.0, 1e3)] = (0.0, 0.0)
    viscous: Annotated[Pair, Parameter("N*m*s/rad", "viscous friction of the joints", 0.0, 1e3)] = (0.0, 0.0)
    contact: Literal["explicit", "engine"] = "explicit"
    substep: Annotated[float, Parameter("s", "engine step, at most", 1e-5, 1e-2, "log")] = 5e-4

    def __post_init__(self) -> None:
        """Raise ValueError for what a URDF cannot say."""
        if self.robot.dynamic_lengths not in (None, self.robot.lengths):
            raise ValueError("dynamic_lengths: a URDF has one set of lengths; use the driver two_link for two")
        if self.contact == "engine" and self.surface.pulls:
            raise ValueError("surface.pulls: the engine's contact cannot pull; use contact: explicit")

    @property
    def servo_gain(self) -> float | None:
        """k_ref of eq. (26), or None for torque actuation."""
        return self.actuation.k_ref if self.actuation.mode == "position_servo" else None

    @property
    def surface_position(self) -> float:
        """Nominal place of the surface along z, m."""
        return self.surface.position

    def begin(self, begin: Begin) -> BulletPlant:
        """Return the arm at rest, held there by its motors."""
        return BulletPlant(self, begin)

    def render(self, joint_positions: Array, width: int, height: int) -> list[Array]:
        """Return pictures (height, width, 3) uint8 of the arm at `joint_positions` (F, 2) rad."""
        world = World(self.robot, 1e-3)
        world.add_wall(self.surface)
        pictures = [world.picture(q, width, height) for q in joint_positions]
        world.close()
        return pictures


class BulletPlant:
    """The arm in one trial."""

    def __init__(self, driver: PybulletArm, begin: Begin) -> None:
        self._driver = driver
        self._geometry = driver.robot.geometry()
        self._nominal = driver.robot.dynamic_parameters()
        self._servo = driver.actuation.constants()
        self._coulomb, self._viscous = np.array(driver.coulomb), np.array(driver.viscous)
        self._steps = max(1, int(np.ceil(begin.period / driver.substep - 1e-9)))
        self._world = World(driver.robot, begin.period / self._steps)
        self._world.place(begin.joint_position)
        contact = EngineContact if driver.contact == "engine" else ExplicitContact
        self._contact = contact(self._world, driver.surface)
        self._torque: Array | None = None
        self._seen: tuple[Array, Array, Kinematics, Array] | None = None

    def measure(self, disturbance: Nudge) -> Measurement:
        """Return joint positions and the wrench the robot exerts."""
        q, _, at, gravity = self._now()
        force = self._force(at, disturbance)
        if self._torque is None:
            self._torque = gravity + at.jacobian.T @ force
        return Measurement(q, planar_wrench(force), self._torque)

    def advance(self, command: Command, disturbance: Nudge) -> None:
        """Step the engine through one period with the command held."""
        surface = surface_now(self._driver.surface, disturbance)
        for i in range(self._steps):
            now = moved(surface, i * self._world.step_size) if surface.velocity else surface
            q, rate, at, gravity = self._now()
            motor = motor_torque(self._servo, command.torque, command.position, q, rate, gravity)
            friction = joint_friction(self._coulomb, self._viscous, disturbance.joint_friction_scale, rate)
            self._contact.apply(now, at.position, at.velocity, disturbance.tip_force)
            self._world.step(motor - friction)
            self._torque, self._seen = motor, None

    def hold(self) -> Command:
        """Return the command that holds the arm where it is."""
        torque = self._torque
        assert torque is not None, "measure() comes first"
        q, _, _, gravity = self._now()
        return Command(torque, holding_position(torque, q, self._servo, gravity))

    def truth(self, disturbance: Nudge) -> Truth:
        """Return the true state."""
        q, rate, at, _ = self._now()
        place = self._driver.surface.position + disturbance.surface_offset
        return Truth(q, rate, at.position, at.velocity, planar_wrench(self._force(at, disturbance)), place)

    def _now(self) -> tuple[Array, Array, Kinematics, Array]:
        """Return q, q', the kinematics there and G(q), asked of the engine once per step."""
        if self._seen is None:
            q, rate = self._world.joints()
            at = kinematics(self._geometry, q, rate)
            self._seen = (q, rate, at, np.dot(at.regressor[0], self._nominal))
        return self._seen

    def _force(self, at: Kinematics, disturbance: Nudge) -> Array:
        surface = surface_now(self._driver.surface, disturbance)
        return self._contact.force(surface, at.position, at.velocity) + disturbance.tip_force

    def close(self) -> None:
        """Disconnect from the engine."""
        self._world.close()
