"""Trials in memory: the nodes of the loop and what they wrote, without bus and without record."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from helpers.plain_loop import Passed, newest
from hilrig.core.errors import Tripped
from hilrig.core.signals import Array
from hilrig.experiment.trial import Trial, start_joint_position, times
from hilrig.loop.controller_node import ControllerNode
from hilrig.loop.driver_node import DriverNode
from hilrig.loop.ticks import Ending, do_ticks
from hilrig.recording.messages.codec import LEAD, Codec
from hilrig.recording.messages.layouts import layouts
from hilrig.recording.messages.record_batch import RecordBatch
from hilrig.rig.rows import HeardCommand, HeardState, controller_rows, driver_rows

DRIVER, CONTROLLER = ("state", "truth"), ("command", "internals")
BATCHES = (*DRIVER, "applied", *CONTROLLER)


def memory_of(trial: Trial) -> dict[str, int]:
    """Return the length of every field of the law's memory."""
    still = np.zeros(trial.driver.robot.joints)
    return ControllerNode(trial).start(0, start_joint_position(trial), np.zeros(6), still)


class Nodes:
    """Both nodes of a trial, on batches of `rows` messages; those of the controller have one row more."""

    def __init__(self, trial: Trial, rows: int = 7, sizes: dict[str, int] | None = None) -> None:
        self.trial = trial
        sizes = memory_of(trial) if sizes is None else sizes
        self.codecs: Mapping[str, Codec] = layouts(trial.driver.robot.joints, len(trial.axes), sizes)
        self.batches = {name: RecordBatch(self.codecs[name], rows + (name in CONTROLLER)) for name in BATCHES}
        self.heard_state, self.heard_command = HeardState(self.codecs), HeardCommand(self.codecs)
        self.driver, self.controller = DriverNode(trial), ControllerNode(trial)
        self.driver.connect()
        self.driver.bind(driver_rows(self.batches), self.heard_command.acting)
        self.controller.bind(self.heard_state.rows, controller_rows(self.batches))
        self.rows = rows

    def message(self, channel: str, tick: int) -> bytes:
        """Return the message of a driver's channel of the last ticks."""
        return self.batches[channel].message(tick % self.rows)

    def values(self, channel: str, message: bytes) -> dict[str, Array]:
        """Return the fields of a message."""
        codec = self.codecs[channel]
        return dict(zip((f.name for f in codec.definition.fields), codec.unpack(message), strict=True))

    def measured(self, tick: int) -> tuple[dict[str, Array], dict[str, Array]]:
        """Measure; return the fields of state and truth. Raises Tripped."""
        self.driver.measure(tick)
        state, truth = (self.values(name, self.message(name, tick)) for name in DRIVER)
        return state, truth

    def answered(self, message: bytes) -> tuple[dict[str, Array], dict[str, Array]]:
        """Answer a state message; return the fields of command and internals. Raises Tripped, PluginError."""
        self.heard_state.read(LEAD + message)
        row = self.controller.answer()
        command, internals = (self.values(name, self.batches[name].message(row)) for name in CONTROLLER)
        return command, internals

    def state(
        self, tick: int, q: Array, wrench: Array | None = None, torque: Array | None = None, stamp: float = np.nan,
        fresh: bool = True,
    ) -> bytes:  # fmt: skip
        """Return a state message of one's own."""
        still = np.zeros(self.trial.driver.robot.joints)
        values = (q, np.zeros(6) if wrench is None else wrench, still if torque is None else torque)
        return self.codecs["state"].pack((tick, tick * self.trial.period, *values, stamp, fresh))


def pass_messages(
    subject: Trial, missed: frozenset[int] = frozenset(), rows: int = 7, sizes: dict[str, int] | None = None
) -> Passed:
    """Run a trial whose controller misses some ticks, as the bus does, and return its messages."""
    nodes, passed, commands = Nodes(subject, rows, sizes), Passed(), {}
    try:
        for tick in range(subject.ticks):
            nodes.driver.measure(tick)
            for name in DRIVER if nodes.driver.truthful else DRIVER[:1]:
                getattr(passed, name).append(nodes.message(name, tick))
            if tick not in missed:
                nodes.heard_state.read(LEAD + passed.state[-1])
                row = nodes.controller.answer()
                assert row == len(passed.command) % (rows + 1)
                for name in CONTROLLER:
                    getattr(passed, name).append(nodes.batches[name].message(row))
                commands[tick] = passed.command[-1]
            if (command := newest(commands, tick - subject.actuation_delay)) is not None:
                nodes.heard_command.read(LEAD + command)
            nodes.driver.advance()
    except Tripped as trip:
        passed.reason = str(trip)
    finally:
        nodes.driver.release()
    return passed


class Seen(NamedTuple):
    """How a trial went, N ticks."""

    ending: Ending
    time: Array
    """(N,) s"""
    position: Array
    """x of the plant, (N, m) m"""
    velocity: Array
    """(N, m) m/s"""
    force: Array
    """F_e along x and z, (N, m) N"""
    wanted_position: Array
    """x_d, (N, m) m"""
    wanted_force: Array
    """F_d, (N, m) N"""
    torque: Array
    """Commanded, (N, n) N m"""
    memory: dict[str, Array]
    """Every field of the law's memory, (N, size)"""


class Wire:
    """Hands each measurement to the controller by a call; the ticks of `late` get no answer in time."""

    def __init__(self, nodes: Nodes) -> None:
        self.nodes = nodes
        self.commands: dict[int, bytes] = {}
        self.wanted: list[int] = []

    def wait(self, tick: int) -> int:
        """Nobody to wait for."""
        return tick

    def publish(self, tick: int) -> None:
        self.nodes.heard_state.read(LEAD + self.nodes.message("state", tick))
        self.commands[tick] = self.nodes.batches["command"].message(self.nodes.controller.answer())

    def take_command(self, tick: int, wanted: int) -> None:
        self.wanted.append(wanted)
        if wanted in self.commands:
            self.nodes.heard_command.read(LEAD + self.commands.pop(wanted))


def run(trial: Trial) -> Seen:
    """Run a trial of an arm in the (x, z) plane."""
    nodes = Nodes(trial, trial.ticks)
    try:
        ending = do_ticks(nodes.driver, Wire(nodes))
    finally:
        nodes.driver.release()
    done = ending.ticks
    codecs, batches = nodes.codecs, nodes.batches
    truth, command, internals = (
        codecs[name].table(batches[name].payloads[:done]) for name in ("truth", "command", "internals")
    )
    own = [field.name for field in codecs["internals"].definition.fields if field.size]
    return Seen(
        ending, times(trial)[:done], truth["position"], truth["velocity"], truth["wrench"][:, [0, 2]],
        internals["reference_position"], internals["reference_force"], command["torque"],
        {name: internals[name].reshape(done, -1) for name in own},
    )  # fmt: skip
