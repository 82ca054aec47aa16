"""A control law that takes longer to compute."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np

from hilrig.core.parameters import Parameter
from hilrig.core.signals import Array, DisturbanceSchedule
from hilrig.kinds.disturbances._fault_times import Duration, FaultTimes, check_duration, drawn


@dataclass(frozen=True, kw_only=True)
class SlowController(FaultTimes):
    """The controller computes for `duration` longer at the given ticks: busy, not asleep.

    A fault of the loop: real time over the bus only.
    """

    acts_on: ClassVar[tuple[str, ...]] = ("faults.controller_busy",)

    duration: Annotated[Duration, Parameter("s", "how much longer; given two, each is drawn between them", 1e-6, 1.0)]

    def __post_init__(self) -> None:
        """Raise ValueError unless the ticks are given in exactly one way, and the duration is valid."""
        super().__post_init__()
        check_duration(self.duration)

    def apply(
        self, schedule: DisturbanceSchedule, time: Array, axes: tuple[str, ...], random: np.random.Generator
    ) -> None:
        """Add to `schedule.faults.controller_busy`. Raises ValueError if the ticks do not fit into the trial."""
        ticks = self.ticks(time, random)
        schedule.faults.controller_busy[ticks] += drawn(self.duration, ticks.size, random)
