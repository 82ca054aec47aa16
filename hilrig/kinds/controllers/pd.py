"""Proportional-derivative control of position and force."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal, NamedTuple

import numpy as np

from hilrig.core.compiler import kernel
from hilrig.core.interfaces import Impedance, Law, Task
from hilrig.core.parameters import Parameter, PerAxis, per_axis
from hilrig.core.signals import Array, Reference, State
from hilrig.kinds.impedance import advance_filter, joint_torque, model_torque


@dataclass(frozen=True)
class Pd:
    """tau = tau_g + J^T f, a textbook hybrid PD with gravity compensation.

    target = filter:  f = K e + D e',  e = p_d - x, e' = v_d - x', with p_d, v_d from the impedance filter (m,)
    target = direct:  f = Sigma [K (x_d - x) + D (x_d' - x')] + (I - Sigma) [F_d + K_f (F_d - F_e) - D x']

    gravity = model:  tau_g = G(q) of the nominal robot (the only model knowledge of a textbook PD)
    gravity = start:  tau_g = the torque that holds the arm where the trial begins, less the contact's share J^T F_e,
                      kept constant (no model at all)

    Source: Takegaki and Arimoto 1981 (PD with gravity compensation); Raibert and Craig 1981 (hybrid control).
    """

    stiffness: Annotated[PerAxis, Parameter("N/m", "K", 0.0, 1e6, "log")] = 1000.0
    damping: Annotated[PerAxis, Parameter("N*s/m", "D", 0.0, 1e5, "log")] = 60.0
    force_gain: Annotated[PerAxis, Parameter("", "K_f, target = direct only", 0.0, 1e3, "log")] = 1.0
    target: Literal["filter", "direct"] = "filter"
    gravity: Literal["model", "start"] = "model"

    def start(self, task: Task, state: State) -> Law:
        """Return the law, with its filter at the measured state."""
        m = len(task.axes)
        nominal = task.dynamic_parameters.copy()
        constants = Constants(
            task.impedance, per_axis(self.stiffness, m, "stiffness"), per_axis(self.damping, m, "damping"),
            per_axis(self.force_gain, m, "force_gain"), self.target == "direct", self.gravity == "model",
            nominal, state.torque - joint_torque(state.jacobian, state.force),
        )  # fmt: skip
        memory = Memory(state.position.copy(), state.velocity.copy(), np.zeros(m), np.zeros(m))
        return Law(step, constants, memory)


class Constants(NamedTuple):
    """Constants of a trial."""

    impedance: Impedance
    stiffness: Array
    damping: Array
    force_gain: Array
    direct: bool
    use_model: bool
    nominal: Array
    start_torque: Array


class Memory(NamedTuple):
    """The law's state between ticks, all of it recorded."""

    filter_position: Array
    """p_d, (m,) m"""
    filter_velocity: Array
    """v_d, (m,) m/s"""
    tracking_error: Array
    """e = p_d - x, (m,) m"""
    task_force: Array
    """f, (m,) N"""


@kernel
def step(c: Constants, memory: Memory, state: State, reference: Reference) -> Array:
    """Return the joint torque (n,) N m and advance `memory` by one period."""
    sigma = c.impedance.sigma
    advance_filter(c.impedance, state.elapsed, memory.filter_position, memory.filter_velocity, state, reference)
    # `[:] =` writes into the recorded array; the fields of a NamedTuple cannot be rebound.
    memory.tracking_error[:] = memory.filter_position - state.position
    if c.direct:
        move = c.stiffness * (reference.position - state.position)
        move += c.damping * (reference.velocity - state.velocity)
        press = reference.force + c.force_gain * (reference.force - state.force) - c.damping * state.velocity
        memory.task_force[:] = sigma * move + (1.0 - sigma) * press
    else:
        rate = memory.filter_velocity - state.velocity
        memory.task_force[:] = c.stiffness * memory.tracking_error + c.damping * rate
    if c.use_model:
        # M a + C v + G at v = a = 0: the nominal parameters have no friction, so this is gravity alone.
        still = np.zeros(state.joint_position.size)
        weight = model_torque(state.regressor, still, still, c.nominal)
    else:
        weight = c.start_torque
    return weight + joint_torque(state.jacobian, memory.task_force)
