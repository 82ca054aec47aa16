"""The record of a plant's stages before and after the ticks, and how long each took."""

from __future__ import annotations

import time

import numpy as np

from hilrig.core.interfaces import Progress
from hilrig.loop.driver_node import DriverNode
from hilrig.loop.life_cycle import STAGES
from hilrig.rig.channels import RecordSender

CHANNEL = "stages"


class StageRecord:
    """Writes one message for each period of a stage."""

    def __init__(self, record: RecordSender, period: float) -> None:
        self._record, self._period = record, period
        self._rows = record.batches[CHANNEL]
        self._stage, self._began, self._number, self._row = "", 0.0, 0, 0
        self.durations: dict[str, float] = {}
        """How long each stage took, s"""

    def enter(self, stage: str) -> None:
        """Begin a stage."""
        now = time.monotonic()
        if self._stage:
            self.durations[self._stage] = now - self._began
        if self._row:
            self._hand_over()
        self._stage, self._began = stage, now

    def elapsed(self) -> float:
        """Return the time since the stage began, s."""
        return time.monotonic() - self._began

    def note(self, node: DriverNode, progress: Progress) -> None:
        """Write a period of the stage: what was measured in it, and what the plant does."""
        seen, command = node.arrays.observation.measurement, progress.command
        none = np.full(seen.joint_position.size, np.nan)
        values = (
            self._number, self.elapsed(), STAGES.index(self._stage), seen.joint_position, seen.wrench,
            none if command is None else command.torque, none if command is None else command.position,
            progress.value, progress.target,
        )  # fmt: skip
        for field, value in zip(self._rows.fields, values, strict=True):
            field[self._row] = value
        self._row, self._number = self._row + 1, self._number + 1
        self._record.written[CHANNEL] = self._row
        if self._row == self._record.rows:
            self._hand_over()

    def _hand_over(self) -> None:
        self._record.ship()
        self._row = 0
