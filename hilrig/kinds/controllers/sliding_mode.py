"""Conventional sliding-mode hybrid impedance control."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal, NamedTuple

import numpy as np

from hilrig.core.compiler import kernel
from hilrig.core.interfaces import Impedance, Law, Task
from hilrig.core.parameters import Parameter, PerAxis, per_axis
from hilrig.core.signals import Array, Reference, State
from hilrig.kinds.impedance import advance_filter, joint_torque, model_torque, sliding_reference


@dataclass(frozen=True)
class SlidingMode:
    """tau = Y(q, q', v, a) theta_0 + J^T [F_e + K sw(s)],  s = e' + Lambda e,  e = p_d - x (m,)

    v = J^-1 (v_d + Lambda e), a = J^-1 (a_d + Lambda e' - J' v): the equivalent control, with nominal theta_0;
    switching = sat: sw(s) = sat(s / phi), a boundary layer of width phi;  switching = sign: sw(s) = sign(s).

    Source: Slotine and Li, Applied Nonlinear Control, 1991, ch. 7, on the impedance filter's reference.
    """

    slope: Annotated[float, Parameter("1/s", "Lambda", 0.0, 1e4, "log")] = 20.0
    gain: Annotated[PerAxis, Parameter("N", "K, switching force", 0.0, 1e5, "log")] = 10.0
    boundary: Annotated[float, Parameter("m/s", "phi, used with switching = sat", 1e-6, 1e3, "log")] = 0.1
    switching: Literal["sat", "sign"] = "sat"
    nominal_scale: Annotated[float, Parameter("", "factor on the robot's nominal parameters", 0.0, 10.0)] = 1.0

    def start(self, task: Task, state: State) -> Law:
        """Return the law, with its filter at the measured state. Raises ValueError if the robot has no model."""
        if task.dynamic_parameters.size == 0:
            raise ValueError("needs the nominal dynamics, but this robot has no model")
        m = len(task.axes)
        constants = Constants(
            task.impedance, self.slope, per_axis(self.gain, m, "gain"), self.boundary, self.switching == "sign",
            self.nominal_scale * task.dynamic_parameters,
        )  # fmt: skip
        memory = Memory(state.position.copy(), state.velocity.copy(), np.zeros(m), np.zeros(m), np.zeros(m))
        return Law(step, constants, memory)


class Constants(NamedTuple):
    """Constants of a trial."""

    impedance: Impedance
    slope: float
    gain: Array
    boundary: float
    sign: bool
    nominal: Array


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
    switching_force: Array
    """K sw(s), (m,) N"""


@kernel
def step(c: Constants, memory: Memory, state: State, reference: Reference) -> Array:
    """Return the joint torque (n,) N m and advance `memory` by one period."""
    a_d = advance_filter(c.impedance, state.elapsed, memory.filter_position, memory.filter_velocity, state, reference)
    e, s, v, a = sliding_reference(c.slope, a_d, memory.filter_position, memory.filter_velocity, state)
    # A loop, because np.clip and np.where would each allocate at every tick.
    for i in range(s.size):
        level = np.sign(s[i]) if c.sign else min(max(s[i] / c.boundary, -1.0), 1.0)
        memory.switching_force[i] = c.gain[i] * level
    # `[:] =` writes into the recorded arrays; the fields of a NamedTuple cannot be rebound.
    memory.tracking_error[:] = e
    memory.sliding_variable[:] = s
    equivalent = model_torque(state.regressor, v, a, c.nominal)
    return equivalent + joint_torque(state.jacobian, state.force + memory.switching_force)
