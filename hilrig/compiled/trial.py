"""A whole trial in one process, many ticks at a call."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, cast

import numpy as np

from hilrig.compiled.tick import Block, Rig, Track, act_template, run_template, sense_template
from hilrig.errors import Tripped
from hilrig.interfaces import Law
from hilrig.kernel import can_be_composed, composed, filled
from hilrig.kernel_interfaces import PlantKernels, RobotKernels, Sight
from hilrig.loop import Answer, ControlSide, Ending, PlantSide, checked, not_finite
from hilrig.safety import Monitor
from hilrig.signals import Array, Command, Kinematics, Measurement, Reference, State, nudge
from hilrig.trial import Trial


class CompiledTrial:
    """A trial whose first tick has been done by the halves of `loop`, which start plant and law; here come the rest."""

    def __init__(self, plant: PlantSide, control: ControlSide, first: Answer) -> None:
        law, trial = control.law, plant.trial
        assert law is not None, "the first tick starts the law"
        self._side, self._law, self._trial = plant, law, trial
        self.tick = 1
        self._plant: PlantKernels = cast(Any, plant.plant).kernels()
        self._robot: RobotKernels = cast(Any, trial.driver.robot).kernels()
        self._rig = _rig(plant, control, first)
        # Views of the memory, all of one type, so that a kernel can go through them.
        self._fields = tuple(field.reshape(-1) for field in law.memory) or (np.zeros(0),)
        self._run = _bound(trial, self._plant, self._robot, law)
        self.in_python = not can_be_composed(law.step)
        """Whether the law needs the interpreter at every tick; else other threads have it during a block"""
        self.recent = Block(1, _track(0, self._rig, 0))

    def do(self, ticks: int) -> Ending | None:
        """Do up to so many ticks, which are then in `recent`; return how the trial ended, if it did."""
        first, last = self.tick, min(self.tick + ticks, self._trial.ticks)
        self.recent = Block(first, _track(last - first, self._rig, sum(field.size for field in self._fields)))
        law, plant = self._law, self._plant
        self.tick = self._run(
            first, last, law.parameters, law.memory, self._fields, plant.constants, plant.state,
            self._robot.constants, self._rig, self.recent.track,
        )  # fmt: skip
        if self.tick < last:
            return Ending("tripped", self._reason(), self.tick)
        return Ending("completed", "", last) if last == self._trial.ticks else None

    def _reason(self) -> str:
        """Return why `run` stopped before the end of a block."""
        tick, rig, done = self.tick, self._rig, self.recent.track.done
        if done[0] > done[1]:
            return not_finite(tick, self._trial.controller_name, rig.wished)
        exact = self._side.plant.measure(nudge(rig.inputs, tick))
        try:
            Monitor(self._trial.limits, rig.period, rig.last_exact).check(tick, exact)
        except Tripped as trip:
            return str(trip)
        raise AssertionError("the compiled loop and the monitor disagree about the limits")


def warm_up(trial: Trial) -> None:
    """Compile or load the loop of a trial that can be compiled, beside the trial, before time counts."""
    plant, control = PlantSide(trial), ControlSide(trial)
    try:
        first = control.control(0, plant.measure(0)[0])
        if can_compile(plant, control):
            CompiledTrial(plant, control, first).do(0)
    finally:
        plant.close()


def can_compile(plant: PlantSide, control: ControlSide) -> bool:
    """Return whether plant and robot offer kernels, and the law's memory can be recorded from where it lies."""
    law = control.law
    offered = hasattr(plant.plant, "kernels") and hasattr(plant.trial.driver.robot, "kernels")
    return offered and law is not None and all(field.flags.c_contiguous for field in law.memory)


def _bound(trial: Trial, plant: PlantKernels, robot: RobotKernels, law: Law) -> Callable[..., int]:
    """Return `run_template` with the kernels of this plant and robot, and the law's step, in it."""
    sense = composed(sense_template, makes_arrays=False, plant_observe=plant.observe, robot_kinematics=robot.kinematics)
    act = composed(act_template, makes_arrays=False, plant_advance=plant.advance)
    if can_be_composed(law.step):
        return composed(run_template, sense=sense, act=act, law_step=law.step)

    def step(parameters: Any, memory: Any, state: State, reference: Reference) -> Array:
        # A law in Python may keep what it is given; here the arrays change at the next tick.
        given = _copied(state)
        return checked(law.step(parameters, memory, given, Reference(*(part.copy() for part in reference))), trial)

    return filled(run_template, sense=sense, act=act, law_step=step)


def _copied(state: State) -> State:
    return State._make(part.copy() if isinstance(part, np.ndarray) else part for part in state)


def _rig(plant: PlantSide, control: ControlSide, first: Answer) -> Rig:
    trial, hold, exact = plant.trial, plant.hold, plant.past[-1]
    assert hold is not None, "measure() comes first"
    n, m = trial.driver.robot.joints, len(trial.axes)
    depth, slots = int(plant.inputs.measurement_delay.max(initial=0)) + 1, trial.actuation_delay + 1
    past = Measurement(*(np.repeat(value[None, :], depth, axis=0) for value in exact))
    commands = Command(*(np.repeat(value[None, :], slots, axis=0) for value in hold))
    for ring, value in zip(commands, first.command, strict=True):
        ring[0] = value
    seen = _copied(first.state)._replace(torque=first.command.torque.copy(), elapsed=trial.period)
    at = Kinematics(seen.position, seen.velocity, seen.jacobian, seen.jacobian_rate, seen.regressor)
    return Rig(
        plant.inputs, control.references, trial.limits.tip_force, trial.limits.joint_velocity, trial.period,
        control.smoothing, trial.driver.servo_gain or 0.0, control.force_index, control.task.torque_limit,
        exact.joint_position.copy(), seen, at, Reference(*(part.copy() for part in first.reference)), _sight(n, m),
        past, commands, trial.actuation_delay, np.zeros(seen.torque.size),
    )  # fmt: skip


def _sight(joints: int, axes: int) -> Sight:
    return Sight(*(np.empty(size) for size in (joints, joints, axes, axes, 6, joints)))


def _track(rows: int, rig: Rig, memory: int) -> Track:
    """Return room for the record of so many ticks."""
    n, m = rig.seen.joint_position.size, rig.seen.position.size

    def room(width: int) -> Array:
        return np.empty((rows, width))

    state, truth = Measurement(room(n), room(6), room(n)), Sight(*(room(part.size) for part in rig.sight))
    command, reference = Command(room(n), room(n)), Reference(room(m), room(m), room(m), room(m))
    return Track(
        state,
        truth,
        np.empty(rows),
        command,
        room(m),
        room(m),
        room(m),
        reference,
        room(memory),
        np.zeros(2, dtype=np.int64),
    )
