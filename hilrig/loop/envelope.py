"""The envelope of commands: what a plant receives is within it, always. Pure."""

from __future__ import annotations

from enum import IntFlag
from typing import NamedTuple

import numpy as np

from hilrig.core.compiler import kernel_without_arrays
from hilrig.core.signals import Array, Command
from hilrig.experiment.limits import Limits
from hilrig.experiment.trial import Trial


class Limited(IntFlag):
    """Why a command was changed, or ended the trial: the bits of `limited` in Command.msg and Applied.msg."""

    TORQUE = 1
    TORQUE_RATE = 2
    POSITION = 4
    POSITION_RATE = 8
    NOT_FINITE = 16


TORQUE, TORQUE_RATE, POSITION, POSITION_RATE, NOT_FINITE = (int(bit) for bit in Limited)
WORDS = {
    Limited.TORQUE: "torque", Limited.TORQUE_RATE: "torque rate", Limited.POSITION: "joint position",
    Limited.POSITION_RATE: "joint position rate",
}  # fmt: skip


class Envelope(NamedTuple):
    """The limits on commands; inf where there is none."""

    torque: Array
    """Largest magnitude, (n,) N m"""
    torque_step: Array
    """Largest change from one period to the next, (n,) N m"""
    lowest: Array
    """Lowest joint position, (n,) rad"""
    highest: Array
    """Highest joint position, (n,) rad"""
    position_step: Array
    """Largest change from one period to the next, (n,) rad"""
    trips: int
    """Bits of `Limited` that end the trial"""


def envelope(trial: Trial) -> Envelope:
    """Return the envelope of a trial's commands. Positions are bounded only for a plant that takes positions."""
    robot, limits, n = trial.driver.robot, trial.limits, trial.driver.robot.joints
    low, high = limits.joint_range(robot)
    step = limits.position_step(robot, trial.period)
    if trial.driver.servo_gain is None:
        low, high, step = np.full(n, -np.inf), np.full(n, np.inf), np.full(n, np.inf)
    trips = NOT_FINITE | sum(int(Limited[name.upper()]) for name in limits.trip_on)
    return Envelope(
        limits.largest_torque(robot), limits.torque_step(robot, trial.period), low, high, step, int(trips)
    )  # fmt: skip


@kernel_without_arrays
def bound_torque(torque: Array, last: Array, asked: Array, largest: Array, step: Array) -> int:
    """Write `asked` (n,) into `torque`, within +- `largest` and within `step` of `last`; return the bits of `Limited`.

    `torque` may be `last`. If `asked` is not finite, nothing is written. The nearest torque within both is taken; where
    `last` is so far outside that there is none, the magnitude is kept.
    """
    for i in range(asked.size):
        if not np.isfinite(asked[i]):
            return NOT_FINITE
    bits = 0
    for i in range(asked.size):
        value = asked[i]
        if abs(value - last[i]) > step[i]:
            value = min(max(value, last[i] - step[i]), last[i] + step[i])
            bits |= TORQUE_RATE
        if abs(value) > largest[i]:
            value = min(max(value, -largest[i]), largest[i])
            bits |= TORQUE
        torque[i] = value
    return bits


@kernel_without_arrays
def bound(torque: Array, position: Array, within: Envelope, applied: Command) -> int:
    """Bring a command within the envelope, relative to the last one in `applied`, and write it there.

    Return the bits of `Limited`. If the command is not finite, nothing is written.
    """
    for i in range(position.size):
        if not np.isfinite(position[i]):
            return NOT_FINITE
    bits = bound_torque(applied.torque, applied.torque, torque, within.torque, within.torque_step)
    if bits & NOT_FINITE:
        return bits
    for i in range(position.size):
        value, last, step = position[i], applied.position[i], within.position_step[i]
        if abs(value - last) > step:
            value = min(max(value, last - step), last + step)
            bits |= POSITION_RATE
        if value < within.lowest[i] or value > within.highest[i]:
            value = min(max(value, within.lowest[i]), within.highest[i])
            bits |= POSITION
        applied.position[i] = value
    return bits


def why_bounded(bits: int, tick: int, period: float, asked: Command, limits: Limits) -> str:
    """Return why a command ends the trial: what is beyond its limit, the command, and when."""
    at = f"t = {tick * period:.4g} s (tick {tick})"
    if bits & NOT_FINITE:
        return f"the command at {at} is not finite: torque {asked.torque} N m, position {asked.position} rad"
    what = ", ".join(word for bit, word in WORDS.items() if bits & bit)
    setting = f" (safety.trip_on: {', '.join(limits.trip_on)})"
    command = f"torque {asked.torque} N m, position {asked.position} rad"
    return f"the command at {at} is beyond its limit of {what}{setting}: {command}"
