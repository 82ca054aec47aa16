"""A constant measurement error."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar, Literal

import numpy as np

from hilrig.core.parameters import Parameter, PerAxis, per_axis
from hilrig.core.signals import WRENCH_AXES, Array, DisturbanceSchedule
from hilrig.kinds.disturbances._window import window


@dataclass(frozen=True)
class SensorBias:
    """Measured F_e along `axis` += force, measured q += joint, for at <= t < until."""

    acts_on: ClassVar[tuple[str, ...]] = ("wrench_error", "joint_error")

    force: Annotated[float, Parameter("N", "error of the measured force", -1e3, 1e3)] = 0.0
    axis: Annotated[Literal["x", "y", "z"], Parameter("", "force component with the error")] = "z"
    joint: Annotated[PerAxis, Parameter("rad", "error of the joint positions, one or one per joint", -1.0, 1.0)] = 0.0
    at: Annotated[float, Parameter("s", "when it begins", 0.0)] = 0.0
    until: Annotated[float | None, Parameter("s", "when it ends; default: never", 0.0)] = None

    def apply(
        self, schedule: DisturbanceSchedule, time: Array, axes: tuple[str, ...], random: np.random.Generator
    ) -> None:
        """Add the errors to `schedule.wrench_error` and `schedule.joint_error`.

        Raises ValueError if `joint` has the wrong number of values.
        """
        inside = window(time, self.at, self.until)
        schedule.wrench_error[inside, WRENCH_AXES.index(self.axis)] += self.force
        schedule.joint_error[inside] += per_axis(self.joint, schedule.joint_error.shape[1], "joint")
