"""A surface that becomes stiffer or softer."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np

from hilrig.disturbances._window import window
from hilrig.interfaces import Parameter
from hilrig.signals import Array, Inputs


@dataclass(frozen=True)
class StiffnessStep:
    """K_e(t) = factor K_e for at <= t < until."""

    acts_on: ClassVar[tuple[str, ...]] = ("plant_stiffness_scale",)

    factor: Annotated[float, Parameter("", "on the surface's stiffness", 0.0, 1e3, "log")]
    at: Annotated[float, Parameter("s", "when it begins", 0.0)]
    until: Annotated[float | None, Parameter("s", "when it ends; default: never", 0.0)] = None

    def apply(self, inputs: Inputs, time: Array, axes: tuple[str, ...], random: np.random.Generator) -> None:
        """Multiply `inputs.plant_stiffness_scale`."""
        inputs.plant_stiffness_scale[window(time, self.at, self.until)] *= self.factor
