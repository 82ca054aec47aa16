"""White measurement noise."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np

from hilrig.core.parameters import Parameter
from hilrig.core.signals import WRENCH_AXES, Array, DisturbanceSchedule


@dataclass(frozen=True)
class SensorNoise:
    """Measured F_e and q += white normal noise, independent between ticks and between channels.

    `force` is the standard deviation of each force component, `joint` that of each joint position. Moments
    stay exact. The draws do not depend on the deviations: doubling them gives the same noise, twice as large.
    """

    acts_on: ClassVar[tuple[str, ...]] = ("wrench_error", "joint_error")

    force: Annotated[float, Parameter("N", "standard deviation of each force component", 0.0, 1e3)] = 0.0
    joint: Annotated[float, Parameter("rad", "standard deviation of each joint position", 0.0, 1.0)] = 0.0

    def apply(
        self, schedule: DisturbanceSchedule, time: Array, axes: tuple[str, ...], random: np.random.Generator
    ) -> None:
        """Add noise from `random` to `schedule.wrench_error` and `schedule.joint_error`."""
        forces = schedule.wrench_error[:, : len(WRENCH_AXES)]
        forces += self.force * random.standard_normal(forces.shape)
        schedule.joint_error[:] += self.joint * random.standard_normal(schedule.joint_error.shape)
