"""What every control law keeps to, whichever it is and however many axes the task has."""

from __future__ import annotations

import ast
import dataclasses
import inspect
import itertools
import sys
import typing
from typing import Any

import numpy as np
import pytest
from helpers.builders import impedance, parameter_of, reference

from hilrig.core.interfaces import Controller, Law, Task
from hilrig.core.signals import Array, Kinematics, State
from hilrig.kinds.controllers.tde_sliding_mode import TdeSlidingMode
from hilrig.kinds.registry import kinds, load

CONTROLLERS = {kind: load("controllers", kind) for kind in kinds("controllers")}
PERIOD = 1e-3
MASS, GRAVITY = 2.0, 9.81


class Gantry:
    """A robot of m prismatic joints along m task axes: x = q, M = diag(mass), gravity against the last axis.

    theta (3m,): mass, Coulomb and viscous friction of each joint.
    """

    def __init__(self, axes: int) -> None:
        self.m = axes
        self.theta = np.concatenate([np.full(axes, MASS), np.zeros(2 * axes)])

    def kinematics(self, q: Array, rate: Array) -> Kinematics:
        m = self.m
        regressor = np.zeros((2 * m + 1, m, 3 * m))
        regressor[0, m - 1, m - 1] = GRAVITY
        for i in range(m):
            regressor[0, i, m + i] = np.tanh(rate[i] / 5e-3)
            regressor[1 + i, i, 2 * m + i] = 1.0
            regressor[1 + m + i, i, i] = 1.0
        return Kinematics(q.copy(), rate.copy(), np.eye(m), np.zeros((m, m)), regressor)

    def state(self, q: Array, rate: Array, torque: Array) -> State:
        force = np.zeros(self.m)
        force[-1] = max(0.0, 800.0 * q[-1] + 20.0 * rate[-1]) if q[-1] > 0 else 0.0
        at = self.kinematics(q, rate)
        return State(q, rate, *at, force, torque, PERIOD)


def begin(controller: Controller, m: int) -> tuple[Gantry, Task, State, Law]:
    robot = Gantry(m)
    task = Task(PERIOD, ("x", "y", "z")[-m:], impedance(m), robot.theta, np.full(m, 100.0))
    weight = np.zeros(m)
    weight[-1] = MASS * GRAVITY
    state = robot.state(np.zeros(m), np.zeros(m), weight)
    return robot, task, state, controller.start(task, state)


def run(controller: Controller, m: int, ticks: int = 300) -> tuple[Array, Array, Any]:
    """Close the loop around the gantry; return the torques (N, m), the positions (N, m), and the law's memory."""
    robot, _, state, law = begin(controller, m)
    wanted = reference(m, position=np.full(m, 0.01), force=np.full(m, 3.5))
    q, rate, torques, positions = np.zeros(m), np.zeros(m), [], []
    weight = state.torque
    for _ in range(ticks):
        torque = law.step(law.parameters, law.memory, state, wanted)
        torques.append(np.array(torque))
        positions.append(q.copy())
        rate = rate + PERIOD * (np.clip(torque, -100, 100) - weight - state.force) / MASS
        q = q + PERIOD * rate
        state = robot.state(q, rate.copy(), np.clip(torque, -100, 100))
    return np.array(torques), np.array(positions), law.memory


@pytest.fixture(params=CONTROLLERS)
def cls(request: pytest.FixtureRequest) -> type:
    return CONTROLLERS[request.param]


@pytest.mark.parametrize("m", [1, 2, 3])
def test_dimensions_come_from_the_task(cls: type, m: int) -> None:
    """One, two or three axes: the law starts, steps, stays finite, and does something about the error."""
    torques, positions, _ = run(cls(), m)
    assert torques.shape == (300, m)
    assert np.isfinite(torques).all()
    assert np.abs(positions[-1]).max() > 1e-4, "the reference is elsewhere: it moves"
    assert np.abs(positions).max() < 0.1, "and it does not run away"


def test_the_same_run_twice_gives_the_same_bits(cls: type) -> None:
    np.testing.assert_array_equal(run(cls(), 2)[0], run(cls(), 2)[0])


def test_two_laws_of_one_controller_share_nothing(cls: type) -> None:
    """A trial must not learn from the trial before it."""
    controller = cls()
    first = run(controller, 2)[0]
    np.testing.assert_array_equal(run(controller, 2)[0], first)
    _, _, _, one = begin(controller, 2)
    _, _, _, two = begin(controller, 2)
    for a, b in zip(one.memory, two.memory, strict=True):
        assert not np.shares_memory(a, b)


def test_memory_is_named_arrays_of_float64_of_fixed_size(cls: type) -> None:
    _, _, _, law = begin(cls(), 2)
    sizes = [part.shape for part in law.memory]
    _, _, after = run(cls(), 2, 20)
    for name, part, size in zip(after._fields, after, sizes, strict=True):
        assert isinstance(part, np.ndarray), name
        assert part.dtype == np.float64, name
        assert part.shape == size, name
        assert part.size > 0, name
    for i, a in enumerate(after):
        assert not any(np.shares_memory(a, b) for b in after[i + 1 :]), "two fields are one array"


def test_memory_changes_as_the_law_runs(cls: type) -> None:
    _, _, _, law = begin(cls(), 2)
    _, _, after = run(cls(), 2, 20)
    assert any(not np.array_equal(a, b) for a, b in zip(law.memory, after, strict=True))


def test_every_field_of_the_memory_says_what_it_is(cls: type) -> None:
    """A docstring behind each field, with its shape: the report's captions come from there."""
    _, _, _, law = begin(cls(), 2)
    memory = type(law.memory)
    tree = ast.parse(inspect.getsource(sys.modules[memory.__module__]))
    body = next(node.body for node in tree.body if isinstance(node, ast.ClassDef) and node.name == memory.__name__)
    said = {}
    for field, text in itertools.pairwise(body):
        if isinstance(field, ast.AnnAssign) and isinstance(text, ast.Expr) and isinstance(text.value, ast.Constant):
            said[typing.cast(ast.Name, field.target).id] = text.value.value
    assert set(said) == set(memory._fields)
    assert all("(" in text and ")" in text for text in said.values()), said


def test_state_and_reference_are_only_read(cls: type) -> None:
    robot, _, _, law = begin(cls(), 2)
    state = robot.state(np.array([0.01, 0.002]), np.array([0.1, -0.2]), np.array([1.0, 20.0]))
    wanted = reference(2, position=np.array([0.02, 0.0]), velocity=np.array([0.1, 0.0]), force=np.array([0.0, 3.5]))
    before = [np.copy(part) for part in (*state, *wanted)]
    for _ in range(5):
        law.step(law.parameters, law.memory, state, wanted)
    for name, part, copy in zip((*state._fields, *wanted._fields), (*state, *wanted), before, strict=True):
        np.testing.assert_array_equal(part, copy, err_msg=name)


def test_what_it_remembers_is_not_the_state_itself(cls: type) -> None:
    """Memory that is a view of the first state would change under the law's feet."""
    _, _, state, law = begin(cls(), 2)
    assert not any(np.shares_memory(kept, part) for kept in law.memory for part in state)


def test_every_parameter_is_declared_within_its_bounds(cls: type) -> None:
    hints = typing.get_type_hints(cls, include_extras=True)
    default = cls()
    for field in dataclasses.fields(cls):
        parameter = parameter_of(hints[field.name])
        values = np.atleast_1d(getattr(default, field.name))
        if values.dtype.kind not in "fi":
            continue  # a choice between words, or yes and no
        assert parameter is not None, f"{field.name} has no unit, meaning and bounds"
        assert parameter.meaning, field.name
        assert parameter.low < parameter.high, field.name
        assert np.isfinite([parameter.low, parameter.high]).all(), f"{field.name}: a search needs both bounds"
        assert ((parameter.low <= values) & (values <= parameter.high)).all(), field.name


def test_the_docstring_has_equation_and_source(cls: type) -> None:
    text = inspect.getdoc(cls) or ""
    assert "tau = " in text
    assert "Source: " in text


def test_a_parameter_per_axis_must_fit_the_task(cls: type) -> None:
    hints = typing.get_type_hints(cls)
    names = [name for name, hint in hints.items() if hint == float | tuple[float, ...]]
    for name in names:
        with pytest.raises(ValueError, match="3 values where there must be 1 or 2"):
            begin(cls(**{name: (1.0, 1.0, 1.0)}), 2)


def test_laws_that_need_a_model_say_so() -> None:
    """Without nominal parameters a law either works or refuses in words; it does not fail inside."""
    for kind, controller in CONTROLLERS.items():
        robot, task, state, _ = begin(TdeSlidingMode(), 2)
        bare = task._replace(dynamic_parameters=np.zeros(0))
        empty = state._replace(regressor=np.zeros((2 * robot.m + 1, robot.m, 0)))
        refusal = ""
        try:
            law = controller().start(bare, empty)
            assert np.isfinite(law.step(law.parameters, law.memory, empty, reference(2))).all(), kind
        except ValueError as error:
            refusal = str(error)
        assert not refusal or "model" in refusal, f"{kind}: {refusal}"
