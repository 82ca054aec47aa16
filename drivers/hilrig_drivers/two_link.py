"""A rigid-body two-link arm in contact with a surface, integrated by Runge-Kutta."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np

from hilrig.actuation import holding_position, motor_torque
from hilrig.contact import SurfaceState
from hilrig.impedance import joint_torque
from hilrig.interfaces import Abilities, Begin, Parameter
from hilrig.kernel import kernel
from hilrig.robots.planar_2r import kinematics
from hilrig.signals import Array, Command, Measurement, Nudge, Truth
from hilrig_drivers._planar import (
    PLANT_INPUTS,
    Constants,
    PlanarArm,
    joint_friction,
    moved,
    planar_wrench,
    surface_now,
    tip_force,
)


@dataclass(frozen=True)
class TwoLink(PlanarArm):
    """M(q) q'' + C(q, q') q' + G(q) + F(q') + J^T F_e = tau  by RK4 at a fixed substep; torque held over a period.

    F_e is the contact of `surface` (normal along the last task axis) plus any external tip force;
    F(q') = f tanh(q'/5e-3) + b q', with `coulomb` f and `viscous` b per joint.
    """

    abilities: ClassVar[Abilities] = Abilities(("lockstep", "realtime"), PLANT_INPUTS, simulated=True)

    substep: Annotated[float, Parameter("s", "integration step, at most", 1e-6, 1e-2, "log")] = 2.5e-4

    def begin(self, begin: Begin) -> TwoLinkPlant:
        """Return the arm at rest, held there by its motors."""
        return TwoLinkPlant(self, begin)


class TwoLinkPlant:
    """The arm in one trial."""

    def __init__(self, driver: TwoLink, begin: Begin) -> None:
        self._surface = driver.surface
        self._constants = driver.constants()
        self._steps = max(1, int(np.ceil(begin.period / driver.substep - 1e-9)))
        self._substep = begin.period / self._steps
        self._state = np.concatenate([begin.joint_position, np.zeros(2)])
        self._torque: Array | None = None

    def measure(self, disturbance: Nudge) -> Measurement:
        """Return joint positions and the wrench the robot exerts."""
        sight = observe(self._constants, self._state, surface_now(self._surface, disturbance), disturbance.tip_force)
        if self._torque is None:
            self._torque = sight[2]
        return Measurement(self._state[:2].copy(), planar_wrench(sight[1]), self._torque)

    def advance(self, command: Command, disturbance: Nudge) -> None:
        """Integrate one period with the command held."""
        self._torque = advance(
            self._constants, self._state, surface_now(self._surface, disturbance), disturbance.tip_force,
            disturbance.joint_friction_scale, command.torque, command.position, self._substep, self._steps,
        )  # fmt: skip

    def hold(self) -> Command:
        """Return the command that holds the arm where it is."""
        torque = self._torque
        assert torque is not None, "measure() comes first"
        q = self._state[:2]
        gravity = gravity_torque(self._constants, self._state)
        return Command(torque, holding_position(torque, q, self._constants.servo, gravity))

    def truth(self, disturbance: Nudge) -> Truth:
        """Return the true state."""
        surface = surface_now(self._surface, disturbance)
        motion, force, _ = observe(self._constants, self._state, surface, disturbance.tip_force)
        q, rate = self._state[:2].copy(), self._state[2:].copy()
        return Truth(q, rate, motion[0], motion[1], planar_wrench(force), surface.position)

    def close(self) -> None:
        """Nothing to release."""


@kernel
def gravity_torque(c: Constants, state: Array) -> Array:
    """Return G(q), (2,) N m."""
    at = kinematics(c.geometry, state[:2], np.zeros(2))
    return np.dot(at.regressor[0], c.dynamics)


@kernel
def observe(
    c: Constants, state: Array, surface: SurfaceState, external: Array
) -> tuple[tuple[Array, Array], Array, Array]:
    """Return ((x, x'), F_e, the torque G + J^T F_e that holds the arm)."""
    at = kinematics(c.geometry, state[:2], state[2:])
    force = tip_force(surface, external, at.position, at.velocity)
    hold = gravity_torque(c, state) + joint_torque(at.jacobian, force)
    return (at.position, at.velocity), force, hold


@kernel
def derivative(
    c: Constants,
    state: Array,
    surface: SurfaceState,
    external: Array,
    friction_scale: float,
    torque: Array,
    reference: Array,
) -> tuple[Array, Array]:
    """Return the state's rate (4,) and the motor torque (2,)."""
    q, rate = state[:2], state[2:]
    at = kinematics(c.geometry, q, rate)
    r = at.regressor
    force = tip_force(surface, external, at.position, at.velocity)
    gravity = gravity_torque(c, state)
    motor = motor_torque(c.servo, torque, reference, q, rate, gravity)
    friction = joint_friction(c, friction_scale, rate)
    coriolis = np.dot(rate[0] * r[1] + rate[1] * r[2], c.dynamics)
    load = motor - friction - coriolis - gravity - joint_torque(at.jacobian, force)
    m1, m2 = np.dot(r[3], c.dynamics), np.dot(r[4], c.dynamics)
    determinant = m1[0] * m2[1] - m1[1] * m2[0]
    q1 = (m2[1] * load[0] - m2[0] * load[1]) / determinant
    q2 = (m1[0] * load[1] - m1[1] * load[0]) / determinant
    return np.array([rate[0], rate[1], q1, q2]), motor


@kernel
def advance(
    c: Constants, state: Array, surface: SurfaceState, external: Array, friction_scale: float,
    torque: Array, reference: Array, substep: float, steps: int,
) -> Array:  # fmt: skip
    """Integrate `state` (4,) in place by `steps` classical Runge-Kutta steps; return the last motor torque (2,)."""
    motor = torque
    moving = surface
    for i in range(steps):
        k1, motor = derivative(c, state, moving, external, friction_scale, torque, reference)
        half = moved(surface, (i + 0.5) * substep)
        k2, _ = derivative(c, state + 0.5 * substep * k1, half, external, friction_scale, torque, reference)
        k3, _ = derivative(c, state + 0.5 * substep * k2, half, external, friction_scale, torque, reference)
        moving = moved(surface, (i + 1) * substep)
        k4, _ = derivative(c, state + substep * k3, moving, external, friction_scale, torque, reference)
        state += substep / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
    return motor.copy()
