"""Adaptive sliding mode with time delay estimation: the control law of the paper."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, NamedTuple

import numpy as np

from hilrig.core.assessment import Assessment, Setting
from hilrig.core.compiler import kernel, kernel_without_arrays
from hilrig.core.interfaces import Impedance, Law, Task
from hilrig.core.parameters import Parameter, PerAxis, per_axis
from hilrig.core.signals import Array, Reference, State
from hilrig.kinds.impedance import eliminate, move_filter


@dataclass(frozen=True)
class TdeSlidingMode:
    """tau = J^T [Mhat u + S_hat],  u = a_d + k_d e' + k_p e + k_r (alpha_1 + alpha_2 + alpha_3) tanh(xi / mu)

    e = p_d - x, e' = v_d - x' (m,), with a_d, v_d, p_d from the impedance filter;
    xi = p12 e + p22 e' from A^T P + P A = -I: p12 = 1/(2 k_p), p22 = (1 + 1/k_p)/(2 k_d);
    S_hat = J^-T tau_l - Mhat x''_l, torque and measured acceleration one period ago (time delay estimation);
    alpha_1' = k_1 |xi| while it is at or below its floor, or xi moves outward and alpha_2, alpha_3 are above theirs;
    alpha_1' = -k_2 |xi| otherwise, at least zero; alpha_2' = -1/alpha_2, alpha_3' = -|xi|/alpha_3, down to the floors.

    The paper does not say where S_hat starts: here from the torque that holds the arm; from zero with preload = false.

    Source: paper eqs. (8), (10), (11), (15), read so that they are stable; docs/paper.md lists the misprints.
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
    preload: Annotated[bool, Parameter("", "whether S_hat starts from the holding torque")] = True

    def start(self, task: Task, state: State) -> Law:
        """Return the law, with its filter at the measured state and its estimate as `preload` says."""
        m = len(task.axes)
        p12, p22 = self.surface_gains()
        constants = Constants(
            task.impedance, per_axis(self.inertia_estimate, m, "inertia_estimate"),
            self.position_gain, self.velocity_gain, p12, p22,
            self.robust_gain, self.boundary, self.growth, self.decay, np.array(self.gains_floor),
        )  # fmt: skip
        alpha_1, alpha_2, alpha_3 = (np.array([alpha]) for alpha in self.gains_start)
        memory = Memory(
            state.position.copy(), state.velocity.copy(), np.zeros(m), np.zeros(m),
            alpha_1, alpha_2, alpha_3, np.zeros(m), state.velocity.copy(), np.zeros(m),
            np.array([float(self.preload)]),
        )  # fmt: skip
        return Law(step, constants, memory)

    def assess(self, setting: Setting) -> Assessment:
        """Return the paper's delay bound (24), the window of Mhat and condition (9)."""
        # Imported here because it imports scipy, which the rig's processes start without.
        from hilrig.kinds.controllers._delay_estimation import assess_delay_estimation

        return assess_delay_estimation(setting, self.inertia_estimate, self.position_gain, self.velocity_gain)

    def surface_gains(self) -> tuple[float, float]:
        """Return p12 (s^2) and p22 (s) of xi = p12 e + p22 e', the second row of P."""
        kp, kd = self.position_gain, self.velocity_gain
        return 1 / (2 * kp), (1 + 1 / kp) / (2 * kd)


class Constants(NamedTuple):
    """Constants of a trial."""

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
    """The law's state between ticks, all of it recorded."""

    filter_position: Array
    """p_d, (m,) m"""
    filter_velocity: Array
    """v_d, (m,) m/s"""
    tracking_error: Array
    """e = p_d - x, (m,) m"""
    sliding_variable: Array
    """xi, (m,) m"""
    alpha_1: Array
    """alpha_1, (1,)"""
    alpha_2: Array
    """alpha_2, (1,)"""
    alpha_3: Array
    """alpha_3, (1,)"""
    estimate: Array
    """S_hat, (m,) N"""
    last_velocity: Array
    """x' one period ago, (m,) m/s"""
    desired_acceleration: Array
    """a_d, (m,) m/s^2"""
    torque_share: Array
    """Share of the last torque that S_hat uses: 0 at the first tick without preload, else 1, (1,)"""


@kernel
def step(c: Constants, memory: Memory, state: State, reference: Reference) -> Array:
    """Return the joint torque (n,) N m and advance `memory` by one period."""
    # The only two arrays of a tick are created here, so the kernels below need no reference counting by numba.
    # J^T is copied because `eliminate` overwrites its matrix.
    torque = np.zeros(state.torque.size)
    estimate(c, memory, state, state.jacobian.T.copy())
    # Before the filter advances: the estimate as printed uses a_d of the last tick.
    move_filter(
        c.impedance, state.elapsed, memory.filter_position, memory.filter_velocity, state, reference,
        memory.desired_acceleration,
    )  # fmt: skip
    slide(c, memory, state)
    press(c, memory, state, torque)
    return torque


@kernel_without_arrays
def estimate(c: Constants, memory: Memory, state: State, lever: Array) -> None:
    """Set S_hat (m,) N, eq. (11), in `memory`, which has x' and a_d of the last tick. `lever` is J^T; overwritten."""
    # J^T f = tau is solved in place: `memory.estimate` is first the right-hand side, then f (n = m).
    for i in range(memory.estimate.size):
        memory.estimate[i] = memory.torque_share[0] * state.torque[i]
    eliminate(lever, memory.estimate)
    for i in range(memory.estimate.size):
        memory.estimate[i] -= c.inertia_estimate[i] * last_acceleration(memory, state, i)
        memory.last_velocity[i] = state.velocity[i]
    memory.torque_share[0] = 1.0


@kernel_without_arrays
def last_acceleration(memory: Memory, state: State, i: int) -> float:
    """Return x'' of axis `i` over the last period, m/s^2."""
    # This, `adapt` and `switching` are functions so that experiments/paper/law_as_printed.py can replace them with a
    # misprint. They are inlined and cost no call.
    return (state.velocity[i] - memory.last_velocity[i]) / state.elapsed


@kernel_without_arrays
def slide(c: Constants, memory: Memory, state: State) -> None:
    """Set e and xi in `memory`, which has xi of the last tick, and adapt the gains."""
    # xi of the last tick is in the same array: it is read before the new value overwrites it.
    square, turn = 0.0, 0.0
    for i in range(state.position.size):
        e = memory.filter_position[i] - state.position[i]
        xi = c.p12 * e + c.p22 * (memory.filter_velocity[i] - state.velocity[i])
        square += xi * xi
        turn += xi * (xi - memory.sliding_variable[i])
        memory.tracking_error[i], memory.sliding_variable[i] = e, xi
    adapt(c, memory, state.elapsed, np.sqrt(square), turn > 0.0)


@kernel_without_arrays
def adapt(c: Constants, memory: Memory, elapsed: float, size: float, outward: bool) -> None:
    """Advance alpha by `elapsed` (s), eq. (15), in place; `size` is |xi|, `outward` whether it grows."""
    floor = c.gains_floor
    # The cases of alpha_1 depend on alpha_2 and alpha_3 before they are updated.
    alpha_1, alpha_2, alpha_3 = memory.alpha_1[0], memory.alpha_2[0], memory.alpha_3[0]
    above_2, above_3 = alpha_2 > floor[1], alpha_3 > floor[2]
    if alpha_1 <= floor[0] or (outward and above_2 and above_3):
        memory.alpha_1[0] = alpha_1 + elapsed * c.growth * size
    else:
        memory.alpha_1[0] = max(alpha_1 - elapsed * c.decay * size, 0.0)
    # A gain at its floor stays there; with a floor of 0 the quotient below would be infinite.
    if above_3:
        memory.alpha_3[0] = max(alpha_3 - elapsed * size / alpha_3, floor[2])
    if above_2:
        memory.alpha_2[0] = max(alpha_2 - elapsed / alpha_2, floor[1])


@kernel_without_arrays
def press(c: Constants, memory: Memory, state: State, torque: Array) -> None:
    """Add J^T (Mhat u + S_hat) to `torque` (n,) N m, eqs. (8) and (10)."""
    robust = c.robust_gain * (memory.alpha_1[0] + memory.alpha_2[0] + memory.alpha_3[0])
    for i in range(memory.sliding_variable.size):
        u = memory.desired_acceleration[i] + robust * switching(c, memory.sliding_variable, i)
        u += c.velocity_gain * (memory.filter_velocity[i] - state.velocity[i])
        u += c.position_gain * memory.tracking_error[i]
        force = c.inertia_estimate[i] * u + memory.estimate[i]
        # J^T f in a loop: np.dot would allocate, and a BLAS call costs more than these few products.
        for j in range(torque.size):
            torque[j] += state.jacobian[i, j] * force


@kernel_without_arrays
def switching(c: Constants, xi: Array, i: int) -> float:
    """Return the smooth sign of component `i` of xi (m,)."""
    return np.tanh(xi[i] / c.boundary)
