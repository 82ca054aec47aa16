"""The paper's arm with the Jacobian as printed. docs/paper.md says what it does."""

from dataclasses import dataclass

import numpy as np

from hilrig import Array, Kinematics, RobotKernels, kernel
from hilrig.kinds.robots.planar_2r import Geometry, Planar2r, fill_kinematics


@dataclass(frozen=True)
class RobotAsPrinted(Planar2r):
    """`planar_2r`, but control laws get J = [[s1 + s12, s12], [c12, c12 + c1]], which is not the derivative of any
    position.

    The plant itself moves by the true Jacobian.
    """

    def kinematics(self, joint_position: Array, joint_velocity: Array) -> Kinematics:
        """Return geometry and regressor at (q, q')."""
        at = super().kinematics(joint_position, joint_velocity)
        misprint(joint_position, joint_velocity, at)
        return at

    def kernels(self) -> RobotKernels:
        """Return the kinematics as a kernel."""
        return RobotKernels(fill_kinematics_as_printed, self.geometry())


@kernel
def fill_kinematics_as_printed(geometry: Geometry, q: Array, rate: Array, at: Kinematics) -> None:
    """Write `RobotAsPrinted.kinematics` into `at`."""
    fill_kinematics(geometry, q, rate, at)
    misprint(q, rate, at)


@kernel
def misprint(q: Array, rate: Array, at: Kinematics) -> None:
    """Replace J, its rate and x' = J q' in `at`."""
    s1, c1 = np.sin(q[0]), np.cos(q[0])
    s12, c12 = np.sin(q[0] + q[1]), np.cos(q[0] + q[1])
    w1, w12 = rate[0], rate[0] + rate[1]
    j, d = at.jacobian, at.jacobian_rate
    j[0, 0], j[0, 1], j[1, 0], j[1, 1] = s1 + s12, s12, c12, c12 + c1
    d[0, 0], d[0, 1] = c1 * w1 + c12 * w12, c12 * w12
    d[1, 0], d[1, 1] = -s12 * w12, -s12 * w12 - s1 * w1
    at.velocity[0] = j[0, 0] * rate[0] + j[0, 1] * rate[1]
    at.velocity[1] = j[1, 0] * rate[0] + j[1, 1] * rate[1]
