"""A constant error of what is measured."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar, Literal

import numpy as np

from hilrig.disturbances._window import window
from hilrig.interfaces import Parameter, PerAxis, per_axis
from hilrig.signals import WRENCH_AXES, Array, Inputs


@dataclass(frozen=True)
class SensorBias:
    """F_e along `axis` as measured += force, q as measured += joint, for at <= t < until."""

    acts_on: ClassVar[tuple[str, ...]] = ("wrench_error", "joint_error")

    force: Annotated[float, Parameter("N", "error of the measured force", -1e3, 1e3)] = 0.0
    axis: Annotated[Literal["x", "y", "z"], Parameter("", "force component of the sensor that is wrong")] = "z"
    joint: Annotated[PerAxis, Parameter("rad", "error of the joint positions, for all or one each", -1.0, 1.0)] = 0.0
    at: Annotated[float, Parameter("s", "when it begins", 0.0)] = 0.0
    until: Annotated[float | None, Parameter("s", "when it ends; default: never", 0.0)] = None

    def apply(self, inputs: Inputs, time: Array, axes: tuple[str, ...], random: np.random.Generator) -> None:
        """Add the errors to `inputs.wrench_error` and `inputs.joint_error`.

        Raises ValueError for too many joints.
        """
        inside = window(time, self.at, self.until)
        inputs.wrench_error[inside, WRENCH_AXES.index(self.axis)] += self.force
        inputs.joint_error[inside] += per_axis(self.joint, inputs.joint_error.shape[1], "joint")
