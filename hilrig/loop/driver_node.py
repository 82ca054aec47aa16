"""The driver node's part of a trial: the plant, its disturbances, its sensors and the safety limits."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from hilrig.core.errors import Tripped
from hilrig.core.interfaces import Plant
from hilrig.core.signals import Command, plant_disturbance
from hilrig.experiment.trial import Trial, trial_start
from hilrig.loop.measure import DriverArrays, driver_arrays, driver_ticks
from hilrig.loop.plain_parts import plant_kernels, take, take_measurement
from hilrig.loop.rows import DriverRows
from hilrig.loop.safety import why_unsafe


class DriverNode:
    """Owns the plant from construction until `close`."""

    def __init__(self, trial: Trial) -> None:
        self.trial = trial
        self.arrays: DriverArrays = driver_arrays(trial)
        self.plant: Plant = trial.driver.connect(trial_start(trial))
        self.truthful = False
        """Whether the plant knows its true state; valid from the first measurement on"""
        self._parts: Iterator[bool] | None = None
        self._acting: Command | None = None
        self._begun = self._closed = False
        try:
            self.kernels = plant_kernels(self.plant, self._name)
        except BaseException:
            self.close()
            raise

    @property
    def compiled(self) -> bool:
        """Whether the plant offers kernels of its own."""
        return hasattr(self.plant, "kernels")

    def bind(self, rows: DriverRows, acting: Command) -> None:
        """Set where the ticks are recorded, and the acting command: arrays (n,) that others fill."""
        self._acting = acting
        self._parts = driver_ticks(self.kernels, self.trial.ticks, self.arrays, rows, acting)

    def first(self) -> Command:
        """Measure for the first time, just before the first tick; return the command that holds the plant."""
        now = plant_disturbance(self.arrays.schedule, 0)
        first = self.arrays.observation
        take_measurement(first, self.plant.measure(now), f"driver {self._name}: measure")
        self.arrays.last_position[:] = first.measurement.joint_position
        self.truthful = self.plant.truth(now) is not None
        self._begun = True
        hold = Command(*(np.zeros(self.trial.driver.robot.joints) for _ in Command._fields))
        take(hold, self.plant.holding_command(), Command, f"driver {self._name}: holding_command")
        return hold

    def measure(self, tick: int) -> None:
        """Measure at `tick` into row `tick` modulo the number of rows. Raises Tripped beyond a safety limit."""
        assert self._parts is not None, "bind() comes first"
        if not self._begun:
            assert self._acting is not None
            for room, value in zip(self._acting, self.first(), strict=True):
                room[:] = value
        if not next(self._parts):
            raise Tripped(self.why_unsafe(tick))

    def advance(self) -> None:
        """Run the period that begins at the measured tick under the acting command."""
        assert self._parts is not None, "bind() comes first"
        next(self._parts)

    def why_unsafe(self, tick: int) -> str:
        """Return why the measurement of `tick`, the last one, ends the trial."""
        exact, last, limits = self.arrays.observation.measurement, self.arrays.last_position, self.trial.limits
        return why_unsafe(tick, exact, last, self.trial.period, limits)

    @property
    def _name(self) -> str:
        return type(self.trial.driver).__name__

    def close(self) -> None:
        """Release the plant, once."""
        if not self._closed:
            self._closed = True
            self.plant.close()
