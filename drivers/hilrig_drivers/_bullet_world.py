"""A PyBullet world with one planar arm and one surface. The only file that imports pybullet.

Task frame and world frame coincide: x and z span the arm's plane, y is normal to it, and q increases from x towards z,
which is a rotation about -y.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from typing import Any

import numpy as np

from hilrig import Array, Picture, Surface, SurfaceState
from hilrig.kinds.robots.planar_2r import Planar2r
from hilrig_drivers._planar import tip_force


@contextmanager
def silent_output() -> Iterator[None]:
    """Suppress the output of native code: PyBullet prints a message on import and at every connection."""
    sys.stdout.flush()
    sys.stderr.flush()
    kept, nowhere = (os.dup(1), os.dup(2)), os.open(os.devnull, os.O_WRONLY)
    try:
        for stream in (1, 2):
            os.dup2(nowhere, stream)
        yield
    finally:
        for stream, copy in zip((1, 2), kept, strict=True):
            os.dup2(copy, stream)
            os.close(copy)
        os.close(nowhere)


with silent_output():
    import pybullet

ARM_JOINTS = 2
TIP_LINK = 2
TIP_RADIUS = 0.015
WALL_HALF_DEPTH = 0.02
NO_ROTATION = (0.0, 0.0, 0.0, 1.0)


class Engine:
    """One connection to Bullet: its functions, bound to this connection on first use."""

    def __init__(self) -> None:
        with silent_output():
            self._client = pybullet.connect(pybullet.DIRECT)

    def __getattr__(self, name: str) -> Any:
        bound = partial(getattr(pybullet, name), physicsClientId=self._client)
        setattr(self, name, bound)
        return bound


class World:
    """The engine with the arm in it."""

    def __init__(self, robot: Planar2r, step_size: float) -> None:
        self.step_size = step_size
        self._closed = False
        self.engine = Engine()
        self.engine.setTimeStep(step_size)
        self.engine.setPhysicsEngineParameter(enableFileCaching=0)
        self.engine.setGravity(robot.gravity[0], 0.0, robot.gravity[1])
        self.arm = self._load(robot)
        for link in range(-1, TIP_LINK + 1):
            self.engine.changeDynamics(
                self.arm, link, linearDamping=0.0, angularDamping=0.0, jointDamping=0.0, maxJointVelocity=1e3
            )
        self._joints = list(range(ARM_JOINTS))
        # Bullet's joints brake by default; torque control needs their velocity motors off.
        self.engine.setJointMotorControlArray(
            self.arm, self._joints, pybullet.VELOCITY_CONTROL, forces=[0.0] * ARM_JOINTS
        )

    def _load(self, robot: Planar2r) -> int:
        # Bullet only accepts a path. A file in memory has one, whatever the user's temporary folder is like.
        with os.fdopen(os.memfd_create("arm.urdf"), "w") as file:
            file.write(urdf(robot))
            file.flush()
            path = f"/proc/self/fd/{file.fileno()}"
            return self.engine.loadURDF(path, useFixedBase=True, flags=pybullet.URDF_USE_INERTIA_FROM_FILE)

    def place(self, joint_position: Array) -> None:
        """Put the arm at rest at `joint_position` (2,) rad."""
        for joint, angle in enumerate(joint_position):
            self.engine.resetJointState(self.arm, joint, float(angle), 0.0)

    def joints(self) -> tuple[Array, Array]:
        """Return q (rad) and q' (rad/s), (2,) each."""
        first, second = self.engine.getJointStates(self.arm, self._joints)
        return np.array([first[0], second[0]]), np.array([first[1], second[1]])

    def push_tip(self, force: Array, position: Array) -> None:
        """Apply a force (x, z) N to the tip at `position` (x, z) m for the next step."""
        self.engine.applyExternalForce(
            self.arm,
            TIP_LINK,
            (force[0], 0.0, force[1]),
            (position[0], 0.0, position[1]),
            pybullet.WORLD_FRAME,
        )

    def step(self, torque: Array) -> None:
        """Step once with the joint torque (2,) N m."""
        self.engine.setJointMotorControlArray(self.arm, self._joints, pybullet.TORQUE_CONTROL, forces=torque.tolist())
        self.engine.stepSimulation()

    def add_wall(self, surface: Surface, solid: bool = False) -> int:
        """Add a box at the surface and return its id; the tip's sphere touches it when the tip is at the surface."""
        half = (0.5, 0.06, WALL_HALF_DEPTH)
        shape = self.engine.createCollisionShape(pybullet.GEOM_BOX, halfExtents=half) if solid else -1
        look = self.engine.createVisualShape(pybullet.GEOM_BOX, halfExtents=half, rgbaColor=(0.75, 0.8, 0.85, 1))
        return self.engine.createMultiBody(0.0, shape, look, self.wall_center(surface.position))

    @staticmethod
    def wall_center(surface_position: float) -> tuple[float, float, float]:
        """Return the centre of the box whose near face the tip's sphere touches at `surface_position` (m)."""
        return (0.0, 0.0, surface_position + TIP_RADIUS + WALL_HALF_DEPTH)

    def picture(self, joint_position: Array, width: int, height: int) -> Picture:
        """Return an RGB picture (height, width, 3) uint8 of the arm at `joint_position` (2,) rad."""
        self.place(joint_position)
        view = self.engine.computeViewMatrix((0.0, -1.05, 0.12), (0.0, 0.0, 0.17), (0, 0, 1))
        lens = self.engine.computeProjectionMatrixFOV(50.0, width / height, 0.05, 4.0)
        raw = self.engine.getCameraImage(
            width, height, view, lens, lightDirection=(0.6, -1.5, 1.2), renderer=pybullet.ER_TINY_RENDERER
        )
        return np.asarray(raw[2], dtype=np.uint8).reshape(height, width, 4)[:, :, :3]

    def close(self) -> None:
        """Disconnect from the engine, once."""
        if not self._closed:
            self._closed = True
            self.engine.disconnect()


class ExplicitContact:
    """The surface as a spring-damper force that hilrig computes and applies at the tip."""

    def __init__(self, world: World) -> None:
        self._world = world

    def force(self, surface: SurfaceState, position: Array, velocity: Array) -> Array:
        """Return the force (x, z) N that the robot exerts on the surface."""
        return tip_force(surface, np.zeros(2), position, velocity)

    def apply(self, surface: SurfaceState, position: Array, velocity: Array, external: Array) -> None:
        """Push the tip for the next step: contact and external force."""
        self._world.push_tip(-tip_force(surface, external, position, velocity), position)


class EngineContact:
    """The surface as a body that Bullet's solver keeps the tip out of; its force is that of the last step.

    It is zero before the first step. Bullet leaves 10 um of slop, and its friction acts on the surface of the sphere,
    TIP_RADIUS beyond the tip, so it turns the arm a little where friction in the explicit model does not.
    """

    def __init__(self, world: World, surface: Surface) -> None:
        self._world, self._engine = world, world.engine
        self._wall = world.add_wall(surface, solid=True)
        self._settings: tuple[float, ...] = ()
        self._engine.changeDynamics(world.arm, TIP_LINK, lateralFriction=1.0)

    def force(self, surface: SurfaceState, position: Array, velocity: Array) -> Array:
        """Return the force (x, z) N that the robot exerts on the surface, as of the last step."""
        total = np.zeros(3)
        for point in self._engine.getContactPoints(self._world.arm, self._wall):
            normal, first, second = np.array(point[7]), np.array(point[11]), np.array(point[13])
            total -= point[9] * normal + point[10] * first + point[12] * second
        return np.array([total[0], total[2]])

    def apply(self, surface: SurfaceState, position: Array, velocity: Array, external: Array) -> None:
        """Move the wall and push the tip for the next step."""
        self._set(surface)
        center = self._world.wall_center(surface.position)
        self._engine.resetBasePositionAndOrientation(self._wall, center, NO_ROTATION)
        self._engine.resetBaseVelocity(self._wall, (0.0, 0.0, surface.velocity))
        self._world.push_tip(-external, position)

    def _set(self, surface: SurfaceState) -> None:
        """Pass changed contact parameters to the engine; doing so at every step would be slow."""
        settings = (surface.stiffness, surface.damping, surface.friction)
        if settings != self._settings:
            self._engine.changeDynamics(
                self._wall,
                -1,
                contactStiffness=settings[0],
                contactDamping=settings[1],
                lateralFriction=settings[2],
            )
            self._settings = settings


def urdf(robot: Planar2r) -> str:
    """Return the URDF of the arm: two links and a massless tip with a small sphere."""
    (l1, l2), masses = robot.lengths, robot.masses
    centers, inertias = robot.mass_distribution()
    links = "".join(
        _link(f"link_{i + 1}", length, mass, center, inertia)
        for i, (length, mass, center, inertia) in enumerate(zip(robot.lengths, masses, centers, inertias, strict=True))
    )
    return f"""<robot name="planar_2r">
<link name="base"><inertial><mass value="1"/>
<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>
{links}<link name="tip"><inertial><mass value="0"/><inertia ixx="0" ixy="0" ixz="0" iyy="0" iyz="0" izz="0"/></inertial>
<visual><geometry><sphere radius="{TIP_RADIUS}"/></geometry>
<material name="tip"><color rgba="0.84 0.37 0 1"/></material></visual>
<collision><geometry><sphere radius="{TIP_RADIUS}"/></geometry></collision></link>
{_joint("joint_1", "base", "link_1", 0.0)}{_joint("joint_2", "link_1", "link_2", l1)}
<joint name="tip_joint" type="fixed"><parent link="link_2"/><child link="tip"/><origin xyz="{l2!r} 0 0"/></joint>
</robot>"""


def _link(name: str, length: float, mass: float, center: float, inertia: float) -> str:
    size = f"{length!r} 0.03 0.03"
    colour = "0.35 0.39 0.46 1" if name == "link_1" else "0 0.45 0.7 1"
    return f"""<link name="{name}">
<inertial><origin xyz="{center!r} 0 0"/><mass value="{mass!r}"/>
<inertia ixx="{inertia!r}" ixy="0" ixz="0" iyy="{inertia!r}" iyz="0" izz="{inertia!r}"/></inertial>
<visual><origin xyz="{length / 2!r} 0 0"/><geometry><box size="{size}"/></geometry>
<material name="{name}"><color rgba="{colour}"/></material></visual></link>
"""


def _joint(name: str, parent: str, child: str, offset: float) -> str:
    return f"""<joint name="{name}" type="revolute"><parent link="{parent}"/><child link="{child}"/>
<origin xyz="{offset!r} 0 0"/><axis xyz="0 -1 0"/><limit lower="-100" upper="100" effort="1e6" velocity="1e3"/></joint>
"""
