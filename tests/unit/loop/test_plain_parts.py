"""What drivers, robots and laws in plain Python return: taken as it is meant, or refused by name."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from helpers.builders import arm, surface, trial
from helpers.in_memory import Nodes, memory_of, pass_messages
from hilrig_drivers.two_link import TwoLink

from hilrig.core.errors import PluginError, describe_error
from hilrig.core.interfaces import Law, Task, TrialStart
from hilrig.core.signals import Array, Command, Measurement, PlantDisturbance, State, Truth


class OddPlant:
    """A plain plant that returns something odd from its fifth measurement on."""

    def __init__(self, plant: Any, odd: str, change: Callable[[Any], Any]) -> None:
        self.plant, self.odd, self.change, self.count = plant, odd, change, 0

    def _maybe(self, name: str, value: Any) -> Any:
        return self.change(value) if name == self.odd and (name == "holding_command" or self.count > 4) else value

    def measure(self, disturbance: PlantDisturbance) -> Measurement:
        self.count += 1
        return self._maybe("measure", self.plant.measure(disturbance))

    def truth(self, disturbance: PlantDisturbance) -> Truth:
        return self._maybe("truth", self.plant.truth(disturbance))

    def holding_command(self) -> Command:
        return self._maybe("holding_command", self.plant.holding_command())

    def advance(self, command: Command, disturbance: PlantDisturbance) -> None:
        self.plant.advance(command, disturbance)

    def close(self) -> None:
        self.plant.close()


@dataclass(frozen=True)
class Odd(TwoLink):
    odd: str = ""
    change: Any = None

    def connect(self, start: TrialStart) -> Any:
        return OddPlant(super().connect(start), self.odd, self.change)


def driven(odd: str, change: Callable[[Any], Any]) -> Any:
    return trial(Odd(arm(), surface(), odd=odd, change=change))


@pytest.mark.parametrize(
    ("odd", "change", "words"),
    [
        ("measure", lambda found: None, "measure returned None; it must return a Measurement"),
        ("measure", lambda found: found[:2], "measure returned a tuple; it must return a Measurement"),
        ("measure", lambda found: found._replace(wrench=np.zeros(1)),
         "measure returned wrench as an array of shape (1,); for this robot it must be (6,)"),
        ("measure", lambda found: found._replace(joint_position=0.3),
         "measure returned joint_position as an array of shape (); for this robot it must be (2,)"),
        ("measure", lambda found: found._replace(joint_position=["a", "b"]), "must be an array of real numbers"),
        ("measure", lambda found: found._replace(wrench=np.zeros(6, complex)), "wrench as an array of complex128"),
        ("truth", lambda found: found._replace(velocity=np.zeros(3)), "truth returned velocity as an array of shape"),
        ("truth", lambda found: 3.0, "truth returned a float; it must return a Truth"),
        ("truth", lambda found: found._replace(surface_position="here"), "truth returned surface_position as a str"),
        ("holding_command", lambda found: None, "holding_command returned None; it must return a Command"),
        ("holding_command", lambda found: Command(0.0, 0.0), "holding_command returned torque as an array of shape ()"),
    ],
)  # fmt: skip
def test_what_a_plant_returns_wrong_names_the_driver(odd: str, change: Any, words: str) -> None:
    with pytest.raises(PluginError) as caught:
        pass_messages(driven(odd, change), sizes={})
    assert str(caught.value).startswith("driver Odd: ")
    assert words in str(caught.value)


def test_a_truth_that_is_missing_at_a_tick_is_not_that_of_the_tick_before() -> None:
    nodes = Nodes(driven("truth", lambda found: None))
    truths = []
    for tick in range(8):
        truths.append(nodes.measured(tick)[1]["position"])
        nodes.driver.advance()
    assert np.isfinite(truths[0]).all()
    assert np.isnan(truths[-1]).all()


@dataclass(frozen=True)
class Returns:
    """A law that returns what it is given to return, from its fifth step on."""

    change: Callable[[Array], Any]

    def start(self, task: Task, state: State) -> Law:
        count = []

        def step(parameters: object, memory: object, state: State, reference: object) -> Any:
            count.append(1)
            return self.change(state.torque) if len(count) > 4 else state.torque

        return Law(step, None, ())


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda torque: None, "step returned None; it must be an array of real numbers"),
        (lambda torque: "hello", "step returned a str; it must be an array of real numbers"),
        (lambda torque: ["1.0", "2.0"], "step returned a list; it must be an array of real numbers"),
        (lambda torque: [[1], [2, 3]], "step returned a list, which is no array"),
        (lambda torque: torque * 1j, "step returned an array of complex128; it must be an array of real numbers"),
        (lambda torque: torque[:, None], "an array of shape (2, 1); the robot needs one of shape (2,)"),
    ],
)
def test_what_a_law_returns_wrong_names_the_controller(change: Any, words: str) -> None:
    subject = trial(controller=Returns(change))
    with pytest.raises(PluginError) as caught:
        pass_messages(subject, sizes=memory_of(subject))
    assert str(caught.value).startswith(f"controller '{subject.controller_name}': ")
    assert words in str(caught.value)


def run_dry(torque: Array) -> Array:
    return next(iter(()))


def test_an_iterator_that_runs_dry_in_a_law_is_told_where() -> None:
    """Within a generator, such as a tick, Python turns StopIteration into RuntimeError."""
    subject = trial(controller=Returns(run_dry))
    with pytest.raises(RuntimeError) as caught:
        pass_messages(subject, sizes=memory_of(subject))
    line = run_dry.__code__.co_firstlineno + 1
    assert describe_error(caught.value) == f"StopIteration at test_plain_parts.py:{line}"
