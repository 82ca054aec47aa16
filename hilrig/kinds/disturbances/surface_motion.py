"""A surface that oscillates along its normal."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np

from hilrig.core.parameters import Parameter
from hilrig.core.signals import Array, DisturbanceSchedule


@dataclass(frozen=True)
class SurfaceMotion:
    """d(t) = r(t) amplitude sin(frequency (t - at)) for t >= at; r rises from 0 to 1 in `ramp`.

    r(t) = 10 s^3 - 15 s^4 + 6 s^5, s = (t - at) / ramp: displacement, velocity and acceleration start at zero.
    """

    acts_on: ClassVar[tuple[str, ...]] = ("plant_surface_offset", "plant_surface_velocity")

    amplitude: Annotated[float, Parameter("m", "amplitude of the displacement", 0.0, 1.0)]
    frequency: Annotated[float, Parameter("rad/s", "angular frequency; '1 Hz' is 2 pi rad/s", 0.0, 1e3, "log")]
    at: Annotated[float, Parameter("s", "when it begins", 0.0)] = 0.0
    ramp: Annotated[float, Parameter("s", "time to reach the full amplitude", 1e-3, 1e3)] = 1.0

    def apply(
        self, schedule: DisturbanceSchedule, time: Array, axes: tuple[str, ...], random: np.random.Generator
    ) -> None:
        """Add the motion to the surface's offset and velocity in `schedule`."""
        w, after = self.frequency, np.maximum(time - self.at, 0.0)
        s = np.minimum(after / self.ramp, 1.0)
        rise = s**3 * (10 - 15 * s + 6 * s**2)
        rise_rate = 30 * s**2 * (1 - s) ** 2 / self.ramp
        sine = np.sin(w * after)
        schedule.plant_surface_offset[:] += self.amplitude * rise * sine
        schedule.plant_surface_velocity[:] += self.amplitude * (rise_rate * sine + rise * w * np.cos(w * after))
