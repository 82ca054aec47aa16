"""The driver node's part of a trial: the plant, its disturbances, its sensors and the safety limits."""

from __future__ import annotations

import time
from collections.abc import Iterator

import numpy as np

from hilrig.core.errors import PluginError, RigError, Tripped, raised
from hilrig.core.interfaces import Plant, Progress
from hilrig.core.signals import Array, Command, PlantDisturbance, plant_disturbance
from hilrig.experiment.trial import Trial, trial_start
from hilrig.loop.envelope import bound, why_bounded
from hilrig.loop.measure import DriverArrays, driver_arrays, driver_ticks, since_sample
from hilrig.loop.plain_parts import plant_kernels, take, take_measurement
from hilrig.loop.rows import DriverRows
from hilrig.loop.safety import why_outside, why_unsafe

LOOK_AT_THE_ARM = "look at the arm"
"""In every message that says that a plant could not be held or closed"""
BEFORE_TICKS = -1
"""Stands for a tick before the first one"""


class DriverNode:
    """Owns the plant from `connect` until `release`."""

    def __init__(self, trial: Trial) -> None:
        self.trial = trial
        self.arrays: DriverArrays = driver_arrays(trial)
        self.simulated = trial.driver.capabilities.simulated
        self.truthful = False
        """Whether the plant knows its true state; valid from the first measurement on"""
        self.busy = False
        """Whether the plant's code is running: no other thread may call it then"""
        self.held_ns = 0
        """When the plant was first held, ns of `time.monotonic`; 0 if it was not"""
        self._plant: Plant | None = None
        self._parts: Iterator[bool] | None = None
        self._acting: Command | None = None
        self._rows: DriverRows | None = None
        self._begun = False
        self._left_out = 0

    def connect(self) -> None:
        """Connect to the plant. Nothing moves."""
        self.adopt(self.trial.driver.connect(trial_start(self.trial)))

    def adopt(self, plant: Plant) -> None:
        """Take a plant that is connected. Raises PluginError if it lacks what it needs."""
        self._plant = plant
        if not self.simulated and not callable(getattr(plant, "hold", None)):
            raise PluginError(f"driver {self._name}: its plant is not simulated, so it must offer `hold`")
        self.kernels = plant_kernels(plant, self._name)

    @property
    def plant(self) -> Plant:
        """The plant; `connect` comes first."""
        assert self._plant is not None, "connect() comes first"
        return self._plant

    @property
    def connected(self) -> bool:
        """Whether the node has a plant."""
        return self._plant is not None

    @property
    def staged(self) -> bool:
        """Whether the plant does something before or after the ticks."""
        return any(hasattr(self.plant, stage) for stage in ("prepare", "approach", "retract"))

    @property
    def compiled(self) -> bool:
        """Whether the plant offers kernels of its own."""
        return hasattr(self.plant, "kernels")

    def bind(self, rows: DriverRows, acting: Command) -> None:
        """Set where the ticks are recorded, and the acting command: arrays (n,) that others fill."""
        self._rows, self._acting = rows, acting

    def first(self) -> Command:
        """Measure for the first time, just before the first tick; return the command that holds the plant."""
        now = plant_disturbance(self.arrays.schedule, 0)
        self._look(now)
        self.truthful = self.plant.truth(now) is not None
        self._begun = True
        hold = Command(*(np.zeros(self.trial.driver.robot.joints) for _ in Command._fields))
        take(hold, self.plant.holding_command(), Command, f"driver {self._name}: holding_command")
        for room, value in zip(self.arrays.applied, hold, strict=True):
            room[:] = value
        return hold

    def _look(self, now: PlantDisturbance) -> None:
        take_measurement(self.arrays.observation, self.plant.measure(now), f"driver {self._name}: measure")
        self._seen()

    def _seen(self) -> None:
        """Remember the last measurement, for the rates."""
        arrays = self.arrays
        arrays.last_position[:] = arrays.observation.measurement.joint_position
        if arrays.observation.sample[1]:
            arrays.last_sample[1] = arrays.observation.sample[0]

    @property
    def joint_position(self) -> Array:
        """The joint positions that were measured last, without sensor errors, (n,) rad"""
        return self.arrays.observation.measurement.joint_position

    @property
    def fresh(self) -> bool:
        """Whether the last sample was new; that of the first tick always is, even if it was also read to begin"""
        return bool(self.arrays.observation.sample[1]) or self.arrays.clock[0] == 0

    def measure(self, tick: int, left_out: int = 0) -> None:
        """Measure at `tick` into the next row, after `left_out` ticks that were not done. Raises Tripped."""
        if self._parts is None:
            assert self._rows is not None, "bind() comes first"
            assert self._acting is not None
            self._parts = driver_ticks(self.kernels, self.arrays, self._rows, self._acting)
            for room, value in zip(self._acting, self.first(), strict=True):
                room[:] = value
        clock = self.arrays.clock
        clock[0] = tick
        if left_out != self._left_out:
            self._left_out = left_out
            # A robot has gone on by itself.
            clock[1] = left_out if self.simulated else 0
        self.busy = True
        safe = next(self._parts)
        self.busy = False
        if not safe:
            raise Tripped(self.why_unsafe(tick))

    def advance(self) -> None:
        """Run the period that begins at the measured tick under the acting command."""
        assert self._parts is not None, "measure() comes first"
        self.busy = True
        within = next(self._parts)
        self.busy = False
        if not within:
            assert self._acting is not None
            raise Tripped(self.why_refused(int(self.arrays.clock[0]), self._acting))

    @property
    def tripped(self) -> bool:
        """Whether the last command ended the trial"""
        return bool(self.arrays.limited[0] & self.arrays.within.trips)

    def why_refused(self, tick: int, asked: Command) -> str:
        """Return why the command at `tick` ended the trial."""
        return why_bounded(int(self.arrays.limited[0]), tick, self.trial.period, asked, self.trial.limits)

    def steps(self, stage: str) -> Iterator[Progress] | None:
        """Return the plant's steps of "prepare", "approach" or "retract"; None if it does not offer them."""
        offered = getattr(self.plant, stage, None)
        return None if offered is None else iter(offered())

    def step(self, stage: str, steps: Iterator[Progress], quiet: PlantDisturbance) -> Progress | None:
        """Measure, and do one period of a stage; return its progress, None if the stage is done.

        Raises Tripped beyond a safety limit, PluginError if the plant yields something else.
        """
        self.busy = True
        try:
            return self._step(stage, steps, quiet)
        finally:
            self.busy = False

    def _step(self, stage: str, steps: Iterator[Progress], quiet: PlantDisturbance) -> Progress | None:
        if not self._begun:
            self.first()
        last, arrays = self.arrays.last_position.copy(), self.arrays
        take_measurement(arrays.observation, self.plant.measure(quiet), f"driver {self._name}: measure")
        elapsed = since_sample(BEFORE_TICKS, arrays)
        self._seen()
        exact, period = arrays.observation.measurement, self.trial.period
        why = why_unsafe(BEFORE_TICKS, exact, last, period, self.trial.limits, elapsed)
        if why:
            raise Tripped(f"{stage}: {why}")
        progress = next(steps, None)
        if progress is None:
            return None
        if not isinstance(progress, Progress):
            raise PluginError(f"driver {self._name}: {stage} yielded a {type(progress).__name__}, not a Progress")
        if progress.command is not None:
            self._apply(stage, progress.command, quiet)
        return progress

    def _apply(self, stage: str, command: Command, quiet: PlantDisturbance) -> None:
        """Apply a command of a stage."""
        wanted = Command(*(np.zeros(self.trial.driver.robot.joints) for _ in Command._fields))
        take(wanted, command, Command, f"driver {self._name}: {stage}")
        arrays = self.arrays
        arrays.limited[0] = bound(wanted.torque, wanted.position, arrays.within, arrays.applied)
        if self.tripped:
            raise Tripped(f"{stage}: {self.why_refused(BEFORE_TICKS, wanted)}")
        self.plant.advance(Command(*(part.copy() for part in arrays.applied)), quiet)

    def require_start(self, quiet: PlantDisturbance) -> None:
        """Measure, and raise RigError unless the arm is where the trial starts."""
        if self.simulated:  # it was put there
            return
        self._look(quiet)
        now, start = self.joint_position, trial_start(self.trial).joint_position
        tolerance = self.trial.limits.start_tolerance
        off = np.abs(now - start)
        if off.max() > tolerance:
            joint = int(off.argmax())
            raise RigError(
                f"the arm is not where the trial starts: joint {joint + 1} is at {now[joint]:.4g} rad, and the trial "
                f"starts at {start[joint]:.4g} rad (tolerance {tolerance:g} rad, safety.start_tolerance); move the arm "
                f"there, or set task.start to where it is"
            )

    def why_unsafe(self, tick: int) -> str:
        """Return why the measurement of `tick`, the last one, ends the trial."""
        arrays, period = self.arrays, self.trial.period
        exact, tip = arrays.observation.measurement, arrays.observation.truth.position
        elapsed = since_sample(tick, arrays)
        return why_unsafe(tick, exact, arrays.last_position, period, self.trial.limits, elapsed) or why_outside(
            tick, exact.joint_position, tip, arrays.joint_range, arrays.tip_range, period
        )

    @property
    def _name(self) -> str:
        return type(self.trial.driver).__name__

    def hold(self) -> None:
        """Stop the plant where it is, if it can be stopped: a simulation stands still when nothing advances it."""
        getattr(self._plant, "hold", _nothing)()
        self.held_ns = self.held_ns or time.monotonic_ns()

    def release(self) -> None:
        """Hold the plant, then close it, once. Raises RigError if it could not be held or closed."""
        plant = self._plant
        if plant is None:
            return
        problems: list[str] = []
        for name, do in (("hold", self.hold), ("close", plant.close)):
            try:
                do()
            except Exception as error:
                problems.append(f"{name} raised {raised(error)}")
        self._plant = None
        if problems:
            raise RigError(f"driver {self._name}: {'; '.join(problems)}: {LOOK_AT_THE_ARM}")


def _nothing() -> None:
    pass
