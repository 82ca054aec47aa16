"""A planar arm in contact with a surface, simulated by PyBullet."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from importlib.util import find_spec
from typing import Annotated, ClassVar, Literal

from hilrig import Array, Capabilities, HilrigError, Parameter, Picture, Plant, TrialStart
from hilrig_drivers._planar import PLANT_INPUTS, PlanarArm


@dataclass(frozen=True)
class PybulletArm(PlanarArm):
    """The arm as a URDF made from the robot's parameters, stepped by Bullet's articulated-body algorithm.

    contact = explicit: the spring-damper of `surface` applied at the tip as an external force (exact stiffness);
    contact = engine:   a box that Bullet's solver keeps the tip out of, with the surface's stiffness and damping as
                        contact parameters (only approximately a spring-damper: the solver is implicit).
    Friction of the joints: f tanh(q'/5e-3) + b q'.
    """

    capabilities: ClassVar[Capabilities] = Capabilities(("lockstep", "realtime"), PLANT_INPUTS, simulated=True)

    contact: Literal["explicit", "engine"] = "explicit"
    substep: Annotated[float, Parameter("s", "largest engine step", 1e-5, 1e-2, "log")] = 5e-4

    def __post_init__(self) -> None:
        """Raise ValueError for what a URDF or the engine cannot represent."""
        if self.robot.dynamic_lengths not in (None, self.robot.lengths):
            raise ValueError("dynamic_lengths: a URDF has one set of lengths; use the driver two_link for two")
        if self.contact == "engine" and self.surface.pulls:
            raise ValueError("surface.pulls: the engine's contact cannot pull; use contact: explicit")

    def missing(self) -> str:
        """Return what to do if PyBullet is not installed; empty if it is."""
        if find_spec("pybullet") is not None:
            return ""
        if sys.version_info >= (3, 12):
            why = f"PyBullet, which has no wheels for Python 3.12 and newer (this is {sys.version.split()[0]})"
            remedy = "use Python 3.11, for example 'uv run --python 3.11 hilrig ...'"
        else:
            why, remedy = "PyBullet, which is not installed", "type: pip install 'hilrig[pybullet]'"
        return f"pybullet_arm needs {why}; {remedy}, or use another driver: --set driver.kind=two_link"

    def connect(self, start: TrialStart) -> Plant:
        """Return the arm at rest, held there by its motors. Raises HilrigError without PyBullet."""
        self._require_pybullet()
        # Imported here because the controller's process needs this driver's robot but no physics engine.
        from hilrig_drivers._bullet_plant import BulletPlant

        return BulletPlant(self, self.contact == "engine", self.substep, start)

    def render(self, joint_positions: Array, width: int, height: int) -> list[Picture]:
        """Return pictures (height, width, 3) uint8 of the arm at `joint_positions` (F, 2) rad.

        Raises HilrigError without PyBullet.
        """
        self._require_pybullet()
        from hilrig_drivers._bullet_world import World

        world = World(self.robot, 1e-3)
        world.add_wall(self.surface)
        pictures = [world.picture(q, width, height) for q in joint_positions]
        world.close()
        return pictures

    def _require_pybullet(self) -> None:
        if missing := self.missing():
            raise HilrigError(missing)
