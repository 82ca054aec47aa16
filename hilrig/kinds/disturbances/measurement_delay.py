"""Measurements that reach the controller late."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np

from hilrig.core.parameters import Parameter
from hilrig.core.signals import Array, DisturbanceSchedule
from hilrig.kinds.disturbances._window import TOLERANCE, window


@dataclass(frozen=True)
class MeasurementDelay:
    """At tick k the controller receives the measurement of tick k - d, for at <= t < until.

    d is given as a number of `ticks` or as a time `delay` (a whole number of periods), not both.
    """

    acts_on: ClassVar[tuple[str, ...]] = ("measurement_delay",)

    ticks: Annotated[int | None, Parameter("", "delay in ticks", 1, 1000)] = None
    delay: Annotated[float | None, Parameter("s", "delay as a time", 1e-4, 10.0)] = None
    at: Annotated[float, Parameter("s", "when it begins", 0.0)] = 0.0
    until: Annotated[float | None, Parameter("s", "when it ends; default: never", 0.0)] = None

    def __post_init__(self) -> None:
        """Raise ValueError unless exactly one of `ticks` and `delay` is given."""
        if (self.ticks is None) == (self.delay is None):
            raise ValueError("give either 'ticks' or 'delay'")

    def apply(
        self, schedule: DisturbanceSchedule, time: Array, axes: tuple[str, ...], random: np.random.Generator
    ) -> None:
        """Add the delay to `schedule.measurement_delay`.

        Raises ValueError if it is not a whole number of periods.
        """
        schedule.measurement_delay[window(time, self.at, self.until)] += self._whole_ticks(time)

    def _whole_ticks(self, time: Array) -> int:
        if self.delay is None:
            return self.ticks or 0
        period = float(time[1] - time[0])
        ticks = round(self.delay / period)
        if abs(ticks * period - self.delay) > TOLERANCE or ticks < 1:
            raise ValueError(f"a delay of {self.delay:g} s is not a whole number of periods of {period:g} s")
        return ticks
