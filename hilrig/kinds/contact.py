"""Contact between the end effector and a flat surface: an explicit spring-damper with friction."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, NamedTuple

from hilrig.core.compiler import kernel
from hilrig.core.parameters import Parameter

FRICTION_SPEED = 5e-3
"""m/s: sliding speed below which friction decreases linearly (regularised Coulomb)"""


@dataclass(frozen=True)
class Surface:
    """A surface whose normal is the last task axis: F_n = K (z - z_e) + B (z' - z_e'), F_t = mu F_n sat(x'/eps).

    F is the force that the robot exerts, positive in penetration. With `pulls` false (the physical case) F_n is never
    negative, and zero without penetration; with `pulls` true the formula holds everywhere, as printed in the paper.
    """

    position: Annotated[float, Parameter("m", "undisturbed position along its normal, z_e")]
    stiffness: Annotated[float, Parameter("N/m", "K_e", 0.0, 1e7, "log")] = 800.0
    damping: Annotated[float, Parameter("N*s/m", "B_e", 0.0, 1e5, "log")] = 20.0
    friction: Annotated[float, Parameter("", "Coulomb coefficient mu along the surface", 0.0, 2.0)] = 0.0
    pulls: Annotated[bool, Parameter("", "whether it also pulls, as in the printed formula")] = False

    def constants(self) -> SurfaceState:
        """Return the undisturbed surface."""
        return SurfaceState(self.position, 0.0, self.stiffness, self.damping, self.friction, self.pulls)


class SurfaceState(NamedTuple):
    """The surface at one instant, disturbances included."""

    position: float
    """z_e, m"""
    velocity: float
    """z_e', m/s"""
    stiffness: float
    """K_e, N/m"""
    damping: float
    """B_e, N s/m"""
    friction: float
    """mu"""
    pulls: bool


@kernel
def contact_force(surface: SurfaceState, z: float, z_rate: float, slip: float) -> tuple[float, float]:
    """Return the (normal, tangential) force that the robot exerts, N, at z (m), z' and sliding speed `slip` (m/s)."""
    depth = z - surface.position
    if depth <= 0.0 and not surface.pulls:
        return 0.0, 0.0
    normal = surface.stiffness * depth + surface.damping * (z_rate - surface.velocity)
    # The tip leaves faster than the surface can follow: the damper alone would pull.
    if normal < 0.0 and not surface.pulls:
        return 0.0, 0.0
    # A plain sign would flip from one step to the next while the tip is at rest.
    saturated = min(max(slip / FRICTION_SPEED, -1.0), 1.0)
    return normal, surface.friction * abs(normal) * saturated
