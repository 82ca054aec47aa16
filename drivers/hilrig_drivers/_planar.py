"""Shared by the simulated planar arms: parameters, the disturbed surface, and the forces on the joints."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated, NamedTuple

import numpy as np

from hilrig import (
    Actuation,
    Array,
    DisturbanceSchedule,
    Parameter,
    PlantDisturbance,
    Servo,
    Surface,
    SurfaceState,
    contact_force,
    jitable,
    kernel,
)
from hilrig.kinds.robots.planar_2r import FRICTION_RATE, Geometry, Planar2r

PLANT_INPUTS = tuple(name for name in DisturbanceSchedule._fields if name.startswith("plant_"))
"""All plant disturbances."""


Pair = tuple[float, float]


@dataclass(frozen=True)
class PlanarArm:
    """A simulated planar arm facing a surface whose normal is the last task axis.

    Friction of the joints: F(q') = f tanh(q'/5e-3) + b q', with `coulomb` f and `viscous` b per joint.
    """

    robot: Planar2r
    surface: Surface
    actuation: Actuation = field(default_factory=Actuation)
    coulomb: Annotated[Pair, Parameter("N*m", "Coulomb friction of the joints", 0.0, 1e3)] = (0.0, 0.0)
    viscous: Annotated[Pair, Parameter("N*m*s/rad", "viscous friction of the joints", 0.0, 1e3)] = (0.0, 0.0)

    @property
    def servo_gain(self) -> float | None:
        """k_ref of eq. (26), or None for torque actuation."""
        return self.actuation.k_ref if self.actuation.mode == "position_servo" else None

    @property
    def surface_position(self) -> float:
        """Nominal position of the surface along z, m."""
        return self.surface.position

    def constants(self) -> Constants:
        """Return the parameters for the kernels."""
        return Constants(
            self.robot.geometry(), tuple(self.robot.dynamic_parameters().tolist()), self.actuation.constants(),
            self.coulomb, self.viscous, self.surface.constants(),
        )  # fmt: skip


class Constants(NamedTuple):
    """What the forces on an arm depend on. Numbers only, because numba counts references to arrays at every call."""

    geometry: Geometry
    dynamics: tuple[float, ...]
    """theta of `Planar2r`, nine numbers"""
    servo: Servo
    coulomb: Pair
    viscous: Pair
    surface: SurfaceState
    """Undisturbed"""


@jitable
def surface_now(surface: SurfaceState, disturbance: PlantDisturbance) -> SurfaceState:
    """Return the undisturbed `surface` with its disturbances applied."""
    return SurfaceState(
        surface.position + disturbance.surface_offset,
        disturbance.surface_velocity,
        surface.stiffness * disturbance.stiffness_scale,
        surface.damping,
        surface.friction * disturbance.surface_friction_scale,
        surface.pulls,
    )


@jitable
def planar_wrench(x: float, z: float) -> Array:
    """Return the wrench (6,) of a force (x, z) N."""
    return np.array([x, 0.0, z, 0.0, 0.0, 0.0])


@kernel
def tip_force(surface: SurfaceState, external: Array, position: Array, velocity: Array) -> Array:
    """Return F_e (x, z): contact plus the external force, N."""
    normal, tangential = contact_force(surface, position[1], velocity[1], velocity[0])
    return np.array([tangential + external[0], normal + external[1]])


@kernel
def friction(c: Constants, scale: float, joint: int, rate: float) -> float:
    """Return scale (f tanh(q'/eps) + b q') of one joint, N m."""
    return scale * (c.coulomb[joint] * np.tanh(rate / FRICTION_RATE) + c.viscous[joint] * rate)
