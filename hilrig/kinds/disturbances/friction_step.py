"""A change of the friction of the surface or of the joints."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar, Literal

import numpy as np

from hilrig.core.parameters import Parameter
from hilrig.core.signals import Array, DisturbanceSchedule
from hilrig.kinds.disturbances._window import window


@dataclass(frozen=True)
class FrictionStep:
    """mu(t) = factor mu (of: surface), or F(q', t) = factor F(q') (of: joints), for at <= t < until."""

    acts_on: ClassVar[tuple[str, ...]] = ("plant_surface_friction_scale", "plant_joint_friction_scale")

    factor: Annotated[float, Parameter("", "factor on the friction", 0.0, 1e3, "log")]
    at: Annotated[float, Parameter("s", "when it begins", 0.0)]
    of: Literal["surface", "joints"] = "surface"
    until: Annotated[float | None, Parameter("s", "when it ends; default: never", 0.0)] = None

    def apply(
        self, schedule: DisturbanceSchedule, time: Array, axes: tuple[str, ...], random: np.random.Generator
    ) -> None:
        """Multiply the scale of the surface's or of the joints' friction in `schedule`."""
        joints = self.of == "joints"
        scale = schedule.plant_joint_friction_scale if joints else schedule.plant_surface_friction_scale
        scale[window(time, self.at, self.until)] *= self.factor
