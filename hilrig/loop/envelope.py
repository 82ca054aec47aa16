"""The envelope of commands: what a plant receives is within it, always. Pure."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from hilrig.core.compiler import kernel_without_arrays
from hilrig.core.signals import Array, Command
from hilrig.experiment.limits import Limits
from hilrig.experiment.trial import Trial
from hilrig.loop.limited import WORDS, Limited

TORQUE, TORQUE_RATE, POSITION, POSITION_RATE, NOT_FINITE = (int(bit) for bit in Limited)


class Envelope(NamedTuple):
    """The limits on commands: the lowest, the highest, the largest change in a period; infinite if there is none."""

    torque: Array
    """(3, n) N m"""
    position: Array
    """(3, n) rad"""
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
    largest = limits.largest_torque(robot)
    torque = np.array([-largest, largest, limits.torque_step(robot, trial.period)])
    return Envelope(torque, np.array([low, high, step]), int(trips))


@kernel_without_arrays
def bound_torque(torque: Array, asked: Array, within: Array) -> int:
    """Bring `asked` (n,) within `Envelope.torque`, relative to the last torque, and write it there, into `torque` (n,).

    Return the bits of `Limited`. If `asked` is not finite, nothing is written.
    """
    return _bring_within(torque, asked, within, TORQUE, TORQUE_RATE) if _finite(asked) else NOT_FINITE


@kernel_without_arrays
def bound(torque: Array, position: Array, within: Envelope, applied: Command) -> int:
    """Bring a command within the envelope, relative to the last one in `applied`, and write it there.

    Return the bits of `Limited`. If the command is not finite, nothing is written.
    """
    if not (_finite(torque) and _finite(position)):
        return NOT_FINITE
    bits = _bring_within(applied.torque, torque, within.torque, TORQUE, TORQUE_RATE)
    return bits | _bring_within(applied.position, position, within.position, POSITION, POSITION_RATE)


@kernel_without_arrays
def _finite(values: Array) -> bool:
    finite = True
    for i in range(values.size):
        finite = finite and np.isfinite(values[i])
    return finite


@kernel_without_arrays
def _bring_within(last: Array, asked: Array, within: Array, beyond: int, too_fast: int) -> int:
    """Write the value nearest to `asked` that is within the limits into `last` (n,); return the bits of what it broke.

    Where `last` is so far outside that nothing is within both its step and its range, the range counts.
    """
    bits = 0
    for i in range(asked.size):
        value, before, lowest, highest, step = asked[i], last[i], within[0, i], within[1, i], within[2, i]
        if abs(value - before) > step:
            value = min(max(value, before - step), before + step)
            bits |= too_fast
        if value < lowest or value > highest:
            value = min(max(value, lowest), highest)
            bits |= beyond
        last[i] = value
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
