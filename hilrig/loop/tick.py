"""The meaning of one tick, written once: used in one process, in lockstep over the bus and in real time.

At tick k (t = k * period) the driver side measures and the controller side answers. During the period that begins at
tick k the plant is under the command of tick k - delay; before there is one, under the command that holds it.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from contextlib import closing, suppress
from typing import Any, NamedTuple, Protocol

import numpy as np

from hilrig.core.compiler import kernel
from hilrig.core.errors import PluginError, Stopped, Tripped
from hilrig.core.interfaces import Law, Plant, Robot, Task, TrialStart
from hilrig.core.signals import (
    WRENCH_AXES,
    Array,
    Command,
    DisturbanceSchedule,
    Measurement,
    PlantDisturbance,
    Reference,
    State,
    Truth,
    plant_disturbance,
)
from hilrig.experiment.trial import Trial, disturbance_schedule, make_task, references, start_joint_position
from hilrig.kinds.actuation import position_reference
from hilrig.loop.law_memory import memory_sizes
from hilrig.loop.safety import Monitor


class PlantSide:
    """The driver's half of a trial: plant, disturbances, sensors and safety."""

    def __init__(self, trial: Trial) -> None:
        self.trial = trial
        self.schedule: DisturbanceSchedule = disturbance_schedule(trial)
        self.plant: Plant = trial.driver.begin(TrialStart(trial.period, start_joint_position(trial)))
        self._monitor = Monitor(trial.limits, trial.period)
        self._delays = self.schedule.measurement_delay.astype(int)
        self.past: deque[Measurement] = deque(maxlen=int(self._delays.max(initial=0)) + 1)
        self.hold: Command | None = None
        self._nudged, self._now = 0, plant_disturbance(self.schedule, 0)

    def measure(self, tick: int) -> tuple[Measurement, Truth | None]:
        """Return what the sensors report at `tick`, with their errors and delays, and the truth where there is one.

        Raises Tripped if a safety limit is exceeded.
        """
        disturbance = self._nudge(tick)
        exact = self.plant.measure(disturbance)
        if self.hold is None:
            self.hold = self.plant.hold()
        self._monitor.check(tick, exact)
        self.past.append(exact)
        age = min(int(self._delays[tick]), len(self.past) - 1)
        return self._sensed(self.past[-1 - age], tick), self.plant.truth(disturbance)

    def _nudge(self, tick: int) -> PlantDisturbance:
        if tick != self._nudged:
            self._nudged, self._now = tick, plant_disturbance(self.schedule, tick)
        return self._now

    def _sensed(self, exact: Measurement, tick: int) -> Measurement:
        return Measurement(
            exact.joint_position + self.schedule.joint_error[tick],
            exact.wrench + self.schedule.wrench_error[tick],
            exact.applied_torque,
        )

    def advance(self, tick: int, command: Command | None) -> None:
        """Let the period that begins at `tick` pass under `command` (None: the holding one)."""
        held = command if command is not None else self.hold
        assert held is not None, "measure() comes first"
        self.plant.advance(held, self._nudge(tick))

    def close(self) -> None:
        """Release the plant."""
        self.plant.close()


class Answer(NamedTuple):
    """What the controller's half makes of one measurement."""

    command: Command
    state: State
    reference: Reference
    memory: Any
    """The law's own; its arrays change at the next tick"""


class ControlSide:
    """The controller's half of a trial: kinematics, velocity filter, reference, law and torque limits."""

    def __init__(self, trial: Trial) -> None:
        self.trial = trial
        self.task: Task = make_task(trial)
        self.references = references(trial)
        self._robot: Robot = trial.driver.robot
        self._k_ref = trial.driver.servo_gain
        self.force_index = np.array([WRENCH_AXES.index(axis) for axis in self._robot.axes])
        self.smoothing = trial.velocity_smoothing
        self.last_position: Array | None = None
        self.last_tick = 0
        self.velocity = np.zeros(self._robot.joints)
        self.torque = np.zeros(self._robot.joints)
        self.law: Law | None = None

    def control(self, tick: int, measurement: Measurement) -> Answer:
        """Return the answer to the measurement of `tick`; the first call starts the law.

        Raises Tripped if the law's torque is not finite, PluginError if it is not one number for each joint.
        """
        state = self._observe(tick, measurement)
        if self.law is None:
            self.law = self.trial.controller.start(self.task, state)
        reference = Reference(*(signal[tick] for signal in self.references))
        wished = checked(self.law.step(self.law.parameters, self.law.memory, state, reference), self.trial)
        self.torque = np.empty_like(wished)
        if not limit(self.torque, wished, self.task.torque_limit):
            raise Tripped(not_finite(tick, self.trial.controller_name, wished))
        position = position_reference(self.torque, measurement.joint_position, self._k_ref)
        return Answer(Command(self.torque, position), state, reference, self.law.memory)

    def _observe(self, tick: int, measurement: Measurement) -> State:
        q = measurement.joint_position
        # In real time a tick can be missed: a difference over two periods is no rate over one.
        gap = max(tick - self.last_tick, 1)
        elapsed, self.last_tick = gap * self.trial.period, tick
        if self.last_position is None:
            self.last_position, self.torque = q, measurement.applied_torque
        smoothing = self.smoothing if gap == 1 else 1.0 - (1.0 - self.smoothing) ** gap
        filter_velocity(self.velocity, q, self.last_position, elapsed, smoothing)
        self.last_position = q
        at = self._robot.kinematics(q, self.velocity)
        return State(
            q, self.velocity.copy(), at.position, at.velocity, at.jacobian, at.jacobian_rate, at.regressor,
            measurement.wrench[self.force_index], self.torque, elapsed,
        )  # fmt: skip


def checked(torque: Any, trial: Trial) -> Array:
    """Return a law's torque as an array. Raises PluginError if it is not one number for each joint."""
    array, shape = np.asarray(torque, dtype=np.float64), (trial.driver.robot.joints,)
    if array.shape != shape:
        raise PluginError(
            f"controller '{trial.controller_name}': step returned an array {array.shape}; "
            f"the robot takes torques {shape}"
        )
    return array


def not_finite(tick: int, controller: str, torque: Array) -> str:
    """Return why a trial trips on such a torque."""
    return f"tick {tick}: the torque of controller '{controller}' is not finite: {torque}"


@kernel
def filter_velocity(velocity: Array, q: Array, last_q: Array, period: float, smoothing: float) -> None:
    """Move q' on by one sample, in place: q' += a ((q - q_prev)/l - q'), a = 1 - exp(-2 pi f_c l)."""
    for i in range(velocity.size):
        velocity[i] += smoothing * ((q[i] - last_q[i]) / period - velocity[i])


@kernel
def limit(torque: Array, wished: Array, largest: Array) -> bool:
    """Write `wished` (n,) within +- `largest` (n,) N m into `torque`, unless it is not finite; return whether it is."""
    for i in range(wished.size):
        if not np.isfinite(wished[i]):
            return False
    for i in range(wished.size):
        torque[i] = min(max(wished[i], -largest[i]), largest[i])
    return True


def warm_up_plant(trial: Trial) -> None:
    """Run one tick of the driver's half beside the trial: its kernels are loaded, or compiled, before time counts."""
    with closing(PlantSide(trial)) as side, suppress(Tripped):  # so will the trial itself, and tell
        side.measure(0)
        side.advance(0, None)


def warm_up_control(trial: Trial) -> dict[str, int]:
    """Run one tick of the controller's half beside the trial; return the length of every field of the law's memory."""
    side = ControlSide(trial)
    still = np.zeros(trial.driver.robot.joints)
    at_rest = Measurement(start_joint_position(trial), np.zeros(6), still)
    with suppress(Tripped):  # so will the trial itself, and tell
        side.control(0, at_rest)
    assert side.law is not None, "the first measurement starts the law"
    return memory_sizes(side.law.memory, trial.controller_name)


class Wire(Protocol):
    """How the driver side reaches the controller side: over the bus, or by a call."""

    def wait(self, tick: int) -> None:
        """Wait until the tick may begin. Raises Stopped if the trial is to end."""
        ...

    @property
    def publish(self) -> Callable[..., None]:
        """Hand on what was measured: publish(tick, *seen), as the side returned it."""
        ...

    def command(self, tick: int, wanted: int) -> Any:
        """Return the command of tick `wanted` for the period that begins at `tick`, or the one to hold instead.

        As the side takes it; None before there is one.
        """
        ...


class DriverSide(Protocol):
    """The driver's half of a trial as the loop has it."""

    trial: Trial

    def measure(self, tick: int) -> tuple[Any, ...]:
        """Measure at `tick`; return what the wire is to publish. Raises Tripped."""
        ...

    def advance(self, tick: int, command: Any) -> None:
        """Let the period that begins at `tick` pass under `command` (None: the holding one)."""
        ...

    def close(self) -> None:
        """Release the plant."""
        ...


class Ending(NamedTuple):
    """How a trial ended, from the driver's side."""

    outcome: str
    """completed, tripped or aborted"""
    reason: str
    ticks: int


def drive(side: DriverSide, wire: Wire) -> Ending:
    """Run the trial from the driver's side, release the plant, and tell how it ended."""
    try:
        return do_ticks(side, wire, 0, side.trial.ticks)
    finally:
        side.close()


def do_ticks(side: DriverSide, wire: Wire, first: int, last: int) -> Ending:
    """Do the ticks from `first` to `last` - 1, and tell how they ended.

    In lockstep the measurement goes out first: its own command may be the one to wait for. In real time the command
    that acts now has come in before, and is applied before anything else is done.
    """
    tick, delay, realtime = first, side.trial.actuation_delay, side.trial.clock == "realtime"
    try:
        while tick < last:
            wire.wait(tick)
            seen = side.measure(tick)
            if realtime:
                side.advance(tick, wire.command(tick, tick - delay))
                wire.publish(tick, *seen)
            else:
                wire.publish(tick, *seen)
                side.advance(tick, wire.command(tick, tick - delay))
            tick += 1
    except Tripped as trip:
        return Ending("tripped", str(trip), tick)
    except Stopped as stop:
        return Ending("aborted", str(stop), tick)
    return Ending("completed", "", tick)
