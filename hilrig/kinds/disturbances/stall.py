"""A process of the loop that pauses for a while."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar, Literal

import numpy as np

from hilrig.core.parameters import Parameter
from hilrig.core.signals import Array, DisturbanceSchedule
from hilrig.kinds.disturbances._fault_times import Duration, FaultTimes, check_duration, drawn


@dataclass(frozen=True, kw_only=True)
class Stall(FaultTimes):
    """A process sleeps, or is stopped (SIGSTOP) and continued, for `duration` at the given ticks.

    The driver pauses after waking for the tick and before measuring, the controller after receiving the state and
    before computing. A fault of the loop: real time over the bus only.
    """

    acts_on: ClassVar[tuple[str, ...]] = (
        "faults.driver_stall", "faults.driver_stop", "faults.controller_stall", "faults.controller_stop",
    )  # fmt: skip

    process: Annotated[Literal["driver", "controller"], Parameter("", "which process: driver or controller")]
    duration: Annotated[Duration, Parameter("s", "how long; given two, each is drawn between them", 1e-6, 1.0)]
    by: Annotated[
        Literal["sleep", "stop"], Parameter("", "sleep: its main thread sleeps; stop: all its threads stop")
    ] = "sleep"

    def __post_init__(self) -> None:
        """Raise ValueError unless the ticks are given in exactly one way, and the duration is valid."""
        super().__post_init__()
        check_duration(self.duration)

    def apply(
        self, schedule: DisturbanceSchedule, time: Array, axes: tuple[str, ...], random: np.random.Generator
    ) -> None:
        """Add the time to the process's stalls or stops. Raises ValueError if the ticks do not fit into the trial."""
        standing: Array = getattr(schedule.faults, f"{self.process}_{'stall' if self.by == 'sleep' else 'stop'}")
        ticks = self.ticks(time, random)
        standing[ticks] += drawn(self.duration, ticks.size, random)
