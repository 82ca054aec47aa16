"""A sinusoidal force on the tip."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np

from hilrig.core.parameters import Parameter
from hilrig.core.signals import Array, DisturbanceSchedule
from hilrig.kinds.disturbances._window import axis_index, window


@dataclass(frozen=True)
class ForceSine:
    """f(t) = amplitude sin(frequency (t - at) + angle) along one task axis, for at <= t < until."""

    acts_on: ClassVar[tuple[str, ...]] = ("plant_tip_force",)

    amplitude: Annotated[float, Parameter("N", "amplitude of the force", 0.0, 1e4)]
    frequency: Annotated[float, Parameter("rad/s", "angular frequency; '1 Hz' is 2 pi rad/s", 0.0, 1e4, "log")]
    axis: Annotated[str, Parameter("", "task axis along which it acts")]
    angle: Annotated[float, Parameter("rad", "phase angle at the beginning")] = 0.0
    at: Annotated[float, Parameter("s", "when it begins", 0.0)] = 0.0
    until: Annotated[float | None, Parameter("s", "when it ends; default: never", 0.0)] = None

    def apply(
        self, schedule: DisturbanceSchedule, time: Array, axes: tuple[str, ...], random: np.random.Generator
    ) -> None:
        """Add the force to `schedule.plant_tip_force`. Raises ValueError for an unknown axis."""
        force = self.amplitude * np.sin(self.frequency * (time - self.at) + self.angle)
        schedule.plant_tip_force[:, axis_index(self.axis, axes)] += force * window(time, self.at, self.until)
