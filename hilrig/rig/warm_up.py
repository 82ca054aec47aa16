"""Warm-up: everything that is loaded or compiled at first use is used once outside the trial, before timing starts."""

from __future__ import annotations

from contextlib import suppress

import numpy as np

from hilrig.core.errors import Tripped
from hilrig.core.signals import Command, Measurement, PlantDisturbance
from hilrig.experiment.trial import Trial, start_joint_position
from hilrig.loop.controller_node import ControllerNode
from hilrig.loop.driver_node import DriverNode
from hilrig.recording.messages.codec import LEAD
from hilrig.recording.messages.layouts import layouts
from hilrig.recording.messages.record_batch import RecordBatch
from hilrig.rig.rows import FEWEST, HeardCommand, HeardState, controller_rows, driver_rows

TICKS = 2
"""At the first tick a node starts plant or law"""


def warm_up_driver(trial: Trial) -> None:
    """Run the first ticks of the driver node. A plant that is not simulated is never rehearsed: a stand-in is."""
    codecs = layouts(trial.driver.robot.joints, len(trial.axes), {})
    node = DriverNode(trial)
    try:
        if node.simulated:
            node.connect()
        else:
            node.adopt(StandIn(trial))
        batches = {name: RecordBatch(codecs[name], FEWEST) for name in ("state", "truth", "applied")}
        node.bind(driver_rows(batches), HeardCommand(codecs).acting)
        for tick in range(min(TICKS, trial.ticks)):
            node.measure(tick)
            node.advance()
    except Tripped:
        pass  # the trial will trip in the same way, and report it
    finally:
        node.release()


class StandIn:
    """Stands in for a plant while the code around it is compiled: it is at the start, and stays there."""

    def __init__(self, trial: Trial) -> None:
        self._q, self._none = start_joint_position(trial), np.zeros(trial.driver.robot.joints)

    def measure(self, disturbance: PlantDisturbance) -> Measurement:
        """Return the start, without contact."""
        return Measurement(self._q.copy(), np.zeros(6), self._none.copy())

    def advance(self, command: Command, disturbance: PlantDisturbance) -> None:
        """Do nothing."""

    def holding_command(self) -> Command:
        """Return no torque."""
        return Command(self._none.copy(), self._q.copy())

    def truth(self, disturbance: PlantDisturbance) -> None:
        """Return None, as a real plant does."""

    def hold(self) -> None:
        """Do nothing: it does not move."""

    def close(self) -> None:
        """Do nothing."""


def warm_up_controller(trial: Trial) -> dict[str, int]:
    """Run the first ticks of the controller node; return the length of every field of the law's memory.

    Raises PluginError if the law's memory cannot be recorded.
    """
    joints, axes = trial.driver.robot.joints, len(trial.axes)
    start = start_joint_position(trial)
    node = ControllerNode(trial)
    sizes = node.start(0, start, np.zeros(6), np.zeros(joints))
    codecs = layouts(joints, axes, sizes)
    batches = {name: RecordBatch(codecs[name], FEWEST) for name in ("command", "internals")}
    heard = HeardState(codecs)
    node.bind(heard.rows, controller_rows(batches))
    heard.read(LEAD + codecs["state"].zero())
    heard.rows.joint_position[0], heard.rows.fresh[0] = start, 1
    with suppress(Tripped):  # the trial will trip in the same way, and report it
        for tick in range(min(TICKS, trial.ticks)):
            heard.rows.tick[0] = tick
            node.answer()
    return sizes
