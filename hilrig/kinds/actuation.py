"""How a command becomes joint torque: directly, or through a position servo by eq. (26) of the paper."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal, NamedTuple

from hilrig.core.compiler import jitable, kernel
from hilrig.core.parameters import Parameter
from hilrig.core.signals import Array


@dataclass(frozen=True)
class Actuation:
    """mode = torque:  tau = the commanded torque.   mode = position_servo:  tau = K_s (q_ref - q) - D_s q' [+ G(q)]

    with q_ref(k) = tau_c(k-1)/k_ref + q(k-1), eq. (26). The loop's torque gain is K_s/k_ref: 1 if K_s = k_ref.
    """

    mode: Literal["torque", "position_servo"] = "torque"
    k_ref: Annotated[float, Parameter("N*m/rad", "k_ref of eq. (26)", 1e-3, 1e6, "log")] = 15.0
    stiffness: Annotated[float, Parameter("N*m/rad", "servo K_s", 0.0, 1e6, "log")] = 15.0
    damping: Annotated[float, Parameter("N*m*s/rad", "servo D_s", 0.0, 1e5, "log")] = 0.1
    gravity_compensation: Annotated[bool, Parameter("", "whether the servo adds G(q)")] = False

    def constants(self) -> Servo:
        """Return the parameters for the kernel."""
        return Servo(self.mode == "position_servo", self.stiffness, self.damping, self.gravity_compensation)


class Servo(NamedTuple):
    """The parameters of an `Actuation`, for kernels."""

    by_position: bool
    """Whether it takes joint references; otherwise torques pass through"""
    stiffness: float
    """K_s, N m/rad"""
    damping: float
    """D_s, N m s/rad"""
    gravity_compensation: bool


@jitable
def position_reference(torque: float, q: float, k_ref: float) -> float:
    """Return a joint's reference tau / k_ref + q (rad) of eq. (26); q itself where k_ref is 0: torques are commanded.

    The one-period delay in (26) is the rig's actuation delay.
    """
    return q + torque / k_ref if k_ref != 0.0 else q


def holding_position(torque: Array, joint_position: Array, servo: Servo, gravity: Array) -> Array:
    """Return the joint reference (n,) rad for which the servo outputs `torque` (n,) N m at rest."""
    share = torque - gravity if servo.gravity_compensation else torque
    return joint_position + share / servo.stiffness if servo.stiffness > 0 else joint_position.copy()


@kernel
def motor_torque(servo: Servo, torque: float, reference: float, q: float, rate: float, gravity: float) -> float:
    """Return the motor torque (N m) of one joint for a command (torque, reference) at (q, q')."""
    if not servo.by_position:
        return torque
    given = servo.stiffness * (reference - q) - servo.damping * rate
    return given + gravity if servo.gravity_compensation else given
