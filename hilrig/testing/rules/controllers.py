"""Rules for controllers: a law takes its dimensions from the task, and its memory holds everything it remembers."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np

from hilrig import Array, Controller, Law, PerAxis
from hilrig.core.errors import PluginError
from hilrig.core.law_memory import memory_sizes
from hilrig.testing.rule import Broken, noting, require, rule, same
from hilrig.testing.scenario import Scenario, arrays, scenario, step
from hilrig.testing.subject import parameters

MANY = 30
"""Ticks after which a law's memory is no longer empty"""


@rule("controllers", first=True)
def the_law_starts_and_its_step_runs(controller: Controller) -> None:
    """`start` must return a Law of step, parameters and memory, and its `step` must run."""
    with noting("in `start`"):
        law, given = _begun(controller)
    require(isinstance(law, Law), f"`start` returned a {type(law).__name__}")
    require(callable(law.step), f"its `step` is a {type(law.step).__name__}, which cannot be called")
    for k, tick in enumerate(given.ticks):
        with noting(f"in `step`, at tick {k},"):
            law.step(law.parameters, law.memory, *tick)


@rule("controllers")
def dimensions_come_from_the_task(controller: Controller) -> None:
    """On one, two and three axes a law must work, or `start` must refuse the task with a ValueError that says why."""
    for m, where in ((1, "on one axis"), (2, "on two axes"), (3, "on three axes")):
        given = scenario(m)
        try:
            law = controller.start(*_task_and_state(given))
        except ValueError as error:
            require(str(error), f"{where} `start` raised a ValueError without a message")
            continue
        with noting(where):
            for tick in given.ticks[:MANY]:
                shape = np.shape(law.step(law.parameters, law.memory, *tick))
                require(shape == (m,), f"{where} `step` returned an array {shape}")


@rule("controllers")
def torque_is_one_finite_number_for_each_joint(controller: Controller) -> None:
    """`step` must return an array with one finite torque for each joint, at every tick."""
    law, given = _begun(controller)
    for k, tick in enumerate(given.ticks):
        torque = law.step(law.parameters, law.memory, *tick)
        require(isinstance(torque, np.ndarray), f"it returned a {type(torque).__name__} at tick {k}")
        wanted = (tick.state.joint_position.size,)
        require(torque.shape == wanted, f"at tick {k} it returned an array {torque.shape} instead of {wanted}")
        require(torque.dtype == np.float64, f"at tick {k} it returned an array of {torque.dtype}")
        require(np.isfinite(torque).all(), "at tick {} it returned {}", k, torque)


@rule("controllers")
def memory_can_be_recorded(controller: Controller) -> None:
    """The memory must be a NamedTuple of float64 arrays, with names that the record does not use otherwise."""
    law, given = _begun(controller)
    try:
        memory_sizes(law.memory, "")
        for tick in given.ticks[:MANY]:
            step(law, tick)
        memory_sizes(law.memory, "")
    except PluginError as error:
        raise Broken(str(error).removeprefix("controller '': ")) from error


@rule("controllers")
def memory_fields_are_arrays_of_their_own(controller: Controller) -> None:
    """Each field of the memory must be a separate array, new for each law."""
    given = fitting(controller)
    one, two = (controller.start(*_task_and_state(given)) for _ in range(2))
    fields = list(_memory(one).items())
    for i, (name, array) in enumerate(fields):
        for other, second in fields[:i]:
            require(not np.shares_memory(array, second), f"'{other}' and '{name}' are one array")
        for part, source in arrays(given.ticks[0].state):
            require(not np.shares_memory(array, source), f"'{name}' is the array state.{part} itself; copy it")
        require(not np.shares_memory(array, _memory(two)[name]), f"two laws have the same array '{name}'")


@rule("controllers")
def memory_is_written_in_place(controller: Controller) -> None:
    """`step` must write what it remembers into the arrays of the given memory."""
    law, given = _begun(controller)
    before = {name: array.copy() for name, array in _memory(law).items()}
    for tick in given.ticks:
        step(law, tick)
    changed = [name for name, array in _memory(law).items() if not same(array, before[name])]
    require(changed or not before, f"after {len(given.ticks)} ticks all of it is unchanged since the start")


@rule("controllers")
def memory_is_all_that_a_law_remembers(controller: Controller) -> None:
    """A law must remember nothing outside its memory: the record shows all of it.

    A second law with the memory of the first must continue as the first does.
    """
    first, given = _begun(controller)
    for tick in given.ticks[:MANY]:
        step(first, tick)
    again = fitting(controller)
    second = controller.start(*_task_and_state(again))
    for name, array in _memory(first).items():
        _memory(second)[name][...] = array
    for k in range(MANY, len(given.ticks)):
        one, two = step(first, given.ticks[k]), step(second, again.ticks[k])
        require(
            same(one, two),
            "a new law with the memory of another gave {} N m at tick {} where the other gave {}",
            two,
            k,
            one,
        )


@rule("controllers")
def start_only_reads_what_it_is_given(controller: Controller) -> None:
    """`start` must only read the task and the state."""
    given, untouched = fitting(controller), fitting(controller)
    controller.start(*_task_and_state(given))
    _require_unchanged(given, untouched)


@rule("controllers")
def step_only_reads_what_it_is_given(controller: Controller) -> None:
    """`step` must only read the state, the reference and the task.

    The loop records and judges by the same arrays: a law that writes into its reference would change its own score.
    """
    law, given = _begun(controller)
    untouched = fitting(controller)
    for k, tick in enumerate(given.ticks):
        step(law, tick)
        _require_unchanged(given, untouched, k)


@rule("controllers")
def a_law_copies_what_it_keeps(controller: Controller) -> None:
    """A law must copy what it keeps from the state and the reference: their arrays are overwritten at every tick."""
    law, given = _begun(controller)
    expected = [step(law, tick) for tick in given.ticks]
    again = fitting(controller)
    for k, tick in enumerate(again.reusing()):
        if k == 0:
            law = controller.start(again.task, tick.state)
        torque = step(law, tick)
        require(
            same(torque, expected[k]),
            "at tick {}, in arrays used before, it gave {} N m instead of {}",
            k,
            torque,
            expected[k],
        )


@rule("controllers")
def the_same_run_twice_gives_the_same_bits(controller: Controller) -> None:
    """The same states must give the same torques, to the last bit, in every run.

    NumPy's global generator has a different state in each run.
    """
    runs: list[list[Array]] = []
    for seed in (1, 2):
        np.random.seed(seed)
        law, given = _begun(controller)
        runs.append([step(law, tick) for tick in given.ticks])
    for k, (one, two) in enumerate(zip(*runs, strict=True)):
        require(same(one, two), "at tick {} it gave {} N m, and {} N m in the second run", k, one, two)


@rule("controllers")
def two_laws_share_nothing(controller: Controller) -> None:
    """Two laws of one controller must not influence each other: trials are independent."""
    alone, given = _begun(controller)
    expected = [step(alone, tick) for tick in given.ticks]
    one, mine = _begun(controller)
    two, other = _begun(controller)
    for k in range(len(expected)):
        torque = step(one, mine.ticks[k])
        step(two, other.ticks[-1 - k])
        require(
            same(torque, expected[k]),
            "at tick {}, with another law at work, it gave {} N m instead of {}",
            k,
            torque,
            expected[k],
        )


@rule("controllers")
def a_wrong_number_of_values_is_refused_by_name(controller: Any) -> None:
    """`start` must refuse three values of a parameter per axis where there are two axes, by its name."""
    names = [name for name, (hint, _) in parameters(type(controller)).items() if hint == PerAxis]
    for name in names:
        value = np.max(getattr(controller, name))
        several = dataclasses.replace(controller, **{name: (float(value),) * 3})
        try:
            several.start(*_task_and_state(scenario(2)))
        except ValueError as error:
            require(name in str(error), f"for '{name}' it said: {error}")
        else:
            raise Broken(f"three values of '{name}' were taken for two axes; `per_axis` refuses them")


@rule("controllers")
def without_a_model_it_works_or_refuses(controller: Controller) -> None:
    """With a robot that has no dynamic model a law must work, or `start` must refuse with a ValueError that says so."""
    given = scenario(len(fitting(controller).task.axes), model=False)
    try:
        law = controller.start(*_task_and_state(given))
    except ValueError as error:
        require("model" in str(error), f"it said: {error}")
        return
    with noting("without a model"):
        for tick in given.ticks:
            require(np.isfinite(step(law, tick)).all(), "its torque is not finite")


def fitting(controller: Controller) -> Scenario:
    """Return a new scenario on as many axes as the controller takes: two, or else one or three."""
    refusals = []
    for m in (2, 1, 3):
        given = scenario(m)
        try:
            controller.start(*_task_and_state(scenario(m)))
        except ValueError as error:
            refusals.append(f"{m} axes: {error}")
        else:
            return given
    raise Broken(f"it does not start on any number of axes ({'; '.join(refusals)})")


def _begun(controller: Controller) -> tuple[Law, Scenario]:
    given = fitting(controller)
    return controller.start(*_task_and_state(given)), given


def _memory(law: Law) -> dict[str, Array]:
    """Return the arrays of a law's memory by name; none if it has no names."""
    return dict(arrays(law.memory)) if hasattr(law.memory, "_asdict") else {}


def _task_and_state(given: Scenario) -> tuple[Any, Any]:
    return given.task, given.ticks[0].state


def _require_unchanged(given: Scenario, untouched: Scenario, tick: int = 0) -> None:
    """Raise Broken if anything in the task, or in the inputs of a tick, has changed."""
    pairs = {
        "task": (given.task, untouched.task), "task.impedance": (given.task.impedance, untouched.task.impedance),
        "state": (given.ticks[tick].state, untouched.ticks[tick].state),
        "reference": (given.ticks[tick].reference, untouched.ticks[tick].reference),
    }  # fmt: skip
    for where, (now, before) in pairs.items():
        for name, array in arrays(now):
            old = getattr(before, name)
            require(same(array, old), "it changed {}.{} at tick {} from {} to {}", where, name, tick, old, array)
