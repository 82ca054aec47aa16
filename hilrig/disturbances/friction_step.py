"""Friction that changes, of the surface or of the joints."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar, Literal

import numpy as np

from hilrig.disturbances._window import window
from hilrig.interfaces import Parameter
from hilrig.signals import Array, Inputs


@dataclass(frozen=True)
class FrictionStep:
    """mu(t) = factor mu (of: surface), or F(q', t) = factor F(q') (of: joints), for at <= t < until."""

    acts_on: ClassVar[tuple[str, ...]] = ("plant_surface_friction_scale", "plant_joint_friction_scale")

    factor: Annotated[float, Parameter("", "on the friction", 0.0, 1e3, "log")]
    at: Annotated[float, Parameter("s", "when it begins", 0.0)]
    of: Literal["surface", "joints"] = "surface"
    until: Annotated[float | None, Parameter("s", "when it ends; default: never", 0.0)] = None

    def apply(self, inputs: Inputs, time: Array, axes: tuple[str, ...], random: np.random.Generator) -> None:
        """Multiply the scale of the surface's or of the joints' friction in `inputs`."""
        joints = self.of == "joints"
        scale = inputs.plant_joint_friction_scale if joints else inputs.plant_surface_friction_scale
        scale[window(time, self.at, self.until)] *= self.factor
