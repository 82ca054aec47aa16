"""A trial in memory: both halves of the rig and what they saw, without bus and without record."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from hilrig.core.signals import Array, Command, Measurement, Truth
from hilrig.experiment.trial import Trial, times
from hilrig.loop.tick import ControlSide, Ending, PlantSide, drive


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


class _Wire:
    """Hands each measurement to the controller by a call, and keeps what passes."""

    def __init__(self, trial: Trial) -> None:
        self._control = ControlSide(trial)
        self._commands: dict[int, Command] = {}
        self.rows: list[list[Array]] = []
        self.memory: dict[str, list[Array]] = {}

    def wait(self, tick: int) -> None:
        """Nobody to wait for."""

    def publish(self, tick: int, measurement: Measurement, truth: Truth | None) -> None:
        answer = self._control.control(tick, measurement)
        self._commands[tick] = answer.command
        assert truth is not None
        self.rows.append([
            truth.position, truth.velocity, truth.wrench[[0, 2]], answer.reference.position,
            answer.reference.force, answer.command.torque,
        ])  # fmt: skip
        for name, values in zip(answer.memory._fields, answer.memory, strict=True):
            self.memory.setdefault(name, []).append(values.copy())

    def command(self, tick: int, wanted: int) -> Command | None:
        return self._commands.pop(wanted, None)


def run(trial: Trial) -> Seen:
    """Run a trial of an arm in the (x, z) plane."""
    wire = _Wire(trial)
    ending = drive(PlantSide(trial), wire)
    columns = [np.array(column) for column in zip(*wire.rows, strict=True)]
    memory = {name: np.array(values) for name, values in wire.memory.items()}
    return Seen(ending, times(trial)[: len(wire.rows)], *columns, memory)
