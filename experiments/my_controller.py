"""A user's own controller: admittance law with gravity compensation and integral action on the filter's error."""

from dataclasses import dataclass
from typing import Annotated, NamedTuple

import numpy as np

from hilrig import Law, Parameter, advance_filter, model_torque


class Memory(NamedTuple):
    """The law's memory; every field is recorded and drawn in the report."""

    filter_position: np.ndarray
    """p_d, (m,) m"""
    filter_velocity: np.ndarray
    """v_d, (m,) m/s"""
    integral: np.ndarray
    """of p_d - x, (m,) m s"""


@dataclass(frozen=True)
class MyController:
    """tau = G(q) + J^T (K e + D e' + I integral(e)),  e = p_d - x,  with p_d, v_d of the impedance filter."""

    stiffness: Annotated[float, Parameter("N/m", "K", 0, 1e5, "log")] = 800.0
    damping: Annotated[float, Parameter("N*s/m", "D", 0, 1e4, "log")] = 50.0
    integral: Annotated[float, Parameter("N/(m*s)", "I", 0, 1e5, "log")] = 1000.0

    def start(self, task, state):
        memory = Memory(state.position.copy(), state.velocity.copy(), np.zeros(len(task.axes)))
        return Law(self.step, task, memory)

    def step(self, task, memory, state, reference):
        advance_filter(task.impedance, state.elapsed, *memory[:2], state, reference)
        error, rate = memory.filter_position - state.position, memory.filter_velocity - state.velocity
        memory.integral[:] += state.elapsed * error
        force = self.stiffness * error + self.damping * rate + self.integral * memory.integral
        still = np.zeros_like(state.joint_position)
        return model_torque(state.regressor, still, still, task.dynamic_parameters) + state.jacobian.T @ force
