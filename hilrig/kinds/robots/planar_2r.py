"""A planar arm with two revolute joints."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar, Literal, NamedTuple

import numpy as np

from hilrig.core.compiler import kernel
from hilrig.core.errors import OutOfReach
from hilrig.core.kernel_interfaces import RobotKernels
from hilrig.core.parameters import Parameter
from hilrig.core.signals import Array, Kinematics

FRICTION_RATE = 5e-3
"""rad/s: joint rate eps below which Coulomb friction decreases, F = f tanh(q'/eps)"""

Pair = tuple[float, float]


class Geometry(NamedTuple):
    """What the kernels need to know of the arm."""

    length_1: float
    """L1, m"""
    length_2: float
    """L2, m"""
    gravity_x: float
    """m/s^2"""
    gravity_z: float
    """m/s^2"""


@dataclass(frozen=True)
class Planar2r:
    """Two links in the (x, z) plane; q1 from the x axis, q2 from link 1, counter-clockwise towards z.

    x = L1 cos q1 + L2 cos(q1 + q2),  z = L1 sin q1 + L2 sin(q1 + q2)

    M(q) q'' + C(q, q') q' + G(q) + F(q') = tau - J^T F_e, linear in theta (9,):
    theta = (I1 + m1 c1^2 + m2 l1^2, m2 c2 l1, I2 + m2 c2^2, m1 c1 + m2 l1, m2 c2, f1, f2, b1, b2)
    in kg m^2 (three), kg m (two), N m (Coulomb, two) and N m s/rad (viscous, two). Friction is not part of the nominal
    model: f and b are zero in `dynamic_parameters`, and the driver models the plant's own friction.

    A link is a uniform slender rod unless `centers_of_mass` and `inertias` say otherwise; point masses at the ends, as
    in the paper, are centers_of_mass = dynamic_lengths and inertias = 0. `dynamic_lengths` lets the dynamics use other
    lengths than the kinematics, which the paper's Section V needs.
    """

    axes: ClassVar[tuple[str, ...]] = ("x", "z")
    joints: ClassVar[int] = 2

    lengths: Annotated[Pair, Parameter("m", "kinematic lengths L1, L2", 1e-3, 10.0)]
    masses: Annotated[Pair, Parameter("kg", "masses m1, m2", 1e-3, 1e3)]
    gravity: Annotated[Pair, Parameter("m/s^2", "gravity along (x, z)", -30.0, 30.0)] = (0.0, -9.81)
    dynamic_lengths: Annotated[Pair | None, Parameter("m", "dynamic lengths l1, l2; default: L1, L2", 1e-3, 10.0)] = (
        None
    )
    centers_of_mass: Annotated[Pair | None, Parameter("m", "c1, c2 from each joint; default: l/2", 0.0, 10.0)] = None
    inertias: Annotated[Pair | None, Parameter("kg*m^2", "I1, I2 about the centres; default: m l^2/12", 0.0, 1e3)] = (
        None
    )
    joint_lower: Annotated[Pair, Parameter("rad", "lowest joint positions", -7.0, 7.0)] = (-np.pi, -np.pi)
    joint_upper: Annotated[Pair, Parameter("rad", "highest joint positions", -7.0, 7.0)] = (np.pi, np.pi)
    torque_limit: Annotated[Pair, Parameter("N*m", "largest joint torques", 0.0, 1e4)] = (200.0, 200.0)
    elbow: Literal["positive", "negative"] = "positive"

    def geometry(self) -> Geometry:
        """Return the parameters for the kernels."""
        return Geometry(*self.lengths, *self.gravity)

    def kernels(self) -> RobotKernels:
        """Return the kinematics as a kernel."""
        return RobotKernels(fill_kinematics, self.geometry())

    def mass_distribution(self) -> tuple[Pair, Pair]:
        """Return the centres of mass c1, c2 (m, from each joint) and the inertias I1, I2 (kg m^2) about them."""
        l1, l2 = self.dynamic_lengths or self.lengths
        m1, m2 = self.masses
        return self.centers_of_mass or (l1 / 2, l2 / 2), self.inertias or (m1 * l1**2 / 12, m2 * l2**2 / 12)

    def forward_kinematics(self, joint_position: Array) -> Array:
        """Return (x, z) in m of the end effector."""
        return forward_kinematics(self.geometry(), joint_position)

    def inverse_kinematics(self, position: Array) -> Array:
        """Return q (2,) rad with the sign of q2 given by `elbow`. Raises OutOfReach."""
        l1, l2 = self.lengths
        x, z = float(position[0]), float(position[1])
        distance = float(np.hypot(x, z))
        cosine = (distance**2 - l1**2 - l2**2) / (2 * l1 * l2)
        if not abs(cosine) <= 1.0:
            raise OutOfReach(
                f"({x:.4g}, {z:.4g}) m is {distance:.4g} m from the shoulder; "
                f"the arm reaches from {abs(l1 - l2):.4g} m to {l1 + l2:.4g} m"
            )
        q2 = float(np.arccos(cosine)) * (1 if self.elbow == "positive" else -1)
        q1 = np.arctan2(z, x) - np.arctan2(l2 * np.sin(q2), l1 + l2 * np.cos(q2))
        return np.array([(q1 + np.pi) % (2 * np.pi) - np.pi, q2])

    def kinematics(self, joint_position: Array, joint_velocity: Array) -> Kinematics:
        """Return geometry and regressor at (q, q')."""
        return kinematics(self.geometry(), joint_position, joint_velocity)

    def dynamic_parameters(self) -> Array:
        """Return the nominal theta (9,), without friction."""
        m1, m2 = self.masses
        l1, _ = self.dynamic_lengths or self.lengths
        (c1, c2), (i1, i2) = self.mass_distribution()
        return np.array(
            [
                i1 + m1 * c1**2 + m2 * l1**2,
                m2 * c2 * l1,
                i2 + m2 * c2**2,
                m1 * c1 + m2 * l1,
                m2 * c2,
                0,
                0,
                0,
                0,
            ],
            dtype=np.float64,
        )

    def torque_limits(self) -> Array:
        """Return the largest joint torques (2,) N m."""
        return np.array(self.torque_limit)

    def joint_limits(self) -> tuple[Array, Array]:
        """Return the lowest and highest joint positions, (2,) rad each."""
        return np.array(self.joint_lower), np.array(self.joint_upper)


@kernel
def forward_kinematics(geometry: Geometry, q: Array) -> Array:
    """Return (x, z), (2,) m."""
    a, b = q[0], q[0] + q[1]
    l1, l2 = geometry.length_1, geometry.length_2
    return np.array([l1 * np.cos(a) + l2 * np.cos(b), l1 * np.sin(a) + l2 * np.sin(b)])


@kernel
def kinematics(geometry: Geometry, q: Array, rate: Array) -> Kinematics:
    """Return position, velocity, Jacobian, its rate, and the regressor at (q, q')."""
    at = Kinematics(np.empty(2), np.empty(2), np.empty((2, 2)), np.empty((2, 2)), np.zeros((5, 2, 9)))
    fill_kinematics(geometry, q, rate, at)
    return at


@kernel
def fill_kinematics(geometry: Geometry, q: Array, rate: Array, at: Kinematics) -> None:
    """Write `kinematics` into `at`; entries of the regressor that are always zero are not written."""
    l1, l2 = geometry.length_1, geometry.length_2
    s1, c1 = np.sin(q[0]), np.cos(q[0])
    s12, c12 = np.sin(q[0] + q[1]), np.cos(q[0] + q[1])
    w1, w12 = rate[0], rate[0] + rate[1]
    at.position[0], at.position[1] = l1 * c1 + l2 * c12, l1 * s1 + l2 * s12
    j, d = at.jacobian, at.jacobian_rate
    j[0, 0], j[0, 1], j[1, 0], j[1, 1] = -l1 * s1 - l2 * s12, -l2 * s12, l1 * c1 + l2 * c12, l2 * c12
    d[0, 0], d[0, 1] = -l1 * c1 * w1 - l2 * c12 * w12, -l2 * c12 * w12
    d[1, 0], d[1, 1] = -l1 * s1 * w1 - l2 * s12 * w12, -l2 * s12 * w12
    at.velocity[0] = j[0, 0] * rate[0] + j[0, 1] * rate[1]
    at.velocity[1] = j[1, 0] * rate[0] + j[1, 1] * rate[1]
    fill_regressor(geometry, q, rate, at.regressor)


@kernel
def fill_regressor(geometry: Geometry, q: Array, rate: Array, r: Array) -> None:
    """Write R (5, 2, 9) of `Kinematics`, except its zeros: constant part, then the parts of v1, v2, a1, a2."""
    gx, gz = geometry.gravity_x, geometry.gravity_z
    s2, c2 = np.sin(q[1]), np.cos(q[1])
    r[0, 0, 3] = gx * np.sin(q[0]) - gz * np.cos(q[0])
    r[0, 0, 4] = gx * np.sin(q[0] + q[1]) - gz * np.cos(q[0] + q[1])
    r[0, 1, 4] = r[0, 0, 4]
    for i in range(2):
        r[0, i, 5 + i] = np.tanh(rate[i] / FRICTION_RATE)
        r[1 + i, i, 7 + i] = 1.0
    # C v with h = m2 c2 l1 sin q2: [-h q2' v1 - h (q1' + q2') v2, h q1' v1]
    r[1, 0, 1] = -s2 * rate[1]
    r[2, 0, 1] = -s2 * (rate[0] + rate[1])
    r[1, 1, 1] = s2 * rate[0]
    # M a
    r[3, 0, 0], r[3, 0, 1], r[3, 0, 2] = 1.0, 2.0 * c2, 1.0
    r[4, 0, 1], r[4, 0, 2] = c2, 1.0
    r[3, 1, 1], r[3, 1, 2] = c2, 1.0
    r[4, 1, 2] = 1.0
