"""What a metric sees: the signals of one phase of one trial."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hilrig.core.interfaces import Impedance
from hilrig.core.signals import Array, Reference
from hilrig.kinds.auxiliary_error import auxiliary_error


@dataclass(frozen=True)
class PhaseRecord:
    """The signals of one phase (or of a whole trial) of one trial: N ticks, m task axes, n joints.

    Position, velocity, acceleration and force are the plant's true values where the driver knows them, otherwise
    measured or estimated. An entry of a reference is meaningful only in the axes that are controlled that way.
    """

    tick: Array
    """Tick numbers, (N,), ascending; a gap is a tick that was not recorded"""
    time: Array
    """Trial time, (N,) s"""
    phases: int
    """Number of phases of the experiment that the record spans"""
    period: float
    """s"""
    axes: tuple[str, ...]
    """Names of the task axes"""
    sigma: Array
    """(m,): 1 position-controlled, 0 force-controlled"""
    inertia: Array
    """M_d, (m,) kg"""
    damping: Array
    """B_d, (m,) N s/m"""
    stiffness: Array
    """K_d, (m,) N/m"""
    position: Array
    """x, (N, m) m"""
    velocity: Array
    """x', (N, m) m/s"""
    acceleration: Array
    """x'', (N, m) m/s^2"""
    force: Array
    """F_e that the robot exerts on its surroundings, (N, m) N"""
    reference_position: Array
    """x_d, (N, m) m"""
    reference_velocity: Array
    """(N, m) m/s"""
    reference_acceleration: Array
    """(N, m) m/s^2"""
    reference_force: Array
    """F_d, (N, m) N"""
    reference_step: Array
    """Jump of x_d at the beginning: from its previous value, or from x at the trial's start, (m,) m"""
    torque: Array
    """Commanded joint torque after limits, (N, n) N m"""
    late: Array
    """Late ticks since the previous recorded tick, including this one; unanswered ticks are not recorded, (N,)"""

    def position_error(self) -> dict[str, Array]:
        """Return e = x_d - x of each position-controlled axis, (N,) m."""
        error = self.reference_position - self.position
        return {axis: error[:, i] for i, axis in enumerate(self.axes) if self.sigma[i] == 1}

    def force_error(self) -> dict[str, Array]:
        """Return e_F = F_d - F_e of each force-controlled axis, (N,) N."""
        error = self.reference_force - self.force
        return {axis: error[:, i] for i, axis in enumerate(self.axes) if self.sigma[i] == 0}

    def auxiliary_error(self) -> Array:
        """Return e_aux of eq. (25), the deviation from the desired dynamics (3), (N, m) N."""
        impedance = Impedance(self.sigma, self.inertia, self.damping, self.stiffness, reference_states=False)
        reference = Reference(
            self.reference_position, self.reference_velocity, self.reference_acceleration, self.reference_force
        )
        return auxiliary_error(impedance, self.position, self.velocity, self.acceleration, self.force, reference)


def rms(values: Array) -> float:
    """Return the root mean square of all entries of `values`; NaN if there are none."""
    return float(np.sqrt(np.mean(np.square(values)))) if values.size else float("nan")


def peak(values: Array) -> float:
    """Return the largest magnitude in `values`; NaN if there are none."""
    return float(np.max(np.abs(values))) if values.size else float("nan")
