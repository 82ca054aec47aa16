"""A plant that is not simulated, for the rig: it stands still whatever it is told, and can be held."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from hilrig import Array, Capabilities, Command, Measurement, PlantDisturbance, Progress, Robot, TrialStart


@dataclass(frozen=True)
class StandingArm:
    """q = q(0)"""

    capabilities: ClassVar[Capabilities] = Capabilities(("realtime",), (), simulated=False, stop_time=1.0)
    servo_gain: ClassVar[None] = None
    surface_position: ClassVar[float] = 0.35
    robot: Robot

    def connect(self, start: TrialStart) -> StandingPlant:
        """Return the plant."""
        return StandingPlant(start.joint_position)


class StandingPlant:
    """The arm in one trial."""

    def __init__(self, q: Array) -> None:
        self._q = q.copy()

    def prepare(self) -> Iterator[Progress]:
        """Do nothing for a period."""
        yield Progress("standing")

    def measure(self, disturbance: PlantDisturbance) -> Measurement:
        """Return where it stands."""
        return Measurement(self._q.copy(), np.zeros(6), np.zeros(2))

    def advance(self, command: Command, disturbance: PlantDisturbance) -> None:
        """Do nothing."""

    def holding_command(self) -> Command:
        """Return no torque."""
        return Command(np.zeros(2), self._q.copy())

    def truth(self, disturbance: PlantDisturbance) -> None:
        """Return None, as a robot does."""

    def hold(self) -> None:
        """Do nothing: it stands."""

    def close(self) -> None:
        """Do nothing."""
