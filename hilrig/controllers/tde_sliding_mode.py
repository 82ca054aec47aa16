"""Adaptive sliding mode with time delay estimation: the control law of the paper."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, NamedTuple

import numpy as np

from hilrig.impedance import advance_filter, joint_torque, task_force
from hilrig.interfaces import DelayEstimation, Impedance, Law, Parameter, PerAxis, Task, per_axis
from hilrig.kernel import kernel
from hilrig.signals import Array, Reference, State


@dataclass(frozen=True)
class TdeSlidingMode:
    """tau = J^T [Mhat u + S_hat],  u = a_d + k_d e' + k_p e + k_r (alpha_1 + alpha_2 + alpha_3) tanh(xi / mu)

    e = p_d - x, e' = v_d - x' (m,), with a_d, v_d, p_d of the impedance filter;
    xi = p12 e + p22 e' from A^T P + P A = -I: p12 = 1/(2 k_p), p22 = (1 + 1/k_p)/(2 k_d);
    S_hat = J^-T tau_l - Mhat x''_l, torque and measured acceleration one period ago (time delay estimation);
    alpha_1' = k_1 |xi| while it is at or below its floor, or xi moves outward and alpha_2, alpha_3 are above theirs;
    alpha_1' = -k_2 |xi| otherwise, to zero at least; alpha_2' = -1/alpha_2, alpha_3' = -|xi|/alpha_3, to their floors.

    Source: paper eqs. (8), (10), (11), (15), read so that they are stable: P solves the Lyapunov equation itself and
    not its transpose, k_d and k_p are positive, (11) takes the measured acceleration, tanh takes xi / mu everywhere.
    """

    inertia_estimate: Annotated[PerAxis, Parameter("kg", "Mhat, diagonal", 1e-5, 1e3, "log")] = 0.03
    position_gain: Annotated[float, Parameter("1/s^2", "k_p", 1e-3, 1e6, "log")] = 150.0
    velocity_gain: Annotated[float, Parameter("1/s", "k_d", 1e-3, 1e4, "log")] = 30.0
    robust_gain: Annotated[float, Parameter("m/s^2", "k_r", 0.0, 1e3, "log")] = 1.1
    boundary: Annotated[float, Parameter("m", "mu, width of the boundary layer", 1e-6, 1e3, "log")] = 0.01
    growth: Annotated[float, Parameter("", "k_1, growth of alpha_1", 0.0, 1e3, "log")] = 1.0
    decay: Annotated[float, Parameter("", "k_2, decay of alpha_1", 0.0, 1e3, "log")] = 1.0
    gains_start: Annotated[tuple[float, float, float], Parameter("", "alpha at the start", 0.0, 1e3)] = (
        0.01,
        1.0,
        1.0,
    )
    gains_floor: Annotated[tuple[float, float, float], Parameter("", "floors alpha^m", 0.0, 1e3)] = (
        0.005,
        0.5,
        0.5,
    )

    def start(self, task: Task, state: State) -> Law:
        """Return the law, its filter at the measured state and its estimate at the torque that holds the arm."""
        m = len(task.axes)
        kp, kd = self.position_gain, self.velocity_gain
        constants = Constants(
            task.impedance, per_axis(self.inertia_estimate, m, "inertia_estimate"), kp, kd,
            1 / (2 * kp), (1 + 1 / kp) / (2 * kd),
            self.robust_gain, self.boundary, self.growth, self.decay, np.array(self.gains_floor),
        )  # fmt: skip
        zero = np.zeros(m)
        memory = Memory(
            state.position.copy(), state.velocity.copy(), zero, zero.copy(), np.array(self.gains_start), zero.copy(),
            state.velocity.copy(),
        )  # fmt: skip
        return Law(step, constants, memory)

    def delay_estimation(self, axes: int) -> DelayEstimation:
        """Return Mhat, k_p and k_d."""
        names = ("inertia_estimate", "position_gain", "velocity_gain")
        return DelayEstimation(*(per_axis(getattr(self, name), axes, name) for name in names))


class Constants(NamedTuple):
    """What does not change during a trial."""

    impedance: Impedance
    inertia_estimate: Array
    position_gain: float
    velocity_gain: float
    p12: float
    p22: float
    robust_gain: float
    boundary: float
    growth: float
    decay: float
    gains_floor: Array


class Memory(NamedTuple):
    """What the law remembers, all of it recorded."""

    filter_position: Array
    """p_d, (m,) m"""
    filter_velocity: Array
    """v_d, (m,) m/s"""
    tracking_error: Array
    """e = p_d - x, (m,) m"""
    sliding_variable: Array
    """xi, (m,) m"""
    gains: Array
    """alpha_1, alpha_2, alpha_3, (3,)"""
    estimate: Array
    """S_hat, (m,) N"""
    last_velocity: Array
    """x' one period ago, (m,) m/s"""


@kernel
def step(c: Constants, memory: Memory, state: State, reference: Reference) -> Array:
    """Return the joint torque (n,) N m and move `memory` on by one period."""
    a_d = advance_filter(c.impedance, state.elapsed, memory.filter_position, memory.filter_velocity, state, reference)
    e = memory.filter_position - state.position
    e_rate = memory.filter_velocity - state.velocity
    xi = c.p12 * e + c.p22 * e_rate
    adapt(c, state.elapsed, memory.gains, xi, memory.sliding_variable)
    u = a_d + c.velocity_gain * e_rate + c.position_gain * e
    u += c.robust_gain * np.sum(memory.gains) * np.tanh(xi / c.boundary)
    acceleration = (state.velocity - memory.last_velocity) / state.elapsed
    memory.estimate[:] = task_force(state.jacobian, state.torque) - c.inertia_estimate * acceleration
    memory.tracking_error[:] = e
    memory.sliding_variable[:] = xi
    memory.last_velocity[:] = state.velocity
    return joint_torque(state.jacobian, c.inertia_estimate * u + memory.estimate)


@kernel
def adapt(c: Constants, elapsed: float, gains: Array, xi: Array, last_xi: Array) -> None:
    """Move alpha (3,) on by `elapsed` (s), eq. (15), in place."""
    floor = c.gains_floor
    norm = np.sqrt(np.sum(xi * xi))
    outward = np.sum(xi * (xi - last_xi)) > 0.0
    if gains[0] <= floor[0] or (outward and gains[1] > floor[1] and gains[2] > floor[2]):
        gains[0] += elapsed * c.growth * norm
    else:
        gains[0] = max(gains[0] - elapsed * c.decay * norm, 0.0)
    if gains[2] > floor[2]:
        gains[2] = max(gains[2] - elapsed * norm / gains[2], floor[2])
    if gains[1] > floor[1]:
        gains[1] = max(gains[1] - elapsed / gains[1], floor[1])
