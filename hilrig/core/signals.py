"""The rig's signals: what passes between plant, controller and record. SI units, arrays of float64.

n is the number of joints, m the number of task axes, p the number of dynamic parameters, N the number of ticks.
Forces are those that the robot exerts on its surroundings: positive when it presses.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hilrig.core.compiler import jitable

Array = NDArray[np.float64]
Picture = NDArray[np.uint8]
"""(height, width, 3), RGB"""

WRENCH_AXES = ("x", "y", "z")
"""The first three components of a wrench are the forces along these axes, the last three the moments about them."""


class Measurement(NamedTuple):
    """What the driver reports at each tick."""

    joint_position: Array
    """q, (n,) rad"""
    wrench: Array
    """Force (N) then moment (N m) that the robot exerts, task frame, (6,)"""
    applied_torque: Array
    """Joint torque in effect until this tick, (n,) N m; at tick 0 the torque that holds the arm"""
    stamp: float = np.nan
    """When the sample was taken, s, on any one clock; nan: at this tick. Differences of stamps give the rates"""
    fresh: bool = True
    """Whether the sample is new since the last tick; a law is not called on a repeated one"""


class Command(NamedTuple):
    """What the controller commands for one tick."""

    torque: Array
    """Joint torque after limits, (n,) N m"""
    position: Array
    """Joint position reference of eq. (26), q + torque / k_ref, (n,) rad; used by position servos"""


class Truth(NamedTuple):
    """A simulated plant's true state; a real plant has no such channel."""

    joint_position: Array
    """(n,) rad"""
    joint_velocity: Array
    """(n,) rad/s"""
    position: Array
    """End effector in the task frame, (m,) m"""
    velocity: Array
    """(m,) m/s"""
    wrench: Array
    """Wrench that the robot exerts, without sensor errors, (6,) N and N m"""
    surface_position: float
    """Position of the surface along its normal, m"""


class Reference(NamedTuple):
    """The desired state at an instant. Entries for an axis that is not controlled that way are zero."""

    position: Array
    """x_d, (m,) m"""
    velocity: Array
    """x_d', (m,) m/s"""
    acceleration: Array
    """x_d'', (m,) m/s^2"""
    force: Array
    """F_d, (m,) N"""


class Kinematics(NamedTuple):
    """A robot's geometry and nominal dynamics at one state (q, q')."""

    position: Array
    """x = fk(q), (m,) m"""
    velocity: Array
    """x' = J q', (m,) m/s"""
    jacobian: Array
    """J = dx/dq, (m, n)"""
    jacobian_rate: Array
    """dJ/dt, (m, n)"""
    regressor: Array
    """R, (2n + 1, n, p): M(q) a + C(q,q') v + G(q) + F(q') = (R[0] + sum v_i R[1+i] + sum a_i R[1+n+i]) theta"""


class State(NamedTuple):
    """What a control law sees at each tick. All laws see the same."""

    joint_position: Array
    """q as measured, (n,) rad"""
    joint_velocity: Array
    """q' by the filtered difference of q, (n,) rad/s"""
    position: Array
    """x, (m,) m"""
    velocity: Array
    """x', (m,) m/s"""
    jacobian: Array
    """J, (m, n)"""
    jacobian_rate: Array
    """dJ/dt, (m, n)"""
    regressor: Array
    """R, (2n + 1, n, p); see Kinematics"""
    force: Array
    """F_e along the task axes as measured, (m,) N"""
    torque: Array
    """Joint torque commanded at the last tick, after limits, (n,) N m; at the start, the torque that holds the arm"""
    elapsed: float
    """Time since the law's last call, s: the period, or more where ticks were missed in real time"""


class Faults(NamedTuple):
    """Faults injected into the real-time loop, for every tick, (N,) each. Zero means no fault.

    The command of tick k is the answer to the state of tick k.
    """

    driver_stall: Array
    """How long the driver's process sleeps before it measures, s"""
    controller_stall: Array
    """How long the controller's process sleeps after receiving the state, s"""
    driver_stop: Array
    """How long the driver's process is stopped (SIGSTOP) before it measures, s"""
    controller_stop: Array
    """How long the controller's process is stopped after receiving the state, s"""
    controller_busy: Array
    """How much longer the controller computes, s"""
    state_delay: Array
    """How long the bus holds the state back, s"""
    command_delay: Array
    """How long the bus holds the command back, s"""
    state_loss: Array
    """1 where the bus loses the state"""
    command_loss: Array
    """1 where the bus loses the command"""

    @classmethod
    def none(cls, ticks: int) -> Faults:
        """Return a schedule without faults."""
        return cls(*(np.zeros(ticks) for _ in cls._fields))


class DisturbanceSchedule(NamedTuple):
    """The disturbances of a trial, for every tick. Zero (one for scales) means undisturbed.

    Fields that begin with `plant_` need a driver that can apply them; the others act on the measurements of any driver.
    """

    plant_tip_force: Array
    """External force on the end effector, as felt by a sensor: adds to F_e, (N, m) N"""
    plant_surface_offset: Array
    """Displacement of the surface along its normal, (N,) m"""
    plant_surface_velocity: Array
    """Its rate, (N,) m/s"""
    plant_stiffness_scale: Array
    """Factor on the surface's stiffness, (N,)"""
    plant_surface_friction_scale: Array
    """Factor on the surface's friction coefficient, (N,)"""
    plant_joint_friction_scale: Array
    """Factor on the joints' friction, (N,)"""
    joint_error: Array
    """Added to the measured joint positions, (N, n) rad"""
    wrench_error: Array
    """Added to the measured wrench, (N, 6)"""
    measurement_delay: Array
    """Age of the measurement handed to the controller, in ticks, (N,) whole numbers"""
    faults: Faults
    """Faults of the processes and the bus; a plant never sees them"""

    @classmethod
    def quiet(cls, ticks: int, joints: int, axes: int) -> DisturbanceSchedule:
        """Return a schedule that disturbs nothing."""
        zeros, ones = np.zeros, np.ones
        return cls(
            zeros((ticks, axes)), zeros(ticks), zeros(ticks), ones(ticks), ones(ticks), ones(ticks),
            zeros((ticks, joints)), zeros((ticks, 6)), zeros(ticks), Faults.none(ticks),
        )  # fmt: skip


class PlantDisturbance(NamedTuple):
    """The plant's share of `DisturbanceSchedule` at one tick, in the same order and with the same meaning."""

    tip_force: Array
    surface_offset: float
    surface_velocity: float
    stiffness_scale: float
    surface_friction_scale: float
    joint_friction_scale: float


def still(axes: int) -> PlantDisturbance:
    """Return a disturbance without effect, for m = `axes`."""
    return PlantDisturbance(np.zeros(axes), 0.0, 0.0, 1.0, 1.0, 1.0)


@jitable
def plant_disturbance(schedule: DisturbanceSchedule, tick: int) -> PlantDisturbance:
    """Return the plant's disturbance during the period that begins at `tick`."""
    return PlantDisturbance(
        schedule.plant_tip_force[tick],
        float(schedule.plant_surface_offset[tick]),
        float(schedule.plant_surface_velocity[tick]),
        float(schedule.plant_stiffness_scale[tick]),
        float(schedule.plant_surface_friction_scale[tick]),
        float(schedule.plant_joint_friction_scale[tick]),
    )
