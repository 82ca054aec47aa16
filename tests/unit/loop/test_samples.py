"""Samples of the plant: a law is called on fresh ones, and nothing differentiates a repeated one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from helpers.builders import PERIOD, arm, surface, trial
from helpers.in_memory import Nodes
from hilrig_drivers.two_link import TwoLink
from hypothesis import given, settings
from hypothesis import strategies as st

from hilrig.core.interfaces import Law, Task
from hilrig.core.signals import Array, Reference, State
from hilrig.experiment.trial import Trial

Q = np.array([0.5, 1.1])


class Counting:
    """A controller that notes what its law is given, and asks for a torque that grows with every call."""

    def __init__(self) -> None:
        self.states: list[State] = []

    def start(self, task: Task, state: State) -> Law:
        self.states.clear()

        def step(parameters: object, memory: object, state: State, reference: Reference) -> Array:
            self.states.append(state)
            return np.full(2, float(len(self.states)))

        return Law(step, None, ())


def counted(on_stale_sample: str = "hold") -> tuple[Nodes, Counting]:
    """Return the nodes of a trial, and its controller."""
    law = Counting()
    subject: Trial = trial(TwoLink(arm(), surface()), law)
    nodes = Nodes(replace(subject, task=replace(subject.task, on_stale_sample=on_stale_sample)))
    law.states.clear()
    return nodes, law


def test_a_law_is_not_called_on_a_repeated_sample() -> None:
    nodes, law = counted()
    torques = []
    for tick, fresh in enumerate([True, False, False, True, False]):
        command, internals = nodes.answered(nodes.state(tick, Q + 1e-3 * (tick // 3), fresh=fresh))
        assert (command["tick"], internals["tick"]) == (tick, tick)
        torques.append(command["torque"][0])
    assert torques == [1.0, 1.0, 1.0, 2.0, 2.0]
    assert [state.elapsed for state in law.states] == [PERIOD, 3 * PERIOD]


def test_the_reference_goes_on_where_the_sample_is_repeated() -> None:
    nodes, _ = counted()
    given = [nodes.answered(nodes.state(tick, Q, fresh=tick == 0))[1]["reference_force"] for tick in range(3)]
    np.testing.assert_array_equal(given, nodes.controller.arrays.references.force[:3])


def test_a_law_that_is_called_on_repeated_samples_sees_no_standstill() -> None:
    """The joints move by 1 mrad a sample, so their velocity never falls between two samples."""
    nodes, law = counted("call")
    for tick in range(6):
        nodes.answered(nodes.state(tick, Q + 1e-3 * (tick // 2), fresh=tick % 2 == 0))
    assert len(law.states) == 6
    assert [state.elapsed for state in law.states] == pytest.approx([PERIOD] * 6)
    speeds = [state.joint_velocity[0] for state in law.states]
    assert speeds[0] == speeds[1] < speeds[2] == speeds[3] < speeds[4] == speeds[5]


@settings(max_examples=30, deadline=None)
@given(st.lists(st.tuples(st.floats(0.2, 5.0), st.floats(-0.01, 0.01)), min_size=1, max_size=20))
def test_rates_come_from_the_stamps_of_the_samples(steps: list[tuple[float, float]]) -> None:
    """q' += a ((q - q_prev)/T - q') with a = 1 - exp(-2 pi f_c T), T from stamp to stamp, whatever the ticks are."""
    nodes, law = counted()
    cutoff = nodes.trial.task.velocity_cutoff
    stamp, q, expected = 100.0, Q.copy(), np.zeros(2)
    nodes.answered(nodes.state(0, q, stamp=stamp))
    for tick, (periods, change) in enumerate(steps, start=1):
        stamp, q = stamp + periods * PERIOD, q + change
        nodes.answered(nodes.state(tick, q, stamp=stamp))
        share = 1.0 - np.exp(-2.0 * np.pi * cutoff * periods * PERIOD)
        expected = expected + share * (change / (periods * PERIOD) - expected)
        np.testing.assert_allclose(law.states[-1].joint_velocity, expected, rtol=1e-6, atol=1e-9)
        assert law.states[-1].elapsed == pytest.approx(periods * PERIOD, rel=1e-6)
