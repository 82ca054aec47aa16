"""A law is a guest: nobody else reads what it writes into its arguments. Compiled or not, on any path of a tick."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import pytest
from helpers.builders import surface, trial
from helpers.in_memory import Nodes, pass_messages
from helpers.whole_trials import CHANNELS, pass_whole
from hilrig_drivers.two_link import TwoLink

from hilrig.core.compiler import kernel
from hilrig.core.interfaces import Law, Task
from hilrig.core.signals import Array, Kinematics, Reference, State
from hilrig.experiment.trial import Trial
from hilrig.kinds.robots.planar_2r import Planar2r

RUINED = 1e3


def arrays_in(value: Any) -> Iterator[Array]:
    """Yield the arrays in nested tuples."""
    if isinstance(value, np.ndarray):
        yield value
    elif isinstance(value, tuple):
        for part in value:
            yield from arrays_in(part)


def ruin(*values: Any) -> None:
    """Write into all arrays that can be written."""
    for array in arrays_in(values):
        with suppress(ValueError):  # read-only
            array[...] = RUINED


@kernel
def compiled_step(parameters: tuple[float, ...], memory: tuple[()], state: State, reference: Reference) -> Array:
    """Push towards the reference; then, if the parameter says so, write into all that was given."""
    force = 200.0 * (reference.position - state.position) + reference.force - 0.1 * state.force
    torque = state.jacobian.T @ force - 0.5 * state.joint_velocity + 0.05 * state.torque
    if parameters[0] != 0.0:
        for row in (
            state.joint_position, state.joint_velocity, state.position, state.velocity, state.force, state.torque,
            reference.position, reference.velocity, reference.acceleration, reference.force,
        ):  # fmt: skip
            row[:] = RUINED
        state.jacobian[:, :] = RUINED
        state.jacobian_rate[:, :] = RUINED
        state.regressor[:, :] = RUINED
    return torque


def plain_step(parameters: tuple[float, ...], memory: tuple[()], state: State, reference: Reference) -> Array:
    """Do the same in plain Python."""
    torque = compiled_step((0.0,), memory, state, reference)
    if parameters[0] != 0.0:
        ruin(state, reference)
    return torque


@dataclass(frozen=True)
class Guest:
    """A controller whose law may write into all that it is given, and so may its start."""

    compiled: bool
    ruins: bool = False

    def start(self, task: Task, state: State) -> Law:
        if self.ruins:
            ruin(task, state)
        return Law(compiled_step if self.compiled else plain_step, (float(self.ruins),), ())


def subject(guest: Guest) -> Trial:
    return trial(controller=guest)


@pytest.mark.parametrize("compiled", [True, False])
@pytest.mark.parametrize("run", [pass_messages, pass_whole])
def test_what_a_law_writes_into_its_arguments_changes_nothing(run: Any, compiled: bool) -> None:
    polite, rude = (run(subject(Guest(compiled, ruins))) for ruins in (False, True))
    assert len(polite.command) > 100
    for channel in CHANNELS:
        assert getattr(rude, channel) == getattr(polite, channel), channel
    assert rude.reason == polite.reason


@pytest.mark.parametrize("on_stale_sample", ["hold", "call"])
@pytest.mark.parametrize("compiled", [True, False])
def test_nor_where_a_sample_is_repeated(compiled: bool, on_stale_sample: str) -> None:
    answers = []
    for ruins in (False, True):
        plain = subject(Guest(compiled, ruins))
        nodes = Nodes(replace(plain, task=replace(plain.task, on_stale_sample=on_stale_sample)), sizes={})
        wrench = np.arange(6.0)
        states = (nodes.state(k, np.array([0.5 + 1e-3 * (k // 3), 1.1]), wrench, fresh=k % 3 == 0) for k in range(12))
        answers.append([nodes.answered(state) for state in states])
    np.testing.assert_equal(answers[1], answers[0])


@pytest.mark.parametrize("compiled", [True, False])
def test_the_trial_is_the_same_for_the_next_law(compiled: bool) -> None:
    shared = subject(Guest(compiled))
    before = pass_messages(shared).command
    pass_messages(replace(shared, controller=Guest(compiled, ruins=True)))
    assert pass_messages(shared).command == before


@dataclass(frozen=True)
class Keeping(Planar2r):
    """A robot that keeps the arrays that it returns."""

    @cached_property
    def kept(self) -> list[Array | Kinematics]:
        return []

    @cached_property
    def model(self) -> Array:
        return super().dynamic_parameters()

    @cached_property
    def largest(self) -> Array:
        return super().torque_limits()

    def dynamic_parameters(self) -> Array:
        return self.model

    def torque_limits(self) -> Array:
        return self.largest

    def kinematics(self, q: Array, rate: Array) -> Kinematics:
        self.kept.append(found := super().kinematics(q, rate))
        return found


def test_what_a_robot_keeps_is_not_given_to_a_law() -> None:
    robot: Any = Keeping((0.345, 0.2), (1.8, 1.1), (-9.81, 0.0))
    model, largest = robot.model.copy(), robot.largest.copy()
    pass_messages(trial(TwoLink(robot, surface()), Guest(compiled=True, ruins=True)))
    np.testing.assert_array_equal(robot.model, model)
    np.testing.assert_array_equal(robot.largest, largest)
    kept = list(arrays_in(tuple(robot.kept)))
    assert len(kept) > 5
    assert not any((array == RUINED).any() for array in kept)
