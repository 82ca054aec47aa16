"""What hilrig asks of the kinds that come with it, beyond the rules for everybody's."""

from __future__ import annotations

import inspect
import re

import numpy as np
import pytest
from helpers import drivers
from helpers.builders import PERIOD, STILL, arm, begin, surface, torque_command

from hilrig import Array, Law, State
from hilrig.kinds.actuation import Actuation
from hilrig.kinds.registry import kind_names, load_kind
from hilrig.report.internals import memory_documents
from hilrig.testing.records import flawed
from hilrig.testing.scenario import MASS, kinematics, scenario

WALL, DAMPING = 800.0, 20.0
"""N/m, N s/m of the surface at zero along the last axis"""


def run(law: Law, axes: int, ticks: int = 300) -> tuple[Array, Array]:
    """Close the loop around the robot of the scenario; return the torques (N, m) and the positions (N, m)."""
    q, rate, torques, positions = np.zeros(axes), np.zeros(axes), [], []
    first = scenario(axes).ticks[0]
    torque, theta = first.state.torque, scenario(axes).task.dynamic_parameters
    wanted = first.reference._replace(
        position=np.full(axes, 0.01), velocity=np.zeros(axes), acceleration=np.zeros(axes)
    )
    for _ in range(ticks):
        at = kinematics(q, rate)
        force = np.zeros(axes)
        force[-1] = max(0.0, WALL * at.position[-1] + DAMPING * at.velocity[-1]) if at.position[-1] > 0 else 0.0
        state = State(q.copy(), rate.copy(), *at, force, torque, PERIOD)
        torque = np.clip(law.step(law.parameters, law.memory, state, wanted), -100, 100)
        torques.append(torque)
        positions.append(at.position)
        rate = rate + PERIOD * (torque - at.regressor[0] @ theta - at.jacobian.T @ force) / MASS
        q = q + PERIOD * rate
    return np.array(torques), np.array(positions)


@pytest.mark.parametrize("axes", [1, 2, 3])
@pytest.mark.parametrize("kind", kind_names("controllers"))
def test_a_law_does_something_about_the_error_on_any_number_of_axes(kind: str, axes: int) -> None:
    given = scenario(axes)
    at, still = kinematics(np.zeros(axes), np.zeros(axes)), np.zeros(axes)
    weight = at.regressor[0] @ given.task.dynamic_parameters
    law = load_kind("controllers", kind)().start(given.task, State(still, still, *at, still, weight, PERIOD))
    torques, positions = run(law, axes)
    assert torques.shape == (300, axes)
    assert np.isfinite(torques).all()
    assert np.abs(positions[-1] - positions[0]).max() > 1e-4, "the reference is elsewhere: it moves"
    assert np.abs(positions).max() < 0.1, "and it does not run away"


@pytest.mark.parametrize("kind", kind_names("controllers"))
def test_the_docstring_of_a_law_has_equation_and_source(kind: str) -> None:
    text = inspect.getdoc(load_kind("controllers", kind)) or ""
    assert "tau = " in text
    assert "Source: " in text


@pytest.mark.parametrize("kind", kind_names("controllers"))
def test_every_field_of_a_memory_says_what_it_is_and_its_shape(kind: str) -> None:
    """The report's captions come from there."""
    given = scenario(2)
    law = load_kind("controllers", kind)().start(given.task, given.ticks[0].state)
    said = memory_documents(kind)
    assert set(said) == set(law.memory._fields)
    assert all(re.search(r"\([^()]*\)", text) for text in said.values()), said


@pytest.mark.parametrize("kind", kind_names("metrics"))
def test_a_metric_is_defined_in_its_docstring_and_zero_without_errors(kind: str) -> None:
    cls = load_kind("metrics", kind)
    assert "=" in (inspect.getdoc(cls) or "")
    nothing, small = (cls().measure(flawed(scale)) for scale in (0.0, 1.0))
    assert nothing == pytest.approx(dict.fromkeys(small, 0.0), abs=1e-12)
    assert all(value > 1e-6 for value in small.values())


@pytest.mark.parametrize("kind", drivers.KINDS)
def test_a_servo_gives_its_stiffness_times_the_way_to_go(kind: str) -> None:
    """Of 60 N m/rad, 0.1 and -0.05 rad from where it is told to be, at rest, in a period of one step."""
    servo = Actuation("position_servo", stiffness=60.0)
    cls = load_kind("drivers", kind)
    assert cls(arm(), surface()).servo_gain is None
    driver = cls(arm(), surface(), servo, substep=PERIOD)
    assert driver.servo_gain == servo.k_ref
    plant = begin(driver, (0.4, 1.3))
    q = plant.measure(STILL).joint_position
    plant.advance(torque_command((1.5, -0.5), q + np.array([0.1, -0.05])), STILL)
    np.testing.assert_allclose(plant.measure(STILL).applied_torque, (6.0, -3.0), rtol=1e-12)
    plant.close()


@pytest.mark.parametrize("friction", [(0.0, 0.0), (0.05, 0.05)], ids=["direct", "with friction"])
@pytest.mark.parametrize("kind", drivers.KINDS)
def test_an_arm_without_friction_keeps_no_command_either(kind: str, friction: tuple[float, float]) -> None:
    """A plant may take a shorter way without friction; the array of its command is written again at the next tick."""
    plant = begin(load_kind("drivers", kind)(arm(), surface(), coulomb=friction), (0.4, 1.3))
    command = torque_command((1.0, 2.0))
    plant.advance(command, STILL)
    command.torque[:] = 9.0
    np.testing.assert_array_equal(plant.measure(STILL).applied_torque, (1.0, 2.0))
    plant.close()
