"""A rigid-body two-link arm in contact with a surface, integrated by Runge-Kutta."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar, NamedTuple

import numpy as np

from hilrig import (
    Array,
    Capabilities,
    Command,
    Measurement,
    Observation,
    Parameter,
    PlantDisturbance,
    PlantKernels,
    SurfaceState,
    TrialStart,
    Truth,
    contact_force,
    holding_position,
    kernel,
    motor_torque,
)
from hilrig_drivers._planar import PLANT_INPUTS, Constants, PlanarArm, friction, surface_now


@dataclass(frozen=True)
class TwoLink(PlanarArm):
    """M(q) q'' + C(q, q') q' + G(q) + F(q') + J^T F_e = tau  by RK4 at a fixed substep; torque held over a period.

    F_e is the contact force of `surface` (normal along the last task axis) plus any external tip force;
    F(q') = f tanh(q'/5e-3) + b q', with `coulomb` f and `viscous` b per joint.
    """

    capabilities: ClassVar[Capabilities] = Capabilities(("lockstep", "realtime"), PLANT_INPUTS, simulated=True)

    substep: Annotated[float, Parameter("s", "largest integration step", 1e-6, 1e-2, "log")] = 2.5e-4

    def connect(self, start: TrialStart) -> TwoLinkPlant:
        """Return the arm at rest, held there by its motors."""
        return TwoLinkPlant(self, start)


class Model(NamedTuple):
    """Constants of a trial."""

    arm: Constants
    substep: float
    """s"""
    steps: int
    """Substeps per period"""


class TwoLinkPlant:
    """The arm in one trial."""

    def __init__(self, driver: TwoLink, start: TrialStart) -> None:
        steps = max(1, int(np.ceil(start.period / driver.substep - 1e-9)))
        self._model = Model(driver.constants(), start.period / steps, steps)
        self._state = np.concatenate([start.joint_position, np.zeros(4)])
        self._begun = False

    def kernels(self) -> PlantKernels:
        """Return the arm as kernels, starting from its current state."""
        return PlantKernels(observe, advance, self._model, self._state)

    def measure(self, disturbance: PlantDisturbance) -> Measurement:
        """Return joint positions and the wrench that the robot exerts."""
        if not self._begun:
            self._begun = True
            self._state[4:] = holding_torque(self._model, self._state, disturbance)
        return self._look(disturbance)[0].measurement

    def advance(self, command: Command, disturbance: PlantDisturbance) -> None:
        """Integrate one period with the command held."""
        advance(self._model, self._state, disturbance, command.torque, command.position)

    def holding_command(self) -> Command:
        """Return the command that holds the arm where it is."""
        assert self._begun, "measure() comes first"
        torque, q = self._state[4:].copy(), self._state[:2]
        gravity = np.array(weight(self._model.arm, pose(*q)))
        return Command(torque, holding_position(torque, q, self._model.arm.servo, gravity))

    def truth(self, disturbance: PlantDisturbance) -> Truth:
        """Return the true state."""
        observation, surface = self._look(disturbance)
        return observation.truth._replace(surface_position=surface)

    def _look(self, disturbance: PlantDisturbance) -> tuple[Observation, float]:
        observation = Observation.empty(2, 2)
        return observation, observe(self._model, self._state, disturbance, observation)

    def close(self) -> None:
        """Do nothing; there is nothing to release."""


# Tuples of numbers, not arrays: numba keeps them in registers, and a step allocates nothing.
Pair = tuple[float, float]
Four = tuple[float, float, float, float]
"""q1, q2, q1', q2', or their rates"""


class Pose(NamedTuple):
    """The arm's geometry at (q1, q2): everything that needs a sine, computed once."""

    x1: float
    """Link 1: cos q1 here, sin q1 in z1"""
    z1: float
    x2: float
    """Link 2: cos(q1 + q2) here, sin(q1 + q2) in z2"""
    z2: float


class Held(NamedTuple):
    """What is held constant during a period."""

    torque: Pair
    """Commanded, N m"""
    reference: Pair
    """Commanded joint position, rad"""
    surface: SurfaceState
    """At the beginning of the period"""
    push: Pair
    """External force on the tip, N"""
    friction_scale: float


@kernel
def pose(q1: float, q2: float) -> Pose:
    """Return the directions of the links."""
    return Pose(np.cos(q1), np.sin(q1), np.cos(q1 + q2), np.sin(q1 + q2))


@kernel
def jacobian(c: Constants, at: Pose) -> tuple[Pair, Pair, Pair]:
    """Return the tip (x, z) in m and the rows of J = d(x, z)/dq."""
    l1, l2 = c.geometry.length_1, c.geometry.length_2
    x2, z2 = l2 * at.x2, l2 * at.z2
    x, z = l1 * at.x1 + x2, l1 * at.z1 + z2
    return (x, z), (-z, -z2), (x, x2)


@kernel
def exerted(surface: SurfaceState, push: Pair, after: float, place: Pair, speed: Pair) -> Pair:
    """Return F_e (x, z), contact plus external force `push`, N, for the tip at `place` m with `speed` m/s.

    `after` is the time into the period, s, during which the surface has moved at its constant rate.
    """
    normal, tangential = contact_force(surface, place[1] - after * surface.velocity, speed[1], speed[0])
    return tangential + push[0], normal + push[1]


@kernel
def touched(c: Constants, disturbance: PlantDisturbance) -> tuple[SurfaceState, Pair]:
    """Return the disturbed surface, and the external force on the tip, N."""
    return surface_now(c.surface, disturbance), (disturbance.tip_force[0], disturbance.tip_force[1])


@kernel
def weight(c: Constants, at: Pose) -> Pair:
    """Return G(q), N m."""
    theta, gx, gz = c.dynamics, c.geometry.gravity_x, c.geometry.gravity_z
    second = theta[4] * (gx * at.z2 - gz * at.x2)
    return theta[3] * (gx * at.z1 - gz * at.x1) + second, second


@kernel
def inertia(c: Constants, at: Pose) -> tuple[float, float, float, float]:
    """Return M11, M12, M22 (kg m^2) and h = m2 c2 l1 sin q2 of C."""
    theta = c.dynamics
    cosine, sine = at.x1 * at.x2 + at.z1 * at.z2, at.x1 * at.z2 - at.z1 * at.x2
    mixed = theta[1] * cosine
    return theta[0] + 2.0 * mixed + theta[2], theta[2] + mixed, theta[2], theta[1] * sine


@kernel
def coriolis(h: float, rate1: float, rate2: float) -> Pair:
    """Return C q', N m, with C = h [[-q2', -q1' - q2'], [q1', 0]]."""
    return -h * rate2 * (2.0 * rate1 + rate2), h * rate1 * rate1


@kernel
def holding_torque(model: Model, state: Array, disturbance: PlantDisturbance) -> Array:
    """Return the torque G + J^T F_e that holds the arm at rest, (2,) N m."""
    c, at = model.arm, pose(state[0], state[1])
    place, row_x, row_z = jacobian(c, at)
    force, load = exerted(*touched(c, disturbance), 0.0, place, (0.0, 0.0)), weight(c, at)
    return np.array([load[i] + row_x[i] * force[0] + row_z[i] * force[1] for i in range(2)])


@kernel
def rates(model: Model, held: Held, after: float, s: Four) -> tuple[Four, Pair]:
    """Return the rate of the state `s`, `after` seconds into the period, and the motors' torque in N m."""
    c, (q1, q2, rate1, rate2) = model.arm, s
    torque, reference, scale = held.torque, held.reference, held.friction_scale
    at = pose(q1, q2)
    place, row_x, row_z = jacobian(c, at)
    speed = (row_x[0] * rate1 + row_x[1] * rate2, row_z[0] * rate1 + row_z[1] * rate2)
    force, load = exerted(held.surface, held.push, after, place, speed), weight(c, at)
    m11, m12, m22, h = inertia(c, at)
    coriolis1, coriolis2 = coriolis(h, rate1, rate2)
    # One line per joint: a loop cannot assign the entries of a tuple.
    motor1 = motor_torque(c.servo, torque[0], reference[0], q1, rate1, load[0])
    motor2 = motor_torque(c.servo, torque[1], reference[1], q2, rate2, load[1])
    net1 = motor1 - load[0] - coriolis1 - friction(c, scale, 0, rate1) - row_x[0] * force[0] - row_z[0] * force[1]
    net2 = motor2 - load[1] - coriolis2 - friction(c, scale, 1, rate2) - row_x[1] * force[0] - row_z[1] * force[1]
    # M^-1 in closed form: a call of LAPACK would take longer than the rest of the step.
    determinant = m11 * m22 - m12 * m12
    acceleration1 = (m22 * net1 - m12 * net2) / determinant
    acceleration2 = (m11 * net2 - m12 * net1) / determinant
    return (rate1, rate2, acceleration1, acceleration2), (motor1, motor2)


@kernel
def along(s: Four, step: float, rate: Four) -> Four:
    """Return s + step * rate."""
    return s[0] + step * rate[0], s[1] + step * rate[1], s[2] + step * rate[2], s[3] + step * rate[3]


@kernel
def advance(model: Model, state: Array, disturbance: PlantDisturbance, torque: Array, reference: Array) -> None:
    """Advance `state` (6,) by one period, in place, by classical Runge-Kutta steps under a held command."""
    h = model.substep
    surface, push = touched(model.arm, disturbance)
    held = Held((torque[0], torque[1]), (reference[0], reference[1]), surface, push, disturbance.joint_friction_scale)
    s = (state[0], state[1], state[2], state[3])
    for i in range(model.steps):
        k1, motor = rates(model, held, i * h, s)
        k2, _ = rates(model, held, (i + 0.5) * h, along(s, 0.5 * h, k1))
        k3, _ = rates(model, held, (i + 0.5) * h, along(s, 0.5 * h, k2))
        k4, _ = rates(model, held, (i + 1) * h, along(s, h, k3))
        s = along(along(along(along(s, h / 6.0, k1), h / 3.0, k2), h / 3.0, k3), h / 6.0, k4)
        # What a torque sensor would show last: the motors' torque at the beginning of the last step.
        state[4], state[5] = motor
    state[0], state[1], state[2], state[3] = s


@kernel
def observe(model: Model, state: Array, disturbance: PlantDisturbance, observation: Observation) -> float:
    """Fill `observation` with the true state, the wrench that the robot exerts and the motors' last torque."""
    c = model.arm
    place, row_x, row_z = jacobian(c, pose(state[0], state[1]))
    speed = (row_x[0] * state[2] + row_x[1] * state[3], row_z[0] * state[2] + row_z[1] * state[3])
    force = exerted(*touched(c, disturbance), 0.0, place, speed)
    measured, true = observation.measurement, observation.truth
    for wrench in (measured.wrench, true.wrench):
        wrench[:] = 0.0
        wrench[0], wrench[2] = force
    for i in range(2):
        measured.joint_position[i] = true.joint_position[i] = state[i]
        true.joint_velocity[i], measured.applied_torque[i] = state[2 + i], state[4 + i]
        true.position[i], true.velocity[i] = place[i], speed[i]
    return c.surface.position + disturbance.surface_offset
