"""Messages that the bus holds back."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar, Literal

import numpy as np

from hilrig.core.parameters import Parameter
from hilrig.core.signals import Array, DisturbanceSchedule
from hilrig.kinds.disturbances._fault_times import Duration, FaultTimes, check_duration, drawn


@dataclass(frozen=True, kw_only=True)
class BusDelay(FaultTimes):
    """The bus holds back the state or command of the given ticks for `duration`; later messages wait behind it.

    The sender continues at once. A fault of the loop: real time over the bus only.
    """

    acts_on: ClassVar[tuple[str, ...]] = ("faults.state_delay", "faults.command_delay")

    channel: Annotated[Literal["state", "command"], Parameter("", "which messages: state or command")]
    duration: Annotated[Duration, Parameter("s", "how long; given two, each is drawn between them", 1e-6, 1.0)]

    def __post_init__(self) -> None:
        """Raise ValueError unless the ticks are given in exactly one way, and the duration is valid."""
        super().__post_init__()
        check_duration(self.duration)

    def apply(
        self, schedule: DisturbanceSchedule, time: Array, axes: tuple[str, ...], random: np.random.Generator
    ) -> None:
        """Add to the channel's delay in `schedule.faults`. Raises ValueError if the ticks do not fit into the trial."""
        delay = schedule.faults.state_delay if self.channel == "state" else schedule.faults.command_delay
        ticks = self.ticks(time, random)
        delay[ticks] += drawn(self.duration, ticks.size, random)
