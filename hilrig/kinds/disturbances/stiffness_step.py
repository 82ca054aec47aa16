"""A surface that becomes stiffer or softer."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np

from hilrig.core.parameters import Parameter
from hilrig.core.signals import Array, DisturbanceSchedule
from hilrig.kinds.disturbances._window import window


@dataclass(frozen=True)
class StiffnessStep:
    """K_e(t) = factor K_e for at <= t < until."""

    acts_on: ClassVar[tuple[str, ...]] = ("plant_stiffness_scale",)

    factor: Annotated[float, Parameter("", "factor on the surface's stiffness", 0.0, 1e3, "log")]
    at: Annotated[float, Parameter("s", "when it begins", 0.0)]
    until: Annotated[float | None, Parameter("s", "when it ends; default: never", 0.0)] = None

    def apply(
        self, schedule: DisturbanceSchedule, time: Array, axes: tuple[str, ...], random: np.random.Generator
    ) -> None:
        """Multiply `schedule.plant_stiffness_scale`."""
        schedule.plant_stiffness_scale[window(time, self.at, self.until)] *= self.factor
