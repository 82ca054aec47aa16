"""What a tick means, told as plainly as NumPy can: the truth that the loop is held to, bit by bit."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from hilrig.core.errors import PluginError, Tripped
from hilrig.core.signals import WRENCH_AXES, Array, Command, Measurement, Reference, State, Truth, plant_disturbance
from hilrig.experiment.trial import Trial, disturbance_schedule, make_task, references, trial_start
from hilrig.recording.messages.layouts import layouts


class PlainDriver:
    """The plant, what disturbs it, its sensors and the safety limits."""

    def __init__(self, trial: Trial) -> None:
        self._trial, self._schedule = trial, disturbance_schedule(trial)
        self.plant = trial.driver.connect(trial_start(trial))
        self._exact: list[Measurement] = []
        self._hold: Command | None = None

    def measure(self, tick: int) -> tuple[Measurement, Truth | None]:
        """Return what the sensors report, and the truth. Raises Tripped."""
        now = plant_disturbance(self._schedule, tick)
        exact, truth = self.plant.measure(now), self.plant.truth(now)
        self._hold = self._hold or self.plant.holding_command()
        self._check(tick, exact)
        self._exact.append(exact)
        old = self._exact[max(tick - int(self._schedule.measurement_delay[tick]), 0)]
        joint_position = old.joint_position + self._schedule.joint_error[tick]
        return old._replace(joint_position=joint_position, wrench=old.wrench + self._schedule.wrench_error[tick]), truth

    def _check(self, tick: int, exact: Measurement) -> None:
        q, wrench = exact.joint_position, exact.wrench
        if not (np.isfinite(q).all() and np.isfinite(wrench).all()):
            raise Tripped(f"tick {tick}: the measurement is not finite: joints {q}, wrench {wrench}")
        step = np.abs(q - self._exact[-1].joint_position).max() if self._exact else 0.0
        limits, time = self._trial.limits, tick * self._trial.period
        force, speed = np.sqrt((wrench[:3] ** 2).sum()), step / self._trial.period
        for what, value, limit in (
            ("tip force {:.4g} N", force, limits.tip_force),
            ("joint velocity {:.4g} rad/s", speed, limits.joint_velocity),
        ):
            if value > limit:
                at = f"at t = {time:.4g} s (tick {tick}) is over the limit of {limit:.4g} {what.split()[-1]}"
                raise Tripped(f"{what.format(value)} {at}")
        low, high = limits.joint_range(self._trial.driver.robot)
        for joint in np.flatnonzero((q < low) | (q > high))[:1]:
            at = f"at t = {time:.4g} s (tick {tick}), outside its range of {low[joint]:.4g} to {high[joint]:.4g} rad"
            raise Tripped(f"joint {joint + 1} is at {q[joint]:.4g} rad {at}")

    def advance(self, tick: int, command: Command | None) -> None:
        """Let a period pass under a command; under the one that holds the plant if there is none.

        What the plant receives is within the robot's limits, whoever asks for it.
        """
        held = command or self._hold
        assert held is not None
        largest = self._trial.driver.robot.torque_limits()
        held = Command(np.clip(held.torque, -largest, largest), held.position)
        if self._trial.driver.servo_gain:
            held = Command(held.torque, np.clip(held.position, *self._trial.driver.robot.joint_limits()))
        self.plant.advance(held, plant_disturbance(self._schedule, tick))


class PlainAnswer(NamedTuple):
    """What becomes of one measurement."""

    command: Command
    asked: Array
    limited: int
    state: State
    reference: Reference
    memory: list[Array]


class PlainController:
    """Velocity filter, kinematics, reference, law and torque limits."""

    def __init__(self, trial: Trial) -> None:
        self._trial, self._robot = trial, trial.driver.robot
        self._references = references(trial)
        self._q: Array | None = None
        self._rate = np.zeros(self._robot.joints)
        self._last_tick = 0
        self._law: Any = None

    def control(self, tick: int, measurement: Measurement) -> PlainAnswer:
        """Return the answer to a measurement. Raises Tripped, PluginError."""
        state = self._observe(tick, measurement)
        if self._law is None:
            self._law = self._trial.controller.start(make_task(self._trial), state)
        reference = Reference(*(signal[tick].copy() for signal in self._references))
        asked = np.asarray(self._law.step(self._law.parameters, self._law.memory, state, reference))
        if asked.shape != (self._robot.joints,):
            raise PluginError(
                f"step returned an array of shape {asked.shape}; the robot needs one of shape ({self._robot.joints},)"
            )
        if not np.isfinite(asked).all():
            raise Tripped(f"tick {tick}: the torque of controller 'mine' is not finite: {asked}")
        largest, k_ref = self._robot.torque_limits(), self._trial.driver.servo_gain
        self._torque = np.clip(asked, -largest, largest)
        position = measurement.joint_position + self._torque / k_ref if k_ref else measurement.joint_position
        memory = [np.ravel(part).copy() for part in self._law.memory]
        limited = int((self._torque != asked).any())  # bit 1: the torque
        return PlainAnswer(Command(self._torque, position), asked, limited, state, reference, memory)

    def _observe(self, tick: int, measurement: Measurement) -> State:
        q, gap = measurement.joint_position, max(tick - self._last_tick, 1)
        if self._q is None:
            self._q, self._torque = q, measurement.applied_torque
        plain = self._trial.velocity_smoothing
        smoothing = plain if gap == 1 else 1.0 - (1.0 - plain) ** gap
        elapsed = gap * self._trial.period
        self._rate = self._rate + smoothing * ((q - self._q) / elapsed - self._rate)
        self._q, self._last_tick = q, tick
        force = measurement.wrench[[WRENCH_AXES.index(axis) for axis in self._robot.axes]]
        return State(q, self._rate, *self._robot.kinematics(q, self._rate), force, self._torque, elapsed)


@dataclass
class Passed:
    """The messages of a trial by channel, and why it ended before its end."""

    state: list[bytes] = field(default_factory=list)
    truth: list[bytes] = field(default_factory=list)
    command: list[bytes] = field(default_factory=list)
    internals: list[bytes] = field(default_factory=list)
    reason: str = ""


def newest(commands: dict[int, Any], wanted: int) -> Any:
    """Return the newest command that is not newer than `wanted`; None if there is none."""
    return next((commands[tick] for tick in reversed(commands) if tick <= wanted), None)


def run_plainly(subject: Trial, sizes: dict[str, int], missed: frozenset[int] = frozenset()) -> Passed:
    """Run a trial whose controller misses some ticks, and return its messages."""
    driver, controller = PlainDriver(subject), PlainController(subject)
    codecs = layouts(subject.driver.robot.joints, len(subject.axes), sizes)
    passed, commands = Passed(), {}

    def say(channel: str, tick: int, *values: Any) -> None:
        getattr(passed, channel).append(codecs[channel].pack((tick, tick * subject.period, *values)))

    try:
        for tick in range(subject.ticks):
            measurement, truth = driver.measure(tick)
            say("state", tick, *measurement)
            if truth is not None:
                say("truth", tick, *truth)
            if tick not in missed:
                answer = controller.control(tick, measurement)
                seen = answer.state
                say("command", tick, *answer.command, answer.asked, answer.limited)
                say("internals", tick, seen.position, seen.velocity, seen.force, *answer.reference, *answer.memory)
                commands[tick] = answer.command
            driver.advance(tick, newest(commands, tick - subject.actuation_delay))
    except Tripped as trip:
        passed.reason = str(trip)
    finally:
        driver.plant.close()
    return passed
