"""Messages that the bus loses."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar, Literal

import numpy as np

from hilrig.core.parameters import Parameter
from hilrig.core.signals import Array, DisturbanceSchedule
from hilrig.kinds.disturbances._fault_times import FaultTimes


@dataclass(frozen=True, kw_only=True)
class BusLoss(FaultTimes):
    """The state or command of the given ticks never arrives. A fault of the loop: real time over the bus only."""

    acts_on: ClassVar[tuple[str, ...]] = ("faults.state_loss", "faults.command_loss")

    channel: Annotated[Literal["state", "command"], Parameter("", "which messages: state or command")]

    def apply(
        self, schedule: DisturbanceSchedule, time: Array, axes: tuple[str, ...], random: np.random.Generator
    ) -> None:
        """Set the channel's loss in `schedule.faults` to 1. Raises ValueError if the ticks do not fit the trial."""
        loss = schedule.faults.state_loss if self.channel == "state" else schedule.faults.command_loss
        loss[self.ticks(time, random)] = 1.0
