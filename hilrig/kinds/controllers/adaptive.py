"""Conventional adaptive hybrid impedance control (Slotine and Li)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, NamedTuple

import numpy as np

from hilrig.core.compiler import kernel
from hilrig.core.interfaces import Impedance, Law, Task
from hilrig.core.parameters import Parameter, PerAxis, per_axis
from hilrig.core.signals import Array, Reference, State
from hilrig.kinds.impedance import advance_filter, joint_torque, regressor_matrix, sliding_reference, solve


@dataclass(frozen=True)
class Adaptive:
    """tau = Y(q, q', v, a) theta + J^T [F_e + K s],  theta' = gamma Y^T J^-1 s,  theta(0) = 0

    s = e' + Lambda e, e = p_d - x (m,); v = J^-1 (v_d + Lambda e), a = J^-1 (a_d + Lambda e' - J' v) (n,);
    Y is the robot's regressor (n, p): inertia, Coriolis, gravity, Coulomb and viscous friction.

    Source: Slotine and Li, On the adaptive control of robot manipulators, 1987, on the impedance filter's reference.
    """

    slope: Annotated[float, Parameter("1/s", "Lambda", 0.0, 1e4, "log")] = 20.0
    gain: Annotated[PerAxis, Parameter("N*s/m", "K", 0.0, 1e5, "log")] = 100.0
    rate: Annotated[float, Parameter("", "gamma, in SI units of theta", 0.0, 1e6, "log")] = 1.0

    def start(self, task: Task, state: State) -> Law:
        """Return the law, with its filter at the measured state. Raises ValueError if the robot has no model."""
        p = state.regressor.shape[2]
        if p == 0:
            raise ValueError("needs the robot's regressor, but this robot has no model")
        m = len(task.axes)
        constants = Constants(task.impedance, self.slope, per_axis(self.gain, m, "gain"), self.rate)
        memory = Memory(state.position.copy(), state.velocity.copy(), np.zeros(m), np.zeros(m), np.zeros(p))
        return Law(step, constants, memory)


class Constants(NamedTuple):
    """Constants of a trial."""

    impedance: Impedance
    slope: float
    gain: Array
    rate: float


class Memory(NamedTuple):
    """The law's state between ticks, all of it recorded."""

    filter_position: Array
    """p_d, (m,) m"""
    filter_velocity: Array
    """v_d, (m,) m/s"""
    tracking_error: Array
    """e = p_d - x, (m,) m"""
    sliding_variable: Array
    """s, (m,) m/s"""
    parameter_estimate: Array
    """theta, (p,) SI units"""


@kernel
def step(c: Constants, memory: Memory, state: State, reference: Reference) -> Array:
    """Return the joint torque (n,) N m and advance `memory` by one period."""
    a_d = advance_filter(c.impedance, state.elapsed, memory.filter_position, memory.filter_velocity, state, reference)
    e, s, v, a = sliding_reference(c.slope, a_d, memory.filter_position, memory.filter_velocity, state)
    y = regressor_matrix(state.regressor, v, a)
    joint_error = solve(state.jacobian, s)
    # `[:] =` writes into the recorded arrays; the fields of a NamedTuple cannot be rebound.
    # numba passes np.dot to BLAS, which is fast on contiguous matrices only; the view Y^T is not contiguous.
    memory.parameter_estimate[:] += state.elapsed * c.rate * np.dot(np.ascontiguousarray(y.T), joint_error)
    memory.tracking_error[:] = e
    memory.sliding_variable[:] = s
    model = np.dot(y, memory.parameter_estimate)
    return model + joint_torque(state.jacobian, state.force + c.gain * s)
