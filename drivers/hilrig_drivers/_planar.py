"""What the simulated planar arms share: their surface, disturbed, the force at their tip, friction in their joints."""

from __future__ import annotations

import numpy as np

from hilrig.contact import Surface, SurfaceState, contact_force
from hilrig.kernel import kernel
from hilrig.robots.planar_2r import FRICTION_RATE
from hilrig.signals import Array, Inputs, Nudge

PLANT_INPUTS = tuple(name for name in Inputs._fields if name.startswith("plant_"))
"""Every plant disturbance there is."""


def surface_now(surface: Surface, disturbance: Nudge) -> SurfaceState:
    """Return the surface with its disturbances."""
    return SurfaceState(
        surface.position + disturbance.surface_offset,
        disturbance.surface_velocity,
        surface.stiffness * disturbance.stiffness_scale,
        surface.damping,
        surface.friction * disturbance.surface_friction_scale,
        surface.pulls,
    )


def planar_wrench(force: Array) -> Array:
    """Return the wrench (6,) of a force (x, z)."""
    return np.array([force[0], 0.0, force[1], 0.0, 0.0, 0.0])


@kernel
def tip_force(surface: SurfaceState, external: Array, position: Array, velocity: Array) -> Array:
    """Return F_e (x, z): contact plus the external force, N."""
    normal, tangential = contact_force(surface, position[1], velocity[1], velocity[0])
    return np.array([tangential + external[0], normal + external[1]])


@kernel
def joint_friction(coulomb: Array, viscous: Array, scale: float, rate: Array) -> Array:
    """Return scale (f tanh(q'/eps) + b q'), (2,) N m."""
    return scale * (coulomb * np.tanh(rate / FRICTION_RATE) + viscous * rate)


@kernel
def moved(surface: SurfaceState, after: float) -> SurfaceState:
    """Return the surface `after` seconds into the period, moving at its constant rate."""
    return SurfaceState(
        surface.position + after * surface.velocity, surface.velocity, surface.stiffness, surface.damping,
        surface.friction, surface.pulls,
    )  # fmt: skip
