"""Laws that go wrong, or keep what they are given, and every disturbance at once."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

import numpy as np

from hilrig.core.compiler import kernel
from hilrig.core.interfaces import Law, Task
from hilrig.core.signals import Array, Reference, State
from hilrig.kinds.actuation import Actuation
from hilrig.kinds.disturbances.force_sine import ForceSine
from hilrig.kinds.disturbances.friction_step import FrictionStep
from hilrig.kinds.disturbances.measurement_delay import MeasurementDelay
from hilrig.kinds.disturbances.sensor_noise import SensorNoise
from hilrig.kinds.disturbances.surface_motion import SurfaceMotion

SERVO = Actuation("position_servo", stiffness=60.0)
EVERYTHING = (
    SensorNoise(force=0.05, joint=2e-5), MeasurementDelay(ticks=3, at=0.05, until=0.15), ForceSine(0.5, 9.0, "x"),
    SurfaceMotion(0.002, 5.0), FrictionStep(2.0, at=0.1),
)  # fmt: skip


class Kept(NamedTuple):
    """What the law below remembers."""

    sums: Array
    """(2, 2): not one-dimensional, as a user's memory may be"""


@dataclass(frozen=True)
class Numpy:
    """A law in plain Python that keeps the states it was given: they must not change later."""

    fault: str = ""
    gain: float = 300.0
    memory: Literal["plain", "strided", "transposed"] = "plain"
    """How the memory lies: only the plain one has a flat view"""

    def start(self, task: Task, state: State) -> Law:
        lying = {"plain": np.zeros((2, 2)), "strided": np.zeros((2, 4))[:, ::2], "transposed": np.zeros((2, 2)).T}
        given: list[State] = []
        heard: list[Reference] = []

        def step(parameters: object, memory: Kept, state: State, reference: Reference) -> Any:
            given.append(state)
            heard.append(reference)
            memory.sums[:] += np.outer(state.position, given[0].position)
            force = self.gain * (reference.position - state.position) - 20.0 * state.velocity + reference.force
            earlier = max(len(given) - 9, 0)
            force += 100.0 * heard[earlier].velocity
            torque = state.jacobian.T @ force + given[earlier].torque * 0.1
            if self.fault and len(given) == 60:
                return {"shape": torque[:1], "nan": torque * np.nan, "huge": torque * 1e300}[self.fault]
            return torque

        return Law(step, None, Kept(lying[self.memory]))


class Counted(NamedTuple):
    """What the law below remembers."""

    count: Array


@kernel
def faulty_step(parameters: tuple[float, ...], memory: tuple[Array, ...], state: State, reference: Reference) -> Array:
    """Damp what moves, and at the 60th call do what the parameter says."""
    memory[0][0] += 1.0
    torque = -1.0 * state.joint_velocity
    if memory[0][0] == 60.0:
        if parameters[0] == 1.0:
            raise ValueError("no idea")
        torque *= np.nan
    return torque


@dataclass(frozen=True)
class Compiled:
    """A law whose kernel goes wrong at the 60th call."""

    fault: str

    def start(self, task: Task, state: State) -> Law:
        return Law(faulty_step, (float(self.fault == "raises"),), Counted(np.zeros(1)))
