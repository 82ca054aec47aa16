"""A constant force on the tip for a short while."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np

from hilrig.core.parameters import Parameter
from hilrig.core.signals import Array, DisturbanceSchedule
from hilrig.kinds.disturbances._window import axis_index, window


@dataclass(frozen=True)
class ForcePulse:
    """f(t) = force along one task axis, for at <= t < at + duration."""

    acts_on: ClassVar[tuple[str, ...]] = ("plant_tip_force",)

    force: Annotated[float, Parameter("N", "the force, with sign", -1e4, 1e4)]
    axis: Annotated[str, Parameter("", "task axis along which it acts")]
    at: Annotated[float, Parameter("s", "when it begins", 0.0)]
    duration: Annotated[float, Parameter("s", "how long it lasts", 1e-4)]

    def apply(
        self, schedule: DisturbanceSchedule, time: Array, axes: tuple[str, ...], random: np.random.Generator
    ) -> None:
        """Add the force to `schedule.plant_tip_force`. Raises ValueError for an unknown axis."""
        inside = window(time, self.at, self.at + self.duration)
        schedule.plant_tip_force[:, axis_index(self.axis, axes)] += self.force * inside
