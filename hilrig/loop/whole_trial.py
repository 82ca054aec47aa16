"""A whole trial in one process, many ticks per call: both nodes, and the loop around them.

The loop is also compiled if the law is a kernel; otherwise it is plain Python.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple, cast

import numpy as np

from hilrig.core.compiler import assembled, can_be_composed
from hilrig.core.errors import Tripped
from hilrig.core.signals import Array, Command, Reference, State
from hilrig.loop.control import ControllerArrays, answer, since
from hilrig.loop.controller_node import ControllerNode
from hilrig.loop.driver_node import DriverNode
from hilrig.loop.measure import DriverArrays, driving, measuring
from hilrig.loop.rows import ControllerRows, DriverRows, put
from hilrig.loop.ticks import Ending


class TrialArrays(NamedTuple):
    """The data around plant and law, and the commands in transit between them."""

    driver: DriverArrays
    controller: ControllerArrays
    commands: Command
    """The last commands, indexed by tick modulo their number: arrays (delay + 1, n)"""
    delay: int
    """Ticks from a measurement until its command acts"""


class TrialRows(NamedTuple):
    """The rows for a block of ticks, one per tick."""

    driver: DriverRows
    controller: ControllerRows


# `assembled` replaces these names.
measure: Callable[..., bool] = cast(Any, None)
observe: Callable[..., float] = cast(Any, None)
drive: Callable[..., bool] = cast(Any, None)
sense: Callable[..., tuple[bool, float]] = cast(Any, None)
act: Callable[..., bool] = cast(Any, None)
law_step: Callable[[Any, Any, State, Reference], Array] = cast(Any, None)


def sense_template(
    tick: int, plant: Any, state: Array, robot: Any, arrays: TrialArrays, rows: TrialRows
) -> tuple[bool, float]:
    """Measure at `tick`; return whether it is safe to continue, and the time since the law's last step, s."""
    row, reported = rows.driver.written[0], rows.driver.state
    if not measure(tick, plant, state, arrays.driver, rows.driver):
        return False, 0.0
    q, wrench = reported.joint_position[row], reported.wrench[row]
    return True, observe(tick, q, wrench, reported.stamp[row], True, robot, arrays.controller, rows.controller)


def act_template(
    tick: int, asked: Array, memory: tuple[Array, ...], plant: Any, state: Array, arrays: TrialArrays, rows: TrialRows
) -> bool:
    """Limit the law's torque and apply it after its delay. Returns False if it cannot be commanded."""
    row, slots = rows.controller.written[0], arrays.commands.torque.shape[0]
    if not answer(tick, asked, memory, arrays.controller, rows.controller):
        return False
    slot, due = tick % slots, (tick - arrays.delay) % slots
    put(arrays.commands.torque[slot], rows.controller.command.torque[row])
    put(arrays.commands.position[slot], rows.controller.command.position[row])
    command = Command(arrays.commands.torque[due], arrays.commands.position[due])
    return drive(tick, command, plant, state, arrays.driver, rows.driver)


def run_template(
    first: int, last: int, parameters: Any, memory: Any, fields: tuple[Array, ...], plant: Any, state: Array,
    robot: Any, arrays: TrialArrays, rows: TrialRows,
) -> int:  # fmt: skip
    """Do the ticks from `first` to `last` - 1; return `last`, or the tick at which the trial had to stop."""
    for tick in range(first, last):
        safe, elapsed = sense(tick, plant, state, robot, arrays, rows)
        if not safe:
            return tick
        asked = law_step(parameters, memory, since(elapsed, arrays.controller.seen), arrays.controller.wanted)
        if not act(tick, asked, fields, plant, state, arrays, rows):
            return tick
    return last


class WholeTrial:
    """A trial in lockstep whose plant offers kernels."""

    def __init__(self, driver: DriverNode) -> None:
        self._driver, self._controller = driver, ControllerNode(driver.trial)
        self._trial = driver.trial
        self.tick = 0
        """The next tick to be done"""

    def start(self, rows: DriverRows) -> dict[str, int]:
        """Start the law; return the length of every field of its memory. Raises Tripped, PluginError.

        This takes a first measurement into `rows`, which changes nothing: the first tick measures again.
        """
        driver, controller = self._driver, self._controller
        held = driver.first()
        commands = Command(*(np.repeat(part[None, :], self._trial.actuation_delay + 1, axis=0) for part in held))
        self._arrays = TrialArrays(driver.arrays, controller.arrays, commands, self._trial.actuation_delay)
        measure = measuring(driver.kernels)
        if not measure(0, driver.kernels.constants, driver.kernels.state, driver.arrays, rows):
            raise Tripped(driver.why_unsafe(0))
        sizes = controller.start(0, rows.state.joint_position[0], rows.state.wrench[0], rows.state.applied_torque[0])
        sense = assembled(sense_template, makes_arrays=False, measure=measure, observe=controller.observe)
        act = assembled(act_template, makes_arrays=False, drive=driving(driver.kernels))
        self._run = assembled(run_template, sense=sense, act=act, law_step=controller.parts.step)
        self.in_python = not can_be_composed(self._run)
        """Whether every tick needs the interpreter; if not, other threads can use it during a block"""
        return sizes

    def do(self, ticks: int, rows: TrialRows) -> Ending | None:
        """Do up to `ticks` ticks into `rows`; return how the trial ended, if it did. Raises PluginError."""
        law, plant, robot = self._controller.law, self._driver.kernels, self._controller.robot
        assert law is not None, "start() comes first"
        last = min(self.tick + ticks, self._trial.ticks)
        self.tick = self._run(
            self.tick, last, law.parameters, law.memory, self._controller.parts.fields, plant.constants, plant.state,
            robot.constants, self._arrays, rows,
        )  # fmt: skip
        if self.tick < last:
            return self._stopped(rows)
        return Ending("completed", "", last) if last == self._trial.ticks else None

    def _stopped(self, rows: TrialRows) -> Ending:
        """Return why a block ended before its last tick. Raises PluginError."""
        if self._driver.tripped:
            due = (self.tick - self._arrays.delay) % self._arrays.commands.torque.shape[0]
            asked = Command(self._arrays.commands.torque[due], self._arrays.commands.position[due])
            return Ending("tripped", self._driver.why_refused(self.tick, asked), self.tick)
        if rows.driver.written[0] == rows.controller.written[0]:
            return Ending("tripped", self._driver.why_unsafe(self.tick), self.tick)
        refused = self._controller.why_refused(self.tick)
        if not isinstance(refused, Tripped):
            raise refused
        return Ending("tripped", str(refused), self.tick)
