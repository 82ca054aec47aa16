"""The error of the desired dynamics, eq. (25) of the paper, over a recorded trial.

Separate from the filter, because metrics of a record need no kernels.
"""

from __future__ import annotations

from hilrig.core.interfaces import Impedance
from hilrig.core.signals import Array, Reference


def auxiliary_error(
    impedance: Impedance, position: Array, velocity: Array, acceleration: Array, force: Array, reference: Reference
) -> Array:
    """Return e_aux of eq. (25), the deviation from the desired dynamics (3), N. All signals are (N, m).

    e_aux = M_d (x'' - Sigma x_d'') + B_d (x' - Sigma x_d') + K_d Sigma (x - x_d) - (I - Sigma) F_d + F_e, where x' is
    the full velocity: a force-controlled axis is damped, as in (4).
    """
    sigma = impedance.sigma
    inertial = impedance.inertia * (acceleration - sigma * reference.acceleration)
    damped = impedance.damping * (velocity - sigma * reference.velocity)
    elastic = impedance.stiffness * sigma * (position - reference.position)
    return inertial + damped + elastic - (1 - sigma) * reference.force + force
